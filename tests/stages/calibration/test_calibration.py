"""The floor gives the camera's tilt and depth scale away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from tablemap.config import CalibrationConfig, SensorsConfig
from tablemap.geometry import Floats, Pose2
from tablemap.stages.calibration import Calibration, SeenTop, calibrate, flatten
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.rounding import REFERENCE_M, Rounding
from tests.making.casting import Box
from tests.making.round_trips import CAMERA, mounting, round_trip, table, tilted

CONFIG = CalibrationConfig()
SENSORS = SensorsConfig()


def height_sigma(result: Calibration, height: float) -> float:
    """Metres that the camera leaves open of a top's height above the floor."""
    return float(np.sqrt(result.top_belief(height).covariance[0, 0]))


def test_tilt_and_scale_come_out_within_targets() -> None:
    """A pitch, a roll and a scale error are found to 0.03 degrees and 1 permil."""
    true = tilted(mounting(), roll=np.deg2rad(0.3), pitch=np.deg2rad(-0.5))
    snapshots = round_trip(
        table(1.0, 0.5, 1.2, 0.8, 0.74, 0.3),
        (1.0, 0.5),
        mount=true,
        recorded_mount=mounting(),
        depth_scale=1.004,
    )
    result = calibrate(snapshots, config=CONFIG, sensors=SENSORS)
    assert np.rad2deg(result.roll) == pytest.approx(0.3, abs=0.03)
    assert np.rad2deg(result.pitch) == pytest.approx(-0.5, abs=0.03)
    assert result.depth_scale == pytest.approx(1 / 1.004, abs=0.001)
    assert result.floor_rms_after < result.floor_rms_before
    points = result.snapshots[0].points_in_base()
    floor = np.abs(points[..., 2]) < 0.02
    assert np.median(points[floor][:, 2]) == pytest.approx(0.0, abs=0.001)
    assert not result.warnings


def panning(*, errs_with_the_head: bool) -> tuple[Snapshot, ...]:
    """Views to three sides from two places; either the head's pitch is off or the base leans."""
    views = []
    for index, pan in enumerate(np.deg2rad([-50.0, 0.0, 50.0] * 2)):
        turn = Pose2(0.0, 0.0, float(pan)).lifted()
        if errs_with_the_head:
            true = turn @ tilted(mounting(), roll=0.0, pitch=np.deg2rad(0.4))
        else:
            true = tilted(turn @ mounting(), roll=0.0, pitch=np.deg2rad(0.4))
        (view,) = round_trip(
            [], (0.0, 0.0), views=1, mount=true, recorded_mount=turn @ mounting(), seed=index
        )
        views.append(replace(view, index=index))
    return tuple(views)


@pytest.mark.parametrize("errs_with_the_head", [True, False])
def test_a_pitch_turns_with_the_head_or_stays_with_the_base(errs_with_the_head: bool) -> None:
    """Which of the two is off is told by the floor to all sides, and every view's floor is flat."""
    result = calibrate(
        panning(errs_with_the_head=errs_with_the_head), config=CONFIG, sensors=SENSORS
    )
    assert np.rad2deg([result.roll, result.pitch]) == pytest.approx([0.0, 0.4], abs=0.03)
    assert result.depth_scale == pytest.approx(1.0, abs=0.002)
    for snapshot in result.snapshots:
        points = snapshot.points_in_base().reshape(-1, 3)
        points = points[np.isfinite(points[:, 2])]
        for side in (points[:, 1] < 0, points[:, 1] > 0):
            if side.sum() > 1000:
                assert np.median(points[side, 2]) == pytest.approx(0.0, abs=0.001)


def test_what_the_floor_cannot_tell_stays_in_the_covariance() -> None:
    """From one camera height, scale and height stay as open as the priors leave them."""
    result = calibrate(round_trip([], (0.0, 0.0)), config=CONFIG, sensors=SENSORS)
    scale_sigma = np.sqrt(result.covariance[2, 2])
    assert scale_sigma == pytest.approx(SENSORS.camera_height_sigma / 1.1, rel=0.15)
    assert height_sigma(result, 0.0) < 0.001
    assert height_sigma(result, 0.74) == pytest.approx(0.74 * scale_sigma, rel=0.15)


