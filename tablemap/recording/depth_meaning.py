"""What the numbers of a depth image mean: in which unit, along what, seen from which axes.

Nothing in a recording says so but the encoding, which some drivers do not keep to. The floor tells:
distances along the rays make it bow, a wrong unit puts it at a multiple of its distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tablemap.config import TopicsConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.recording.floor import (
    HEIGHT_SIGMA,
    TILT_SIGMA,
    FloorView,
    Ratio,
    Slope,
    floor_ratio,
    floor_share,
    floor_slope,
)

BODY_FROM_OPTICAL = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""REP 103: a body looks along x, its z points up; a camera looks along z, its y points down."""

PLAUSIBLE = 0.12
"""The floor's ratio may be off by this share: TF's camera height, or a base above the floor."""
DOUBTED = 9.0
"""Chi squared of 2 degrees of freedom, from which on the floor contradicts the calibration."""
AGREED = 4.0

_UNITS = (0.0001, 0.000125, 0.0002, 0.00025, 0.0004, 0.0005)  # metres, of drivers of 16-bit depth
_UNIT_SHARE = 0.06  # the floor's ratio is within this share of a unit's
# Metres, of the median of what a camera in a room sees: the least, the most and the usual.
_NEAREST, _FARTHEST, _USUAL = 0.1, 15.0, 2.0
_LEAST_RAISED, _MOST_RAISED = 0.03, 0.6  # metres of a base's frame above the floor
_TOO_NEAR = 0.3  # of the floor's distance: the camera is higher above any table than that
_NOTHING_BEYOND = 1.5  # metres: a room is larger
_SURE = 2.0  # times as much floor as of the next reading, that makes it beyond doubt
_LIKELY = 1.4
_LEAST_FLOOR = 0.12  # of what lies below the horizon
_LEAST_TURNED = 0.2  # of what then lies below the horizon is floor, where it was none before
_EXPLAINED = 0.25  # of what contradicts may be left by a wrong focal length


@dataclass(frozen=True)
class DepthMeaning:
    """How depth as decoded becomes metres along the optical axis.

    - ``factor``: metres, as decoded, are multiplied by it
    - ``along``: whether depth is measured along the optical axis or along each ray
    - ``axes``: the axes of the camera's frame
    """

    factor: float = 1.0
    along: Literal["axis", "ray"] = "axis"
    axes: Literal["optical", "body"] = "optical"

    def metres(self, depth: NDArray[np.float32], k: Floats) -> NDArray[np.float32]:
        """Return a depth image of a pinhole ``k`` (3, 3) in metres along its axis."""
        if self.factor != 1.0:
            depth = depth * np.float32(self.factor)
        if self.along == "axis":
            return depth
        v, u = np.indices(depth.shape)
        x, y = (u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1]
        stretch = np.sqrt(x * x + y * y + 1).astype(np.float32)
        return np.asarray(depth / stretch, dtype=np.float32)

    def of(self, view: FloorView) -> FloorView:
        """Return a view as this meaning has it."""
        values = view.values * self.factor
        if self.along == "ray":
            values = values / np.linalg.norm(view.rays, axis=1)
        mount = view.base_from_camera
        if self.axes == "body":
            mount = mount @ BODY_FROM_OPTICAL
        step = view.step * self.factor
        return replace(view, values=values, base_from_camera=mount, step=step)


def given_meaning(config: TopicsConfig, *, unit: float) -> DepthMeaning:
    """Return what the settings say; ``unit`` is that of the encoding, in metres."""
    return DepthMeaning(
        factor=config.depth_unit / unit if config.depth_unit else 1.0,
        along=config.depth_along or "axis",
        axes=config.camera_axes or "optical",
    )


def judge(
    views: Sequence[FloorView],
    config: TopicsConfig,
    *,
    unit: float,
    topic: str,
    is_height_known: bool = True,
) -> tuple[DepthMeaning, list[ProcessWarning]]:
    """Tell by the floor what depth means, and say what differs from what was recorded.

    What the settings say is not judged. Where the evidence is overwhelming the meaning is another;
    where it is not, and the floor is not where it should be, that costs the verdict. Where nothing
    but a fixed frame says how high the camera is (not ``is_height_known``), scale is not judged.
    """
    given = given_meaning(config, unit=unit)
    choices = [
        replace(given, along=along, axes=axes)
        for axes in ((given.axes,) if config.camera_axes else ("optical", "body"))
        for along in ((given.along,) if config.depth_along else ("axis", "ray"))
    ]
    ratios = {choice: _ratio(views, choice) for choice in choices}
    floors = {choice: ratio for choice, ratio in ratios.items() if ratio.share >= _LEAST_FLOOR}
    if not floors:
        turned = [] if config.camera_axes else _turned(views, given, topic)
        return given, turned or _implausible(views, given, unit, topic)
    best = max(floors, key=lambda choice: floors[choice].share)
    ratio = floors[best]
    recorded = _share(views, given, ratio.value)
    if best != given and ratio.share < _LIKELY * recorded:
        best, ratio = given, ratios[given]
    scaled = is_height_known and not config.depth_unit
    factor = _unit_factor(ratio.value, unit) if scaled else None
    plausible = abs(np.log(ratio.value)) < PLAUSIBLE or factor is not None
    sure = ratio.share >= _SURE * recorded if best != given else plausible
    found = best if factor is None else replace(best, factor=factor)
    if found == given:
        return given, _off_scale(views, given, ratio, unit, topic) if scaled else []
    if not (sure and plausible):
        doubt = _said(found, given, unit, topic, ratio, recorded)
        message = f"{doubt}; this is not sure enough to change anything."
        return given, [ProcessWarning("accuracy.depth_meaning", "recording", message)]
    message = f"{_said(found, given, unit, topic, ratio, recorded)}; it was converted."
    return found, [ProcessWarning("recording.depth_meaning", "recording", message)]


