"""Labels of the first view stand clear of the table, of lines and of each other."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from rerun.chunk import RrdReader

from tablemap.geometry import Pose2
from tablemap.model import TableModel
from tablemap.review.clouds import raised
from tablemap.review.current import MOST_PX
from tablemap.review.eyes import overview_eye
from tablemap.review.naming import Naming
from tablemap.review.room import ENDS, HIGH, LABEL_DROP, LETTER, LOW, SIZE, Eye, Room
from tablemap.review.scene import DrawnScene
from tablemap.review.solid import DRAWN_THICKNESS
from tests.making import made_up_run as made_up
from tests.making.reviews import columns, eye_of, eye_of_first_view, write

STOPS = 8


def boxes(
    eye: Eye, places: list[object], texts: list[object], size: tuple[int, int] = SIZE
) -> list[shapely.Polygon]:
    """The labels' rectangles in the picture."""
    pixels, _ = eye.pixels(np.array(places, dtype=np.float64), size)
    wide = [(LETTER * len(str(one)) + ENDS) / 2 for one in texts]
    return [
        shapely.box(x - w, y + LABEL_DROP - HIGH / 2, x + w, y + LABEL_DROP + HIGH / 2)
        for (x, y), w in zip(pixels, wide, strict=True)
    ]


def test_no_name_is_written_over_the_table_or_another_name(tmp_path: Path) -> None:
    """White text cannot be read on the top in the light theme, and not on other text at all."""
    run = made_up.results(stops=STOPS)
    path = write(tmp_path / "run" / "run.rrd", run)
    eye = eye_of_first_view(path)
    model = next(one for one in run if isinstance(one, TableModel))
    top = model.floor_z + model.surface.height.value
    outline = np.array(model.surface.outline)
    levels = [raised(outline, z) for z in (top, top - DRAWN_THICKNESS)]
    pixels, _ = eye.pixels(np.concatenate(levels).astype(np.float64))
    table = shapely.MultiPoint(pixels).convex_hull
    named = []
    for entity in ("/model/dimensions/names", "/registration/bases/names", "/model/beside/names"):
        places = columns(path, entity, "Points3D:positions")[-1]
        texts = columns(path, entity, "Points3D:labels")[-1]
        named += [
            box
            for box, text in zip(boxes(eye, places, texts), texts, strict=True)
            if text and shapely.box(0, 0, *SIZE).contains(box.centroid)
        ]
    assert len(named) > STOPS
    for entity in ("/stop/camera/names",):
        rows = zip(
            columns(path, entity, "Points3D:positions")[-STOPS:],
            columns(path, entity, "Points3D:labels")[-STOPS:],
            strict=True,
        )
        for places, texts in rows:
            (box,) = boxes(eye, places, texts)
            assert box.intersection(table).area < 2 * HIGH
            assert all(box.intersection(other).area < 2 * HIGH for other in named)
    for box in named:
        assert box.intersection(table).area < 2 * HIGH  # pixels are whole
    for one, other in combinations(named, 2):
        assert one.intersection(other).area < 2 * HIGH


