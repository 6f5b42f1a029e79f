"""The method on one page: from a recording to the model of a table."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cache, partial
from typing import Literal

from threadpoolctl import threadpool_limits

from tablemap.config import Config
from tablemap.errors import EstimationError
from tablemap.events import OtherTable, Record, StageFinished, StageStarted, ignore, of_table
from tablemap.model import TableModel
from tablemap.recording import Recording
from tablemap.stages.assembly import assemble
from tablemap.stages.calibration import calibrate
from tablemap.stages.crosscheck import admitted_legs, corrected, cross_check
from tablemap.stages.legs import Legs, find_legs
from tablemap.stages.legs.adjoining import find_adjoining, without
from tablemap.stages.odometry import Trajectory, estimate_odometry
from tablemap.stages.outline import Outline, find_edges
from tablemap.stages.registration import register
from tablemap.stages.segmentation import Segmentation, segment
from tablemap.stages.snapshots import take_snapshots
from tablemap.stages.surface import Surface, fit_surface

STAGES = (
    "snapshots",
    "calibration",
    "segmentation",
    "odometry",
    "registration",
    "outline",
    "surface",
    "legs",
)

Tables = Literal["best", "all"] | tuple[float, float]
"""Which table: the best seen, all of them, or the one nearest to a place in the fixed frame."""


@dataclass(frozen=True, eq=False)
class Processed:
    """A recording's outcome: the chosen table, the others where all were asked for, the drive."""

    model: TableModel
    others: tuple[OtherTable, ...]
    trajectory: Trajectory


def process(
    recording: Recording, *, config: Config, tables: Tables = "best", record: Record = ignore
) -> Processed:
    """Turn a recording into the model of its table.

    Every result and intermediate step goes to ``record`` as it arises. Raises `RecordingError` or
    `EstimationError` where there is no model to be had.
    """
    # One thread: faster round small solves, and the same sums in the same order on every run.
    with threadpool_limits(limits=1):
        return _process(recording, config, tables, record)


def _process(recording: Recording, config: Config, tables: Tables, record: Record) -> Processed:
    stage = stages(record)

    with stage("snapshots"):
        taken = take_snapshots(recording, config=config.snapshots)
        record(taken)

    with stage("calibration"):
        calibration = calibrate(taken.snapshots, config=config.calibration)
        record(calibration)
        snapshots = calibration.snapshots

    with stage("segmentation"):
        near = tables if isinstance(tables, tuple) else None
        segmentation = segment(snapshots, config=config.segmentation, near=near, record=record)
        record(segmentation)

    with stage("odometry"):
        odometry = estimate_odometry(recording, snapshots, config=config.odometry, record=record)
        record(odometry)

    @cache
    def edges(segmentation: Segmentation) -> Outline:
        # Within each view, so before its stage too: without a laser they are what is registered.
        return find_edges(snapshots, segmentation, config=config.outline, calibration=calibration)

    with stage("registration"):
        registration = register(
            recording,
            snapshots,
            odometry,
            edges=partial(edges, segmentation),
            config=config.registration,
            record=record,
        )
        record(registration)

    def model(segmentation: Segmentation, record: Record) -> TableModel:
        def fitted(outline: Outline) -> Surface:
            surface = fit_surface(outline, registration, config=config.surface, seed=config.seed)
            record(surface)
            return surface

        def carried(surface: Surface) -> Legs:
            return find_legs(recording, snapshots, registration, surface, config=config.legs)

        with stage("outline"):
            outline = edges(segmentation)
            record(outline)

        with stage("surface"):
            surface = fitted(outline)

        with stage("legs"):
            legs = carried(surface)
            adjoining = find_adjoining(surface, legs, near=near)
            if adjoining is not None:
                outline = without(outline, adjoining, registration.map_from_base)
                surface = fitted(outline)
                legs = carried(surface)
            cross = cross_check(
                outline, surface, registration, legs.legs, snapshots, config=config.crosscheck
            )
            record(cross)
            if cross.is_found:
                # What the camera saw is moved to where the laser asks it to be, and fitted again.
                outline = corrected(outline, cross)
                surface = fitted(outline)
                legs = carried(surface)
            legs = admitted_legs(legs, cross, surface, registration)
            record(legs)

        return assemble(
            recording,
            taken,
            calibration,
            segmentation,
            odometry,
            registration,
            outline,
            surface,
            cross,
            legs,
        )

    chosen = model(segmentation, record)
    record(chosen)
    others: list[OtherTable] = []
    if tables == "all":
        beside = [candidate for candidate in segmentation.candidates if not candidate.chosen]
        for number, candidate in enumerate(beside, start=1):
            try:
                if candidate.reason is not None:
                    raise EstimationError(f"it is hardly a table: {candidate.reason}")
                other = segment(snapshots, config=config.segmentation, candidate=candidate)
                others.append(OtherTable(number, model(other, of_table(number, record))))
            except EstimationError as error:
                others.append(OtherTable(number, str(error)))
            record(others[-1])
    return Processed(chosen, tuple(others), registration.trajectory)


def stages(record: Record) -> Callable[[str], AbstractContextManager[None]]:
    """Return a context manager that brackets a stage with its events."""
    count = 0

    @contextmanager
    def stage(name: str) -> Iterator[None]:
        nonlocal count
        index, count = count, count + 1
        record(StageStarted(name, index))
        started = time.perf_counter()
        yield
        record(StageFinished(name, index, time.perf_counter() - started))

    return stage
