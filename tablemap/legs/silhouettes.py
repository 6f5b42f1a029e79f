"""Segments of a scan near the table: their tangents, their depth, and which are walls."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from tablemap.config import LegsConfig
from tablemap.geometry import Floats
from tablemap.legs.scans import Scans

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_STEP_NOISES = 4.0  # a range step is real from this many sigmas of a beam difference
_STEP_INCIDENCE = 2.5  # and above what a surface at 68 degrees incidence makes of one beam's angle


@dataclass(frozen=True, eq=False)
class Segments:
    """S runs of neighbouring beams without a jump, all ends given in the map.

    ``view`` (S,) is the scan, ``first`` and ``last`` (S,) its beams. ``centre`` (S, 2) is where the
    middle of a round thing with this silhouette would be, ``range`` (S,) the mean, ``width`` (S,)
    across the rays. ``low`` and ``high`` (S,) say that this end is a silhouette: the neighbour lies
    farther or saw nothing. ``between`` (S,) marks single beams that lie in a jump between two
    surfaces, as a wide spot does. ``inside`` (S,) is the share of points under the top or a
    little beyond, ``wall`` (S,) what belongs to a line that leads on beyond it.
    """

    view: Ints
    first: Ints
    last: Ints
    centre: Floats
    range: Floats
    width: Floats
    low: Bools
    high: Bools
    between: Bools
    inside: Floats
    wall: Bools

    def __len__(self) -> int:
        return len(self.view)

    def only(self, keep: Bools) -> Segments:
        """Return the segments that ``keep`` (S,) selects."""
        return Segments(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})


def beam_points(scans: Scans) -> Floats:
    """Return (V, B, 2) beam ends in the map, NaN where nothing came back."""
    ranges = np.where(np.isfinite(scans.ranges), scans.ranges, np.nan)
    directions = np.stack([np.cos(scans.angles), np.sin(scans.angles)], axis=-1)
    ends: Floats = scans.origins + ranges[..., None] * directions
    return ends


def find_segments(
    scans: Scans, points: Floats, outline: Polygon, *, config: LegsConfig
) -> Segments:
    """Cut every scan where the range jumps, and keep what ends near the table."""
    beams = scans.ranges.shape[1]
    hit = np.isfinite(scans.ranges)
    reach = np.where(hit, scans.ranges, np.inf)
    nearer = np.minimum(reach[:, 1:], reach[:, :-1])
    near_both = hit[:, 1:] & hit[:, :-1]
    finite = np.where(hit, scans.ranges, 0.0)
    step = np.where(near_both, np.abs(finite[:, 1:] - finite[:, :-1]), np.inf)
    allowed = (
        0.01
        + _STEP_NOISES * np.maximum(np.sqrt(2.0) * scans.noise, 0.004)[:, None]
        + _STEP_INCIDENCE * np.where(near_both, nearer, 0.0) * scans.spacing[:, None]
    )
    starts = hit.copy()
    starts[:, 1:] &= step > allowed
    view, first = np.nonzero(starts)
    ends = hit.copy()
    ends[:, :-1] &= step > allowed
    last = np.nonzero(ends)[1]

    everything = np.nan_to_num(points, nan=1e9)
    inside = _within(everything, outline, config.margin)
    counts = (last - first + 1).astype(np.float64)
    share = _sums(inside.astype(np.float64), view, first, last) / counts
    mean_range = _sums(np.where(hit, scans.ranges, 0.0), view, first, last) / counts
    angle_low, angle_high = scans.angles[view, first], scans.angles[view, last]
    spacing = scans.spacing[view]
    width = (angle_high - angle_low + spacing) * mean_range
    middle = 0.5 * (angle_low + angle_high)
    direction = np.stack([np.cos(middle), np.sin(middle)], axis=1)
    origin = scans.origins[view, (first + last) // 2]
    centre = origin + (mean_range + 0.39 * np.minimum(width, 0.2))[:, None] * direction

    unknown = np.isnan(scans.ranges)
    before, after = np.maximum(first - 1, 0), np.minimum(last + 1, beams - 1)
    range_first, range_last = reach[view, first], reach[view, last]
    low = (first > 0) & ~unknown[view, before] & (reach[view, before] > range_first)
    high = (last < beams - 1) & ~unknown[view, after] & (reach[view, after] > range_last)
    between = (
        (first == last)
        & (low ^ high)
        & (np.abs(np.minimum(reach[view, before], reach[view, after]) - range_first) < 0.6)
    )
    found = Segments(
        view,
        first,
        last,
        centre,
        mean_range,
        width,
        low,
        high,
        between,
        share,
        np.zeros(len(view), dtype=bool),
    )
    wall = _walls(found, points, outline, config=config)
    found = Segments(view, first, last, centre, mean_range, width, low, high, between, share, wall)
    return found.only(share > 0.5)


def _within(points: Floats, outline: Polygon, margin: float) -> Bools:
    """Say which (..., 2) points lie in the outline grown by a margin."""
    grown = outline.buffer(margin)
    x0, y0, x1, y1 = grown.bounds
    inside: Bools = (
        (points[..., 0] > x0)
        & (points[..., 0] < x1)
        & (points[..., 1] > y0)
        & (points[..., 1] < y1)
    )
    if inside.any():
        inside[inside] = shapely.contains_xy(grown, points[inside][:, 0], points[inside][:, 1])
    return inside


def _sums(values: Floats, view: Ints, first: Ints, last: Ints) -> Floats:
    total = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
    sums: Floats = total[view, last + 1] - total[view, first]
    return sums


def _walls(found: Segments, points: Floats, outline: Polygon, *, config: LegsConfig) -> Bools:
    """Mark segments on straight lines that lead on beyond the table by ``config.wall_beyond``."""
    grown = outline.buffer(config.margin)
    beyond = outline.buffer(config.wall_beyond)
    start, end = points[found.view, found.first], points[found.view, found.last]
    length = np.linalg.norm(end - start, axis=1)
    long = np.flatnonzero((length > config.wall_length) & (found.last - found.first >= 5))
    lines: list[tuple[Floats, float]] = []
    for i in long[np.argsort(-length[long], kind="stable")]:
        run = points[found.view[i], found.first[i] : found.last[i] + 1]
        if not (shapely.intersects(grown, shapely.LineString(run[[0, -1]]))):
            continue
        for piece in _straight_pieces(run):
            centre = piece.mean(axis=0)
            _, _, axes = np.linalg.svd(piece - centre, full_matrices=False)
            along = (piece - centre) @ axes[0]
            if np.ptp(along) < config.wall_length:
                continue
            # A panel ends with the table; a wall leads on.
            outside = ~shapely.contains_xy(beyond, piece[:, 0], piece[:, 1])
            if outside.mean() * np.ptp(along) > 0.15:
                if any(
                    abs(normal @ axes[1]) > 0.99 and abs(normal @ centre - offset) < 0.03
                    for normal, offset in lines
                ):
                    continue
                lines.append((axes[1], float(axes[1] @ centre)))
    wall = np.zeros(len(found), dtype=bool)
    if not lines:
        return wall
    middle = points[found.view, (found.first + found.last) // 2]
    for normal, offset in lines:
        near = np.stack([np.abs(p @ normal - offset) for p in (start, middle, end)]).max(axis=0)
        wall |= near < config.wall_distance
    return wall


def _straight_pieces(run: Floats) -> list[Floats]:
    """Split (n, 2) points of one segment at their corners (Douglas and Peucker, 2 cm)."""
    pieces: list[Floats] = []
    pending = [run]
    while pending:
        part = pending.pop()
        if len(part) < 6:
            continue
        chord = part[-1] - part[0]
        length = float(np.hypot(*chord))
        if length < 1e-6:
            continue
        normal = np.array([-chord[1], chord[0]]) / length
        off = np.abs((part - part[0]) @ normal)
        worst = int(np.argmax(off))
        if off[worst] > 0.02 and 0 < worst < len(part) - 1:
            pending += [part[worst:], part[: worst + 1]]
        else:
            pieces.append(part)
    return pieces


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a leg's primitive is fitted to: N tangents and M mean depths of segments.

    A tangent has an outward ``normal`` (N, 2), a ``point`` (N, 2) on it beside the leg, the
    ``range`` (N,) and a white ``sigma`` (N,) metres. The depths, one a segment, are given by their
    beams: ``hits`` (P, 2) points, ``rays`` (P, 2) directions and ``row`` (P,) into the M segments,
    whose ``hit_sigma`` (M,) is that of the mean. ``group`` and ``hit_group`` share pose errors and
    ``lever`` and ``hit_lever`` are the place relative to the base, about which a yaw error turns.
    """

    normal: Floats
    point: Floats
    range: Floats
    sigma: Floats
    group: Ints
    lever: Floats
    hits: Floats
    rays: Floats
    row: Ints
    hit_sigma: Floats
    hit_group: Ints
    hit_lever: Floats

    @property
    def stops(self) -> int:
        """How many stops and drives saw it."""
        return len(np.unique(np.concatenate([self.group, self.hit_group])))


