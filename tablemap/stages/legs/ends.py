"""The upper end of a thing under the top: whether the camera saw a gap between it and the top."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage
from shapely.geometry import LineString, Polygon

from tablemap.geometry import Bools, Floats, Pose2
from tablemap.stages.legs.layout import Frame
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted

_LOWEST = 0.08  # metres: lower down, the floor is as near as the thing
_STEP = 0.008  # metres between looks: a gap of 3 cm holds four of them
_FINEST = 0.003  # metres between looks beside each other, for the thinnest legs
_AROUND = 0.15  # metres beside the thing that are looked at
_BESIDE = 0.05  # metres beside the thing, from where on a surface there is another one
_LEAN = 0.25  # metres sideways a metre up: legs splay by so much
_TELLING = 0.15  # metres of height that show by how much a thing leans
_ROUND = 0.02  # metres round the thing: errors of its place and of a pose
_SAME, _FARTHER, _NEARER = 0.04, 0.08, 0.06  # metres from a thing's middle, beyond its radius
_MARGIN = 0.015  # metres under the line of sight that grazes the edge of the top
_BRIDGED = 5  # rows without depth that do not part a thing
_LEAST_ROWS = 3
_FLARE = 0.08  # metres by which a leg's upper end may be wider than its foot
_THICKNESS = 0.03  # metres, of a top whose thickness was not measured
_THICKNESSES = (0.02, 0.1)  # metres: a fit beyond these says little of where the underside is

_GAP = 0.03  # metres: a smaller gap may be an error of a place or a pose
_VIEWS = 2  # that must show it
_SCATTER = 0.05  # metres: ends of one thing that differ more are errors of the depth
_HIDDEN = 0.06  # metres just under the top that no view need show: nothing ends there by chance


@dataclass(frozen=True)
class UpperEnd:
    """Where the views saw a thing end.

    - ``height``: metres above the floor, of the end below the gap; None if no view saw a gap
    - ``gap``: metres, the largest free height that was seen above it
    - ``shown``: views that saw the gap
    - ``opposed``: views that saw the thing go on well above that height
    - ``hidden``: metres just under the top, up to which two views followed it; infinite if fewer
      saw the thing
    """

    height: float | None = None
    gap: float = 0.0
    shown: int = 0
    opposed: int = 0
    hidden: float = np.inf

    @property
    def is_below(self) -> bool:
        """Whether the views agree that it ends below the top."""
        return self.shown >= _VIEWS and self.shown > 2 * self.opposed

    @property
    def is_at_top(self) -> bool:
        """Whether it was followed up to the top, as far as the top itself lets a camera see."""
        return not self.is_below and self.hidden <= _HIDDEN

    def __str__(self) -> str:
        """Return what was seen of its end, as a clause."""
        return (
            f"it ends {100 * (self.height or 0.0):.0f} cm above the floor, and "
            f"{counted(self.shown, 'view')} saw through the gap of {100 * self.gap:.0f} cm above it"
        )


UNSEEN = UpperEnd()
"""No view showed it."""


@dataclass(frozen=True)
class _SeenEnd:
    """One view, in metres.

    - ``end``: height of the thing's upper end
    - ``gap``: free height above it
    - ``followed``: height up to which it was seen, as slender as at its foot: the limit of the view
      if it goes on there
    """

    end: float
    gap: float
    followed: float


def upper_end(
    snapshots: tuple[Snapshot, ...],
    poses: dict[int, Pose2],
    frame: Frame,
    place: Floats,
    radius: float,
) -> UpperEnd:
    """Follow a thing upwards in every depth image, and see how far below the top it ends.

    ``place`` (2,) in the map and ``radius``, metres, are the thing's at its foot. Only what lies
    under the line of sight that grazes the top's edge is looked at. Free is where depth is farther
    than the thing; pixels without depth say nothing.
    """
    surface = frame.surface
    thickness = _THICKNESS if surface.thickness is None else surface.thickness.value
    underside = surface.height.value - float(np.clip(thickness, *_THICKNESSES))
    views = [
        _look(snapshots[index], pose, frame.polygon, place, radius, underside)
        for index, pose in poses.items()
    ]
    seen = [view for view in views if view is not None]
    hidden = np.sort([underside - view.followed for view in seen])
    least = float(hidden[_VIEWS - 1]) if len(seen) >= _VIEWS else np.inf
    open_above = [view for view in seen if view.gap >= _GAP]
    if not open_above:
        return UpperEnd(hidden=least)
    end = float(np.median([view.end for view in open_above]))
    agreeing = [view for view in open_above if abs(view.end - end) < _SCATTER]
    return UpperEnd(
        height=end,
        gap=max((view.gap for view in agreeing), default=0.0),
        shown=len(agreeing),
        opposed=sum(view.end > end + _SCATTER for view in seen),
        hidden=least,
    )


def _look(
    snapshot: Snapshot,
    map_from_base: Pose2,
    outline: Polygon,
    place: Floats,
    radius: float,
    underside: float,
) -> _SeenEnd | None:
    """Follow the thing in one view; None if the view does not show it."""
    eye = snapshot.base_from_camera[:3, 3]
    foot = map_from_base.inverse().apply(place)
    sight = foot - eye[:2]
    distance = float(np.hypot(*sight))
    limit = _limit(map_from_base.apply(eye[:2]), float(eye[2]), outline, place, underside)
    pixel = distance / snapshot.camera.fx
    step = max(pixel, _STEP)
    heights = np.arange(_LOWEST, limit - _MARGIN, step, dtype=np.float64)
    if len(heights) < 2 * _LEAST_ROWS:
        return None
    beside = max(pixel, float(np.clip(0.5 * radius, _FINEST, _STEP)))
    count = int(np.ceil((radius + _AROUND) / beside))
    aside = np.arange(-count, count + 1, dtype=np.float64) * beside
    left = np.array([-sight[1], sight[0]]) / distance
    raw = _offsets(snapshot, foot, left, aside, heights)
    up = heights - heights[0]
    lean = _LEAN * up[:, None]
    rough = _alone(np.abs(raw) < radius + _SAME + 0.5 * lean, aside, radius)
    sideways, deeper = _leaning(rough & (np.abs(aside) < radius + _ROUND + lean), raw, aside, up)
    off = raw - (deeper * up)[:, None]
    around = aside - (sideways * up)[:, None]
    near = np.abs(off) < radius + _SAME
    on = _alone(near, aside, radius)
    goes_on = (near & ~on).any(axis=1)
    top, columns, width = _followed(on, np.abs(around) < radius + _ROUND, beside)
    if top is None:
        return None
    free = 0
    for row in range(top + 1, len(heights)):
        behind = off[row, columns]
        if goes_on[row] or (np.abs(behind) < radius + _SAME).any():
            break
        if (behind > radius + _FARTHER).any() and not (behind < -radius - _NEARER).any():
            free += 1
        elif row > top + 1:  # the first row may mix the thing with what is behind it
            break
    gap = free * step if free >= _LEAST_ROWS else 0.0
    # A ray that grazes the end meets its far rim: the end is where that ray is, and not its axis.
    deep = float(np.median(raw[top][on[top]])) / distance
    end = float(eye[2] + (heights[top] - eye[2]) * (1.0 + deep))
    followed = limit if top >= len(heights) - 2 else float(heights[top])
    # What grows wide is the body of someone who sits there, or a seat, or a box on a leg.
    return _SeenEnd(end, gap, followed if width <= 2 * radius + _FLARE else 0.0)


def _alone(on: Bools, aside: Floats, radius: float) -> Bools:
    """Leave out the rows of a surface that goes on to both sides, as a wall close behind does."""
    one_side = on[:, aside < -radius - _BESIDE].any(axis=1)
    other_side = on[:, aside > radius + _BESIDE].any(axis=1)
    return on & ~np.logical_and(one_side, other_side)[:, None]


def _leaning(on: Bools, off: Floats, aside: Floats, up: Floats) -> tuple[float, float]:
    """Return by how much the largest piece leans sideways and away, metres a metre."""
    labels, count = ndimage.label(_bridged(on), structure=np.ones((3, 3)))
    if not count:
        return 0.0, 0.0
    row, column = np.nonzero((labels == 1 + np.bincount(labels[labels > 0])[1:].argmax()) & on)
    # The middle of a wide gap is bridged and touches neither end: such a piece shows nothing.
    if len(row) == 0 or np.ptp(up[row]) < _TELLING:
        return 0.0, 0.0
    lines = np.polyfit(up[row], np.column_stack([aside[column], off[row, column]]), 1)[0]
    sideways, deeper = np.clip(lines, -_LEAN, _LEAN)
    return float(sideways), float(deeper)


def _limit(eye: Floats, eye_height: float, outline: Polygon, place: Floats, under: float) -> float:
    """Return the height at ``place`` that the sight line grazing the top's near edge reaches."""
    distance = float(np.hypot(*(place - eye)))
    crossed = shapely.get_coordinates(outline.intersection(LineString([eye, place])))
    edge = float(np.hypot(*(crossed - eye).T).min()) if len(crossed) else distance
    if edge < 1e-3:
        return 0.0
    return min(under, eye_height + (under - eye_height) * distance / edge)


