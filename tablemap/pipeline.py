"""The method on one page: from a recording to the model of a table."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cache

from msgspec.structs import replace
from threadpoolctl import threadpool_limits

from tablemap.config import Config, Tables, check_tables
from tablemap.errors import EstimationError, cause_named
from tablemap.events import OtherTable, Record, StageFinished, StageStarted, ignore, of_table
from tablemap.model import TableModel
from tablemap.recording import Recording
from tablemap.stages.assembly import Findings, assemble
from tablemap.stages.calibration import Calibration, calibrate, find_step, flatten
from tablemap.stages.crosscheck import admitted_legs, corrected, cross_check
from tablemap.stages.legs import Legs, find_legs
from tablemap.stages.legs.adjoining import find_adjoining, without
from tablemap.stages.odometry import Odometry, Trajectory, estimate_odometry
from tablemap.stages.outline import Outline, find_edges
from tablemap.stages.registration import register
from tablemap.stages.segmentation import (
    STRIDE_PX,
    Segmentation,
    TableCandidate,
    choose_next,
    next_choices,
    none_gave_a_table,
    segment,
    segment_again,
)
from tablemap.stages.snapshots import Snapshots, take_snapshots
from tablemap.stages.surface import Mounting, Surface, fit_surface

STAGES = (
    "snapshots",
    "calibration",
    "segmentation",
    "odometry",
    "registration",
    "outline",
    "surface",
    "legs",
    "crosscheck",
)


@dataclass(frozen=True, eq=False)
class Processed:
    """A recording's outcome: the chosen table, the others where all were asked for, the drive."""

    model: TableModel
    others: tuple[OtherTable, ...]
    trajectory: Trajectory


def process(
    recording: Recording,
    *,
    config: Config | None = None,
    tables: Tables | None = None,
    record: Record = ignore,
) -> Processed:
    """Turn a recording into the model of its table.

    ``tables`` is ``best``, ``all``, or a place (x, y) in the map, metres: the table nearest to it;
    None: what ``config`` says.
    Every result and intermediate step goes to ``record`` as it arises. Raises `RecordingError` or
    `EstimationError` where there is no model to be had, and `ConfigError` for no such tables.
    """
    config = config or Config()
    chosen = config.tables if tables is None else check_tables(tables)
    # One thread: faster round small solves, and the same sums in the same order on every run.
    with threadpool_limits(limits=1), cause_named(recording.warnings):
        return _process(recording, config, chosen, record)


def _process(recording: Recording, config: Config, tables: Tables, record: Record) -> Processed:
    stage = stages(record)
    sensors = config.sensors
    near = tables if isinstance(tables, tuple) else None

    # Where the robot stood, and what its camera saw there.
    with stage("snapshots"):
        taken = take_snapshots(recording, config=config.snapshots, sensors=sensors)
        record(taken)
        # A kind of camera has its own errors at edges, and so has the window that it compares.
        sensors, _ = sensors.of_camera(taken.camera.kind)
        sensors = sensors.of_window(taken.camera.window)
        config = replace(config, sensors=sensors)

    # The floor shows the camera's tilt, and the bend of its depth image.
    with stage("calibration"):
        calibration = calibrate(
            taken.snapshots,
            config=config.calibration,
            sensors=sensors,
            rounding=taken.camera.rounding,
        )
        record(calibration)

    # The top is a second plane, nearer than the floor: with it the camera is adjusted again, and
    # all views are read anew.
    def settle(rough: Segmentation) -> tuple[Calibration, Segmentation]:
        adjusted = flatten(calibration, rough.top(), config=config.calibration)
        record(adjusted)
        segmentation = segment_again(
            adjusted.snapshots, rough, config=config.segmentation, sensors=sensors, record=record
        )
        record(segmentation)
        return adjusted, segmentation

    # Which of the horizontal surfaces is the table; roughly first, then which pixels show it.
    with stage("segmentation"):
        rough = segment(
            calibration.snapshots,
            config=config.segmentation,
            sensors=sensors,
            near=near,
            stride=STRIDE_PX,
            record=record,
        )
        adjusted, segmentation = settle(rough)

    # KISS-ICP over the laser's scans of the whole drive.
    with stage("odometry"):
        odometry = estimate_odometry(
            recording, adjusted.snapshots, config=config.odometry, sensors=sensors, record=record
        )
        record(odometry)

    def attempt(calibration: Calibration, segmentation: Segmentation) -> Processed:
        seen = _Seen(recording, taken, calibration, segmentation, odometry)
        done = _model(seen, config, tables, record, stage)
        _check_choice(done.model)
        return done

    first: Processed | None = None
    try:
        first = attempt(adjusted, segmentation)
        if near is not None or first.model.verdict.level != "failed":
            return first
        failure = EstimationError(first.model.verdict.reasons[0])
    except EstimationError as error:
        if near is not None:
            raise
        failure = error

    # The likeliest surface gave no model, or a failed one: the next ones are tried in their order.
    for candidate in next_choices(rough):
        try:
            with stage("segmentation"):
                second = choose_next(
                    calibration.snapshots,
                    rough,
                    candidate,
                    failure,
                    config=config.segmentation,
                    sensors=sensors,
                )
                settled = settle(second)
            return attempt(*settled)
        except EstimationError:
            continue
    if first is not None:
        # A review shows what is recorded last: the first one again.
        record(adjusted)
        record(segmentation)
        return attempt(adjusted, segmentation)
    raise EstimationError(none_gave_a_table(failure, rough.candidates)) from failure


