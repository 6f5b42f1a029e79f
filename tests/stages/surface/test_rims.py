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
from tests.making.edges import Bench, box_table, observe, rounded

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


RADIUS = 0.1
ROUND = rounded(TABLE, RADIUS)
CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def _fit_with_holes(corners: Collection[tuple[int, int]], views: int, told: bool) -> Surface:
    """Fit a top of round corners; in ``views`` views some ends there are at missing depth.

    ``told`` says whether a lower surface is seen behind it, as beyond a hole.
    """
    rng = np.random.default_rng(3)
    outline, registration = observe(ROUND, Bench(), rng)
    seen = []
    for view, pose in zip(outline.views, registration.map_from_base, strict=True):
        local = POSE.inverse().apply(pose.apply(view.points))
        there = np.zeros(len(local), dtype=bool)
        for along, across in corners:
            beyond = local * [along, across] - [0.6 - RADIUS, 0.4 - RADIUS]
            there |= (beyond > 0.01).all(axis=1)
        gone = there & (rng.random(len(there)) < 0.4) & (view.index < views)
        seen.append(
            replace(
                view,
                points=view.points - np.where(gone, 0.02, 0.0)[:, None] * view.normals,
                kind=np.where(gone, EdgeKind.MISSING, view.kind).astype(np.uint8),
                hole=np.where(gone, 0.07 if told else np.nan, 0.0),
            )
        )
    seen = replace(outline, views=tuple(seen))
    return fit_surface(seen, registration, config=SurfaceConfig(), sensors=SensorsConfig(), seed=0)


@pytest.mark.parametrize("corners", [CORNERS, CORNERS[:1]], ids=["all", "one"])
def test_a_corner_without_depth_may_be_sharp(corners: tuple[tuple[int, int], ...]) -> None:
    """The edge's sigma holds the sharp corner, the radius' by the share of such corners."""
    surface = _fit_with_holes(corners, views=8, told=True)
    assert [w.message for w in surface.warnings if w.code == "accuracy.hidden_rim"] == [
        f"At {len(corners)} of 4 corners the depth is missing, so that a radius of "
        f"{surface.corner_radius.value:.3f} m was fitted to the edges of holes; the top may have "
        f"sharp corners, which lie {414 * surface.corner_radius.value:.0f} mm farther out."
    ]
    assert surface.corner_radius.sigma == pytest.approx(RADIUS * len(corners) / 4, rel=0.15)
    sigmas = [edge.sigma or 0.0 for edge in surface.edges]
    assert sum(sigma > 0.035 for sigma in sigmas) == len(corners)
    for name, truth in ROUND.dimensions.items():
        figure = surface.dimensions[name]
        assert figure.sigma is not None and figure.sigma < 0.004
        assert abs(figure.value - truth) < 3 * figure.sigma


@pytest.mark.parametrize(("views", "told"), [(2, True), (8, False), (0, True)])
def test_shadows_at_round_corners_are_no_holes(views: int, told: bool) -> None:
    """A shadow lies beside a corner in few views, and the lower surface is not seen behind it."""
    surface = _fit_with_holes(CORNERS, views, told)
    assert "accuracy.hidden_rim" not in _codes(surface)
    assert surface.corner_radius.sigma < 0.01
