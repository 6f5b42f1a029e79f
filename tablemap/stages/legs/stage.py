"""From scans, poses and top to the legs: the flow of the stage."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from threadpoolctl import threadpool_limits

from tablemap.config import LegsConfig, SensorsConfig
from tablemap.errors import ProcessWarning, WarnedPlace
from tablemap.geometry import Floats, Pose2
from tablemap.model.outlines import simple_polygon
from tablemap.recording import Recording
from tablemap.stages.legs.bodies import find_bodies
from tablemap.stages.legs.candidates import LegCandidate, find_candidates
from tablemap.stages.legs.decision import judge
from tablemap.stages.legs.depth import Reach, find_posts, reach
from tablemap.stages.legs.ends import UpperEnd, upper_end
from tablemap.stages.legs.layout import Frame, two_tables
from tablemap.stages.legs.ledges import find_ledge
from tablemap.stages.legs.misread import find_misread_side
from tablemap.stages.legs.missing import infer_missing
from tablemap.stages.legs.posts import accept_posts
from tablemap.stages.legs.result import Legs, RejectedCluster
from tablemap.stages.legs.scans import Scans, gather_scans
from tablemap.stages.legs.shapes import refine
from tablemap.stages.legs.silent import silent_legs
from tablemap.stages.legs.silhouettes import Walls
from tablemap.stages.registration import Registration
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.surface import Surface
from tablemap.words import counted

_STEEPEST = 0.1  # a laser tilted by more than this (radians) does not cut at one height


def find_legs(
    recording: Recording,
    snapshots: tuple[Snapshot, ...],
    registration: Registration,
    surface: Surface,
    *,
    config: LegsConfig,
    sensors: SensorsConfig,
) -> Legs:
    """Find the legs that carry the top: persistent silhouettes under it, each with a primitive.

    The silhouettes come from the scans of all used stops at their registered poses, and from
    selected scans of the drives. The depth camera's views under the top add evidence for or against
    each candidate; without a laser they are the only evidence. A lack of evidence does not raise:
    the warnings say so.
    """
    warnings: list[ProcessWarning] = []
    # Poses by laser match its own scans; without a laser, the fit of the edges corrected the poses.
    corrected = {} if registration.source == "laser" else surface.map_from_base
    poses = {
        index: corrected.get(index, pose)
        for index, pose in enumerate(registration.map_from_base)
        if registration.used[index] and index < len(snapshots)
    }
    polygon = simple_polygon(surface.outline)
    if polygon.is_empty or not poses:
        warnings.append(_warning("legs.none_found", "No view or no outline to look for legs with."))
        return Legs((), (), np.zeros((0, 2)), tuple(warnings))
    frame = Frame(surface, polygon)
    with threadpool_limits(limits=1, user_api="blas"):
        scans = _usable_scans(
            recording, snapshots, registration, frame, poses, config, sensors, warnings
        )
        candidates: list[LegCandidate] = []
        evidence: Floats = np.zeros((0, 2))
        walls: Walls = []
        if scans is not None:
            candidates, evidence, walls = find_candidates(
                scans, snapshots, poses, frame, config=config, sensors=sensors
            )
            candidates = judge(candidates, frame)
        accepted = [candidate for candidate in candidates if candidate.reason is None]
        refined = refine(accepted, scans, registration, frame, sensors=sensors)
        candidates = [c for c in candidates if c.reason is not None] + refined.unsure
        posts = find_posts(
            snapshots,
            poses,
            polygon,
            surface.height.value,
            walls,
            config=config,
            sensors=sensors,
        )

        def end_of(place: Floats, radius: float) -> UpperEnd:
            return upper_end(snapshots, poses, frame, place, radius)

        more, refused = accept_posts(
            posts, refined.legs, candidates, scans, end_of, frame, sensors=sensors
        )
        legs = refined.legs + more
        highest = surface.height.value - 0.06

        def looked(place: Floats, radius: float) -> Reach:
            return reach(snapshots, poses, place, radius, min(0.1, highest), highest)

        warnings += _unsure(candidates)
        legs += infer_missing(legs, candidates, scans, looked, frame, config=config)
        warnings += silent_legs(legs, scans, frame)
    rejected = [
        RejectedCluster(float(c.place[0]), float(c.place[1]), c.points, c.reason)
        for c in candidates
        if c.reason is not None
    ]
    if scans is None and posts:
        evidence = np.concatenate([post.points for post in posts])
        cells = np.unique(np.floor(evidence[:, :2] / 0.01), axis=0)
        evidence = (cells + 0.5) * 0.01
    if not legs:
        warnings.append(_warning("legs.none_found", _none(len(rejected) + len(refused))))
    elif any(leg.status == "inferred" for leg in legs):
        warnings.append(
            _warning("legs.inferred", "A leg that no view could see was placed by symmetry.")
        )
    places = np.array([(leg.x, leg.y) for leg in legs if leg.status == "measured"]).reshape(-1, 2)
    halves = two_tables(frame, places)
    if halves:
        message = "The legs stand like those of two tables that were pushed together."
        warnings.append(_warning("accuracy.two_tables", message, map(WarnedPlace.ring, halves)))
    bodies = find_bodies(
        snapshots,
        poses,
        evidence if scans is not None else np.zeros((0, 2)),
        polygon,
        surface.height.value,
    )
    warnings += [body.warning(bodies[1:]) for body in bodies[:1]]
    ledge = find_ledge(snapshots, poses, polygon, surface.height.value)
    misread = find_misread_side(snapshots, poses, polygon, surface.height.value)
    warnings += [each for each in (ledge, misread) if each is not None]
    return Legs(
        tuple(legs),
        tuple(rejected + refused),
        evidence,
        tuple(warnings),
        refined.beam_half_width,
        refined.range_bias,
    )


def _none(things: int) -> str:
    """Say that no leg was found: none of the things under the top, or nothing was seen there."""
    if things:
        return f"None of {counted(things, 'thing')} is a leg."
    return (
        "Nothing upright was seen under the top, so that no leg is known; record views that look "
        "at the table's corners, with the legs in the image."
    )


def _unsure(candidates: list[LegCandidate]) -> list[ProcessWarning]:
    """Say which things were left out though they may be legs."""
    unsure = [candidate for candidate in candidates if candidate.is_unsure]
    if not unsure:
        return []
    where = ", ".join(f"({c.place[0]:.2f}, {c.place[1]:.2f})" for c in unsure)
    sizes = sorted({f"{100 * c.size:.0f}" for c in unsure}, key=float)
    across = " to ".join(dict.fromkeys((sizes[0], sizes[-1])))
    one = len(unsure) == 1
    message = (
        f"{counted(len(unsure), 'thing')} under the top, {across} cm across, at {where}, may be "
        f"{'a leg' if one else 'legs'}: no view saw {'its' if one else 'their'} upper end. Other "
        f"legs carry the top, so {'it was' if one else 'they were'} left out."
    )
    places = [WarnedPlace.about(c.place, _MARK).standing() for c in unsure]
    return [_warning("accuracy.unsure_legs", message, places)]


_MARK = 0.08  # metres: radius of a circle about a thing that may be a leg


def _usable_scans(
    recording: Recording,
    snapshots: tuple[Snapshot, ...],
    registration: Registration,
    frame: Frame,
    poses: dict[int, Pose2],
    config: LegsConfig,
    sensors: SensorsConfig,
    warnings: list[ProcessWarning],
) -> Scans | None:
    """Gather the scans, or say why there are none that cut the legs."""
    if recording.names.laser is None:
        warnings.append(
            _warning("legs.no_laser", "There is no laser; legs come from the depth camera alone.")
        )
        return None
    mount = recording.base_from_laser(snapshots[min(poses)].stamp_ns)
    tilt = float(np.arccos(np.clip(abs(mount[2, 2]), 0.0, 1.0)))
    if tilt > _STEEPEST or mount[2, 3] > frame.surface.height.value - 0.05:
        warnings.append(
            _warning(
                "legs.no_laser",
                f"The laser, {mount[2, 3]:.2f} m high, tilted by {np.degrees(tilt):.0f} degrees, "
                "does not see the legs; they come from the depth camera alone.",
            )
        )
        return None
    centre: Floats = frame.surface.outline.mean(axis=0)
    scans = gather_scans(
        recording,
        snapshots,
        registration,
        poses,
        centre,
        config=config,
        range_noise=sensors.laser_range_noise,
    )
    if scans is None:
        message = "No scan saw the table; legs come from the depth camera alone."
        warnings.append(_warning("legs.no_laser", message))
    return scans


def _warning(code: str, message: str, places: Iterable[WarnedPlace] = ()) -> ProcessWarning:
    return ProcessWarning(code, "legs", message, places=tuple(places))
