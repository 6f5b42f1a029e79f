"""Whether a point is on the table, and how sure that is.

The uncertainties are the sides' sigmas and, for a point in the map, the table's pose. Together they
give the point's place against the outline a Gaussian distribution. The probability is the share of
this Gaussian inside the outline. It is exact for any polygon: a sum over its segments of Owen's T
function (D. B. Owen, Tables for computing bivariate normal probabilities, Ann. Math. Statist. 27,
1956).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol, get_args

import numpy as np
import shapely
from numpy.typing import ArrayLike
from scipy.special import owens_t

from tablemap.errors import TablemapError
from tablemap.geometry import Floats, Ints, Pose2

UNKNOWN_ABOVE = 0.01
"""If an unseen side decides about more of the probability than this, the probability is unknown."""
FAR = 10.0
"""Largest extent of a table beyond a side that nothing bounds, metres."""
UNIFORM = 3.0**0.5
"""Half the width of an interval over the standard deviation of a uniform distribution on it."""
LEAST_SIGMA = 1e-6
PARALLEL = 0.5
MOST_AT_ONCE = 1_000_000

Frame = Literal["map", "table"]


class PlacedPose(Protocol):
    """A pose in the map with its covariance."""

    @property
    def x(self) -> float:
        """Metres."""

    @property
    def y(self) -> float:
        """Metres."""

    @property
    def yaw(self) -> float:
        """Radians."""

    @property
    def covariance(self) -> Sequence[Sequence[float]]:
        """(3, 3) of x, y and yaw."""


class Side(Protocol):
    """A side of an outline."""

    @property
    def points(self) -> Sequence[tuple[float, float]]:
        """Where it runs: x and y in the map, metres; a bound where it was not seen."""

    @property
    def status(self) -> str:
        """``unseen``, or how it was seen."""

    @property
    def sigma(self) -> float | None:
        """Metres, across it; None where nothing is known of it."""


class PlacedTop(Protocol):
    """A table's top as in its model."""

    @property
    def pose(self) -> PlacedPose:
        """Its area centroid, and its heading."""

    @property
    def outline(self) -> Sequence[tuple[float, float]]:
        """X and y in the map, metres, counter-clockwise."""

    @property
    def edges(self) -> Sequence[Side]:
        """The sides that make up the outline."""


@dataclass(frozen=True, eq=False)
class _KnownOutline:
    """The outline as known, in the table's frame.

    - ``ring``: (M, 2) metres, counter-clockwise
    - ``sigma``: (M,) metres, of each segment's side
    - ``side``: (M,) the index of each segment's side
    - ``inner``, ``outer``: the smallest and the largest possible top; both are the ring if all
      sides were seen
    - ``open_normals``: (K, 2) unit vectors out of the sides that nothing bounds
    """

    ring: Floats
    sigma: Floats
    side: Ints
    inner: shapely.Geometry
    outer: shapely.Geometry
    open_normals: Floats


