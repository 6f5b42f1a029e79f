"""Which surface is the table, how high it is, and what every pixel shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from tablemap.config import CalibrationConfig, SegmentationConfig, SensorsConfig, SnapshotsConfig
from tablemap.errors import EstimationError
from tablemap.geometry import Pose2
from tablemap.recording import open_recording
from tablemap.stages.calibration import calibrate
from tablemap.stages.segmentation import (
    Label,
    TableRefused,
    TablesFound,
    find_tables,
    segment,
    stage,
)
from tablemap.stages.segmentation.height import shows_both
from tablemap.stages.snapshots import Snapshot, take_snapshots
from tests.making.casting import Box
from tests.making.round_trips import mounting, round_trip, table

CONFIG = SegmentationConfig()
SENSORS = SensorsConfig()
TABLE = table(1.0, 0.5, 1.2, 0.8, 0.74, 0.3)
CENTRE = (1.0, 0.5)


def on_table(snapshot: Snapshot, true_pose: Pose2, margin: float) -> np.ndarray:
    """Return which pixels truly show the top of `TABLE`."""
    points = true_pose.apply(snapshot.points_in_base())
    place = Pose2(1.0, 0.5, 0.3).inverse().apply(points)
    inside = (abs(place[..., 0]) < 0.6 + margin) & (abs(place[..., 1]) < 0.4 + margin)
    return inside & (abs(place[..., 2] - 0.74) < 0.012 + margin)


def test_labels_agree_with_the_truth_though_poses_are_off() -> None:
    """With localisation 10 cm and 4 degrees off, 97 % of the top is found and little else."""
    snapshots = round_trip(TABLE, CENTRE, pose_error=(0.10, np.deg2rad(4)), seed=1)
    truth = round_trip(TABLE, CENTRE, seed=1)
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    assert result.used == (0, 1, 2, 3, 4, 5)
    assert result.height == pytest.approx(0.74, abs=0.001)
    for view, snapshot, true in zip(result.views, snapshots, truth, strict=True):
        top = view.labels == Label.TOP
        real = on_table(snapshot, true.map_from_base, -0.005)
        loose = on_table(snapshot, true.map_from_base, 0.015)
        assert (top & real).sum() / real.sum() > 0.97
        assert (top & loose).sum() / top.sum() > 0.99
        assert (view.labels == Label.FLOOR).sum() > 1000


def test_things_on_the_table_stand_on_it() -> None:
    """A box on the top is ON_TOP; a chair's back before the table is FRONT."""
    cup = Box(1.0, 0.5, 0.12, 0.12, 0.74, 0.90)
    back = Box(1.0, -0.35, 0.45, 0.04, 0.45, 0.95)
    snapshots = round_trip([*TABLE, cup, back], CENTRE)
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    seen_back = 0
    for view, snapshot in zip(result.views, snapshots, strict=True):
        points = snapshot.map_from_base.apply(snapshot.points_in_base())
        of_cup = (np.hypot(points[..., 0] - 1.0, points[..., 1] - 0.5) < 0.1) & (
            points[..., 2] > 0.76
        )
        of_back = (abs(points[..., 1] + 0.35) < 0.03) & (points[..., 2] > 0.78)
        assert (view.labels[of_cup] == Label.ON_TOP).mean() > 0.9
        if of_back.sum() > 200:
            seen_back += 1
            assert (view.labels[of_back] == Label.FRONT).mean() > 0.9
    assert seen_back >= 2


def test_a_top_parted_by_clutter_is_one_top() -> None:
    """A wall of boxes across the table leaves both halves TOP."""
    place = Pose2(1.0, 0.5, 0.3)
    wall = Box(1.0, 0.5, 0.1, 0.84, 0.74, 0.80, 0.3)
    snapshots = round_trip([*TABLE, wall], CENTRE, mount=mounting(1.4, 32.0))
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    halves = 0
    for view, snapshot in zip(result.views, snapshots, strict=True):
        points = snapshot.map_from_base.apply(snapshot.points_in_base())
        along = place.inverse().apply(points)[..., 0]
        real = on_table(snapshot, snapshot.map_from_base, -0.002)
        first, second = real & (along > 0.08), real & (along < -0.08)
        if min(first.sum(), second.sum()) > 300:
            halves += 1
            assert (view.labels[first] == Label.TOP).mean() > 0.9
            assert (view.labels[second] == Label.TOP).mean() > 0.9
    assert halves >= 2


