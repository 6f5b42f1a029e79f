"""The laser's mounting, checked by the wheels: do scans from two places show one room?

The wheels tell how the base moved between two scans. Laid over each other by that motion and by
the mounting in TF, the scans agree; with another mounting they do not, as soon as the base turns.
A laser that is mounted backwards, or upside down, or whose transform was left at zero, shows so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from tablemap.geometry import Bools, Floats, compose, inverses, invert, wrap_angle
from tablemap.recording.messages import LaserScan
from tablemap.recording.tf.frames import TransformEdge, TransformTree
from tablemap.robust import kernel_weight

LEAST_TURN, LEAST_METRES = np.radians(3.0), 0.08
"""Smaller errors may be the wheels'. In a hundred simulated drives these made .7 degrees, 3 cm."""
MOST_PAIRS = 40
LEAST_SHARE = 0.5
"""Of the points agree where mounting and scans are right."""

_FEWEST_PAIRS = 8
_LEAST_STEP_TURN = 0.2  # radians between the scans of a pair: a base that only drives tells little
_MOST_STEP, _MOST_STEP_TURN = 0.8, 0.9  # metres, radians: scans farther apart share too little
_MOST_BEAMS = 180
_REACH = 8.0  # metres: beyond, the beams lie too far apart
_KERNELS = (0.5, 0.5, 0.4, 0.3, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.1, 0.1)  # metres
_NEAR = 0.06  # metres: points so near to another scan's agree with it
_GRID_DEG = 15
_REFINED = 4  # starts of the grid
_LEAST_GAIN = 0.15  # that another turn, or upside down, must explain
_FEWEST_POINTS = 50
_STEP = 1e-4  # metres and radians, for derivatives
_SAME_METRES, _SAME_TURN = 0.03, np.radians(1.5)  # between the two halves of the pairs


@dataclass(frozen=True)
class Mount:
    """A laser's pose in the base's plane; ``side`` is -1 if it hangs upside down."""

    x: float
    y: float
    yaw: float
    side: int = 1

    @staticmethod
    def of(base_from_laser: Floats) -> Mount:
        """Project a (4, 4) pose."""
        matrix = base_from_laser
        yaw = float(np.arctan2(matrix[1, 0], matrix[0, 0]))
        return Mount(float(matrix[0, 3]), float(matrix[1, 3]), yaw, 1 if matrix[2, 2] >= 0 else -1)

    def in_space(self) -> Floats:
        """Return the (4, 4) pose, at no height."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        pose = np.eye(4)
        pose[:2, :2] = [[c, -s * self.side], [s, c * self.side]]
        pose[2, 2] = self.side
        pose[:2, 3] = self.x, self.y
        return pose

    def metres_to(self, other: Mount) -> float:
        """Return the distance to another one."""
        return float(np.hypot(self.x - other.x, self.y - other.y))

    def turn_to(self, other: Mount) -> float:
        """Return the radians in [-pi, pi) by which another one is turned to the left of this."""
        return wrap_angle(other.yaw - self.yaw)


@dataclass(frozen=True)
class Told:
    """What the wheels tell of a laser's mounting.

    - ``mount``: as in TF, or turned, or upside down, as the scans have it
    - ``ahead``, ``left``: metres by which it then sits elsewhere in the base; 0 if that is little
    """

    mount: Mount
    ahead: float = 0.0
    left: float = 0.0


def told_by_wheels(scans: Sequence[LaserScan], bases: Floats, given: Mount) -> Told:
    """Return the mounting by which scans agree; the given one where nothing speaks against it.

    ``bases`` (n, 3) are the base's poses in the wheels' odometry at the scans.
    """
    pairs = _Pairs.of(scans, bases)
    if pairs is None:
        return Told(given)
    mount = _turned(pairs, given)
    if pairs.share(mount) < LEAST_SHARE:
        return Told(given)
    placed = pairs.refined(mount, (0, 1))
    if placed.metres_to(mount) < LEAST_METRES:
        return Told(mount)
    first, second = (pairs.refined(mount, (0, 1), half) for half in pairs.halves())
    if first.metres_to(second) > _SAME_METRES:
        return Told(mount)
    return Told(mount, placed.x - given.x, placed.y - given.y)


def agreement(scans: Sequence[LaserScan], bases: Floats, mount: Mount) -> float | None:
    """Return the share of points that show one room from two places; None without turns.

    ``bases`` (n, 3) are the base's poses at the scans.
    """
    pairs = _Pairs.of(scans, bases)
    return None if pairs is None else pairs.share(mount)


def turned_laser(tree: TransformTree, frame: str, given: Mount, found: Mount) -> TransformTree:
    """Return the tree with the laser's frame turned in its own plane from one mount to another."""
    turn = invert(given.in_space()) @ found.in_space()
    turn[:3, 3] = 0.0

    def changed(edge: TransformEdge) -> TransformEdge:
        poses = edge.at(edge.stamps_ns)[0] @ turn
        attitudes = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
        return replace(edge, quaternions=attitudes)

    return tree.with_edges(
        changed(edge) if edge.child == frame else edge for edge in tree.all_edges
    )


