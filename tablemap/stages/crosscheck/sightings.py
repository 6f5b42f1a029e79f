"""The table's legs: their places seen by the depth camera against those from the laser."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Bools, Floats, Pose2, invert, transform
from tablemap.model.shapes import ShapeRecord, shape_named
from tablemap.robust import mad_sigma
from tablemap.stages.crosscheck.rows import Rows, bias_row, stacked, together
from tablemap.stages.legs import Leg
from tablemap.stages.legs.primitives import has_yaw, support, surface_distance
from tablemap.stages.registration import Registration
from tablemap.stages.snapshots import Snapshot

_LOW, _UNDER_TOP = 0.05, 0.07  # metres above the floor and under the top: the seen part of a leg
_ASIDE = 0.05  # metres beside a leg: its silhouette is searched there
_BEFORE, _BEHIND = 0.05, 0.05  # metres before and behind a leg's face that belong to the leg
_LARGEST = 0.2  # metres across: the silhouette of a wider leg does not fit a view
_LEAST_ROWS = 8  # image rows that must show both borders of a leg
_STEEPEST = 0.3  # cosine of the look down on a leg: below it the columns smear


@dataclass(frozen=True, eq=False)
class _LegSighting:
    """One leg in one view, in the base: n tangents (two sides) and depths."""

    points: Floats
    normals: Floats
    distance: Floats
    variance: Floats
    bias: Floats


def leg_rows(
    snapshots: tuple[Snapshot, ...],
    registration: Registration,
    legs: tuple[Leg, ...],
    height: float,
) -> tuple[Rows | None, int]:
    """Compare every leg that the laser placed with its silhouette and face in each depth image.

    A leg's place may err by ``position_sigma``, the same for all its views. Returns the rows (None
    if there are none) and the number of sightings.
    """
    parts = []
    sightings = 0
    for leg in legs:
        if leg.seen_by != "laser" or leg.position_sigma is None:
            continue
        if max(figure.value for figure in leg.dimensions.values()) > _LARGEST:
            continue
        place = np.array([leg.x, leg.y])
        own = []
        for snapshot in snapshots:
            if not registration.used[snapshot.index]:
                continue
            pose = registration.map_from_base[snapshot.index]
            seen = _sighted(snapshot, pose, leg, height)
            if seen is not None:
                own.append(_rows(seen, snapshot, pose, place, leg.position_sigma))
                sightings += 1
        if own:
            parts.append(stacked(own))
    return (together(parts), sightings) if parts else (None, 0)


def _rows(
    seen: _LegSighting, snapshot: Snapshot, pose: Pose2, place: Floats, position_sigma: float
) -> Rows:
    turn = pose.rotation
    count = len(seen.distance)
    normal = seen.normals @ turn.T
    return Rows(
        arm=seen.points @ turn.T,
        ray=(seen.points - snapshot.base_from_camera[:2, 3]) @ turn.T,
        normal=normal,
        distance=seen.distance,
        variance=seen.variance,
        stretch=np.tile(pose.translation - place, (count, 1)),
        tilt=np.zeros((count, 2)),
        bias=seen.bias,
        basis=-normal * position_sigma,
        yaw=np.full(count, pose.yaw),
        view=np.full(count, float(snapshot.index)),
        is_leg=np.ones(count),
    )


def _sighted(snapshot: Snapshot, pose: Pose2, leg: Leg, height: float) -> _LegSighting | None:
    """Find the leg in one depth image; None if it is not whole or not upright."""
    camera = snapshot.camera
    eye = snapshot.base_from_camera[:2, 3]
    centre = pose.inverse().apply(np.array([leg.x, leg.y]))
    away = float(np.hypot(*(centre - eye)))
    kind = shape_named(leg.shape)
    sizes = [figure.value for figure in leg.dimensions.values()]
    radius = 0.5 * (sizes[0] if kind.is_elliptic else float(np.linalg.norm(sizes)))
    if away < radius + 0.3 or height < _LOW + _UNDER_TOP + 0.1:
        return None
    sight = (centre - eye) / away
    left = np.array([-sight[1], sight[0]])
    window = _window(snapshot, centre, left, radius + _ASIDE, (_LOW, height - _UNDER_TOP))
    if window is None:
        return None
    rows, columns = window
    depth = snapshot.depth[rows, columns].astype(np.float64)
    rays = camera.rays[rows, columns].astype(np.float64)
    points = transform(snapshot.base_from_camera, rays * depth[..., None])
    with np.errstate(invalid="ignore"):
        along, aside = (points[..., :2] - eye) @ sight - away, (points[..., :2] - eye) @ left
        on = (np.abs(aside) < radius + 0.02) & (along > -radius - _BEFORE)
        on &= along < radius + _BEHIND
        on &= (points[..., 2] > _LOW) & (points[..., 2] < height - _UNDER_TOP)
    # The sight lines of the columns' left borders, in the plane.
    direction = rays @ snapshot.base_from_camera[:3, :3].T
    bearing = np.arctan2(direction[..., :2] @ left, direction[..., :2] @ sight)
    flat = np.hypot(direction[..., 0], direction[..., 1]) / np.linalg.norm(direction, axis=-1)
    sides = _silhouettes(on & (flat > _STEEPEST), depth, bearing, points[..., 2], away)
    pixel = away / camera.fx
    tangents = []
    for sign, (angles, levels) in zip((1.0, -1.0), sides, strict=True):
        if len(angles) < _LEAST_ROWS:
            return None
        middle, spread, lean = _upright(angles, levels)
        # A leaning leg stands elsewhere than at the height of the laser.
        if lean * away > max(pixel, 0.003) + 3.0 * spread * away / np.sqrt(len(angles)):
            return None
        ray = np.cos(middle) * sight + np.sin(middle) * left
        tangents.append((sign, ray, spread))
    width = away * (np.median(sides[0][0]) - np.median(sides[1][0]))
    if not 0.5 * min(sizes) - pixel < width < 2.0 * radius + 2.0 * pixel + 0.01:
        return None
    values = _values(leg, centre, pose)
    places, normals, distances, variances, biases = [], [], [], [], []
    for sign, ray, spread in tangents:
        normal = sign * np.array([-ray[1], ray[0]])
        touch = eye + away * ray
        places.append(touch)
        normals.append(normal)
        distances.append(
            float(normal @ (touch - centre)) - float(support(kind, values, normal[None])[0][0])
        )
        # Errors of the rows are correlated: their number hardly helps. A third of a pixel stays.
        variances.append((pixel / 3.0) ** 2 + (away * spread) ** 2 / _LEAST_ROWS)
        biases.append(
            bias_row("width of silhouettes", np.array([-pixel]))
            + bias_row("their middle", np.array([-sign * pixel]))
        )
    face = _face(kind, values, points[..., :2], direction[..., :2], on)
    if face is not None:
        distance, normal, spread, place = face
        places.append(place)
        normals.append(normal)
        distances.append(distance)
        variances.append(0.001**2 + spread**2 / _LEAST_ROWS)
        biases.append(bias_row("depth of legs", np.array([normal @ sight])))
    return _LegSighting(
        np.array(places),
        np.array(normals),
        np.array(distances),
        np.array(variances),
        np.concatenate(biases),
    )


def _window(
    snapshot: Snapshot, centre: Floats, left: Floats, half: float, levels: tuple[float, float]
) -> tuple[slice, slice] | None:
    """Return the rows and columns of the image with an upright strip; None if the image cuts it."""
    corners = np.array([[*(centre + s * half * left), z] for s in (-1.0, 1.0) for z in levels])
    seen = transform(invert(snapshot.base_from_camera), corners)
    if seen[:, 2].min() < 0.3:
        return None
    camera = snapshot.camera
    u, v = camera.project(seen).T
    first, last = int(np.floor(u.min())), int(np.ceil(u.max()))
    top, bottom = max(int(np.floor(v.min())), 0), min(int(np.ceil(v.max())), camera.height - 1)
    if first < 1 or last > camera.width - 2 or bottom - top < 4 or last - first < 4:
        return None
    return slice(top, bottom + 1), slice(first, last + 1)


def _silhouettes(
    on: Bools, depth: Floats, bearing: Floats, level: Floats, away: float
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Return the bearings and heights of the left and of the right border, row by row.

    A border counts if the pixel beside it lies farther away or has no depth. A row counts if there
    is no gap between its borders.
    """
    columns = on.shape[1]
    first = on.argmax(axis=1)
    last = columns - 1 - on[:, ::-1].argmax(axis=1)
    count = on.sum(axis=1)
    rows = np.flatnonzero(
        (count >= 2) & (count >= 0.8 * (last - first + 1)) & (first > 0) & (last < columns - 1)
    )
    found = []
    for end, step in ((first[rows], -1), (last[rows], 1)):
        here, beside = depth[rows, end], depth[rows, end + step]
        silhouette = np.isnan(beside) | (beside > here + 0.05)
        kept = rows[silhouette]
        ends = end[silhouette]
        angle = 0.5 * (bearing[kept, ends] + bearing[kept, ends + step])
        found.append((angle, level[kept, ends]))
    # Columns run to the right: the first one is the left border, with the larger bearing.
    return found[0], found[1]


