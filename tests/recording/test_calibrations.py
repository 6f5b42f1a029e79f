"""Each image is taken with the calibration that was valid for it, and for the part it shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tablemap.errors import RecordingError
from tablemap.geometry import Floats
from tablemap.pipeline import process
from tablemap.recording import DepthFrame, open_recording
from tests.making.rewriting import Change, Dialect, Entry, depth_of, edit, rewrite, with_depth

ROS: tuple[Dialect, ...] = ("ros1", "ros2")
WINDOW = (24, 10, 280, 220)  # left, top, width, height of 320 x 240
CENTRE = (157.4, 116.3)  # pixels, where the optical axis meets the image


def frames(path: Path) -> list[DepthFrame]:
    """Return all depth images."""
    with open_recording(path) as recording:
        return list(recording.depth_frames())


def warnings(path: Path) -> list[str]:
    """Return what is said while all images are read."""
    with open_recording(path) as recording:
        list(recording.depth_frames())
        return [warning.code for warning in recording.warnings]


def points(frame: DepthFrame) -> Floats:
    """Return (height, width, 3) points in the camera."""
    v, u = np.indices(frame.depth.shape)
    x, y = (u - frame.k[0, 2]) / frame.k[0, 0], (v - frame.k[1, 2]) / frame.k[1, 1]
    return np.stack([x, y, np.ones_like(x)], axis=-1) * frame.depth[..., None]


def calibrated(change: Callable[[Entry], Entry]) -> Change:
    """Change the calibrations."""

    def changed(entry: Entry) -> Iterable[Entry]:
        yield change(entry) if entry.type == "CameraInfo" else entry

    return changed


def imaged(change: Callable[[Entry], Entry]) -> Change:
    """Change the depth images."""

    def changed(entry: Entry) -> Iterable[Entry]:
        yield change(entry) if entry.is_depth else entry

    return changed


def with_k(entry: Entry, scale: float = 1.0, *, names: str = "kp") -> Entry:
    """Return a calibration with other focal lengths, in K or P or both."""
    made = {}
    for name in names:
        matrix = getattr(entry.message, name).copy()
        matrix[[0, 4 if name == "k" else 5]] *= scale
        made[name] = matrix
    return edit(entry, **made)


def cropped(entry: Entry) -> Entry:
    """Return the window of an image."""
    left, top, width, height = WINDOW
    return with_depth(entry, depth_of(entry)[top : top + height, left : left + width])


def says_window(entry: Entry, *, of_sensor: bool = True) -> Entry:
    """Return a calibration with its region of interest, and the sensor's size or the window's."""
    left, top, width, height = WINDOW
    roi = replace(entry.message.roi, x_offset=left, y_offset=top, width=width, height=height)
    size = {} if of_sensor else {"width": width, "height": height}
    return edit(entry, roi=roi, **size)


@pytest.mark.parametrize("dialect", ROS)
@pytest.mark.parametrize("of_sensor", [True, False])
def test_a_window_of_the_sensor(
    tmp_path: Path, plain_recording: Path, dialect: Dialect, of_sensor: bool
) -> None:
    """Pixels of a window see what they saw in the whole image, whichever size is stated."""
    path = rewrite(
        plain_recording,
        tmp_path / "r.mcap",
        calibrated(lambda entry: says_window(entry, of_sensor=of_sensor)),
        imaged(cropped),
        dialect=dialect,
    )
    left, top, width, height = WINDOW
    for whole, part in zip(frames(plain_recording), frames(path), strict=True):
        expected = points(whole)[top : top + height, left : left + width]
        assert np.allclose(points(part), expected, atol=1e-4, equal_nan=True)


def test_a_window_that_was_not_cut_out(tmp_path: Path, plain_recording: Path) -> None:
    """A region of interest beside an image of all pixels says nothing about it."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", calibrated(says_window))
    for whole, same in zip(frames(plain_recording), frames(path), strict=True):
        assert np.array_equal(whole.k, same.k)


