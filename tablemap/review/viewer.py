"""The Rerun Viewer as a program beside us, on this machine alone."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

from tablemap.errors import ExternalToolError, TablemapError

LOOPBACK = "127.0.0.1"
START_SECONDS = 2.0


def viewer_environment() -> dict[str, str]:
    """Return our environment, with the viewer's usage statistics off."""
    return {**os.environ, "CI": "1"}


def viewer_program() -> Path:
    """Return the viewer that came with the rerun package.

    Raises `ExternalToolError` where there is none.
    """
    found = importlib.util.find_spec("rerun_cli")
    folder = Path(found.origin).parent if found and found.origin else None
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    if folder is None or not (folder / name).is_file():
        raise ExternalToolError(
            "the Rerun Viewer is not installed; install it with `pip install rerun-sdk`."
        )
    return folder / name


def review_file(path: Path) -> Path:
    """Return the .rrd of a run folder, or the file itself.

    Raises `TablemapError` where there is none.
    """
    file = path / "run.rrd" if path.is_dir() else path
    if not file.is_file():
        raise TablemapError(f"expected a run folder or an .rrd, found neither: {path}")
    return file


def open_viewer(path: Path) -> subprocess.Popen[bytes]:
    """Open a run folder's .rrd in the native viewer, and return its process.

    Raises `ExternalToolError` where the viewer is missing or ends at once (no screen, no graphics
    driver), and `TablemapError` where there is no .rrd.
    """
    file = review_file(path)
    command = [str(viewer_program()), "--bind", LOOPBACK, "--port", "auto", str(file)]
    try:
        viewer = subprocess.Popen(
            command,
            env=viewer_environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
    except OSError as error:
        raise ExternalToolError(f"the Rerun Viewer cannot be started: {error}") from error
    try:
        _, said = viewer.communicate(timeout=START_SECONDS)
    except subprocess.TimeoutExpired:
        return viewer
    if viewer.returncode != 0:
        lines = [line for line in said.decode(errors="replace").splitlines() if line.strip()]
        last = lines[-1] if lines else f"exit code {viewer.returncode}"
        raise ExternalToolError(
            f"the Rerun Viewer ended at once ({last}); is there a screen? The file is {file}"
        )
    return viewer
