"""Many recordings in processes of this machine.

Each worker is its own process and takes one recording at a time. If a worker dies (killed, out of
memory, a crash in a library), the others go on, and its recording is tried once more in a new
worker.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from tablemap.events import StageStarted
from tablemap.imports import collect_rarely, hide_pandas, keep_memory, without_scipy_notes
from tablemap.inputs import AnyInput, Input
from tablemap.interrupts import Interrupts, held_back, let_through
from tablemap.runs.jobs import TRIES, Job, Progress, mark_lost, runs_of
from tablemap.runs.running import Outcome

GRACE_SECONDS = 20.0
SINGLE_THREADED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def process_many(
    recordings: Sequence[AnyInput], job: Job, progress: Progress, *, jobs: int
) -> Iterator[Outcome]:
    """Process recordings with at most ``jobs`` processes; yield each outcome when it is there.

    A recording whose worker dies is tried once more; then it has failed. On an interruption the
    workers are interrupted too, and have time to mark their runs.
    """
    for name in SINGLE_THREADED:  # as many processes as cores leave no core for more threads
        os.environ.setdefault(name, "1")
    waiting = deque(
        _Task(recording, known=frozenset(r.manifest.run_id for r in runs_of(recording, job.output)))
        for recording in map(Input.of, recordings)
    )
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
                    left = mark_lost(lost.recording, job.output, error, known=lost.known)
                    if lost.tries < TRIES:
                        waiting.appendleft(lost)
                    else:
                        error = f"{error} {TRIES} times; is there enough memory? {lost.recording}"
                        last = left[0] if left else None
                        yield Outcome(lost.recording, last, "failed", error, None)
    finally:
        for worker in workers:
            worker.stop()
        deadline = time.monotonic() + GRACE_SECONDS
        for worker in workers:
            worker.join(deadline)
            if worker.task:
                lost = worker.lose()
                mark_lost(lost.recording, job.output, "interrupted", known=lost.known)


@dataclass(frozen=True)
class _Task:
    """A recording, the runs that it had before, and how often it was started."""

    recording: Input
    known: frozenset[str]
    tries: int = 0


class _Worker:
    """A process that gets recordings one by one, and our end of the pipe to it."""

    def __init__(self, job: Job) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_work, args=(theirs, job))
        resource_tracker.ensure_running()  # beginning it would let the signals through again
        with held_back():
            self._process.start()
        theirs.close()
        self.task: _Task | None = None

    @property
    def handles(self) -> list[Connection[object, object] | int]:
        return [self._pipe, self._process.sentinel]

    @property
    def recording(self) -> Input:
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
        self.task = replace(task, tries=task.tries + 1)
        with suppress(OSError):  # the worker has died; the next check will notice it
            self._pipe.send(task.recording)

    def hear(self) -> Iterator[object]:
        """Yield the messages of the worker; after an outcome the worker is free."""
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
    """Process the recordings from the pipe until it is closed (in the worker's process)."""

    def progress(event: object) -> None:
        if isinstance(event, StageStarted):
            try:
                pipe.send(event)
            except OSError:  # our parent has ended, or wants us to
                raise KeyboardInterrupt from None

    hide_pandas()
    without_scipy_notes()
    collect_rarely()
    keep_memory()
    with suppress(KeyboardInterrupt, EOFError, OSError):
        # They may come by the terminal and by our parent; one must not disturb the other's marks.
        Interrupts(grace_seconds=float("inf")).listen()
        let_through()
        while True:
            recording = pipe.recv()
            if not isinstance(recording, Input):
                raise TypeError(f"expected a recording, found {recording!r}")
            try:
                outcome = job(recording, progress)
            except Exception as error:  # a defect met by one recording must not stop the others
                outcome = Outcome.of_defect(recording, error)
            pipe.send(outcome)
