"""Places of the viewer's eye from which the important things are large and in the picture."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tablemap import palette
from tablemap.geometry import Floats, transform
from tablemap.review.clouds import raised
from tablemap.review.pairs import FRAME
from tablemap.review.room import LOW, Eye, Size
from tablemap.review.scene import DrawnScene

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
FITTING = 8  # steps that fit an eye to what it should show
FILLED = 0.76  # of a picture's width or height: the rest is for names
CAMERA = 0.2  # metres, depth of a stop's camera as drawn
MOST_OF_TOP = 0.9  # of its reach: its outline lies within

GRID = (90, 90, 96, 90)

Override = rrb.EntityBehavior | rr.LineStrips3D | rr.Points3D
Overrides = dict[Any, Override]
"""By the path of the entity."""


def overview_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the first view: of the whole table and the stops round it."""
    scene = _of_all_found(scene)
    return _overview_eye(scene, between_stops(scene))


def _fitted(scene: DrawnScene, eye: Eye, size: Size) -> Eye:
    """Return an eye that looks the same way, moved so that table and stops fill the picture.

    Stops farther away than others are where a view of all would show too little are left out.
    """
    around = _around(scene)
    for _ in range(FITTING):
        pixels, _ = eye.pixels(around, size)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        middle = np.array(eye.target)
        aside = eye.beside(middle, (low + high) / 2 - np.array(size) / 2, size) - middle
        back = np.subtract(eye.position, eye.target)
        # On the level of the target: what lies above the middle of the picture is farther away.
        ahead = aside - back * (aside[2] / back[2])
        share = float(np.max((high - low) / (FILLED * np.array(size))))
        target = middle + ahead
        eye = Eye(_triple(target + share * back), _triple(target))
    return eye


def _triple(point: Floats) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])


def _around(scene: DrawnScene) -> Floats:
    """Return points (n, 3) that a view of table and stops should show."""
    turns = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    centre = np.array(scene.centre or _middle(scene))
    table = raised(centre + (scene.extent + BESIDE) * ring, scene.height)
    bases = np.array([pose.translation for pose in scene.localised]).reshape(-1, 2)
    cameras = _cameras(scene)[:, 0]
    points = np.concatenate([raised(bases, scene.floor_z), cameras, table])
    away = np.linalg.norm(points[:, :2] - centre, axis=1)
    if scene.centre is not None:
        points = points[away <= FARTHEST * scene.extent]
    return points.astype(np.float64)


def _overview_eye(scene: DrawnScene, aside: float) -> Eye:
    reach = max(ROUND * _surround(scene), WHOLE * scene.extent)
    return _eye(scene, _middle(scene), reach, STEEPNESS, aside)


def table_eye(scene: DrawnScene) -> Eye:
    """Return the eye of a view of the whole table alone."""
    return _eye(scene, scene.centre or (0.0, 0.0), WHOLE * scene.extent, STEEPNESS)


def views_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the segmented views: rather flat, as the camera looked."""
    scene = _of_all_found(scene)
    return _eye(scene, _middle(scene), ROUND * _surround(scene), 0.8)


def _of_all_found(scene: DrawnScene) -> DrawnScene:
    """Return a scene whose table is all that was found: where none was a table, that is of use."""
    if not scene.failed or scene.found is None:
        return scene
    centre, extent = scene.found
    return replace(scene, centre=centre, extent=extent)


def stops_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the registration: all stops, almost from above."""
    return _fitted(scene, _eye(scene, _middle(scene), ROUND * _surround(scene, FARTHEST), 4.0), LOW)


def edges_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the top's edges: almost from above."""
    return _eye(scene, scene.centre or (0.0, 0.0), NEAR * scene.extent, 5.0)


def legs_eye(scene: DrawnScene) -> Eye:
    """Return the eye of the legs."""
    return _eye(scene, scene.centre or (0.0, 0.0), NEAR * scene.extent, STEEPNESS)


def pair_eye(scene: DrawnScene) -> Eye:
    """Return the eye of a single pair: of the room that most of the pairs' points lie in."""
    return Eye(*scene.pair_eye) if scene.pair_eye else stops_eye(scene)


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
    """Return the angle (radians) by which the eye stands aside, so that no stop hides the table.

    Of the angles at which the fewest cameras lie before the top, above all not that of the stop
    which is shown first, it is the one in the widest gap between stops.
    """
    x, y = scene.centre or (0.0, 0.0)
    seen = [math.atan2(pose.y - y, pose.x - x) for pose in scene.localised]
    aside = np.linspace(EYE_ASIDE / 2, MOST_ASIDE, 40)
    if not seen:
        return EYE_ASIDE
    away = (scene.yaw - math.pi / 2 + aside)[:, None] - np.array(seen)
    gaps = np.abs((away + math.pi) % (2 * math.pi) - math.pi).min(axis=1)
    cameras = _cameras(scene)
    hidden = [_hiding(scene, cameras, _overview_eye(scene, float(one))) for one in aside]
    return float(aside[np.lexsort((-gaps, hidden))[0]])


def _cameras(scene: DrawnScene) -> Floats:
    """Return tips and corners (n, 5, 3) of the stops' cameras, as localised and as drawn."""
    found = [
        transform(pose.lifted(), view[0] + CAMERA * (view - view[0]))
        for (_, view), pose in zip(scene.cameras, scene.localised, strict=False)
    ]
    return np.array(found).reshape(-1, 5, 3)


def _hiding(scene: DrawnScene, cameras: Floats, eye: Eye) -> int:
    """Return how many cameras an eye has before the top; the first that is shown counts most."""
    if scene.centre is None:
        return 0
    position = np.array(eye.position)
    rise = np.minimum(cameras[..., 2] - position[2], -1e-6)
    on_top = position + (cameras - position) * ((scene.height - position[2]) / rise)[..., None]
    away = np.linalg.norm(on_top[..., :2] - np.array(scene.centre), axis=-1)
    is_before = (cameras[..., 2] > scene.height) & (away < MOST_OF_TOP * scene.extent)
    hiding = is_before.any(axis=1)
    is_first = scene.best is not None and scene.best < len(hiding) and hiding[scene.best]
    return int(hiding.sum() + len(hiding) * is_first)


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
