"""Normals of a scan's points are those of the lines that the points lie on."""

from __future__ import annotations

import numpy as np

from tablemap.geometry import Floats
from tablemap.stages.registration.laser.normals import planar_normals
from tests.making.casting import Box, cast_level
from tests.making.rooms import corridor

ORIGIN = np.array([0.1, -0.8])
BEARINGS = np.linspace(-2.1, 2.1, 721)
BEAMS = np.stack([np.cos(BEARINGS), np.sin(BEARINGS)], axis=1)


def scanned(segments: Floats, *, noise: float) -> Floats:
    """Return (721, 2) points of one scan, NaN where nothing is hit within 10 m."""
    ranges = cast_level(segments, ORIGIN, BEAMS)
    ranges = ranges + np.random.default_rng(0).normal(0.0, noise, len(ranges))
    ranges[ranges > 10.0] = np.nan
    return ORIGIN + ranges[:, None] * BEAMS


def test_normals_of_a_bare_wall_hardly_nod() -> None:
    """With 3 mm of noise they err by half a degree: a wall says nothing along itself."""
    points = scanned(corridor(0.0, leg=0.001), noise=0.003)
    normals, holds, noise = planar_normals(points, ORIGIN)
    assert holds.sum() > 200
    assert 0.002 < noise < 0.004
    assert np.degrees(np.sqrt(np.mean(normals[holds, 0] ** 2))) < 0.5
    facing = np.einsum("ij,ij->i", normals[holds], ORIGIN - points[holds])
    assert (facing > 0).all()


def test_the_faces_of_a_leg_keep_their_own_normals() -> None:
    """What is short is not taken for a piece of a longer line."""
    points = scanned(Box(0.9, -0.5, 0.08, 0.08).sides(), noise=0.001)
    normals, holds, _ = planar_normals(points, ORIGIN)
    assert holds.sum() > 10
    # Both faces are seen; in the middle of the one ahead the other is not near.
    ahead = holds & (points[:, 0] < 0.87) & (np.abs(points[:, 1] + 0.5) < 0.01)
    assert ahead.sum() >= 3
    assert np.abs(normals[ahead, 0]).min() > 0.95


def test_the_normals_of_a_corner_are_those_of_its_walls() -> None:
    """A longer piece is not bent round the corner."""
    points = scanned(Box(0.0, 0.0, 4.0, 3.0).sides(), noise=0.003)
    normals, holds, _ = planar_normals(points, ORIGIN)
    far_from_corner = np.abs(np.abs(points) - [2.0, 1.5]).max(axis=1) > 0.1
    straight = np.abs(normals[holds & far_from_corner]).max(axis=1)
    assert straight.min() > np.cos(np.radians(12))
    assert np.median(straight) > np.cos(np.radians(0.5))


def test_no_point_has_no_normal() -> None:
    """An empty or blind scan is not an error."""
    normals, holds, noise = planar_normals(np.full((5, 2), np.nan), ORIGIN)
    assert normals.shape == (5, 2)
    assert not holds.any()
    assert noise == 0.0
