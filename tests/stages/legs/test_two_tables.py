"""Two tables of one height that meet over a whole side look like one; their legs do not."""

from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Polygon

from tablemap.geometry import Pose2
from tablemap.stages.legs.layout import Frame, two_tables
from tests.making.leg_scenes import Scene, surface_of

PAIRS = {
    "two tables, long side to long side": (True, 1.2, 1.6, [0.1, 1.1], [0.1, 0.7, 0.9, 1.5]),
    "two tables of unlike size, end to end": (True, 2.0, 0.8, [0.1, 1.1, 1.3, 1.9], [0.1, 0.7]),
    "one table on four legs": (False, 2.0, 0.8, [0.1, 1.9], [0.1, 0.7]),
    "one table on six": (False, 2.0, 0.8, [0.1, 1.0, 1.9], [0.1, 0.7]),
    "one table on eight, evenly spaced": (False, 3.2, 0.8, [0.1, 1.1, 2.1, 3.1], [0.1, 0.7]),
}


@pytest.mark.parametrize("name", PAIRS)
def test_legs_tell_two_tables_from_one(name: str) -> None:
    """Each of two has legs about its own middle; those of a long one are about the whole's."""
    expected, length, width, along, across = PAIRS[name]
    scene = Scene(table=Pose2(0.4, -0.3, 0.5), length=length, width=width)
    surface = surface_of(scene, {})
    frame = Frame(surface, Polygon(surface.outline))
    local = np.array([(x - length / 2, y - width / 2) for x in along for y in across])
    assert bool(two_tables(frame, scene.table.apply(local))) is expected
    assert not two_tables(frame, scene.table.apply(local)[:2])
