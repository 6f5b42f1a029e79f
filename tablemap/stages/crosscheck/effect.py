"""Effect of an offset between camera and laser: it corrects the outline and widens legs' sigmas."""

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
    """Return the outline with the camera moved by the offset that was found.

    The laser placed the robot, so the camera is moved relative to it.
    """
    if cross.offset is None or cross.at_table is None:
        return outline
    turn = Pose2(0.0, 0.0, float(cross.offset[2]))
    # The forward shift includes the effect of the laser's scale at the table.
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
    """Return the legs with the uncertain place of the top added to their sigmas.

    The camera saw the top, and the laser saw the legs: the top's own place and heading against the
    stops count for both. So does a disagreement of camera and laser that the surface was not
    corrected for. A camera turned in the base turns the top against the legs; a shifted camera
    shifts the top, as far as the views' headings do not cancel.
    """
    top = surface.relative_covariance
    place, turn = 0.5 * float(np.trace(top[:2, :2])), float(top[2, 2])
    stretch = 0.0
    if cross.mounting is None and cross.offset is not None and cross.covariance is not None:
        left_over, turned = _left_over(cross, cross.offset, cross.covariance, registration)
        place += 0.5 * float(left_over @ left_over)
        turn += turned**2
        stretch = _stretch(cross)
    middle = surface.pose.translation
    widened = []
    for leg in legs.legs:
        if leg.position_sigma is None or leg.seen_by == "depth":
            widened.append(leg)
            continue
        away = float(np.hypot(leg.x - middle[0], leg.y - middle[1]))
        variance = place + 0.5 * turn * away**2 + (stretch * leg.scale_sigma) ** 2
        # Legs that the laser places stand farther apart as its ranges are longer.
        variance += (cross.scale_excess * away) ** 2
        sigma = float(np.hypot(leg.position_sigma, np.sqrt(variance)))
        widened.append(replace(leg, position_sigma=sigma))
    return replace(legs, legs=tuple(widened))


def _left_over(
    cross: CrossCheck, offset: Floats, covariance: Floats, registration: Registration
) -> tuple[Floats, float]:
    """Return how far a disagreement shifts the top (2,) in the map, metres, and turns it.

    What was found and corrected leaves its standard deviations, and what was not leaves itself.
    """
    at_table, turn = cross.at_table, float(offset[2])
    if cross.is_found:
        at_table, turn = cross.at_table_sigma, float(np.sqrt(covariance[2, 2]))
    headings = [
        pose.rotation
        for pose, used in zip(registration.map_from_base, registration.used, strict=True)
        if used
    ]
    shift = np.zeros(2) if at_table is None else at_table
    return np.asarray(np.mean(headings, axis=0) @ shift, dtype=np.float64), turn


def _stretch(cross: CrossCheck) -> float:
    """Return the sigma, in assumed sigmas, that added to them makes ``excess`` times as much."""
    return float(np.sqrt(cross.excess**2 - 1.0))
