"""The model in the camera's images: its lines lie where the images show the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from tablemap.events import OfTable, OtherTable
from tablemap.model import TableModel
from tablemap.review.projection import edge_points_seen, in_image, places_apart
from tablemap.stages.outline import Outline
from tests.making import made_up_run as made_up
from tests.making.reviews import columns, write

STOPS = 8
FLOOR = 0.2
"""Height of the floor in the map, metres."""


def top_edge() -> np.ndarray:
    """The top's closed outline (5, 3) in a map whose floor is not at nought."""
    ring = made_up.outline()
    ring = np.concatenate([ring, ring[:1]])
    return np.column_stack([ring, np.full(len(ring), FLOOR + made_up.HEIGHT)])


def pose(index: int) -> np.ndarray:
    """A stop's true pose (4, 4) on that floor."""
    lifted = made_up.true_pose(index, STOPS).lifted()
    lifted[2, 3] = FLOOR
    return lifted


@pytest.mark.parametrize("index", range(STOPS))
def test_the_outline_lies_on_the_edge_that_the_image_shows(index: int) -> None:
    """Within a pixel of where the top's pixels end, two in a sharp corner, from every stop."""
    shot = made_up.snapshot(made_up.MadeUpRecording(stops=STOPS), index)
    is_top = np.abs(shot.points_in_base()[..., 2] - made_up.HEIGHT) < 0.002
    is_top = ndimage.binary_fill_holes(is_top)
    rim = is_top ^ ndimage.binary_erosion(is_top, border_value=1)
    away = ndimage.distance_transform_edt(~rim)
    pieces = in_image(shot, pose(index), top_edge(), dashed=False)
    pixels = np.concatenate(pieces)
    columns, rows = np.floor(pixels).astype(int).T
    has_depth = (columns >= 8) & (columns < made_up.CAMERA.width) & (rows < made_up.CAMERA.height)
    assert has_depth.sum() > 100
    apart = away[rows[has_depth], columns[has_depth]]
    assert np.percentile(apart, 98) <= 1.0
    assert apart.max() <= 2.5


def test_a_dashed_line_has_gaps_and_stays_in_place() -> None:
    """Half of what the solid one covers, and each of its points is one of the solid line's."""
    shot = made_up.snapshot(made_up.MadeUpRecording(stops=STOPS), 0)
    solid = np.concatenate(in_image(shot, pose(0), top_edge(), dashed=False))
    pieces = in_image(shot, pose(0), top_edge(), dashed=True)
    dashed = np.concatenate(pieces)
    assert len(pieces) > 10
    assert 0.3 < len(dashed) / len(solid) < 0.7
    assert set(map(tuple, dashed.tolist())) <= set(map(tuple, solid.tolist()))


def test_numbers_of_lines_that_coincide_stand_apart() -> None:
    """Each on its own line, side by side where the lines lie over each other."""
    line = np.column_stack([np.linspace(0, 90, 91), np.full(91, 40.0)]).astype(np.float32)
    places = places_apart({k: [line + 0.1 * k] for k in range(4)})
    for k, place in places.items():
        assert np.abs(line + 0.1 * k - place).max(axis=1).min() < 1e-4
    apart = [np.linalg.norm(places[a] - places[b]) for a in range(4) for b in range(a)]
    assert min(apart) > 20.0


def test_what_is_behind_the_camera_is_not_drawn() -> None:
    """A line that runs from before the camera to behind it ends in the image."""
    shot = made_up.snapshot(made_up.MadeUpRecording(stops=STOPS), 0)
    seen = pose(0) @ np.array([[1.5, 0.0, 0.0, 1.0], [-3.0, 0.0, 0.0, 1.0]]).T
    pieces = in_image(shot, pose(0), seen[:3].T, dashed=False)
    assert len(pieces) == 1
    assert np.isfinite(pieces[0]).all()
    behind = pose(0) @ np.array([[-1.0, 0.0, 0.0, 1.0], [-3.0, 0.0, 0.0, 1.0]]).T
    assert in_image(shot, pose(0), behind[:3].T, dashed=False) == []


def test_another_table_has_one_image_wherever_the_cursor_is(tmp_path: Path) -> None:
    """The one that shows most of its edge, with its lines: those of that snapshot and no other."""
    run = made_up.results(stops=STOPS)
    model = next(one for one in run if isinstance(one, TableModel))
    outline = next(
        one.result for one in run if isinstance(one, OfTable) and isinstance(one.result, Outline)
    )
    others = [OtherTable(1, model) if isinstance(one, OtherTable) else one for one in run]
    path = write(tmp_path / "other" / "run.rrd", others)
    seen = edge_points_seen(outline)
    best = max((k for k in seen if k != 5), key=lambda k: seen[k])  # stop 5 is not used
    (lines,) = {str(one) for one in columns(path, "/tables/01/view/outline", "LineStrips2D:strips")}
    own = columns(path, "/tables/01/camera/model/outline", "LineStrips2D:strips")
    stamps = columns(path, "/tables/01/camera/model/outline", "snapshot")
    at = {str(stamp): str(strips) for stamp, strips in zip(stamps, own, strict=True)}
    assert at[str(best)] == lines
    assert len(set(at.values())) == STOPS
    images = columns(path, "/tables/01/view/image", "EncodedImage:blob")
    images += columns(path, "/tables/01/view/image", "EncodedDepthImage:blob")
    assert images
