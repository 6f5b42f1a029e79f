"""A leg that no view could have seen, placed by the symmetry of the other legs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from shapely.geometry import Point

from tablemap.config import LegsConfig
from tablemap.geometry import Floats
from tablemap.stages.legs.candidates import LegCandidate
from tablemap.stages.legs.clusters import persistence
from tablemap.stages.legs.depth import Reach
from tablemap.stages.legs.layout import Frame, symmetric_sets
from tablemap.stages.legs.posts import DEPTH_SYMMETRY
from tablemap.stages.legs.result import Leg
from tablemap.stages.legs.scans import Scans
from tablemap.stages.surface import FittedFigure

_LASER_SYMMETRY = 0.03  # metres: like `DEPTH_SYMMETRY`, for legs that the laser placed
_BESIDE = 0.08  # metres
_SYMMETRY_SIGMA = 0.01  # metres: real legs stand off their symmetric places by so much


def infer_missing(
    legs: list[Leg],
    candidates: list[LegCandidate],
    scans: Scans | None,
    looked: Callable[[Floats, float], Reach],
    frame: Frame,
    *,
    config: LegsConfig,
) -> list[Leg]:
    """Add the fourth leg if three stand by symmetry and neither sensor could have seen it.

    ``looked`` returns the depth camera's looks at a place of a radius. There is no leg where a
    sensor saw through the place, or should have seen a leg and did not. Beams of the laser that
    were lost at the place alone speak for a leg that sends nothing back.
    """
    if len(legs) != 3:
        return []
    places = np.array([[leg.x, leg.y] for leg in legs])
    by_depth = any(leg.seen_by == "depth" for leg in legs)
    tolerance = DEPTH_SYMMETRY if by_depth else _LASER_SYMMETRY
    for members, missing in symmetric_sets(frame, places, tolerance):
        if len(members) != 3 or len(missing) != 1:
            continue
        place = missing[0]
        pattern = legs[0]
        size = max(figure.value for figure in pattern.dimensions.values())
        if not frame.polygon.buffer(config.beyond).contains(Point(*place)):
            return []
        if scans is not None:
            seen = persistence(scans, place, 0.5 * size)
            # A thing whose side is so near may hide the leg, or be one cluster with it.
            hides = [
                c for c in candidates if np.linalg.norm(c.place - place) < _BESIDE + 0.5 * c.size
            ]
            if seen.passed > seen.lost or (seen.hit and not hides):
                return []
        open_view = looked(place, 0.5 * size)
        if open_view.passed > open_view.hit:
            return []
        figures = {
            name: FittedFigure(figure.value, figure.sigma, "inferred")
            for name, figure in pattern.dimensions.items()
        }
        spread = max((leg.position_sigma or 0.0 for leg in legs), default=0.0)
        # Real tables are symmetric to about a centimetre.
        sigma = float(np.sqrt(3.0 * spread**2 + _SYMMETRY_SIGMA**2))
        return [
            Leg(
                shape=pattern.shape,
                x=float(place[0]),
                y=float(place[1]),
                yaw=pattern.yaw,
                status="inferred",
                position_sigma=sigma,
                dimensions=figures,
                points=np.zeros((0, 2)),
                views=0,
                seen_by="nothing",
            )
        ]
    return []
