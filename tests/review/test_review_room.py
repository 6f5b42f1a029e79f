"""Labels of the first view stand clear of the table, of lines and of each other."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import shapely

from tablemap.model import TableModel
from tablemap.review.clouds import raised
from tablemap.review.naming import Naming
from tablemap.review.room import ENDS, HIGH, LABEL_DROP, LETTER, SIZE, Eye, Room
from tablemap.review.solid import DRAWN_THICKNESS
from tests.making import made_up_run as made_up
from tests.making.reviews import columns, eye_of_first_view, write

STOPS = 8


def boxes(eye: Eye, places: list[object], texts: list[object]) -> list[shapely.Polygon]:
    """The labels' rectangles in the picture."""
    pixels, _ = eye.pixels(np.array(places, dtype=np.float64))
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
    for entity in ("/model/dimensions/names", "/registration/bases/names"):
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