def test_a_top_that_reads_further_than_the_floor_is_lower_and_farther_away() -> None:
    """Its own error of depth adds to height and distance, which err together."""
    result = calibrate(round_trip([], (0.0, 0.0)), config=CONFIG, sensors=SENSORS)
    camera = result.snapshots[0].base_from_camera
    alike, apart = result.top_belief(0.74), result.top_belief(0.74, surface_depth_sigma=0.002)
    lower, drop = 0.002 * camera[2, 2], camera[2, 3] - 0.74
    more = (apart.covariance - alike.covariance)[:2, :2]
    np.testing.assert_allclose(
        more, lower**2 * np.array([[1.0, -1 / drop], [-1 / drop, drop**-2]]), rtol=0.01
    )


def leaning(leans: Floats) -> tuple[Snapshot, ...]:
    """Views of a table from bases with these rolls and pitches (n, 2), about their wheels."""
    views = []
    for index, (roll, pitch) in enumerate(leans):
        true = tilted(mounting(), roll=roll, pitch=pitch)
        # The base turns as a whole: the camera's place moves with it.
        true[:3, 3] = tilted(np.eye(4), roll=roll, pitch=pitch)[:3, :3] @ mounting()[:3, 3]
        (view,) = round_trip(
            table(0.0, 0.0, 1.2, 0.8, 0.74, 0.3),
            (0.0, 0.0),
            views=1,
            mount=true,
            recorded_mount=mounting(),
            seed=index,
        )
        views.append(replace(view, index=index))
    return tuple(views)


def test_a_base_that_leans_moves_its_camera() -> None:
    """A roll of .15 degrees is a lean, 3 mm at the camera; half of a pitch may be the head's."""
    leans = np.deg2rad([[0.15, 0], [-0.15, 0], [0, 0.15], [0, -0.15], [0, 0], [0, 0]])
    result = calibrate(leaning(leans), config=CONFIG, sensors=SENSORS)
    moved = np.stack([s.base_from_camera[:2, 3] for s in result.snapshots])
    rolled = -1.1 * leans[:, 0]
    pitched = 1.1 * leans[:, 1]
    np.testing.assert_allclose(moved[:, 1] - moved[:, 1].mean(), rolled, atol=0.0006)
    np.testing.assert_allclose(moved[:, 0] - moved[:, 0].mean(), 0.5 * pitched, atol=0.0006)
    belief = result.top_belief(0.74)
    assert belief.lean == pytest.approx((1.1, 0.55), rel=0.01)
    assert belief.view_shift == pytest.approx(0.55 * np.deg2rad(0.15 * np.sqrt(2 / 6)), rel=0.4)
    without = calibrate(
        leaning(leans), config=CONFIG, sensors=structs.replace(SENSORS, base_lean_share=0.0)
    )
    ahead = np.stack([s.base_from_camera[0, 3] for s in without.snapshots])
    np.testing.assert_allclose(ahead, 0.0, atol=1e-9)


def test_a_camera_held_by_hand_is_not_believed_its_height() -> None:
    """Images that roll from view to view tell a hand: 2 cm of height are no depth scale then."""
    mounts = [tilted(mounting(), roll=np.deg2rad(4.0 * (i % 3)), pitch=0.0) for i in range(6)]
    views = []
    for index, mount in enumerate(mounts):
        low = mount.copy()
        low[2, 3] -= 0.02
        view = round_trip([], (0.0, 0.0), views=1, mount=mount, recorded_mount=low, seed=index)[0]
        views.append(replace(view, index=index))
    held = calibrate(tuple(views), config=CONFIG, sensors=SENSORS)
    firm = calibrate(
        tuple(views),
        config=structs.replace(CONFIG, held_roll_deg=90.0),
        sensors=SENSORS,
    )
    assert held.height_correction > 2 * firm.height_correction
    assert abs(held.depth_scale - 1) < 0.7 * abs(firm.depth_scale - 1)
    assert held.covariance[2, 2] > firm.covariance[2, 2]
    assert held.top_belief(0.74).lean == (0.0, 0.0)


