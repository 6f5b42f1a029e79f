"""Camera against laser: what the edges and legs of a known table say of the mounting."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tablemap.config import CrossCheckConfig, LegsConfig, SensorsConfig, SurfaceConfig
from tablemap.geometry import Floats, Pose2
from tablemap.stages.calibration import TopBelief
from tablemap.stages.crosscheck import CrossCheck, admitted_legs, corrected, cross_check
from tablemap.stages.legs import Leg, Legs, find_legs
from tablemap.stages.outline import Outline
from tablemap.stages.surface import FittedFigure, camera_motion, fit_surface
from tests.making.edges import Bench, Table, box_table, ellipse_table, observe
from tests.making.leg_scenes import Scene, drive, four

SENSORS = SensorsConfig()

# What a laser leaves: poses good to half a millimetre, the depth scale calibrated.
LAP = Bench(place_sigma=0.0005, yaw_sigma=np.radians(0.01), scale_sigma=0.0005, points=200)


def checked(
    table: Table, bench: Bench, *, offset: Pose2, seed: int = 0, source: str = "laser"
) -> CrossCheck:
    """Observe a table with the camera ``offset`` from where it is believed, and cross-check."""
    outline, registration = observe(table, bench, np.random.default_rng(seed))
    registration = replace(registration, source=source, systematic=0.008)
    outline = _calibrated(_displaced(outline, offset))
    surface = fit_surface(outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    return cross_check(outline, surface, registration, config=CrossCheckConfig(), sensors=SENSORS)


def _calibrated(outline: Outline, tilt_deg: float = 0.03) -> Outline:
    """Return the outline of a camera whose roll and pitch the floor has shown."""
    camera = TopBelief(
        np.diag([0.001, 0.0005, np.radians(tilt_deg), np.radians(tilt_deg)]) ** 2,
        view_tilt=0.0003,
        view_lift=0.0003,
        lean=(0.0, 0.0),
        view_shift=0.0,
        is_held=False,
    )
    return replace(outline, camera=camera, height_sigma=0.001)


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


@pytest.mark.parametrize("tilt", ["roll", "pitch"])
def test_a_tilted_camera_is_not_called_shifted_or_turned(tilt: str) -> None:
    """A third of a degree moves the edges by millimetres, to either side otherwise."""
    table = box_table(1.2, 0.8, Pose2(0.3, -0.2, 0.4))
    outline, registration = observe(table, LAP, np.random.default_rng(3))
    views = []
    for view in outline.views:
        count = len(view.points)
        motion = camera_motion(
            view.points - view.camera_xy,
            np.full(count, view.drop),
            np.tile(view.axis, (count, 1)),
            np.zeros(count),
        )
        moved = np.radians(0.3) * getattr(motion, tilt)
        views.append(replace(view, points=view.points + moved))
    outline = _calibrated(replace(outline, views=tuple(views)), tilt_deg=0.3)
    surface = fit_surface(outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    result = cross_check(outline, surface, registration, config=CrossCheckConfig(), sensors=SENSORS)
    assert result.warnings == ()
    if result.offset is not None:
        assert result.covariance is not None
        assert (np.abs(result.offset) < 3 * np.sqrt(np.diag(result.covariance))).all()


def test_nothing_is_said_without_laser_poses_or_views() -> None:
    """Poses that rest on the camera itself cannot check it; three views do not go round a table."""
    table, offset = box_table(1.2, 0.8, Pose2()), Pose2(0.012, 0.0, 0.0)
    by_depth = checked(table, LAP, offset=offset, source="depth")
    few = checked(table, replace(LAP, views=3), offset=offset)
    for result in (by_depth, few):
        assert result.offset is None and result.warnings == ()


@pytest.mark.parametrize(("forward", "is_doubted"), [(0.012, False), (0.03, True)])
def test_an_offset_of_centimetres_that_edges_alone_show_is_doubted(
    forward: float, is_doubted: bool
) -> None:
    """TF is hardly off by so much; the edges of a top that mirrors look alike."""
    result = checked(box_table(1.2, 0.8, Pose2()), LAP, offset=Pose2(forward, 0.0, 0.0))
    assert result.is_found
    codes = [warning.code for warning in result.warnings]
    assert ("accuracy.views_disagree" in codes) == is_doubted


def test_an_offset_of_centimetres_that_legs_confirm_is_believed() -> None:
    """Legs stand where they stand, whatever the top's edges look like."""
    result = _with_legs(Pose2(0.03, 0.0, 0.0))
    assert result.is_found
    assert [warning.code for warning in result.warnings] == ["crosscheck.mounting"]


