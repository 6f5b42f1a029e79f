"""The robot's log of its drive, in time order."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from tablemap.files import whole_files
from tablemap.geometry import Floats
from tablemap.simulation import laser as scanner
from tablemap.simulation.camera import map_from, recorded_mounting
from tablemap.simulation.ros import Profile, RosMessages
from tablemap.simulation.scenario import CameraSection
from tablemap.simulation.scene import Scene
from tablemap.simulation.simulation import Simulation
from tablemap.simulation.view import View

CAMERA_FRAME = "head_rgbd_sensor_rgb_frame"
LASER_FRAME = "base_range_sensor_link"
_QUANTISATION, _DEEPEST = 100.0, 10.0
"""The transport's own, of depth in metres."""
_LATENCY = 0.03  # seconds from a message's stamp to its entry in the log
_TYPES = {
    "tf": "tf2_msgs/msg/TFMessage",
    "tf_static": "tf2_msgs/msg/TFMessage",
    "scan": "sensor_msgs/msg/LaserScan",
    "depth_info": "sensor_msgs/msg/CameraInfo",
    "colour_info": "sensor_msgs/msg/CameraInfo",
    "colour": "sensor_msgs/msg/CompressedImage",
    "compressed": "sensor_msgs/msg/CompressedImage",
    "raw": "sensor_msgs/msg/Image",
}


@dataclass(frozen=True)
class _Entry:
    """Something to be logged: ``index`` is the image, the scan, or the pose."""

    second: float
    kind: str
    index: int


def write(simulation: Simulation, path: Path, *, profile: Profile = "ros1") -> None:
    """Write the recording as MCAP and its truth beside it; each file appears only when complete.

    Images are made one at a time; a simulation gives the same bytes each time.
    """
    truth_path = path.with_name(f"{path.stem}.truth.json")
    with whole_files([truth_path, path]) as (unfinished_truth, unfinished):
        _write_mcap(simulation, unfinished, profile)
        truth = json.dumps(simulation.truth(), indent=1, allow_nan=False)
        unfinished_truth.write_text(truth + "\n", encoding="utf-8")


def _write_mcap(simulation: Simulation, path: Path, profile: Profile) -> None:
    messages = RosMessages(profile)
    topics = _topics(profile, simulation.scenario.camera)
    with path.open("wb") as stream:
        # Chunks of a few images: a reader that takes one need not unpack a megabyte of scans.
        writer = Writer(stream, chunk_size=512 * 1024, compression=CompressionType.ZSTD)
        writer.start(profile=profile, library="tablemap")
        channels: dict[str, int] = {}
        for kind, second, data in _logged(simulation, messages):
            if kind not in channels:
                name, encoding, text = messages.schema(_TYPES[kind])
                schema = writer.register_schema(name=name, encoding=encoding, data=text)
                channels[kind] = writer.register_channel(
                    topic=topics[kind],
                    message_encoding="ros1" if profile == "ros1" else "cdr",
                    schema_id=schema,
                )
            stamp_ns = simulation.stamp_ns(second)
            log_ns = stamp_ns + round(_LATENCY * 1e9)
            writer.add_message(channels[kind], log_time=log_ns, publish_time=stamp_ns, data=data)
        writer.finish()  # type: ignore[no-untyped-call]


def _topics(profile: Profile, camera: CameraSection) -> dict[str, str]:
    rectified = not any(camera.distortion)
    prefix = "/hsrb" if profile == "ros1" else ""
    head = f"{prefix}/head_rgbd_sensor"
    name = "image_rect_raw" if rectified else "image_raw"
    if camera.encoding == "32FC1":
        name = "image"
    depth = f"{head}/depth_registered/{name}"
    colour = f"{head}/rgb/" + ("image_rect_color" if rectified else "image_raw")
    return {
        "tf": "/tf",
        "tf_static": "/tf_static",
        "scan": f"{prefix}/base_scan" if profile == "ros1" else "/scan",
        "depth_info": f"{head}/depth_registered/camera_info",
        "colour_info": f"{head}/rgb/camera_info",
        "colour": f"{colour}/compressed",
        "compressed": f"{depth}/compressedDepth",
        "raw": depth,
    }