def said(told: Told, given: Mount, *, topic: str, base: str, frame: str) -> str:
    """Say where the mounting in TF is wrong; nothing where it is right."""
    where = f"correct the transform from {base} to {frame}."
    turn = np.degrees(given.turn_to(told.mount))
    side = "left" if turn > 0 else "right"
    turned = f"turned to the {side} by {abs(turn):.0f} degrees"
    if told.mount.side != given.side:
        sense = "upside down" if told.mount.side < 0 else "upright"
        mounted = f"{sense} (or its beams run the other way round)"
        mounted += f", {turned}," if abs(turn) > np.degrees(LEAST_TURN) else ""
    else:
        mounted = turned
    if told.mount != given:
        return (
            f"Scans on {topic} fit the motion of the wheels if the laser is mounted {mounted} "
            f"against TF; it was taken so: {where}"
        )
    if not (told.ahead or told.left):
        return ""
    ahead = f"{abs(told.ahead):.2f} m further {'forward' if told.ahead > 0 else 'back'}"
    left = f"{abs(told.left):.2f} m further {'left' if told.left > 0 else 'right'}"
    shift = " and ".join(
        part for part, size in ((ahead, told.ahead), (left, told.left)) if abs(size) > 0.03
    )
    return (
        f"Scans on {topic} fit the motion of the wheels if the laser sits {shift} than TF says, "
        f"or if the wheels misjudge distances by a tenth; it was left as it is, and sizes may be "
        f"wrong by centimetres: {where}"
    )


