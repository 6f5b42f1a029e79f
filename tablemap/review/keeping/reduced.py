"""Each result and event with what its drawing needs, and no more."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np

from tablemap.config import ReviewConfig
from tablemap.events import OfTable, RunFailed, StageFinished
from tablemap.geometry import Floats, Ints
from tablemap.recording import CompressedImage, LaserScan, Recording
from tablemap.recording.messages import Image
from tablemap.review.clouds import thinned
from tablemap.review.images import as_jpeg, encode_depth, is_recorded_png
from tablemap.review.keeping.codec import DepthImage
from tablemap.review.keeping.recorded import RecordedFrames, RecordedStops, RecordedWarnings
from tablemap.review.motion import MAP_CELLS, ScansInTime
from tablemap.review.sensors import frame_stamps, nearest_scan
from tablemap.review.top import TOP_CELLS
from tablemap.stages.calibration import Calibration
from tablemap.stages.odometry import OdometryMap, OdometryScan
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration, StopScan
from tablemap.stages.segmentation import Segmentation, TableRefused
from tablemap.stages.snapshots import Snapshot, Snapshots
from tablemap.stages.surface import Surface

SCAN_FIELDS = ("points",)
EDGE_FIELDS = ("points", "kind", "pixels", "top")


class Reduction:
    """Turns results and events into what is kept, in their order.

    Depth images are handed out without their pixels; ``needed`` gives those that a drawing uses,
    once it is known that it does.
    """

    def __init__(self, config: ReviewConfig) -> None:
        self._config = config
        self._recording: Recording | None = None
        self._warned = 0
        self._scans = ScansInTime(config)
        self._shown: dict[int, DepthImage] = {}

    def __call__(self, event: object) -> Iterator[object]:
        """Yield what is kept of a result or an event."""
        if isinstance(event, Recording):
            self._recording = event
            yield _frames(event)
            return
        if isinstance(event, (StageFinished, RunFailed)):
            yield from self._new_warnings()
        if isinstance(event, Snapshots) and self._recording is not None:
            yield _stops(self._recording, event.snapshots)
        yield self._one(event)

    def needed(self, event: object) -> list[DepthImage]:
        """Return the depth images that the drawing of an event uses."""
        if not isinstance(event, (Segmentation, TableRefused, RunFailed)):
            return []
        shown, self._shown = self._shown, {}
        return list(shown.values())

    def _new_warnings(self) -> Iterator[object]:
        if self._recording is not None and len(self._recording.warnings) > self._warned:
            self._warned = len(self._recording.warnings)
            yield RecordedWarnings(tuple(self._recording.warnings))

    def _one(self, event: object) -> object:
        if isinstance(event, OfTable):
            return replace(event, result=self._one(event.result))
        if isinstance(event, Snapshots):
            self._shown = {}
            return replace(event, snapshots=tuple(self._snapshot(s) for s in event.snapshots))
        if isinstance(event, Calibration):
            self._shown = {}
            recorded = tuple(self._snapshot(s, is_shown=False) for s in event.recorded)
            snapshots = tuple(self._snapshot(s) for s in event.snapshots)
            return replace(event, recorded=recorded, snapshots=snapshots)
        if isinstance(event, (Segmentation, TableRefused)):
            return replace(event, views=tuple(replace(v, tolerance=None) for v in event.views))
        if isinstance(event, OdometryScan):
            few = event.points if self._scans.is_next(event) else event.points[:0]
            return replace(event, points=few)
        if isinstance(event, OdometryMap):
            few = thinned(event.points, MAP_CELLS * self._config.voxel).astype(np.float64)
            return replace(event, points=few)
        if isinstance(event, StopScan):
            return _slim(event, SCAN_FIELDS)
        if isinstance(event, Registration):
            scans = tuple(_slim(scan, SCAN_FIELDS) for scan in event.stop_scans)
            return replace(event, stop_scans=scans)
        if isinstance(event, Outline):
            cell = TOP_CELLS * self._config.voxel
            views = tuple(
                replace(_slim(view, EDGE_FIELDS), top=thinned(view.top, cell))
                for view in event.views
            )
            return replace(event, views=views, camera=None)
        if isinstance(event, Surface):
            return replace(event, states=())
        return event

    def _snapshot(self, snapshot: Snapshot, *, is_shown: bool = True) -> Any:
        image = DepthImage(snapshot.depth)
        if is_shown:
            self._shown[snapshot.index] = image
        depth, colour = snapshot.depth_message, snapshot.colour_message
        if not is_recorded_png(depth):
            png = encode_depth(snapshot.depth)
            depth = CompressedImage(depth.stamp_ns, depth.frame_id, "16UC1; png", png)
        if isinstance(colour, Image):
            jpeg = as_jpeg(colour)
            if jpeg is None:
                colour = replace(colour, data=b"")
            else:
                colour = CompressedImage(colour.stamp_ns, colour.frame_id, "jpeg", jpeg)
        held: dict[str, Any] = {"depth": image, "depth_message": depth, "colour_message": colour}
        return replace(snapshot, **held, recorded_noise=None)


def _slim(one: Any, kept: tuple[str, ...]) -> Any:
    """Return a result whose arrays are empty, but for those that are kept."""
    held = {f.name: getattr(one, f.name) for f in fields(one)}
    empty = {
        name: np.zeros(tuple(0 if k == 0 else n for k, n in enumerate(array.shape)))
        for name, array in held.items()
        if isinstance(array, np.ndarray) and name not in kept
    }
    return replace(one, **empty)


def _poses(recording: Recording, stamps_ns: Ints) -> tuple[Floats, Floats]:
    """Return the base's poses (n, 4, 4) in the fixed frame and in that of the wheels, or nan."""
    fixed, odom = (
        np.where(known[:, None, None], poses, np.nan)
        for poses, known in (
            recording.fixed_from_bases(stamps_ns),
            recording.odom_from_bases(stamps_ns),
        )
    )
    return fixed, odom


def _frames(recording: Recording) -> RecordedFrames:
    stamps = frame_stamps(recording)
    return RecordedFrames(
        recording.names, recording.start_ns, recording.end_ns, stamps, *_poses(recording, stamps)
    )


def _stops(recording: Recording, snapshots: tuple[Snapshot, ...]) -> RecordedStops:
    stamps = np.array([snapshot.stamp_ns for snapshot in snapshots], dtype=np.int64)
    scans: list[tuple[LaserScan, Floats]] = []
    for stamp in stamps.tolist() if recording.names.laser else []:
        scan = nearest_scan(recording, stamp)
        if scan is not None:
            scans.append((scan, recording.base_from_laser(scan.stamp_ns)))
    return RecordedStops(stamps, *_poses(recording, stamps), tuple(scans))
