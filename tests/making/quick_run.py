"""A run whose stages take no time: everything round them is as in any other run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tablemap.events import OtherTable, StageFinished, StageStarted
from tablemap.pipeline import Processed
from tablemap.runs import running
from tablemap.stages.odometry import Trajectory
from tests.making import messages as w
from tests.making.models import rectangle_model

Act = Callable[[], None]


def make_recording(folder: Path, name: str = "lap.mcap") -> Path:
    """Write a small drive."""
    path = folder / name
    w.write_drive(path)
    return path


def act_within(
    monkeypatch: pytest.MonkeyPatch, act: Act, *, others: tuple[OtherTable, ...] = ()
) -> None:
    """Let every run find made-up tables, and do something in the middle of it."""

    def process(recording: object, *, record: Callable[[object], None], **_: object) -> Processed:
        record(StageStarted("snapshots", 0))
        act()
        record(StageFinished("snapshots", 0, 0.1))
        stamps = np.array([w.START_NS], dtype=np.int64)
        model = rectangle_model()
        record(model)
        return Processed(model, others, Trajectory(stamps, np.zeros((1, 3))))

    monkeypatch.setattr(running, "_method", lambda _: process)
