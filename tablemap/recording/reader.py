"""An opened recording: its depth images, scans and poses, streamed by role."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tablemap.config import LimitsConfig, TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError, cause_named
from tablemap.geometry import Floats
from tablemap.inputs import AnyInput, Input
from tablemap.recording.calibrations import Calibrations, valid_calibrations
from tablemap.recording.carried import carried_warnings
from tablemap.recording.channels import Channels, Stamped, only
from tablemap.recording.depth import decode_depth
from tablemap.recording.depth_meaning import DepthMeaning
from tablemap.recording.judgement import Sample, judged, sampled, spread
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    DecodingError,
    Image,
    LaserScan,
)
from tablemap.recording.pose_topics import read_poses
from tablemap.recording.raw import Source
from tablemap.recording.rectification import Rectification
from tablemap.recording.robot_poses import RobotPoses
from tablemap.recording.robots import placed
from tablemap.recording.roles import Roles, find_roles, implied_transforms, missing_roles
from tablemap.recording.sensor_clocks import (
    ClockedSensor,
    Pairs,
    compared,
    run_of,
    settled,
    span_apart,
)
from tablemap.recording.silence import is_silent, sweep_that_can_be
from tablemap.recording.sources import open_source
from tablemap.recording.tf.frame_roles import FrameNames, pose_stamps
from tablemap.recording.tf.frames import Stamps
from tablemap.recording.topics import list_topics
from tablemap.recording.unseen import Unseen, learnt, places_apart
from tablemap.recording.window import windowed

_COMPARED_IMAGES = 120  # of a camera whose clock may be off


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """One depth image as recorded and in metres.

    - ``depth``: (height, width) float32 metres along the optical axis, NaN where nothing was
      measured, undistorted to the pinhole
    - ``k``: (3, 3), the pinhole
    - ``message``: the recorded message, to be passed on without decoding
    - ``base_from_camera``: (4, 4), the optical frame's pose in the base at the stamp
    """

    stamp_ns: int
    depth: NDArray[np.float32]
    k: Floats
    message: Image | CompressedImage
    base_from_camera: Floats


class Recording(RobotPoses):
    """An opened recording. Iterators stream; only the TF tree and the index stay in memory.

    All problems (cut files, bad checksums, undecodable messages) are appended to ``warnings`` when
    they are found. Close it, or use it as a context manager.
    """

    input: Input
    start_ns: int
    end_ns: int
    warnings: list[ProcessWarning]
    _unseen: Unseen | None = None

    def __init__(
        self,
        input: Input,
        source: Source,
        *,
        topics: TopicsConfig,
        limits: LimitsConfig,
        warnings: list[ProcessWarning],
    ) -> None:
        self.input = input
        self.source = source
        self.warnings = warnings
        self._said: set[str] = set()
        self.warnings.extend(carried_warnings(source))
        self.roles, choices = _roles(source, topics, limits)
        self.warnings.extend(choice for choice in choices if choice not in self.warnings)
        assert self.roles.depth is not None
        assert self.roles.calibration is not None
        self._channels = Channels(source, self.roles, limits=limits, say=self._say_once)
        self._depth, self._colour = (
            self._channels.of(topic) for topic in (self.roles.depth, self.roles.colour)
        )
        self._calibrations = self._calibrated()
        self._check_first_depth()
        self._place(topics, limits)
        self._laser = self._channels.of(self.roles.laser)
        self._settle_clocks(topics)
        self._meaning = self._judge(topics, limits)
        self._pose_stamps = pose_stamps(self.tree, self.names.fixed, self.names.carrier)
        self.start_ns, self.end_ns = self._span()
        self._unseen = self._learnt_unseen()
        self.names = self._names_without_silent_laser()

    @property
    def path(self) -> Path:
        """The path, or the first of several."""
        return self.input.path

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
        """Return by topic the median time from a message's stamp to its recording, seconds.

        All topics of a computer whose clock is off have another lag.
        """
        roles = (self.roles.depth, self.roles.laser, *self.roles.transforms)
        lags = {topic.name: self._channels.lag(topic) for topic in roles if topic is not None}
        return {name: lag for name, lag in lags.items() if lag is not None}

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
                depth = decode_depth(message)
            except DecodingError as error:
                self._channels.say_undecoded(topic, error)
                continue
            try:
                rectified = self._rectification(message, depth.shape[1], depth.shape[0])
            except RecordingError as error:
                unfit.append(str(error))
                continue
            yield DepthFrame(
                message.stamp_ns,
                self._meaning.metres(rectified.apply(depth), rectified.k),
                rectified.k,
                message,
                placed[0][place],
            )
        if unfit:
            self._say_once(
                "recording.calibration",
                f"{len(unfit)} of {len(due.stamps_ns)} depth images were left out: {unfit[0]}",
            )
        if unplaced:
            self._say_once(
                "recording.no_pose",
                f"{unplaced} of {len(due.stamps_ns)} depth images were left out, as the camera "
                "has no pose at their stamps.",
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
            message.stamp_ns: message
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
        for message in self._channels.in_order(self.roles.laser, due):
            assert isinstance(message, LaserScan)
            scan = sweep_that_can_be(message)
            if scan is not message:
                self._say_once(
                    "recording.silent_sensor",
                    f"The beams of scans on {self.roles.laser.name} were taken as of one moment: "
                    f"their time_increment of {message.time_increment:g} s cannot be.",
                )
            yield scan if self._unseen is None else self._unseen.removed(scan)

    # Opening.

    def _check_first_depth(self) -> None:
        """Raise if the calibration does not fit the images, before anything is computed."""
        assert self.roles.depth is not None
        empty = 0
        for message in self._channels.in_order(self.roles.depth, self._depth):
            assert isinstance(message, Image | CompressedImage)
            try:
                depth = decode_depth(message)
            except DecodingError as error:
                self._channels.say_undecoded(self.roles.depth.name, error)
                continue
            if not np.isfinite(depth).any():
                empty += 1
                continue
            self._rectification(message, depth.shape[1], depth.shape[0])
            return
        what = f"decoded, and {empty} show nothing" if empty else "decoded"
        raise RecordingError(
            f"None of the depth images on {self.roles.depth.name} can be {what}; "
            "the recording has no depth that could be used."
        )

    def _place(self, config: TopicsConfig, limits: LimitsConfig) -> None:
        """Find the camera's robot: its transforms and frames, and the laser that it has."""
        found = placed(
            self._channels.collector,
            self.roles,
            config,
            lambda: read_poses(self.source, self.roles.poses, limits),
        )
        for warning in found.warnings:
            self._say_once(warning.code, warning.message, warning.stamp_ns)
        self.tree, self.names, self.roles = found.tree, found.names, found.roles
        self.localisation = found.localisation

    def _settle_clocks(self, config: TopicsConfig) -> None:
        """Move the stamps of sensors whose clock is off; raise if no image has a pose then."""
        depth, laser = self.roles.depth, self.roles.laser
        assert depth is not None
        camera = ClockedSensor(
            "camera", self.names.camera, "clock_offset", self._depth, self._depth_pairs
        )
        offset_ns = self._offset_ns(camera, config.clock_offset)
        if offset_ns:
            for topic in (depth, self.roles.colour):
                if topic is not None:
                    self._channels.shift(topic, offset_ns)
            self._depth, self._colour = (
                self._channels.of(topic) for topic in (depth, self.roles.colour)
            )
            self._calibrations = self._calibrations.shifted(offset_ns)
        if laser is not None and self.names.laser is not None:
            scanner = ClockedSensor(
                "laser", self.names.laser, "laser_clock_offset", self._laser, self._scan_pairs
            )
            offset_ns = self._offset_ns(scanner, config.laser_clock_offset)
            if offset_ns:
                self._channels.shift(laser, offset_ns)
                self._laser = self._channels.of(laser)
        stamps = self._depth.stamps_ns
        poses = pose_stamps(self.tree, self.names.fixed, self.names.carrier)
        if len(stamps) and len(poses) and not self.fixed_from_bases(stamps)[1].any():
            named = [each.message for each in self.warnings if each.code == "accuracy.clock"]
            raise RecordingError(" ".join([span_apart(stamps, poses, "clock_offset"), *named]))

    def _offset_ns(self, sensor: ClockedSensor, given_s: float) -> int:
        if given_s:
            return round(given_s * 1e9)
        found = settled(sensor, self, self._channels.collector)
        if found.warning is not None:
            self._say_once(found.warning.code, found.warning.message)
        return round(found.offset_s * 1e9)

    def _depth_pairs(self) -> Pairs:
        """Compare neighbouring depth images, thinned."""

        def measured() -> Iterator[tuple[int, Floats]]:
            assert self.roles.depth is not None
            due = only(self._depth, run_of(self._depth.stamps_ns, most=_COMPARED_IMAGES))
            for message in self._channels.in_order(self.roles.depth, due):
                assert isinstance(message, Image | CompressedImage)
                try:
                    yield message.stamp_ns, decode_depth(message)[::8, ::8].astype(np.float64)
                except DecodingError:
                    continue  # who reads all images says so

        return compared(measured())

    def _scan_pairs(self) -> Pairs:
        """Compare neighbouring scans."""
        stamps = run_of(self._laser.stamps_ns)
        scans = self.scans(stamps_ns=stamps)
        return compared((scan.stamp_ns, scan.ranges.astype(np.float64)) for scan in scans)

    def _judge(self, config: TopicsConfig, limits: LimitsConfig) -> DepthMeaning:
        """Judge by the floor what depth means, and which calibration is right; say what differs."""
        found = judged(
            self._samples(),
            self._calibrations,
            self.roles,
            config,
            is_height_known=not self.names.base_is_virtual,
        )
        for warning in found.warnings:
            self._say_once(warning.code, warning.message)
        self._calibrations = found.calibrations
        if found.meaning.axes == "body":
            self.roles = replace(self.roles, body_frame=self.names.camera)
            for transform in implied_transforms(self.roles):
                self._channels.collector.add(transform)
            self._place(config, limits)
        return found.meaning

    def _samples(self) -> list[Sample]:
        """Return a few depth images that have poses, as they were decoded."""
        assert self.roles.depth is not None
        stamps = self._depth.stamps_ns
        known = self.fixed_from_bases(stamps)[1] & self.base_from_cameras(stamps)[1]
        due = only(self._depth, spread(stamps[known]))
        images = (
            message
            for message in self._channels.in_order(self.roles.depth, due)
            if isinstance(message, Image | CompressedImage)
        )
        return sampled(images, self.tree, self.names)

    def _learnt_unseen(self) -> Unseen | None:
        """Learn from scans of different places which range stands for nothing seen, and say it."""
        poses, known = self.fixed_from_bases(self.scan_stamps())
        stamps = self.scan_stamps()[known][places_apart(poses[known])]
        unseen = learnt(list(self.scans(stamps_ns=stamps)))
        if unseen is not None and self.roles.laser is not None:
            self._say_once(
                "recording.silent_sensor",
                f"The laser on {self.roles.laser.name} sends {unseen} where it sees nothing; such "
                "beams were taken as free.",
            )
        return unseen

    def _names_without_silent_laser(self) -> FrameNames:
        """Return the frames; drop the laser's, with a warning, if none of its scans has returns."""
        if self.names.laser is None or not is_silent(self.scans()):
            return self.names
        assert self.roles.laser is not None
        self._say_once(
            "recording.silent_sensor",
            f"The laser on {self.roles.laser.name} was not used: none of its "
            f"{len(self.scan_stamps())} scans has returns within its own range.",
        )
        return replace(self.names, laser=None)

    def _span(self) -> tuple[int, int]:
        stamps = [s.stamps_ns for s in (self._depth, self._laser) if len(s.stamps_ns)]
        return min(int(s[0]) for s in stamps), max(int(s[-1]) for s in stamps)

    def _calibrated(self) -> Calibrations:
        """Return the depth camera's calibrations over the drive; warn of those that are wrong."""
        assert self.roles.depth is not None
        assert self.roles.calibration is not None
        first = self.roles.calibration.first
        assert isinstance(first, CameraInfo)
        calibrations, warnings = valid_calibrations(
            self._channels.calibrations or [first],
            topic=self.roles.calibration.name,
            depth=self.roles.depth.name,
            counts=self._channels.calibration_counts,
        )
        for warning in warnings:
            self._say_once(warning.code, warning.message)
        return calibrations

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

    def close(self) -> None:
        """Close the files."""
        self.source.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def open_recording(
    recording: AnyInput, *, topics: TopicsConfig | None = None, limits: LimitsConfig | None = None
) -> Recording:
    """Open a recording, find its topics by role, and read its TF tree.

    ``recording`` is a file or a folder, or several of one drive that are read together. ``topics``
    may name topics and frames; roles that it does not name are found. Close the result, or use it
    as a context manager. Raises `RecordingError` if the file is no recording, or lacks depth, its
    calibration or a pose.
    """
    warnings: list[ProcessWarning] = []
    given = Input.of(recording)
    config, limits = topics or TopicsConfig(), limits or LimitsConfig()
    with cause_named(warnings):
        source = open_source(given, warnings=warnings, limits=limits)
        try:
            part = windowed(source, config.start, config.end)
            return Recording(given, part, topics=config, limits=limits, warnings=warnings)
        except BaseException:
            source.close()
            raise


def _roles(
    source: Source, config: TopicsConfig, limits: LimitsConfig
) -> tuple[Roles, list[ProcessWarning]]:
    topics = list_topics(source, limits)
    names = sorted({channel.topic for channel in source.channels.values()})
    roles, choices = find_roles(topics, config, all_names=names)
    missing = missing_roles(source, roles, topics)
    if missing:
        raise RecordingError(missing[0])
    return roles, choices
