"""Which side of the top has the sensor's shadow, and how wide its baseline is."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.stages.outline.shadows import Gaps, find_gaps, find_shadow

FOCAL = 500.0
TABLE, FLOOR = 1.2, 2.0  # metres away


def side_of(widths: np.ndarray) -> Gaps:
    """Make whole gaps of given widths in pixels, between a table and the floor."""
    count = len(widths)
    rows = np.arange(count)
    return Gaps(
        rows=rows,
        columns=rows,
        reach=np.round(widths).astype(np.int64),
        parallax=np.full(count, FOCAL * (1 / TABLE - 1 / FLOOR)),
        begins=np.ones(count, dtype=bool),
    )


def shadow(baseline: float, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return widths of gaps that a baseline makes, ragged by half a pixel."""
    return FOCAL * (1 / TABLE - 1 / FLOOR) * baseline + rng.normal(0, 0.5, count)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("baseline", [0.05, 0.12])
def test_most_gaps_agree_in_the_baseline(side: int, baseline: float) -> None:
    """Among as many holes of any width the side is found, and a baseline wider than believed."""
    rng = np.random.default_rng(0)
    holes = rng.uniform(4, 100, 80)
    views = []
    for _ in range(4):
        pair = (side_of(np.concatenate([shadow(baseline, 40, rng), holes])), side_of(holes))
        views.append(pair if side == 0 else pair[::-1])
    found = find_shadow(views, 0.075)
    assert found is not None
    assert found.side == side
    assert found.baseline == pytest.approx(max(baseline, 0.075), rel=0.05)


def test_gaps_of_the_stated_baseline_win_over_a_larger_crowd() -> None:
    """A dark rail makes as many gaps that nearly agree, twice as wide, on the other side."""
    rng = np.random.default_rng(3)
    rail = shadow(0.16, 300, rng)
    views = [(side_of(shadow(0.072, 250, rng)), side_of(rail))]
    found = find_shadow(views, 0.075)
    assert found is not None
    assert (found.side, found.baseline) == (0, 0.075)


def test_holes_of_any_width_are_no_shadow() -> None:
    """Gaps that agree in nothing, as many on both sides, leave the side open."""
    rng = np.random.default_rng(1)
    views = [(side_of(rng.uniform(4, 100, 80)), side_of(rng.uniform(4, 100, 80)))]
    assert find_shadow(views, 0.075) is None
    assert find_shadow([], 0.075) is None


def test_a_sensor_with_one_eye_has_no_shadow() -> None:
    """Where the baseline is believed to be 0, gaps that agree are something else."""
    rng = np.random.default_rng(2)
    views = [(side_of(shadow(0.08, 60, rng)), side_of(np.empty(0)))]
    assert find_shadow(views, 0.0) is None
    assert find_shadow(views, 0.075) is not None


def test_a_shadow_covers_the_gap_beside_the_top_and_no_hole_elsewhere() -> None:
    """Of a row floor, gap, top, hole, top only the gap is found, as wide as the parallax."""
    width = round(FOCAL * 0.075 * (1 / TABLE - 1 / FLOOR))
    depth = np.full((40, 120), TABLE, dtype=np.float32)
    depth[:, :50] = FLOOR
    depth[:, 50 - width : 50] = np.nan
    depth[:, 80:90] = np.nan
    known = np.isfinite(depth)
    top, below = depth == np.float32(TABLE), depth == np.float32(FLOOR)
    gaps = find_gaps(depth, top, below, np.zeros_like(top), known, FOCAL)
    found = find_shadow([gaps], 0.075)
    assert found is not None
    covered = found.cast_on(gaps, depth.shape)
    assert covered[:, 50 - width : 50].all()
    assert covered.sum() == 40 * width