def _turned(pairs: _Pairs, given: Mount) -> Mount:
    """Return the mounting turned, or upside down, if the scans agree on that."""
    share = pairs.share(given)
    best = pairs.refined(given, (2,))
    if pairs.share(best) < LEAST_SHARE:
        turns = np.radians(np.arange(0, 360, _GRID_DEG))
        starts = [replace(given, yaw=float(t), side=side) for side in (1, -1) for t in turns]
        starts.sort(key=pairs.share, reverse=True)
        best = max((pairs.refined(each, (2,)) for each in starts[:_REFINED]), key=pairs.share)
        if pairs.share(best) < max(LEAST_SHARE, share + _LEAST_GAIN):
            return given
    if best.side == given.side and abs(given.turn_to(best)) < LEAST_TURN:
        return given
    first, second = (pairs.refined(best, (2,), half) for half in pairs.halves())
    return best if abs(first.turn_to(second)) < _SAME_TURN else given


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Pairs of scans: points of one, and trees of the points of another one.

    - ``points``: a (n, 2) array a pair, in the second scan's laser
    - ``trees``, ``normals``: of the first scans' points, in their laser
    - ``steps``: (pairs, 3), the base's motion from the first scan to the second
    """

    points: list[Floats]
    trees: list[cKDTree]
    normals: list[Floats]
    steps: Floats

    @property
    def count(self) -> int:
        return len(self.points)

    @staticmethod
    def of(scans: Sequence[LaserScan], bases: Floats) -> _Pairs | None:
        """Return pairs of scans between which the base turned; None if they are too few."""
        chosen, steps = [], []
        for i in range(len(scans)):
            for j in range(i + 1, min(i + 4, len(scans))):
                step = compose(inverses(bases[i : i + 1])[0], bases[j : j + 1])[0]
                turn = abs(wrap_angle(step[2]))
                if _LEAST_STEP_TURN < turn < _MOST_STEP_TURN and np.hypot(*step[:2]) < _MOST_STEP:
                    chosen.append((i, j))
                    steps.append(step)
                    break
        thinned = np.unique(np.linspace(0, len(chosen) - 1, MOST_PAIRS).astype(int))
        if len(chosen) < _FEWEST_PAIRS:
            return None
        seen = {i: _points(scans[i]) for k in thinned for i in chosen[k]}
        kept = [k for k in thinned if min(len(seen[i][0]) for i in chosen[k]) > 20]
        if len(kept) < _FEWEST_PAIRS:
            return None
        firsts = [seen[chosen[k][0]] for k in kept]
        seconds = [seen[chosen[k][1]][0] for k in kept]
        return _Pairs(
            [each[:: -(-len(each) // _MOST_BEAMS)] for each in seconds],
            [cKDTree(each[0]) for each in firsts],
            [each[1] for each in firsts],
            np.array(steps)[kept],
        )

    def halves(self) -> tuple[Bools, Bools]:
        """Return two masks (pairs,) that halve the pairs."""
        odd = np.arange(self.count) % 2 == 1
        return odd, ~odd

    def share(self, mount: Mount) -> float:
        """Return the median share of a pair's points that lie near one of the other scan."""
        moved = self._moved(mount)
        shares = [
            float(np.mean(tree.query(points, distance_upper_bound=_NEAR)[0] < _NEAR))
            for tree, points in zip(self.trees, moved, strict=True)
        ]
        return float(np.median(shares))

    def refined(self, mount: Mount, axes: Sequence[int], which: Bools | None = None) -> Mount:
        """Return the mounting near a given one by which the pairs agree best, point to line."""
        values = np.array([mount.x, mount.y, mount.yaw])
        used = np.arange(self.count) if which is None else np.flatnonzero(which)
        for kernel in _KERNELS:
            moved = self._moved(_at(values, mount.side))
            found = [self.trees[k].query(moved[k], distance_upper_bound=2 * kernel) for k in used]
            rows, errors, changed = [], [], []
            for axis in axes:
                step = values.copy()
                step[axis] += _STEP
                changed.append(self._moved(_at(step, mount.side)))
            for k, (distance, index) in zip(used, found, strict=True):
                near = np.isfinite(distance)
                normal = self.normals[k][index[near]]
                target = np.asarray(self.trees[k].data)[index[near]]
                errors.append(np.sum((moved[k][near] - target) * normal, axis=1))
                rows.append(
                    np.stack(
                        [
                            np.sum((each[k][near] - moved[k][near]) * normal, axis=1) / _STEP
                            for each in changed
                        ],
                        axis=1,
                    )
                )
            error, jacobian = np.concatenate(errors), np.concatenate(rows)
            if len(error) < _FEWEST_POINTS:
                break
            weights = kernel_weight(error, kernel)
            normal_matrix = jacobian.T @ (weights[:, None] * jacobian) + 1e-6 * np.eye(len(axes))
            move = -np.linalg.solve(normal_matrix, jacobian.T @ (weights * error))
            values[list(axes)] += np.clip(move, -0.2, 0.2)
        return _at(values, mount.side)

    def _moved(self, mount: Mount) -> list[Floats]:
        """Return the second scans' points as the first scans' laser would see them."""
        c, s = np.cos(mount.yaw), np.sin(mount.yaw)
        turn = np.array([[c, -s * mount.side], [s, c * mount.side]])
        place = np.array([mount.x, mount.y])
        moved = []
        for points, step in zip(self.points, self.steps, strict=True):
            cos, sin = np.cos(step[2]), np.sin(step[2])
            motion = np.array([[cos, -sin], [sin, cos]])
            in_first = (points @ turn.T + place) @ motion.T + step[:2]
            moved.append((in_first - place) @ turn)
        return moved


def _at(values: Floats, side: int) -> Mount:
    x, y, yaw = map(float, values)
    return Mount(x, y, wrap_angle(yaw), side)


def _points(scan: LaserScan) -> tuple[Floats, Floats]:
    """Return what a scan hit, (n, 2) in the laser, and the normals (n, 2) there."""
    ranges = scan.ranges.astype(np.float64)
    far = min(_REACH, scan.range_max if scan.range_max > scan.range_min else _REACH)
    hit = np.isfinite(ranges) & (ranges > max(scan.range_min, 0.02)) & (ranges < far)
    angles = scan.angles[hit]
    points = ranges[hit, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    if len(points) < 5:
        return points, points
    along = np.empty_like(points)
    along[2:-2] = points[4:] - points[:-4]
    along[:2], along[-2:] = along[2], along[-3]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    return points, np.column_stack([-along[:, 1], along[:, 0]])
