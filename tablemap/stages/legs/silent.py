"""Legs that send a laser nothing back: black ones, chrome and glass."""

from __future__ import annotations

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.legs.clusters import persistence
from tablemap.stages.legs.layout import Frame, partners
from tablemap.stages.legs.result import Leg
from tablemap.stages.legs.scans import Scans
from tablemap.words import counted

_LEAST = 3  # stops and drives that must have lost their beams at one place
_OWN = 0.1  # metres from a leg: the place is the leg's


def silent_legs(legs: list[Leg], scans: Scans | None, frame: Frame) -> list[ProcessWarning]:
    """Say where the laser's beams were lost at a leg, or where symmetry wants one."""
    if scans is None or not legs:
        return []
    places = np.array([[leg.x, leg.y] for leg in legs])
    size = float(np.median([max(f.value for f in leg.dimensions.values()) for leg in legs]))
    unseen = [place for leg, place in zip(legs, places, strict=True) if leg.seen_by != "laser"]
    silent = sum(_is_silent(scans, place, size) for place in unseen)
    messages = []
    if silent:
        messages.append(
            f"{counted(silent, 'leg')} sent the laser nothing back, as black, bright or clear "
            "ones do: they were placed by the depth camera, or by the symmetry of the others."
        )
    wanted: list[Floats] = []
    for place in partners(frame, places):
        known = [*places, *wanted]
        if min(float(np.linalg.norm(place - other)) for other in known) > _OWN and _is_silent(
            scans, place, size
        ):
            wanted.append(place)
    if wanted:
        where = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in wanted)
        messages.append(
            f"At {where}, where the other legs have partners, the laser's beams came back with "
            "nothing: legs that no sensor saw may stand there."
        )
    return [ProcessWarning("legs.no_return", "legs", message) for message in messages]


def _is_silent(scans: Scans, place: Floats, size: float) -> bool:
    """Tell whether beams to the place alone were lost, from several stops and drives."""
    seen = persistence(scans, place, 0.5 * size)
    return seen.lost >= _LEAST and seen.lost > seen.hit + seen.passed
