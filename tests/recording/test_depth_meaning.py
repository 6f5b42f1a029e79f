"""What depth and calibration mean is told by the floor, and said with the setting that says so."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tablemap.config import TopicsConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.recording import inspect, open_recording
from tests.making.rewriting import (
    DIALECTS,
    Change,
    Dialect,
    Entry,
    depth_of,
    edit,
    rewrite,
    with_depth,
)

CAMERA = "head_rgbd_sensor_rgb_frame"
AS_RECORDED = TopicsConfig(depth_unit=0.001, depth_along="axis", camera_axes="optical")


def read(
    path: Path, topics: TopicsConfig | None = None
) -> tuple[list[Floats], list[ProcessWarning]]:
    """Return the points of all depth images in the base, every fourth, and what was said."""
    points = []
    with open_recording(path, topics=topics) as recording:
        for frame in recording.depth_frames():
            v, u = np.indices(frame.depth.shape)[:, ::4, ::4]
            depth = frame.depth[::4, ::4].astype(np.float64)
            x, y = (u - frame.k[0, 2]) / frame.k[0, 0], (v - frame.k[1, 2]) / frame.k[1, 1]
            arms = np.stack([x, y, np.ones_like(x)], axis=-1) * depth[..., None]
            mount = frame.base_from_camera
            points.append(arms @ mount[:3, :3].T + mount[:3, 3])
        return points, recording.warnings


def imaged(change: Any) -> Change:
    """Change the values of depth images, in millimetres."""

    def changed(entry: Entry) -> Iterable[Entry]:
        yield change(entry) if entry.is_depth else entry

    return changed


def assert_same(path: Path, plain: Path, *, metres: float) -> list[ProcessWarning]:
    """Check that all points are where they were, to what the rewriting rounds."""
    ours, warnings = read(path)
    for after, before in zip(ours, read(plain)[0], strict=True):
        off = np.abs(after - before)
        assert np.array_equal(np.isnan(after), np.isnan(before))
        assert np.nanmax(off) < metres
    return warnings


def stretch_of(entry: Entry) -> Floats:
    """Return the (240, 320) lengths of the rays of the plain recording's camera."""
    v, u = np.indices(depth_of(entry).shape)
    f, (cx, cy) = K_OF_PLAIN[0], K_OF_PLAIN[1:]
    return np.sqrt(((u - cx) / f) ** 2 + ((v - cy) / f) ** 2 + 1)


K_OF_PLAIN = [269.2, 157.4, 116.3]


@pytest.fixture(scope="module", autouse=True)
def _camera(plain_recording: Path) -> None:
    """Take the plain recording's pinhole for what is rewritten."""
    with open_recording(plain_recording) as recording:
        k = recording.camera_info().k
        K_OF_PLAIN[:] = [float(k[0, 0]), float(k[0, 2]), float(k[1, 2])]


def along_rays(entry: Entry) -> Entry:
    """Return an image with distances along the rays."""
    return with_depth(entry, np.round(depth_of(entry) * stretch_of(entry)).astype(np.uint16))


