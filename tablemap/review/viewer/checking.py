"""Check of an .rrd by Rerun's own tool."""

from __future__ import annotations

import subprocess
from pathlib import Path

from tablemap.errors import ExternalToolError
from tablemap.review.viewer.viewer import rrd_tool

MOST_SECONDS = 600


def damage_of(file: Path) -> str | None:
    """Return what `rerun rrd verify` finds wrong with an .rrd, in one line; None if nothing.

    Raises `ExternalToolError` if the tool is missing or does not end.
    """
    try:
        done = rrd_tool("verify", file, seconds=MOST_SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ExternalToolError(f"`rerun rrd verify` cannot be run ({error}): {file}") from error
    if done.returncode == 0:
        return None
    said = [line.strip() for line in (done.stderr + done.stdout).splitlines() if line.strip()]
    return said[-1] if said else f"`rerun rrd verify` ended with {done.returncode}"
