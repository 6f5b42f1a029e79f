"""Each kind of depth camera errs in its own ways, and each way can be switched off."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from PIL import Image

from tablemap.geometry import Floats
from tablemap.recording import open_recording
from tablemap.simulation import Scenario, Simulation, load_scenario, simulate, suite, write
from tablemap.simulation.scene import Scene
from tablemap.simulation.time_of_flight import multipath_of
from tablemap.simulation.view import View
from tests.making import simulated_log as log


def scenario(name: str = "exact", **camera: object) -> Scenario:
    """A scenario whose camera has no errors but what is asked for."""
    loaded = load_scenario(name)
    none = {
        "noise": 0.0,
        "dropouts": False,
        "scale_sigma": 0.0,
        "pitch_sigma_deg": 0.0,
        "roll_sigma_deg": 0.0,
        "flying": 0.0,
        "multipath": 0.0,
        "fattening_px": 0.0,
        "holes": 0.0,
    }
    settings = structs.replace(loaded.camera, **{**none, "width": 320, "height": 240, **camera})
    return structs.replace(loaded, camera=settings)


def taken(simulated: Simulation, image: int = 0, count: int = 1) -> tuple[View, Floats]:
    """Return a view and (count, n) depths of it in metres, NaN where there are none."""
    camera, second = simulated.camera, float(simulated.image_seconds[image])
    pose = simulated.map_from_camera(second)
    view = camera.view(Scene(simulated.parts(moved=False)), None, pose)
    rng = np.random.default_rng(0)
    images = np.stack([camera.depth(view, rng).ravel() for _ in range(count)]).astype(float)
    if simulated.scenario.camera.encoding == "16UC1":
        images = np.where(images > 0, images / 1000, np.nan)
    return view, images


@pytest.mark.parametrize("principle", ["structured_light", "time_of_flight", "stereo"])
def test_without_errors_each_kind_reads_the_truth(principle: str) -> None:
    """To half a millimetre, everywhere."""
    view, (depth,) = taken(simulate(scenario(principle=principle), seed=1))
    seen = np.isfinite(view.depth)
    assert np.isfinite(depth[seen]).all()
    assert np.abs(depth - view.depth)[seen].max() < 6e-4


def test_time_of_flight_mixes_what_lies_in_one_pixel() -> None:
    """At edges depths lie between both surfaces; without that setting none does."""
    between = {}
    for flying in (0.0, 0.6):
        simulated = simulate(scenario(principle="time_of_flight", noise=1.0, flying=flying), seed=1)
        view, (depth,) = taken(simulated)
        image = view.depth.reshape(240, 320)
        low, high = (
            extreme(np.stack([np.roll(image, s, axis=(0, 1)) for s in shifts]), axis=0).ravel()
            for extreme in (np.min, np.max)
            for shifts in [[(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]]
        )
        gap = high - low > 0.3
        middle = (depth > low + 0.08) & (depth < high - 0.08) & gap
        between[flying] = middle.sum() / gap.sum()
    assert between[0.0] < 0.02
    assert 0.1 < between[0.6] < 0.5


def test_light_from_a_wall_makes_a_top_read_far() -> None:
    """By a centimetre or so at the wall, a millimetre away from it; off with its setting."""
    settings = {"principle": "time_of_flight", "width": 640, "height": 480, "multipath": 0.3}
    simulated = simulate(scenario("against_wall", **settings), seed=1)
    view, (depth,) = taken(simulated, image=6)
    further = 1000 * (depth - view.depth)
    top = (view.parts == 0) & (view.normals[:, 2] > 0.9)
    pose = view.map_from_camera
    points = pose[:3, 3] + view.depth[:, None] * (simulated.camera.rays @ pose[:3, :3].T)
    local = simulated.world.map_from_table.inverse().apply(points[:, :2])
    away = simulated.world.top.outline[:, 1].max() - local[:, 1]
    assert 5 < np.nanmedian(further[top & (away < 0.05)]) < 40
    assert np.abs(np.nanmedian(further[top & (away > 0.5)])) < 3
    off = simulate(scenario("against_wall", **{**settings, "multipath": 0.0}), seed=1)
    view, (depth,) = taken(off, image=6)
    assert np.nanmax(np.abs(depth - view.depth)) < 6e-4


def test_more_reflecting_walls_send_more_light() -> None:
    """The bounce is in proportion to the strength of the setting, as long as it is small."""
    further = []
    for multipath in (0.05, 0.1):
        settings = {"principle": "time_of_flight", "multipath": multipath}
        simulated = simulate(scenario("against_wall", **settings), seed=1)
        view, _ = taken(simulated, image=6)
        further.append(multipath_of(simulated.camera, view))
    assert np.nanpercentile(further[1], 90) == pytest.approx(
        2 * np.nanpercentile(further[0], 90), rel=0.1
    )


def test_time_of_flight_is_lit_in_a_cone() -> None:
    """The image's corners are dark; without the setting they are not."""
    settings = {"principle": "time_of_flight", "dropouts": True}
    lit = {}
    for lit_deg in (0.0, 30.0):
        simulated = simulate(scenario(lit_deg=lit_deg, **settings), seed=1)
        _, (depth,) = taken(simulated)
        corner = np.arctan(np.hypot(*simulated.camera.rays[:, :2].T)) > np.deg2rad(30.5)
        lit[lit_deg] = np.isfinite(depth)[corner].mean()
    assert lit[0.0] > 0.9
    assert lit[30.0] == 0.0