def _logged(simulation: Simulation, messages: RosMessages) -> Iterator[tuple[str, float, bytes]]:
    """Yield kind, second and bytes of every message in time order."""
    entries = [_Entry(second, "tf", i) for i, second in enumerate(simulation.belief.seconds)]
    entries += [_Entry(second, "scan", i) for i, second in enumerate(simulation.scan_seconds)]
    entries += [_Entry(second, "image", i) for i, second in enumerate(simulation.image_seconds)]
    entries.sort(key=lambda entry: (entry.second, entry.kind, entry.index))
    poses = _poses(simulation, messages)
    ranges = _scans(simulation)
    pictures = _Pictures(simulation, messages)
    laser = simulation.scenario.laser
    beam = scanner.time_increment(laser) if laser.says_times else 0.0
    yield "tf_static", entries[0].second, _static(simulation, messages)
    for entry in entries:
        stamp_ns = simulation.stamp_ns(entry.second)
        if entry.kind == "tf":
            yield "tf", entry.second, poses[entry.index]
        elif entry.kind == "scan":
            yield (
                "scan",
                entry.second,
                messages.laser_scan(
                    stamp_ns,
                    LASER_FRAME,
                    ranges[entry.index],
                    angles=(scanner.ANGLE_MIN, scanner.ANGLE_MAX, scanner.INCREMENT),
                    times=(beam, laser.turn_seconds),
                    limits=(scanner.RANGE_MIN, scanner.RANGE_MAX),
                ),
            )
        else:
            for kind, data in pictures.taken(entry.second):
                yield kind, entry.second, data


def _scans(simulation: Simulation) -> NDArray[np.float32]:
    """Return the (n, beams) ranges of all scans; those after the furniture moved see it moved."""
    seconds = simulation.scan_seconds
    ranges = np.zeros((len(seconds), scanner.BEAMS), dtype=np.float32)
    if len(seconds) == 0:
        return ranges
    rng = simulation.generator("scans")
    for moved in (False, True):
        chosen = (seconds >= simulation.moved_second) == moved
        if not chosen.any():
            continue
        solid = [part for part in simulation.parts(moved=moved) if not part.glass]
        ranges[chosen] = scanner.scan(
            Scene(solid),
            simulation.world.people,
            simulation.drive,
            simulation.attitude,
            seconds[chosen],
            laser=simulation.scenario.laser,
            errors=simulation.laser_errors,
            rng=rng,
        )
    return ranges


class _Pictures:
    """Takes images one after the other; a stop's view is cast once for all of its images."""

    def __init__(self, simulation: Simulation, messages: RosMessages) -> None:
        self._simulation = simulation
        self._messages = messages
        self._camera = simulation.camera
        self._rng = simulation.generator("images")
        glass = [part for part in simulation.world.parts if part.glass]
        self._glass = Scene(glass) if glass else None
        self._view: View | None = None
        self._colour_given: set[int] = set()

    def taken(self, second: float) -> Iterator[tuple[str, bytes]]:
        """Yield the messages of the image at a time: calibration, depth, at times colour."""
        simulation, messages, camera = self._simulation, self._messages, self._camera
        robot = simulation.scenario.robot
        stamp_ns = simulation.stamp_ns(second)
        view = self._seen(second)
        size = {"width": camera.width, "height": camera.height}
        d = np.array(simulation.scenario.camera.distortion)
        info = messages.camera_info(stamp_ns, CAMERA_FRAME, **size, k=camera.recorded_k, d=d)
        yield "depth_info", info
        depth = camera.depth(view, self._rng, progress=second / simulation.drive.duration)
        if robot.depth_transport == "raw":
            yield "raw", messages.image(stamp_ns, CAMERA_FRAME, depth)
        else:
            encoding, data = _compressed(depth)
            yield "compressed", messages.compressed_image(stamp_ns, CAMERA_FRAME, encoding, data)
        rest = simulation.rest_at(second)
        if robot.colour and rest not in self._colour_given:
            self._colour_given.add(rest)
            picture = camera.colour(view, self._rng)
            data = _encoded(picture, "JPEG", quality=80)
            encoding = "rgb8; jpeg compressed bgr8"
            yield "colour_info", info
            yield "colour", messages.compressed_image(stamp_ns, CAMERA_FRAME, encoding, data)

    def _seen(self, second: float) -> View:
        simulation = self._simulation
        pose = simulation.map_from_camera(second)
        scene = simulation.scene(second)
        view = self._view
        if view is None or view.scene is not scene or (view.map_from_camera != pose).any():
            view = self._camera.view(scene, self._glass, pose)
        self._view = view
        return view