def test_a_low_shelf_does_not_pass_for_the_floor() -> None:
    """A platform of 6 cm that fills much of the view leaves the camera where it is."""
    platform = [Box(0.0, 0.0, 1.6, 1.6, 0.0, 0.06)]
    result = calibrate(round_trip(platform, (0.0, 0.0)), config=CONFIG, sensors=SENSORS)
    assert np.rad2deg(abs(result.pitch)) < 0.1
    assert result.depth_scale == pytest.approx(1.0, abs=0.002)


def test_without_floor_the_recorded_camera_stays() -> None:
    """Where no floor is seen the priors stay, and a warning says so."""
    plate = [Box(0.0, 0.0, 9.0, 9.0, 0.3, 0.4)]
    result = calibrate(round_trip(plate, (0.0, 0.0), views=2), config=CONFIG, sensors=SENSORS)
    assert [w.code for w in result.warnings] == ["calibration.no_floor"]
    assert (result.roll, result.pitch, result.depth_scale) == (0.0, 0.0, 1.0)
    assert np.sqrt(result.covariance[2, 2]) == pytest.approx(SENSORS.depth_scale_sigma)


def pit(heights: list[list[float]]) -> list[Box]:
    """Return a wide platform with a pit, in which things of these heights cover the floor."""
    size, side = 0.52, 10.0
    far = (size + side) / 2
    boxes = [Box(1.0 + s * far, 0.5, side, 2 * side + size, 0.0, 0.3) for s in (-1, 1)]
    boxes += [Box(1.0, 0.5 + s * far, size, side, 0.0, 0.3) for s in (-1, 1)]
    wide = size / len(heights)
    for i, row in enumerate(heights):
        for j, height in enumerate(row):
            place = np.array([1.0, 0.5]) + wide * (np.array([i, j]) + 0.5) - size / 2
            boxes += [Box(*place, wide, wide, 0.0, height)] if height else []
    return boxes


THINGS = [[0.0, 0.1, 0.05], [0.05, 0.02, 0.1], [0.1, 0.05, 0.0]]


@pytest.mark.parametrize("heights", [THINGS, [[0.0]]])
def test_a_few_things_on_a_hidden_floor_are_no_floor(heights: list[list[float]]) -> None:
    """What little is seen of a floor corrects the camera if it is flat, and else nothing."""
    snapshots = round_trip(pit(heights), (1.0, 0.5), views=8, radius=1.4, mount=mounting(2.0, 52.0))
    result = calibrate(snapshots, config=CONFIG, sensors=SENSORS)
    assert result.is_cluttered == (heights is THINGS)
    notes = [w.message for w in result.warnings if w.code == "calibration.no_floor"]
    assert len(notes) == (heights is THINGS)
    assert all("little and not flat" in note for note in notes)
    assert (result.pitch == 0.0) == (heights is THINGS)
    tops = {s.index: np.abs(s.points_in_base()[..., 2] - 0.3) < 0.01 for s in result.snapshots}
    again = flatten(result, SeenTop(0.3, tops), config=CONFIG)
    assert again.sees_top
    assert (again.floor_pixels == 0) == (heights is THINGS)


def test_a_top_that_hides_most_of_the_floor_is_no_floor() -> None:
    """The little floor that is seen stays the zero of heights; things on the top are above both."""
    things = Box(2.3, 0.5, 1.2, 2.0, 0.3, 0.6)
    snapshots = round_trip(
        [*pit([[0.0]]), things], (1.0, 0.5), views=8, radius=1.4, mount=mounting(2.0, 52.0)
    )
    result = calibrate(snapshots, config=CONFIG, sensors=SENSORS)
    assert result.floor_z == 0.0
    assert abs(result.height_correction) < 0.003


def raised(level: float, base_z: float) -> tuple[Snapshot, ...]:
    """Views of a table whose floor lies at a level of the fixed frame, the base's origin at z."""
    mount = mounting()
    mount[2, 3] += level
    views = round_trip(
        table(0.0, 0.0, 1.2, 0.8, 0.74, 0.3), (0.0, 0.0), recorded_mount=mount, mount=mounting()
    )
    return tuple(replace(view, base_z=base_z) for view in views)


