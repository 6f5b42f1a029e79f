"""The errors that tablemap raises, and the warnings that a result carries."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Self


class TablemapError(Exception):
    """Something that the user can act on: what was expected, what was found, what to do next."""


class RecordingError(TablemapError):
    """The recording cannot be read, or lacks what processing needs."""


class ConfigError(TablemapError):
    """A setting is unknown or out of its range."""


class EstimationError(TablemapError):
    """The recording was read, but no table could be modelled from it."""


class ExternalToolError(TablemapError):
    """Another program (the viewer, a graphics driver, a network port) is missing or failed."""


LOSSES = ("recording.truncated", "recording.damaged")
"""Warnings that not all of a recording could be read; they make a run ``partial``."""

WARNING_CODES: dict[str, str] = {
    "recording.truncated": "The file was cut short; the part that could be read was used.",
    "recording.damaged": ("A part failed its checksum or could not be decoded; it was left out."),
    "recording.silent_sensor": (
        "The messages of a sensor are empty or impossible; they were not used."
    ),
    "recording.unread_cloud": "Point clouds of a laser are not read; a LaserScan of it is.",
    "recording.own_body": "Beams of the laser meet the robot itself; these were left out.",
    "recording.topic_choice": "Several topics fitted a role; one was chosen.",
    "snapshots.set_aside": "Depth images became no snapshot.",
    "snapshots.camera": "Values of the depth camera's kind or name took the place of defaults.",
    "snapshots.grounded": (
        "The base's height and tilt drift in the fixed frame; it was taken as level on its floor."
    ),
    "snapshots.own_body": "Depth images show the robot itself; these pixels were left out.",
    "snapshots.unused": "Snapshots do not see the table, or were not registered.",
    "registration.pair_dropped": "Pairs of snapshots disagree with the rest.",
    "legs.set_aside": "Things stand under or near the top and are no legs of it.",
    "recording.no_pose": "Depth images or a laser were left out, as their pose is unknown.",
    "recording.localisation_gap": (
        "The localisation sent nothing for a while; the wheels carried its last pose on."
    ),
    "recording.frame_name": (
        "A sensor's frame has another prefix than in TF; the one of TF was taken."
    ),
    "recording.pose_topic": "TF lacks poses; those on another topic were taken.",
    "recording.clock": (
        "A sensor's clock is off, as the motion shows, and its stamps were moved; or its messages "
        "come late, and the motion does not show which it is."
    ),
    "accuracy.clock": "A sensor's clock seems to be off, and no motion shows by how much.",
    "recording.odometry_restart": (
        "The wheel odometry starts again during the drive; its parts were joined."
    ),
    "accuracy.odometry_restart": (
        "The wheel odometry starts again after a gap in which the motion is unknown."
    ),
    "calibration.no_floor": "Too little floor was seen; the camera was not calibrated.",
    "calibration.floor_level": (
        "The floor is not at z = 0 of the fixed frame; heights are measured from the floor."
    ),
    "surface.inferred_side": "A side was seen only in part, but enough to know where it ends.",
    "accuracy.hardly_table": "The chosen surface has a front below it, like a box or a couch.",
    "accuracy.second_choice": "The likeliest surface gave no table; another one was taken.",
    "segmentation.cloth": "The table has a front below it, as of a cloth, and legs that carry it.",
    "segmentation.table_tie": "Several surfaces could be the table; one was chosen.",
    "recording.calibration": (
        "Calibrations change, were left out, or differ between topics; the message says more."
    ),
    "accuracy.calibration_flawed": (
        "The camera's distortion cannot be that of a lens; its images were taken as undistorted."
    ),
    "accuracy.calibrations_disagree": (
        "Calibrations of the depth camera disagree, and the floor does not tell which is right."
    ),
    "recording.depth_meaning": (
        "Depth has another unit, direction, frame or empty value than its encoding says; converted."
    ),
    "accuracy.depth_meaning": (
        "Depth may have another unit, direction or frame than its encoding says."
    ),
    "accuracy.floor": (
        "The floor does not lie at z = 0, or is tilted: calibration, TF or depth are wrong."
    ),
    "recording.laser_meaning": (
        "The laser's ranges or angles are in another unit than metres and radians; converted."
    ),
    "accuracy.laser_meaning": "The laser's ranges are in a unit that nothing confirms.",
    "accuracy.laser_scale": "The laser's ranges are too long or too short for the camera's depth.",
    "accuracy.tf_conflict": (
        "Two sources send one transform and disagree; the one that sent most, or last, was taken."
    ),
    "accuracy.laser_mounting": (
        "The laser's scans fit the wheels' motion only if it is mounted otherwise than TF says."
    ),
    "accuracy.few_views": "Too few views see the table to check one against another.",
    "accuracy.height_scatter": "The views disagree on the height of the top.",
    "accuracy.two_levels": (
        "A lower level lies within the top, or round it: a tray, cloth or cushion may cover it."
    ),
    "accuracy.calibration": (
        "By the floor, the camera's tilt or depth scale is implausible; it was left as recorded."
    ),
    "accuracy.top_distance": (
        "Edges and depth disagree on how far the top is: TF or the depth of the top is wrong."
    ),
    "accuracy.floor_step": (
        "The floor under the table is higher or lower than around it; the height is between them."
    ),
    "accuracy.floor_level": (
        "The floor lies centimetres above or below the base: lens, depth scale or TF are wrong."
    ),
    "odometry.bridged": "On a part of the way no laser scan could be placed; the wheels were used.",
    "odometry.left_open": (
        "The laser saw nothing that fixes the position along one direction, as in a corridor; "
        "along it the recorded motion was used."
    ),
    "odometry.no_laser": "There is no usable laser; the motion of the wheels was used.",
    "odometry.no_wheels": (
        "There is neither laser nor wheel odometry; the motion of the localisation was used."
    ),
    "odometry.wheels_disagree": (
        "Wheels and laser end up metres apart; the laser's motion was taken."
    ),
    "odometry.kept_prior": "Scans that moved too far from their prediction were placed by it.",
    "registration.no_scan": (
        "A snapshot has no usable laser scan; depth connects it to the others, or it is not used."
    ),
    "registration.depth_instead": (
        "The laser loses views that depth can place; all views were placed by depth."
    ),
    "registration.sweep": "Scans of a moving robot say no time_increment; it was estimated.",
    "registration.searched": "A snapshot started far from its place and was found by searching.",
    "accuracy.registration_failed": "A snapshot's registration failed its check; it is not used.",
    "accuracy.registration_unchecked": "The snapshots could not be checked against each other.",
    "registration.placement": (
        "The localisation disagrees with itself; the table's place in the map is uncertain."
    ),
    "accuracy.localisation": (
        "The localisation wandered by decimetres or metres: the table's place in the map is unsure."
    ),
    "outline.view_without_edges": "A view that sees the table gave no edge of its top.",
    "accuracy.unchecked_poses": (
        "No snapshot passed the registration's check; the figures rest on unchecked poses."
    ),
    "accuracy.unseen_side": "A side of the top was not seen; its place is only bounded.",
    "accuracy.inferred_side": "A side of the top was seen at one end only, or follows by symmetry.",
    "accuracy.shape_ambiguous": "Another shape explains the edges nearly as well.",
    "accuracy.no_primitive": ("No shape fits the outline; the hull of the seen top was taken."),
    "accuracy.poor_fit": (
        "The edge points scatter far more about the chosen outline than their sigma says."
    ),
    "accuracy.hidden_rim": (
        "The rim or corners of the top give no depth, or a wrong one: the edge lies farther out."
    ),
    "accuracy.outline": (
        "Over centimetres the top's edge is off the chosen outline: its shape is not on the list."
    ),
    "accuracy.inner_edge": (
        "There is an edge inside the outline: two surfaces may have been taken for one top."
    ),
    "surface.adjoining": (
        "A seat touches the table at its height; it was removed, as it has legs of its own."
    ),
    "accuracy.adjoining": (
        "A surface touches the table at its height; it was removed, as it has legs of its own."
    ),
    "accuracy.closed_body": (
        "A closed body stands under a part of the top: a cupboard may touch the table."
    ),
    "accuracy.two_tables": "The legs stand like those of two tables that were pushed together.",
    "accuracy.unsure_legs": "Things under the top may be legs; they are not in the model.",
    "accuracy.views_disagree": (
        "The views' edges fit together only with errors larger than is believed."
    ),
    "accuracy.votes_contradict": ("Top was seen outside the outline, or free space inside it."),
    "crosscheck.mounting": (
        "Camera and laser disagree by more than 5 mm: TF has a wrong pose of one of them."
    ),
    "legs.no_laser": "No laser sees the legs; they come from the depth camera alone.",
    "legs.none_found": "No leg was found.",
    "legs.inferred": "A leg that no view could see was placed by symmetry.",
    "legs.no_return": "Where legs stand or should stand, the laser's beams came back with nothing.",
    "export.assumed_thickness": "The top's thickness is not known; the configured one was written.",
    "export.outline_repaired": "The outline crosses itself; its largest part was written.",
    "export.bound": "A dimension was not seen; its bound was written.",
    "export.no_legs": "No legs were found; the top alone was written.",
    "export.verdict": "The model that was exported is doubtful or failed.",
}
"""Every warning code and what it means. Codes that doubt the figures begin with `DOUBT`."""

DOUBT = "accuracy."


def is_doubt(code: str) -> bool:
    """Tell whether a warning with this code doubts the figures."""
    return code.startswith(DOUBT)


@dataclass(frozen=True)
class WarnedPlace:
    """A line in the fixed frame that a warning is about, or an upright body over it.

    - ``points``: x and y of its corners, metres
    - ``height``: metres above the floor; None: that of the top
    - ``bottom``: metres above the floor, where the body begins; None: there is the line alone
    """

    points: tuple[tuple[float, float], ...]
    height: float | None = None
    bottom: float | None = None

    @classmethod
    def along(cls, points: Iterable[Iterable[float]], *, height: float | None = None) -> Self:
        """Return a line through points (n, 2), metres."""
        return cls(tuple((float(x), float(y)) for x, y in points), height)

    @classmethod
    def ring(cls, points: Iterable[Iterable[float]], *, height: float | None = None) -> Self:
        """Return a closed line through corners (n, 2), metres."""
        corners = cls.along(points).points
        return cls((*corners, *corners[:1]), height)

    @classmethod
    def about(cls, place: Iterable[float], radius: float, *, height: float | None = None) -> Self:
        """Return a circle about a place (2,), metres."""
        x, y = place
        turns = [2 * math.pi * k / _CIRCLE for k in range(_CIRCLE + 1)]
        circle = ((x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns)
        return cls.along(circle, height=height)

    def standing(self) -> Self:
        """Return the body that stands on the floor and reaches up to the line."""
        return replace(self, bottom=0.0)


_CIRCLE = 24  # sides of the polygon that stands for a circle


@dataclass(frozen=True)
class ProcessWarning:
    """A warning for the reader of a result.

    - ``code``: a key of `WARNING_CODES`
    - ``stage``: the stage that gives it
    - ``stamp_ns``: the sensor time that it concerns; None for all of it
    - ``places``: where it is, for drawings; empty if it is nowhere in particular
    """

    code: str
    stage: str
    message: str
    stamp_ns: int | None = None
    places: tuple[WarnedPlace, ...] = ()

    def __post_init__(self) -> None:
        if self.code not in WARNING_CODES:
            raise ValueError(f"undocumented warning code {self.code!r}")


def with_cause(sentence: str, warnings: Sequence[ProcessWarning]) -> str:
    """Return the sentence; if a warning about the recording may be its cause, the result says so.

    First comes damage, then what makes the recording doubtful.
    """
    lost = [warning.message for warning in warnings if warning.code in LOSSES]
    doubts = [
        warning.message
        for warning in warnings
        if warning.stage == "recording" and is_doubt(warning.code)
    ]
    said = (lost or doubts)[:1]
    if not said or said[0] in sentence:
        return sentence
    if not lost:
        return f"{sentence.rstrip('.')}. This may be why: {said[0]}"
    more = f" (and {len(lost) - 1} more)" if len(lost) > 1 else ""
    return f"{sentence.rstrip('.')}. The recording is damaged, which may be why: {lost[0]}{more}"


@contextmanager
def cause_named(warnings: Sequence[ProcessWarning]) -> Iterator[None]:
    """Let errors raised in this context also say what of the recording may be their cause."""
    try:
        yield
    except (RecordingError, EstimationError) as error:
        sentence = with_cause(str(error), warnings)
        if sentence == str(error):
            raise
        raise type(error)(sentence) from error