@pytest.mark.parametrize(("rise", "used"), [(0.024, 8), (0.03, 8), (0.15, 5)])
def test_a_thing_over_half_of_a_small_top_is_not_the_top(rise: float, used: int) -> None:
    """Half of the top is under a tray or a box in its corner, which hides all from three sides."""
    low = table(1.0, 0.5, 0.5, 0.5, 0.45, 0.0)
    thing = Box(0.93, 0.43, 0.35, 0.35, 0.45, 0.45 + rise)
    snapshots = round_trip(
        [*low, thing], CENTRE, views=8, radius=1.2, pose_error=(0.05, 0.02), seed=2
    )
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    assert result.height == pytest.approx(0.45, abs=0.002)
    assert len(result.used) == used
    chosen = next(c for c in result.candidates if c.chosen)
    assert chosen.reason is None
    lids = [c for c in result.candidates if c.reason is not None and "it lies on" in c.reason]
    assert any(c.height == pytest.approx(0.45 + rise, abs=0.004) for c in lids)


@pytest.mark.parametrize("rise", [0.04, 0.055, 0.15])
def test_a_top_at_another_height_in_half_of_the_views_is_doubted(rise: float) -> None:
    """A desk that somebody raised during the drive is no table of one height."""
    low = round_trip(TABLE, CENTRE)
    high = round_trip(table(1.0, 0.5, 1.2, 0.8, 0.74 + rise, 0.3), CENTRE)
    raised = segment((*low[:3], *high[3:]), config=CONFIG, sensors=SENSORS)
    (warning,) = [w for w in raised.warnings if w.code == "accuracy.height_scatter"]
    assert "3 of 6 views" in warning.message
    assert raised.height_apart == pytest.approx(rise, abs=0.006)
    still = segment(low, config=CONFIG, sensors=SENSORS)
    assert still.height_apart == 0.0
    assert "accuracy.height_scatter" not in {w.code for w in still.warnings}


@pytest.mark.parametrize("rise", [0.008, 0.012, 0.017])
def test_trays_that_cover_most_of_a_small_top_are_not_its_height(rise: float) -> None:
    """Two trays cover 56 % of the top: what is left of it lies all round them."""
    low = table(1.0, 0.5, 0.5, 0.5, 0.45, 0.0)
    trays = [
        Box(0.90, 0.5, 0.22, 0.42, 0.45, 0.45 + rise),
        Box(1.13, 0.60, 0.19, 0.25, 0.45, 0.45 + rise),
    ]
    snapshots = round_trip(
        [*low, *trays], CENTRE, views=8, radius=1.2, pose_error=(0.05, 0.02), seed=2
    )
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    assert result.height == pytest.approx(0.45, abs=0.002)
    assert len(result.used) == 8
    for view, snapshot in zip(result.views, snapshots, strict=True):
        z = snapshot.points_in_base()[..., 2][view.labels == Label.TOP]
        assert np.mean(z > 0.45 + 0.75 * rise) < 0.05


def test_a_tray_that_leaves_only_one_end_of_the_top_is_doubted() -> None:
    """No view can tell it from a lower table that adjoins: the warning has the step."""
    low = table(1.0, 0.5, 0.5, 0.5, 0.45, 0.0)
    tray = Box(0.92, 0.5, 0.32, 0.49, 0.45, 0.462)
    bare, laden = (
        segment(
            round_trip(boxes, CENTRE, views=8, radius=1.2, seed=2), config=CONFIG, sensors=SENSORS
        )
        for boxes in (low, [*low, tray])
    )
    assert not bare.warnings
    assert laden.height == pytest.approx(0.462, abs=0.002)
    (doubt,) = laden.warnings
    assert doubt.code == "accuracy.two_levels"
    assert "12 mm lower" in doubt.message
    (place,) = doubt.places
    assert place.height == pytest.approx(0.45, abs=0.002)
    bare_end = shapely.box(1.08, 0.25, 1.25, 0.75)
    assert shapely.Polygon(place.points).intersection(bare_end).area > 0.8 * bare_end.area
    assert np.mean(np.array(place.points)[:, 0]) > 1.05