def _with_legs(
    offset: Pose2,
    *,
    leaning: float = 0.0,
    seed: int = 0,
    stops: int = 8,
    later: Pose2 | None = None,
) -> CrossCheck:
    """Four legs seen by the laser, and by a camera ``offset`` from where it is believed.

    From half way on it is ``later`` from there, where that is given.
    """
    scene = Scene(table=Pose2(0.4, -0.3, 0.6))
    scene.boxes = [(*place, 0.06, 0.06, scene.table.yaw) for place in four(scene)]
    if leaning:
        scene.boxes = [
            (x + leaning * k, y, 0.06, 0.06, yaw, 0.1 * k, 0.1 * k + 0.1)
            for x, y, _, _, yaw in scene.boxes
            for k in range(7)
        ]
    rng = np.random.default_rng(seed)
    recording, snapshots, registration, surface = drive(
        scene,
        rng,
        scans_between=4,
        stops=stops,
        scans_per_stop=4,
        with_depth=True,
        pose_sigma=0.0005,
    )
    # The images are what the true camera saw; the frames have it elsewhere.
    offsets = [offset if later is None or s.index < stops // 2 else later for s in snapshots]
    snapshots = tuple(
        replace(s, base_from_camera=_about_itself(s.base_from_camera, its.inverse()))
        for s, its in zip(snapshots, offsets, strict=True)
    )
    legs = find_legs(
        recording, snapshots, registration, surface, config=LegsConfig(), sensors=SENSORS
    )
    assert len(legs.legs) == 4
    outline = Outline((), scene.height, 0.001, {}, None, None, ())
    config = CrossCheckConfig()
    return cross_check(
        outline, surface, registration, legs.legs, snapshots, config=config, sensors=SENSORS
    )


def _about_itself(base_from_camera: Floats, offset: Pose2) -> Floats:
    """Shift a camera in the base, and turn it about its own vertical."""
    turned = offset.lifted()[:3, :3] @ base_from_camera[:3, :3]
    moved = base_from_camera.copy()
    moved[:3, :3] = turned
    moved[:2, 3] += offset.rotation.T @ offset.translation
    return moved


@pytest.mark.parametrize("seed", range(2))
def test_legs_alone_show_where_the_camera_is(seed: int) -> None:
    """Without an edge, four legs give 10 mm ahead, 8 mm left and half a degree within sigmas."""
    result = _with_legs(Pose2(0.010, 0.008, np.radians(0.5)), seed=seed)
    assert result.by_edges is None and result.by_legs is not None
    assert result.offset is not None and result.covariance is not None
    sigma = np.sqrt(np.diag(result.covariance))
    wrong = np.abs(result.offset - [0.010, 0.008, np.radians(0.5)])
    assert (wrong < 3 * sigma).all()
    assert sigma[1] < 0.003 and sigma[2] < np.radians(0.2)
    assert result.is_found and "legs" in result.warnings[0].message


@pytest.mark.parametrize(
    ("later", "metres", "side"),
    [
        (Pose2(0.04, 0.0, 0.0), 0.04, "forward"),
        (Pose2(-0.03, 0.0, 0.0), 0.03, "back"),
        (Pose2(0.0, -0.03, 0.0), 0.03, "right"),
    ],
)
def test_a_camera_that_moves_on_the_way_is_doubted(later: Pose2, metres: float, side: str) -> None:
    """Half of the views see all legs elsewhere: one offset of the camera does not tell that."""
    (doubt,) = [w for w in _with_legs(Pose2(), later=later).warnings if "accuracy" in w.code]
    assert doubt.code == "accuracy.views_disagree"
    assert doubt.message.startswith("From view 4 on the camera is ")
    (seen,) = re.findall(rf"(\d+) mm further {side}", doubt.message)
    assert float(seen) == pytest.approx(1e3 * metres, abs=3.0)


def test_an_offset_that_cancels_at_the_table_is_said() -> None:
    """Late stamps on a round shift the camera to the left and turn it to the right."""
    turn = -np.radians(1.9)
    result = _with_legs(Pose2(0.0, 0.048, turn))
    (warning,) = result.warnings
    assert warning.code == "crosscheck.mounting"
    assert "clocks" in warning.message
    assert not result.is_found
    assert result.mounting is not None


@pytest.mark.parametrize("seed", range(2))
def test_legs_raise_no_alarm_where_the_camera_is_right(seed: int) -> None:
    """Legs seen where the laser has them: nothing is said, and the estimate admits nought."""
    result = _with_legs(Pose2(), seed=seed)
    assert result.at_table is not None and result.at_table_sigma is not None
    assert (np.abs(result.at_table) < 3 * result.at_table_sigma).all()
    assert not result.is_found and result.excess == 1.0


def test_leaning_legs_are_not_compared() -> None:
    """A leg that leans stands elsewhere at the laser's height than where the camera sees most."""
    assert _with_legs(Pose2(), leaning=0.02, stops=5).by_legs is None
    assert _with_legs(Pose2(), stops=5).by_legs is not None


def test_a_mended_outline_shows_no_offset() -> None:
    """What the camera saw, moved by the offset that was found, is where it should be."""
    table = box_table(1.2, 0.8, Pose2(0.3, -0.2, 0.4))
    outline, registration = observe(table, LAP, np.random.default_rng(0))
    registration = replace(registration, source="laser", systematic=0.008)
    outline = _displaced(outline, Pose2(0.012, 0.008, np.radians(0.8)))
    before = fit_surface(outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    cross = cross_check(outline, before, registration, config=CrossCheckConfig(), sensors=SENSORS)
    assert cross.is_found
    mended = corrected(outline, cross)
    after = fit_surface(mended, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    again = cross_check(mended, after, registration, config=CrossCheckConfig(), sensors=SENSORS)
    assert not again.is_found
    assert cross.at_table is not None
    assert again.at_table is not None
    assert np.linalg.norm(again.at_table) < 0.2 * np.linalg.norm(cross.at_table)
    assert abs(after.pose.yaw - 0.4) < np.radians(0.3)


def test_legs_admit_what_was_found_of_the_camera() -> None:
    """A camera that may be turned leaves a leg 0.7 m out by millimetres, and so does the top."""
    table = box_table(1.2, 0.8, Pose2())
    outline, registration = observe(table, LAP, np.random.default_rng(0))
    surface = fit_surface(outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    size = {"diameter": FittedFigure(0.05, 0.001)}
    leg = Leg("circle", 0.6, 0.3, 0.0, "measured", 0.0005, size, np.zeros((0, 2)), 8)
    posted = replace(leg, seen_by="depth")
    legs = Legs((leg, posted), (), np.zeros((0, 2)), ())
    offset = np.array([0.0, 0.0, np.radians(0.3)])
    cross = CrossCheck(offset, np.eye(3) * 1e-6, np.zeros(2), np.full(2, 0.001), 0.0, 9, 8, ())
    wide, same = admitted_legs(legs, cross, surface, registration).legs
    turned = np.radians(0.3) * np.hypot(0.6, 0.3) / np.sqrt(2)
    top = surface.relative_covariance
    placed = np.sqrt(0.5 * (np.trace(top[:2, :2]) + top[2, 2] * (0.6**2 + 0.3**2)))
    assert 0.0003 < placed < 0.003
    expected = np.sqrt(0.0005**2 + turned**2 + placed**2)
    assert wide.position_sigma == pytest.approx(expected, rel=0.02)
    # The camera saw both the top and this one.
    assert same.position_sigma == 0.0005
