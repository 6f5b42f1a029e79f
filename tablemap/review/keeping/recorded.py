"""What the drawings need of the recording itself: frames over time, scans at the stops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tablemap.errors import ProcessWarning
from tablemap.geometry import Bools, Floats, Ints
from tablemap.inputs import Input
from tablemap.recording import DepthFrame, FrameNames, LaserScan, Recording


@dataclass(frozen=True, eq=False)
class RecordedFrames:
    """Poses of the base at some times of the drive.

    - ``stamps_ns``: (n,) int64
    - ``fixed_from_base``, ``odom_from_base``: (n, 4, 4), nan where there is none
    """

    names: FrameNames
    start_ns: int
    end_ns: int
    stamps_ns: Ints
    fixed_from_base: Floats
    odom_from_base: Floats


@dataclass(frozen=True, eq=False)
class RecordedStops:
    """The same at the snapshots, and the scan nearest to each with the laser's pose (4, 4)."""

    stamps_ns: Ints
    fixed_from_base: Floats
    odom_from_base: Floats
    scans: tuple[tuple[LaserScan, Floats], ...]


@dataclass(frozen=True, eq=False)
class RecordedWarnings:
    """The recording's warnings up to here."""

    warnings: tuple[ProcessWarning, ...]


class KeptRecording(Recording):
    """A recording that knows only what was kept of it; it has no images."""

    def __init__(self, frames: RecordedFrames) -> None:
        self.input = Input.of("kept")
        self.names = frames.names
        self.start_ns, self.end_ns = frames.start_ns, frames.end_ns
        self.warnings = []
        self._stamps = frames.stamps_ns
        self._fixed: dict[int, Floats] = {}
        self._odom: dict[int, Floats] = {}
        self._scans: tuple[tuple[LaserScan, Floats], ...] = ()
        self._take(frames)

    def _take(self, kept: RecordedFrames | RecordedStops) -> None:
        for poses, known in (
            (kept.fixed_from_base, self._fixed),
            (kept.odom_from_base, self._odom),
        ):
            for stamp, pose in zip(kept.stamps_ns.tolist(), poses, strict=True):
                if np.isfinite(pose).all():
                    known[stamp] = pose

    def take_stops(self, stops: RecordedStops) -> None:
        """Take what was kept at the snapshots."""
        self._take(stops)
        self._scans = stops.scans

    def pose_stamps(self) -> Ints:
        """See `Recording`."""
        return self._stamps

    def depth_stamps(self) -> Ints:
        """See `Recording`."""
        return np.zeros(0, dtype=np.int64)

    def depth_frames(self, stamps_ns: ArrayLike | None = None) -> Iterator[DepthFrame]:
        """See `Recording`."""
        return iter(())

    def scans(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        *,
        stamps_ns: ArrayLike | None = None,
    ) -> Iterator[LaserScan]:
        """See `Recording`."""
        for scan, _ in self._scans:
            if stamps_ns is not None and scan.stamp_ns not in np.asarray(stamps_ns):
                continue
            is_late_enough = start_ns is None or scan.stamp_ns >= start_ns
            if is_late_enough and (end_ns is None or scan.stamp_ns <= end_ns):
                yield scan

    def base_from_laser(self, stamp_ns: int) -> Floats:
        """See `Recording`."""
        return next(pose for scan, pose in self._scans if scan.stamp_ns == stamp_ns)

    def fixed_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """See `Recording`."""
        return _kept_at(self._fixed, stamps_ns)

    def odom_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """See `Recording`."""
        return _kept_at(self._odom, stamps_ns)


def _kept_at(known: dict[int, Floats], stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
    """Return the (n, 4, 4) poses that were kept at (n,) stamps, and which of them were."""
    stamps = np.asarray(stamps_ns, dtype=np.int64).tolist()
    found = [known.get(stamp) for stamp in stamps]
    poses = [np.eye(4) if pose is None else pose for pose in found]
    return np.array(poses).reshape(-1, 4, 4), np.array([pose is not None for pose in found], bool)
