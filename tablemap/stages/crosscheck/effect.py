"""What a found offset changes: the outline is mended by it, the legs' sigmas admit the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tablemap.geometry import Floats, Pose2
from tablemap.stages.crosscheck.result import CrossCheck
from tablemap.stages.legs import Legs
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration
from tablemap.stages.surface import Surface


def corrected(outline: Outline, cross: CrossCheck) -> Outline:
    """Return the outline as the camera sees it from where the laser asks it to be.

    The laser has placed the robot: relative to that, the camera is moved.
    """
    if cross.offset is None or cross.at_table is None:
        return outline
    turn = Pose2(0.0, 0.0, float(cross.offset[2]))
    # Forward, a scale of the laser's counts as what it does at the table.
    shift = np.array([cross.at_table[0], cross.offset[1]])
    views = []
    for view in outline.views:
        eye = view.camera_xy

        def moved(points: Floats, eye: Floats = eye) -> Floats:
            there: Floats = turn.apply(points - eye) + eye + shift
            return there

        views.append(
            replace(
                view,
                points=moved(view.points),
                normals=turn.rotate(view.normals),
                camera_xy=eye + shift,
                top=moved(view.top),
                free=moved(view.free),
            )
        )
    return replace(outline, views=tuple(views))


def admitted_legs(
    legs: Legs, cross: CrossCheck, surface: Surface, registration: Registration
) -> Legs:
    """Return the legs with what camera and laser may be apart in their sigmas.

    The camera saw the top and the laser the legs: a camera turned in the base turns the top over
    the legs, and one that is shifted shifts it by what the views' headings do not cancel. An offset
    that was found has been mended but for its covariance; a smaller one is itself admitted.
    """
    if cross.offset is None or cross.covariance is None or cross.at_table is None:
        return legs
    if cross.is_found:
        turn = float(np.sqrt(cross.covariance[2, 2]))
        shift = np.asarray(cross.at_table_sigma, dtype=np.float64)
    else:
        turn, shift = float(cross.offset[2]), cross.at_table
    headings = [
        pose.rotation
        for pose, used in zip(registration.map_from_base, registration.used, strict=True)
        if used
    ]
    left_over = np.mean(headings, axis=0) @ shift
    stretch = _stretch(cross)
    middle = surface.pose.translation
    widened = []
    for leg in legs.legs:
        if leg.position_sigma is None or leg.seen_by == "depth":
            widened.append(leg)
            continue
        away = float(np.hypot(leg.x - middle[0], leg.y - middle[1]))
        variance = 0.5 * float((turn * away) ** 2 + left_over @ left_over)
        variance += (stretch * leg.scale_sigma) ** 2
        sigma = float(np.hypot(leg.position_sigma, np.sqrt(variance)))
        widened.append(replace(leg, position_sigma=sigma))
    return replace(legs, legs=tuple(widened))


def _stretch(cross: CrossCheck) -> float:
    """Return how many assumed sigmas must be added for them to be ``excess`` times as large."""
    return float(np.sqrt(cross.excess**2 - 1.0))
