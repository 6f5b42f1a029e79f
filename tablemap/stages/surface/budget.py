"""The variance of a figure as a sum of named parts.

A fit with priors moves by H^-1 (J' W e + P n), for errors e of the data and n of the nuisances,
with H = J' W J + P. Let g be the gradient of a figure and v = H^-1 g. The figure's variance v' H v
has two terms: v' P v, with one part for each nuisance, and the rest, which is the data's own noise.
Correlated nuisances share their common part.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import JointFit, information_of
from tablemap.stages.surface.nuisances import CommonNuisances

PARTS: dict[str, str] = {
    "noise": "scatter of the edge points, and what holds a side that none shows",
    "poses": "places of the views",
    "drive_scale": "scale of what placed them: the laser's ranges, or wheels and depth",
    "depth": "height of the camera above the top: depth scale and field, height in TF",
    "tilt": "roll and pitch of the camera, tilt and pan of each view",
    "focal": "focal length",
    "mount": "place and heading of the camera in the base",
    "rim": "where near and far edges lie at the rim",
    "level": "slope and sag of the top",
    "floor": "a step of the floor: a rug under the table, a platform",
    "shape": "other shapes that explain the edges nearly as well; an edge that is off the outline",
    "share": "sides that were seen in part",
    "other": "what no residual can tell",
}
"""The parts of a budget, and what each stands for."""

_COMMON = {
    "scale": "depth",
    "roll": "tilt",
    "pitch": "tilt",
    "yaw": "mount",
    "focal": "focal",
    "near_bias": "rim",
    "widening": "rim",
    "shift_x": "mount",
    "shift_y": "mount",
    "set_back": "rim",
    "slope_x": "level",
    "slope_y": "level",
    "sag": "level",
    "stretch": "drive_scale",
}


def budget_of(
    fit: JointFit, evidence: Evidence, config: SurfaceConfig, gradient: Floats
) -> list[dict[str, float]]:
    """Split the variances of figures, with the ``gradient`` (d, k) by the shape's parameters."""
    information = information_of(fit, evidence, config)
    size = gradient.shape[1]
    padded = np.zeros((len(information), len(gradient)))
    padded[:size] = gradient.T
    moved = np.linalg.solve(information, padded)
    total = np.einsum("id,id->d", moved, padded)
    shared = moved[size : size + CommonNuisances.COUNT]
    by_common = shared * (evidence.common_precision @ shared)
    own = moved[size + CommonNuisances.COUNT :] ** 2
    budgets = []
    for figure in range(len(gradient)):
        parts = dict.fromkeys(PARTS, 0.0)
        for place, each in enumerate(fields(CommonNuisances)):
            parts[_COMMON[each.name]] += float(by_common[place, figure])
        for place, source in enumerate(evidence.prior_sources):
            parts[source] += float(own[place, figure])
        # Bound nuisances can share a negative part: it is taken off the others in proportion.
        parts = {name: max(part, 0.0) for name, part in parts.items()}
        known = sum(parts.values())
        parts["noise"] = max(float(total[figure]) - known, 0.0)
        excess = float(total[figure]) / max(parts["noise"] + known, 1e-18)
        budgets.append({name: part * min(excess, 1.0) for name, part in parts.items()})
    return budgets