@pytest.mark.parametrize("dialect", DIALECTS)
def test_distances_along_the_rays(tmp_path: Path, plain_recording: Path, dialect: Dialect) -> None:
    """The floor bows: depth is converted, and the warning says so, also to info."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", imaged(along_rays), dialect=dialect)
    (warning,) = assert_same(path, plain_recording, metres=0.015)
    assert warning.code == "recording.depth_meaning"
    assert "topics.depth_along=ray" in warning.message
    assert warning.code in [each.code for each in inspect(path).warnings]


@pytest.mark.parametrize("unit", [0.0001, 0.000125, 0.00025])
def test_other_units_of_16_bits(tmp_path: Path, plain_recording: Path, unit: float) -> None:
    """Steps of 0.1, 0.125 or 0.25 mm put the floor 10, 8 or 4 times too far."""

    def finer(entry: Entry) -> Entry:
        values = np.round(depth_of(entry) * (0.001 / unit))
        return with_depth(entry, np.where(values < 65535, values, 0).astype(np.uint16))

    path = rewrite(plain_recording, tmp_path / "r.mcap", imaged(finer))
    ours, warnings = read(path)
    for after, before in zip(ours, read(plain_recording)[0], strict=True):
        both = np.isfinite(after) & np.isfinite(before)
        assert both.mean() > 0.5
        assert np.abs(after - before)[both].max() < 0.001
    (warning,) = warnings
    assert warning.code == "recording.depth_meaning"
    assert f"topics.depth_unit={unit:g}" in warning.message
    assert read(path, TopicsConfig(depth_unit=unit))[1] == []


@pytest.mark.parametrize("dialect", DIALECTS)
def test_floats_in_millimetres(tmp_path: Path, plain_recording: Path, dialect: Dialect) -> None:
    """32FC1 is metres; a driver that fills in millimetres is found out."""

    def floats(entry: Entry) -> Entry:
        return with_depth(entry, depth_of(entry).astype(np.float32), encoding="32FC1")

    path = rewrite(plain_recording, tmp_path / "r.mcap", imaged(floats), dialect=dialect)
    (warning,) = assert_same(path, plain_recording, metres=1e-5)
    assert "1 mm, not 1000 mm" in warning.message


@pytest.mark.parametrize("dialect", DIALECTS)
def test_images_in_a_body_s_frame(tmp_path: Path, plain_recording: Path, dialect: Dialect) -> None:
    """Images stamped with a link whose x points forward are turned to where the camera looks."""

    def stamped(entry: Entry) -> Iterable[Entry]:
        message = copy.deepcopy(entry.message)
        if entry.type == "TFMessage":
            extra = []
            for edge in message.transforms:
                if edge.child_frame_id == CAMERA:
                    link = copy.deepcopy(edge)
                    link.header.frame_id, link.child_frame_id = CAMERA, "head_link"
                    place, turn = link.transform.translation, link.transform.rotation
                    place.x = place.y = place.z = 0.0
                    turn.x, turn.y, turn.z, turn.w = 0.5, -0.5, 0.5, 0.5
                    extra.append(link)
            message.transforms = [*message.transforms, *extra]
        elif entry.is_depth or entry.type == "CameraInfo":
            message.header.frame_id = "head_link"
        yield replace(entry, message=message)

    path = rewrite(plain_recording, tmp_path / "r.mcap", stamped, dialect=dialect)
    (warning,) = assert_same(path, plain_recording, metres=1e-5)
    assert "topics.camera_axes=body" in warning.message


def test_what_is_set_is_not_judged(tmp_path: Path, plain_recording: Path) -> None:
    """Whoever says what depth means has it so, whatever the floor says."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", imaged(along_rays))
    _, warnings = read(path, AS_RECORDED)
    assert "recording.depth_meaning" not in [warning.code for warning in warnings]
    ours, warnings = read(path, TopicsConfig(depth_along="ray"))
    assert warnings == []
    for after, before in zip(ours, read(plain_recording)[0], strict=True):
        assert np.nanmax(np.abs(after - before)) < 0.015


def shorter(entry: Entry, share: float) -> Entry:
    """Return a calibration with focal lengths of a share."""
    k, p = entry.message.k.copy(), entry.message.p.copy()
    k[[0, 4]] *= share
    p[[0, 5]] *= share
    return edit(entry, k=k, p=p)


@pytest.mark.parametrize("share", [0.94, 0.96, 1.05])
def test_focal_length_that_the_floor_contradicts(
    tmp_path: Path, plain_recording: Path, share: float
) -> None:
    """A few per cent short or long: the floor is too low and tilted, which costs the verdict."""

    def wrong(entry: Entry) -> Iterable[Entry]:
        yield shorter(entry, share) if entry.type == "CameraInfo" else entry

    _, warnings = read(rewrite(plain_recording, tmp_path / "r.mcap", wrong))
    (warning,) = warnings
    assert warning.code == "accuracy.floor"
    assert ("too short" if share < 1 else "too long") in warning.message


@pytest.mark.parametrize("dialect", DIALECTS)
def test_calibrations_of_one_frame_that_disagree(
    tmp_path: Path, plain_recording: Path, dialect: Dialect
) -> None:
    """The depth's own calibration is 4 % short, the colour's is right: the floor chooses."""

    def wrong(entry: Entry) -> Iterable[Entry]:
        if entry.type == "CameraInfo":
            yield replace(entry, topic="/head_rgbd_sensor/rgb/camera_info")
            entry = shorter(entry, 0.96)
        yield entry

    path = rewrite(plain_recording, tmp_path / "r.mcap", wrong, dialect=dialect)
    (warning,) = assert_same(path, plain_recording, metres=1e-6)
    assert warning.code == "recording.calibration"
    assert "/head_rgbd_sensor/rgb/camera_info was taken" in warning.message
    assert warning in inspect(path).warnings


