"""A few depth images, also against the floor: what depth means, and which calibration is right."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tablemap.config import TopicsConfig
from tablemap.errors import ProcessWarning, RecordingError, is_doubt
from tablemap.geometry import Floats, Ints
from tablemap.recording.calibrations import Calibrations, changing, dissenting, stated
from tablemap.recording.depth import decode_depth, depth_encoding
from tablemap.recording.depth_meaning import (
    AGREED,
    DOUBTED,
    DepthMeaning,
    contradiction,
    given_meaning,
    judge,
)
from tablemap.recording.floor import MOST_VIEWS, FloorView, floor_ratio, floor_slope, thinned
from tablemap.recording.messages import (
    CameraInfo,
    CloudImage,
    CompressedImage,
    DecodingError,
    Image,
)
from tablemap.recording.roles import Roles
from tablemap.recording.tf.frame_roles import FrameNames, base_from, fixed_from_bases
from tablemap.recording.tf.frames import TransformTree
from tablemap.recording.unmeasured import filler_of, removed

_SAME_LEVEL = 0.02  # metres between the base's origin and the fixed frame's z = 0


@dataclass(frozen=True, eq=False)
class Sample:
    """A depth image as recorded and as decoded, and the (4, 4) pose of its frame in the base.

    ``base_z``: metres, the base's height in the fixed frame.
    """

    message: Image | CompressedImage
    depth: NDArray[np.float32]
    base_from_camera: Floats
    base_z: float


@dataclass(frozen=True, eq=False)
class Judged:
    """What depth means, by which calibration, and what is to be said of both.

    ``filler``: metres as decoded, the number that stands for nothing measured, if there is one.
    """

    meaning: DepthMeaning
    calibrations: Calibrations
    warnings: list[ProcessWarning]
    filler: float | None = None


def spread(stamps_ns: Ints) -> Ints:
    """Return a few of the stamps, evenly spread."""
    places = np.linspace(0, len(stamps_ns) - 1, min(MOST_VIEWS, len(stamps_ns)))
    return stamps_ns[np.unique(places.astype(np.int64))]


def sampled(
    images: Iterable[Image | CompressedImage], tree: TransformTree, names: FrameNames
) -> list[Sample]:
    """Decode images, and look up their poses; those that cannot be decoded or placed are none."""
    samples = []
    for message in images:
        stamp = np.array([message.stamp_ns])
        base, localised = fixed_from_bases(tree, names, stamp)
        mount, mounted = base_from(tree, names, names.camera, stamp)
        if not (localised[0] and mounted[0]):
            continue
        try:
            depth = decode_depth(message)
        except DecodingError:
            continue  # who reads all images says so
        samples.append(Sample(message, depth, mount[0], float(base[0, 2, 3])))
    return samples


def judged(
    samples: Sequence[Sample],
    calibrations: Calibrations,
    roles: Roles,
    config: TopicsConfig,
    *,
    is_height_known: bool,
) -> Judged:
    """Judge depth and calibration by the floor; without samples all is as recorded or as set."""
    assert roles.depth is not None
    assert isinstance(roles.depth.first, Image | CompressedImage)
    unit = 0.001 if depth_encoding(roles.depth.first) == "16UC1" else 1.0
    topic = roles.depth.name
    filler, filled = _filler(samples, topic)
    samples = [replace(each, depth=removed(each.depth, filler)) for each in samples]
    samples = _above_the_floor(samples, calibrations)
    views = _views(samples, calibrations)
    if not views:
        return Judged(given_meaning(config, unit=unit), calibrations, filled, filler)
    meaning, warnings = judge(
        views, config, unit=unit, topic=topic, is_height_known=is_height_known
    )
    others = [
        (other.name, other.first)
        for other in roles.calibrations
        if isinstance(other.first, CameraInfo)
    ]
    if not roles.is_own_calibration:
        calibrations, said = _settled(samples, calibrations, others, meaning)
        warnings += said
    if is_height_known and not any(is_doubt(warning.code) for warning in warnings):
        views = [meaning.of(view) for view in _views(samples, calibrations)]
        _, warning = contradiction(views)
        warnings += [warning] if warning is not None else []
    return Judged(meaning, calibrations, [*filled, *warnings], filler)


def _filler(samples: Sequence[Sample], topic: str) -> tuple[float | None, list[ProcessWarning]]:
    """Return the number that fills in what was not measured, and say it."""
    found = filler_of([sample.depth for sample in samples])
    if found is None:
        return None, []
    number, share = found
    message = (
        f"In all images on {topic} {100 * share:.1f} % of the pixels are {number:.3f} m to the "
        "last digit; these were taken as not measured."
    )
    return number, [ProcessWarning("recording.depth_meaning", "recording", message)]


def _views(samples: Sequence[Sample], calibrations: Calibrations) -> list[FloorView]:
    views = []
    for sample in samples:
        height, width = sample.depth.shape
        if isinstance(sample.message, CloudImage):
            views.append(thinned(sample.depth, sample.message.k, sample.base_from_camera))
            continue
        try:
            fitting = calibrations.rectification(sample.message.stamp_ns, width, height)
        except RecordingError:
            continue
        depth = fitting.apply(sample.depth)
        views.append(thinned(depth, fitting.k, sample.base_from_camera))
    return views


def _above_the_floor(samples: Sequence[Sample], calibrations: Calibrations) -> list[Sample]:
    """Return the samples with z counted from where the floor is: the base's, or the fixed frame's.

    A base whose origin is above the floor has it at z = 0 of the fixed frame.
    """
    lifted = [replace(each, base_from_camera=_raised(each)) for each in samples]
    if all(abs(sample.base_z) < _SAME_LEVEL for sample in samples):
        return list(samples)
    ratios = [
        floor_ratio(_views(choice, calibrations), along_ray=False) for choice in (samples, lifted)
    ]
    off = [abs(np.log(ratio.value)) if ratio.share else np.inf for ratio in ratios]
    return lifted if off[1] < off[0] else list(samples)


def _raised(sample: Sample) -> Floats:
    mount = sample.base_from_camera.copy()
    mount[2, 3] += sample.base_z
    return mount


def _parts(samples: Sequence[Sample], used: Calibrations) -> list[list[Sample]]:
    """Return the samples of each calibration that was valid for any of them."""
    parts: dict[int, list[Sample]] = {}
    for sample in samples:
        parts.setdefault(id(used.at(sample.message.stamp_ns)), []).append(sample)
    return list(parts.values())


def _settled(
    samples: Sequence[Sample],
    used: Calibrations,
    others: Sequence[tuple[str, CameraInfo]],
    meaning: DepthMeaning,
) -> tuple[Calibrations, list[ProcessWarning]]:
    """Return the calibration that the floor agrees with, where several disagree, and say so.

    They are on different topics, or on one that changes during the drive.
    """
    height, width = samples[0].depth.shape
    try:
        against = dissenting(used, others, width=width, height=height)
    except RecordingError:
        return used, []
    own = changing(used, width=width, height=height)
    if not (against or own):
        return used, []
    parts = _parts(samples, used if own else used.only(used.infos[0]))
    choices = [(used.topic, used)]
    choices += [(name, replace(used.only(info), topic=name)) for name, info in against]
    choices += [(f"{used.topic} {when}", used.only(info)) for when, info in own]
    doubts = []
    for _, choice in choices:
        slopes = [
            floor_slope([meaning.of(view) for view in _views(part, choice)]) for part in parts
        ]
        doubts.append(max(np.inf if slope is None else slope.doubt for slope in slopes))
    order = np.argsort(doubts, kind="stable")
    says = "; ".join(
        f"{name} says {stated(choice.infos[0], depth=used.depth)}"
        for name, choice in (choices[1:] if own else choices)
    )
    said = f"The calibrations of the depth camera disagree: {says}."
    first, second = doubts[order[0]], doubts[order[1]]
    if first < AGREED and second > DOUBTED:
        name, taken = choices[order[0]]
        if own and taken is used:
            return used, []  # the camera was set otherwise, and that was said
        message = f"{said} {name} was taken, as the floor agrees with it alone."
        return taken, [ProcessWarning("recording.calibration", "recording", message)]
    taken = "what was valid for each image" if own else used.topic
    message = (
        f"{said} {taken} was taken, and the floor does not tell which is right; "
        "--set topics.calibration=TOPIC takes another."
    )
    return used, [ProcessWarning("accuracy.calibrations_disagree", "recording", message)]