def _offsets(
    snapshot: Snapshot, foot: Floats, left: Floats, aside: Floats, heights: Floats
) -> Floats:
    """Return (rows, columns): by how much depth is farther than a plane through the thing."""
    across, up = np.meshgrid(aside, heights)
    places = np.stack([foot[0] + across * left[0], foot[1] + across * left[1], up], axis=-1)
    away, depth = snapshot.depth_at(places.reshape(-1, 3), nearest=0.3)
    return (depth - away).reshape(up.shape)


def _followed(on: Bools, corridor: Bools, step: float) -> tuple[int | None, slice, float]:
    """Return the top row of the uppermost piece in the corridor, its middle columns, its width.

    Columns and width (metres) are those of its end; ``step`` is the width of a column, metres. The
    row is None where there is no such piece.
    """
    labels, count = ndimage.label(_bridged(on), structure=np.ones((3, 3)))
    rows, columns = np.nonzero(on & corridor)
    own = labels[rows, columns]
    tops, first = np.full(count + 1, -1), np.unique(own * len(on) + rows)
    seen_rows = np.bincount(first // len(on), minlength=count + 1)
    np.maximum.at(tops, own, rows)
    tops[seen_rows <= _LEAST_ROWS] = -1
    label = int(tops.argmax())
    top = int(tops[label])
    if top < 0:
        return None, slice(0), 0.0
    last = slice(max(top - 2, 0), top + 1)
    end = np.flatnonzero(((labels[last] == label) & on[last]).any(axis=0))
    inset = (end[-1] - end[0]) // 4
    middle = slice(int(end[0] + inset), int(end[-1] - inset) + 1)
    return top, middle, float(end[-1] - end[0] + 1) * step


def _bridged(on: Bools) -> Bools:
    """Close gaps of a few rows."""
    sums = np.cumsum(np.pad(on, ((_BRIDGED, _BRIDGED), (0, 0))), axis=0, dtype=np.int32)
    below, above = sums[_BRIDGED:-_BRIDGED] - sums[: -2 * _BRIDGED], sums[2 * _BRIDGED :]
    return on | ((below > 0) & (above - sums[_BRIDGED:-_BRIDGED] > 0))