def test_a_floor_at_the_bases_origin_is_the_floor_wherever_the_map_begins() -> None:
    """A map 0.5 m lower than the floor changes nothing but ``floor_z``, and is said."""
    result = calibrate(raised(0.5, 0.5), config=CONFIG, sensors=SENSORS)
    usual = calibrate(raised(0.0, 0.0), config=CONFIG, sensors=SENSORS)
    assert result.floor_z == 0.5
    assert usual.floor_z == 0.0
    assert [w.code for w in result.warnings] == ["calibration.floor_level"]
    assert result.depth_scale == pytest.approx(usual.depth_scale, abs=1e-6)
    assert height_sigma(result, 0.74) == pytest.approx(height_sigma(usual, 0.74), rel=1e-6)
    points = result.snapshots[0].points_in_base()
    assert np.median(points[np.abs(points[..., 2]) < 0.02][:, 2]) == pytest.approx(0.0, abs=0.001)


def test_a_map_that_begins_at_the_camera_leaves_the_cameras_height_open() -> None:
    """The floor is found 1.1 m lower to 5 mm; how high the camera is stays open, as sigma says."""
    result = calibrate(raised(-1.1, 0.0), config=CONFIG, sensors=SENSORS)
    assert result.floor_z == pytest.approx(-1.1, abs=0.005)
    assert np.sqrt(result.covariance[2, 2]) == pytest.approx(SENSORS.depth_scale_sigma, rel=0.1)
    assert abs(result.depth_scale - 1.0) < np.sqrt(result.covariance[2, 2])


@pytest.mark.parametrize("level", [0.06, -0.04, -0.2])
def test_a_base_that_does_not_stand_on_the_floor_is_no_wrong_scale(level: float) -> None:
    """Centimetres between floor and base are the floor's level, not five percent of all depth."""
    result = calibrate(raised(level, 0.0), config=CONFIG, sensors=SENSORS)
    assert result.floor_z == pytest.approx(level, abs=0.005)
    assert result.depth_scale == pytest.approx(1.0, abs=0.01)
    assert np.sqrt(result.covariance[2, 2]) > abs(result.depth_scale - 1)


def test_no_snapshots_and_empty_images_are_no_floor() -> None:
    """Nothing to see is a warning, not an exception."""
    assert calibrate((), config=CONFIG, sensors=SENSORS).warnings[0].code == "calibration.no_floor"
    snapshots = round_trip([Box(0, 0, 30, 30, 0.0, 1.0)], (0.0, 0.0), views=1)
    snapshots[0].depth[:] = np.nan
    assert (
        calibrate(snapshots, config=CONFIG, sensors=SENSORS).warnings[0].code
        == "calibration.no_floor"
    )


def test_an_implausible_camera_is_left_as_recorded_and_doubted() -> None:
    """What cannot be true is not applied: it is named, and widens what is believed."""
    true = tilted(mounting(), roll=0.0, pitch=np.deg2rad(3.0))
    result = calibrate(
        round_trip([], (0.0, 0.0), mount=true, recorded_mount=mounting()),
        config=CONFIG,
        sensors=SENSORS,
    )
    (doubt,) = [w for w in result.warnings if w.code == "accuracy.calibration"]
    assert "pitch of +2.89 degrees" in doubt.message
    assert (result.roll, result.pitch, result.depth_scale) == (0.0, 0.0, 1.0)
    usual = calibrate(round_trip([], (0.0, 0.0)), config=CONFIG, sensors=SENSORS)
    assert np.trace(result.covariance) > 4 * np.trace(usual.covariance)


def test_a_scale_of_five_percent_is_no_level_in_silence() -> None:
    """A floor that lies five centimetres under the base is a doubt, and says what may be wrong."""
    views = round_trip([], (0.0, 0.0), depth_scale=1.05)
    result = calibrate(views, config=CONFIG, sensors=SENSORS)
    assert "accuracy.floor_level" in [w.code for w in result.warnings]


def bent(snapshots: tuple[Snapshot, ...], corner: float) -> tuple[Snapshot, ...]:
    """The same views by a camera whose depth bends: as a share, in the corners at 2 m."""
    columns, rows = np.meshgrid(np.linspace(-1, 1, CAMERA.width), np.linspace(-1, 1, CAMERA.height))
    bowl = corner * (columns**2 + rows**2) / 2
    return tuple(
        replace(s, depth=(s.depth * (1 + bowl * s.depth / 2.0)).astype(np.float32))
        for s in snapshots
    )


