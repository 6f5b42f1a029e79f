"""Camera against laser: what the edges of a known table say of the mounting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.config import CrossCheckConfig, SurfaceConfig
from tablemap.crosscheck import CrossCheck, cross_check
from tablemap.geometry import Pose2
from tablemap.outline import Outline
from tablemap.surface import fit_surface
from tests.surface.synthetic import Bench, Table, box_table, ellipse_table, observe

# What a laser leaves: poses good to half a millimetre, the depth scale calibrated.
LAP = Bench(place_sigma=0.0005, yaw_sigma=np.radians(0.01), scale_sigma=0.0005, points=200)


def checked(
    table: Table, bench: Bench, *, offset: Pose2, seed: int = 0, source: str = "laser"
) -> CrossCheck:
    """Observe a table with the camera ``offset`` from where it is believed, and cross-check."""
    outline, registration = observe(table, bench, np.random.default_rng(seed))
    registration = replace(registration, source=source, systematic=0.008)
    outline = _displaced(outline, offset)
    surface = fit_surface(outline, registration, config=SurfaceConfig(), seed=0)
    return cross_check(outline, surface, registration, config=CrossCheckConfig())


def _displaced(outline: Outline, offset: Pose2) -> Outline:
    """Return what a camera that truly is at ``offset`` from its believed place would report."""
    back = Pose2(0.0, 0.0, -offset.yaw)
    views = []
    for view in outline.views:
        arm = view.points - view.camera_xy - offset.translation
        points = view.camera_xy + back.apply(arm)
        views.append(replace(view, points=points, normals=back.apply(view.normals)))
    return replace(outline, views=tuple(views))


@pytest.mark.parametrize(
    "table",
    [
        box_table(1.2, 0.8, Pose2(0.3, -0.2, 0.4)),
        ellipse_table(0.7, 0.7, Pose2(0.3, -0.2, 0.0)),
    ],
    ids=["rectangle", "circle"],
)
def test_a_shifted_camera_is_found_and_named(table: Table) -> None:
    """A camera 12 mm ahead and 8 mm left of its frame is measured within its sigmas, and warned."""
    result = checked(table, LAP, offset=Pose2(0.012, 0.008, 0.0))
    assert result.at_table is not None and result.at_table_sigma is not None
    wrong = np.abs(result.at_table - [0.012, 0.008])
    assert (wrong < 3 * result.at_table_sigma + 0.0005).all()
    assert [w.code for w in result.warnings] == ["crosscheck.mounting"]
    assert "further forward" in result.warnings[0].message
    assert result.pose_sigma > 0.004


def test_a_turned_camera_is_found() -> None:
    """Half a degree of yaw shows at the table as its lateral arm."""
    table = box_table(1.2, 0.8, Pose2(0.3, -0.2, 0.4))
    result = checked(table, LAP, offset=Pose2(0.0, 0.0, np.radians(0.8)))
    assert result.offset is not None and result.covariance is not None
    sigma = float(np.sqrt(result.covariance[2, 2]))
    assert abs(result.offset[2] - np.radians(0.8)) < 3 * sigma
    assert len(result.warnings) == 1


@pytest.mark.parametrize("seed", range(2))
def test_a_camera_in_its_place_raises_no_alarm(seed: int) -> None:
    """Without an offset the estimate is near zero, within its sigmas, and nothing is said."""
    table = box_table(1.3, 0.7, Pose2(0.3, -0.2, 0.4))
    result = checked(table, LAP, offset=Pose2(), seed=seed)
    assert result.at_table is not None and result.at_table_sigma is not None
    assert (np.abs(result.at_table) < 4 * result.at_table_sigma).all()
    assert result.warnings == () and result.pose_sigma == 0.0


def test_nothing_is_said_without_laser_poses_or_views() -> None:
    """Poses that rest on the camera itself cannot check it; three views do not go round a table."""
    table, offset = box_table(1.2, 0.8, Pose2()), Pose2(0.012, 0.0, 0.0)
    by_depth = checked(table, LAP, offset=offset, source="depth")
    few = checked(table, replace(LAP, views=3), offset=offset)
    for result in (by_depth, few):
        assert result.offset is None and result.warnings == ()
