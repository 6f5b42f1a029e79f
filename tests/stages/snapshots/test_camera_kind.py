"""The kind of a depth camera is told by steps and noise; its values take the place of defaults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from tablemap.config import SensorsConfig, SnapshotsConfig, load_config
from tablemap.config.cameras import CAMERAS
from tablemap.errors import ConfigError
from tablemap.recording import open_recording
from tablemap.stages.snapshots import take_snapshots
from tablemap.stages.snapshots.camera_kind import seen_camera

IDEAL = np.repeat(np.linspace(0.7, 4.2, 320, dtype=np.float64)[None], 240, axis=0)
"""A wall that runs away from the camera, (240, 320) metres."""


def structured_light(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return what a camera with disparities in eighths of a pixel sees, in millimetres."""
    disparity = np.rint(8 * (43.9 / IDEAL + rng.normal(0, 0.08, IDEAL.shape))) / 8
    return np.rint(1e3 * 43.9 / disparity) / 1e3


def bent(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the same with a bend of 1.5 percent over the image, after the steps."""
    v, u = np.indices(IDEAL.shape) / 120.0
    field = 1 + 0.015 * np.sin(1.7 * u + 0.4) * np.cos(1.3 * v) * IDEAL / 2
    return np.rint(1e3 * structured_light(rng) * field) / 1e3


def realsense(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return what 848 x 480 active stereo sees: disparities in 32nds, smooth, in millimetres."""
    disparity = 21.3 / IDEAL + rng.normal(0, 0.08, IDEAL.shape)
    return np.rint(1e3 * 21.3 / disparity) / 1e3


def coarse_realsense(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return what the same sees in 640 x 480: steps of 6 mm at two metres."""
    disparity = np.rint(32 * (19.3 / IDEAL + rng.normal(0, 0.09, IDEAL.shape))) / 32
    return np.rint(1e3 * 19.3 / disparity) / 1e3


def zed(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return floats with NaN and infinities."""
    depth = 63.0 / (63.0 / IDEAL + rng.normal(0, 0.15, IDEAL.shape))
    depth[rng.uniform(size=depth.shape) < 0.05] = np.inf
    depth[rng.uniform(size=depth.shape) < 0.05] = np.nan
    return depth


def azure_kinect(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return millimetres whose noise grows slowly with the distance."""
    return np.rint(1e3 * (IDEAL + rng.normal(0, 1, IDEAL.shape) * 0.0012 * IDEAL)) / 1e3


def at_a_wall(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return time of flight where what is far is dark and slanted, so that its noise grows more."""
    return np.rint(1e3 * (IDEAL + rng.normal(0, 1, IDEAL.shape) * 0.0012 * IDEAL**1.45)) / 1e3


def in_little_light(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return time of flight whose noise grows with the square of the distance, as light falls."""
    return np.rint(1e3 * (IDEAL + rng.normal(0, 1, IDEAL.shape) * 0.0016 * IDEAL**2)) / 1e3


def matched_in_windows(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return stereo of as little noise, which the pixels of a window of seven share."""
    noise = uniform_filter(rng.normal(0, 1, IDEAL.shape), 7)
    return np.rint(1e3 * (IDEAL + 0.0016 * IDEAL**2 * noise / noise.std())) / 1e3


def smoothed(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the mean of three by three pixels, whose noise is then as low as time of flight's."""
    noisy = IDEAL + rng.normal(0, 1, IDEAL.shape) * 0.004 * IDEAL**1.3
    return np.rint(1e3 * uniform_filter(noisy, 3)) / 1e3


def eight_bits(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return depth in equal steps of 39 mm, as no camera measures it."""
    return np.rint(IDEAL / 0.039) * 0.039


@pytest.mark.parametrize(
    ("camera", "kind"),
    [
        (structured_light, "structured_light"),
        (bent, "structured_light"),
        (realsense, "stereo"),
        (coarse_realsense, "stereo"),
        (zed, "stereo"),
        (azure_kinect, "time_of_flight"),
        (at_a_wall, "time_of_flight"),
        (in_little_light, "time_of_flight"),
        (matched_in_windows, "stereo"),
        (eight_bits, None),
        (smoothed, None),
    ],
)
def test_kinds(camera: object, kind: str | None) -> None:
    """By single images; what is not known is None."""
    rng = np.random.default_rng(1)
    images = [camera(rng).astype(np.float32) for _ in range(3)]  # type: ignore[operator]
    for image in images:
        image[~np.isfinite(image)] = np.nan  # as decoded
    assert seen_camera(images).kind == kind


def test_nothing_is_told_of_nothing() -> None:
    """Empty and tiny images have no kind."""
    assert seen_camera([]).kind is None
    assert seen_camera([np.full((4, 6), np.nan, dtype=np.float32)]).kind is None


def test_the_simulated_camera_is_one_of_structured_light(plain_recording: Path) -> None:
    """Its values are the defaults, so that nothing is to be said."""
    with open_recording(plain_recording) as recording:
        taken = take_snapshots(recording, config=SnapshotsConfig(), sensors=SensorsConfig())
        named = take_snapshots(
            recording, config=SnapshotsConfig(), sensors=SensorsConfig(depth_camera="zed")
        )
    assert taken.camera.kind == "structured_light"
    assert taken.warnings == ()
    (note,) = named.warnings
    assert note.code == "snapshots.camera"
    for words in ("named zed", "structured light", "sensors.projector_baseline = 0.12"):
        assert words in note.message


def test_a_camera_by_name(tmp_path: Path) -> None:
    """It fills in what was left at its default, and no more; an unknown name is refused."""
    sensors, taken = SensorsConfig(depth_camera="azure_kinect").of_camera("stereo")
    assert sensors.projector_baseline == 0.0
    assert taken == CAMERAS["azure_kinect"]
    own, _ = SensorsConfig(depth_camera="zed", projector_baseline=0.063).of_camera(None)
    assert own.projector_baseline == 0.063
    assert own.top_widening_px == CAMERAS["zed"]["top_widening_px"]
    assert SensorsConfig().of_camera("structured_light") == (SensorsConfig(), {})
    config = load_config(overrides=["sensors.depth_camera=oak"])
    assert config.sensors.depth_camera == "oak"
    with pytest.raises(ConfigError, match=r"depth_camera"):
        load_config(overrides=["sensors.depth_camera=polaroid"])
