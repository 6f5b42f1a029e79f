"""A live run in the viewer: another process passes on the growing .rrd, and the run never waits."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from tablemap.errors import ExternalToolError
from tablemap.review.viewer.viewer import LOOPBACK, launch, listens, stop

PORT = 9876
"""The viewer's default port."""
START_SECONDS = 2.0
POLL_SECONDS = 0.2
LAST_SECONDS = 2.0
BLOCK = 1 << 20


def start_viewer(port: int = PORT) -> None:
    """Start a viewer, unless one listens already.

    Raises `ExternalToolError` if there is none, or it ends at once (no screen).
    """
    if listens(port):
        return
    viewer = launch("--bind", LOOPBACK, "--port", str(port), "--expect-data-soon")
    deadline = time.monotonic() + START_SECONDS
    # The viewer listens before it opens a screen: if it still runs then, it has found one.
    time.sleep(POLL_SECONDS)
    while time.monotonic() < deadline:
        if viewer.poll() is not None:
            raise ExternalToolError("the Rerun Viewer ended at once; is there a screen?")
        if listens(port):
            return
        time.sleep(0.05)
    stop(viewer)
    raise ExternalToolError(f"the Rerun Viewer did not start within {START_SECONDS:.0f} s.")


@contextmanager
def followed(file: Path, *, port: int = PORT) -> Iterator[None]:
    """Pass the growing .rrd on to the viewer within the context.

    A separate program feeds the viewer: if the viewer is closed or hangs, the run is not affected.
    """
    feeder = launch("--port", str(port), "-", stdin=subprocess.PIPE)
    ended = threading.Event()
    assert feeder.stdin is not None
    feed = threading.Thread(target=_feed, args=(file, feeder.stdin, ended), daemon=True)
    feed.start()
    try:
        yield
    finally:
        ended.set()
        feed.join(LAST_SECONDS)
        try:
            feeder.wait(LAST_SECONDS)
        except subprocess.TimeoutExpired:
            stop(feeder)


def _feed(file: Path, pipe: IO[bytes], ended: threading.Event) -> None:
    """Copy the file as it grows, and the rest after its end; stop if nobody reads."""
    try:
        with pipe:
            while not file.exists():
                if ended.wait(POLL_SECONDS):
                    return
            with file.open("rb") as source:
                is_last = False
                while not is_last:
                    is_last = ended.wait(POLL_SECONDS)
                    while block := source.read(BLOCK):
                        pipe.write(block)
                        pipe.flush()
    except OSError:
        pass  # The viewer was closed: the file has it all.
