"""The interface of a parametric outline: signed distance with derivatives, and conventions.

Every shape keeps its parameters as one vector in a frame with the map's axes. ``measure`` returns
each point's signed distance (positive outside) to the part of the boundary whose normal fits.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import shapely
from numpy.typing import NDArray

from tablemap.config import SurfaceConfig
from tablemap.geometry import Bools, Floats, Ints
from tablemap.model.shapes import ShapeRecord
from tablemap.stages.surface.shapes.sides import Sight


@dataclass(frozen=True, eq=False)
class Measure:
    """Points measured against a boundary.

    distance: (N,), metres along the boundary's outward normal
    normal: (N, 2), that unit normal
    excess: (N,), metres past the end of the straight side that the point was assigned to
    jacobian: (N, k), derivatives of the distance by the parameters
    side: (N,), the side, -1 for none
    """

    distance: Floats
    excess: Floats
    normal: Floats
    jacobian: Floats
    side: Ints


@dataclass(frozen=True, eq=False)
class Shape(ABC):
    """A parametric outline; ``parameters`` (k,) metres and radians."""

    parameters: Floats

    @property
    @abstractmethod
    def record(self) -> ShapeRecord:
        """What is known of all shapes of this name."""

    @classmethod
    def starts_in(cls, rectangle: Floats) -> tuple[Shape, ...]:
        """Return starts out of a fitted rectangle's x, y, yaw, length, width; none by default."""
        return ()

    @abstractmethod
    def measure(self, points: Floats, normals: Floats) -> Measure:
        """Measure (N, 2) points with outward (N, 2) normals against the boundary."""

    @abstractmethod
    def outline(self) -> Floats:
        """Return the (n, 2) outline, counter-clockwise."""

    @abstractmethod
    def pieces(self) -> tuple[Floats, ...]:
        """Return the outline's sides as (n, 2) polylines; piece i is side i of `measure`."""

    @abstractmethod
    def describe(self) -> tuple[Floats, dict[str, float]]:
        """Return the pose (x, y, yaw; centroid, yaw unwrapped) and the dimensions by name."""

    @abstractmethod
    def is_plausible(self) -> bool:
        """Tell whether the parameters describe a valid shape."""

    def at(self, parameters: Floats) -> Self:
        """Return the same kind of shape with other parameters."""
        return replace(self, parameters=parameters)

    def normalised(self) -> Self:
        """Return the same outline with its parameters in the model's convention."""
        return self

    def is_shown(self, own: tuple[str, ...]) -> bool:
        """Tell whether sides of these statuses are enough evidence for this shape."""
        return True

    def is_told(self, covariance: Floats, config: SurfaceConfig) -> bool:
        """Tell whether a fit of this ``covariance`` (k, k) differs clearly from a simpler shape."""
        return True

    def side_statuses(self, own: tuple[str, ...]) -> tuple[str, ...]:
        """Return each side's status, given ``own``, the statuses of the sides by themselves."""
        return own

    def dimension_statuses(
        self, seen: tuple[Sight, ...], status: tuple[str, ...]
    ) -> dict[str, str]:
        """Return each dimension's status; a measured one needs both sides that bound it.

        ``seen`` and ``status`` are those of the sides, ``status`` as from `side_statuses`.
        """
        return {}


def unit(angle: NDArray[np.floating[Any]]) -> Floats:
    """Return the (..., 2) unit vectors of angles."""
    vectors: Floats = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return vectors


def perpendicular(vectors: Floats) -> Floats:
    """Return (..., 2) vectors turned a quarter counter-clockwise."""
    turned: Floats = np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)
    return turned


def area(corners: Floats) -> float:
    """Return the signed area of a (n, 2) polygon, positive counter-clockwise."""
    x, y = corners.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def centroid(corners: Floats) -> Floats:
    """Return the (2,) area centroid of a (n, 2) polygon."""
    following = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]
    total = cross.sum()
    if abs(total) < 1e-12:
        middle: Floats = corners.mean(axis=0)
        return middle
    result: Floats = ((corners + following) * cross[:, None]).sum(axis=0) / (3 * total)
    return result


def extents(corners: Floats) -> tuple[float, float]:
    """Return length and width, metres, of the smallest rectangle round an outline (n, 2)."""
    box = np.asarray(shapely.Polygon(corners).minimum_rotated_rectangle.exterior.coords)
    sides = np.hypot(*np.diff(box[:3], axis=0).T)
    return float(sides.max()), float(sides.min())


def signed_distance(points: Floats, corners: Floats) -> Floats:
    """Return (N,) distances of (N, 2) points to a (n, 2) polygon, negative inside."""
    if len(points) == 0:
        return np.empty(0)
    nearest = np.full(len(points), np.inf)
    inside: Bools = np.zeros(len(points), dtype=bool)
    px, py = points.T
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        ux, uy = bx - ax, by - ay
        length2 = max(ux * ux + uy * uy, 1e-18)
        along = np.clip(((px - ax) * ux + (py - ay) * uy) / length2, 0, 1)
        dx, dy = px - ax - along * ux, py - ay - along * uy
        np.minimum(nearest, dx * dx + dy * dy, out=nearest)
        if ay != by:
            crosses = (ay > py) != (by > py)
            inside ^= crosses & (px < ux * (py - ay) / uy + ax)
    distance: Floats = np.sqrt(nearest) * np.where(inside, -1.0, 1.0)
    return distance
