"""A strip of the top whose depth is too long is no edge: other views see through where it seems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Polygon

from tablemap.errors import ProcessWarning
from tablemap.geometry import transform
from tablemap.stages.legs.misread import find_misread_side
from tests.making.leg_scenes import TABLE, Scene, drive

STRIP = 0.05  # metres along the first long side


def _warned(scene: Scene, share: float) -> ProcessWarning | None:
    """Look at a scene whose top has a strip with depths that are too long by a share of them.

    The outline is where the top then seems to end.
    """
    _, snapshots, registration, surface = drive(
        scene, np.random.default_rng(0), with_depth=True, scans_per_stop=2, scans_between=1
    )
    poses = dict(enumerate(registration.map_from_base))
    shown = []
    for snapshot in snapshots:
        points = transform(
            snapshot.base_from_camera, snapshot.camera.rays * snapshot.depth[..., None]
        )
        own = scene.table.inverse().apply(poses[snapshot.index].apply(points[..., :2]))
        strip = (own[..., 1] > scene.width / 2 - STRIP) & (own[..., 1] < scene.width / 2 + 0.01)
        strip &= np.abs(points[..., 2] - scene.height) < 0.01
        depth = np.where(strip, snapshot.depth * (1 + share), snapshot.depth)
        shown.append(replace(snapshot, depth=depth.astype(np.float32)))
    outline = scene.table.inverse().apply(surface.outline)
    if share:
        outline[:, 1] = np.minimum(outline[:, 1], scene.width / 2 - STRIP)
    return find_misread_side(tuple(shown), poses, Polygon(scene.table.apply(outline)), scene.height)


@pytest.mark.parametrize("share", [0.1, 0.2])
def test_a_strip_with_a_wrong_depth_is_doubted(share: float) -> None:
    """It seems to lie lower beyond the edge, elsewhere in each view."""
    warning = _warned(Scene(table=TABLE, length=1.3, width=0.8), share)
    assert warning is not None
    assert warning.code == "accuracy.hidden_rim"
    assert "1.30 m" in warning.message


@pytest.mark.parametrize("lower", [None, 0.05, 0.10])
def test_a_lower_level_that_stands_there_is_not_doubted(lower: float | None) -> None:
    """Beyond an edge there is the floor, or a bench that all views see where it is."""
    scene = Scene(table=TABLE, length=1.3, width=0.8)
    if lower is not None:
        place = TABLE.apply(np.array([0.0, 0.55]))
        scene.boxes = [(*place, 1.3, 0.3, TABLE.yaw, 0.0, scene.height - lower)]
    assert _warned(scene, 0.0) is None
