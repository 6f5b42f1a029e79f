"""Simulated recordings: repeatable, readable by others, and true to the truth beside them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from msgspec import structs

from tablemap.errors import ConfigError
from tablemap.geometry import Pose2, transform
from tablemap.simulation import (
    Scenario,
    Simulation,
    load_scenario,
    scenario_names,
    simulate,
    suite,
    write,
)
from tablemap.simulation.laser import MOUNT
from tablemap.simulation.scene import Scene
from tests.making import simulated_log as log

HEAD = "/hsrb/head_rgbd_sensor"
DEPTH = f"{HEAD}/depth_registered/image_rect_raw/compressedDepth"


def small(name: str, **robot: object) -> Scenario:
    """A scenario with a small camera, few stops and few scans, so that it is simulated quickly."""
    scenario = load_scenario(name)
    few = {"stops": 3, "standing_scan_rate": 2.0, "moving_scan_rate": 0.5}
    size: dict[str, object] = {"width": 160, "height": 120}
    stated = scenario.camera.intrinsics
    if stated:
        across, down = 160 / scenario.camera.width, 120 / scenario.camera.height
        scales = (across, down, across, down)
        size["intrinsics"] = tuple(k * s for k, s in zip(stated, scales, strict=True))
    camera = structs.replace(scenario.camera, **size)
    return structs.replace(
        scenario, camera=camera, robot=structs.replace(scenario.robot, **{**few, **robot})
    )


def truth_of(path: Path) -> dict[str, Any]:
    """The truth file beside a recording."""
    text = path.with_name(f"{path.stem}.truth.json").read_text()
    return dict(json.loads(text))


def test_same_seed_gives_same_bytes(tmp_path: Path) -> None:
    """A scenario and a seed decide every byte of the recording and of its truth."""
    first, second, other = (tmp_path / f"{name}.mcap" for name in ("a", "b", "c"))
    write(simulate(small("people"), seed=5), first)
    write(simulate(small("people"), seed=5), second)
    write(simulate(small("people"), seed=6), other)
    assert first.read_bytes() == second.read_bytes()
    assert truth_of(first) == truth_of(second)
    assert first.read_bytes() != other.read_bytes()


def test_writing_twice_gives_same_bytes(tmp_path: Path) -> None:
    """A simulation is not used up by writing it."""
    simulation = simulate(small("circle", stops=2), seed=1)
    write(simulation, tmp_path / "a.mcap")
    write(simulation, tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_noise_free_depth_lies_on_the_truth(exact_recording: Path) -> None:
    """Unprojected by the recorded calibration and frames, top and floor are within 1 mm."""
    truth = truth_of(exact_recording)
    simulation = simulate(load_scenario("exact"), seed=3)
    messages = log.read(exact_recording)
    edges = log.transforms(messages)
    infos = {
        log.stamp_ns(info): info for _, info in messages[f"{HEAD}/depth_registered/camera_info"]
    }
    outline = shapely.Polygon(truth["surface"]["outline"])
    height = truth["surface"]["height"]
    bases = {each["stamp_ns"]: each["map_from_base"] for each in truth["snapshots"]}
    assert len(messages[DEPTH]) == len(bases) == 16
    for _, image in messages[DEPTH][::5]:
        stamp = log.stamp_ns(image)
        depth = log.depth_millimetres(image) / 1000
        k = infos[stamp].K.reshape(3, 3)
        v, u = np.mgrid[0 : depth.shape[0], 0 : depth.shape[1]]
        rays = np.dstack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(depth)])
        camera = log.nearest(edges["head_rgbd_sensor_rgb_frame"], stamp)
        map_from_base = Pose2(**bases[stamp]).lifted()
        points = transform(map_from_base @ camera, rays * depth[..., None])[depth > 0]
        inside = shapely.contains_xy(outline.buffer(-2e-3), points[:, :2])
        on_top = inside & (np.abs(points[:, 2] - height) < 0.01)
        assert on_top.sum() > 20_000
        assert np.abs(points[on_top, 2] - height).max() < 1e-3
        above = np.abs(points[:, 2] - height) < 1e-3
        reach = shapely.distance(outline, shapely.points(points[above, :2]))
        reach = reach[reach < 0.05]  # what else is as high stands further away
        # A pixel on the upper end of the side face, rounded to a millimetre, lies just outside.
        assert np.percentile(reach, 99.9) < 1e-3
        # The floor beside the path, clear of the feet of legs, walls and cupboards.
        path = shapely.LineString(simulation.world.path).buffer(0.2)
        floor = points[(points[:, 2] < 0.01) & shapely.contains_xy(path, points[:, :2])]
        assert len(floor) > 500
        assert np.abs(floor[:, 2]).max() < 1e-3


def test_noise_free_top_reaches_the_outline() -> None:
    """The outermost points seen of the top, all views together, lie on the truth's sides."""
    simulation = simulate(load_scenario("exact"), seed=3)
    scene = Scene(simulation.parts(moved=False))
    outline = simulation.world.top.outline
    sides = np.roll(outline, -1, axis=0) - outline
    outward = np.column_stack([sides[:, 1], -sides[:, 0]])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    reach = np.full(len(sides), -1.0)
    for second in simulation.image_seconds[::4]:
        pose = simulation.map_from_camera(float(second))
        camera = simulation.camera
        depth = (
            camera.depth(camera.view(scene, None, pose), np.random.default_rng(0)).ravel() / 1000
        )
        points = transform(pose, camera.directions(camera.pixels) * depth[:, None])
        top = points[(depth > 0) & (np.abs(points[:, 2] - simulation.world.top.height) < 1e-3)]
        local = simulation.world.map_from_table.inverse().apply(top[:, :2])
        ahead = np.einsum("nij,ij->ni", local[:, None, :] - outline, outward)
        ahead = ahead[ahead.max(axis=1) < 0.05]  # what else is as high stands further away
        reach = np.maximum(reach, np.percentile(ahead, 99.99, axis=0))
    assert np.abs(reach).max() < 1.5e-3


