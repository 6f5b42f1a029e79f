"""A gap between two surfaces of one height shows as edges inside of the outline."""

from __future__ import annotations

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.stages.surface.inner import inner_edges

CONFIG = SurfaceConfig()
SQUARE = np.array([[0.0, 0.0], [1.4, 0.0], [1.4, 1.2], [0.0, 1.2]])


def test_a_row_of_edge_points_inside_is_a_line() -> None:
    """Forty points along a gap are found with their length; those on the rim are not inner."""
    rng = np.random.default_rng(0)
    gap = np.column_stack([np.linspace(0.1, 1.2, 40), 0.8 + rng.normal(0, 0.004, 40)])
    rim = np.column_stack([np.linspace(0.0, 1.4, 90), rng.normal(0, 0.003, 90)])
    (edge,) = inner_edges(np.vstack([rim, gap]), SQUARE, CONFIG)
    assert edge.points == 40
    assert abs(edge.length - 1.1) < 0.02
    assert np.allclose(sorted(edge.ends), [[0.1, 0.8], [1.2, 0.8]], atol=0.02)


def test_scattered_points_and_short_rows_are_no_line() -> None:
    """Stray points all over, a clump and 10 cm of a row say nothing."""
    rng = np.random.default_rng(1)
    stray = rng.uniform(0.1, 1.1, (60, 2))
    clump = rng.normal((0.7, 0.6), 0.04, (40, 2))
    row = np.column_stack([np.linspace(0.3, 0.4, 30), np.full(30, 0.3)])
    assert inner_edges(clump, SQUARE, CONFIG) == []
    assert inner_edges(row, SQUARE, CONFIG) == []
    assert inner_edges(stray[:12], SQUARE, CONFIG) == []
