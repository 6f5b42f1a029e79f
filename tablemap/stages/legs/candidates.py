"""Each cluster with its own fits, and what by itself rules it out as a leg."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import LegsConfig, SensorsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import CIRCLE, RECTANGLE, SQUARE, ShapeRecord
from tablemap.stages.legs.clusters import Cluster, Persistence, find_clusters, persistence
from tablemap.stages.legs.depth import Reach, reach
from tablemap.stages.legs.ends import UNSEEN, UpperEnd, upper_end
from tablemap.stages.legs.evidence import STOP_POSITION_SIGMA, LegEvidence, gather_evidence, thinned
from tablemap.stages.legs.fit import Fit, Priors, criterion, fit_alone
from tablemap.stages.legs.layout import Frame
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
_HOLLOW = 0.2  # of the beams that end inside a thing: it is not one solid thing


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


def _thinned(points: Floats, segments: Segments) -> Floats:
    """Return the centres (n, 2) of the 1 cm cells in which beams ended."""
    counts = segments.last - segments.first + 1
    view = np.repeat(segments.view, counts)
    beam = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    ends = points[view, beam + np.repeat(segments.first, counts)]
    return (np.unique(np.floor(ends / 0.01).astype(np.int64), axis=0) + 0.5) * 0.01