def test_noise_of_time_of_flight_is_millimetres() -> None:
    """A millimetre or two at the table's distance, on a surface that reflects well."""
    simulated = simulate(scenario(principle="time_of_flight", noise=1.0), seed=2)
    view, images = taken(simulated, count=12)
    flat = np.setdiff1d(np.flatnonzero(np.isfinite(images).all(axis=0)), view.edges)
    flat = flat[(view.depth[flat] > 0.9) & (view.depth[flat] < 1.5) & (view.cosine[flat] > 0.5)]
    assert 0.0008 < np.median(images[:, flat].std(axis=0, ddof=1)) < 0.0025


def test_noise_of_stereo_grows_with_the_distance_squared() -> None:
    """As a constant error of the disparity does, inversely with the baseline."""
    spreads = {}
    for baseline in (0.05, 0.1):
        simulated = simulate(scenario(principle="stereo", noise=1.0, baseline=baseline), seed=2)
        view, images = taken(simulated, count=12)
        flat = np.setdiff1d(np.arange(len(view.depth)), view.edges)
        for low, high in ((0.9, 1.1), (2.6, 3.2)):
            chosen = flat[(view.depth[flat] > low) & (view.depth[flat] < high)]
            spread = images[:, chosen].std(axis=0, ddof=1)
            spreads[baseline, low] = np.median(spread / view.depth[chosen] ** 2)
    for baseline in (0.05, 0.1):
        assert spreads[baseline, 2.6] == pytest.approx(spreads[baseline, 0.9], rel=0.15)
        stated = 0.08 / (simulated.camera.k[0, 0] * baseline)
        assert spreads[baseline, 0.9] == pytest.approx(stated, rel=0.25)


def test_stereo_fattens_what_is_in_front() -> None:
    """The top's outline grows by a pixel on all sides where the floor is behind it."""
    grown = {}
    for px in (0.0, 1.0):
        simulated = simulate(scenario(principle="stereo", fattening_px=px), seed=1)
        view, (depth,) = taken(simulated)
        jumped = (view.depth - depth).reshape(240, 320) > 0.1
        edges = np.zeros(jumped.shape, dtype=bool)
        image = view.depth.reshape(240, 320)
        edges[:, 1:] |= np.abs(np.diff(image, axis=1)) > 0.3
        edges[1:] |= np.abs(np.diff(image, axis=0)) > 0.3
        grown[px] = jumped.sum() / edges.sum()
    assert grown[0.0] == 0.0
    assert 0.7 < grown[1.0] < 1.5


