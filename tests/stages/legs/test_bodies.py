"""A closed body that is flush with an end of the top may be a cupboard beside the table."""

from __future__ import annotations

import re

import numpy as np
import pytest
from shapely import Polygon

from tablemap.errors import ProcessWarning
from tests.making.leg_scenes import ROOM, TABLE, Scene, legs_of

Sides = tuple[float, ...]
"""Of a box in the top's frame: x, y, length, width[, low, high]."""


def _scene(boxes: list[Sides], *, length: float = 1.6, width: float = 0.8) -> Scene:
    """Return a top with two legs at its left end, and boxes."""
    scene = Scene(table=TABLE, length=length, width=width, walls=ROOM)
    for y in (-1, 1):
        place = TABLE.apply(np.array([0.08 - length / 2, y * (width / 2 - 0.08)]))
        scene.circles.append((*place, 0.025))
    for x, y, long, wide, *span in boxes:
        scene.boxes.append((*TABLE.apply(np.array([x, y])), long, wide, TABLE.yaw, *span))
    return scene


def _doubt(scene: Scene, **settings: object) -> ProcessWarning | None:
    """Return the doubt, None without one."""
    found = [w for w in legs_of(scene, **settings).warnings if w.code == "accuracy.closed_body"]
    assert len(found) < 2
    return found[0] if found else None


def _sizes(message: str) -> list[tuple[float, float]]:
    """Return the sizes that a message names: the body's, and the top's without it."""
    found = re.findall(r"(\d\.\d\d) by (\d\.\d\d) m", message)
    return [(float(length), float(width)) for length, width in found]


@pytest.mark.parametrize("laser", [True, False], ids=["with a laser", "by depth alone"])
@pytest.mark.parametrize(
    ("body", "top", "own"),
    [
        ((0.6, 0.0, 0.4, 0.8), (1.6, 0.8), (1.2, 0.8)),
        ((0.0, 0.4, 1.6, 0.4), (1.6, 1.2), (1.6, 0.8)),
    ],
    ids=["at an end", "along a side"],
)
def test_a_cupboard_of_the_tables_height_is_doubted(
    body: Sides, top: tuple[float, float], own: tuple[float, float], laser: bool
) -> None:
    """The doubt says how large the body is, where, and how large the top is without it."""
    scene = _scene([body], length=top[0], width=top[1])
    doubt = _doubt(scene, with_depth=True, laser=laser)
    assert doubt is not None
    (place,) = doubt.places
    x, y, *sides = body
    half = np.array(sides) / 2 * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    stands, told = Polygon(TABLE.apply(half + np.array([x, y]))), Polygon(place.points)
    assert told.intersection(stands).area > 0.85 * told.union(stands).area
    assert place.bottom == 0.0
    found = _sizes(doubt.message)
    assert found[0] == pytest.approx(sorted(body[2:], reverse=True), abs=0.05)
    assert found[1] == pytest.approx(own, abs=0.05)


UNDER_A_TABLE: dict[str, list[Sides]] = {
    "drawers that stand back from the edge": [(0.55, 0.0, 0.4, 0.7)],
    "a flush panel under each end": [(-0.785, 0, 0.03, 0.8), (0.785, 0, 0.03, 0.8)],
    "panels on two sides": [(0.785, 0, 0.03, 0.8), (0, 0.385, 1.6, 0.03)],
    "panels on three sides": [(-0.785, 0, 0.03, 0.8), (0.785, 0, 0.03, 0.8), (0, 0.385, 1.6, 0.03)],
    "a low box": [(0.6, 0.0, 0.4, 0.8, 0.0, 0.3)],
    "cloth that hangs down": [(0.6, 0.0, 0.4, 0.8, 0.5, 0.75)],
    "a body that is higher than the top": [(0.6, 0.0, 0.4, 0.8, 0.0, 1.0)],
    "nothing but a body": [(0.0, 0.0, 1.6, 0.8)],
}


@pytest.mark.parametrize("name", UNDER_A_TABLE)
def test_what_belongs_to_a_table_is_not_doubted(name: str) -> None:
    """A part of the top is a body's only with flush fronts of the top's height on three sides."""
    assert _doubt(_scene(UNDER_A_TABLE[name]), with_depth=True) is None
