"""A camera on its side or upside down gives the same upright images as one that stands."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tablemap.geometry import Floats
from tablemap.recording import open_recording
from tablemap.recording.colour import colour_pixels
from tablemap.recording.messages import CompressedImage, Image
from tablemap.recording.streams import DepthFrame
from tablemap.recording.upright import quarter_turns, turned_colour, turned_pinhole
from tests.making.messages import png
from tests.making.rewriting import DIALECTS, Change, Dialect, Entry, depth_of, rewrite, with_depth

CAMERA = "head_rgbd_sensor_rgb_frame"


def mounted(turns: int) -> Change:
    """Mount the camera turned clockwise by quarters: image, calibration and TF follow."""

    def changed(entry: Entry) -> Iterable[Entry]:
        if entry.is_depth:
            entry = with_depth(entry, np.rot90(depth_of(entry), -turns))
        elif entry.type == "CameraInfo":
            message = copy.deepcopy(entry.message)
            k = np.asarray(message.k).reshape(3, 3)
            k = turned_pinhole(k, message.width, message.height, -turns % 4)
            if turns % 2:
                message.width, message.height = message.height, message.width
            message.k = k.ravel()
            message.p = np.column_stack([k, np.zeros(3)]).ravel()
            entry = replace(entry, message=message)
        elif entry.type == "TFMessage":
            message = copy.deepcopy(entry.message)
            for edge in message.transforms:
                if edge.child_frame_id == CAMERA:
                    turn = edge.transform.rotation
                    spin = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
                    spin = spin * Rotation.from_euler("z", -90.0 * turns, degrees=True)
                    turn.x, turn.y, turn.z, turn.w = (float(value) for value in spin.as_quat())
            entry = replace(entry, message=message)
        yield entry

    return changed


def frames_of(path: Path) -> list[DepthFrame]:
    """Read all depth images of a recording."""
    with open_recording(path) as recording:
        frames = list(recording.depth_frames())
        assert not recording.warnings
    return frames


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("turns", [1, 2, 3])
def test_images_come_out_upright(
    tmp_path: Path, plain_recording: Path, turns: int, dialect: Dialect
) -> None:
    """Depth, pinhole and pose are those of the camera that stands."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", mounted(turns), dialect=dialect)
    for after, before in zip(frames_of(path), frames_of(plain_recording), strict=True):
        np.testing.assert_array_equal(after.depth, before.depth)
        np.testing.assert_allclose(after.k, before.k, atol=1e-9)
        np.testing.assert_allclose(after.base_from_camera, before.base_from_camera, atol=1e-6)
        assert isinstance(after.message, Image)
        assert (after.message.height, after.message.width) == after.depth.shape


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_frame_shows_the_same_points(plain_recording: Path, turns: int) -> None:
    """Whatever is turned, all points stay where they are in the base."""
    frame = frames_of(plain_recording)[0]
    turned = frame.turned(turns)

    def points(one: DepthFrame) -> Floats:
        v, u = np.indices(one.depth.shape)
        x, y = (u - one.k[0, 2]) / one.k[0, 0], (v - one.k[1, 2]) / one.k[1, 1]
        arms = np.stack([x, y, np.ones_like(x)], axis=-1) * one.depth[..., None]
        return np.asarray(arms @ one.base_from_camera[:3, :3].T + one.base_from_camera[:3, 3])

    expected = np.rot90(points(frame), turns)
    np.testing.assert_allclose(points(turned), expected, atol=1e-6)


@pytest.mark.parametrize("lean_deg", [-35.0, 0.0, 35.0])
@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_a_lean_is_no_quarter_turn(turns: int, lean_deg: float) -> None:
    """A hand that leans the camera by less than half a right angle turns nothing."""
    level = Rotation.from_euler("y", 25.0, degrees=True).as_matrix() @ np.array(
        [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    )
    mount = np.eye(4)
    mount[:3, :3] = (
        level @ Rotation.from_euler("z", lean_deg - 90.0 * turns, degrees=True).as_matrix()
    )
    assert quarter_turns(np.stack([mount, mount])) == turns


def test_a_camera_that_looks_straight_down_has_no_upright() -> None:
    """Nor have images without a pose."""
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    assert quarter_turns(np.stack([down])) == 0
    assert quarter_turns(np.zeros((0, 4, 4))) == 0


def test_colour_is_turned_with_depth() -> None:
    """An encoded image as one of raw pixels; what is no picture comes back as it is."""
    pixels = np.random.default_rng(1).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    raw = Image(1, "camera", 6, 8, "bgr8", False, 24, pixels[..., ::-1].tobytes())
    turned = turned_colour(raw, 1)
    found = colour_pixels(turned)
    assert found is not None
    np.testing.assert_array_equal(found, np.rot90(pixels))
    grey = turned_colour(Image(1, "camera", 6, 8, "mono8", False, 8, bytes(range(48))), 3)
    assert isinstance(grey, Image)
    assert (grey.height, grey.width, grey.encoding) == (8, 6, "mono8")
    encoded = turned_colour(CompressedImage(1, "camera", "png", png(pixels[..., 0])), 1)
    found = colour_pixels(encoded)
    assert found is not None
    assert found.shape == (8, 6, 3)
    broken = CompressedImage(1, "camera", "jpeg", b"no picture")
    assert turned_colour(broken, 1) is broken