def contradiction(views: Sequence[FloorView]) -> tuple[Slope | None, ProcessWarning | None]:
    """Return where the floor lies, and what is to be said where it contradicts TF."""
    slope = floor_slope(views)
    if slope is None or slope.doubt < DOUBTED:
        return slope, None
    side = "below" if slope.height < 0 else "above"
    cause = _cause(slope)
    is_level = not cause and abs(slope.tilt) < 2 * TILT_SIGMA
    raised = _if_raised(-slope.height) if is_level else ""
    message = (
        f"The floor lies {1e3 * abs(slope.height):.0f} mm {side} the base's z = 0, and is tilted "
        f"by {np.degrees(abs(slope.tilt)):.1f} degrees{cause}: check the camera's "
        f"calibration, its mounting in TF, and the depth's scale.{raised}"
    )
    return slope, ProcessWarning("accuracy.floor", "recording", message)


def _if_raised(below: float) -> str:
    """Return a sentence on a base whose frame is so many metres above the floor, if it may be."""
    if not _LEAST_RAISED < below < _MOST_RAISED:
        return ""
    return (
        f" If the base's frame is {below:.2f} m above the floor, as a base_link may be, all is "
        "right: put a base_footprint on the floor (in TF, or by --set topics.extrinsics=FILE)."
    )


def _cause(slope: Slope) -> str:
    """Say which error of the focal length would explain both height and tilt, if one does."""
    # Rays that are a share too wide see a floor that is lower, and rises ahead.
    sine, cosine = np.sin(slope.pitch), np.cos(slope.pitch)
    sigmas = np.array([HEIGHT_SIGMA, TILT_SIGMA])
    effect = np.array([-slope.camera_height * cosine**2, sine * cosine]) / sigmas
    seen = np.array([slope.height, slope.tilt]) / sigmas
    share = float(seen @ effect / (effect @ effect))
    left = seen - share * effect
    if float(left @ left) > _EXPLAINED * float(seen @ seen):
        return ""
    wrong = "short" if share > 0 else "long"
    return f", as if the focal length were {100 * abs(share):.0f} % too {wrong}"


def _turned(views: Sequence[FloorView], given: DepthMeaning, topic: str) -> list[ProcessWarning]:
    """Say where no floor is seen, and much of one if the camera is turned by right angles."""
    plain = [given.of(view) for view in views]
    best, most = np.eye(3), 0.0
    for turn in Rotation.create_group("O").as_matrix():
        mounts = [view.base_from_camera.copy() for view in plain]
        for mount in mounts:
            mount[:3, :3] = mount[:3, :3] @ turn
        seen = [
            replace(view, base_from_camera=mount) for view, mount in zip(plain, mounts, strict=True)
        ]
        ratio = floor_ratio(seen, along_ray=False)
        if ratio.share > most and abs(np.log(max(ratio.value, 1e-9))) < PLAUSIBLE:
            best, most = turn, ratio.share
    if most < _LEAST_TURNED:
        return []
    message = (
        f"No floor is seen on {topic}, but {100 * most:.0f} % of what lies below the horizon is "
        f"floor if the camera is turned {_turn_said(best)} against TF: correct the transform to "
        "the frame of its images."
    )
    return [ProcessWarning("accuracy.depth_meaning", "recording", message)]


def _turn_said(turn: Floats) -> str:
    """Say how a camera's frame is turned: by right angles, in its own axes."""
    if np.allclose(turn, BODY_FROM_OPTICAL[:3, :3].T):
        return "back from a camera's axes to a body's (TF has that turn twice)"
    vector = Rotation.from_matrix(turn).as_rotvec(degrees=True)
    degrees = float(np.linalg.norm(vector))
    axes = ("its image's rows", "its image's columns", "its optical axis")
    if np.isclose(np.abs(vector).max(), degrees):
        return f"by {degrees:.0f} degrees about {axes[int(np.argmax(np.abs(vector)))]}"
    return f"by {degrees:.0f} degrees"


