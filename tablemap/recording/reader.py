"""A recording as it is opened: its topics by role, its robot, its clocks and what depth means."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from weakref import WeakMethod

import numpy as np

from tablemap.config import LimitsConfig, TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError, cause_named
from tablemap.geometry import Floats, Ints, planar
from tablemap.inputs import AnyInput, Input
from tablemap.recording.blocked import Blocked, blocked
from tablemap.recording.calibrations import Calibrations, valid_calibrations
from tablemap.recording.carried import carried_warnings
from tablemap.recording.channels import Channels, Stamped, only
from tablemap.recording.depth import decode_depth
from tablemap.recording.depth_meaning import DepthMeaning
from tablemap.recording.judgement import Sample, judged, sampled, spread
from tablemap.recording.laser_meaning import is_plain, told
from tablemap.recording.laser_mount import Mount, said, told_by_wheels, turned_laser
from tablemap.recording.messages import CameraInfo, CompressedImage, DecodingError, Image, LaserScan
from tablemap.recording.pose_topics import read_poses
from tablemap.recording.raw import Source
from tablemap.recording.recent import RecentScans
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
from tablemap.recording.silence import is_silent, is_telling, repeated_elsewhere, shows_much
from tablemap.recording.sources import open_source
from tablemap.recording.streams import SensorStreams
from tablemap.recording.tf.frame_roles import FrameNames, pose_stamps
from tablemap.recording.topics import Topic, list_topics
from tablemap.recording.unseen import Unseen, learnt, places_apart
from tablemap.recording.upright import quarter_turns
from tablemap.recording.window import windowed
from tablemap.words import counted

_COMPARED_IMAGES = 400  # of a camera whose clock may be off


class Recording(SensorStreams):
    """An opened recording. Iterators stream; only the TF tree and the index stay in memory.

    All problems (cut files, bad checksums, undecodable messages) are appended to ``warnings`` when
    they are found. Close it, or use it as a context manager.
    """

    input: Input
    start_ns: int
    end_ns: int

    def __init__(
        self,
        input: Input,
        source: Source,
        *,
        topics: TopicsConfig,
        limits: LimitsConfig,
        warnings: list[ProcessWarning],
    ) -> None:
        super().__init__(warnings)
        self.input = input
        self.source = source
        self.warnings.extend(carried_warnings(source))
        self.roles, choices = _roles(source, topics, limits)
        self.warnings.extend(choice for choice in choices if choice not in self.warnings)
        assert self.roles.depth is not None
        assert self.roles.calibration is not None
        say = _held_weakly(self._say_once)
        self._channels = Channels(source, self.roles, limits=limits, say=say)
        self._depth, self._colour = (
            self._channels.of(topic) for topic in (self.roles.depth, self.roles.colour)
        )
        self._calibrations = self._calibrated()
        self._check_first_depth()
        self._place(topics, limits)
        self._laser = self._channels.of(self.roles.laser)
        self._read_laser_meaning()
        self._settle_clocks(topics)
        self._laser = self._without_repeated_scans()
        self._depth = self._without_repeated_images()
        self._meaning, self._filler = self._judge(topics, limits)
        mounts, known = self.base_from_cameras(spread(self._depth.stamps_ns))
        self._turns = quarter_turns(mounts[known])
        self._pose_stamps = pose_stamps(self.tree, self.names.fixed, self.names.carrier)
        self.start_ns, self.end_ns = self._span()
        self._unseen, self._blocked = self._learnt_of_scans()
        self._settle_laser_mount()
        self._recent = RecentScans()  # from here on scans come out as they stay
        self.names = self._names_without_silent_laser()

    @property
    def path(self) -> Path:
        """The path, or the first of several."""
        return self.input.path

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
                "laser",
                self.names.laser,
                "laser_clock_offset",
                self._laser,
                self._scan_pairs,
                is_cheap=True,
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
        """Compare neighbouring scans, each at the middle of its sweep: the stamp is its begin."""
        scans = self.scans(stamps_ns=run_of(self._laser.stamps_ns))
        return compared(
            (scan.stamp_ns + round(scan.sweep_seconds / 2 * 1e9), scan.ranges.astype(np.float64))
            for scan in scans
        )

    def _judge(
        self, config: TopicsConfig, limits: LimitsConfig
    ) -> tuple[DepthMeaning, float | None]:
        """Judge by a few images what depth means, what stands for nothing, and which calibration.

        What differs from what is recorded is said.
        """
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
        return found.meaning, found.filler

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

    def _read_laser_meaning(self) -> None:
        """Learn the units of the laser's scans, and say them where they are not ROS's."""
        laser = self.roles.laser
        if laser is None or self.names.laser is None:
            return
        assert isinstance(laser.first, LaserScan)
        if is_plain(laser.first):
            return
        stamps = self.scan_stamps()
        poses, known = self.driven_bases(stamps)
        apart = places_apart(poses[known])
        scans = list(self.scans(stamps_ns=stamps[known][apart]))
        if not scans:
            return
        mount = Mount.of(self.base_from_laser(scans[0].stamp_ns))
        bases = planar(poses[known][apart])
        self._laser_meaning, said = told(scans, bases, mount, laser.name)
        for warning in said:
            self._say_once(warning.code, warning.message)
        if not self._laser_meaning.is_usable:
            self.names = replace(self.names, laser=None)

    def _without_repeated_scans(self) -> Stamped:
        """Return the laser's scans without those that a hung driver sent again from elsewhere."""
        have, laser = self._laser, self.roles.laser
        if laser is None or self.names.laser is None:
            return have

        def telling(stamps_ns: Ints) -> list[int]:
            return [s.stamp_ns for s in self.scans(stamps_ns=stamps_ns) if is_telling(s)]

        return self._without_repeats(laser, have, telling, "laser", "scan")

    def _without_repeated_images(self) -> Stamped:
        """Return the depth images without those that a hung driver sent again from elsewhere."""
        depth = self.roles.depth
        assert depth is not None

        def telling(stamps_ns: Ints) -> list[int]:
            told = []
            for message in self._channels.in_order(depth, only(self._depth, stamps_ns)):
                assert isinstance(message, Image | CompressedImage)
                with suppress(DecodingError):
                    if shows_much(decode_depth(message)):
                        told.append(message.stamp_ns)
            return told

        return self._without_repeats(depth, self._depth, telling, "camera", "image")

    def _without_repeats(
        self,
        topic: Topic,
        have: Stamped,
        telling: Callable[[Ints], list[int]],
        sensor: str,
        noun: str,
    ) -> Stamped:
        """Return a topic's messages without what a hung driver sent again, and say it.

        ``telling`` returns of some stamps those whose messages no other place gives.
        """
        contents = self._channels.contents(topic)
        different = len(np.unique(contents))
        if len(contents) != len(have.stamps_ns) or not 2 < different < len(contents):
            return have
        poses, known = self.driven_bases(have.stamps_ns)
        repeats = repeated_elsewhere(contents, poses, known)
        firsts = np.unique(repeats[repeats >= 0])
        if not len(firsts):
            return have
        told = np.searchsorted(have.stamps_ns, telling(have.stamps_ns[firsts]))
        gone = np.isin(repeats, told)
        if gone.any():
            first_ns = int(have.stamps_ns[gone][0])
            self._say_once(
                "recording.silent_sensor",
                f"The {sensor} on {topic.name} sent old {noun}s again, equal to the last digit, "
                f"while the robot moved: {gone.sum()} of {counted(len(gone), noun)} were left out, "
                f"the first {(first_ns - int(have.stamps_ns[0])) / 1e9:.1f} s after the first "
                f"{noun}; look for a driver that hangs.",
                first_ns,
            )
        return Stamped(have.stamps_ns[~gone], have.log_times_ns[~gone])

    def _learnt_of_scans(self) -> tuple[Unseen | None, Blocked | None]:
        """Learn from scans of different places which ranges are no thing of the room, and say it.

        They stand for nothing seen, or are parts of the robot itself.
        """
        poses, known = self.fixed_from_bases(self.scan_stamps())
        stamps = self.scan_stamps()[known][places_apart(poses[known])]
        scans = list(self.scans(stamps_ns=stamps))
        if self.roles.laser is None or not scans:
            return None, None
        unseen, own = learnt(scans), blocked(scans)
        if unseen is not None:
            self._say_once(
                "recording.silent_sensor",
                f"The laser on {self.roles.laser.name} sends {unseen} where it sees nothing; such "
                "beams were taken as free.",
            )
        if own is not None:
            self._say_once(
                "recording.own_body",
                f"The laser on {self.roles.laser.name} sees the robot itself in {own}; they were "
                "left out.",
            )
        return unseen, own

    def _settle_laser_mount(self) -> None:
        """Turn the laser as its own scans have it, and say where TF has it wrong."""
        laser, names = self.roles.laser, self.names
        if laser is None or names.laser is None or names.odom is None:
            return
        if self.tree.moving_edges(names.carrier, names.laser):
            return
        stamps = self.scan_stamps()
        poses, known = self.odom_from_bases(stamps)
        scans = list(self.scans(stamps_ns=stamps[known][places_apart(poses[known])]))
        # A scan shows the room as of the middle of its sweep.
        middles = [scan.stamp_ns + round(scan.sweep_seconds / 2 * 1e9) for scan in scans]
        poses, known = self.odom_from_bases(np.array(middles, dtype=np.int64))
        if not known.any():
            return
        scans = [scan for scan, is_known in zip(scans, known, strict=True) if is_known]
        given = Mount.of(self.base_from_laser(scans[0].stamp_ns))
        told = told_by_wheels(scans, planar(poses[known]), given)
        if told.mount != given:
            self.tree = turned_laser(self.tree, names.laser, given, told.mount)
        message = said(told, given, topic=laser.name, base=names.base, frame=names.laser)
        if message:
            self._say_once("accuracy.laser_mounting", message)

    def _names_without_silent_laser(self) -> FrameNames:
        """Return the frames; drop the laser's, with a warning, if none of its scans has returns."""
        if self.names.laser is None or not is_silent(self.scans()):
            return self.names
        assert self.roles.laser is not None
        self._say_once(
            "recording.silent_sensor",
            f"The laser on {self.roles.laser.name} was not used: none of its "
            f"{counted(len(self.scan_stamps()), 'scan')} has returns within its own range.",
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


def _held_weakly(method: Callable[..., None]) -> Callable[..., None]:
    """Return what calls a method as long as its object is there.

    A recording that held itself would stay in memory until garbage is collected.
    """
    held = WeakMethod(method)

    def call(*arguments: object) -> None:
        if known := held():
            known(*arguments)

    return call


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
