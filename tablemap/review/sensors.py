"""The recorded data: frames, scans, depth and colour."""

from __future__ import annotations

import numpy as np
import rerun as rr

from tablemap import palette
from tablemap.geometry import Floats, Ints, invert, transform
from tablemap.recording import FrameNames, Recording
from tablemap.recording.messages import Image, LaserScan
from tablemap.review import text
from tablemap.review.clouds import raised
from tablemap.review.images import colour_archetype, colour_size, depth_archetype
from tablemap.review.stream import Stream, sensor_times
from tablemap.stages.snapshots import SetAside, Snapshot, Snapshots

SCAN_SEARCH_NS = 200_000_000
IMAGE_PLANE = "_image_plane"
HEADING_LENGTH = 0.35
MOST_POSES = 500  # of the frame tree, as each pose makes the file larger


def log_recording(stream: Stream, recording: Recording) -> None:
    """Log the recorded frames over time, and in full every image and scan."""
    _log_frames(stream, recording, frame_stamps(recording))
    stream.hold()
    stream.log(
        "robot/heading",
        rr.Arrows3D(
            vectors=[[HEADING_LENGTH, 0, 0]],
            colors=[palette.LOCALISED.on_dark],
            labels=["base as localised"],
            show_labels=False,
        ),
        frame=recording.names.base,
    )
    if stream.config.level == "full":
        for scan in recording.scans():
            stream.at(scan.stamp_ns)
            _log_scan(stream, recording, scan)
        for frame in recording.depth_frames():
            stream.at(frame.stamp_ns)
            stream.transform(
                "tf/camera", recording.names.base, recording.names.camera, frame.base_from_camera
            )
            _log_pinhole(stream, recording.names, frame.k, frame.depth.shape)
            stream.log(
                "camera/depth",
                depth_archetype(frame.message, frame.depth),
                frame=recording.names.camera + IMAGE_PLANE,
            )


