"""How fit a recording is for processing: for each role missing, weak or fine, and why.

Nothing is modelled. Stamps and transforms are read whole, as processing reads them; of the images
and scans a few are decoded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tablemap.config import Config
from tablemap.errors import ProcessWarning, TablemapError, with_cause
from tablemap.geometry import Bools, Floats, Ints
from tablemap.inputs import AnyInput
from tablemap.recording import Recording, open_recording
from tablemap.recording import inspect as read_info
from tablemap.recording.info import RecordingInfo, RoleFitness
from tablemap.stages.snapshots import Viewpoint, find_viewpoints
from tablemap.words import counted

FEW_IMAGES = 8
LEAST_MEASURED = 0.5
"""Share of a depth image's pixels; black, glossy or far surfaces measure less."""
COARSE_STEP = 0.025
"""Metres between neighbouring depths within `NEAR`; a Kinect has 11 mm at 2 m."""
NEAR = 2.5
LONGEST_GAP, MOVED = 1.0, 0.05
"""Seconds without a pose, in which the base moved so many metres: how, is a guess."""
LEAST_STOPS = 5
WIDEST_ANGLE = 100.0
"""Degrees round the table without a view; neighbouring views then share no side."""
LEAST_LASER_ANGLE = 150.0
LEAST_RETURNS = 0.3

_OF_CALIBRATION = (
    "accuracy.calibrations_disagree",
    "accuracy.calibration_flawed",
    "accuracy.depth_meaning",
    "accuracy.floor",
)


def inspect(recording: AnyInput, *, config: Config | None = None) -> RecordingInfo:
    """Return what a recording holds, what processing lacks, and how fit each role is.

    ``config`` may name topics and frames; roles that it does not name are found. Raises
    `RecordingError` if the file is no recording, or lacks the named topics.
    """
    config = config or Config()
    info = read_info(recording, topics=config.topics, limits=config.limits)
    if info.missing:
        return replace(info, fitness=_absent(info))
    try:
        with open_recording(recording, topics=config.topics, limits=config.limits) as opened:
            fitness = tuple(_judged(opened, config, info.warnings))
    except TablemapError as error:  # what only a whole reading shows
        missing = (with_cause(str(error), info.warnings),)
        return replace(info, missing=missing, fitness=_absent(info))
    return replace(info, fitness=fitness)


def _absent(info: RecordingInfo) -> tuple[RoleFitness, ...]:
    """Return the roles that no topic has."""
    there = {topic.role for topic in info.topics}
    # Which calibration is the depth camera's is not known without it.
    roles = ("depth", "calibration", "laser") if "depth" in there else ("depth", "laser")
    found = [RoleFitness(role, "missing", "no such topic") for role in roles if role not in there]
    if not there & {"transforms", "pose"}:
        found.append(RoleFitness("localisation", "missing", "neither /tf nor a topic of poses"))
    return tuple(found)


def _judged(
    recording: Recording, config: Config, warnings: tuple[ProcessWarning, ...]
) -> Iterator[RoleFitness]:
    kind, viewpoints, _ = find_viewpoints(
        recording, config=config.snapshots, sensors=config.sensors
    )
    yield _depth(recording, viewpoints)
    yield _calibration(recording, warnings)
    yield _localisation(recording)
    yield _stops(recording, kind, viewpoints)
    yield _laser(recording, viewpoints)
    yield _odometry(recording)
    yield _clocks(recording)


