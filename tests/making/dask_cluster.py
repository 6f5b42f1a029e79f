"""A Dask cluster on this machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
START_SECONDS = 60
WORKER = "from distributed.cli.dask_worker import main; main()"
SCHEDULER = "from distributed.cli.dask_scheduler import main; main()"


@contextmanager
def started(code: str, *arguments: object) -> Iterator[subprocess.Popen[bytes]]:
    """Run one of Dask's programs for as long as the context lasts."""
    process = subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        start_new_session=True,
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def scheduler(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Start a scheduler; gives its address and process."""
    file = folder / "scheduler.json"
    loopback = ("--host", "127.0.0.1", "--port", 0, "--no-dashboard")
    with started(SCHEDULER, *loopback, "--scheduler-file", file) as process:
        deadline = time.monotonic() + START_SECONDS
        while not file.is_file() or not file.read_text().strip():
            assert time.monotonic() < deadline
            assert process.poll() is None
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], process


def worker(
    address: str, *arguments: object, code: str = WORKER
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """Return the context of a worker that is not restarted when it dies."""
    options = ("--nthreads", 1, "--no-nanny", "--no-dashboard", "--death-timeout", 60)
    return started(code, address, *options, *arguments)


def wait_for_workers(address: str, count: int) -> None:
    """Wait until so many workers are there."""
    from distributed import Client

    with Client(address, timeout=10, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=START_SECONDS)


@contextmanager
def workers(address: str, count: int) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Start workers and wait until they are there."""
    with ExitStack() as stack:
        processes = [stack.enter_context(worker(address)) for _ in range(count)]
        wait_for_workers(address, count)
        yield processes