def _static(simulation: Simulation, messages: RosMessages) -> bytes:
    stamp_ns = simulation.stamp_ns(simulation.belief.seconds[0])
    none, identity = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    edges = [(stamp_ns, "base_footprint", "base_link", none, identity)]
    if simulation.scenario.robot.laser:
        edges.append((stamp_ns, "base_link", LASER_FRAME, np.array(scanner.MOUNT), identity))
    return messages.transforms(edges)


def _poses(simulation: Simulation, messages: RosMessages) -> list[bytes]:
    """Return the TF message of every time at which the robot publishes its pose."""
    belief, height = simulation.belief, simulation.scenario.robot.camera_height
    tilts, pans = simulation.drive.tilt(belief.seconds), simulation.drive.pan(belief.seconds)
    heads = np.stack(
        [
            map_from(np.array([0.0, 0.0, pan]), recorded_mounting(height, tilt))
            for tilt, pan in zip(tilts, pans, strict=True)
        ]
    )
    attitudes = Rotation.from_matrix(heads[:, :3, :3]).as_quat()
    serialised = []
    for i, second in enumerate(belief.seconds):
        stamp_ns = simulation.stamp_ns(second)
        edges = [(stamp_ns, "base_link", CAMERA_FRAME, heads[i, :3, 3], attitudes[i])]
        if simulation.scenario.robot.wheels:
            edges += [
                (stamp_ns, "map", "odom", *_planar(belief.map_from_odom[i])),
                (stamp_ns, "odom", "base_footprint", *_planar(belief.odom_from_base[i])),
            ]
        else:
            edges.append((stamp_ns, "map", "base_footprint", *_planar(belief.map_from_base[i])))
        serialised.append(messages.transforms(edges))
    return serialised


def _planar(pose: Floats) -> tuple[Floats, Floats]:
    half = pose[2] / 2
    return np.array([pose[0], pose[1], 0.0]), np.array([0.0, 0.0, np.sin(half), np.cos(half)])


def _compressed(depth: NDArray[np.uint16] | NDArray[np.float32]) -> tuple[str, bytes]:
    """Return format and data in the layout of compressed_depth_image_transport.

    The data are twelve bytes of header and a PNG. The PNG has millimetres, or A / z + B: this is
    the inverse depth, in steps that are finer at small distances.
    """
    if depth.dtype == np.uint16:
        millimetres = depth.astype(np.uint16, copy=False)
        png = _encoded(millimetres, "PNG", compress_level=4)
        return "16UC1; compressedDepth png", bytes(12) + png
    a = _QUANTISATION * (_QUANTISATION + 1)
    b = 1 - a / _DEEPEST
    known = np.isfinite(depth) & (depth > 0) & (depth < _DEEPEST)
    steps = np.where(known, np.rint(a / np.where(known, depth, 1.0) + b), 0).astype(np.uint16)
    header = struct.pack("<iff", 0, a, b)
    return "32FC1; compressedDepth png", header + _encoded(steps, "PNG", compress_level=4)


def _encoded(
    pixels: NDArray[np.uint16] | NDArray[np.uint8], file_format: str, **options: int
) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, file_format, **options)
    return stream.getvalue()