def test_noise_free_frames_are_the_truth(exact_recording: Path) -> None:
    """Without wheel and localisation errors the recorded chain of frames is the true pose."""
    truth = truth_of(exact_recording)
    edges = log.transforms(log.read(exact_recording))
    for snapshot in truth["snapshots"]:
        stamp = snapshot["stamp_ns"]
        pose = Pose2.projected(
            log.nearest(edges["odom"], stamp) @ log.nearest(edges["base_footprint"], stamp)
        )
        true = Pose2(**snapshot["map_from_base"])
        error = true.inverse() @ pose
        assert np.hypot(error.x, error.y) < 1e-6
        assert abs(error.yaw) < 1e-6


def test_noise_free_scans_lie_on_the_legs(exact_recording: Path) -> None:
    """Scan points under the table, placed with the true pose, are on the legs' sides."""
    truth = truth_of(exact_recording)
    messages = log.read(exact_recording)
    edges = log.transforms(messages)
    legs = shapely.union_all(
        [
            shapely.Polygon(
                Pose2(leg["x"], leg["y"], leg["yaw"]).apply(
                    np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
                    * (leg["dimensions"]["length"] / 2, leg["dimensions"]["width"] / 2)
                )
            )
            for leg in truth["legs"]
        ]
    )
    top = shapely.Polygon(truth["surface"]["outline"])
    hits = 0
    for snapshot in truth["snapshots"][::4]:
        stamp = snapshot["stamp_ns"]
        scan = min(
            (each for _, each in messages["/hsrb/base_scan"]),
            key=lambda each: abs(log.stamp_ns(each) - stamp),
        )
        base = Pose2.projected(
            log.nearest(edges["odom"], stamp) @ log.nearest(edges["base_footprint"], stamp)
        )
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        seen = np.isfinite(scan.ranges)
        points = (scan.ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]))[seen]
        points = base.apply(points + MOUNT[:2])
        under = points[shapely.contains_xy(top, points)]
        hits += len(under)
        assert shapely.distance(legs.boundary, shapely.points(under)).max() < 1e-3
    assert hits > 50


