"""A picture of a review without a screen: the viewer renders in software."""

from __future__ import annotations

import hashlib
import io
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
from rerun.experimental import ViewerClient

from tablemap.errors import ExternalToolError, TablemapError
from tablemap.files import write_whole
from tablemap.paths import AnyPath, as_path
from tablemap.review.viewer.viewer import (
    LOOPBACK,
    first_snapshot,
    free_port,
    launch,
    whole,
)
from tablemap.words import known_name

TABS = (
    "Overview",
    "Views",
    "Odometry",
    "Registration",
    "Pairs",
    "Surface",
    "Legs",
    "Timings",
)
TIMELINES = {"Odometry": "sensor_time", "Pairs": "iteration"}
"""The timeline of each tab; all other tabs use the snapshots."""
LOAD_SECONDS = 90.0
MOST_PICTURES = 15
TRIES = 6


def still(
    path: AnyPath, out: AnyPath, *, tab: str = "Overview", size: tuple[int, int] = (1000, 700)
) -> list[str]:
    """Write a PNG of one tab (or of a tab within one) of a run folder's .rrd.

    It is of the snapshot that the file asks for, and of the end of what has a timeline of its own.

    The case of the tab's name does not count.

    Returns the errors that the views report, one line each. Raises `ExternalToolError` if the
    viewer is missing or cannot draw (it needs a Vulkan driver, such as Debian's
    ``mesa-vulkan-drivers``), and `TablemapError` for an unknown tab or a missing file.
    """
    tab = known_name(tab, TABS)
    with whole(path) as file, _headless(file, size) as client:
        _show_tab(client, tab)
        timeline = TIMELINES.get(tab, "snapshot")
        best = first_snapshot(file) if timeline == "snapshot" else None
        if best is None:
            _show_end(client, timeline)
        else:
            client.set_time(timeline, sequence=best, play_state="paused")
        previous = b""
        for _ in range(MOST_PICTURES):
            picture = _shoot(client)
            digest = hashlib.sha256(picture).digest()
            if digest == previous:
                break
            previous = digest
            time.sleep(0.4)
        write_whole(as_path(out), _smaller(picture))
        views = client.get_state().views
    return [f"{view.name}: {report.summary}" for view in views for report in view.reports]


def _smaller(picture: bytes) -> bytes:
    """Return a PNG in 256 colours: it has a quarter of the size and looks almost the same.

    The colours cover all that are there: by their frequency a legend's few pixels would get others.
    They are mixed where the depth image would fall into bands.
    """
    with PIL.Image.open(io.BytesIO(picture)) as image:
        whole = image.convert("RGB")
        colours = whole.quantize(256, method=PIL.Image.Quantize.MAXCOVERAGE, kmeans=1)
        few = whole.quantize(palette=colours, dither=PIL.Image.Dither.FLOYDSTEINBERG)
        buffer = io.BytesIO()
        few.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


@contextmanager
def _headless(file: Path, size: tuple[int, int]) -> Iterator[ViewerClient]:
    port = free_port()
    window = ["--headless", "--window-size", f"{size[0]}x{size[1]}", "--hide-welcome-screen"]
    viewer = launch(*window, "--bind", LOOPBACK, "--port", str(port), str(file))
    try:
        yield _connected(viewer, port, file)
    finally:
        if viewer.poll() is None:
            os.killpg(viewer.pid, signal.SIGTERM)
        viewer.wait()


def _connected(viewer: subprocess.Popen[bytes], port: int, file: Path) -> ViewerClient:
    deadline = time.monotonic() + LOAD_SECONDS
    while time.monotonic() < deadline:
        if viewer.poll() is not None:
            raise ExternalToolError(
                "the Rerun Viewer ended before it drew anything; it needs a Vulkan driver "
                "(on Debian: apt-get install mesa-vulkan-drivers)."
            )
        try:
            client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
            state = client.get_state()
            if state.recordings and not state.loading:
                return client
        except (ConnectionError, TimeoutError, RuntimeError):
            pass  # not listening yet
        time.sleep(0.2)
    raise ExternalToolError(
        f"the Rerun Viewer did not load the file in {LOAD_SECONDS:.0f} s: {file}"
    )


def _show_tab(client: ViewerClient, tab: str) -> None:
    """Bring the container or view of that name to the front of every row of tabs above it."""
    whole: dict[str, Any] = client.get_blueprint().blueprint
    named: dict[str, list[str]] = {}
    containers: dict[str, dict[str, Any]] = {}
    for path, archetypes in whole.items():
        for kind in ("ContainerBlueprint", "ViewBlueprint"):
            if kind in archetypes:
                named.setdefault(archetypes[kind].get("display_name", ""), []).append(
                    path.lstrip("/")
                )
                if kind == "ContainerBlueprint":
                    containers[path.lstrip("/")] = archetypes[kind]
    tab = known_name(tab, named)
    if tab not in named:
        there = ", ".join(one for one in (*TABS, "Tables") if one in named)
        raise TablemapError(f"expected one of this run's tabs {there}, found {tab!r}.")

    def parent_of(child: str) -> str | None:
        return next((p for p, c in containers.items() if child in c.get("contents", ())), None)

    def above(child: str) -> int:
        parent = parent_of(child)
        return 0 if parent is None else 1 + above(parent)

    child: str | None = min(named[tab], key=above)  # a table's tab has panes of the same names
    while child is not None:
        parent = parent_of(child)
        if parent is not None and containers[parent].get("container_kind") == "Tabs":
            containers[parent]["active_tab"] = child
        child = parent
    client.set_blueprint(whole, of="recording")


def _show_end(client: ViewerClient, name: str) -> None:
    state = client.get_state()
    for recording in state.recordings:
        if recording.store_id != state.active_recording:
            continue
        for timeline in recording.timelines:
            if timeline.name != name or timeline.end is None:
                continue
            if timeline.time_type == "timestamp":
                end = np.datetime64(timeline.end, "ns")
                client.set_time(name, timestamp=end, play_state="paused")
            else:
                client.set_time(name, sequence=timeline.end, play_state="paused")


def _shoot(client: ViewerClient) -> bytes:
    for attempt in range(TRIES):
        try:
            return client.take_screenshot()
        except (ConnectionError, TimeoutError, RuntimeError) as error:
            if attempt == TRIES - 1:
                raise ExternalToolError(f"the Rerun Viewer cannot draw: {error}") from error
            time.sleep(1.0)
    raise AssertionError("unreachable")