@pytest.mark.parametrize("dialect", ROS)
@pytest.mark.parametrize("stated", ["sensor", "binned"])
def test_binned_pixels(
    tmp_path: Path, plain_recording: Path, dialect: Dialect, stated: str
) -> None:
    """Two by two pixels made one: half the focal length, the principal point between pixels."""

    def binned(entry: Entry) -> Entry:
        size = {"width": 160, "height": 120} if stated == "binned" else {}
        return edit(entry, binning_x=2, binning_y=2, **size)

    path = rewrite(
        plain_recording,
        tmp_path / "r.mcap",
        calibrated(binned),
        imaged(lambda entry: with_depth(entry, depth_of(entry)[::2, ::2])),
        dialect=dialect,
    )
    for whole, half in zip(frames(plain_recording), frames(path), strict=True):
        assert half.depth.shape == (120, 160)
        assert np.allclose(half.k[[0, 1], [0, 1]], whole.k[[0, 1], [0, 1]] / 2)
        assert np.allclose(half.k[:2, 2], (whole.k[:2, 2] + 0.5) / 2 - 0.5)


def test_a_window_that_is_binned(tmp_path: Path, plain_recording: Path) -> None:
    """The region of interest counts in pixels that are not binned."""
    path = rewrite(
        plain_recording,
        tmp_path / "r.mcap",
        calibrated(lambda entry: edit(says_window(entry), binning_x=2, binning_y=2)),
        imaged(lambda entry: with_depth(entry, depth_of(cropped(entry))[::2, ::2])),
    )
    for whole, part in zip(frames(plain_recording), frames(path), strict=True):
        left, top, width, height = WINDOW
        assert part.depth.shape == (height // 2, width // 2)
        assert np.allclose(part.k[:2, 2], (whole.k[:2, 2] - (left, top) + 0.5) / 2 - 0.5)


def test_a_calibration_that_changes_on_the_way(tmp_path: Path, plain_recording: Path) -> None:
    """From half way on the camera shows a window: each image has its own calibration."""
    with open_recording(plain_recording) as recording:
        middle = int(recording.depth_stamps()[4])

    def later(change: Callable[[Entry], Entry]) -> Callable[[Entry], Entry]:
        return lambda entry: change(entry) if entry.stamp_ns >= middle else entry

    path = rewrite(
        plain_recording,
        tmp_path / "r.mcap",
        calibrated(later(says_window)),
        imaged(later(cropped)),
    )
    left, top, width, height = WINDOW
    seen = frames(path)
    assert [frame.depth.shape for frame in seen] == 4 * [(240, 320)] + 4 * [(height, width)]
    for whole, part in zip(frames(plain_recording)[4:], seen[4:], strict=True):
        expected = points(whole)[top : top + height, left : left + width]
        assert np.allclose(points(part), expected, atol=1e-4, equal_nan=True)
    assert warnings(path) == ["recording.calibration"]


def zoomed(entry: Entry, scale: float) -> Entry:
    """Return a depth image as a lens with a longer focal length shows it."""
    values = depth_of(entry)
    height, width = values.shape
    v, u = (
        np.round((np.arange(size) - middle) / scale + middle).astype(int)
        for size, middle in ((height, CENTRE[1]), (width, CENTRE[0]))
    )
    return with_depth(entry, values[np.ix_(v, u)])


def middle_of(path: Path) -> int:
    """Return the stamp from which on the later half of the images were taken."""
    with open_recording(path) as recording:
        return int(recording.depth_stamps()[4])


def with_later_k(path: Path, scale: float) -> Change:
    """Scale the focal length in the calibrations of the later half."""
    middle = middle_of(path)
    return calibrated(lambda entry: with_k(entry, scale) if entry.stamp_ns >= middle else entry)


def test_a_camera_that_zooms_on_the_way(tmp_path: Path, plain_recording: Path) -> None:
    """The floor agrees with both calibrations: each is taken from its stamp on, and it is said."""
    middle = middle_of(plain_recording)
    path = rewrite(
        plain_recording,
        tmp_path / "r.mcap",
        with_later_k(plain_recording, 1.1),
        imaged(lambda entry: zoomed(entry, 1.1) if entry.stamp_ns >= middle else entry),
    )
    focal = [frame.k[0, 0] for frame in frames(path)]
    assert focal == pytest.approx(4 * [focal[0]] + 4 * [1.1 * focal[0]])
    assert warnings(path) == ["recording.calibration"]


def test_a_calibration_that_turns_wrong_on_the_way(tmp_path: Path, plain_recording: Path) -> None:
    """The floor agrees with the first one alone: that is taken for all images, and it is said."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", with_later_k(plain_recording, 1.1))
    focal = [frame.k[0, 0] for frame in frames(path)]
    assert focal == pytest.approx(8 * [frames(plain_recording)[0].k[0, 0]])
    assert warnings(path) == 2 * ["recording.calibration"]


def test_a_calibration_that_changes_by_little(tmp_path: Path, plain_recording: Path) -> None:
    """Where the floor agrees with both, what each image's own one says is taken in doubt."""
    path = rewrite(plain_recording, tmp_path / "r.mcap", with_later_k(plain_recording, 1.015))
    focal = [frame.k[0, 0] for frame in frames(path)]
    assert focal == pytest.approx(4 * [focal[0]] + 4 * [1.015 * focal[0]])
    with open_recording(path) as recording:
        (doubt,) = [each for each in recording.warnings if each.code.startswith("accuracy.")]
    assert doubt.code == "accuracy.calibrations_disagree"
    assert "what was valid for each image was taken" in doubt.message


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_first_calibrations_that_are_none(
    tmp_path: Path, plain_recording: Path, value: float
) -> None:
    """A driver that begins with zeros or NaN: the first valid one holds for those images too."""
    count = 0

    def empty(entry: Entry) -> Entry:
        nonlocal count
        count += 1
        return with_k(entry, value) if count <= 3 else entry

    path = rewrite(plain_recording, tmp_path / "r.mcap", calibrated(empty))
    for whole, same in zip(frames(plain_recording), frames(path), strict=True):
        assert np.array_equal(whole.k, same.k)
    assert warnings(path) == ["recording.calibration"]


def test_distortion_that_no_lens_has(tmp_path: Path, plain_recording: Path) -> None:
    """Coefficients in the hundreds are not applied: the images are taken as they are, in doubt."""

    def raw(entry: Entry) -> Iterable[Entry]:
        topic = entry.topic.replace("image_rect_raw", "image_raw")
        yield replace(entry, topic=topic)

    wild = np.array([312.0, -541.0, 0.2, -0.1, 880.0])
    path = rewrite(
        plain_recording, tmp_path / "r.mcap", raw, calibrated(lambda entry: edit(entry, d=wild))
    )
    for whole, same in zip(frames(plain_recording), frames(path), strict=True):
        assert np.array_equal(whole.k, same.k)
        assert np.array_equal(whole.depth, same.depth, equal_nan=True)
    assert warnings(path) == ["accuracy.calibration_flawed"]


def test_images_that_no_calibration_fits(tmp_path: Path, plain_recording: Path) -> None:
    """Some of another shape are left out, and said; where all are, that is the error."""

    def narrow(entry: Entry) -> Entry:
        return with_depth(entry, depth_of(entry)[:, :200])

    with open_recording(plain_recording) as recording:
        stamps = recording.depth_stamps()
    some = rewrite(
        plain_recording,
        tmp_path / "some.mcap",
        imaged(lambda entry: narrow(entry) if entry.stamp_ns >= stamps[5] else entry),
    )
    assert [frame.stamp_ns for frame in frames(some)] == stamps[:5].tolist()
    assert warnings(some) == ["recording.calibration"]
    every = rewrite(plain_recording, tmp_path / "all.mcap", imaged(narrow))
    with pytest.raises(RecordingError, match="200 x 240 pixels, its calibration is for 320 x 240"):
        open_recording(every)


@pytest.mark.slow
@pytest.mark.parametrize("stated", ["sensor", "halved"])
def test_half_the_pixels_keep_all_views(tmp_path: Path, demo_recording: Path, stated: str) -> None:
    """The demo at 320 x 240, by its calibrations or by their binning, gives the same table."""

    def halved(entry: Entry) -> Entry:
        if stated == "sensor":
            return edit(entry, binning_x=2, binning_y=2)
        k, p = entry.message.k.copy(), entry.message.p.copy()
        k[[0, 2, 4, 5]] /= 2
        p[[0, 2, 5, 6]] /= 2
        return edit(entry, width=320, height=240, k=k, p=p)

    path = rewrite(
        demo_recording,
        tmp_path / "r.mcap",
        calibrated(halved),
        imaged(lambda entry: with_depth(entry, depth_of(entry)[::2, ::2])),
    )
    model = process(open_recording(path)).model
    assert frames(path)[0].depth.shape == (240, 320)
    assert [view.used for view in model.snapshots] == [True] * 8
    assert model.verdict.level == "good"
    top = model.surface
    assert top.dimensions["length"].value == pytest.approx(1.187, abs=0.003)
    assert top.dimensions["width"].value == pytest.approx(0.806, abs=0.003)
    assert top.height.value == pytest.approx(0.743, abs=0.003)
    assert len(model.legs) == 4