def test_leaves_that_lie_lower_at_both_ends_are_doubted() -> None:
    """They do not reach round the middle, whose height is the table's."""
    middle = table(1.0, 0.5, 0.8, 0.8, 0.74, 0.0)
    leaves = [Box(1.0 + side * 0.5, 0.5, 0.2, 0.8, 0.70, 0.728) for side in (-1, 1)]
    snapshots = round_trip([*middle, *leaves], CENTRE, views=8, radius=1.4, seed=2)
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    assert result.height == pytest.approx(0.74, abs=0.002)
    assert "accuracy.two_levels" in {warning.code for warning in result.warnings}


def test_a_bent_top_has_one_level() -> None:
    """Depth that bends by 1.5 % over the image spreads a top over 2 cm: no view is lost by that."""
    snapshots = round_trip(TABLE, CENTRE)
    rows, columns = snapshots[0].depth.shape
    across = np.linspace(-1, 1, columns, dtype=np.float32)
    along = np.linspace(-1, 1, rows, dtype=np.float32)[:, None]
    bend = 1 + np.float32(0.015) * (across**2 - along**2)
    bent = tuple(replace(each, depth=each.depth * bend) for each in snapshots)
    straight = segment(snapshots, config=CONFIG, sensors=SENSORS)
    result = segment(bent, config=CONFIG, sensors=SENSORS)
    assert result.used == straight.used
    assert result.height == pytest.approx(0.74, abs=0.008)
    for view, other in zip(result.views, straight.views, strict=True):
        assert (view.labels == Label.TOP).sum() > 0.6 * (other.labels == Label.TOP).sum()


