"""The mounting of sensors, from a TOML or a URDF file.

TOML::

    [[transform]]
    parent = "base_link"
    child = "camera_link"
    xyz = [0.1, 0.0, 1.1]     # metres
    rpy = [0.0, 0.5, 0.0]     # radians about x, y, z; or quaternion = [x, y, z, w]

In a URDF only fixed joints count, as the state of a moving joint is only in TF.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from tablemap.errors import RecordingError
from tablemap.files import read_text
from tablemap.recording.messages import TransformStamped

_KEYS = {"parent", "child", "xyz", "rpy", "quaternion"}


def read_extrinsics(file: Path) -> tuple[TransformStamped, ...]:
    """Return the static transforms of a file. Raises `RecordingError` if it has another format."""
    try:
        text = read_text(file)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecordingError(f"The extrinsics cannot be read ({reason}): {file}") from error
    try:
        found = tuple(_of_urdf(text) if text.lstrip().startswith("<") else _of_toml(text))
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        RecursionError,
        ElementTree.ParseError,
    ) as error:
        raise RecordingError(
            "Expected extrinsics as [[transform]] tables in TOML (parent, child, xyz, and rpy or "
            f"quaternion) or as a URDF, and found something else ({error}): {file}"
        ) from error
    if not found:
        raise RecordingError(f"The extrinsics tell no transform: {file}")
    return found


def _of_toml(text: str) -> Iterator[TransformStamped]:
    for each in tomllib.loads(text)["transform"]:
        if unknown := set(each) - _KEYS:
            raise ValueError(f"unknown key {sorted(unknown)[0]!r}")
        turn = _numbers(each["quaternion"], 4) if "quaternion" in each else None
        rpy = _numbers(each.get("rpy", (0, 0, 0)), 3)
        yield _transform(each["parent"], each["child"], _numbers(each["xyz"], 3), rpy, turn)


def _of_urdf(text: str) -> Iterator[TransformStamped]:
    robot = ElementTree.fromstring(text)
    if robot.tag != "robot":
        raise ValueError(f"its root is <{robot.tag}>")
    for joint in robot.iter("joint"):
        if joint.get("type") != "fixed":
            continue
        parent, child, origin = joint.find("parent"), joint.find("child"), joint.find("origin")
        if parent is None or child is None:
            raise ValueError(f"the joint {joint.get('name')!r} has no parent or no child")
        place = {} if origin is None else origin.attrib
        yield _transform(
            parent.attrib["link"],
            child.attrib["link"],
            _numbers(place.get("xyz", "0 0 0").split(), 3),
            _numbers(place.get("rpy", "0 0 0").split(), 3),
            None,
        )


def _transform(
    parent: str, child: str, xyz: list[float], rpy: list[float], turn: list[float] | None
) -> TransformStamped:
    rotation = Rotation.from_quat(turn) if turn else Rotation.from_euler("xyz", rpy)
    x, y, z, w = map(float, rotation.as_quat())
    parent, child = str(parent).lstrip("/"), str(child).lstrip("/")
    if not parent or not child or parent == child:
        raise ValueError(f"a transform from {parent!r} to {child!r}")
    return TransformStamped(0, parent, child, (xyz[0], xyz[1], xyz[2]), (x, y, z, w), True)


def _numbers(given: Sequence[Any], count: int) -> list[float]:
    numbers = [float(each) for each in given]
    if len(numbers) != count or not np.all(np.isfinite(numbers)):
        raise ValueError(f"expected {count} numbers, found {given!r}")
    return numbers
