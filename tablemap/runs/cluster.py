"""Many recordings on a Dask cluster whose workers see the same folders as this machine.

Each recording is one task, and the workers write the run folders. If a worker dies, Dask gives its
recording to another worker. That worker marks the run that the first one left behind. If the second
worker dies too, the recording has failed.
"""

from __future__ import annotations

import logging
import queue
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tablemap.archive.manifest import versions
from tablemap.errors import ExternalToolError
from tablemap.events import StageStarted
from tablemap.inputs import AnyInput, Input
from tablemap.runs.jobs import TRIES, Job, Progress, mark_lost, runs_of
from tablemap.runs.running import Outcome, out_of_memory

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT_SECONDS = 10
WORKERLESS_SECONDS = 60.0
GRACE_SECONDS = 30.0
LOOK_SECONDS = 1.0

_one_at_a_time = threading.Lock()
"""Each recording needs its own process, as BLAS threads are set for a whole process."""


@dataclass(frozen=True)
class _ClusterTask:
    """A recording for a worker, with the runs that it had before and its batch."""

    number: int
    recording: Input
    job: Job
    known: frozenset[str]
    batch: str
    source: str


def process_on_cluster(
    recordings: Sequence[AnyInput],
    job: Job,
    progress: Progress,
    *,
    address: str,
    warn: Callable[[str], None],
) -> Iterator[Outcome]:
    """Process recordings by the workers of a scheduler; yield each outcome when it is there.

    ``warn`` takes a sentence about the cluster. A recording whose worker dies is tried once more.
    A recording has failed if no worker is left for it. On an interruption the workers are told, and
    have time to mark their runs. Raises `ExternalToolError` if the scheduler cannot be reached, has
    no workers, or has workers with another version of tablemap.
    """
    with _connected(address) as client:
        _check_workers(client, address, warn)
        yield from _Batch(
            client, address, list(map(Input.of, recordings)), job, progress
        ).outcomes()


class _Batch:
    """The recordings of one call, on the cluster."""

    def __init__(
        self,
        client: Client,
        address: str,
        recordings: Sequence[Input],
        job: Job,
        progress: Progress,
    ) -> None:
        from distributed import Event

        self._client, self._address, self._progress = client, address, progress
        self._recordings = list(recordings)
        batch = f"tablemap-{secrets.token_hex(4)}"
        job = replace(job, output=job.output.absolute())
        self._cancelled = Event(f"{batch}-cancelled", client=client)
        self._ended: queue.SimpleQueue[Future[Outcome]] = queue.SimpleQueue()
        client.subscribe_topic(batch, self._hear)
        self._waiting: dict[Future[Outcome], _ClusterTask] = {}
        for number, recording in enumerate(recordings):
            known = frozenset(run.manifest.run_id for run in runs_of(recording, job.output))
            task = _ClusterTask(
                number, recording.absolute(), job, known, batch, _source(versions())
            )
            future = client.submit(_process, task, key=f"{batch}-{number}", pure=False)
            self._waiting[future] = task
        for future in list(self._waiting):
            future.add_done_callback(self._ended.put)

    def outcomes(self) -> Iterator[Outcome]:
        try:
            while self._waiting:
                with suppress(queue.Empty):
                    future = self._ended.get(timeout=LOOK_SECONDS)
                    yield self._outcome(future, self._waiting.pop(future))
                    continue
                if trouble := self._trouble():
                    for task in self._waiting.values():
                        yield self._failed(task, f"{trouble} {task.recording}")
                    self._waiting.clear()
        finally:
            if self._waiting:
                self._cancel()

    def _hear(self, event: tuple[float, Any]) -> None:
        number, stage, index = event[1]
        self._progress(self._recordings[number], StageStarted(stage, index))

    def _outcome(self, future: Future[Outcome], task: _ClusterTask) -> Outcome:
        try:
            outcome: Outcome = future.result(timeout=GRACE_SECONDS)
        except Exception as error:  # whatever it is, the other recordings go on
            return self._failed(task, _sentence(error, task))
        return replace(outcome, recording=self._recordings[task.number])

    def _failed(self, task: _ClusterTask, error: str) -> Outcome:
        left = mark_lost(task.recording, task.job.output, error, known=task.known)
        recording = self._recordings[task.number]
        return Outcome(recording, left[0] if left else None, "failed", error, None)

    def _trouble(self) -> str | None:
        """Return why no further outcome can come, if that has been so for a while."""
        deadline = time.monotonic() + WORKERLESS_SECONDS
        while time.monotonic() < deadline and self._ended.empty():
            if self._client.status in ("closing", "closed"):
                return f"the scheduler at {self._address} is gone:"
            with suppress(OSError, TimeoutError):
                if self._client.nthreads():
                    return None
            time.sleep(LOOK_SECONDS)
        return None if not self._ended.empty() else f"no worker is left at {self._address}:"

    def _cancel(self) -> None:
        """Tell the workers to stop; busy ones get time to mark their runs."""
        with suppress(OSError, TimeoutError):
            self._cancelled.set()
            deadline = time.monotonic() + GRACE_SECONDS
            while time.monotonic() < deadline and not all(f.done() for f in self._waiting):
                time.sleep(0.1)
            self._client.cancel(list(self._waiting), force=True)
        for task in self._waiting.values():
            mark_lost(task.recording, task.job.output, "interrupted", known=task.known)