def test_seats_round_a_closed_table_do_not_carry_it() -> None:
    """A cloth hides what is under the top, and four seats 15 cm lower stand close to it."""
    closed = Box(1.0, 0.5, 0.8, 0.8, 0.0, 0.60)
    seats = [
        Box(1.0 + 0.65 * x, 0.5 + 0.65 * y, 0.38, 0.38, 0.40, 0.45)
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    snapshots = round_trip([closed, *seats], CENTRE, views=8, pose_error=(0.05, 0.02), seed=3)
    tops = [c for c in find_tables(snapshots, config=CONFIG) if c.height > 0.55]
    assert tops
    assert not any("it lies on" in (c.reason or "") for c in tops)


def chair(x: float, y: float) -> list[Box]:
    """Return a chair with its back at the side of -y."""
    legs = [
        Box(x + 0.18 * a, y + 0.18 * b, 0.04, 0.04, 0.0, 0.43) for a in (-1, 1) for b in (-1, 1)
    ]
    return [Box(x, y, 0.42, 0.42, 0.43, 0.46), Box(x, y - 0.2, 0.42, 0.03, 0.46, 0.8), *legs]


def looks_at_a_chair(furniture: list[Box]) -> tuple[Snapshot, ...]:
    """Return views of a chair at (1.0, -0.3), from its own side of a table at (1.0, 0.5)."""
    snapshots = round_trip(
        furniture, (1.0, -0.25), radius=1.2, step=0.02, mount=mounting(1.1, 35.0)
    )
    return tuple(each for each in snapshots if each.map_from_base.y < -0.2)


def test_a_seat_that_is_seen_better_than_its_table_is_no_table() -> None:
    """The images show all of the seat and cut the table; the larger, higher surface is chosen."""
    snapshots = looks_at_a_chair([*table(1.0, 0.5, 2.2, 0.9, 0.74, 0.0), *chair(1.0, -0.3)])
    best, second = find_tables(snapshots, config=CONFIG)[:2]
    assert best.height == pytest.approx(0.74, abs=0.01)
    assert second.height == pytest.approx(0.46, abs=0.01)
    assert second.area < 0.5 * best.area


def test_a_low_table_beside_a_higher_one_is_still_a_table() -> None:
    """As large as a coffee table it is no seat; a stool without a table beside it is chosen too."""
    low = table(1.0, -0.35, 0.9, 0.6, 0.45, 0.0)
    best = find_tables(
        looks_at_a_chair([*table(1.0, 0.5, 2.2, 0.9, 0.74, 0.0), *low]), config=CONFIG
    )[0]
    assert best.height == pytest.approx(0.45, abs=0.01)
    stool = table(1.0, -0.3, 0.4, 0.4, 0.46, 0.0)
    alone = find_tables(looks_at_a_chair(stool), config=CONFIG)[0]
    assert alone.height == pytest.approx(0.46, abs=0.01)


def test_strays_in_other_views_are_no_second_level() -> None:
    """Two views of something lower, and one pixel in a hundred in the others, lower no top."""
    shares = np.zeros((5, 60))
    shares[:3, 30], shares[:3, 2], shares[:3, 8] = 0.9, 0.01, 0.01
    shares[3, 2] = shares[4, 8] = 0.9
    assert not shows_both(shares, 2, 8)
    tray = np.zeros((5, 60))
    tray[:, 20], tray[:, 32] = 0.3, 0.6
    assert shows_both(tray, 20, 32)


def test_a_second_table_at_the_same_height_is_another_top() -> None:
    """A table half a metre beside is never TOP, and --near chooses it."""
    second = table(1.0, 1.75, 1.0, 0.6, 0.74, 0.3)
    snapshots = round_trip([*TABLE, *second], CENTRE, views=8)
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    for view, snapshot in zip(result.views, snapshots, strict=True):
        points = snapshot.map_from_base.apply(snapshot.points_in_base())
        distance = np.hypot(points[..., 0] - 1.0, points[..., 1] - 0.5)
        assert not ((view.labels == Label.TOP) & (distance > 0.85)).any()
    other = segment(snapshots, config=CONFIG, sensors=SENSORS, near=(1.0, 1.8))
    chosen = next(c for c in other.candidates if c.chosen)
    assert np.hypot(chosen.x - 1.0, chosen.y - 1.75) < 0.2


def test_a_couch_loses_against_the_table() -> None:
    """A larger couch with a back and closed sides beside the table is not chosen."""
    couch = [
        Box(1.0, 2.2, 1.9, 0.7, 0.0, 0.43),
        Box(1.0, 2.6, 1.9, 0.15, 0.0, 0.80),
        Box(0.0, 2.2, 0.15, 0.8, 0.0, 0.62),
        Box(2.0, 2.2, 0.15, 0.8, 0.0, 0.62),
    ]
    low = table(1.0, 0.8, 0.55, 0.55, 0.45, 0.2)
    snapshots = round_trip([*low, *couch], (1.0, 0.9), views=5, radius=1.6, step=0.02)
    best = find_tables(snapshots, config=CONFIG)[0]
    assert best.chosen
    assert np.hypot(best.x - 1.0, best.y - 0.8) < 0.1
    assert best.height == pytest.approx(0.45, abs=0.015)


def test_what_stands_beyond_the_far_edge_is_no_front_of_the_table() -> None:
    """A body hides its far side. So seats that are seen there over the top do not close it."""
    seats = [Box(x, 0.88, 0.5, 0.04, 0.0, 0.6) for x in (0.3, 0.65, 1.0, 1.35, 1.7)]
    snapshots = round_trip(
        [*table(1.0, 0.5, 2.2, 0.6, 0.74, 0.0), *seats],
        CENTRE,
        views=8,
        radius=0.3,
        mount=mounting(1.9, 60.0),
    )
    near = tuple(each for each in snapshots if each.map_from_base.y < 0.4)
    best = find_tables(near, config=CONFIG)[0]
    assert best.height == pytest.approx(0.74, abs=0.01)
    assert not best.is_closed
    assert best.reason == "the space under it was not seen"


def test_a_large_counter_loses_against_a_table_of_which_little_was_seen() -> None:
    """A front that closes the space under a surface weighs more than its size and its views."""
    counter = Box(1.0, 2.2, 2.4, 0.7, 0.0, 0.9)
    small = table(1.0, 0.6, 0.4, 0.4, 0.7, 0.2)
    snapshots = round_trip([*small, counter], (1.0, 1.9), views=5, radius=2.2, step=0.02)
    far = [snapshot for snapshot in snapshots if snapshot.map_from_base.y < 1.9]
    best, second = find_tables(tuple(far), config=CONFIG)[:2]
    assert best.height == pytest.approx(0.7, abs=0.015)
    assert second.height == pytest.approx(0.9, abs=0.015)
    assert second.area > 4 * best.area
    assert "a front closes" in (second.reason or "")


def test_a_seat_15_mm_above_the_top_is_not_the_top() -> None:
    """The joint height tells a stool beside the table apart."""
    stool = Box(1.0, -0.35, 0.4, 0.4, 0.70, 0.755, 0.3)
    snapshots = round_trip([*TABLE, stool], CENTRE, views=8)
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    assert result.height == pytest.approx(0.74, abs=0.001)
    for view, snapshot in zip(result.views, snapshots, strict=True):
        points = snapshot.map_from_base.apply(snapshot.points_in_base())
        seat = np.hypot(points[..., 0] - 1.0, points[..., 1] + 0.35) < 0.19
        assert ((view.labels == Label.TOP) & seat).sum() < 60


def test_tied_tables_are_named() -> None:
    """Two equal tables seen alike give a warning with the other's place."""
    pair = [*table(0.0, -0.9, 1.0, 0.7, 0.74, 0.0), *table(0.0, 0.9, 1.0, 0.7, 0.74, 0.0)]
    snapshots = round_trip(pair, (0.0, 0.0), views=8, radius=2.4)
    result = segment(snapshots, config=CONFIG, sensors=SENSORS)
    tie = [w for w in result.warnings if w.code == "segmentation.table_tie"]
    assert len(tie) == 1
    assert "--near" in tie[0].message


def test_a_place_without_a_table_names_the_candidates() -> None:
    """--near far from everything is an error that lists where tables are; they are recorded."""
    events: list[object] = []
    views = round_trip(TABLE, CENTRE)
    with pytest.raises(EstimationError, match=r"candidates: --near 1\.0"):
        segment(views, config=CONFIG, sensors=SENSORS, near=(9.0, 9.0), record=events.append)
    (found,) = events
    assert isinstance(found, TablesFound)
    assert found.candidates[0].height == pytest.approx(0.74, abs=0.05)


def test_a_surface_that_gives_no_table_is_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the views labelled as if it were level, whoever chose it."""
    views = round_trip(TABLE, CENTRE, views=3)
    best = find_tables(views, config=CONFIG)[0]
    monkeypatch.setattr(stage, "joint_height", lambda *_: None)
    for choice in ({}, {"near": (best.x, best.y)}, {"candidate": best}):
        events: list[object] = []
        with pytest.raises(EstimationError, match="shows enough of it"):
            segment(views, config=CONFIG, sensors=SENSORS, record=events.append, **choice)
        refused = events[-1]
        assert isinstance(refused, TableRefused)
        assert (refused.candidate.x, refused.candidate.y) == (best.x, best.y)
        assert [view.index for view in refused.views] == [0, 1, 2]
        assert all((view.labels == Label.TOP).sum() > 100 for view in refused.views)


def test_no_table_at_all_is_an_error() -> None:
    """An empty floor, an image without depth, and no image are errors that say so."""
    empty = round_trip([], (0.0, 0.0), views=2)
    dark = tuple(replace(s, depth=np.full_like(s.depth, np.nan)) for s in empty)
    for snapshots in (empty, dark, ()):
        with pytest.raises(EstimationError, match="horizontal surface"):
            segment(snapshots, config=CONFIG, sensors=SENSORS)


def test_a_table_seen_end_by_end_is_one_candidate() -> None:
    """Views that each show only the near part of a table make one candidate of it."""
    snapshots = round_trip(TABLE, CENTRE, mount=mounting(down_deg=35.0))
    best = find_tables(snapshots, config=CONFIG)[0]
    assert best.views == (0, 1, 2, 3, 4, 5)
    assert np.hypot(best.x - 1.0, best.y - 0.5) < 0.1


def test_a_view_that_looks_away_is_set_aside_with_a_reason() -> None:
    """A view of the empty floor sees no table; the others are used."""
    snapshots = list(round_trip(TABLE, CENTRE))
    away = round_trip([], (9.0, 9.0), views=1)[0]
    snapshots[2] = replace(away, index=2)
    result = segment(tuple(snapshots), config=CONFIG, sensors=SENSORS)
    assert not result.views[2].sees_table
    assert result.views[2].reason is not None
    assert result.used == (0, 1, 3, 4, 5)


def test_segmentation_repeats_bit_for_bit() -> None:
    """The same snapshots give the same labels and height."""
    first = segment(round_trip(TABLE, CENTRE, views=3), config=CONFIG, sensors=SENSORS)
    second = segment(round_trip(TABLE, CENTRE, views=3), config=CONFIG, sensors=SENSORS)
    assert first.height == second.height
    for a, b in zip(first.views, second.views, strict=True):
        np.testing.assert_array_equal(a.labels, b.labels)


def test_a_corner_of_a_table_is_chosen_over_the_counter_behind_it(real_recordings: Path) -> None:
    """The counter fills the images; the table is seen in one of three views, at its lower rim."""
    recording = open_recording(real_recordings / "redkitchen_corner.mcap")
    taken = take_snapshots(recording, config=SnapshotsConfig(), sensors=SENSORS)
    calibration = calibrate(taken.snapshots, config=CalibrationConfig(), sensors=SENSORS)
    result = segment(calibration.snapshots, config=CONFIG, sensors=SENSORS)
    assert result.height == pytest.approx(0.711, abs=0.01)
    assert "segmentation.table_tie" in {warning.code for warning in result.warnings}


def test_living_room_chooses_the_side_table(real_recordings: Path) -> None:
    """Of armchair, couches, TV bench and side table, the table of views 3 and 4 is chosen."""
    recording = open_recording(real_recordings / "hsr_living_room.mcap")
    taken = take_snapshots(recording, config=SnapshotsConfig(), sensors=SENSORS)
    calibration = calibrate(taken.snapshots, config=CalibrationConfig(), sensors=SENSORS)
    result = segment(calibration.snapshots, config=CONFIG, sensors=SENSORS)
    assert result.used == (2, 3)
    assert result.height == pytest.approx(0.45, abs=0.02)
    best = next(c for c in result.candidates if c.chosen)
    assert shapely.Polygon(best.hull).area == pytest.approx(0.55**2, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("first", "scale"), [(0, 1.0), (0, 1.005), (1, 1.0)])
def test_the_near_table_is_chosen_whatever_changes_a_little(
    real_recordings: Path, first: int, scale: float
) -> None:
    """Half a percent of depth, or a view less, makes no chair of a table that the images cut."""
    recording = open_recording(real_recordings / "kitchen_near_end.mcap")
    taken = take_snapshots(recording, config=SnapshotsConfig(), sensors=SENSORS).snapshots[first:]
    scaled = tuple(replace(each, depth=each.depth * np.float32(scale)) for each in taken)
    calibration = calibrate(scaled, config=CalibrationConfig(), sensors=SENSORS)
    result = segment(calibration.snapshots, config=CONFIG, sensors=SENSORS)
    assert result.height == pytest.approx(0.727, abs=0.02)


@pytest.mark.slow
def test_kitchen_finds_the_dining_table(real_recordings: Path) -> None:
    """Among chairs, books and counters the dining table is chosen, its height within 1 cm."""
    recording = open_recording(real_recordings / "kitchen.mcap")
    taken = take_snapshots(recording, config=SnapshotsConfig(), sensors=SENSORS)
    assert taken.kind == "keyframes"
    calibration = calibrate(taken.snapshots, config=CalibrationConfig(), sensors=SENSORS)
    result = segment(calibration.snapshots, config=CONFIG, sensors=SENSORS)
    assert result.height == pytest.approx(0.725, abs=0.01)
    assert len(result.used) >= 25
    best = next(c for c in result.candidates if c.chosen)
    assert best.area == pytest.approx(2.15 * 0.9, rel=0.15)