@pytest.mark.parametrize(
    ("texture", "holes", "share"), [(0.5, 1.0, 0.5), (1.0, 1.0, 0.0), (0.5, 0.0, 0.0)]
)
def test_stereo_has_holes_where_texture_is_missing(
    texture: float, holes: float, share: float
) -> None:
    """In patches, as large a part of the top as it lacks texture; off with its setting."""
    plain = scenario(principle="stereo", dropouts=True, holes=holes)
    table = structs.replace(plain.table, texture=texture)
    view, images = taken(simulate(structs.replace(plain, table=table), seed=1), count=6)
    inner = np.setdiff1d(np.flatnonzero((view.parts == 0) & (view.cosine > 0.3)), view.edges)
    assert np.mean(np.isnan(images[:, inner])) == pytest.approx(share, abs=0.15 if share else 0.03)


def test_stereo_sees_nothing_at_the_left_end_of_its_image() -> None:
    """What the second camera has not in its image cannot be matched."""
    simulated = simulate(scenario(principle="stereo", dropouts=True), seed=1)
    view, (depth,) = taken(simulated)
    band = simulated.camera.k[0, 0] * 0.075 / view.depth
    outside = simulated.camera.pixels[:, 0] < band
    assert outside.sum() > 500
    assert np.isnan(depth[outside]).all()


