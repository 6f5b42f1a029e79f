"""Starts for the fits: RANSAC generators, dominant directions, the smallest rectangle round all.

Two generators are random and come from the bachelor report: the circle through three points, and
two parallel lines through three points, found twice. The others are deterministic.
"""

from __future__ import annotations

import numpy as np
import shapely

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats, wrap_angles
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.shapes.curved import Circle, Ellipse
from tablemap.stages.surface.shapes.shape import Shape
from tablemap.stages.surface.shapes.straight import Parallelogram, Rectangle

_SAMPLE = 800


def circles(evidence: Evidence, config: SurfaceConfig, random: np.random.Generator) -> list[Circle]:
    """Find the circle through three points on which most points lie, with fitting normals."""
    points, normals = _sample(evidence)
    picks = random.integers(0, len(points), (config.ransac_draws, 3))
    a, b, c = points[picks[:, 0]], points[picks[:, 1]], points[picks[:, 2]]
    ab, ac = b - a, c - a
    cross = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    good = np.abs(cross) > 1e-4
    a, ab, ac, cross = a[good], ab[good], ac[good], cross[good]
    ab2, ac2 = np.sum(ab**2, axis=1), np.sum(ac**2, axis=1)
    centre = a + np.column_stack(
        [(ac[:, 1] * ab2 - ab[:, 1] * ac2) / cross, (ab[:, 0] * ac2 - ac[:, 0] * ab2) / cross]
    )
    radius = np.linalg.norm(a - centre, axis=1)
    good = (radius > 0.1) & (radius < 3.0)
    centre, radius = centre[good], radius[good]
    if not len(centre):
        return []
    offset = points[None] - centre[:, None]
    reach = np.linalg.norm(offset, axis=2)
    facing = np.einsum("dni,ni->dn", offset, normals) / np.maximum(reach, 1e-9)
    agree = (np.abs(reach - radius[:, None]) < config.ransac_threshold) & (
        facing > config.normal_cosine
    )
    best = int(np.argmax(agree.sum(axis=1)))
    return [Circle(np.array([*centre[best], radius[best]]))]


def ellipses(rectangles: list[Rectangle], found: list[Circle]) -> list[Ellipse]:
    """Start ellipses from circles and inside rectangles."""
    starts = []
    for rectangle in rectangles:
        x, y, yaw, length, width = rectangle.parameters
        starts.append(Ellipse.of_axes(x, y, yaw, length / 2, width / 2))
    for circle in found:
        x, y, radius = circle.parameters
        starts.append(Ellipse.of_axes(x, y, 0.0, radius, radius))
    return starts


def parallelograms(
    evidence: Evidence, config: SurfaceConfig, random: np.random.Generator
) -> list[Parallelogram]:
    """Find two parallel lines through three points, twice: they make a parallelogram."""
    points, normals = _sample(evidence)
    first = _parallel_pair(points, normals, config, random)
    if first is None:
        return []
    angle, low, high, agree = first
    rest = ~agree
    # The second pair must cross the first at more than 20 degrees.
    rest &= np.abs(normals @ np.array([np.cos(angle), np.sin(angle)])) < np.cos(np.radians(20))
    if rest.sum() < 6:
        return []
    second = _parallel_pair(points[rest], normals[rest], config, random)
    if second is None:
        return []
    other, other_low, other_high, _ = second
    shape = _between(angle, low, high, other, other_low, other_high)
    return [shape] if shape is not None and shape.is_plausible() else []


def _parallel_pair(
    points: Floats, normals: Floats, config: SurfaceConfig, random: np.random.Generator
) -> tuple[float, float, float, np.ndarray] | None:
    picks = random.integers(0, len(points), (config.ransac_draws, 3))
    a, b, c = points[picks[:, 0]], points[picks[:, 1]], points[picks[:, 2]]
    along = b - a
    length = np.linalg.norm(along, axis=1)
    good = length > 0.05
    a, c, along, length = a[good], c[good], along[good], length[good]
    if not len(a):
        return None
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None]
    first, second = np.sum(a * outward, axis=1), np.sum(c * outward, axis=1)
    apart = np.abs(second - first) > 0.1
    if not apart.any():
        return None
    outward, first, second = outward[apart], first[apart], second[apart]
    flip = np.where(first > second, -1.0, 1.0)
    outward = outward * flip[:, None]
    low, high = np.where(flip < 0, -first, first), np.where(flip < 0, -second, second)
    offset = outward @ points.T
    facing = outward @ normals.T
    near = config.ransac_threshold
    agree = ((np.abs(offset - high[:, None]) < near) & (facing > config.normal_cosine)) | (
        (np.abs(offset - low[:, None]) < near) & (facing < -config.normal_cosine)
    )
    best = int(np.argmax(agree.sum(axis=1)))
    angle = float(np.arctan2(outward[best, 1], outward[best, 0]))
    return angle, float(low[best]), float(high[best]), agree[best]