def test_a_depth_image_that_bends_is_flattened_by_floor_and_top() -> None:
    """The top's height is right to 2 mm, and the pitch is not bent to make the floor flat."""
    flat = round_trip(table(1.0, 0.5, 1.2, 0.8, 0.74, 0.3), (1.0, 0.5))
    rough = calibrate(bent(flat, 0.015), config=CONFIG, sensors=SENSORS)
    masks = {s.index: np.abs(s.points_in_base()[..., 2] - 0.74) < 0.004 for s in flat}
    result = flatten(rough, SeenTop(0.75, masks), config=CONFIG)
    assert result.adjustment.common.top == pytest.approx(0.74, abs=0.002)
    assert result.adjustment.sigma("top") < 0.004
    assert np.rad2deg(abs(result.pitch)) < 0.2
    assert result.adjustment.size > 0.5
    assert result.floor is not None
    assert result.top is not None
    for shown in (result.floor, result.top):
        assert np.nanmax(np.abs(shown.after)) < 0.4 * np.nanmax(np.abs(shown.before))
    for before, after in zip(flat, result.snapshots, strict=True):
        seen = np.isfinite(before.depth)
        error = np.abs(after.depth[seen] / before.depth[seen] - 1)
        assert np.median(error) < 0.004


def test_a_camera_that_does_not_bend_is_not_flattened() -> None:
    """The size of the field is learnt: a flat image is left flat to half a permil."""
    flat = round_trip(table(1.0, 0.5, 1.2, 0.8, 0.74, 0.3), (1.0, 0.5))
    result = calibrate(flat, config=CONFIG, sensors=SENSORS)
    assert result.adjustment.size < 0.2
    factor = result.field.multiplier(CAMERA, flat[0].depth)
    assert np.nanmax(np.abs(factor - np.nanmedian(factor))) < 0.0005


def test_coarse_steps_leave_the_scale_open() -> None:
    """Depth in 39 mm steps is calibrated, and the result says how little it knows."""
    result = calibrate(
        round_trip([], (0.0, 0.0), step=0.039),
        config=CONFIG,
        sensors=SENSORS,
        rounding=Rounding(0.039, power=0),
    )
    assert np.rad2deg(abs(result.pitch)) < 0.5
    assert result.adjustment.sigma("offset") > 0.003
    assert abs(result.depth_scale - 1.0) < 3 * np.sqrt(result.covariance[2, 2])


def stepped(
    snapshots: tuple[Snapshot, ...], rounding: Rounding, *, is_cut_off: bool
) -> tuple[Snapshot, ...]:
    """The same views by a camera whose depth, or disparity, comes in whole steps."""
    to_whole = np.floor if is_cut_off else np.round
    views = []
    for view in snapshots:
        if rounding.power == 0:
            depth = to_whole(view.depth / rounding.step) * rounding.step
        else:
            per_step = REFERENCE_M**2 / rounding.step
            depth = per_step / to_whole(per_step / view.depth)
        views.append(replace(view, depth=depth.astype(np.float32)))
    return tuple(views)


@pytest.mark.parametrize("is_cut_off", [True, False])
@pytest.mark.parametrize(
    "rounding", [Rounding(0.02, 0), Rounding(0.04, 0), Rounding(0.035, 2), Rounding(0.07, 2)]
)
@pytest.mark.parametrize("bend", [0.0, 0.015])
def test_whether_coarse_steps_were_rounded_is_fitted(
    rounding: Rounding, is_cut_off: bool, bend: float
) -> None:
    """A top's height is right to 6 mm and 2 sigmas, whether its depth was rounded or cut off."""
    flat = round_trip(table(1.0, 0.5, 1.2, 0.8, 0.74, 0.3), (1.0, 0.5))
    views = stepped(bent(flat, bend), rounding, is_cut_off=is_cut_off)
    rough = calibrate(views, config=CONFIG, sensors=SENSORS, rounding=rounding)
    masks = {s.index: np.abs(s.points_in_base()[..., 2] - 0.74) < 0.004 for s in flat}
    result = flatten(rough, SeenTop(0.75, masks), config=CONFIG)
    error = result.adjustment.common.top - 0.74
    assert abs(error) < 0.006
    assert abs(error) < 2 * result.adjustment.sigma("top")
    assert not result.warnings