def _process(task: _ClusterTask) -> Outcome:
    """Process one recording (in a worker)."""
    from distributed import Event, get_worker

    worker, cancelled = get_worker(), Event(f"{task.batch}-cancelled")
    recording, output = task.recording, task.job.output
    interrupted = Outcome(recording, None, "failed", "interrupted", None)
    if _source(versions()) != task.source:
        error = f"the worker {worker.address} has another tablemap; install the same: {recording}"
        return Outcome(recording, None, "failed", error, None)
    lost = mark_lost(recording, output, "its worker died", known=task.known)
    if len(lost) >= TRIES:
        error = f"its worker died {TRIES} times; is there enough memory? {recording}"
        return Outcome(recording, lost[0], "failed", error, None)
    looked = 0.0

    def progress(event: object) -> None:
        nonlocal looked
        if isinstance(event, StageStarted):
            worker.log_event(task.batch, (task.number, event.name, event.index))
        if time.monotonic() - looked > LOOK_SECONDS:
            looked = time.monotonic()
            if cancelled.is_set():
                raise KeyboardInterrupt

    with _one_at_a_time:
        if cancelled.is_set():
            return interrupted
        try:
            return task.job(recording, progress)
        except KeyboardInterrupt:  # it would end the worker, which is not ours
            return interrupted


def _sentence(error: Exception, task: _ClusterTask) -> str:
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return f"its worker died each time; is there enough memory? {task.recording}"
    if isinstance(error, MemoryError):
        return out_of_memory(task.recording)
    if isinstance(error, ModuleNotFoundError) and "tablemap" in str(error):
        return f"a worker has no tablemap; install the same there: {task.recording}"
    return f"the cluster has not processed it ({type(error).__name__}: {error}): {task.recording}"


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    """Connect to a scheduler, without the messages of Dask itself."""
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address
        from distributed.comm.registry import get_backend
    except ImportError as error:
        raise ExternalToolError(
            "--scheduler needs Dask, which is not installed: pip install distributed"
        ) from error

    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        try:
            get_backend(parse_address(address)[0])  # a client that does not know it never closes
            client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False, name="tablemap")
        except (OSError, ValueError, TimeoutError) as error:
            raise ExternalToolError(
                f"no Dask scheduler answers ({error}); start one with `dask scheduler`, and "
                f"workers with `dask worker ADDRESS --nthreads 1`: {address}"
            ) from error
        try:
            yield client
        finally:
            client.close(timeout=CONNECT_SECONDS)
    finally:
        logger.setLevel(level)


def _check_workers(client: Client, address: str, warn: Callable[[str], None]) -> None:
    """Refuse a cluster without workers, or with another version of tablemap."""
    threads = client.nthreads()
    if not threads:
        raise ExternalToolError(
            "the Dask scheduler has no workers; start some with "
            f"`dask worker {address} --nthreads 1`: {address}"
        )
    found = client.run(_versions_there(), on_error="return")
    ours = versions()
    for worker, theirs in found.items():
        if not isinstance(theirs, dict):
            raise ExternalToolError(
                f"the worker has no tablemap ({theirs}); install version {ours['tablemap']} "
                f"there: {worker}"
            )
        if _source(theirs) != _source(ours):
            raise ExternalToolError(
                f"the worker has another tablemap than this machine: expected {_source(ours)}, "
                f"found {_source(theirs)}; install the same there: {worker}"
            )
    if most := max(threads.values()) - 1:
        warn(
            f"a worker takes one recording at a time, and one has {most + 1} threads; start them "
            "with `dask worker --nthreads 1`, several on a machine"
        )


def _versions_there() -> Callable[[], dict[str, str]]:
    """Return a function that reads a worker's versions.

    It is sent by value, since the worker may have no tablemap.
    """

    def look() -> dict[str, str]:
        from tablemap.archive.manifest import versions

        return versions()

    return look


def _source(found: dict[str, str]) -> str:
    return f"{found.get('tablemap', 'unknown')} ({found.get('tablemap source', 'unknown')})"
