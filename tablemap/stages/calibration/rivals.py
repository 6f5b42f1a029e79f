"""Rare errors that could make edges and depth disagree on how far the top is from the camera.

The calibration believes in small errors. Some robots have a large one: a camera that sits
centimetres higher than TF says, or a dark top whose depth errs otherwise than that of the floor.
Then the edges of the top, seen from all sides, contradict the depth. Which of these errors it is
decides whether the height must rise or fall. So each is an explanation of its own, with a small
prior probability, and the evidence weighs them (a finite mixture; Bishop, Pattern Recognition and
Machine Learning, 2006, section 3.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Floats
from tablemap.stages.calibration.adjustment import PLACE, Adjustment, Beliefs

CAMERA_HEIGHT, TOP_DEPTH = "camera_height", "top_depth"

_PRIOR = 0.03  # of each: about one recording in thirty
_CAMERA_SIGMA = 0.02  # metres
_TOP_SIGMA = 0.01  # metres; light that enters a dark or glossy top returns late


@dataclass(frozen=True, eq=False)
class Rival:
    """One explanation of the top's height above the floor and of its distance from the camera.

    cause: `CAMERA_HEIGHT`, `TOP_DEPTH`, or "" for the small errors that are always believed
    shift: (2,), by how much it changes height (metres) and distance (a share of it)
    covariance: (2, 2), of height and distance, if it is true
    log_weight: the logarithm of its probability by prior, floor and top, before the edges
    """

    cause: str
    shift: Floats
    covariance: Floats
    log_weight: float


def rivals(
    adjustment: Adjustment, beliefs: Beliefs, rows: Floats, lower: Floats, surface_sigma: float
) -> tuple[Rival, ...]:
    """Return the usual explanation and the rare ones.

    - ``rows``: (2, COUNT), derivatives of height and distance by the adjustment's unknowns
    - ``lower``: (2,), the same for a metre that is added to the depth of the top alone
    - ``surface_sigma``: metres, the usual error of that kind
    """
    surface = max(surface_sigma, _TOP_SIGMA)
    usual = rows @ adjustment.covariance @ rows.T

    def with_top(covariance: Floats, sigma: float) -> Floats:
        return covariance + np.outer(lower, lower) * sigma**2

    found = [
        Rival("", np.zeros(2), with_top(usual, surface_sigma), float(np.log(1 - 2 * _PRIOR))),
        Rival(TOP_DEPTH, np.zeros(2), with_top(usual, surface), float(np.log(_PRIOR))),
    ]
    place, believed = PLACE["height"], beliefs.common.height**2
    posterior = float(adjustment.covariance[place, place])
    data = 1 / posterior - 1 / believed  # what floor and top themselves say of the camera's height
    if believed < _CAMERA_SIGMA**2 and data * believed > _SAID:
        told, variance = float(adjustment.values[place]) / (posterior * data), 1 / data
        # The prior of one unknown becomes wider: a change of rank one.
        loosened = 1 / (1 / _CAMERA_SIGMA**2 - 1 / believed) + posterior
        column = adjustment.covariance[:, place]
        wider = adjustment.covariance - np.outer(column, column) / loosened
        likelier = _log_normal(told, _CAMERA_SIGMA**2 + variance)
        likelier -= _log_normal(told, believed + variance)
        found.append(
            Rival(
                CAMERA_HEIGHT,
                rows @ (-column * float(adjustment.values[place]) / loosened),
                with_top(rows @ wider @ rows.T, surface_sigma),
                float(np.log(_PRIOR)) + likelier,
            )
        )
    return tuple(found)


_SAID = 1e-3  # less information than this share of the prior's is none


def _log_normal(value: float, variance: float) -> float:
    return -0.5 * (value**2 / variance + float(np.log(variance)))
