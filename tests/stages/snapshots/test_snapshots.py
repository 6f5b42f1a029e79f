"""Viewpoints out of poses and images: stops, single images, and a camera that never rests."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from tablemap.config import SensorsConfig, SnapshotsConfig
from tablemap.errors import EstimationError, RecordingError
from tablemap.geometry import Bools, Floats, Ints, Pose2, transform
from tablemap.inputs import Input
from tablemap.recording import DepthFrame, FrameNames, Recording
from tablemap.recording.messages import CompressedImage, Image
from tablemap.stages.snapshots import Snapshot, take_snapshots
from tablemap.stages.snapshots.combining import combine
from tests.making.made_up_run import each
from tests.making.round_trips import CAMERA, MESSAGE, mounting, round_trip

CONFIG = SnapshotsConfig()
SENSORS = SensorsConfig()
SECOND = 1_000_000_000
K = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1.0]])


class Drive(Recording):
    """A made-up recording: (t, x, y, yaw) knots of the true path, images at given times.

    ``jumps`` shifts the localisation by metres in x from a time on; wheels follow the true path.
    ``head`` has (t, pan, tilt) knots in degrees, ``jitter_deg`` is what its encoders add.
    """

    def __init__(
        self,
        knots: list[tuple[float, float, float, float]],
        images: NDArray[np.float64],
        *,
        pose_rate: float = 20.0,
        wheels: bool = True,
        jumps: tuple[tuple[float, float], ...] = (),
        pose_span: tuple[float, float] | None = None,
        head: list[tuple[float, float, float]] | None = None,
        jitter_deg: float = 0.0,
    ) -> None:
        self.input = Input.of("drive.mcap")
        self.warnings = []
        self.names = FrameNames("map", "odom" if wheels else None, "base_link", "camera", None)
        self.localisation = None
        self.knots = np.array(knots)
        self.images = np.round(images * SECOND).astype(np.int64)
        self.pose_rate, self.wheels, self.jumps = pose_rate, wheels, jumps
        ends = (self.knots[0, 0], self.knots[-1, 0]) if pose_span is None else pose_span
        self.pose_span = (int(ends[0] * SECOND), int(ends[1] * SECOND))
        self.start_ns, self.end_ns = 0, int(self.knots[-1, 0] * SECOND)
        self.decoded: list[int] = []
        self.head = np.array([(0.0, 0.0, 0.0)] if head is None else head)
        self.jitter_deg = jitter_deg

    def _true(self, stamp_ns: int) -> Pose2:
        t = stamp_ns / SECOND
        x, y, yaw = (float(np.interp(t, self.knots[:, 0], self.knots[:, i])) for i in (1, 2, 3))
        return Pose2(x, y, yaw)

    def depth_stamps(self) -> Ints:
        """Return the images' stamps."""
        return self.images

    def depth_frames(self, stamps_ns: Ints | None = None) -> Iterator[DepthFrame]:
        """Yield a flat wall a metre away."""
        for stamp in self.images if stamps_ns is None else stamps_ns:
            self.decoded.append(int(stamp))
            depth = np.full((CAMERA.height, CAMERA.width), 1.0, dtype=np.float32)
            message = replace(MESSAGE, stamp_ns=int(stamp))
            yield DepthFrame(int(stamp), depth, K, message, self.mount(int(stamp)))

    def mount(self, stamp_ns: int) -> Floats:
        """Return how the head holds the camera: turned about the base's vertical axis, and down."""
        t = stamp_ns / SECOND
        pan, tilt = (float(np.interp(t, self.head[:, 0], self.head[:, i])) for i in (1, 2))
        jitter = self.jitter_deg * np.array([np.sin(1e3 * t), np.cos(7e2 * t)])
        held = mounting().copy()
        nod = Rotation.from_euler("y", tilt + jitter[1], degrees=True).as_matrix()
        held[:3, :3] = nod @ held[:3, :3]
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_euler("z", pan + jitter[0], degrees=True).as_matrix()
        return turn @ held

    def base_from_cameras(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return how the head held the camera."""
        mounts = np.array([self.mount(int(s)) for s in np.asarray(stamps_ns)])
        return mounts.reshape(-1, 4, 4), np.ones(len(mounts), dtype=bool)

    def colour_near(
        self, stamps_ns: Ints, tolerance_ns: int = 100_000_000
    ) -> dict[int, Image | CompressedImage]:
        """Return a colour image for each."""
        return {int(s): replace(MESSAGE, stamp_ns=int(s)) for s in stamps_ns}

    def fixed_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return the localised poses, and which are known."""
        return each(self.fixed_from_base, stamps_ns)

    def odom_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return the wheels' poses, and which are known."""
        return each(self.odom_from_base, stamps_ns)

    def fixed_from_base(self, stamp_ns: int) -> Floats | None:
        """Return the localised pose."""
        if not self.pose_span[0] <= stamp_ns <= self.pose_span[1]:
            return None
        pose = self._true(stamp_ns).lifted()
        pose[0, 3] += sum(shift for at, shift in self.jumps if stamp_ns >= at * SECOND)
        pose[2, 3] = 0.05
        return pose

    def odom_from_base(self, stamp_ns: int) -> Floats | None:
        """Return the wheels' pose."""
        return self._true(stamp_ns).lifted() if self.wheels else None

    def pose_stamps(self) -> Ints:
        """Return the localisation's stamps."""
        step = int(SECOND / self.pose_rate)
        return np.arange(self.pose_span[0], self.pose_span[1] + 1, step, dtype=np.int64)


STOPS = [
    (0.0, 0.0, 0.0, 0.0),
    (3.0, 0.0, 0.0, 0.0),
    (6.0, 1.0, 0.0, 0.8),
    (9.0, 1.0, 0.0, 0.8),
    (12.0, 1.0, 1.0, 1.6),
    (15.0, 1.0, 1.0, 1.6),
    (18.0, 0.0, 1.0, 2.4),
    (21.0, 0.0, 1.0, 2.4),
]
VIDEO = np.arange(0.0, 21.0, 0.1)


def test_each_stop_is_one_snapshot_of_several_images() -> None:
    """Four stops in a video give four snapshots, each with its whole standing time."""
    drive = Drive(STOPS, VIDEO)
    result = take_snapshots(drive, config=CONFIG, sensors=SENSORS)
    assert result.kind == "stops"
    assert [s.index for s in result.snapshots] == [0, 1, 2, 3]
    assert all(s.images == CONFIG.images_per_stop for s in result.snapshots)
    for snapshot, start in zip(result.snapshots, (0, 6, 12, 18), strict=True):
        # Only what the sampling of the motion cannot resolve is missing.
        assert start * SECOND <= snapshot.start_ns <= (start + 0.3) * SECOND
        assert (start + 2.7) * SECOND <= snapshot.end_ns <= (start + 3) * SECOND
        assert snapshot.odom_from_base is not None
        assert snapshot.colour_message is not None
    assert len(drive.decoded) == 4 * CONFIG.images_per_stop


def test_height_and_tilt_go_with_the_camera() -> None:
    """map_from_base is planar; with base_from_camera it makes the full camera pose."""
    snapshot = take_snapshots(Drive(STOPS, VIDEO), config=CONFIG, sensors=SENSORS).snapshots[1]
    whole = snapshot.map_from_base.lifted() @ snapshot.base_from_camera
    place = transform(whole, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(place, [1.0, 0.0, 1.15], atol=1e-9)
    assert snapshot.map_from_base.yaw == pytest.approx(0.8)


def test_a_localisation_jump_does_not_part_a_stop() -> None:
    """The wheels decide; without them a lone jump while standing is no motion either."""
    for wheels in (True, False):
        drive = Drive(STOPS, VIDEO, wheels=wheels, jumps=((7.5, 0.2), (13.5, -0.3)))
        result = take_snapshots(drive, config=CONFIG, sensors=SENSORS)
        assert result.kind == "stops"
        assert len(result.snapshots) == 4


def creeping(speeds: list[float], *, apart: float = 0.8) -> Drive:
    """Rest for two seconds at places so many metres apart; the odometry creeps meanwhile."""
    knots = []
    for i, speed in enumerate(speeds):
        knots += [(4.0 * i, apart * i, 0.0, 0.0), (4.0 * i + 2, apart * i + 2 * speed, 0.0, 0.0)]
    images = np.array([4.0 * i + second for i in range(len(speeds)) for second in (0.8, 1.2)])
    return Drive(knots, images)


def test_stops_at_which_the_odometry_creeps_are_seen_too() -> None:
    """Where it drifts by 4 cm/s at every other stop, one image of each of these is a view."""
    taken = take_snapshots(creeping([0.0, 0.04] * 4), config=CONFIG, sensors=SENSORS)
    assert taken.kind == "stops"
    assert len(taken.snapshots) == 8
    # Faster motion is the drive itself.
    driven = take_snapshots(creeping([0.0, 0.15] * 4), config=CONFIG, sensors=SENSORS)
    assert len(driven.snapshots) == 4
    # What a stop shows needs no second view.
    near = take_snapshots(creeping([0.0, 0.04] * 4, apart=0.05), config=CONFIG, sensors=SENSORS)
    assert len(near.snapshots) == 4


def test_one_image_a_viewpoint() -> None:
    """Single images seconds apart, with poses at their stamps alone, are a snapshot each."""
    images = np.array([1.0, 8.0, 14.0, 20.0])
    drive = Drive(STOPS, images, pose_rate=0.1, wheels=False)
    result = take_snapshots(drive, config=CONFIG, sensors=SENSORS)
    assert (result.kind, len(result.snapshots)) == ("stops", 4)
    assert [s.images for s in result.snapshots] == [1, 1, 1, 1]


def test_a_camera_that_never_rests_gives_keyframes() -> None:
    """Keyframes are apart by distance or angle, at most as many as wanted, none lost."""
    knots = [(0.0, 0.0, 0.0, 0.0), (30.0, 6.0, 0.0, 3.0)]
    drive = Drive(knots, np.arange(0.0, 30.0, 0.1), wheels=False)
    config = SnapshotsConfig(maximum=12)
    result = take_snapshots(drive, config=config, sensors=SENSORS)
    assert result.kind == "keyframes"
    assert 6 <= len(result.snapshots) <= 12
    assert len(result.set_aside) == 300 - len(result.snapshots)
    assert all(entry.reason for entry in result.set_aside)
    assert len(drive.decoded) == len(result.snapshots)
    places = np.array([s.map_from_base.translation for s in result.snapshots])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).min() > 0.15


STANDING = [(0.0, 0.0, 0.0, 0.3), (14.0, 0.0, 0.0, 0.3)]
PANNING = [
    *((0.0, -40.0, 0.0), (3.0, -40.0, 0.0), (4.0, 0.0, 0.0), (7.0, 0.0, 0.0)),
    *((8.0, 40.0, 0.0), (11.0, 40.0, 0.0), (12.0, 40.0, 20.0), (14.0, 40.0, 20.0)),
]
TRIPOD = np.arange(0.0, 14.0, 0.1)


def pans_deg(snapshots: tuple[Snapshot, ...]) -> list[int]:
    """Return where the cameras look in the base, by their optical axes."""
    axes = [s.base_from_camera[:3, 2] for s in snapshots]
    return [round(float(np.rad2deg(np.arctan2(axis[1], axis[0])))) for axis in axes]


def test_each_direction_of_the_head_is_a_view() -> None:
    """A base that stands while its head looks three ways, and once lower, gives four snapshots."""
    result = take_snapshots(Drive(STANDING, TRIPOD, head=PANNING), config=CONFIG, sensors=SENSORS)
    assert result.kind == "stops"
    assert pans_deg(result.snapshots) == [-40, 0, 40, 40]
    assert all(s.images == CONFIG.images_per_stop for s in result.snapshots)
    dips = [np.rad2deg(np.arcsin(s.base_from_camera[2, 2])) for s in result.snapshots]
    assert dips[3] == pytest.approx(dips[2] - 20.0, abs=0.01)
    moving = [a.stamp_ns / SECOND for a in result.set_aside]
    assert all("while the camera turned" in a.reason for a in result.set_aside)
    assert len(moving) == pytest.approx(28, abs=4)
    assert all(3 < t < 4 or 7 < t < 8 or 11 < t < 12 for t in moving)


def test_views_of_one_stop_share_its_time() -> None:
    """No moment, and with it no laser scan, belongs to two views; all of the stop is used."""
    drive = Drive(STANDING, TRIPOD, head=PANNING)
    views = take_snapshots(drive, config=CONFIG, sensors=SENSORS).snapshots
    whole = take_snapshots(Drive(STANDING, TRIPOD), config=CONFIG, sensors=SENSORS).snapshots[0]
    assert (views[0].start_ns, views[-1].end_ns) == (whole.start_ns, whole.end_ns)
    for before, after in pairwise(views):
        assert before.end_ns < after.start_ns <= before.end_ns + 1
    assert all(view.start_ns <= view.stamp_ns <= view.end_ns for view in views)


def test_the_head_looks_about_at_every_stop() -> None:
    """Four stops with two directions each are eight views, each with its own base's pose."""
    head: list[tuple[float, float, float]] = []
    for start in (0.0, 6.0, 12.0, 18.0):
        head += [(start, 30.0, 0.0), (start + 1.3, 30.0, 0.0)]
        head += [(start + 1.6, -30.0, 0.0), (start + 3.0, -30.0, 0.0)]
    result = take_snapshots(Drive(STOPS, VIDEO, head=head), config=CONFIG, sensors=SENSORS)
    assert (result.kind, pans_deg(result.snapshots)) == ("stops", [30, -30] * 4)
    yaws = [s.map_from_base.yaw for s in result.snapshots]
    np.testing.assert_allclose(yaws, np.repeat([0.0, 0.8, 1.6, 2.4], 2), atol=1e-9)


def test_one_image_a_direction() -> None:
    """Single images seconds apart, each in its own direction, are a snapshot each."""
    images = np.array([1.5, 5.5, 9.5, 13.0])
    for rate in (0.1, 20.0):
        drive = Drive(STANDING, images, head=PANNING, pose_rate=rate, wheels=False)
        result = take_snapshots(drive, config=CONFIG, sensors=SENSORS)
        assert (result.kind, len(result.snapshots)) == ("stops", 4)
        assert result.set_aside == ()


@pytest.mark.parametrize("sag_deg", [0.0, 2.0])
def test_a_head_that_jitters_or_sags_is_one_view(sag_deg: float) -> None:
    """Encoder noise and a slow drift leave each stop one view, for its whole time."""
    head = [(0.0, 0.0, 0.0), (21.0, 0.0, 4 * sag_deg)]
    drive = Drive(STOPS, VIDEO, head=head, jitter_deg=0.05)
    result = take_snapshots(drive, config=CONFIG, sensors=SENSORS)
    still = take_snapshots(Drive(STOPS, VIDEO), config=CONFIG, sensors=SENSORS)
    times = [(s.start_ns, s.end_ns) for s in result.snapshots]
    assert times == [(s.start_ns, s.end_ns) for s in still.snapshots]
    assert all("camera moved, or changed" in a.reason for a in result.set_aside)
    assert bool(result.set_aside) == (sag_deg > 0)


def test_a_direction_seen_again_counts_once() -> None:
    """Of two rests in one direction the longer is taken, and the other named."""
    head = [(0.0, 0, 0), (3.0, 0, 0), (4.0, 40, 0), (6.0, 40, 0), (7.0, 0, 0), (14.0, 0, 0)]
    result = take_snapshots(Drive(STANDING, TRIPOD, head=head), config=CONFIG, sensors=SENSORS)
    assert pans_deg(result.snapshots) == [40, 0]
    again = [a for a in result.set_aside if a.what == "viewpoint"]
    assert len(again) == 1
    assert again[0].stamp_ns < 3 * SECOND
    assert "once more" in again[0].reason


def test_a_head_that_never_rests_gives_views_by_angle() -> None:
    """A base that stands while its head sweeps without a halt still shows all that it saw."""
    sweep = [(0.0, -60.0, 0.0), (14.0, 80.0, 0.0)]
    result = take_snapshots(Drive(STANDING, TRIPOD, head=sweep), config=CONFIG, sensors=SENSORS)
    assert result.kind == "stops"
    assert np.diff(pans_deg(result.snapshots)).min() >= CONFIG.keyframe_angle_deg - 1
    assert len(result.snapshots) == pytest.approx(140 / CONFIG.keyframe_angle_deg, abs=2)
    assert len(result.snapshots) + len(result.set_aside) == len(TRIPOD)
    assert all("kept turning" in a.reason for a in result.set_aside)


def test_few_views_are_chosen_by_where_the_camera_looks() -> None:
    """Where only two may be kept, those that look apart are, and the reason holds."""
    result = take_snapshots(
        Drive(STANDING, TRIPOD, head=PANNING), config=SnapshotsConfig(maximum=2), sensors=SENSORS
    )
    assert np.ptp(pans_deg(result.snapshots)) >= 40
    dropped = [a for a in result.set_aside if a.what == "viewpoint"]
    assert len(dropped) == 2
    assert all("not among the 2 viewpoints" in a.reason for a in dropped)


@pytest.mark.parametrize(("tilted_deg", "views"), [(8.0, 1), (60.0, 3)])
def test_a_tilt_of_the_camera_is_a_new_view_and_a_nod_is_none(
    tilted_deg: float, views: int
) -> None:
    """A hand tilts its camera over a table from one place; a moving robot only nods."""
    creeping = [(0.0, 0.0, 0.0, 0.0), (2.0, 0.1, 0.0, 0.0)]
    head = [(0.0, 0.0, 0.0), (2.0, 0.0, tilted_deg)]
    drive = Drive(creeping, np.arange(1, 20) / 10, head=head)
    result = take_snapshots(drive, config=CONFIG, sensors=SENSORS)
    assert result.kind == "keyframes"
    assert len(result.snapshots) == views


def test_images_of_one_view_are_not_said_to_be_too_many() -> None:
    """A camera that is carried over a few centimetres shows one view; the limit plays no part."""
    carried = [(0.0, 0.0, 0.0, 0.0), (1.0, 0.1, 0.0, 0.0)]
    result = take_snapshots(Drive(carried, np.arange(9) / 10), config=CONFIG, sensors=SENSORS)
    assert len(result.snapshots) == 1
    assert {a.reason for a in result.set_aside} == {"it shows nothing new beside the 1 view kept"}


def test_images_without_a_pose_are_set_aside() -> None:
    """Images before the first pose are named with the frames that were missing."""
    drive = Drive(STOPS, VIDEO, pose_span=(5.0, 21.0))
    result = take_snapshots(drive, config=CONFIG, sensors=SENSORS)
    reasons = [entry.reason for entry in result.set_aside if "no pose" in entry.reason]
    assert len(reasons) == 50
    assert "'base_link' in 'map'" in reasons[0]
    assert len(result.snapshots) == 3


def test_no_pose_and_no_image_say_what_is_missing() -> None:
    """Without any pose or any depth image one sentence says where it was looked for."""
    with pytest.raises(EstimationError, match="'base_link' in 'map'"):
        take_snapshots(Drive(STOPS, VIDEO, pose_span=(50, 60)), config=CONFIG, sensors=SENSORS)
    with pytest.raises(RecordingError, match="depth images"):
        take_snapshots(Drive(STOPS, np.zeros(0)), config=CONFIG, sensors=SENSORS)


def test_combining_drops_flicker_and_averages_noise() -> None:
    """Half-seen pixels and values that swing between two surfaces go; noise falls by the root."""
    rng = np.random.default_rng(0)
    images = [(1.0 + rng.normal(0, 0.004, (60, 80))).astype(np.float32) for _ in range(10)]
    for i, image in enumerate(images):
        image[0] = 1.0 if i < 5 else 1.8
        if i < 6:
            image[1] = np.nan
        if i < 2:
            image[2] = np.nan
    combined = combine(images)
    assert np.isnan(combined[:2]).all()
    assert np.isfinite(combined[2:]).all()
    assert combined[3:].std() == pytest.approx(0.004 / np.sqrt(10), rel=0.15)


@pytest.mark.parametrize("count", [3, 5])
def test_edges_flicker_to_neither_side(count: int) -> None:
    """A pixel on a depth edge is missing, whichever of the two depths the images saw more often."""
    edge = np.full((count, 4, 4), 1.0, dtype=np.float32)
    edge[0, 0] = 2.0  # one image saw what lies behind
    edge[:, 1] = 2.0
    edge[0, 1] = 1.0  # one image saw the nearer
    edge[: count // 2 + 1, 2] = np.nan  # more than half of the images saw nothing
    combined = combine(list(edge))
    if count <= 3:
        assert np.isnan(combined[:2]).all()
    mirrored = combine(list(3.0 - edge))
    assert np.array_equal(np.isnan(mirrored[:2]), np.isnan(combined[:2]))
    assert np.isnan(combined[2]).all()
    assert np.allclose(combined[3], 1.0)


def test_where_images_are_split_the_first_decides() -> None:
    """Of two images that disagree over a pixel one is taken: an edge stays where it shows it."""
    images = np.full((2, 4, 3), 1.0, dtype=np.float32)
    images[0, 0] = np.nan
    images[1, 1] = np.nan
    images[0, 2] = 2.0
    combined = combine(list(images))
    assert np.isnan(combined[0]).all()
    assert np.allclose(combined[1:], [[1.0], [2.0], [1.0]])


def test_sigma_is_read_off_the_image() -> None:
    """Noise of 2 mm at a metre and steps of 39 mm are told from the image itself."""
    noisy = round_trip([], (0.0, 0.0), views=1, noise=0.002)[0]
    near = noisy.depth[np.abs(noisy.depth - 1.6) < 0.1]
    assert np.median(noisy.noise.sigma(near)) == pytest.approx(0.002 * 1.6**2, rel=0.25)
    coarse = round_trip([], (0.0, 0.0), views=1, noise=0.0, step=0.039)[0]
    assert np.median(coarse.noise.sigma(near)) == pytest.approx(0.039 / np.sqrt(12), rel=0.1)
    missing = replace(noisy, depth=np.full_like(noisy.depth, np.nan))
    assert np.isnan(missing.noise.sigma(missing.depth)).all()
    steps = [shot.noise.coarse_step for shot in (noisy, coarse, missing)]
    assert steps == pytest.approx([0.0, 0.039, 0.0], abs=0.001)