def _check_choice(model: TableModel) -> None:
    """Raise `EstimationError` for a second choice with hardly a measured side, as of a step."""
    codes = {warning.code for warning in model.warnings}
    sides = [edge.status for edge in model.surface.edges]
    is_open = "accuracy.unseen_side" in codes or sides.count("measured") < min(2, len(sides))
    is_open |= model.verdict.level == "failed"
    if "accuracy.second_choice" in codes and is_open:
        raise EstimationError(
            "no table was found: the likeliest surface is none, and of the next one "
            f"({model.surface.height.value:.2f} m high) not all sides were seen: it may be a "
            "step or a shelf; record views from more sides of the table"
        )


@dataclass(frozen=True, eq=False)
class _Seen:
    """The stages' results up to the choice of a table, and the motion of the drive."""

    recording: Recording
    taken: Snapshots
    calibration: Calibration
    segmentation: Segmentation
    odometry: Odometry


def _model(
    seen: _Seen,
    config: Config,
    tables: Tables,
    record: Record,
    stage: Callable[[str], AbstractContextManager[None]],
) -> Processed:
    """Register the views, and model the chosen table, and the others where all are wanted."""
    sensors = config.sensors
    near = tables if isinstance(tables, tuple) else None
    recording, calibration, odometry = seen.recording, seen.calibration, seen.odometry
    snapshots = calibration.snapshots

    @cache
    def edges(segmentation: Segmentation) -> Outline:
        return find_edges(
            snapshots,
            segmentation,
            config=config.outline,
            sensors=sensors,
            calibration=calibration,
        )

    # Pairwise ICP, a pose graph and a joint polish place the stops to a millimetre. Without a
    # laser, the table's edges are registered.
    with stage("registration"):
        registration = register(
            recording,
            snapshots,
            odometry,
            edges=lambda: edges(seen.segmentation),
            config=config.registration,
            sensors=sensors,
            record=record,
        )
        record(registration)

    def model(segmentation: Segmentation, record: Record) -> TableModel:
        # The ends of the top in each view, and the cause of each edge point.
        with stage("outline"):
            outline = edges(segmentation)
            # Its height refers to the floor: a rug under the table gives that two levels.
            poses = registration.used_poses
            outline = outline.on(find_step(snapshots, poses, outline.top_in(poses)))
            record(outline)

        # The shape that explains the edges of all views.
        with stage("surface"):
            surface = fit(outline, record)

        # The legs under the top. Another piece of furniture may touch the top at the same height:
        # if it has its own legs, it is cut off.
        with stage("legs"):
            legs = stand(surface)
            adjoining = find_adjoining(surface, legs, near=near)
            if adjoining is not None:
                outline = without(outline, adjoining, registration.map_from_base)
                surface = fit(outline, record)
                legs = stand(surface)
            record(legs)

        # Camera and laser are compared by edges and legs. The legs show the camera's place in the
        # base, which the edges leave open. If only edges show that the two disagree, the edges that
        # the camera saw are moved to agree with the laser.
        with stage("crosscheck"):
            cross = cross_check(
                outline,
                surface,
                registration,
                legs.legs,
                snapshots,
                config=config.crosscheck,
                sensors=sensors,
            )
            record(cross)
            if cross.mounting is not None:
                first, surface = surface, fit(outline, record, cross.mounting, first=surface)
                # The laser's legs do not depend on the camera: under the same top they stay.
                if registration.source != "laser" or not surface.is_nearly(first):
                    legs = stand(surface)
            elif cross.is_found:
                outline = corrected(outline, cross)
                surface = fit(outline, record)
                legs = stand(surface)
            legs = admitted_legs(legs, cross, surface, registration)
            record(legs)

        return assemble(
            Findings(
                recording=recording,
                taken=seen.taken,
                calibration=calibration,
                segmentation=segmentation,
                odometry=odometry,
                registration=registration,
                outline=outline,
                surface=surface,
                cross=cross,
                legs=legs,
            )
        )

    def fit(
        outline: Outline,
        record: Record,
        mounting: Mounting | None = None,
        *,
        first: Surface | None = None,
    ) -> Surface:
        surface = fit_surface(
            outline,
            registration,
            config=config.surface,
            sensors=sensors,
            seed=config.seed,
            mounting=mounting,
            first=first,
        )
        record(surface)
        return surface

    def stand(surface: Surface) -> Legs:
        return find_legs(
            recording, snapshots, registration, surface, config=config.legs, sensors=sensors
        )

    def other(candidate: TableCandidate, number: int) -> TableModel | str:
        place = f"({candidate.x:.2f}, {candidate.y:.2f})"
        where = f"the surface at {place}, {candidate.height:.2f} m high"
        if candidate.reason is not None:
            return f"{where}, is probably no table: {candidate.reason}"
        try:
            segmentation = segment(
                snapshots, config=config.segmentation, sensors=sensors, candidate=candidate
            )
            return model(segmentation, of_table(number, record))
        except EstimationError as error:
            return f"{where}, gave no model: {error}"

    chosen = model(seen.segmentation, record)
    record(chosen)
    others: list[OtherTable] = []
    if tables == "all":
        beside = [candidate for candidate in seen.segmentation.candidates if not candidate.chosen]
        for number, candidate in enumerate(beside, start=1):
            others.append(OtherTable(number, other(candidate, number)))
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
