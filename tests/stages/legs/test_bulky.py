"""Wide things at the foot of a leg: bases with arms, boxes beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Polygon

from tablemap.geometry import Pose2
from tablemap.model.shapes import CIRCLE
from tablemap.stages.legs.candidates import LegCandidate
from tablemap.stages.legs.clusters import Cluster, Persistence
from tablemap.stages.legs.decision import judge
from tablemap.stages.legs.depth import Reach
from tablemap.stages.legs.ends import UpperEnd
from tablemap.stages.legs.evidence import LegEvidence
from tablemap.stages.legs.fit import Fit
from tablemap.stages.legs.layout import Frame
from tests.making.leg_scenes import ROOM, TABLE, Scene, errors_of, four, legs_of, surface_of

MIDDLE = Pose2(0.2, 0.1)


def _pedestal() -> Scene:
    scene = Scene(table=MIDDLE, length=0.9, width=0.9, shape="circle", walls=ROOM)
    scene.circles = [(MIDDLE.x, MIDDLE.y, 0.035)]
    return scene


@pytest.mark.parametrize("arms", [3, 4, 5])
def test_of_a_pedestal_on_a_star_the_column_is_the_leg(arms: int) -> None:
    """The laser cuts the arms: they are no circle, as beams end between them."""
    scene = _pedestal()
    for turn in 0.3 + 2 * np.pi * np.arange(arms) / arms:
        x, y = MIDDLE.apply(0.16 * np.array([np.cos(turn), np.sin(turn)]))
        scene.boxes.append((x, y, 0.3, 0.05, turn, 0.1, 0.2))
    legs = legs_of(scene, with_depth=True)
    assert [leg.seen_by for leg in legs.legs] == ["depth"]
    assert errors_of(legs, np.array([[MIDDLE.x, MIDDLE.y]])).max() < 0.012
    assert legs.legs[0].dimensions["diameter"].value == pytest.approx(0.07, abs=0.02)
    assert any("a base with arms" in one.reason for one in legs.rejected)


def test_a_star_without_a_view_of_its_column_is_set_aside() -> None:
    """The laser alone does not know what stands on the arms, and says so."""
    scene = _pedestal()
    for turn in 0.3 + 2 * np.pi * np.arange(5) / 5:
        x, y = MIDDLE.apply(0.16 * np.array([np.cos(turn), np.sin(turn)]))
        scene.boxes.append((x, y, 0.3, 0.05, turn, 0.1, 0.2))
    legs = legs_of(scene)
    assert legs.legs == ()
    assert any("a base with arms" in one.reason for one in legs.rejected)


def test_a_round_foot_plate_is_a_leg() -> None:
    """A plate of 45 cm is solid: no beam ends in it."""
    scene = _pedestal()
    scene.circles = [(MIDDLE.x, MIDDLE.y, 0.225)]
    legs = legs_of(scene)
    assert [leg.seen_by for leg in legs.legs] == ["laser"]
    assert legs.legs[0].dimensions["diameter"].value == pytest.approx(0.45, abs=0.01)


@pytest.mark.parametrize("with_depth", [True, False], ids=["seen by depth", "by the laser alone"])
@pytest.mark.parametrize("gap", [0.015, 0.03])
@pytest.mark.parametrize("sides", [(0.2, 0.2), (0.3, 0.18)], ids=str)
def test_a_box_beside_a_leg_is_no_leg_and_hides_none(
    gap: float, sides: tuple[float, float], with_depth: bool
) -> None:
    """A box that nearly touches a leg is set aside; depth or symmetry keeps the leg."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.03) for x, y in truth]
    local = TABLE.inverse().apply(truth[:1])[0] - [0.03 + gap + 0.5 * sides[0], 0.03]
    x, y = TABLE.apply(local)
    scene.boxes = [(x, y, *sides, TABLE.yaw + 0.15, 0.0, 0.25)]
    legs = legs_of(scene, with_depth=with_depth)
    assert len(legs.legs) == 4
    assert errors_of(legs, truth).max() < 0.015
    for leg in legs.legs:
        assert max(figure.value for figure in leg.dimensions.values()) < 0.09
        assert leg.position_sigma is not None and leg.position_sigma < 0.025
    assert any("too large" in one.reason for one in legs.rejected)


@pytest.mark.parametrize(("along", "turn"), [(0.4, 0.2), (0.41, 0.2), (0.4, 0.0)])
def test_a_leg_that_is_one_cluster_with_a_box_is_inferred(along: float, turn: float) -> None:
    """The laser does not part them, and depth saw nothing: no leg is made of pieces of both."""
    scene = Scene(table=TABLE, walls=ROOM)
    truth = four(scene, inset=0.08)
    scene.boxes = [(x, y, 0.05, 0.05, TABLE.yaw) for x, y in truth]
    box = TABLE.apply(np.array([along, -0.2]))
    scene.boxes.append((*box, 0.2, 0.2, TABLE.yaw + turn, 0.0, 0.25))
    legs = legs_of(scene)
    assert sorted(leg.seen_by for leg in legs.legs) == ["laser"] * 3 + ["nothing"]
    assert errors_of(legs, truth).max() < 0.005
    assert any("too large" in one.reason for one in legs.rejected)


