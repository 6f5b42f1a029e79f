"""What importing a part of the package costs."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.parametrize("module", ["tablemap", "tablemap.cli"])
def test_importing_starts_nothing_heavy(module: str) -> None:
    """``tablemap --help`` answers at once."""
    heavy = {"open3d", "rerun", "kiss_icp", "scipy", "shapely", "mcap", "numpy"}
    code = f"import sys, {module}; print(*(set(sys.modules) & {heavy!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("module", ["tablemap.pipeline", "tablemap.runs.running"])
def test_the_pipeline_loads_open3d_and_rerun_only_when_needed(module: str) -> None:
    """They take seconds to import."""
    code = f"import sys, {module}; print(*(set(sys.modules) & {{'open3d', 'rerun', 'kiss_icp'}}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
