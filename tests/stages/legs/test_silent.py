"""Legs that send the laser nothing back: black ones, chrome and glass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.config import LegsConfig
from tablemap.stages.legs import Legs, find_legs
from tests.making.leg_scenes import ROOM, SENSORS, TABLE, Scene, drive, errors_of, four, legs_of


def _silenced(
    scene: Scene, silent: list[int], *, unseen: tuple[int, ...] = (), seed: int = 4
) -> Legs:
    """Find the legs of a scene whose ``silent`` round legs send the laser nothing back.

    The depth camera sees none of the ``unseen`` ones either.
    """
    settings = {"scans_between": 8, "scans_per_stop": 4, "with_depth": True}
    circles = scene.circles

    def given(hidden: set[int]) -> tuple:  # type: ignore[type-arg]
        shown = replace(scene, circles=[c for k, c in enumerate(circles) if k not in hidden])
        return drive(shown, np.random.default_rng(seed), **settings)  # type: ignore[arg-type]

    recording, snapshots, registration, surface = given(set())
    without = given(set(silent))[0]
    behind = [snapshot.depth for snapshot in given(set(unseen))[1]]
    snapshots = tuple(
        replace(one, depth=np.where(np.abs(one.depth - other) > 0.05, np.nan, one.depth))
        for one, other in zip(snapshots, behind, strict=True)
    )
    recording.all = [
        replace(one, ranges=np.where(np.abs(one.ranges - other.ranges) > 0.1, np.inf, one.ranges))
        for one, other in zip(recording.all, without.all, strict=True)
    ]
    return find_legs(
        recording, snapshots, registration, surface, config=LegsConfig(), sensors=SENSORS
    )


@pytest.mark.parametrize("radius", [0.03, 0.009], ids=["several beams wide", "a beam or two"])
@pytest.mark.parametrize("silent", [[0], [1, 2], [0, 1, 2, 3]], ids=str)
def test_legs_that_send_the_laser_nothing_back_come_from_depth(
    silent: list[int], radius: float
) -> None:
    """A lost beam is no free space, not even where the wall on both sides bridges the gap."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, radius) for x, y in truth]
    legs = _silenced(scene, silent)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.012
    assert sum(leg.seen_by == "depth" for leg in legs.legs) == len(silent)
    notes = [w.message for w in legs.warnings if w.code == "legs.no_return"]
    assert len(notes) == 1 and notes[0].startswith(f"{len(silent)} leg")


def test_a_leg_that_no_sensor_sees_is_inferred_and_said() -> None:
    """A black leg: three others and the beams lost at its place put it there."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.03) for x, y in truth]
    legs = _silenced(scene, [2], unseen=(2,))
    assert [leg.seen_by for leg in legs.legs].count("nothing") == 1
    assert len(legs.legs) == 4 and errors_of(legs, truth).max() < 0.01
    assert {w.code for w in legs.warnings} == {"legs.inferred", "legs.no_return"}


def test_two_legs_that_no_sensor_sees_are_said_to_be_there() -> None:
    """Two of four do not give the other two: the note says where they may stand."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.03) for x, y in truth]
    legs = _silenced(scene, [1, 2], unseen=(1, 2))
    assert [leg.status for leg in legs.legs] == ["measured"] * 2
    notes = [w.message for w in legs.warnings if w.code == "legs.no_return"]
    assert len(notes) == 1
    for x, y in truth[1:3]:
        assert f"({x:.2f}, {y:.2f})" in notes[0]


def test_a_hall_without_walls_hides_no_leg() -> None:
    """Where all beams are lost, one lost at a corner says nothing, and depth sees it open."""
    scene = Scene(table=TABLE)
    scene.circles = [(x, y, 0.03) for x, y in four(scene)[:3]]
    legs = legs_of(scene, with_depth=True)
    assert [leg.status for leg in legs.legs] == ["measured"] * 3
    assert legs.warnings == ()