def test_two_things_that_touch_are_no_leg() -> None:
    """A box and a bin are one cluster, unlike the legs and known to decimetres: set aside."""
    scene = Scene(table=TABLE, length=1.4, width=0.8, walls=ROOM)
    truth = four(scene)
    scene.circles = [(x, y, 0.025) for x, y in truth[[0, 1, 3]]]
    box, drum = TABLE.apply(np.array([[0.2, 0.1], [-0.1, 0.2]]))
    scene.circles.append((*drum, 0.13))
    scene.boxes = [(*box, 0.35, 0.2, TABLE.yaw + 0.4, 0.0, 0.6)]
    legs = legs_of(scene, with_depth=True)
    assert all(leg.position_sigma and leg.position_sigma < 0.025 for leg in legs.legs)
    assert any("its place is known to" in one.reason for one in legs.rejected)


def _candidate(
    x: float, tangents: int, diameter: float, spread: float, y: float = 0.0
) -> LegCandidate:
    """Return a round thing ``x`` and ``y`` metres from the table's middle, along its axes."""
    none = np.zeros(0)
    place = MIDDLE.apply(np.array([x, y]))
    rows = np.zeros((tangents, 2))
    fit = Fit(
        kind=CIRCLE,
        parameters=np.array([[*place, diameter]]),
        covariance=np.eye(3)[None] * 1e-6,
        cost=1.0,
        costs=np.ones(1),
        count=tangents,
        free=3,
        shared=0,
        rms=np.zeros(1),
        beam_half_width=0.0,
        range_bias=0.0,
        misfits=((none, none),),
    )
    zeros = np.zeros(tangents)
    group = np.zeros(tangents, dtype=np.int64)
    evidence = LegEvidence(
        rows, rows, zeros, zeros, group, rows, rows, rows, group, zeros, group, rows
    )
    cluster = Cluster(place, spread, np.arange(tangents), slender=True)
    stayed, looked = Persistence(8, 0, 0, 0), Reach(8, 0)
    return LegCandidate(cluster, place, rows, evidence, {CIRCLE: fit}, stayed, looked, None)


@pytest.mark.parametrize(("tangents", "kept"), [(7, False), (150, True)], ids=["sliver", "rod"])
def test_noise_beside_a_leg_is_a_fragment_of_it(tangents: int, kept: bool) -> None:
    """Of few silhouettes the spread counts, not the small fit; a rod of its own has many."""
    scene = _pedestal()
    surface = surface_of(scene, {})
    frame = Frame(surface, Polygon(surface.outline))
    leg, beside = judge(
        [_candidate(0.0, 228, 0.05, 0.06), _candidate(0.055, tangents, 0.011, 0.085)], frame
    )
    assert leg.reason is None
    assert (beside.reason != "a fragment of the leg beside it") == kept


@pytest.mark.parametrize(
    ("end", "diameter", "unsure", "said"),
    [
        (UpperEnd(hidden=0.12), 0.11, True, "no view saw its upper 12 cm"),
        (UpperEnd(height=0.6, gap=0.04, shown=1, hidden=0.12), 0.11, False, "1 view saw through"),
        (UpperEnd(height=0.6, gap=0.04, shown=1, opposed=1, hidden=0.12), 0.11, True, "no view"),
        (UpperEnd(hidden=0.12), 0.05, False, None),
        (UpperEnd(hidden=0.02), 0.11, False, None),
    ],
    ids=["hidden", "one view", "contradicted", "alike", "at the top"],
)
def test_beside_four_legs_a_thing_unlike_them_must_be_seen_to_meet_the_top(
    end: UpperEnd, diameter: float, unsure: bool, said: str | None
) -> None:
    """One view of the gap above it decides; without one it is a doubt, unless it is alike."""
    scene = Scene(table=MIDDLE, length=1.6, width=0.9)
    surface = surface_of(scene, {})
    corners = [
        _candidate(0.72 * u, 200, 0.05, 0.05, 0.37 * v)
        for u, v in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    ]
    thing = replace(_candidate(0.4, 200, diameter, diameter, 0.2), end=end)
    *legs, judged = judge([*corners, thing], Frame(surface, Polygon(surface.outline)))
    assert all(leg.reason is None for leg in legs)
    assert judged.is_unsure is unsure
    assert judged.reason is None if said is None else said in (judged.reason or "")