def _between(
    angle: float, low: float, high: float, other: float, other_low: float, other_high: float
) -> Parallelogram | None:
    """Make the parallelogram between two pairs of parallel lines, each given by its normal."""
    if np.sin(other - angle) < 0:
        other, other_low, other_high = other + np.pi, -other_high, -other_low
    sine = float(np.sin(other - angle))
    if sine < 0.3:
        return None
    # The first pair's normal belongs to the sides along the width.
    middle, other_middle = (low + high) / 2, (other_low + other_high) / 2
    system = np.array([[np.cos(angle), np.sin(angle)], [np.cos(other), np.sin(other)]])
    x, y = np.linalg.solve(system, np.array([middle, other_middle]))
    yaw = other - np.pi / 2
    corner = angle + np.pi / 2 - yaw
    return Parallelogram(
        np.array(
            [
                x,
                y,
                yaw,
                (high - low) / sine,
                (other_high - other_low) / sine,
                float(corner % (2 * np.pi)),
            ]
        )
    ).normalised()


def rectangles(evidence: Evidence) -> list[Rectangle]:
    """Start rectangles along the points' dominant direction, and the smallest one round all."""
    points, normals = evidence.points, evidence.normals
    turn = np.arctan2(normals[:, 1], normals[:, 0])
    starts = []
    bins = np.bincount((np.degrees(turn) % 90).astype(np.int64), minlength=90)[:90]
    smooth = sum(np.roll(bins, k) for k in range(-4, 5))
    peak = float(np.radians(int(np.argmax(smooth)) + 0.5))
    close = np.abs(wrap_angles(turn - peak, np.pi / 2)) < np.radians(15)
    if close.any():
        peak += float(np.median(wrap_angles(turn[close] - peak, np.pi / 2)))
    starts.append(_along(peak, evidence))
    seen = np.concatenate([points, evidence.top])
    box = shapely.minimum_rotated_rectangle(shapely.MultiPoint(seen))
    if isinstance(box, shapely.Polygon):
        corners = np.asarray(box.exterior.coords)
        side = corners[1] - corners[0]
        starts.append(_along(float(np.arctan2(side[1], side[0])), evidence))
    return [start for start in starts if start.is_plausible()]


def _along(yaw: float, evidence: Evidence) -> Rectangle:
    """Put each side where most points with its normal lie, or where the seen top ends."""
    ends = []
    for quarter in range(4):
        angle = yaw + quarter * np.pi / 2
        outward = np.array([np.cos(angle), np.sin(angle)])
        facing = evidence.normals @ outward > 0.9
        offset = evidence.points[facing] @ outward
        reach = evidence.top @ outward if len(evidence.top) else evidence.points @ outward
        if len(offset) >= 10:
            step = 0.01
            bins = np.floor((offset - offset.min()) / step).astype(np.int64)
            counts = np.convolve(np.bincount(bins), [1, 2, 1], mode="same")
            ends.append(float(offset.min() + (int(np.argmax(counts)) + 0.5) * step))
        else:
            ends.append(float(np.percentile(reach, 99.5)))
    right, front, left, back = ends
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    x, y = np.array([(right - left) / 2, (front - back) / 2]) @ axes
    return Rectangle(np.array([x, y, yaw, right + left, front + back])).normalised()


def _sample(evidence: Evidence) -> tuple[Floats, Floats]:
    count = len(evidence.points)
    pick = np.linspace(0, count - 1, min(count, _SAMPLE)).round().astype(np.int64)
    return evidence.points[pick], evidence.normals[pick]


def generators(
    evidence: Evidence, config: SurfaceConfig, random: np.random.Generator
) -> dict[type[Shape], list[Shape]]:
    """Return the starts that come from the points, by the class of the fit."""
    found = circles(evidence, config, random)
    boxes = rectangles(evidence)
    slanted = parallelograms(evidence, config, random)
    for shape in slanted:
        x, y, yaw, length, width, corner = shape.parameters
        upright = width * np.sin(corner)
        boxes.append(Rectangle(np.array([x, y, yaw, length, upright])).normalised())
    return {
        Circle: list(found),
        Ellipse: list(ellipses(boxes, found)),
        Rectangle: list(boxes),
        Parallelogram: list(slanted),
    }