def thinned(evidence: Evidence, tangents: int) -> Evidence:
    """Return about as many tangents, evenly chosen, and the depths of as many segments."""
    keep = np.arange(0, len(evidence.sigma), max(1, len(evidence.sigma) // tangents))
    rows = np.arange(0, len(evidence.hit_sigma), max(1, len(evidence.hit_sigma) // tangents))
    index = np.full(len(evidence.hit_sigma), -1)
    index[rows] = np.arange(len(rows))
    hits = index[evidence.row] >= 0
    return Evidence(
        normal=evidence.normal[keep],
        point=evidence.point[keep],
        range=evidence.range[keep],
        sigma=evidence.sigma[keep],
        group=evidence.group[keep],
        lever=evidence.lever[keep],
        hits=evidence.hits[hits],
        rays=evidence.rays[hits],
        row=index[evidence.row[hits]],
        hit_sigma=evidence.hit_sigma[rows],
        hit_group=evidence.hit_group[rows],
        hit_lever=evidence.hit_lever[rows],
    )


def gather_evidence(
    scans: Scans, points: Floats, chosen: Segments, members: Segments, *, config: LegsConfig
) -> Evidence:
    """Turn one leg's segments into tangents and depths.

    ``members`` are all segments that belong to the same thing, ``chosen`` those to be used: an
    end whose neighbour is another member is no silhouette.
    """
    tangents = []
    beams = scans.ranges.shape[1]
    stride = beams + 4  # so that a step beyond the last beam is not the next scan's first
    own = members.view * stride + np.stack([members.first, members.last])
    for ends, step, is_end in ((chosen.first, -1, chosen.low), (chosen.last, 1, chosen.high)):
        next_beam = chosen.view * stride + ends + step
        # At grazing incidence a stray beam lies between two pieces of one face.
        alone = ~np.isin(next_beam, own) & ~np.isin(next_beam + step, own)
        keep = is_end & alone & ~chosen.between
        view, end = chosen.view[keep], ends[keep]
        inner = scans.ranges[view, end]
        outer = scans.ranges[view, np.clip(end + step, 0, beams - 1)]
        further = scans.ranges[view, np.clip(end + 2 * step, 0, beams - 1)]
        # A wide spot half on the leg measures something between: that beam holds the edge.
        mixed = np.isfinite(outer) & (outer - inner < 0.6) & ~(further < outer + 0.05)
        spacing = scans.spacing[view]
        angle = scans.angles[view, end] + step * np.where(mixed, 1.0, 0.5) * spacing
        origin = scans.origins[view, end]
        direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        normal = step * np.stack([-direction[:, 1], direction[:, 0]], axis=1)
        white = np.hypot(inner * spacing / np.sqrt(12.0), 0.0005) * np.where(mixed, 1.3, 1.0)
        moving = ~scans.standing[view]
        white = np.where(
            moving,
            np.sqrt(
                white**2 + config.moving_position_sigma**2 + (inner * config.moving_yaw_sigma) ** 2
            ),
            white,
        )
        point = origin + inner[:, None] * direction
        tangents.append(
            (normal, point, inner, white, scans.groups[view], point - scans.pivots[view])
        )
    normal, point, reach, sigma, group, lever = (
        np.concatenate(parts) for parts in zip(*tangents, strict=True)
    )
    solid = chosen.only(~chosen.between)
    counts = solid.last - solid.first + 1
    row = np.repeat(np.arange(len(solid)), counts)
    beam = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    beam = beam + np.repeat(solid.first, counts)
    view = np.repeat(solid.view, counts)
    angle = scans.angles[view, beam]
    moving = ~scans.standing[solid.view]
    hit_sigma = np.sqrt(
        scans.noise[solid.view] ** 2 / np.maximum(counts, 1)
        + 0.002**2
        + np.where(moving, config.moving_position_sigma**2, 0.0)
    )
    middle = points[solid.view, (solid.first + solid.last) // 2]
    return Evidence(
        normal=normal,
        point=point,
        range=reach,
        sigma=sigma,
        group=group.astype(np.int64),
        lever=lever,
        hits=points[view, beam],
        rays=np.stack([np.cos(angle), np.sin(angle)], axis=1),
        row=row,
        hit_sigma=hit_sigma,
        hit_group=scans.groups[solid.view],
        hit_lever=middle - scans.pivots[solid.view],
    )