@pytest.fixture(scope="module")
def review(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The review of a made-up run."""
    path = tmp_path_factory.mktemp("room") / "run.rrd"
    return write(path, made_up.results(stops=STOPS))


def drawn(path: Path, below: tuple[str, ...]) -> np.ndarray:
    """All points (n, 3) that entities show last, those along lines included."""
    rows: dict[str, np.ndarray] = {}
    for chunk in RrdReader(path).stream():
        if chunk.entity_path.startswith(below) and "/names" not in chunk.entity_path:
            batch = chunk.to_record_batch().to_pydict()
            for points in batch.get("Points3D:positions", []):
                rows[chunk.entity_path] = np.array(points).reshape(-1, 3)
            for strips in batch.get("LineStrips3D:strips", []):
                rows[chunk.entity_path] = np.concatenate(
                    [np.linspace(a, b, 60) for strip in strips for a, b in pairwise(strip)]
                )
    assert len(rows) > 0
    return np.concatenate(list(rows.values()))


@pytest.mark.parametrize(
    ("names", "view", "below", "size"),
    [
        ("/surface/chosen", "Edges by kind", ("/model/uncertainty", "/outline/edges/table"), SIZE),
        ("/legs", "Legs", ("/legs/", "/surface/candidates/rectangle"), SIZE),
        ("/legs/rejected", "Legs", ("/legs/",), SIZE),
        ("/segmentation/candidates/chosen", "Segmented", ("/segmentation/candidates/",), LOW),
        ("/registration/stops", "As registered", ("/registration/after", "/registration/st"), LOW),
        ("/registration/localised_stops", "As localised", ("/registration/before",), LOW),
        ("/model/dimensions", "Table and stops", ("/model/dim", "/registration/bases"), SIZE),
    ],
)
def test_names_stand_clear_of_points_and_lines(
    names: str, view: str, below: tuple[str, ...], size: tuple[int, int], review: Path
) -> None:
    """In each view as its eye begins: white on bright points cannot be read in the light theme."""
    eye = eye_of(review, view)
    texts = columns(review, f"{names}/names", "Points3D:labels")[-1]
    places = columns(review, f"{names}/names", "Points3D:positions")[-1]
    pixels, _ = eye.pixels(drawn(review, below), size)
    shown = boxes(eye, places, texts, size)
    assert shown
    for box in shown:
        left, top, right, bottom = box.bounds
        inside = (pixels > (left + 1, top + 1)) & (pixels < (right - 1, bottom - 1))
        assert inside.all(axis=1).sum() == 0


def test_a_name_that_steps_aside_is_joined_to_what_it_names() -> None:
    """By a line that ends at the label's side and crosses no other label."""
    eye = Eye((0.0, -3.0, 3.0), (0.0, 0.0, 0.0))
    room = Room(eye)
    cloud = np.random.default_rng(0).uniform(-0.4, 0.4, (4000, 3)) * [1, 1, 0]
    room.take_points(cloud)
    texts = [str(k) for k in range(6)]
    anchors = np.column_stack([np.linspace(-0.2, 0.2, 6), np.zeros((6, 2))])
    placed = room.names(texts, anchors, away=np.array([0.0, -1.0]))
    assert len(placed.leaders) == 6
    labels = boxes(eye, list(placed.places), list(texts))
    for k, (leader, anchor) in enumerate(zip(placed.leaders, anchors, strict=True)):
        assert np.allclose(leader[0], anchor)
        line = shapely.LineString(eye.pixels(leader)[0])
        assert labels[k].distance(shapely.Point(line.coords[-1])) < 1.0
        for other in (*labels[:k], *labels[k + 1 :]):
            assert line.intersection(other).length < 2.0
    free = Room(eye).names(["free"], anchors[:1], away=np.array([0.0, -1.0]))
    assert free.leaders == []


def test_another_table_has_its_name_in_the_first_view(review: Path) -> None:
    """Clear of both tables; a surface without a model has none."""
    (texts,) = columns(review, "/tables/01/name", "Points3D:labels")
    assert texts == ["table 01"]
    assert columns(review, "/tables/02/name", "Points3D:labels") == []
    eye = eye_of_first_view(review)
    (box,) = boxes(eye, columns(review, "/tables/01/name", "Points3D:positions")[-1], texts)
    for table in ("/model/top", "/tables/01/model/top"):
        corners = columns(review, table, "Mesh3D:vertex_positions")[-1]
        hull = shapely.MultiPoint(eye.pixels(np.array(corners))[0]).convex_hull
        assert box.intersection(hull).area < 2 * HIGH


def test_the_current_stop_is_no_large_thing(review: Path) -> None:
    """Its camera stands out and hides no table: it is small in the picture of the first view."""
    eye = eye_of_first_view(review)
    rows = columns(review, "/stop/camera", "LineStrips3D:strips")
    assert len(rows) >= STOPS
    for strips in rows[-STOPS:]:
        pixels, _ = eye.pixels(np.array(strips[0]))
        assert 10 < np.ptp(pixels, axis=0).max() < 1.15 * MOST_PX


def test_the_eye_stands_where_no_camera_hides_the_top() -> None:
    """Of the angles that it may take; with the stops moved round, it goes elsewhere."""
    view = np.array([[0.0, 0, 1.2], [1, 0.3, 0.9], [1, -0.3, 0.9], [1, 0.3, 0.5], [1, -0.3, 0.5]])
    for turn in np.linspace(0.0, 1.0, 6):
        stops = [turn - np.pi / 2 + k * np.pi / 4 for k in range(8)]
        scene = DrawnScene(
            localised=[Pose2(np.cos(a), np.sin(a), a + np.pi) for a in stops],
            cameras=[(np.eye(4), view)] * 8,
            centre=(0.0, 0.0),
            extent=0.5,
            height=0.7,
        )
        eye = overview_eye(scene)
        ring = np.linspace(0, 2 * np.pi, 60)
        top = 0.44 * np.column_stack([np.cos(ring), np.sin(ring), 0 * ring]) + [0, 0, 0.7]
        hull = shapely.MultiPoint(eye.pixels(top)[0]).convex_hull
        for pose in scene.localised:
            tip = pose.apply(view[:1])[0]
            if np.subtract(eye.position, tip) @ tip > 0:  # before the table, not behind it
                assert not hull.contains(shapely.Point(eye.pixels(tip[None])[0][0]))


def test_a_label_without_hindrance_stays() -> None:
    """And one that something hides steps aside, first to where it was told to."""
    eye = Eye((0.0, -3.0, 3.0), (0.0, 0.0, 0.0))
    anchor, away = np.array([0.2, 0.1, 0.0]), np.array([1.0, 0.0])
    room = Room(eye)
    assert np.allclose(room.place("free", anchor, away=away), anchor)
    room.take_line(np.array([[0.2, -2.0, 0.0], [0.2, 2.0, 0.0]]), width=5)
    moved = room.place("free", anchor, away=away) - anchor
    assert moved[2] == 0.0
    assert moved[0] > 0.1


def test_before_a_registration_there_are_no_names() -> None:
    """Nothing is drawn of stops that nobody registered."""
    assert Naming().lines(None) == []  # type: ignore[arg-type]


@pytest.mark.parametrize("place", [(9.0, 0.0, 0.0), (0.0, -9.0, 9.0)])
def test_what_is_not_in_the_picture_stays(place: tuple[float, float, float]) -> None:
    """Beside the picture and behind the eye."""
    room = Room(Eye((0.0, -3.0, 3.0), (0.0, 0.0, 0.0)))
    anchor = np.array(place)
    assert np.array_equal(room.place("far", anchor, away=np.array([1.0, 0.0])), anchor)
