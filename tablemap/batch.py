"""Many recordings on this machine: which ones, which are done already, and the rest in parallel.

Each worker is a process of its own that takes one recording at a time. One that dies (killed, out
of memory, a crash in a library) takes nothing else with it: its recording is tried once more in a
new one.
"""

from __future__ import annotations

import glob
import os
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from tablemap.archive.folder import LEAVE_A_MODEL, RunFolder, load_run, versions
from tablemap.config import Config, dump_config
from tablemap.errors import ConfigError, TablemapError
from tablemap.record import StageStarted
from tablemap.running import Follow, Method, Outcome, run

if TYPE_CHECKING:
    from tablemap.pipeline import Tables

TRIES = 2
GRACE_SECONDS = 20.0
SINGLE_THREADED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")

Progress = Callable[[Path, StageStarted], None]


@dataclass(frozen=True)
class Job:
    """How recordings are processed: `tablemap.running.run`'s arguments."""

    output: Path
    config: Config
    method: Method = "tablemap"
    tables: Tables = "best"
    follow: Follow = nullcontext

    def __call__(self, recording: Path, progress: Callable[[object], None]) -> Outcome:
        """Process one recording."""
        return run(
            recording,
            output=self.output,
            config=self.config,
            method=self.method,
            tables=self.tables,
            progress=progress,
            follow=self.follow,
        )


