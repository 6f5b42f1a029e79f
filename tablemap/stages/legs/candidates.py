"""Each cluster with the evidence for and against it, and the decision on all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import LegsConfig, SensorsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import CIRCLE, RECTANGLE, SQUARE, ShapeRecord
from tablemap.stages.legs.chairs import chair_like
from tablemap.stages.legs.clusters import Cluster, Persistence, find_clusters, persistence
from tablemap.stages.legs.depth import Reach, reach
from tablemap.stages.legs.ends import UNSEEN, UpperEnd, upper_end
from tablemap.stages.legs.evidence import STOP_POSITION_SIGMA, LegEvidence, gather_evidence, thinned
from tablemap.stages.legs.fit import Fit, Priors, criterion, fit_alone
from tablemap.stages.legs.layout import Frame, are_alike, rectangles, table_sets
from tablemap.stages.legs.primitives import chords, sizes_of
from tablemap.stages.legs.scans import Scans
from tablemap.stages.legs.silhouettes import Segments, Walls, beam_points, find_segments
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted

UNDER_ANOTHER = "stands under the surface that touches the table"

_OWN_TANGENTS = 120  # in a candidate's first fit, which only has to find its place and shape
_LEAST_TANGENTS = 4
_APART = 0.05  # metres, or its size: a fit that ends farther from its cluster found something else
_JUST_BELOW = 0.06  # metres: the depth camera need not see this part just under the top
_UPPER_PART = 0.6  # of the top's height: below it, legs and clutter look alike
_ROUGHNESS, _ROUGHNESS_SHARE = 0.02, 0.1  # metres, share of its size: scatter of a leg's outline
_PANEL = 2.0  # times its width: a shorter thing is a block, not a panel
_BULKY = 0.1  # metres: the laser tells whether wider things are solid
_INSIDE, _INSIDE_SHARE = 0.05, 0.25  # metres, share of a beam's way through: ends in there
_SLIVER = 0.1  # of the silhouettes of the thing beside it
_WIDE = 0.2  # metres: beside legs that carry the top, a wider thing is hardly one of them
_HOLLOW = 0.2  # of the beams that end inside a thing: it is not one solid thing

# The evidence for and against a leg, in one unit. A candidate that the depth camera saw reach the
# top is a leg unless it stands like a chair's. Without such a look, its place must speak for it.
_REACHES_TOP = 3.0  # the depth camera followed it up to the top
_REACHES_BESIDE = 1.0  # the same beyond the top, where the back of a chair reaches as high
_OF_COMPLETE_SET = 2.0  # all its partners stand where the top's symmetry puts them
_OF_PARTIAL_SET = 1.0  # only some partners stand there, or they make up a second set
_IN_THE_MIDDLE = 3.0  # pedestals stand there, and clutter rarely does
_NEAR_A_CORNER = 1.0  # legs stand there, but people and bags do too
_OF_A_CHAIR = -2.5  # it and others stand like the legs of a chair
_BEYOND_THE_TOP = -1.5  # feet may stand there, but so do all things beside the table
_BESIDE_A_SET = -1.0  # the table has a complete set, and the candidate is not part of it
_LEAST_FOR_A_LEG = 1.0


@dataclass(frozen=True, eq=False)
class LegCandidate:
    """A cluster with its own fits by kind.

    ``reason`` says why it is no leg (None: it is one). ``is_open`` tells that the laser says too
    little of it, or sees something else at its foot: the depth camera may still find a leg there.
    ``is_unsure`` tells that it may be a leg for all that was seen, and that only the layout speaks
    against it. ``end`` is what the views saw of its upper end.
    """

    cluster: Cluster
    place: Floats
    points: Floats
    evidence: LegEvidence | None
    fits: dict[ShapeRecord, Fit]
    stayed: Persistence
    reach: Reach
    reason: str | None
    is_open: bool = False
    end: UpperEnd = UNSEEN
    is_unsure: bool = False

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
) -> tuple[list[LegCandidate], Floats, Walls]:
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
) -> LegCandidate:
    members = np.zeros(len(segments), dtype=bool)
    members[cluster.members] = True
    own = segments.only(members)
    ends = points[own.view, (own.first + own.last) // 2]
    radius = 0.5 * cluster.size
    found = LegCandidate(
        cluster, cluster.centre, ends, None, {}, Persistence(0, 0, 0, 0), Reach(0, 0), None
    )
    if frame.is_beside(cluster.centre):
        return replace(found, reason=UNDER_ANOTHER)
    inset = frame.inset(cluster.centre)
    if inset < -config.beyond - (0.0 if cluster.slender else radius):
        return replace(found, reason=f"stands {100 * -inset:.0f} cm beyond the top")
    stops = len(np.unique(scans.groups[own.view]))
    if stops < min(2, len(scans.group_stops)):
        return replace(found, reason="seen from one stop alone", is_open=True)
    evidence = gather_evidence(scans, points, own, own)
    if len(evidence.sigma) < _LEAST_TANGENTS:
        return replace(found, reason="too little of its outline was seen", is_open=True)
    fits = _own_fits(cluster, evidence, frame, sensors)
    found = replace(found, evidence=evidence, fits=fits)
    place = fits[found.kind].parameters[0, :2]
    if np.linalg.norm(place - cluster.centre) > max(_APART, cluster.size):
        return replace(found, reason="its silhouettes do not agree on a place", is_open=True)
    found = replace(found, place=place)
    size = found.size
    stayed = (
        persistence(scans, place, 0.5 * size) if cluster.slender else Persistence(stops, 0, 0, 0)
    )
    highest = frame.surface.height.value - _JUST_BELOW
    # No seat fits under a top as low as a seat: anything that reaches such a top may carry it.
    seat = config.seat_height if highest > config.seat_height else 0.0
    lowest = max(seat, _UPPER_PART * frame.surface.height.value)
    looked = reach(snapshots, poses, place, 0.5 * size, lowest, highest)
    found = replace(found, stayed=stayed, reach=looked)
    found = replace(found, reason=_objection(found, frame, config))
    if found.reason is not None:
        return found
    end = upper_end(snapshots, poses, frame, place, 0.5 * size)
    found = replace(found, end=end)
    if end.is_below:
        return replace(found, reason=f"does not reach the top: {end}")
    # A leg that leans is not above its foot: followed up to the top, it is there all the same.
    if found.cluster.slender and looked.is_free and not end.is_at_top:
        reason = (
            "does not reach the top: the depth camera saw through between them "
            f"{looked.passed} times"
        )
        return replace(found, reason=reason)
    fit = fits[found.kind]
    if fit.rms[0] > _ROUGHNESS + _ROUGHNESS_SHARE * size:
        return replace(found, reason="its silhouettes do not agree on a shape", is_open=True)
    inside = _share_inside(scans, fit)
    if inside > _HOLLOW:
        reason = (
            f"{100 * size:.0f} cm across and not solid: {100 * inside:.0f} % of the laser's beams "
            "at it end inside; it is a base with arms, or several things"
        )
        return replace(found, reason=reason, is_open=True)
    return found


def _share_inside(scans: Scans, fit: Fit) -> float:
    """Return the share of beams through the middle of a bulky thing that end well inside it."""
    values = fit.parameters[0]
    narrow = float(values[sizes_of(fit.kind)].min())
    if narrow < _BULKY:
        return 0.0
    origins, ranges = scans.origins.reshape(-1, 2), scans.ranges.ravel()
    angles = scans.angles.ravel()
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    first, last = chords(fit.kind, values, origins, rays)
    through = last - first
    with np.errstate(invalid="ignore"):
        deep = np.maximum(_INSIDE, _INSIDE_SHARE * through)
        met = (first > 0.0) & (through > 0.5 * narrow) & np.isfinite(ranges)
        met &= (ranges > first - deep) & ~scans.bridged.ravel()
        inside = met & (ranges > first + deep)
    return float(inside.sum() / max(met.sum(), 1))


def _own_fits(
    cluster: Cluster,
    evidence: LegEvidence,
    frame: Frame,
    sensors: SensorsConfig,
) -> dict[ShapeRecord, Fit]:
    """Fit the cluster by itself: the poses are fixed, and their errors go into the sigmas."""
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


def _objection(found: LegCandidate, frame: Frame, config: LegsConfig) -> str | None:
    """Return the reason that by itself rules a candidate out, None if there is none."""
    stayed, size = found.stayed, found.size
    seen = stayed.hit + stayed.passed
    if seen and stayed.share < config.persistence:
        return f"missing in {stayed.passed} of {counted(seen, 'view')} that looked there: it moved"
    central = frame.is_central(found.place)
    if found.kind is RECTANGLE:
        length, width = np.sort(found.fits[RECTANGLE].parameters[0, sizes_of(RECTANGLE)])[::-1]
        thin = config.largest_slender if length > _PANEL * width else config.largest_leg
        panel = width <= thin and length <= 2.0 * frame.half.max() + 0.1
    else:
        width, panel = size, size <= config.largest_leg
    if not panel and not (central and size <= config.largest_pedestal):
        return f"{100 * size:.0f} cm by {100 * width:.0f} cm: too large for a leg"
    if size < config.smallest_leg:
        return f"{1000 * size:.0f} mm across: too thin for a leg"
    return None


def judge(candidates: list[LegCandidate], frame: Frame) -> list[LegCandidate]:
    """Weigh the layout and depth of all candidates, and give a reason to each that is no leg."""
    candidates = _without_fragments(candidates)
    alive = [i for i, candidate in enumerate(candidates) if candidate.reason is None]
    places = np.array([candidate.place for candidate in candidates]).reshape(-1, 2)
    slender = [i for i in alive if candidates[i].cluster.slender]
    wide = [i for i in alive if not candidates[i].cluster.slender]
    complete, partial, own = table_sets(frame, places, slender, wide)
    # Legs of a surface that touches the table form no chair together with the table's legs.
    free = [
        i
        for i, candidate in enumerate(candidates)
        if candidate.cluster.slender and candidate.reason != UNDER_ANOTHER
    ]
    at = {i: k for k, i in enumerate(free)}
    chairs = {free[k] for k in chair_like(frame, places[free], {at[i] for i in own if i in at})}
    judged = list(candidates)
    for i in alive:
        place = candidates[i].place
        signs = _Signs(
            reaches_top=candidates[i].reach.is_up or candidates[i].end.is_at_top,
            in_complete_set=i in complete,
            in_partial_set=i in partial,
            in_chair=i in chairs,
            is_central=frame.is_central(place),
            is_near_corner=frame.near_corner(place),
            is_beyond=frame.is_beyond(place),
            table_has_set=bool(complete),
        )
        if signs.score() < _LEAST_FOR_A_LEG:
            judged[i] = replace(candidates[i], reason=signs.objection(frame.inset(place)))
    return _doubted(_completed(judged, slender, frame), complete, chairs, frame)


def _doubted(
    judged: list[LegCandidate], complete: set[int], chairs: set[int], frame: Frame
) -> list[LegCandidate]:
    """Set aside what no view saw meet the top, if other legs carry it and are made otherwise.

    ``complete`` are the indices of a complete set of legs, ``chairs`` of things that stand like
    chairs' legs. A shin or a post of almost the top's height cannot be told from a leg then.
    """
    legs = [i for i, candidate in enumerate(judged) if candidate.reason is None]
    central = [i for i in legs if frame.is_central(judged[i].place)]
    carry = [i for i in legs if i in complete] or central
    if not carry:
        return judged
    sizes = np.array([judged[i].size for i in carry])
    usual = float(np.median(sizes))
    result = list(judged)
    for i in legs:
        candidate = judged[i]
        # Beside a pedestal, that a thing is as wide as the column says nothing for it.
        alike = bool(complete) and bool(are_alike(np.array([candidate.size]), usual)[0])
        # Beyond the top, things of its height need not touch it.
        meets = candidate.end.is_at_top and not frame.is_beyond(candidate.place)
        if i in carry or i in central or meets or (alike and i not in chairs):
            continue
        # Against such a layout, one view through the gap above it is enough.
        ends = candidate.end.shown > 0 and not candidate.end.opposed
        unseen = candidate.end.hidden
        upper = f"its upper {100 * unseen:.0f} cm" if np.isfinite(unseen) else "its upper end"
        reason = (
            f"{100 * candidate.size:.0f} cm across, and "
            f"{candidate.end if ends else f'no view saw {upper}'}; "
            f"{counted(len(carry), 'leg')} of {100 * usual:.0f} cm {_carry(len(carry))} the top"
        )
        is_unsure = not ends and candidate.cluster.slender and candidate.size <= _WIDE
        result[i] = replace(candidate, reason=reason, is_unsure=is_unsure)
    return result


def _carry(count: int) -> str:
    return "carries" if count == 1 else "carry"


def _completed(judged: list[LegCandidate], slender: list[int], frame: Frame) -> list[LegCandidate]:
    """Accept things under the top that stand in a rectangle with a leg of their own size.

    ``slender`` are those that only their layout or a lack of looks spoke against. The rectangle
    with most legs counts, as long as the table has fewer than four.
    """
    pool = [i for i in slender if not frame.is_beyond(judged[i].place)]
    kept = {k for k, i in enumerate(pool) if judged[i].reason is None}
    if not 0 < len(kept) < _LEGS:
        return judged
    places = np.array([judged[i].place for i in pool])
    fours = rectangles(places, np.array([judged[i].size for i in pool]))
    best = max(fours, key=lambda four: len(kept & set(four)), default=())
    result = list(judged)
    if kept & set(best):
        for k in best:
            result[pool[k]] = replace(judged[pool[k]], reason=None)
    return result


_LEGS = 4


@dataclass(frozen=True)
class _Signs:
    """Signs that tell a leg from clutter: its place, and the looks of the depth camera."""

    reaches_top: bool
    in_complete_set: bool
    in_partial_set: bool
    in_chair: bool
    is_central: bool
    is_near_corner: bool
    is_beyond: bool
    table_has_set: bool

    def score(self) -> float:
        """Return the evidence for a leg minus the evidence against it."""
        score = 0.0
        if self.reaches_top:
            score += _REACHES_BESIDE if self.is_beyond else _REACHES_TOP
        if self.in_complete_set:
            score += _OF_COMPLETE_SET
        elif self.in_partial_set and not (self.in_chair and self.table_has_set):
            score += _OF_PARTIAL_SET
        if self.is_central:
            score += _IN_THE_MIDDLE
        elif self.is_near_corner:
            score += _NEAR_A_CORNER
        if self.in_chair:
            score += _OF_A_CHAIR
        if self.is_beyond:
            score += _BEYOND_THE_TOP
        if self.table_has_set and not self.in_complete_set and not self.is_central:
            score += _BESIDE_A_SET
        return score

    def objection(self, inset: float) -> str:
        """Return the strongest sign against it, at ``inset`` metres inside the outline."""
        if self.in_chair:
            return "stands like the leg of a chair, and was not seen to reach the top"
        if self.is_beyond:
            return f"stands {100 * -inset:.0f} cm beyond the top, without partners"
        if self.table_has_set:
            return "stands inside a complete set of legs, and was not seen to reach the top"
        return "neither its place nor the depth camera shows that it is a leg"


def _without_fragments(candidates: list[LegCandidate]) -> list[LegCandidate]:
    """Reject candidates that overlap one with more evidence: they are pieces of its silhouette."""

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
            # Noisy ranges scatter slivers of a leg: their fit may be small, their spread is not.
            sliver = weight(i) < _SLIVER * weight(k)
            own = max(candidates[i].size, candidates[i].cluster.size if sliver else 0.0)
            reach = 0.5 * (own + candidates[k].size) + 0.01
            if candidates[k].cluster.slender and apart < reach:
                result[i] = replace(candidates[i], reason="a fragment of the leg beside it")
                break
        else:
            kept.append(i)
    return result


def _thinned(points: Floats, segments: Segments) -> Floats:
    """Return the centres (n, 2) of the 1 cm cells in which beams ended."""
    counts = segments.last - segments.first + 1
    view = np.repeat(segments.view, counts)
    beam = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    ends = points[view, beam + np.repeat(segments.first, counts)]
    return (np.unique(np.floor(ends / 0.01).astype(np.int64), axis=0) + 0.5) * 0.01