def _depth(recording: Recording, viewpoints: list[Viewpoint]) -> RoleFitness:
    """Judge which part of the images is measured, and in which steps."""
    middles = np.array([each.stamps_ns[len(each.stamps_ns) // 2] for each in viewpoints])
    frames = list(recording.depth_frames(_few(middles)))
    images = counted(len(recording.depth_stamps()), "image")
    if not frames:
        return RoleFitness("depth", "missing", f"{images}, and none of {len(middles)} decoded")
    measured = float(np.median([np.isfinite(frame.depth).mean() for frame in frames]))
    height, width = frames[0].depth.shape
    says = f"{images} of {width} x {height}, {100 * measured:.0f} % of their pixels measured"
    step = float(np.median([_step(frame.depth) for frame in frames]))
    if step > COARSE_STEP:
        return RoleFitness("depth", "weak", f"{says}; depth is in steps of {1000 * step:.0f} mm")
    if measured < LEAST_MEASURED:
        return RoleFitness("depth", "weak", f"{says}; light, gloss or distance took the others")
    return RoleFitness("depth", "fine", says)


def _step(depth: NDArray[np.float32]) -> float:
    """Return the usual distance of neighbouring values of a depth image that are near, metres."""
    near = depth[np.isfinite(depth) & (depth < NEAR)]
    values = np.unique(np.round(near, 4))
    return float(np.median(np.diff(values))) if len(values) > 1 else 0.0


def _calibration(recording: Recording, warnings: tuple[ProcessWarning, ...]) -> RoleFitness:
    known = {(each.code, each.message) for each in chain(warnings, recording.warnings)}
    doubts = sorted(message for code, message in known if code in _OF_CALIBRATION)
    if doubts:
        return RoleFitness("calibration", "weak", " ".join(doubts))
    k = recording.camera_info().k
    return RoleFitness("calibration", "fine", f"fx {k[0, 0]:.1f}, fy {k[1, 1]:.1f} pixels")


def _localisation(recording: Recording) -> RoleFitness:
    """Judge which of the images have a pose, and how long there was none while it was needed."""
    stamps = recording.depth_stamps()
    known = recording.fixed_from_bases(stamps)[1]
    placed = f"{int(known.sum())} of {counted(len(stamps), 'depth image')} placed"
    gap = _longest_gap(recording)
    says = f"{recording.names.base} in {recording.names.fixed}, {placed}"
    if not known.all():
        return RoleFitness("localisation", "weak", f"{says}, others beside or in a gap of /tf")
    if gap > LONGEST_GAP:
        return RoleFitness(
            "localisation", "weak", f"{says}; for {gap:.1f} s of motion no pose was recorded"
        )
    return RoleFitness("localisation", "fine", says)


def _longest_gap(recording: Recording) -> float:
    """Return for how long no pose was recorded while the base moved, seconds.

    Poses that are as rare as the images are one for each image, and no gap.
    """
    stamps, images = recording.pose_stamps(), recording.depth_stamps()
    stamps = stamps[(stamps >= images[0]) & (stamps <= images[-1])]
    if len(stamps) <= len(images):
        return 0.0
    places = recording.fixed_from_bases(stamps)[0][:, :3, 3]
    moved = np.linalg.norm(np.diff(places, axis=0), axis=1) > MOVED
    return float(np.max(np.diff(stamps)[moved], initial=0)) / 1e9


def _stops(recording: Recording, kind: str, viewpoints: list[Viewpoint]) -> RoleFitness:
    """Judge the number of viewpoints, and how they lie round what the camera looked at."""
    stamps = np.array([each.middle_ns for each in viewpoints])
    bases, placed = recording.fixed_from_bases(stamps)
    mounts, mounted = recording.base_from_cameras(stamps)
    gap = _widest_gap(bases @ mounts, placed & mounted)
    named = "stop" if kind == "stops" else "view"
    says = counted(len(viewpoints), named)
    if kind != "stops":
        says += " of a drive that never stood still"
    if gap is not None:
        says += f", at most {gap:.0f} degrees apart round what the camera looked at"
    if len(viewpoints) < LEAST_STOPS:
        return RoleFitness("stops", "weak", f"{says}; six to ten are better")
    if gap is not None and gap > WIDEST_ANGLE:
        return RoleFitness("stops", "weak", f"{says}; close the lap")
    return RoleFitness("stops", "fine", says)


def _widest_gap(map_from_cameras: Floats, known: Bools) -> float | None:
    """Return the widest angle between neighbouring cameras round the point they look at, degrees.

    ``map_from_cameras`` is (n, 4, 4). The point is the nearest one to all optical axes, in the
    plane; None where they have none in front of them.
    """
    places = map_from_cameras[known, :2, 3]
    axes = map_from_cameras[known, :2, 2]
    size = np.linalg.norm(axes, axis=1)
    level = size > 0.2  # a camera that looks straight down has no direction in the plane
    places, axes = places[level], axes[level] / size[level, None]
    if len(places) < 2:
        return None
    across = np.stack([-axes[:, 1], axes[:, 0]], axis=1)
    centre, _, rank, _ = np.linalg.lstsq(across, np.einsum("ni,ni->n", across, places), rcond=0.05)
    towards = np.einsum("ni,ni->n", axes, centre - places)
    if rank < 2 or (towards > 0).mean() < 0.7:
        return None
    bearings = np.sort(np.arctan2(*(places - centre).T[::-1]))
    return float(np.degrees(np.diff(np.append(bearings, bearings[0] + 2 * np.pi)).max()))


def _laser(recording: Recording, viewpoints: list[Viewpoint]) -> RoleFitness:
    """Judge the angle that the laser covers, and which part of its beams come back."""
    if recording.roles.laser is None or recording.names.laser is None:
        return RoleFitness("laser", "missing", "the views are placed by depth, less exactly")
    stamps = recording.scan_stamps()
    scans = list(recording.scans(stamps_ns=_few(stamps)))
    if not scans:
        return RoleFitness("laser", "missing", f"{counted(len(stamps), 'scan')}, and none decoded")
    angle = float(np.median([np.degrees(np.ptp(scan.angles)) for scan in scans]))
    returns = float(
        np.median(
            [
                np.mean((scan.ranges > scan.range_min) & (scan.ranges < scan.range_max))
                for scan in scans
            ]
        )
    )
    without = sum(
        not np.any((stamps >= each.start_ns - 10**8) & (stamps <= each.end_ns + 10**8))
        for each in viewpoints
    )
    number = counted(len(stamps), "scan")
    says = f"{number} of {angle:.0f} degrees, {100 * returns:.0f} % of beams return"
    wrong = [each.message for each in recording.warnings if each.code == "accuracy.laser_mounting"]
    if wrong:
        return RoleFitness("laser", "weak", f"{says}; {wrong[0]}")
    if without:
        return RoleFitness("laser", "weak", f"{says}; {counted(without, 'view')} without a scan")
    if angle < LEAST_LASER_ANGLE:
        return RoleFitness("laser", "weak", f"{says}; a wider view places the stops better")
    if returns < LEAST_RETURNS:
        return RoleFitness("laser", "weak", f"{says}; let it see walls or furniture")
    return RoleFitness("laser", "fine", says)


def _odometry(recording: Recording) -> RoleFitness:
    names = recording.names
    if names.odom is None:
        return RoleFitness("odometry", "missing", "without wheels, all rests on the other sensors")
    stamps = recording.depth_stamps()
    known = recording.odom_from_bases(stamps)[1]
    says = f"{names.base} in {names.odom}, {int(known.sum())} of {counted(len(stamps), 'image')}"
    return RoleFitness("odometry", "fine" if known.all() else "weak", says)


def _clocks(recording: Recording) -> RoleFitness:
    """Tell how long after their stamps messages were logged, and what that says of the clocks."""
    codes: dict[str, Literal["weak", "fine"]] = {
        "accuracy.clock": "weak",
        "recording.clock": "fine",
    }
    for code, state in codes.items():
        said = [each.message for each in recording.warnings if each.code == code]
        if said:
            return RoleFitness("clocks", state, " ".join(said))
    lags = ", ".join(f"{name} {1000 * lag:.0f} ms" for name, lag in recording.lags().items())
    return RoleFitness("clocks", "fine", f"logged after their stamps: {lags}")


def _few(stamps_ns: Ints) -> Ints:
    """Return a few of the stamps, spread evenly."""
    places = np.linspace(0, len(stamps_ns) - 1, min(FEW_IMAGES, len(stamps_ns)))
    return np.sort(stamps_ns)[np.unique(places.astype(np.int64))]
