"""Parametric outlines keep their conventions and their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.config import SurfaceConfig
from tablemap.stages.surface.shapes.chamfered import Chamfered
from tablemap.stages.surface.shapes.curved import Circle, Ellipse
from tablemap.stages.surface.shapes.rounded import Rounded
from tablemap.stages.surface.shapes.shape import Shape, area, signed_distance
from tablemap.stages.surface.shapes.stadium import Stadium
from tablemap.stages.surface.shapes.straight import (
    Parallelogram,
    Polygon,
    Rectangle,
    Rectilinear,
    Sided,
    Square,
)

L_SHAPE = Rectilinear(
    np.array([0.3, 0.7, 0.8, 0.0, 0.1, 0.7, 0.6]), np.array([3, 0, 1, 0, 1, 2]), np.arange(6)
)
TRIANGLE = Polygon(np.array([-0.1, 1.8, 3.9, 0.5, 0.6, 0.4]))


def _rounded(sharp: Sided, radius: float) -> Rounded:
    return Rounded(np.append(sharp.parameters, radius), sharp)


def _cut(sharp: Sided, size: float, which: tuple[int, ...]) -> Chamfered:
    is_cut = np.isin(np.arange(len(sharp.corners)), which)
    return Chamfered(np.append(sharp.parameters, size), sharp, is_cut)


def _name(shape: Shape) -> str:
    own = type(shape).__name__
    return own + type(shape.kind).__name__ if isinstance(shape, Rounded | Chamfered) else own


SHAPES: list[Shape] = [
    Circle(np.array([0.1, -0.2, 0.5])),
    Ellipse.of_axes(0.1, -0.2, 0.7, 0.6, 0.4),
    Rectangle(np.array([0.1, -0.2, 0.7, 1.2, 0.8])),
    Square(np.array([0.1, -0.2, 0.7, 0.6])),
    Parallelogram(np.array([0.1, -0.2, 0.7, 1.2, 0.8, 1.3])),
    _rounded(Rectangle(np.array([0.1, -0.2, 0.7, 1.2, 0.8])), 0.15),
    _rounded(Square(np.array([0.1, -0.2, 0.7, 0.6])), 0.05),
    _rounded(Parallelogram(np.array([0.1, -0.2, 0.7, 1.2, 0.8, 1.3])), 0.1),
    _rounded(L_SHAPE, 0.05),
    _rounded(TRIANGLE, 0.08),
    _cut(Rectangle(np.array([0.1, -0.2, 0.7, 1.2, 0.8])), 0.06, (0, 1, 2, 3)),
    _cut(Parallelogram(np.array([0.1, -0.2, 0.7, 1.2, 0.8, 1.3])), 0.1, (1, 2)),
    _cut(L_SHAPE, 0.05, (0, 2, 5)),
    _cut(TRIANGLE, 0.08, (0, 1, 2)),
    Stadium(np.array([0.1, -0.2, 0.7, 1.2, 0.8])),
    L_SHAPE,
    TRIANGLE,
]


@pytest.mark.parametrize("shape", SHAPES, ids=_name)
class TestEveryShape:
    """What holds for every shape."""

    def test_outline_runs_counter_clockwise(self, shape: Shape) -> None:
        """Areas are positive, and the shape calls itself plausible."""
        assert shape.is_plausible()
        assert area(shape.outline()) > 0.1

    def test_distance_is_the_outline_s(self, shape: Shape) -> None:
        """Points set off from the outline along its normal measure what they were set off by."""
        middle, normal = _middles(shape)
        for off in (-0.004, 0.004):
            measured = shape.measure(middle + off * normal, normal)
            assert np.abs(measured.distance - off).max() < 1.2e-3
            assert np.sum(measured.normal * normal, axis=1).min() > 0.99

    def test_derivatives_are_those_of_differences(self, shape: Shape) -> None:
        """On the outline the Jacobian agrees with central differences."""
        points, normal = _middles(shape)
        step = 1e-6
        measured = shape.measure(points, normal)
        for index in range(len(shape.parameters)):
            change = np.zeros(len(shape.parameters))
            change[index] = step
            above = shape.at(shape.parameters + change).measure(points, normal).distance
            below = shape.at(shape.parameters - change).measure(points, normal).distance
            slope = (above - below) / (2 * step)
            # The ellipse's distance is of first order: its slope is so too.
            assert np.abs(slope - measured.jacobian[:, index]).max() < 0.02

    def test_pieces_make_up_the_outline(self, shape: Shape) -> None:
        """Every piece lies on the outline, and together they are as long."""
        pieces = shape.pieces()
        ring = shape.outline()
        closed = np.concatenate([ring, ring[:1]])
        length = sum(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces)
        assert length == pytest.approx(np.linalg.norm(np.diff(closed, axis=0), axis=1).sum())
        assert max(np.abs(signed_distance(p, ring)).max() for p in pieces) < 1e-9


@pytest.mark.parametrize(
    "shape",
    [
        Rectangle(np.array([0.1, -0.2, 0.7, 0.8, 1.2])),
        Parallelogram(np.array([0.1, -0.2, 0.7, 0.8, 1.2, 1.3])),
        _rounded(Rectangle(np.array([0.1, -0.2, 0.7, 0.8, 1.2])), 0.1),
    ],
    ids=_name,
)
def test_the_length_is_the_longer_side(shape: Shape) -> None:
    """Renaming the sides leaves the outline where it is."""
    renamed = shape.normalised()
    _, values = renamed.describe()
    assert values["length"] == pytest.approx(1.2)
    assert values["width"] == pytest.approx(0.8)
    assert np.abs(signed_distance(renamed.outline(), shape.outline())).max() < 1e-9
    assert area(renamed.outline()) == pytest.approx(area(shape.outline()))


@pytest.mark.parametrize(("radius", "told"), [(0.005, False), (0.08, True), (0.48, False)])
def test_a_round_polygon_keeps_straight_sides(radius: float, told: bool) -> None:
    """Too small a radius is a pixel's blur; with too large a one the top is another shape."""
    shape = _rounded(TRIANGLE, radius)
    assert shape.is_plausible()
    assert shape.is_told(np.eye(7) * 1e-8, SurfaceConfig()) is told


def _middles(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles of the outline's segments and their outward normals."""
    ring = shape.outline()
    along = np.roll(ring, -1, axis=0) - ring
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return ring + along / 2, normal
