"""What the stages cost on the demo, beside the ready-made way of doing the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from tablemap.baseline import method as report_method
from tablemap.config import Config
from tablemap.geometry import transform
from tablemap.pipeline import process
from tablemap.recording import Recording, open_recording
from tablemap.stages.calibration import calibrate
from tablemap.stages.segmentation import segment
from tablemap.stages.snapshots import Snapshot, take_snapshots

CONFIG = Config()


@pytest.fixture(scope="module")
def recording(demo_recording: Path) -> Iterator[Recording]:
    """The demo, opened once."""
    with open_recording(demo_recording) as opened:
        yield opened


@pytest.fixture(scope="module")
def snapshots(recording: Recording) -> tuple[Snapshot, ...]:
    """The demo's calibrated viewpoints."""
    taken = take_snapshots(recording, config=CONFIG.snapshots, sensors=CONFIG.sensors)
    return calibrate(taken.snapshots, config=CONFIG.calibration, sensors=CONFIG.sensors).snapshots


@pytest.mark.benchmark(group="whole run")
def test_tablemap(benchmark: BenchmarkFixture, recording: Recording) -> None:
    """Our method, without its review."""
    assert benchmark.pedantic(process, (recording,), {"config": CONFIG}, rounds=2).model


@pytest.mark.benchmark(group="whole run")
def test_the_report_s_method(benchmark: BenchmarkFixture, recording: Recording) -> None:
    """The baseline: half of it is clusters, half point-to-point ICP."""
    run = report_method.process
    assert benchmark.pedantic(run, (recording,), {"config": CONFIG}, rounds=2).model


@pytest.mark.benchmark(group="segmentation of eight views")
def test_organised_segmentation(
    benchmark: BenchmarkFixture, snapshots: tuple[Snapshot, ...]
) -> None:
    """Labels of every pixel, and which table it is."""
    result = benchmark.pedantic(
        segment, (snapshots,), {"config": CONFIG.segmentation, "sensors": CONFIG.sensors}, rounds=3
    )
    assert len(result.used) == len(snapshots)


@pytest.mark.benchmark(group="segmentation of eight views")
def test_open3d_clusters(benchmark: BenchmarkFixture, snapshots: tuple[Snapshot, ...]) -> None:
    """The baseline: voxels and DBSCAN, which name the nearest cluster and no more."""

    def clusters() -> int:
        return sum(not isinstance(report_method.table_cloud(s, seed=0), str) for s in snapshots)

    assert benchmark.pedantic(clusters, rounds=3) > 0


@pytest.mark.benchmark(group="one depth image to points in the map")
def test_unprojection(benchmark: BenchmarkFixture, snapshots: tuple[Snapshot, ...]) -> None:
    """Precomputed rays."""
    snapshot = snapshots[0]
    points = benchmark(
        lambda: transform(snapshot.map_from_base.lifted(), snapshot.points_in_base())
    )
    assert np.isfinite(points).any()


@pytest.mark.benchmark(group="one depth image to points in the map")
def test_open3d_unprojection(benchmark: BenchmarkFixture, snapshots: tuple[Snapshot, ...]) -> None:
    """The baseline: Open3D's own, which drops the image's order."""
    import open3d as o3d

    snapshot = snapshots[0]
    camera = snapshot.camera
    intrinsic = o3d.camera.PinholeCameraIntrinsic(
        camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy
    )
    image = o3d.geometry.Image(np.nan_to_num(snapshot.depth).astype(np.float32))
    pose = snapshot.map_from_base.lifted() @ snapshot.base_from_camera

    def unproject() -> int:
        cloud = o3d.geometry.PointCloud.create_from_depth_image(image, intrinsic, depth_scale=1.0)
        return len(cloud.transform(pose).points)

    assert benchmark(unproject) > 0