@pytest.mark.parametrize("profile", ["ros1", "ros2"])
def test_both_profiles_are_readable(tmp_path: Path, profile: str) -> None:
    """Each profile has its topics, decodes by its own schemas, and is logged in time order."""
    path = tmp_path / "recording.mcap"
    write(simulate(small("square", stops=2, depth_transport="raw"), seed=0), path, profile=profile)
    messages = log.read(path)
    prefix, scan = ("/hsrb", "/hsrb/base_scan") if profile == "ros1" else ("", "/scan")
    head = f"{prefix}/head_rgbd_sensor"
    assert set(messages) == {
        "/tf",
        "/tf_static",
        scan,
        f"{head}/depth_registered/image_rect_raw",
        f"{head}/depth_registered/camera_info",
        f"{head}/rgb/image_rect_color/compressed",
        f"{head}/rgb/camera_info",
    }
    times = sorted(time for topic in messages.values() for time, _ in topic)
    assert times[-1] - times[0] > 3e9
    depth = log.depth_millimetres(messages[f"{head}/depth_registered/image_rect_raw"][0][1])
    assert depth.shape == (120, 160)
    assert 0.3 < np.mean(depth > 0) < 1.0
    assert len(messages[scan]) > 5
    assert len(messages[scan][0][1].ranges) == 721


