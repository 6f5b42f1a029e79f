"""A base whose height and tilt drift in the fixed frame stands on its floor all the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from tablemap.geometry import Floats
from tablemap.stages.snapshots import Snapshot
from tablemap.stages.snapshots.grounding import on_the_ground
from tests.making.round_trips import mounting, round_trip, table

VIEWS = 6


def leans(*, rise: float, tilt_deg: float) -> list[Floats]:
    """Return (4, 4) poses of the base in the fixed frame, above its place there, one a view."""
    found = []
    for i in range(VIEWS):
        lean = np.eye(4)
        lean[2, 3] = rise * i / (VIEWS - 1)
        turn = [tilt_deg * np.sin(i), tilt_deg * np.cos(i)]
        lean[:3, :3] = Rotation.from_euler("xy", turn, degrees=True).as_matrix()
        found.append(lean)
    return found


def lap(of_base: list[Floats], *, is_true: bool) -> list[Snapshot]:
    """Return views of a table; the base leans as told, and its pose says so if not ``is_true``."""
    views = []
    for i, lean in enumerate(of_base):
        seen = round_trip(
            table(0.0, 0.0, 1.2, 0.8, 0.74, 0.3),
            (0.0, 0.0),
            views=VIEWS,
            mount=lean @ mounting() if is_true else mounting(),
            recorded_mount=lean @ mounting(),
        )[i]
        views.append(replace(seen, base_z=float(lean[2, 3])))
    return views


def test_a_drift_in_height_and_tilt_is_taken_back() -> None:
    """The camera is where it is mounted in the base, and the note says how much it drifted."""
    drifted = lap(leans(rise=0.12, tilt_deg=1.0), is_true=False)
    views, (note,) = on_the_ground(drifted, [mounting()] * VIEWS)
    assert note.code == "snapshots.grounded"
    assert "rises by 12 cm and tilts by up to 1.0 degrees" in note.message
    for view in views:
        np.testing.assert_array_equal(view.base_from_camera, mounting())
        assert view.base_z == 0.0


def test_a_base_that_really_leans_is_believed() -> None:
    """Where the floor lies still in the fixed frame, height and tilt are the base's own."""
    leaning = lap(leans(rise=0.12, tilt_deg=1.0), is_true=True)
    views, notes = on_the_ground(leaning, [mounting()] * VIEWS)
    assert not notes
    for view, before in zip(views, leaning, strict=True):
        assert view is before


def test_a_level_base_needs_no_floor() -> None:
    """Millimetres and tenths of a degree are left as they are."""
    level = lap(leans(rise=0.005, tilt_deg=0.1), is_true=False)
    views, notes = on_the_ground(level, [mounting()] * VIEWS)
    assert not notes
    assert all(view is before for view, before in zip(views, level, strict=True))
