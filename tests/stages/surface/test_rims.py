"""A rim that gives no depth is said, and the sigmas hold its width."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import pytest

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.geometry import Pose2
from tablemap.stages.outline import EdgeKind
from tablemap.stages.surface import Surface, fit_surface
from tests.making.edges import Bench, box_table, observe

POSE = Pose2(0.31, -0.22, 0.37)
TABLE = box_table(1.2, 0.8, POSE)
RIM = 0.03


def _fit(sides: Collection[float], missing: float, seed: int = 5) -> Surface:
    """Fit a table of 1.2 x 0.8 m; ends at ``sides`` (headings in the table) lie a rim inside.

    ``missing`` is the share of the near ends there that are at missing depth.
    """
    rng = np.random.default_rng(seed)
    outline, registration = observe(TABLE, Bench(), rng)
    views = []
    for view, pose in zip(outline.views, registration.map_from_base, strict=True):
        heading = np.arctan2(*(pose.rotate(view.normals).T[::-1])) - POSE.yaw
        there = np.zeros(len(heading), dtype=bool)
        for side in sides:
            there |= np.cos(heading - side) > np.cos(np.pi / 4)
        gone = there & view.is_near & (rng.random(len(there)) < missing)
        views.append(
            replace(
                view,
                points=view.points - np.where(there, RIM, 0.0)[:, None] * view.normals,
                kind=np.where(gone, EdgeKind.MISSING, view.kind).astype(np.uint8),
                hole=np.where(there, RIM, 0.0),
            )
        )
    seen = replace(outline, views=tuple(views))
    return fit_surface(seen, registration, config=SurfaceConfig(), sensors=SensorsConfig(), seed=0)


def _codes(surface: Surface) -> set[str]:
    return {warning.code for warning in surface.warnings}


@pytest.mark.parametrize("sides", [(0.0, np.pi / 2, np.pi, -np.pi / 2), (np.pi / 2,)])
def test_a_rim_without_depth_is_doubted(sides: tuple[float, ...]) -> None:
    """On all sides or on one: the figures hold the truth, and the rest is as sure as before."""
    surface = _fit(sides, 0.9)
    assert "accuracy.hidden_rim" in _codes(surface)
    for name, truth in TABLE.dimensions.items():
        figure = surface.dimensions[name]
        assert figure.sigma is not None
        assert abs(figure.value - truth) < 2 * figure.sigma
    sigmas = sorted(edge.sigma or 0.0 for edge in surface.edges)
    assert sigmas[-1] == pytest.approx(RIM, rel=0.3)
    assert sum(sigma > RIM / 2 for sigma in sigmas) == len(sides)


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_holes_and_shadows_beside_a_side_are_no_rim(missing: float) -> None:
    """Most ends of such a side lie at something that was seen."""
    surface = _fit((), missing)
    assert "accuracy.hidden_rim" not in _codes(surface)
    assert max(edge.sigma or 0.0 for edge in surface.edges) < 0.004
