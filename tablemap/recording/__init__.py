"""MCAP in, sensor messages out."""

from __future__ import annotations

from tablemap.inputs import sha256
from tablemap.recording.converting import Conversion, convert
from tablemap.recording.info import RecordingInfo, inspect
from tablemap.recording.messages import (
    CameraInfo,
    CompressedImage,
    Image,
    LaserScan,
    TransformStamped,
)
from tablemap.recording.reader import Recording, open_recording
from tablemap.recording.streams import DepthFrame
from tablemap.recording.tf.frame_roles import FrameNames

__all__ = [
    "CameraInfo",
    "CompressedImage",
    "Conversion",
    "DepthFrame",
    "FrameNames",
    "Image",
    "LaserScan",
    "Recording",
    "RecordingInfo",
    "TransformStamped",
    "convert",
    "inspect",
    "open_recording",
    "sha256",
]