def _ratio(views: Sequence[FloorView], choice: DepthMeaning) -> Ratio:
    plain = replace(choice, along="axis")
    return floor_ratio([plain.of(view) for view in views], along_ray=choice.along == "ray")


def _share(views: Sequence[FloorView], choice: DepthMeaning, ratio: float) -> float:
    plain = replace(choice, along="axis")
    return floor_share(
        [plain.of(view) for view in views],
        along_ray=choice.along == "ray",
        ratio=ratio,
        within=PLAUSIBLE,
    )


def _unit_factor(ratio: float, unit: float) -> float | None:
    """Return by what to multiply where the floor's ratio is that of another unit, else None."""
    if abs(np.log(ratio)) < PLAUSIBLE:
        return None
    units = (0.001,) if unit == 1.0 else _UNITS
    nearest = min(units, key=lambda other: abs(np.log(ratio * other / unit)))
    close = abs(np.log(ratio * nearest / unit)) < _UNIT_SHARE
    return nearest / unit if close else None


def _off_scale(
    views: Sequence[FloorView], given: DepthMeaning, ratio: Ratio, unit: float, topic: str
) -> list[ProcessWarning]:
    """Say where all lies a multiple too far or too near, beyond an error of a camera's height.

    What is too near may be a table that hides the floor, unless nothing at all is far away.
    """
    too_far = np.log(ratio.value) >= PLAUSIBLE
    values = np.concatenate([view.values for view in views]) * given.factor
    too_near = ratio.value < _TOO_NEAR and np.quantile(values, 0.99) < _NOTHING_BEYOND
    if not (too_far or too_near):
        return []
    heights = [view.base_from_camera[2, 3] for view in views]
    below = float(np.median(heights)) * (ratio.value - 1)
    message = (
        f"The floor on {topic} is {ratio.value:.2f} times as far as TF has it: check the depth's "
        f"unit (--set topics.depth_unit={_round(unit * given.factor / ratio.value):.3g} would fit) "
        f"and the camera's height in TF.{_if_raised(below)}"
    )
    return [ProcessWarning("accuracy.depth_meaning", "recording", message)]


def _round(unit: float) -> float:
    """Return the number near a unit that somebody may have chosen, else the unit to two digits."""
    power = 10.0 ** np.floor(np.log10(unit))
    chosen = [power * step for step in (1, 1.25, 2, 2.5, 4, 5, 6.25, 8, 10)]
    nearest = float(min(chosen, key=lambda each: abs(np.log(unit / each))))
    return nearest if abs(np.log(unit / nearest)) < _UNIT_SHARE else float(f"{unit:.2g}")


def _implausible(
    views: Sequence[FloorView], given: DepthMeaning, unit: float, topic: str
) -> list[ProcessWarning]:
    """Say where no floor is seen, and most depth is farther or nearer than a room's."""
    middle = float(np.median(np.concatenate([view.values for view in views]))) * given.factor
    if not np.isfinite(middle) or _NEAREST < middle < _FARTHEST:
        return []
    number = middle / given.factor / unit  # as the images have it
    choices = (0.001, 0.01) if unit == 1.0 else (*_UNITS, 0.01)
    likely = min(choices, key=lambda other: abs(np.log(number * other / _USUAL)))
    is_likely = _NEAREST < number * likely < _FARTHEST
    metres = f"{middle:.0f}" if middle > 100 else f"{middle:.3g}"
    message = (
        f"The depth on {topic} is {metres} m in the middle, which is no room: its unit is likely "
        f"another (--set topics.depth_unit={f'{likely:g}' if is_likely else 'METRES'})."
    )
    return [ProcessWarning("accuracy.depth_meaning", "recording", message)]


def _said(
    found: DepthMeaning,
    given: DepthMeaning,
    unit: float,
    topic: str,
    ratio: Ratio,
    recorded: float,
) -> str:
    parts, settings = [], []
    if found.factor != given.factor:
        parts.append(f"is in units of {1e3 * unit * found.factor:g} mm, not {1e3 * unit:g} mm")
        settings.append(f"topics.depth_unit={unit * found.factor:g}")
    if found.along != given.along:
        parts.append("is the distance along each ray, not along the optical axis")
        settings.append(f"topics.depth_along={found.along}")
    if found.axes != given.axes:
        parts.append("is stamped in a frame with a body's axes (x forward), not a camera's")
        settings.append(f"topics.camera_axes={found.axes}")
    seen = f"{100 * ratio.share:.0f} % of what lies below the horizon is then floor" + (
        f", against {100 * recorded:.0f} %" if found.factor == given.factor else ""
    )
    return (
        f"The depth on {topic} {', and '.join(parts)}, as the floor shows ({seen}); "
        f"--set {' --set '.join(settings)} says so"
    )
