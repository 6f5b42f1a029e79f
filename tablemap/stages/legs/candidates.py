"""Each cluster with what speaks for and against it, and the verdict on all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import LegsConfig, SensorsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import CIRCLE, RECTANGLE, SQUARE, ShapeRecord
from tablemap.stages.legs.chairs import chair_like
from tablemap.stages.legs.clusters import Cluster, Persistence, find_clusters, persistence
from tablemap.stages.legs.depth import Reach, reach
from tablemap.stages.legs.evidence import (
    STOP_POSITION_SIGMA,
    Evidence,
    gather_evidence,
    thinned,
)
from tablemap.stages.legs.fit import Fit, Priors, criterion, fit_alone
from tablemap.stages.legs.layout import Frame, table_sets
from tablemap.stages.legs.primitives import sizes_of
from tablemap.stages.legs.scans import Scans
from tablemap.stages.legs.silhouettes import Segments, Walls, beam_points, find_segments
from tablemap.stages.snapshots import Snapshot

UNDER_ANOTHER = "stands under the surface that touches the table"

_OWN_TANGENTS = 120  # of a candidate's first fit, which only has to find its place and shape


@dataclass(frozen=True, eq=False)
class Candidate:
    """A cluster with its own fits by kind. ``reason`` says why it is no leg (None: it is one)."""

    cluster: Cluster
    place: Floats
    points: Floats
    evidence: Evidence | None
    fits: dict[ShapeRecord, Fit]
    stayed: Persistence
    reach: Reach
    reason: str | None

    @property
    def kind(self) -> ShapeRecord:
        """The shape that its own evidence prefers."""
        return min(self.fits, key=lambda kind: criterion(self.fits[kind]))

    @property
    def size(self) -> float:
        """The larger extent of its preferred shape."""
        if not self.fits:
            return self.cluster.size
        fit = self.fits[self.kind]
        return float(fit.parameters[0, sizes_of(self.kind)].max())


def find_candidates(
    scans: Scans,
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    frame: Frame,
    *,
    config: LegsConfig,
    sensors: SensorsConfig,
) -> tuple[list[Candidate], Floats, Walls]:
    """Return all clusters under or near the top, the thinned evidence (n, 2) in the map, walls."""
    points = beam_points(scans)
    segments, walls = find_segments(scans, points, frame.polygon)
    candidates = [
        _judged(scans, points, segments, cluster, snapshots, poses, frame, config, sensors)
        for cluster in find_clusters(scans, points, segments, config=config)
    ]
    return candidates, _thinned(points, segments), walls


def _judged(
    scans: Scans,
    points: Floats,
    segments: Segments,
    cluster: Cluster,
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    frame: Frame,
    config: LegsConfig,
    sensors: SensorsConfig,
) -> Candidate:
    members = np.zeros(len(segments), dtype=bool)
    members[cluster.members] = True
    own = segments.only(members)
    ends = points[own.view, (own.first + own.last) // 2]
    radius = 0.5 * cluster.size
    found = Candidate(
        cluster, cluster.centre, ends, None, {}, Persistence(0, 0, 0), Reach(0, 0), None
    )
    if frame.is_beside(cluster.centre):
        return replace(found, reason=UNDER_ANOTHER)
    inset = frame.inset(cluster.centre)
    if inset < -config.beyond - (0.0 if cluster.slender else radius):
        return replace(found, reason=f"stands {100 * -inset:.0f} cm beyond the top")
    stops = len(np.unique(scans.groups[own.view]))
    if stops < min(2, len(scans.group_stops)):
        return replace(found, reason="seen from one stop alone")
    evidence = gather_evidence(scans, points, own, own)
    if len(evidence.sigma) < 4:
        return replace(found, reason="too little of its outline seen")
    fits = _own_fits(cluster, evidence, frame, sensors)
    found = replace(found, evidence=evidence, fits=fits)
    place = fits[found.kind].parameters[0, :2]
    if np.linalg.norm(place - cluster.centre) > max(0.05, cluster.size):
        return replace(found, reason="its silhouettes do not agree on a place")
    found = replace(found, place=place)
    size = found.size
    stayed = persistence(scans, place, 0.5 * size) if cluster.slender else Persistence(stops, 0, 0)
    highest = frame.surface.height.value - 0.06
    # No seat goes under a top as low as one: there all that stands up to it may carry it.
    seat = config.seat_height if highest > config.seat_height else 0.0
    lowest = max(seat, 0.6 * frame.surface.height.value)
    looked = reach(snapshots, poses, place, 0.5 * size, lowest, highest)
    found = replace(found, stayed=stayed, reach=looked)
    return replace(found, reason=_objection(found, frame, config))


def _own_fits(
    cluster: Cluster,
    evidence: Evidence,
    frame: Frame,
    sensors: SensorsConfig,
) -> dict[ShapeRecord, Fit]:
    """Fit the cluster by itself: poses are held, and what they may be off goes into the sigmas."""
    few = thinned(evidence, _OWN_TANGENTS)
    alone = replace(
        few,
        sigma=np.hypot(few.sigma, STOP_POSITION_SIGMA),
        hit_sigma=np.hypot(few.hit_sigma, STOP_POSITION_SIGMA),
    )
    priors = Priors(
        None, (sensors.laser_beam_half_width, 1e-4), (0.0, sensors.laser_range_bias_sigma)
    )
    kinds = [CIRCLE, SQUARE, RECTANGLE]
    if not cluster.slender and not frame.is_central(cluster.centre):
        kinds = [SQUARE, RECTANGLE]
    yaw = frame.surface.pose.yaw
    return {
        kind: fit_alone(kind, alone, cluster.centre, cluster.size, yaw, priors=priors)
        for kind in kinds
    }


def _objection(found: Candidate, frame: Frame, config: LegsConfig) -> str | None:
    """Return what alone rules a candidate out."""
    stayed, size = found.stayed, found.size
    seen = stayed.hit + stayed.passed
    if seen and stayed.share < config.persistence:
        return f"gone in {stayed.passed} of {seen} views that looked there: it moved"
    central = frame.is_central(found.place)
    if found.kind is RECTANGLE:
        length, width = np.sort(found.fits[RECTANGLE].parameters[0, sizes_of(RECTANGLE)])[::-1]
        panel = width <= config.largest_slender and length <= 2.0 * frame.half.max() + 0.1
    else:
        width, panel = size, size <= config.largest_leg
    if not panel and not (central and size <= config.largest_pedestal):
        return f"{100 * size:.0f} cm by {100 * width:.0f} cm: too large for a leg"
    if size < config.smallest_leg:
        return f"{1000 * size:.0f} mm across: too thin for a leg"
    fit = found.fits[found.kind]
    if fit.rms[0] > 0.02 + 0.1 * size:
        return "its silhouettes do not agree on a shape"
    if found.cluster.slender and found.reach.is_free:
        return (
            f"does not reach the top: {found.reach.passed} looks of the depth camera passed "
            "between it and the top"
        )
    return None


def judge(candidates: list[Candidate], frame: Frame) -> list[Candidate]:
    """Weigh layout and depth over all candidates, and give those that are no legs a reason."""
    candidates = _without_fragments(candidates)
    alive = [i for i, candidate in enumerate(candidates) if candidate.reason is None]
    places = np.array([candidate.place for candidate in candidates]).reshape(-1, 2)
    slender = [i for i in alive if candidates[i].cluster.slender]
    wide = [i for i in alive if not candidates[i].cluster.slender]
    complete, partial, own = table_sets(frame, places, slender, wide)
    # Legs of what touches the table make no chair together with the table's.
    free = [
        i
        for i, candidate in enumerate(candidates)
        if candidate.cluster.slender and candidate.reason != UNDER_ANOTHER
    ]
    at = {i: k for k, i in enumerate(free)}
    chairs = {free[k] for k in chair_like(frame, places[free], {at[i] for i in own if i in at})}
    judged = list(candidates)
    for i in alive:
        candidate = candidates[i]
        inset = frame.inset(candidate.place)
        central, beyond = frame.is_central(candidate.place), frame.is_beyond(candidate.place)
        score = 0.0
        # Beyond the top a chair's back stands up to it too.
        score += 0.0 if not candidate.reach.is_up else 1.0 if beyond else 3.0
        score += 2.0 if i in complete else 1.0 if i in partial else 0.0
        score += 3.0 if central else 1.0 if frame.near_corner(candidate.place) else 0.0
        score -= 2.5 if i in chairs else 0.0
        score -= 1.5 if beyond else 0.0
        score -= 1.0 if complete and i not in complete and not central else 0.0
        if score < 1.0:
            reason = _weighed(i in chairs, inset, beyond, bool(complete))
            judged[i] = replace(candidate, reason=reason)
    return judged


def _without_fragments(candidates: list[Candidate]) -> list[Candidate]:
    """Set aside what overlaps a candidate with more evidence: a piece of the same silhouette."""

    def weight(i: int) -> int:
        evidence = candidates[i].evidence
        return len(evidence.sigma) if evidence is not None else 0

    kept: list[int] = []
    result = list(candidates)
    for i in sorted(range(len(candidates)), key=weight, reverse=True):
        if candidates[i].reason is not None:
            continue
        for k in kept:
            apart = np.linalg.norm(candidates[i].place - candidates[k].place)
            sizes = sorted((candidates[i].size, candidates[k].size))
            if candidates[k].cluster.slender and apart < 0.5 * sum(sizes) + 0.01:
                result[i] = replace(candidates[i], reason="a fragment of the leg beside it")
                break
        else:
            kept.append(i)
    return result


def _weighed(is_chair: bool, inset: float, is_beyond: bool, has_set: bool) -> str:
    if is_chair:
        return "stands as a chair's leg does, and was not seen to reach the top"
    if is_beyond:
        return f"stands {100 * -inset:.0f} cm beyond the top, without partners"
    if has_set:
        return "stands inside a complete set of legs, and was not seen to reach the top"
    return "neither its place nor the depth camera tell it from clutter"


def _thinned(points: Floats, segments: Segments) -> Floats:
    """Return the centres (n, 2) of the 1 cm cells in which beams ended."""
    counts = segments.last - segments.first + 1
    view = np.repeat(segments.view, counts)
    beam = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    ends = points[view, beam + np.repeat(segments.first, counts)]
    return (np.unique(np.floor(ends / 0.01).astype(np.int64), axis=0) + 0.5) * 0.01
