"""The images and scans of a recording, streamed by role."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import merge

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablemap.errors import ProcessWarning, RecordingError
from tablemap.geometry import Floats
from tablemap.recording.blocked import Blocked
from tablemap.recording.calibrations import Calibrations
from tablemap.recording.channels import Channels, Stamped, only
from tablemap.recording.depth import decode_depth
from tablemap.recording.depth_meaning import DepthMeaning
from tablemap.recording.laser_meaning import LaserMeaning
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    DecodingError,
    Image,
    LaserScan,
)
from tablemap.recording.recent import RecentScans
from tablemap.recording.rectification import Rectification
from tablemap.recording.robot_poses import RobotPoses
from tablemap.recording.roles import Roles
from tablemap.recording.sensor_clocks import tf_lags
from tablemap.recording.silence import sweep_that_can_be
from tablemap.recording.tf.frames import Stamps
from tablemap.recording.unmeasured import removed
from tablemap.recording.unseen import Unseen
from tablemap.recording.upright import (
    depth_message,
    turned_colour,
    turned_image,
    turned_mounting,
    turned_pinhole,
)
from tablemap.words import counted


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """One depth image as recorded and in metres.

    - ``depth``: (height, width) float32 metres along the optical axis, NaN where nothing was
      measured, undistorted to the pinhole
    - ``k``: (3, 3), the pinhole
    - ``message``: the recorded message, to be passed on without decoding; of a camera that is not
      mounted upright, the upright image
    - ``base_from_camera``: (4, 4), the optical frame's pose in the base at the stamp
    """

    stamp_ns: int
    depth: NDArray[np.float32]
    k: Floats
    message: Image | CompressedImage
    base_from_camera: Floats

    def turned(self, turns: int) -> DepthFrame:
        """Return the frame with its image turned by quarters, counter-clockwise."""
        height, width = self.depth.shape
        depth = turned_image(self.depth, turns)
        return DepthFrame(
            self.stamp_ns,
            depth,
            turned_pinhole(self.k, width, height, turns),
            depth_message(self.message, depth),
            turned_mounting(self.base_from_camera, turns),
        )


class SensorStreams(RobotPoses):
    """The streams of a robot's sensors: depth, colour and laser.

    - ``warnings``: problems of the recording, each once, as they are found
    - ``roles``: the topics by role
    """

    warnings: list[ProcessWarning]
    roles: Roles
    _channels: Channels
    _depth: Stamped
    _colour: Stamped
    _laser: Stamped
    _calibrations: Calibrations
    _meaning: DepthMeaning
    _filler: float | None
    _turns: int
    _pose_stamps: Stamps
    _laser_meaning: LaserMeaning = LaserMeaning()
    _unseen: Unseen | None = None
    _blocked: Blocked | None = None
    _recent: RecentScans | None = None

    def __init__(self, warnings: list[ProcessWarning]) -> None:
        self.warnings = warnings
        self._said: set[str] = set()

    # What is in it.

    def depth_stamps(self) -> Stamps:
        """Return the (n,) header stamps of all depth images, ascending, without decoding them."""
        return self._depth.stamps_ns

    def scan_stamps(self) -> Stamps:
        """Return the (n,) header stamps of all laser scans, ascending, without decoding them."""
        return self._laser.stamps_ns

    def pose_stamps(self) -> Stamps:
        """Return the (n,) stamps at which the localised pose was recorded, ascending."""
        return self._pose_stamps

    def camera_info(self) -> CameraInfo:
        """Return the depth camera's first recorded calibration."""
        return self._calibrations.infos[0]

    def lags(self) -> dict[str, float]:
        """Return by source the median time from a message's stamp to its recording, seconds.

        The sources are ``depth``, ``laser`` and ``tf``. Where a clock is off, its
        sources have another lag than the others.
        """
        known = {
            "depth": self._depth.lags_s(),
            "laser": self._laser.lags_s(),
            "tf": tf_lags(self.tree, self.names, self._channels.collector),
        }
        return {name: float(np.median(lags)) for name, lags in known.items() if len(lags)}

    # Images and scans.

    def depth_frames(self, stamps_ns: ArrayLike | None = None) -> Iterator[DepthFrame]:
        """Yield depth images in time order; if stamps are given, only the images at these.

        An image that cannot be decoded, or has no pose at its stamp, is left out with a warning.
        """
        assert self.roles.depth is not None
        topic = self.roles.depth.name
        due = only(self._depth, stamps_ns)
        placed = self.base_from_cameras(due.stamps_ns)
        order = {int(stamp): place for place, stamp in enumerate(due.stamps_ns)}
        unplaced = 0
        unfit: list[str] = []
        for message in self._channels.in_order(self.roles.depth, due):
            assert isinstance(message, Image | CompressedImage)
            place = order[message.stamp_ns]
            if not placed[1][place]:
                unplaced += 1
                continue
            try:
                depth = removed(decode_depth(message), self._filler)
            except DecodingError as error:
                self._channels.say_undecoded(topic, error)
                continue
            try:
                rectified = self._rectification(message, depth.shape[1], depth.shape[0])
            except RecordingError as error:
                unfit.append(str(error))
                continue
            frame = DepthFrame(
                message.stamp_ns,
                self._meaning.metres(rectified.apply(depth), rectified.k),
                rectified.k,
                message,
                placed[0][place],
            )
            yield frame if self._turns == 0 else frame.turned(self._turns)
        if unfit:
            self._say_once(
                "recording.calibration",
                f"{len(unfit)} of {counted(len(due.stamps_ns), 'depth image')} left out: "
                f"{unfit[0]}",
            )
        if unplaced:
            self._say_once(
                "recording.no_pose",
                f"{unplaced} of {counted(len(due.stamps_ns), 'depth image')} left out, as the "
                "camera has no pose at their stamps.",
            )

    def colour_near(
        self, stamps_ns: ArrayLike, tolerance_ns: int = 100_000_000
    ) -> dict[int, Image | CompressedImage]:
        """Return, by stamp, the colour image nearest in time; a stamp without one has no key."""
        wanted = np.atleast_1d(np.asarray(stamps_ns, dtype=np.int64))
        have = self._colour.stamps_ns
        if self.roles.colour is None or len(have) == 0 or len(wanted) == 0:
            return {}
        after = np.clip(np.searchsorted(have, wanted), 0, len(have) - 1)
        before = np.maximum(after - 1, 0)
        nearer = np.abs(have[before] - wanted) <= np.abs(have[after] - wanted)
        nearest = np.where(nearer, before, after)
        close = np.abs(have[nearest] - wanted) <= tolerance_ns
        due = only(self._colour, have[nearest[close]])
        images = {
            message.stamp_ns: turned_colour(message, self._turns) if self._turns else message
            for message in self._channels.in_order(self.roles.colour, due)
            if isinstance(message, Image | CompressedImage)
        }
        return {
            int(stamp): images[int(have[place])]
            for stamp, place in zip(wanted[close], nearest[close], strict=True)
            if int(have[place]) in images
        }

    def scans(
        self,
        start_ns: int | None = None,
        end_ns: int | None = None,
        *,
        stamps_ns: ArrayLike | None = None,
    ) -> Iterator[LaserScan]:
        """Yield laser scans in time order; none without a laser.

        Only scans with header stamps in [start, end], or with the given stamps, are returned.
        """
        if self.roles.laser is None or self.names.laser is None:
            return
        due = only(self._laser, stamps_ns)
        first = 0 if start_ns is None else int(np.searchsorted(due.stamps_ns, start_ns))
        last = None if end_ns is None else int(np.searchsorted(due.stamps_ns, end_ns, "right"))
        due = Stamped(due.stamps_ns[first:last], due.log_times_ns[first:last])
        if self._recent is None:
            yield from self._read_scans(due)
            return
        held = self._recent.at(due.stamps_ns)
        missing = only(due, np.setdiff1d(due.stamps_ns, np.array([*held], dtype=np.int64)))
        for scan in merge(held.values(), self._read_scans(missing), key=lambda s: s.stamp_ns):
            if scan.stamp_ns not in held:
                self._recent.keep(scan)
            yield scan

    def _read_scans(self, due: Stamped) -> Iterator[LaserScan]:
        assert self.roles.laser is not None
        for message in self._channels.in_order(self.roles.laser, due):
            assert isinstance(message, LaserScan)
            message = self._laser_meaning.of(message)
            scan = sweep_that_can_be(message)
            if scan is not message:
                self._say_once(
                    "recording.silent_sensor",
                    f"The beams of scans on {self.roles.laser.name} were taken as of one moment: "
                    f"their time_increment of {message.time_increment:g} s cannot be.",
                )
            if self._unseen is not None:
                scan = self._unseen.removed(scan)
            yield scan if self._blocked is None else self._blocked.removed(scan)

    def _rectification(
        self, message: Image | CompressedImage, width: int, height: int
    ) -> Rectification:
        if isinstance(message, CloudImage) and self.roles.is_own_calibration:
            return Rectification(message.k, None)
        return self._calibrations.rectification(message.stamp_ns, width, height)

    def _say_once(self, code: str, message: str, stamp_ns: int | None = None) -> None:
        if message not in self._said:
            self._said.add(message)
            self.warnings.append(ProcessWarning(code, "recording", message, stamp_ns))