def _upright(angles: Floats, levels: Floats) -> tuple[float, float, float]:
    """Return the median, the robust spread, and the lean of a line through them over the rows."""
    middle = float(np.median(angles))
    spread = mad_sigma(angles - middle)
    half = np.median(levels)
    upper, lower = angles[levels > half], angles[levels <= half]
    if len(upper) < 3 or len(lower) < 3:
        return middle, spread, 0.0
    return middle, spread, 2.0 * abs(float(np.median(upper) - np.median(lower)))


def _values(leg: Leg, centre: Floats, pose: Pose2) -> Floats:
    """Return the leg's parameters in the base, in the order of the fit of primitives."""
    sizes = [figure.value for figure in leg.dimensions.values()]
    yaw = [leg.yaw - pose.yaw] if has_yaw(shape_named(leg.shape)) else []
    return np.array([*centre, *sizes, *yaw])


def _face(
    kind: ShapeRecord, values: Floats, points: Floats, rays: Floats, on: Bools
) -> tuple[float, Floats, float, Floats] | None:
    """Return the face's median distance, mean normal (2,), robust spread and middle (2,)."""
    inner = on.copy()
    # Border pixels mix the leg with its background.
    inner[:, 1:] &= on[:, :-1]
    inner[:, :-1] &= on[:, 1:]
    here, towards = points[inner], rays[inner]
    if len(here) < 12:
        return None
    towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    distance, normals, _, ok = surface_distance(kind, values, here, towards)
    good = ok > 0
    if good.sum() < 12:
        return None
    middle = float(np.median(distance[good]))
    spread = mad_sigma(distance[good] - middle)
    normal = normals[good].mean(axis=0)
    size = float(np.hypot(*normal))
    return middle, normal / size, spread, np.median(here[good], axis=0)
