"""The one place that knows how a result looks in Rerun."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from tablemap.calibration import Calibration
from tablemap.config import ReviewConfig
from tablemap.crosscheck import CrossCheck
from tablemap.errors import ProcessWarning, TablemapError
from tablemap.legs import Legs
from tablemap.model import TableModel
from tablemap.odometry import Odometry, OdometryScan
from tablemap.outline import Outline
from tablemap.record import OtherTable, RunFailed, StageFinished, StageStarted
from tablemap.recording import Recording
from tablemap.registration import Pair, PairIteration, Registration, StopScan
from tablemap.review import progress, sensors, supports, text
from tablemap.review.alignment import Alignment
from tablemap.review.blueprint import blueprint
from tablemap.review.crosscheck import log_cross_check
from tablemap.review.motion import Motion
from tablemap.review.perception import Perception
from tablemap.review.solid import log_model, log_other_table
from tablemap.review.stream import Stream
from tablemap.review.top import Top
from tablemap.segmentation import Segmentation
from tablemap.snapshots import SetAside, Snapshots
from tablemap.surface import Surface

Draw = Callable[[Stream, Any], None]
ALWAYS = (RunFailed, ProcessWarning, TableModel, OtherTable)
"""What is drawn even where the level is ``off``: the model and how the run went."""


class Reviewer:
    """Writes an .rrd while a run goes on; call it with each result and event as it arises.

    ``path`` is written in place and is readable after every stage, also where the run is killed.
    Raises `TablemapError` where the file cannot be written.
    """

    def __init__(
        self, path: Path, *, run_id: str, recording_name: str, config: ReviewConfig
    ) -> None:
        self._stream = Stream(path, run_id=run_id, recording_name=recording_name, config=config)
        perception, motion, alignment, top = Perception(), Motion(), Alignment(), Top()

        def draw_registration(stream: Stream, registration: Registration) -> None:
            top.take_poses(registration.map_from_base)
            alignment.log_registration(stream, registration)

        def draw_failure(stream: Stream, failed: RunFailed) -> None:
            alignment.log_localised_stops(stream)
            progress.log_failure(stream, failed)

        self.places: dict[type, Draw] = {
            Recording: sensors.log_recording,
            StageStarted: progress.log_started,
            StageFinished: progress.log_finished,
            RunFailed: draw_failure,
            ProcessWarning: progress.log_warning,
            Snapshots: sensors.log_snapshots,
            SetAside: sensors.log_set_aside,
            Calibration: perception.log_calibration,
            Segmentation: perception.log_segmentation,
            OdometryScan: motion.log_scan,
            Odometry: motion.log_odometry,
            StopScan: alignment.log_stop_scan,
            PairIteration: alignment.log_iteration,
            Pair: alignment.log_pair,
            Registration: draw_registration,
            Outline: top.log_outline,
            Surface: top.log_surface,
            CrossCheck: log_cross_check,
            Legs: supports.log_legs,
            TableModel: log_model,
            OtherTable: log_other_table,
        }
        self._stream.hold()
        self._stream.text("summary", text.running(recording_name))
        self._stream.rec.send_blueprint(blueprint(self._stream.scene))
        self._stream.flush()

    def __call__(self, result: object) -> None:
        """Log one result or event, and its warnings.

        Raises `TypeError` for a type that has no place, and `TablemapError` where the disk is full.
        """
        place = next((self.places[k] for k in type(result).__mro__ if k in self.places), None)
        if place is None:
            raise TypeError(f"{type(result).__name__} has no place in the review")
        if isinstance(result, Recording):
            self._stream.open_recording(result)
        if self._stream.config.level != "off" or isinstance(result, ALWAYS):
            place(self._stream, result)
        self._warn(result)
        if isinstance(result, (Segmentation, TableModel, RunFailed)):
            self._stream.rec.send_blueprint(blueprint(self._stream.scene))
            self._stream.flush()

    def _warn(self, result: object) -> None:
        """Log the warnings of a result, and those that the recording has gathered since."""
        scene = self._stream.scene
        if scene.recording is not None and isinstance(
            result, (StageFinished, TableModel, RunFailed)
        ):
            gathered = scene.recording.warnings
            progress.log_warnings(self._stream, gathered[scene.warnings_seen :])
            scene.warnings_seen = len(gathered)
        if not isinstance(result, (Recording, TableModel)):
            progress.log_warnings(self._stream, getattr(result, "warnings", ()))

    def close(self) -> None:
        """Write what is left and the footer; closing twice does nothing."""
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except TablemapError:
            # The error that ended the run says more than what it did to the file.
            if error is None:
                raise
