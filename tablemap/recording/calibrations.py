"""A depth camera's calibrations over the drive, and the valid one for each image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tablemap.errors import ProcessWarning, RecordingError
from tablemap.geometry import Floats
from tablemap.recording.messages import CameraInfo
from tablemap.recording.rectification import (
    Rectification,
    flaw,
    is_rectified,
    rectification,
    used_matrix,
)
from tablemap.words import counted

SAME_SHARE = 0.005
"""Largest difference of equal focal lengths and principal points, as a share of the image."""
LONE_MESSAGES, LONE_SHARE = 2, 5
"""What so few messages say against so many times as many others was damaged on its way."""


@dataclass(frozen=True, eq=False)
class Calibrations:
    """The different calibrations; each is valid from its stamp until that of the next one.

    - ``topic``: where they were published
    - ``depth``: topic of the images that they are for
    - ``infos``: in time order
    - ``known``: rectifications by calibration and image size, each made once
    """

    topic: str
    depth: str
    infos: tuple[CameraInfo, ...]
    known: dict[tuple[int, int, int], Rectification | None] = field(default_factory=dict)

    def at(self, stamp_ns: int) -> CameraInfo:
        """Return the calibration that was valid at a stamp."""
        return self.infos[self._index(stamp_ns)]

    def only(self, info: CameraInfo) -> Calibrations:
        """Return them with one that is valid for the whole drive."""
        return replace(self, infos=(info,), known={})

    def shifted(self, offset_ns: int) -> Calibrations:
        """Return them with an offset added to their stamps."""
        moved = (replace(info, stamp_ns=info.stamp_ns + offset_ns) for info in self.infos)
        return replace(self, infos=tuple(moved))

    def rectification(self, stamp_ns: int, width: int, height: int) -> Rectification:
        """Return the rectification of an image of a size, by the calibration valid at its stamp.

        If that calibration is for another size, the nearest one in time that fits is taken, as
        image and calibration do not always change at the same time. Raises `RecordingError` if none
        fits.
        """
        valid = self._index(stamp_ns)
        nearest = sorted(range(len(self.infos)), key=lambda i: (abs(i - valid), i))
        for index in nearest:
            found = self._fitting(index, width, height)
            if found is not None:
                return found
        return rectification(self.infos[valid], width=width, height=height, topic=self.depth)

    def _index(self, stamp_ns: int) -> int:
        stamps = [info.stamp_ns for info in self.infos]
        return max(int(np.searchsorted(stamps, stamp_ns, side="right")) - 1, 0)

    def _fitting(self, index: int, width: int, height: int) -> Rectification | None:
        key = (index, width, height)
        if key not in self.known:
            try:
                self.known[key] = rectification(
                    self.infos[index], width=width, height=height, topic=self.depth
                )
            except RecordingError:
                self.known[key] = None
        return self.known[key]


def valid_calibrations(
    infos: Sequence[CameraInfo], *, topic: str, depth: str, counts: Sequence[int] | None = None
) -> tuple[Calibrations, list[ProcessWarning]]:
    """Return the valid calibrations in time order, and warnings about the others.

    ``counts`` are the messages that said each: what hardly one says against many does not count.
    Drivers publish zeros until they know the calibration. If only the distortion is wrong, the
    images are taken as undistorted, with a warning that lowers the verdict.
    """
    rectified = is_rectified(depth)
    said: list[ProcessWarning] = []
    infos, lone = _without_lone(infos, counts or [1] * len(infos), rectified=rectified)
    if lone:
        message = f"{lone} calibrations on {topic} contradict all others there, and were left out."
        said.append(ProcessWarning("recording.calibration", "recording", message))
    ordered = sorted(infos, key=lambda info: info.stamp_ns)
    flaws = [flaw(info, rectified=rectified) for info in ordered]
    sound = [info for info, what in zip(ordered, flaws, strict=True) if what is None]
    if not sound:
        straight = [replace(info, d=np.zeros(0)) for info in ordered]
        sound = [info for info in straight if flaw(info, rectified=rectified) is None]
        if not sound:
            return Calibrations(topic, depth, tuple(ordered)), []  # the first image says why
        message = f"The calibration on {topic} {flaws[0]}; the images were taken as undistorted."
        said.append(ProcessWarning("accuracy.calibration_flawed", "recording", message))
    elif len(sound) < len(ordered):
        first = next(what for what in flaws if what is not None)
        message = (
            f"{len(ordered) - len(sound)} of {len(ordered)} different calibrations on {topic} were "
            f"left out, the first of which {first}."
        )
        said.append(ProcessWarning("recording.calibration", "recording", message))
    sound = [info for i, info in enumerate(sound) if i == 0 or not is_same(info, sound[i - 1])]
    if len(sound) > 1:
        message = (
            f"The calibration on {topic} changes {counted(len(sound) - 1, 'time')} during the "
            "drive; each image is taken with the one that was valid for it."
        )
        said.append(ProcessWarning("recording.calibration", "recording", message))
    return Calibrations(topic, depth, tuple(sound)), said


def _without_lone(
    infos: Sequence[CameraInfo], counts: Sequence[int], *, rectified: bool
) -> tuple[list[CameraInfo], int]:
    """Return the calibrations without sound ones that hardly a message said, and those messages."""
    different: list[CameraInfo] = []
    which = []
    for info in infos:
        same = (i for i, other in enumerate(different) if is_same(info, other))
        which.append(next(same, len(different)))
        if which[-1] == len(different):
            different.append(info)
    totals = np.bincount(which, weights=counts)
    few = (totals <= LONE_MESSAGES) & (totals * LONE_SHARE <= totals.max())
    lone = [
        bool(few[group]) and flaw(info, rectified=rectified) is None
        for info, group in zip(infos, which, strict=True)
    ]
    kept = [info for info, out in zip(infos, lone, strict=True) if not out]
    return kept, sum(number for number, out in zip(counts, lone, strict=True) if out)


def is_same(first: CameraInfo, second: CameraInfo) -> bool:
    """Tell whether two calibrations are equal but for their stamps."""
    return (first.width, first.height, first.binning, first.roi, first.distortion_model) == (
        second.width,
        second.height,
        second.binning,
        second.roi,
        second.distortion_model,
    ) and all(
        np.array_equal(getattr(first, name), getattr(second, name), equal_nan=True)
        for name in ("k", "d", "r", "p")
    )


def apart(first: Floats, second: Floats, width: int, height: int) -> float:
    """Return the difference of two pinholes (3, 3) of one image, as a share of it.

    It is the larger one of the differences of the focal lengths and of the principal points.
    """
    focal = np.abs(np.array([second[0, 0] / first[0, 0], second[1, 1] / first[1, 1]]) - 1)
    middle = np.abs(second[:2, 2] - first[:2, 2]) / (width, height)
    return float(max(focal.max(), middle.max()))


def dissenting(
    used: Calibrations, others: Sequence[tuple[str, CameraInfo]], *, width: int, height: int
) -> list[tuple[str, CameraInfo]]:
    """Return the names of other calibrations of the same image that differ.

    ``others`` are the calibrations of the same frame on other topics. K and P of one calibration
    may differ, too, although nothing is distorted.
    """
    rectified = is_rectified(used.depth)
    info = used.infos[0]
    own = used.rectification(info.stamp_ns, width, height).k
    found = []
    undistorted = not np.any(np.nan_to_num(info.d)) and np.allclose(info.r, np.eye(3), atol=1e-6)
    if undistorted and info.p[0, 0] > 0 and info.p[1, 1] > 0:
        letter, matrix = ("K", info.k) if rectified else ("P", info.p[:, :3])
        other_one = replace(info, k=matrix, p=np.column_stack([matrix, np.zeros(3)]))
        others = [(f"{letter} of {used.topic}", other_one), *others]
    for name, other in others:
        try:
            if flaw(other, rectified=rectified) is not None:
                continue
            theirs = rectification(other, width=width, height=height, topic=used.depth).k
        except RecordingError:
            continue
        if apart(own, theirs, width, height) > SAME_SHARE:
            found.append((name, other))
    return found


def changing(used: Calibrations, *, width: int, height: int) -> list[tuple[str, CameraInfo]]:
    """Return calibrations of one image that differ during the drive, each with when it came.

    There are none where no calibration changes, or each change is of another window or binning of
    the sensor. A lens does not change: a setting that zooms does, or one of them is wrong.
    """
    first = used.infos[0]
    found: list[tuple[str, CameraInfo]] = []
    pinholes: list[Floats] = []
    for info in used.infos:
        if (info.width, info.height, info.binning, info.roi) != (
            first.width,
            first.height,
            first.binning,
            first.roi,
        ):
            continue
        try:
            k = rectification(info, width=width, height=height, topic=used.depth).k
        except RecordingError:
            continue
        if all(apart(other, k, width, height) > SAME_SHARE for other in pinholes):
            pinholes.append(k)
            seconds = (info.stamp_ns - first.stamp_ns) / 1e9
            found.append((f"from {seconds:.1f} s on" if seconds else "at first", info))
    return found if len(found) > 1 else []


def stated(info: CameraInfo, *, depth: str) -> str:
    """Return words for the pinhole of a calibration."""
    k = used_matrix(info, rectified=is_rectified(depth))
    return f"f {k[0, 0]:.1f}, {k[1, 1]:.1f}, c {k[0, 2]:.1f}, {k[1, 2]:.1f}"
