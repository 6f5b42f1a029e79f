"""The scans of a base that stands as one."""

from __future__ import annotations

import numpy as np
import pytest

from tablemap.stages.odometry import combine_beams


def test_the_scans_of_a_stop_are_averaged_beam_by_beam() -> None:
    """Who walks by does not count, nor the surface behind an edge, nor a beam often lost."""
    scans = np.full((10, 4), 2.0) + 0.004 * np.arange(10)[:, None]
    scans[3, 0] = 0.9  # a leg passes
    scans[:5, 1] = np.inf  # half of the scans lost it
    scans[::2, 2] += 1.0  # an edge: now the one surface, now the other
    scans[0, 2] = np.inf
    beams = combine_beams(scans)
    assert beams.seen.tolist() == [True, False, True, True]
    assert beams.agreed.tolist() == [True, True, True, True]
    assert beams.mean[2] == pytest.approx(scans[1::2, 2].mean())
    assert beams.mean[3] == pytest.approx(2.018)
    assert beams.mean[0] == pytest.approx(np.delete(scans[:, 0], 3).mean())


def test_beams_that_scatter_do_not_agree() -> None:
    """A median that few scans lie near is no surface."""
    beams = combine_beams(np.linspace(1.0, 3.0, 9)[:, None])
    assert beams.seen.tolist() == [True]
    assert beams.agreed.tolist() == [False]