def test_corners_read_nearer() -> None:
    """By one to two centimetres in the outermost pixels, and nowhere else."""
    view, (depth,) = taken(simulate(scenario(corner_nearer=0.02, width=640, height=480), seed=1))
    nearer = (view.depth - depth).reshape(480, 640)
    v, u = np.mgrid[0:480, 0:640]
    away = np.hypot(np.minimum(u, 639 - u), np.minimum(v, 479 - v))
    corners = nearer[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert ((corners > 0.0094) & (corners < 0.0206)).all()
    assert len(np.unique(corners.round(4))) == 4
    assert np.nanmax(np.abs(nearer[away > 20])) < 6e-4


def test_the_stated_intrinsics_are_the_camera_s(tmp_path: Path) -> None:
    """They are published as they are, and the camera looks through them."""
    k = (212.0, 213.0, 160.5, 119.0)
    simulated = simulate(scenario(intrinsics=k), seed=1)
    write(simulated, tmp_path / "a.mcap")
    messages = log.read(tmp_path / "a.mcap")
    (topic,) = (each for each in messages if each.endswith("depth_registered/camera_info"))
    info = messages[topic][0][1]
    assert info.K.reshape(3, 3)[[0, 1, 0, 1], [0, 1, 2, 2]].tolist() == list(k)
    corner = simulated.camera.directions(np.array([[0.0, 0.0]]))[0]
    assert corner == pytest.approx([-160.5 / 212.0, -119.0 / 213.0, 1.0])


@pytest.mark.parametrize("transport", ["raw", "compressed"])
def test_depth_in_metres_is_recorded(tmp_path: Path, transport: str) -> None:
    """As 32FC1 with NaN, or by its inverse; ours and others' readers get the same image."""
    stereo = scenario(principle="stereo", encoding="32FC1", dropouts=True)
    robot = structs.replace(stereo.robot, depth_transport=transport, stops=1)
    simulated = simulate(structs.replace(stereo, robot=robot), seed=1)
    write(simulated, tmp_path / "a.mcap")
    messages = log.read(tmp_path / "a.mcap")
    ends = "image" if transport == "raw" else "image/compressedDepth"
    (topic,) = (each for each in messages if each.endswith(f"depth_registered/{ends}"))
    metres = decoded(messages[topic][0][1])
    view, _ = taken(simulated)
    lost = np.isnan(metres.ravel())
    assert 0.005 < lost.mean() < 0.5
    step = view.depth**2 / 10_100 if transport == "compressed" else 1e-6
    right = np.abs(metres.ravel() - view.depth) <= step + 1e-6
    assert right[~lost & (view.depth < 9.9)].all()
    with open_recording(tmp_path / "a.mcap") as recording:
        ours = next(iter(recording.depth_frames()))
    assert np.nan_to_num(ours.depth) == pytest.approx(np.nan_to_num(metres), abs=1e-3)


def decoded(message: Any) -> Floats:
    """Decode a 32FC1 image, raw or compressed, to metres and NaN."""
    if not hasattr(message, "format"):
        assert message.encoding == "32FC1"
        return np.asarray(message.data.view("<f4").reshape(message.height, message.width), float)
    assert message.format == "32FC1; compressedDepth png"
    _, a, b = np.frombuffer(message.data[:12].tobytes(), dtype="<i4,<f4,<f4")[0]
    steps = np.asarray(Image.open(io.BytesIO(message.data[12:].tobytes()))).astype(float)
    return np.where(steps > 0, a / np.where(steps > 0, steps - b, 1.0), np.nan)


def test_real_sensors_are_of_every_kind_and_all_of_them_err() -> None:
    """Ten cameras and more, low and high, of three principles and small tables among them."""
    scenarios = [load_scenario(name) for name in suite("real_sensors")]
    assert len(scenarios) >= 10
    assert {each.camera.principle for each in scenarios} == {
        "structured_light",
        "stereo",
        "time_of_flight",
    }
    for each in scenarios:
        assert each.camera.bend_percent > 0
        assert min(each.head.pan_sigma_deg, each.head.tilt_sigma_deg) >= 0.1
        assert each.ground.lean_sigma_deg > 0
    heights = [each.robot.camera_height for each in scenarios]
    assert min(heights) < 0.9 < 1.5 < max(heights)
    areas = [simulate(each, seed=0, nominal=True).world.top.polygon.area for each in scenarios]
    assert sum(area < 0.35 for area in areas) >= 5
    assert len(set(suite("real_sensors")) & set(suite("hard"))) >= 4
    assert set(suite("real_sensors")) <= set(suite("all"))
    assert len(suite("all")) == len(set(suite("all")))


@pytest.mark.parametrize("principle", ["structured_light", "time_of_flight", "stereo"])
def test_single_pixels_are_lost_or_wrong_by_the_shares_asked_for(principle: str) -> None:
    """Lost ones are no neighbours of each other more often than by chance."""
    view, (depth,) = taken(simulate(scenario(principle=principle, salt=0.2, specks=0.05), seed=1))
    seen = np.isfinite(view.depth)
    lost = np.isnan(depth)[seen]
    assert lost.mean() == pytest.approx(0.2, abs=0.01)
    assert (lost[1:] & lost[:-1]).mean() == pytest.approx(0.04, abs=0.01)
    wrong = np.abs(depth - view.depth)[seen & np.isfinite(depth)] > 1e-3
    assert wrong.mean() == pytest.approx(0.05, abs=0.01)


def test_a_driver_that_smooths_makes_ramps_of_the_steps() -> None:
    """Three pixels' mean: next to a step lie thirds of it, elsewhere nothing changes."""
    simulated = simulate(scenario(smoothing_px=3), seed=1)
    view, (depth,) = taken(simulated)
    true, seen = view.depth.reshape(240, 320), depth.reshape(240, 320)
    step = true[1:-1, 2:] - true[1:-1, 1:-1]
    between = seen[1:-1, 1:-1] - true[1:-1, 1:-1]
    jump = np.abs(step) > 0.3
    beside = jump & np.isfinite(between)
    assert np.median(between[beside] / step[beside]) == pytest.approx(1 / 3, abs=0.1)
    assert np.nanmedian(np.abs(between)) < 1e-3