def probability_on_top(
    top: PlacedTop, x: ArrayLike, y: ArrayLike, *, frame: Frame = "map"
) -> Floats:
    """Return the probability that points are on the top, seen from above; NaN where unknown.

    ``x`` and ``y`` are metres in the map or in the table's own frame (origin at the pose, x along
    its yaw). In the map the pose's covariance counts too. Raises `TablemapError` if they are not
    numbers, their shapes do not fit, or the frame is unknown.
    """
    if frame not in get_args(Frame):
        raise TablemapError(f"expected the frame 'map' or 'table', found {frame!r}.")
    try:
        xs, ys = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    except (TypeError, ValueError) as error:
        raise TablemapError(f"expected x and y as numbers of one shape: {error}.") from error
    pose = Pose2(top.pose.x, top.pose.y, top.pose.yaw)
    points = np.stack([xs.ravel(), ys.ravel()], axis=-1)
    if frame == "map":
        points = pose.inverse().apply(points)
    outline = _outline(top, pose)
    known = np.isfinite(points).all(axis=1)
    result = np.full(len(points), np.nan)
    step = max(MOST_AT_ONCE // max(shapely.get_num_coordinates(outline.outer), 1), 1)
    for first in range(0, len(points), step):
        some = np.flatnonzero(known[first : first + step]) + first
        covariance = _side_covariance(outline, points[some])
        if frame == "map":
            covariance = covariance + _pose_covariance(top.pose, outline, points[some])
        result[some] = _between(outline, points[some], covariance)
    return result.reshape(xs.shape)


def _between(outline: _KnownOutline, points: Floats, covariance: Floats) -> Floats:
    """Return the share inside the outline; NaN where the smallest and largest top differ."""
    if not np.isfinite(covariance).all():
        return np.full(len(points), np.nan)
    least = _share(outline.inner, points, covariance)
    if outline.outer is outline.inner:
        return least
    most = _share(outline.outer, points, covariance)
    return np.where(most - least > UNKNOWN_ABOVE, np.nan, (least + most) / 2)


def _outline(top: PlacedTop, pose: Pose2) -> _KnownOutline:
    to_table = pose.inverse()
    ring = to_table.apply(np.array(top.outline, dtype=np.float64).reshape(-1, 2))
    polygon = shapely.orient_polygons(shapely.Polygon(ring)) if len(ring) > 2 else shapely.Polygon()
    ring = np.array(polygon.exterior.coords, dtype=np.float64)[:-1].reshape(-1, 2)
    sides = [to_table.apply(np.array(edge.points).reshape(-1, 2)) for edge in top.edges]
    if len(ring) == 0 or not sides:
        nothing = np.zeros((0, 2))
        empty = shapely.Polygon()
        return _KnownOutline(nothing, np.zeros(0), np.zeros(0, np.int64), empty, empty, nothing)
    middles = shapely.points((ring + np.roll(ring, -1, axis=0)) / 2)
    lines = np.array([shapely.LineString(side) for side in sides])
    side = np.argmin(shapely.distance(middles[:, None], lines[None]), axis=1)
    extent = float(np.ptp(ring, axis=0).max())
    stated = [edge.sigma for edge in top.edges if edge.sigma and edge.status != "unseen"]
    usual = float(np.median(stated)) if stated else LEAST_SIGMA
    sigma = np.array([_sigma(edge, usual) for edge in top.edges])[side]
    whole = _KnownOutline(ring, sigma, side, polygon, polygon, np.zeros((0, 2)))
    return _bounded(whole, top.edges, polygon, extent)


def _sigma(edge: Side, usual: float) -> float:
    known = edge.sigma is not None and edge.status != "unseen"
    return max(edge.sigma if known and edge.sigma else usual, LEAST_SIGMA)


def _bounded(
    whole: _KnownOutline, edges: Sequence[Side], polygon: shapely.Polygon, extent: float
) -> _KnownOutline:
    """Add the smallest and largest possible top, for sides that were not seen or lack a sigma."""
    if any(edge.sigma is None and edge.status != "unseen" for edge in edges):
        # A hull instead of a shape may cover more than the top, and may end before the top does.
        everywhere = shapely.Point(0.0, 0.0).buffer(FAR + extent)
        return replace(whole, inner=shapely.Polygon(), outer=everywhere)
    inner = outer = polygon
    normals = []
    for run in _unseen_runs(whole, edges):
        sigmas = [edges[k].sigma for k in whole.side[run]]
        reach = max((np.inf if s is None else s * UNIFORM for s in sigmas), default=0.0)
        is_open = reach > extent / 2
        if is_open:
            normals.append(_normals(whole.ring)[run].mean(axis=0))
        else:
            inner = inner.difference(_swept(whole.ring, run, -reach))
        outer = outer.union(_swept(whole.ring, run, FAR if is_open else reach))
    return replace(whole, inner=inner, outer=outer, open_normals=np.array(normals).reshape(-1, 2))


def _unseen_runs(whole: _KnownOutline, edges: Sequence[Side]) -> list[Ints]:
    """Return the segments of unseen sides, grouped into runs of neighbours."""
    unseen = np.array([edges[k].status == "unseen" for k in whole.side])
    if unseen.all():
        return [np.arange(len(unseen))]
    start = int(np.argmin(unseen))
    order = np.roll(np.arange(len(unseen)), -start)
    breaks = np.flatnonzero(np.diff(unseen[order].astype(int))) + 1
    return [run for run in np.split(order, breaks) if unseen[run[0]]]


def _normals(ring: Floats) -> Floats:
    """Return the outward normals (M, 2) of a counter-clockwise ring's segments."""
    along = np.roll(ring, -1, axis=0) - ring
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return np.asarray(outward / np.maximum(np.linalg.norm(outward, axis=1), 1e-12)[:, None])


def _swept(ring: Floats, run: Ints, distance: float) -> shapely.Geometry:
    """Return the area that neighbouring segments cover when they move outward (negative: inward).

    The run's ends move along the adjoining sides, if these lead outward.
    """
    count, normals = len(ring), _normals(ring)
    chain = ring[np.append(run, (run[-1] + 1) % count)]
    corners = [chain, *(ring[[k, (k + 1) % count]] + distance * normals[k] for k in run)]
    for end, before, k in (
        (chain[0], ring[(run[0] - 1) % count], run[0]),
        (chain[-1], ring[(run[-1] + 2) % count], run[-1]),
    ):
        along = (end - before) / max(float(np.linalg.norm(end - before)), 1e-12)
        rate = float(along @ normals[k])
        if rate > PARALLEL:
            corners.append((end + distance / rate * along)[None])
    return shapely.MultiPoint(np.concatenate(corners)).convex_hull


def _side_covariance(outline: _KnownOutline, points: Floats) -> Floats:
    """Return (N, 2, 2): across the nearest side its variance, along it the second nearest's."""
    ring, count = outline.ring, len(points)
    if len(ring) == 0 or count == 0:
        return np.tile(np.eye(2) * LEAST_SIGMA**2, (count, 1, 1))
    start, along = ring, np.roll(ring, -1, axis=0) - ring
    squared = np.maximum((along**2).sum(axis=1), 1e-24)
    offset = points[:, None] - start[None]
    share = np.clip((offset * along).sum(axis=-1) / squared, 0.0, 1.0)
    apart = np.linalg.norm(offset - share[..., None] * along, axis=-1)
    nearest = np.argmin(apart, axis=1)
    others = np.where(outline.side[None] == outline.side[nearest][:, None], np.inf, apart)
    second = np.where(np.isfinite(others).any(axis=1), np.argmin(others, axis=1), nearest)
    normal = _normals(ring)[nearest]
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    across = outline.sigma[nearest, None, None] ** 2 * normal[:, :, None] * normal[:, None]
    beside = outline.sigma[second, None, None] ** 2 * tangent[:, :, None] * tangent[:, None]
    return np.asarray(across + beside)


def _pose_covariance(pose: PlacedPose, outline: _KnownOutline, points: Floats) -> Floats:
    """Return (N, 2, 2): the covariance of points in the table's frame from that of the pose.

    The pose is a centroid. If nothing bounds a side, the centroid is unknown along that side's
    normal: the variance there is then taken to be that of the other direction. If two such sides
    have different normals, the place is unknown (NaN).
    """
    covariance = np.array(pose.covariance, dtype=np.float64)
    table_from_map = np.eye(3)
    table_from_map[:2, :2] = Pose2(pose.x, pose.y, pose.yaw).inverse().rotation
    covariance = table_from_map @ covariance @ table_from_map.T
    if len(outline.open_normals):
        first = outline.open_normals[0]
        crossed = first[0] * outline.open_normals[:, 1] - first[1] * outline.open_normals[:, 0]
        if np.abs(crossed).max() > PARALLEL:
            return np.full((len(points), 2, 2), np.nan)
        beside = np.array([-first[1], first[0]]) / max(float(np.linalg.norm(first)), 1e-12)
        variance = float(beside @ covariance[:2, :2] @ beside)
        covariance = np.diag([variance, variance, covariance[2, 2]])
    jacobian = np.zeros((len(points), 2, 3))
    jacobian[:, :, :2] = -np.eye(2)
    jacobian[:, 0, 2], jacobian[:, 1, 2] = points[:, 1], -points[:, 0]
    return np.asarray(jacobian @ covariance @ jacobian.transpose(0, 2, 1))


def _share(region: shapely.Geometry, points: Floats, covariance: Floats) -> Floats:
    """Return the share in a region of a Gaussian about each point (N, 2), covariance (N, 2, 2).

    Each oriented segment of the region's rings adds the triangle that it forms with the point. In
    the whitened plane let the segment's line pass the point at distance h. An end at t along the
    line contributes atan(t / h) / 2 pi - T(h, t / h).
    """
    least = LEAST_SIGMA**2
    first = np.sqrt(np.maximum(covariance[:, 0, 0], least))[:, None]
    mixed = covariance[:, 0, 1][:, None] / first
    second = np.sqrt(np.maximum(covariance[:, 1, 1][:, None] - mixed**2, least))
    total = np.zeros(len(points))
    oriented = shapely.orient_polygons(region)
    for ring in shapely.get_rings(oriented):
        apart = shapely.get_coordinates(ring)[None] - points[:, None]
        u = apart[..., 0] / first
        v = (apart[..., 1] - mixed * u) / second
        du, dv = np.diff(u, axis=1), np.diff(v, axis=1)
        length = np.maximum(np.hypot(du, dv), 1e-300)
        signed = (u[:, :-1] * dv - v[:, :-1] * du) / length
        h = np.maximum(np.abs(signed), 1e-12)
        ends = []
        for at in (slice(None, -1), slice(1, None)):
            ratio = (u[:, at] * du + v[:, at] * dv) / length / h
            ends.append(np.arctan(ratio) / (2 * np.pi) - owens_t(h, ratio))
        total += (np.copysign(1.0, signed) * (ends[1] - ends[0])).sum(axis=1)
    return np.asarray(np.clip(total, 0.0, 1.0))
