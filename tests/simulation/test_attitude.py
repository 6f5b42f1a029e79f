"""The base leans and the head's encoders err, at each stop in another way, and TF says neither."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec import structs
from scipy.spatial.transform import Rotation

from tablemap.simulation import Scenario, Simulation, load_scenario, simulate, write
from tablemap.simulation import laser as scanner
from tablemap.simulation.meshes import MeshPart, prism
from tablemap.simulation.scenario import Ground, Head
from tablemap.simulation.scene import Scene
from tests.making import simulated_log as log


def exact(**sections: object) -> Scenario:
    """The exact scenario, small and quick, with errors."""
    scenario = load_scenario("exact")
    camera = structs.replace(scenario.camera, width=160, height=120)
    return structs.replace(scenario, camera=camera, **sections)


def attitudes(simulated: Simulation, plain: Simulation) -> list[Rotation]:
    """How the camera is turned against another simulation's, in the base, at each stop."""
    found = []
    for second in simulated.drive.rests.mean(axis=1).tolist():
        yaw = float(simulated.drive.base(np.array([second]))[0, 2])
        true, stated = (
            Rotation.from_matrix(each.map_from_camera(second)[:3, :3])
            for each in (simulated, plain)
        )
        heading = Rotation.from_euler("z", yaw)
        found.append(heading.inv() * true * stated.inv() * heading)
    return found


def test_encoder_errors_turn_the_camera_anew_at_each_rest() -> None:
    """Pan about the vertical, tilt about the level axis across; the spread is the stated one."""
    head = Head(pan_sigma_deg=0.1, tilt_sigma_deg=0.2)
    turns = []
    for seed in range(12):
        plain = simulate(exact(), seed=seed)
        turns += attitudes(simulate(exact(head=head), seed=seed), plain)
    vectors = np.rad2deg([turn.as_rotvec() for turn in turns])
    assert np.abs(vectors[:, 0]).max() < 1e-3
    assert vectors[:, 1].std() == pytest.approx(0.2, rel=0.2)
    assert vectors[:, 2].std() == pytest.approx(0.1, rel=0.2)
    assert len(np.unique(vectors[:8, 1].round(6))) == 8


def test_a_leaning_base_leans_about_its_foot() -> None:
    """Camera and base lean together; a degree moves the camera by its height times as much."""
    scenario = exact(ground=Ground(lean_sigma_deg=1.0))
    simulated, plain = simulate(scenario, seed=1), simulate(exact(), seed=1)
    for turn, lean in zip(attitudes(simulated, plain), simulated.attitude.lean, strict=True):
        assert turn.as_rotvec()[:2] == pytest.approx(lean, abs=2e-3)
    second = float(simulated.drive.rests[0].mean())
    moved = simulated.map_from_camera(second)[:3, 3] - plain.map_from_camera(second)[:3, 3]
    tall = scenario.robot.camera_height
    assert np.hypot(*moved[:2]) == pytest.approx(
        tall * np.hypot(*simulated.attitude.lean[0]), rel=0.02
    )


def test_the_laser_leans_with_the_base() -> None:
    """A beam ahead of a base that pitches down by a degree meets the floor ten metres ahead."""
    scenario = exact(ground=Ground(lean_sigma_deg=1.0))
    simulated = simulate(scenario, seed=1)
    simulated.attitude.lean[:] = 0.0, np.deg2rad(1.0)
    place = simulated.drive.base(np.array([0.0]))[0, :2]
    corners = place + 30.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    floor = Scene([MeshPart(prism(corners, -0.1, 0.0), (0.5, 0.5, 0.5))])
    second = simulated.drive.stops[0].mean(keepdims=True)
    errors = scanner.LaserErrors(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    ranges = scanner.scan(
        floor,
        (),
        simulated.drive,
        simulated.attitude,
        second,
        laser=scenario.laser,
        errors=errors,
        rng=np.random.default_rng(0),
    )[0]
    height, ahead = scanner.MOUNT[2], scanner.MOUNT[0]
    pitch = np.tan(np.deg2rad(1.0))
    assert ranges[360] == pytest.approx(height / pitch - ahead, rel=0.01)


def test_frames_are_published_without_either(tmp_path: Path) -> None:
    """TF is what the robot believes: the same bytes with the errors and without."""
    sections = {"head": Head(pan_sigma_deg=0.1, tilt_sigma_deg=0.1)}
    for name, each in (
        ("plain", {}),
        ("errors", {**sections, "ground": Ground(lean_sigma_deg=0.2)}),
    ):
        write(simulate(exact(**each), seed=0), tmp_path / f"{name}.mcap")
    plain, errors = (log.read(tmp_path / f"{name}.mcap") for name in ("plain", "errors"))
    frames = [log.transforms(each)["head_rgbd_sensor_rgb_frame"] for each in (plain, errors)]
    assert frames[0].keys() == frames[1].keys()
    assert all((frames[0][stamp] == frames[1][stamp]).all() for stamp in frames[0])
    (depth,) = (topic for topic in plain if topic.endswith("compressedDepth"))
    images = (log.depth_millimetres(each[depth][0][1]) for each in (plain, errors))
    assert not np.array_equal(*images)
