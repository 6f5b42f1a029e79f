"""Chairs among a table's legs: squares of slender things that extend beyond the top."""

from __future__ import annotations

from collections.abc import Set as AbstractSet

import numpy as np

from tablemap.geometry import Floats
from tablemap.stages.legs.layout import Frame

_SIDES = (0.28, 0.56)  # metres between a chair's neighbouring legs
_ASKEW = 0.2  # largest cosine of the angle at a chair's leg
_CLOSES = 0.05  # metres between the fourth leg and the place that the other three predict


def chair_like(frame: Frame, places: Floats, own: AbstractSet[int]) -> set[int]:
    """Return which of (n, 2) places of slender things stand like the legs of a chair.

    ``own`` are places that stand like the table's own legs: a symmetric set near its corners. Such
    a set is much less likely by accident than three places at a right angle. Its places count as
    chairs' legs only if chairs explain all of them, and one of two things holds: at least half
    belong to whole chairs with as many other legs, or something in the middle carries the top.
    """
    squares = chair_squares(frame, places)
    found = set().union(*squares)
    whole = [legs for legs in squares if len(legs) == 4 and len(legs & own) <= 2]
    explained = own & set().union(*whole)
    enough = 2 * len(explained) >= len(own) or any(frame.is_central(place) for place in places)
    return found if own <= found and enough else found - own


def chair_squares(frame: Frame, places: Floats) -> list[frozenset[int]]:
    """Return the squares of 28 to 56 cm among (n, 2) places that extend beyond the top, as indices.

    Three corners of a square are enough, with two exceptions. No corner may belong to a whole
    square, as no leg belongs to two chairs. No corner may be in the middle of the top, where a
    pedestal stands.
    """
    if len(places) < 3:
        return []
    outside = np.array([frame.is_beyond(place) for place in places])
    central = np.array([frame.is_central(place) for place in places])
    distance = np.linalg.norm(places[:, None] - places[None], axis=2)
    whole: set[frozenset[int]] = set()
    corners: set[frozenset[int]] = set()
    for a in range(len(places)):
        side = np.flatnonzero((distance[a] > _SIDES[0]) & (distance[a] < _SIDES[1]))
        for i, b in enumerate(side):
            for c in side[i + 1 :]:
                first, second = places[b] - places[a], places[c] - places[a]
                cosine = abs(first @ second) / (np.hypot(*first) * np.hypot(*second))
                trio = [a, int(b), int(c)]
                if cosine >= _ASKEW or not outside[trio].any():
                    continue
                fourth = np.linalg.norm(places - (places[b] + second), axis=1)
                if fourth.min() < _CLOSES:
                    whole.add(frozenset([*trio, int(fourth.argmin())]))
                elif not central[trio].any():
                    corners.add(frozenset(trio))
    taken = frozenset().union(*whole)
    return sorted(whole | {trio for trio in corners if not trio & taken}, key=sorted)
