"""The single place that maps each result to its drawing in Rerun."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from tablemap.config import ReviewConfig
from tablemap.errors import ProcessWarning, is_doubt
from tablemap.events import OfTable, OtherTable, RunFailed, StageFinished, StageStarted
from tablemap.model import TableModel
from tablemap.recording import Recording
from tablemap.review import progress, sensors, story, supports
from tablemap.review.alignment import Alignment
from tablemap.review.blueprint import blueprint
from tablemap.review.closing import Closing
from tablemap.review.crosscheck import log_cross_check
from tablemap.review.current import log_localised_stops, log_registered_stops
from tablemap.review.doubted import Doubted, log_doubts
from tablemap.review.legend import log_legends
from tablemap.review.motion import MotionDrawing
from tablemap.review.naming import Naming
from tablemap.review.perception import Perception
from tablemap.review.projection import Projection, edge_points_seen
from tablemap.review.room import Room
from tablemap.review.solid import bands, log_model
from tablemap.review.stream import Stream
from tablemap.review.tables import Tables
from tablemap.review.telling import Telling
from tablemap.review.top import TopDrawing
from tablemap.stages.calibration import Calibration
from tablemap.stages.crosscheck import CrossCheck
from tablemap.stages.legs import Legs
from tablemap.stages.odometry import Odometry, OdometryMap, OdometryScan
from tablemap.stages.outline import Outline
from tablemap.stages.registration import PairIteration, PairStarted, Registration, StopScan
from tablemap.stages.segmentation import Segmentation, TableRefused, TablesFound
from tablemap.stages.snapshots import SetAside, Snapshots
from tablemap.stages.surface import Surface

Draw = Callable[[Stream, Any], None]
ALWAYS = (RunFailed, TableModel, OtherTable)
"""Results that are drawn even at level ``off``: the models, or the failure."""


class Reviewer(Closing):
    """Writes an .rrd during a run; call it with each result and event.

    ``path`` is written in place and is readable after every stage, even if the run is killed.
    Raises `TablemapError` if the file cannot be written.
    """

    def __init__(
        self, path: Path, *, run_id: str, recording_name: str, config: ReviewConfig
    ) -> None:
        self._stream = Stream(path, run_id=run_id, recording_name=recording_name, config=config)
        self._stages_say: dict[type, list[ProcessWarning]] = {}
        perception, motion, alignment, top = (
            Perception(),
            MotionDrawing(),
            Alignment(),
            TopDrawing(),
        )
        projection, telling, naming = Projection(), Telling(), Naming()
        doubted = self._doubted = Doubted()
        rooms: dict[str, Room] = {}

        def draw_snapshots(stream: Stream, taken: Snapshots) -> None:
            sensors.log_snapshots(stream, taken)
            perception.take_snapshots(taken)
            telling.log_stops(stream, taken)
            log_localised_stops(stream)

        def draw_surface(stream: Stream, surface: Surface) -> None:
            top.log_surface(stream, surface)
            naming.take_surface(surface)
            telling.log_top(stream, surface)

        tables = Tables()

        def draw_registration(stream: Stream, registration: Registration) -> None:
            top.take_poses(registration.map_from_base)
            projection.take_used(registration.used)
            telling.take_poses(registration.map_from_base)
            naming.take_registration(registration)
            perception.take_scans(stream, registration.stop_scans)
            tables.take_poses(registration.map_from_base)
            alignment.log_registration(stream, registration)
            log_registered_stops(stream, registration)

        def draw_calibration(stream: Stream, calibration: Calibration) -> None:
            perception.log_calibration(stream, calibration)
            projection.take_cameras(calibration)

        def draw_tables_found(stream: Stream, found: TablesFound) -> None:
            perception.log_tables_found(stream, found)
            projection.log_candidates(stream, found.candidates)

        def draw_segmentation(stream: Stream, segmentation: Segmentation) -> None:
            perception.log_segmentation(stream, segmentation)
            telling.log_candidates(stream, segmentation)
            seen = {v.index: v.top_pixels for v in segmentation.views if v.sees_table}
            projection.bring_to_front(stream, seen)

        def draw_outline(stream: Stream, outline: Outline) -> None:
            top.log_outline(stream, outline)
            telling.log_edges(stream, outline)
            projection.bring_to_front(stream, edge_points_seen(outline))
            projection.log_edges(stream, outline)

        def draw_legs(stream: Stream, legs: Legs) -> None:
            rooms["legs"] = supports.log_legs(stream, legs)

        def draw_model(stream: Stream, model: TableModel) -> None:
            room = log_model(
                stream, model, lines=naming.lines(stream), points=naming.points(stream)
            )
            doubts = doubted.of(model)
            codes = (one.code for one in model.warnings)
            stream.scene.doubts = frozenset(filter(is_doubt, codes))
            if stream.config.level != "off":
                telling.end(stream)
                perception.log_names(stream)
                alignment.log_names(stream)
                stream.hold()
                rooms["surface"] = top.log_names(stream, [line for _, line in bands(model)])
                log_doubts(stream, doubts, {**rooms, "overview": room})
            naming.log_beside(stream, room)
            projection.log_model(stream, model, doubts)

        def draw_other(stream: Stream, other: OtherTable) -> None:
            tables.log_outcome(stream, other)
            naming.log_other(stream, other)
            projection.log_other(stream, other)

        def draw_of_table(stream: Stream, one: OfTable) -> None:
            tables.log_result(stream, one)
            projection.take_other(stream, one)

        def draw_failure(stream: Stream, failed: RunFailed) -> None:
            perception.log_as_far_as_it_came(stream)
            alignment.log_as_far_as_it_came(stream)
            progress.log_failure(stream, failed, found=perception.told())
            if stream.config.level != "off":
                projection.log_failure(stream)
                perception.log_names(stream)
                alignment.log_names(stream)
                naming.log_found(stream, *perception.found(stream))

        self.places: dict[type, Draw] = {
            Recording: sensors.log_recording,
            StageStarted: progress.log_started,
            StageFinished: progress.log_finished,
            RunFailed: draw_failure,
            ProcessWarning: progress.log_warning,
            Snapshots: draw_snapshots,
            SetAside: sensors.log_set_aside,
            Calibration: draw_calibration,
            TablesFound: draw_tables_found,
            Segmentation: draw_segmentation,
            TableRefused: perception.log_refused,
            OdometryScan: motion.log_scan,
            OdometryMap: motion.log_map,
            Odometry: motion.log_odometry,
            StopScan: alignment.log_stop_scan,
            PairStarted: alignment.pairs.start,
            PairIteration: alignment.pairs.step,
            Registration: draw_registration,
            Outline: draw_outline,
            Surface: draw_surface,
            CrossCheck: log_cross_check,
            Legs: draw_legs,
            TableModel: draw_model,
            OfTable: draw_of_table,
            OtherTable: draw_other,
        }
        log_legends(self._stream)
        self._stream.hold()
        self._stream.text("summary", story.running(recording_name))
        self._stream.show(blueprint(self._stream.scene))
        self._has_more_tables = False
        self._stream.flush()

    def __call__(self, result: object) -> None:
        """Log one result or event, and its warnings.

        Raises `TypeError` for an unknown type, and `TablemapError` if the disk is full.
        """
        place = next((self.places[k] for k in type(result).__mro__ if k in self.places), None)
        if place is None:
            raise TypeError(f"{type(result).__name__} has no place in the review")
        if isinstance(result, Recording):
            self._stream.open_recording(result)
        if self._stream.config.level != "off" or isinstance(result, ALWAYS):
            self._doubted.take(result)
            place(self._stream, result)
            self._warn(result)
        # Every layout stays in the file: what the segmentation adds is shown with the registration,
        # and all tables beside the chosen one together at the end.
        if isinstance(result, (Registration, TableModel, RunFailed)):
            self._stream.show(blueprint(self._stream.scene))
            if isinstance(result, (TableModel, RunFailed)):
                self._stream.say_first_view()
        self._has_more_tables |= isinstance(result, OtherTable)
        if isinstance(result, (Segmentation, Registration, TableModel, OtherTable, RunFailed)):
            self._stream.flush()

    def _warn(self, result: object) -> None:
        """Log the warnings of a model, or of a run that failed; keep those of a stage till then.

        A stage may run again and say something else, and a later one may withdraw what it says.
        """
        if self._stream.config.level == "off":
            return
        recording = self._stream.scene.recording
        if isinstance(result, OtherTable):
            if isinstance(result.outcome, TableModel):
                about = f"table {result.number:02d}, "
                progress.log_warnings(self._stream, result.outcome.warnings, about=about)
        elif isinstance(result, TableModel):
            self._stages_say.clear()
            progress.log_warnings(self._stream, result.warnings)
        elif isinstance(result, RunFailed):
            recorded = [*recording.warnings] if recording else []
            said = [one for warnings in self._stages_say.values() for one in warnings]
            self._stages_say.clear()
            progress.log_warnings(self._stream, dict.fromkeys([*recorded, *said]))
        elif hasattr(result, "warnings") and not isinstance(result, Recording):
            self._stages_say[type(result)] = [*result.warnings]

    def close(self) -> None:
        """Write the remaining rows and the footer; a second call does nothing."""
        if self._has_more_tables:
            self._has_more_tables = False
            self._stream.show(blueprint(self._stream.scene))
        self._stream.close()