def frame_stamps(recording: Recording) -> Ints:
    """Return the times at which the frames are drawn."""
    stamps = np.unique(np.concatenate([recording.pose_stamps(), recording.depth_stamps()]))
    return stamps[:: max(1, -(-len(stamps) // MOST_POSES))]


def nearest_scan(recording: Recording, stamp_ns: int) -> LaserScan | None:
    """Return the scan nearest to a time, if there is one near enough."""
    scans = recording.scans(stamp_ns - SCAN_SEARCH_NS, stamp_ns + SCAN_SEARCH_NS)
    return min(scans, key=lambda scan: abs(scan.stamp_ns - stamp_ns), default=None)


def _log_frames(stream: Stream, recording: Recording, stamps_ns: Ints) -> None:
    names = recording.names
    bases, known = recording.fixed_from_bases(stamps_ns)
    odoms, rolled = recording.odom_from_bases(stamps_ns)
    if names.odom:
        known = known & rolled
    if not known.any():
        return
    times = sensor_times(stamps_ns[known].tolist())
    bases, odoms = bases[known], odoms[known]
    if names.odom and names.odom != names.fixed:
        corrections = bases @ np.array([invert(odom) for odom in odoms])
        stream.transforms("tf/odom", names.fixed, names.odom, times, corrections)
        stream.transforms("tf/base", names.odom, names.base, times, odoms)
    else:
        stream.transforms("tf/base", names.fixed, names.base, times, bases)


def log_snapshots(stream: Stream, taken: Snapshots) -> None:
    """Log every viewpoint, and the images that were not used with their reasons."""
    for snapshot in taken.snapshots:
        log_snapshot(stream, snapshot)
    for one in taken.set_aside:
        log_set_aside(stream, one)
    stream.scene.told = text.snapshots(taken)


def log_snapshot(stream: Stream, snapshot: Snapshot) -> None:
    """Log one viewpoint as recorded: camera pose, depth, colour and the scan at that time."""
    scene = stream.scene
    if not scene.stamps_ns and scene.start_ns == 0:
        scene.start_ns = snapshot.start_ns
    scene.stamps_ns.append(snapshot.stamp_ns)
    scene.localised.append(snapshot.map_from_base)
    scene.cameras.append((snapshot.base_from_camera, _frustum(snapshot)))
    stream.at(snapshot.stamp_ns, snapshot=snapshot.index)
    names = scene.names or FrameNames("map", None, "base", "camera", None)
    _log_pose(stream, names, snapshot)
    log_images(stream, snapshot)
    if scene.recording is not None and names.laser:
        nearest = nearest_scan(scene.recording, snapshot.stamp_ns)
        if nearest is not None:
            _log_scan(stream, scene.recording, nearest)


def log_images(stream: Stream, snapshot: Snapshot) -> None:
    """Log depth and colour as recorded, at the stream's time, with the camera that took them."""
    scene = stream.scene
    names = scene.names or FrameNames("map", None, "base", "camera", None)
    height, width = snapshot.depth.shape
    camera = snapshot.camera
    k = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    plane = names.camera + IMAGE_PLANE
    _log_pinhole(stream, names, k, (height, width))
    depth = depth_archetype(snapshot.depth_message, snapshot.depth)
    stream.log("camera/depth", depth, frame=plane)
    _log_mended(stream, snapshot, plane)
    message = snapshot.colour_message
    if message is None:
        return
    colour = colour_archetype(message)
    if colour is None:
        form = message.encoding if isinstance(message, Image) else message.format
        said = f"colour image not shown: its encoding is {form!r}"
        stream.say(said)
        return
    scene.has_colour = True
    scene.colour_fits &= message.frame_id == snapshot.depth_message.frame_id and colour_size(
        message
    ) == (width, height)
    if scene.colour_fits:
        stream.log("camera/colour", colour, frame=plane)
    else:
        stream.log_flat("camera/colour", colour)


def _log_mended(stream: Stream, snapshot: Snapshot, plane: str) -> None:
    """Mark the mended pixels: the depth image is shown as it was recorded."""
    mended = snapshot.mended
    if mended is None:
        if not stream.scene.is_mended:
            return
        mended = np.zeros(snapshot.depth.shape, dtype=bool)  # those of the view before would stay
    elif not stream.scene.is_mended:
        stream.scene.is_mended = True
        clear, marked = (0, "as recorded", (0, 0, 0, 0)), (1, "mended", palette.MENDED.on_dark)
        stream.rec.log("camera/mended", rr.AnnotationContext([clear, marked]), static=True)
    stream.log("camera/mended", rr.SegmentationImage(mended.astype(np.uint8)), frame=plane)


def log_set_aside(stream: Stream, one: SetAside) -> None:
    """Log an image that was not used, and why, at its time."""
    stream.at(one.stamp_ns, snapshot=one.index)
    stream.say(f"{one.what} set aside: {one.reason}")


def _log_pose(stream: Stream, names: FrameNames, snapshot: Snapshot) -> None:
    """Log the camera's pose in the base, whatever frames lie between both in the recording."""
    map_from_base = snapshot.map_from_base.lifted()
    recording = stream.scene.recording
    recorded = recording.fixed_from_base(snapshot.stamp_ns) if recording else None
    odom = recording.odom_from_base(snapshot.stamp_ns) if recording and names.odom else None
    base = map_from_base if recorded is None else recorded
    if odom is not None and names.odom and names.odom != names.fixed:
        stream.transform("tf/odom", names.fixed, names.odom, base @ invert(odom))
        stream.transform("tf/base", names.odom, names.base, odom)
    else:
        stream.transform("tf/base", names.fixed, names.base, base)
    camera = invert(base) @ map_from_base @ snapshot.base_from_camera
    stream.transform("tf/camera", names.base, names.camera, camera)


def _log_pinhole(stream: Stream, names: FrameNames, k: Floats, shape: tuple[int, ...]) -> None:
    stream.rec.log(
        "camera",
        rr.Pinhole(
            image_from_camera=k,
            height=shape[0],
            width=shape[1],
            parent_frame=names.camera,
            child_frame=names.camera + IMAGE_PLANE,
            image_plane_distance=0.25,
            color=palette.TEXT.on_dark,
        ),
    )


def _log_scan(stream: Stream, recording: Recording, scan: LaserScan) -> None:
    laser = recording.names.laser
    if laser is None:
        return
    base_from_laser = recording.base_from_laser(scan.stamp_ns)
    stream.scene.laser_height = float(base_from_laser[2, 3])
    stream.transform("tf/laser", recording.names.base, laser, base_from_laser)
    stream.log("laser/scan", scan_points(scan), frame=laser)


def scan_points(scan: LaserScan) -> rr.Points3D:
    """Return where a scan's beams hit something, in the laser's frame."""
    ranges = scan.ranges.astype(np.float64)
    hit = np.isfinite(ranges) & (ranges > scan.range_min) & (ranges < scan.range_max)
    beams = np.column_stack([np.cos(scan.angles), np.sin(scan.angles)])[hit] * ranges[hit, None]
    return rr.Points3D(
        raised(beams, 0.0), colors=[palette.LASER.on_dark], radii=rr.Radius.ui_points(1.5)
    )


def _frustum(snapshot: Snapshot) -> Floats:
    """Return the (5, 3) corners of the camera's view at a depth of 1 m, its centre first."""
    camera = snapshot.camera
    u = (np.array([0, camera.width, camera.width, 0]) - camera.cx) / camera.fx
    v = (np.array([0, 0, camera.height, camera.height]) - camera.cy) / camera.fy
    corners = np.column_stack([u, v, np.ones(4)])
    return transform(snapshot.base_from_camera, np.concatenate([np.zeros((1, 3)), corners]))