def test_the_head_looks_in_one_direction_after_another(tmp_path: Path) -> None:
    """TF has the head at rest while images are taken, and no faster than it can turn between."""
    pans = (40.0, 0.0, -30.0)
    path = tmp_path / "panning.mcap"
    scenario = small("square", stops=2, pan_deg=pans, pan_speed_deg=50.0, colour=True)
    simulation = simulate(scenario, seed=0)
    write(simulation, path)
    messages = log.read(path)
    heads = log.transforms(messages)["head_rgbd_sensor_rgb_frame"]
    stamps = np.array(sorted(heads))
    yaws = np.rad2deg([np.arctan2(heads[s][1, 2], heads[s][0, 2]) for s in stamps.tolist()])
    (depth,) = (topic for topic in messages if topic.endswith("compressedDepth"))
    taken = np.array([log.stamp_ns(image) for _, image in messages[depth]])
    assert len(taken) == 2 * len(pans) * scenario.robot.images_per_stop
    for reach in (-100_000_000, 0, 100_000_000):
        assert np.interp(taken + reach, stamps, yaws) == pytest.approx(
            np.tile(np.repeat(pans, scenario.robot.images_per_stop), 2), abs=1e-6
        )
    stands = np.diff(simulation.drive.stops, axis=1)[0, 0]
    within = (stamps - taken[0]) * 1e-9 < stands - scenario.robot.stop_seconds / 2
    speeds = np.abs(np.diff(yaws[within])) / np.diff(stamps[within]) * 1e9
    assert 40.0 < speeds.max() < 51.0
    (colour,) = (topic for topic in messages if topic.endswith("rgb/image_rect_color/compressed"))
    assert len(messages[colour]) == 2 * len(pans)
    for k in (0, 1):
        start, end = simulation.drive.stops[k]
        bases = simulation.drive.base(np.linspace(start, end, 20))
        assert np.ptp(bases, axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_nothing_unfinished_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording that could not be finished leaves no file behind."""

    def fail(*_: object, **__: object) -> bytes:
        raise OSError("no space left")

    monkeypatch.setattr("tablemap.simulation.recorder._encoded", fail)
    with pytest.raises(OSError, match="no space"):
        write(simulate(small("square", stops=1), seed=0), tmp_path / "cut.mcap")
    assert list(tmp_path.iterdir()) == []


def test_noise_is_that_of_the_sensor(tmp_path: Path) -> None:
    """Depth scatters by the published model, and its scale error is what was drawn."""
    simulation = simulate(load_scenario("rectangle_default"), seed=2)
    camera = simulation.camera
    second = float(simulation.image_seconds[0])
    view = camera.view(
        Scene(simulation.parts(moved=False)), None, simulation.map_from_camera(second)
    )
    rng = np.random.default_rng(0)
    images = np.stack([camera.depth(view, rng) for _ in range(12)]).reshape(12, -1) / 1000.0
    flat = np.setdiff1d(np.flatnonzero((images > 0).all(axis=0)), view.edges)
    flat = flat[(view.depth[flat] > 1.0) & (view.depth[flat] < 2.0) & (view.cosine[flat] > 0.5)]
    scale = np.mean(images[:, flat] / view.depth[flat])
    assert abs(scale - camera.errors.depth_scale) < 5e-4
    expected = 0.0012 + 0.0019 * (view.depth[flat] - 0.4) ** 2
    quantum = view.depth[flat] ** 2 * 0.125 / (camera.k[0, 0] * 0.075)
    expected = np.sqrt(expected**2 + quantum**2 / 12)
    assert np.mean(images[:, flat].std(axis=0, ddof=1) / expected) == pytest.approx(1.0, abs=0.15)


def test_localisation_spreads_as_stated() -> None:
    """Over many recordings the localised stops scatter by the scenario's figures."""
    scenario = load_scenario("rectangle_default")
    errors = []
    for seed in range(25):
        simulation = simulate(scenario, seed=seed)
        belief = simulation.belief
        middle = simulation.drive.stops.mean(axis=1)
        at = np.searchsorted(belief.seconds, middle)
        errors.append(belief.map_from_base[at] - simulation.drive.base(belief.seconds[at]))
    spread = np.concatenate(errors).std(axis=0)
    assert spread[:2] == pytest.approx([0.06, 0.06], rel=0.2)
    assert np.rad2deg(spread[2]) == pytest.approx(2.5, rel=0.2)


def test_wheels_drift_by_percents() -> None:
    """Over a lap the wheels lose some centimetres and a few degrees, and are never exact."""
    scenario = load_scenario("rectangle_default")
    lost = []
    for seed in range(10):
        simulation = simulate(scenario, seed=seed)
        belief = simulation.belief
        true = [Pose2.from_array(pose) for pose in simulation.drive.base(belief.seconds[[8, -8]])]
        odom = [Pose2.from_array(pose) for pose in belief.odom_from_base[[8, -8]]]
        error = (true[0].inverse() @ true[1]).inverse() @ (odom[0].inverse() @ odom[1])
        lost.append(np.hypot(error.x, error.y))
    assert 0.01 < np.median(lost) < 0.2
    assert min(lost) > 1e-3


def test_nominal_keeps_the_sizes() -> None:
    """Nominal sizes are those stated; else the seed varies them by up to a tenth."""
    scenario = load_scenario("rectangle_default")
    top = simulate(scenario, seed=4, nominal=True).world.top
    assert top.dimensions == {"length": 1.20, "width": 0.80}
    assert top.height == 0.755
    drawn = np.array(
        [list(simulate(scenario, seed=seed).world.top.dimensions.values()) for seed in range(20)]
    )
    factors = drawn / (1.20, 0.80)
    assert np.abs(factors - 1).max() <= 0.1
    assert np.ptp(factors) > 0.12


@pytest.fixture(scope="module", params=scenario_names())
def drawn(request: pytest.FixtureRequest) -> list[Simulation]:
    """Each scenario as three seeds draw it."""
    return [simulate(load_scenario(request.param), seed=seed) for seed in range(3)]


def test_truth_keeps_the_conventions(drawn: list[Simulation]) -> None:
    """Centroid, yaw range, order of sizes and sense of the outline are those of table.json."""
    for simulation in drawn:
        surface: Any = simulation.truth()["surface"]
        outline = shapely.Polygon(surface["outline"])
        pose, sizes = surface["pose"], surface["dimensions"]
        assert outline.is_valid
        assert outline.exterior.is_ccw
        assert np.hypot(outline.centroid.x - pose["x"], outline.centroid.y - pose["y"]) < 1e-6
        turn = {"square": np.pi / 2, "circle": 1e-12}.get(surface["shape"], np.pi)
        assert 0 <= pose["yaw"] < turn
        sizes = {"angle": np.pi / 2, **sizes}
        if surface["shape"] in ("rectangle", "parallelogram"):
            expected = sizes["length"] * sizes["width"] * np.sin(sizes["angle"])
        elif surface["shape"] == "stadium":
            radius = sizes["width"] / 2
            expected = (sizes["length"] - 2 * radius) * sizes["width"] + np.pi * radius**2
        elif surface["shape"] == "square":
            expected = sizes["side"] ** 2
        elif surface["shape"] == "circle":
            expected = np.pi * sizes["diameter"] ** 2 / 4
        elif surface["shape"] == "ellipse":
            expected = np.pi * sizes["major"] * sizes["minor"] / 4
        else:
            expected = outline.area
        if surface["shape"] != "polygon":
            expected -= (4 - np.pi) * (surface["corner_radius"] or 0.0) ** 2
        assert outline.area == pytest.approx(expected, rel=2e-3)
        if "length" in sizes:
            assert sizes["length"] >= sizes["width"]


def test_legs_stand_under_the_top(drawn: list[Simulation]) -> None:
    """Every leg is under the top, whole, and within the yaw range of its shape."""
    for simulation in drawn:
        truth: Any = simulation.truth()
        outline = shapely.Polygon(truth["surface"]["outline"]).buffer(1e-3)
        for leg in truth["legs"]:
            sizes = leg["dimensions"]
            radius = max(sizes.values()) / 2
            if leg["shape"] == "circle":
                footprint = shapely.Point(leg["x"], leg["y"]).buffer(radius)
                assert leg["yaw"] == 0.0
            else:
                corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
                corners = corners * (sizes["length"], sizes["width"])
                footprint = shapely.Polygon(Pose2(leg["x"], leg["y"], leg["yaw"]).apply(corners))
                assert 0 <= leg["yaw"] < np.pi
            assert outline.contains(footprint)


def test_robot_stays_clear(drawn: list[Simulation]) -> None:
    """The base, 21 cm in radius, never touches the table or what stands on the floor."""
    for simulation in drawn:
        seconds = np.arange(0, simulation.drive.duration, 0.1)
        bases = shapely.points(simulation.drive.base(seconds)[:, :2])
        tree = shapely.STRtree(bases)
        for part in simulation.parts(moved=False) + simulation.parts(moved=True):
            mesh = part.mesh
            if mesh.vertices[:, 2].max() < 0.01:
                continue
            footprint = shapely.MultiPoint(mesh.vertices[:, :2]).convex_hull
            assert len(tree.query(footprint, predicate="dwithin", distance=0.21)) == 0


QUICK = (
    "people",
    "glass",
    "moved_furniture",
    "distorted_lens",
    "cloth",
    "no_wheels",
    "no_laser",
    "bent_uneven",
    "stereo_small_table",
    "stereo_wide",
    "tof_wall",
)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)
        for name in scenario_names()
    ],
)
def test_every_scenario_is_recorded(name: str, tmp_path: Path) -> None:
    """Each scenario gives a recording whose images show something, few of them for speed."""
    scenario = small(name)
    if scenario.robot.continuous_rate:
        scenario = small(name, continuous_rate=0.4)
    path = tmp_path / f"{name}.mcap"
    write(simulate(scenario, seed=0), path)
    messages = log.read(path)
    truth = truth_of(path)
    images = ("compressedDepth", "image_rect_raw", "depth_registered/image")
    (depth,) = (topic for topic in messages if topic.endswith(images))
    stamps = [log.stamp_ns(image) for _, image in messages[depth]]
    assert stamps == [each["stamp_ns"] for each in truth["snapshots"]]
    filled = [np.mean(log.depth_steps(image) > 0) for _, image in messages[depth][::4]]
    assert min(filled) > 0.15
    assert ("/hsrb/base_scan" in messages) == scenario.robot.laser