def test_calibrations_that_the_floor_cannot_tell_apart(
    tmp_path: Path, plain_recording: Path
) -> None:
    """One per cent apart, either may be right: both are named, which costs the verdict."""

    def wrong(entry: Entry) -> Iterable[Entry]:
        if entry.type == "CameraInfo":
            yield replace(entry, topic="/head_rgbd_sensor/rgb/camera_info")
            entry = shorter(entry, 0.99)
        yield entry

    _, (warning,) = read(rewrite(plain_recording, tmp_path / "r.mcap", wrong))
    assert warning.code == "accuracy.calibrations_disagree"
    assert "depth_registered/camera_info says f" in warning.message


def test_matrices_that_disagree(tmp_path: Path, plain_recording: Path) -> None:
    """Of an undistorted image K and P are one matrix: where P is 5 % short, K is taken."""

    def wrong(entry: Entry) -> Iterable[Entry]:
        if entry.type == "CameraInfo":
            p = entry.message.p.copy()
            p[[0, 5]] *= 0.95
            entry = edit(entry, p=p)
        yield entry

    path = rewrite(plain_recording, tmp_path / "r.mcap", wrong)
    (warning,) = assert_same(path, plain_recording, metres=1e-6)
    assert warning.code == "recording.calibration"
    assert "K of" in warning.message


@pytest.mark.parametrize("unit", [0.005, 0.01])
def test_coarser_units_are_named(tmp_path: Path, plain_recording: Path, unit: float) -> None:
    """A room in which nothing is a metre away has another unit; the warning tells which."""

    def coarser(entry: Entry) -> Entry:
        return with_depth(entry, np.round(depth_of(entry) * (0.001 / unit)).astype(np.uint16))

    path = rewrite(plain_recording, tmp_path / "r.mcap", imaged(coarser))
    (warning,) = read(path)[1]
    assert warning.code == "accuracy.depth_meaning"
    assert f"topics.depth_unit={unit:g} would fit" in warning.message
    assert [each.code for each in read(path, TopicsConfig(depth_unit=unit))[1]] == []


@pytest.mark.parametrize("above", [0.1, 0.2])
def test_a_base_above_the_floor_may_be_all(
    tmp_path: Path, plain_recording: Path, above: float
) -> None:
    """A base_link that has no footprint below it: what is said names that, and what mends it."""

    def raised(entry: Entry) -> Iterable[Entry]:
        if entry.type == "TFMessage":
            entry = copy.deepcopy(entry)
            for each in entry.message.transforms:
                if each.child_frame_id == CAMERA:
                    each.transform.translation.z -= above
        yield entry

    (warning,) = read(rewrite(plain_recording, tmp_path / "r.mcap", raised))[1]
    assert warning.code.startswith("accuracy.")
    assert f"If the base's frame is {above:.2f} m above the floor" in warning.message
    assert "topics.extrinsics" in warning.message


@pytest.mark.parametrize(
    ("turn", "says"),
    [
        (np.diag([-1.0, -1, 1]), "by 180 degrees about its optical axis"),
        (np.diag([1.0, -1, -1]), "by 180 degrees about its image's rows"),
        (np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), "TF has that turn twice"),
    ],
    ids=["upside down", "looks along -z", "optical turn twice"],
)
def test_a_camera_that_is_turned_by_right_angles_is_named(
    tmp_path: Path, plain_recording: Path, turn: Floats, says: str
) -> None:
    """No floor is seen by TF: what is said names the turn by which it would be."""

    def turned(entry: Entry) -> Iterable[Entry]:
        if entry.type == "TFMessage":
            entry = copy.deepcopy(entry)
            for each in entry.message.transforms:
                if each.child_frame_id == CAMERA:
                    q = each.transform.rotation
                    sent = Rotation.from_quat([q.x, q.y, q.z, q.w])
                    q.x, q.y, q.z, q.w = (sent * Rotation.from_matrix(turn)).as_quat()
        yield entry

    (warning,) = read(rewrite(plain_recording, tmp_path / "r.mcap", turned))[1]
    assert warning.code == "accuracy.depth_meaning"
    assert says in warning.message
