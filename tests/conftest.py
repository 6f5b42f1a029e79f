"""What tests share: where the demo and the real recordings are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def demo_recording() -> Path:
    """The recording that the project ships."""
    return ROOT / "recordings" / "demo.mcap"


@pytest.fixture(scope="session")
def real_recordings() -> Path:
    """The folder of real recordings; skips where it is missing."""
    named = os.environ.get("TABLEMAP_REAL_RECORDINGS")
    folder = Path(named) if named else ROOT.parent / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}; set TABLEMAP_REAL_RECORDINGS to their folder")
    return folder
