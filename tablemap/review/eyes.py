"""Places of the viewer's eye from which the important things are large and in the picture."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tablemap import palette
from tablemap.review.pairs import FRAME
from tablemap.review.room import Eye
from tablemap.review.stream import DrawnScene

ROUND = 2.3
"""Distance of the eye, in sizes of the scene, for a view of the stops round the table."""
NEAR = 2.7
"""The same for a view of the table alone."""
WHOLE = 3.3
"""The same for the whole table with its numbers."""
ABOVE = 2.1
"""The same for the grid of pairs, from straight above."""
STEEPNESS = 1.3
"""Rise of the eye of the first view for each metre that it stands back."""
MOST_ROUND = 4.0
"""Stops farther than so many sizes of the table need not be in a view of the table."""
FARTHEST = 9.0
"""The same for a view of the stops."""
BESIDE = 0.2  # metres: the numbers beside the table
EYE_ASIDE = 0.3  # radians from straight before the table, so that two of its sides are visible
MOST_ASIDE = 0.9

GRID = (90, 90, 96, 90)

Override = rrb.EntityBehavior | rr.LineStrips3D | rr.Points3D
Overrides = dict[Any, Override]
"""By the path of the entity."""


def overview_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the first view: of the whole table and the stops round it."""
    reach = max(ROUND * _surround(scene), WHOLE * scene.extent)
    return _eye(scene, _middle(scene), reach, STEEPNESS, between_stops(scene))


def table_eye(scene: DrawnScene) -> Eye:
    """Return the eye of a view of the whole table alone."""
    return _eye(scene, scene.centre or (0.0, 0.0), WHOLE * scene.extent, STEEPNESS)


def views_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the segmented views: rather flat, as the camera looked."""
    return _eye(scene, _middle(scene), ROUND * _surround(scene), 0.8)


def stops_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the registration: all stops, almost from above."""
    return _eye(scene, _middle(scene), ROUND * _surround(scene, FARTHEST), 4.0)


def edges_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the top's edges: almost from above."""
    return _eye(scene, scene.centre or (0.0, 0.0), NEAR * scene.extent, 5.0)


def legs_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the legs."""
    return _eye(scene, scene.centre or (0.0, 0.0), NEAR * scene.extent, STEEPNESS)


def of_pairs(scene: DrawnScene, name: str) -> rrb.Spatial3DView:
    """Return the view of all aligned pairs side by side, from above."""
    height = ABOVE * (scene.pairs_reach or 1.0)
    return rrb.Spatial3DView(
        name=name,
        origin="/registration/pairs",
        spatial_information=rrb.SpatialInformation(target_frame=FRAME),
        background=palette.BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(0.0, -0.1 * height, height),
            look_target=(0.0, 0.0, 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def between_stops(scene: DrawnScene) -> float:
    """Return the angle (radians) by which the eye stands aside, so that no stop hides the table."""
    x, y = scene.centre or (0.0, 0.0)
    seen = [math.atan2(pose.y - y, pose.x - x) for pose in scene.localised]
    aside = np.linspace(EYE_ASIDE / 2, MOST_ASIDE, 40)
    if not seen:
        return EYE_ASIDE
    away = (scene.yaw - math.pi / 2 + aside)[:, None] - np.array(seen)
    gaps = np.abs((away + math.pi) % (2 * math.pi) - math.pi).min(axis=1)
    return float(aside[np.argmax(gaps)])


def _middle(scene: DrawnScene) -> tuple[float, float]:
    """Return the place at which a view of the stops round the table looks."""
    stops = [(pose.x, pose.y) for pose in scene.localised]
    if scene.centre is None:
        return tuple(np.mean(stops, axis=0).tolist()) if stops else (0.0, 0.0)
    if not stops:
        return scene.centre
    away = np.array(stops) - np.array(scene.centre)
    reach = MOST_ROUND * scene.extent
    low = np.minimum(np.clip(away, -reach, reach).min(axis=0), -scene.extent)
    high = np.maximum(np.clip(away, -reach, reach).max(axis=0), scene.extent)
    middle = np.array(scene.centre) + (low + high) / 2
    return float(middle[0]), float(middle[1])


def _surround(scene: DrawnScene, farthest: float = MOST_ROUND) -> float:
    """Return the distance of table and stops from the middle, metres, with an upper limit."""
    if not scene.localised:
        return 2 * scene.extent
    middle = np.array(_middle(scene))
    away = np.linalg.norm([pose.translation - middle for pose in scene.localised], axis=1)
    if scene.centre is None:
        return float(max(np.median(away), 2 * scene.extent))
    table = float(np.linalg.norm(np.array(scene.centre) - middle)) + scene.extent + BESIDE
    most = farthest * scene.extent
    return max(float(away[away <= most].max(initial=0.0)), table)


def _eye(
    scene: DrawnScene,
    place: tuple[float, float],
    reach: float,
    steepness: float,
    aside: float = 0.0,
) -> Eye:
    """Return an eye that looks at a place from ``reach`` metres away, the table's length across.

    ``steepness`` is the rise of the eye for each metre that it stands back; ``aside`` is the angle
    (radians) between the eye and straight before the table.
    """
    back = reach / math.hypot(1.0, steepness)
    target = (*place, 0.8 * scene.height)
    heading = scene.yaw - math.pi / 2 + (aside or EYE_ASIDE / max(steepness, 1.0) ** 2)
    position = (
        place[0] + back * math.cos(heading),
        place[1] + back * math.sin(heading),
        target[2] + steepness * back,
    )
    return Eye(position, target)


def seen_from(
    eye: Eye,
    scene: DrawnScene,
    name: str,
    contents: list[str],
    *,
    overrides: Overrides | None = None,
) -> rrb.Spatial3DView:
    """Return a 3D view in the map that begins at an eye."""
    return rrb.Spatial3DView(
        name=name,
        origin="/",
        contents=contents,
        overrides=overrides,
        background=palette.BACKGROUND,
        line_grid=rrb.LineGrid3D(color=GRID),
        spatial_information=rrb.SpatialInformation(
            target_frame=scene.names.fixed if scene.names else "map"
        ),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=eye.position,
            look_target=eye.target,
            eye_up=(0.0, 0.0, 1.0),
        ),
    )
