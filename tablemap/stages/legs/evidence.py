"""The evidence to which a leg's primitive is fitted: tangents and depths of its segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Floats, Ints
from tablemap.stages.legs.scans import Scans
from tablemap.stages.legs.silhouettes import Segments

STOP_POSITION_SIGMA = 0.003
"""Error of a stop's pose in fits that keep the poses fixed, metres."""

# Error of one scan of a drive against the others, from the odometry's interpolation.
_MOVING_POSITION_SIGMA = 0.003  # metres
_MOVING_YAW_SIGMA = 0.001  # radians


@dataclass(frozen=True, eq=False)
class LegEvidence:
    """N tangents and M mean depths of segments, to which a leg's primitive is fitted.

    All places are metres in the map. Of the tangents:

    - ``normal``: (N, 2) outward unit vectors
    - ``point``: (N, 2), on the tangent beside the leg
    - ``range``: (N,) metres
    - ``sigma``: (N,) metres, of white noise
    - ``group``: (N,), rows of one group share a pose error
    - ``lever``: (N, 2), place relative to the base, about which a yaw error turns

    Of the depths, one a segment, given by P beams:

    - ``hits``: (P, 2) ends of the beams
    - ``rays``: (P, 2) their directions
    - ``row``: (P,) ascending, each beam's segment
    - ``hit_sigma``: (M,) metres, of the mean of a segment
    - ``hit_group``, ``hit_lever``: (M,) and (M, 2), as for the tangents
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


def thinned(evidence: LegEvidence, tangents: int) -> LegEvidence:
    """Return about ``tangents`` tangents, evenly chosen, and the depths of as many segments."""
    keep = np.arange(0, len(evidence.sigma), max(1, len(evidence.sigma) // tangents))
    rows = np.arange(0, len(evidence.hit_sigma), max(1, len(evidence.hit_sigma) // tangents))
    index = np.full(len(evidence.hit_sigma), -1)
    index[rows] = np.arange(len(rows))
    hits = index[evidence.row] >= 0
    return LegEvidence(
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
    scans: Scans, points: Floats, chosen: Segments, members: Segments
) -> LegEvidence:
    """Turn one leg's segments into tangents and depths.

    ``members`` are all segments of the thing, and ``chosen`` are those to use. An end whose
    neighbour is another member is no silhouette.
    """
    tangents = []
    beams = scans.ranges.shape[1]
    stride = beams + 4  # so that a step beyond the last beam is not the next scan's first
    own = members.view * stride + np.stack([members.first, members.last])
    for ends, step, is_end in ((chosen.first, -1, chosen.low), (chosen.last, 1, chosen.high)):
        next_beam = chosen.view * stride + ends + step
        # At grazing incidence a stray beam may lie between two pieces of one face.
        alone = ~np.isin(next_beam, own) & ~np.isin(next_beam + step, own)
        keep = is_end & alone & ~chosen.between
        view, end = chosen.view[keep], ends[keep]
        inner = scans.ranges[view, end]
        outer = scans.ranges[view, np.clip(end + step, 0, beams - 1)]
        further = scans.ranges[view, np.clip(end + 2 * step, 0, beams - 1)]
        # A wide spot that is half on the leg gives a range in between: its beam contains the edge.
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
            np.sqrt(white**2 + _MOVING_POSITION_SIGMA**2 + (inner * _MOVING_YAW_SIGMA) ** 2),
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
        + np.where(moving, _MOVING_POSITION_SIGMA**2, 0.0)
    )
    middle = points[solid.view, (solid.first + solid.last) // 2]
    return LegEvidence(
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