@pytest.mark.slow
@pytest.mark.parametrize("name", suite("report"))
def test_report_recordings_are_small(name: str, tmp_path: Path) -> None:
    """A recording of the report's suite stays under ten megabytes at full resolution."""
    path = tmp_path / f"{name}.mcap"
    write(simulate(load_scenario(name), seed=1000), path)
    assert path.stat().st_size < 10_000_000


def test_unknown_scenario_is_refused(tmp_path: Path) -> None:
    """An unknown name, key or shape and a missing size each end in one clear sentence."""
    with pytest.raises(ConfigError, match="no scenario 'rectangel'"):
        load_scenario("rectangel")
    with pytest.raises(ConfigError, match="no suite named"):
        suite("easy")
    path = tmp_path / "odd.toml"
    path.write_text('description = ""\n[table]\nshape = "circle"\nheight = 0.5\nlenght = 1.0\n')
    with pytest.raises(ConfigError, match=r"table\.lenght"):
        load_scenario(path)
    path.write_text('description = ""\n[table]\nshape = "circle"\nheight = 0.5\n')
    with pytest.raises(ConfigError, match=r"needs table\.diameter"):
        simulate(load_scenario(path), seed=0)
    path.write_text('description = ""\n[table]\nshape = "blob"\nheight = 0.5\n')
    with pytest.raises(ConfigError, match=r"table\.shape: expected one of circle, .*'blob'"):
        load_scenario(path)
    path.write_text('description = ""\n[table]\nshape = "mesh"\nheight = 0.5\n')
    with pytest.raises(ConfigError, match=r"'mesh' cannot be simulated; there are circle,"):
        simulate(load_scenario(path), seed=0)