def expand(arguments: Sequence[str]) -> list[Path]:
    """Return the recordings that are named: paths, globs and ``@list.txt``, each once.

    A list has a path or glob a line, relative to where one works; blank lines and those that begin
    with ``#`` count for nothing. A glob that matches nothing stands for itself, as in a shell.
    Raises `ConfigError` where a list cannot be read.
    """
    names: list[str] = []
    for argument in arguments:
        if not argument.startswith("@") or Path(argument).exists():
            names.append(argument)
            continue
        try:
            lines = Path(argument[1:]).read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(
                f"the list of recordings cannot be read ({error}): {argument[1:]}"
            ) from error
        names += [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    paths: dict[Path, None] = {}
    for name in names:
        matches = [] if Path(name).exists() else sorted(_glob(name))
        paths.update(dict.fromkeys(map(Path, matches or [name])))
    return list(paths)


def _glob(pattern: str) -> list[str]:
    return glob.glob(pattern, recursive=True)  # noqa: PTH207 - Path's takes no absolute pattern


def done_already(recording: Path, job: Job) -> RunFolder | None:
    """Return the newest run that left a model of the same bytes by the same config and versions.

    The recording is read (for its SHA-256) only where all the rest is the same.
    """
    from tablemap.recording import sha256

    if not recording.is_file():
        return None
    digest = None
    for held in _runs_of(recording, job.output):
        manifest = held.manifest
        if (
            manifest.status not in LEAVE_A_MODEL
            or (manifest.method, manifest.tables) != (job.method, job.tables)
            or manifest.versions != versions()
            or manifest.recording.size != recording.stat().st_size
            or not (held.path / "table.json").is_file()
            or not _has_text(held.path / "config.toml", dump_config(job.config))
        ):
            continue
        digest = digest or sha256(recording)
        if manifest.recording.sha256 == digest:
            return held
    return None


def process_many(
    recordings: Sequence[Path], job: Job, *, jobs: int, progress: Progress
) -> Iterator[Outcome]:
    """Process recordings over at most ``jobs`` processes; yield each outcome as it comes.

    A recording whose worker dies is tried once more, then it has failed. On an interruption the
    workers are interrupted too, and given time to mark their runs.
    """
    for name in SINGLE_THREADED:  # as many processes as cores leave no core for more threads
        os.environ.setdefault(name, "1")
    waiting = deque(_Task(recording) for recording in recordings)
    workers = [_Worker(job) for _ in range(min(jobs, len(waiting)))]
    try:
        while waiting or any(worker.task for worker in workers):
            for number, worker in enumerate(workers):
                if waiting and not worker.task:
                    if not worker.is_alive():
                        worker = workers[number] = _Worker(job)
                    worker.give(waiting.popleft())
            wait([handle for worker in workers if worker.task for handle in worker.handles])
            for worker in workers:
                for said in worker.hear():
                    if isinstance(said, Outcome):
                        yield said
                    elif isinstance(said, StageStarted):
                        progress(worker.recording, said)
                if worker.task and not worker.is_alive():
                    lost = worker.lose()
                    error = f"its worker died ({worker.end})"
                    left = _mark_lost(lost, job.output, error)
                    if lost.tries < TRIES:
                        waiting.appendleft(lost)
                    else:
                        error = f"{error} {TRIES} times; is there enough memory? {lost.recording}"
                        yield Outcome(lost.recording, left, "failed", error, None)
    finally:
        for worker in workers:
            worker.stop()
        deadline = time.monotonic() + GRACE_SECONDS
        for worker in workers:
            worker.join(deadline)
            if worker.task:
                _mark_lost(worker.lose(), job.output, "interrupted")


@dataclass(frozen=True)
class _Task:
    """A recording, how often it was begun, and when it was last."""

    recording: Path
    tries: int = 0
    begun: datetime | None = None


class _Worker:
    """A process that is given recordings one by one, and our end of the pipe to it."""

    def __init__(self, job: Job) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_work, args=(theirs, job))
        self._process.start()
        theirs.close()
        self.task: _Task | None = None

    @property
    def handles(self) -> list[Connection[object, object] | int]:
        return [self._pipe, self._process.sentinel]

    @property
    def recording(self) -> Path:
        if self.task is None:
            raise RuntimeError("the worker has no recording")
        return self.task.recording

    @property
    def end(self) -> str:
        self._process.join()
        code = self._process.exitcode or 0
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def is_alive(self) -> bool:
        return self._process.is_alive()

    def give(self, task: _Task) -> None:
        self.task = replace(task, tries=task.tries + 1, begun=datetime.now(UTC))
        with suppress(OSError):  # it has died meanwhile, as the next look at it will show
            self._pipe.send(task.recording)

    def hear(self) -> Iterator[object]:
        """Yield what the worker has said; with its outcome it is free."""
        try:
            while self._pipe.poll():
                said = self._pipe.recv()
                yield said
                if isinstance(said, Outcome):
                    self.task = None
        except (EOFError, OSError):
            self._process.join(GRACE_SECONDS)

    def lose(self) -> _Task:
        if self.task is None:
            raise RuntimeError("the worker has no recording")
        lost, self.task = self.task, None
        return lost

    def stop(self) -> None:
        """Let an idle worker end; interrupt one that is busy."""
        if self.task:
            self._process.terminate()
        self._pipe.close()

    def join(self, deadline: float) -> None:
        self._process.join(max(0.1, deadline - time.monotonic()))
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _work(pipe: Connection[object, object], job: Job) -> None:
    """Process what comes through the pipe until it is closed (in a process of its own)."""

    def interrupt(_signal: int, _frame: FrameType | None) -> None:
        # Both may come, by the terminal and by our parent; one must not disturb the other's marks.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)

    def progress(event: object) -> None:
        if isinstance(event, StageStarted):
            pipe.send(event)

    with suppress(KeyboardInterrupt, EOFError, OSError):
        while True:
            recording = pipe.recv()
            if not isinstance(recording, Path):
                raise TypeError(f"expected a path, found {recording!r}")
            try:
                outcome = job(recording, progress)
            except Exception as error:  # a defect met by one recording must not stop the others
                sentence = f"this is a defect of tablemap: {type(error).__name__}: {error}"
                outcome = Outcome(recording, None, "failed", sentence, None)
            pipe.send(outcome)


def _runs_of(recording: Path, output: Path) -> list[RunFolder]:
    """Return the runs of recordings of that name, newest first."""
    found = []
    for path in sorted((output / recording.stem).glob("*/manifest.json"), reverse=True):
        if not path.parent.is_symlink():
            with suppress(TablemapError):  # what cannot be read cannot be what is sought
                found.append(RunFolder(path.parent, load_run(path.parent).manifest))
    return found


def _has_text(file: Path, text: str) -> bool:
    try:
        return file.read_text(encoding="utf-8") == text
    except (OSError, UnicodeDecodeError):
        return False


def _mark_lost(task: _Task, output: Path, error: str) -> RunFolder | None:
    """Let the run that a dead worker has left behind say so, and return it."""
    for left in _runs_of(task.recording, output):
        manifest = left.manifest
        if (
            manifest.status == "running"
            and manifest.recording.path == str(task.recording.resolve())
            and task.begun is not None
            and datetime.fromisoformat(manifest.started) >= task.begun.replace(microsecond=0)
        ):
            with suppress(TablemapError):
                left.finish("interrupted", error=error)
            return left
    return None
