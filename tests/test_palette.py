"""The palette: every meaning can be read on its background, and is told from the others."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from tablemap import palette
from tablemap.palette import Ink
from tablemap.review.budget import PARTS, WHITE
from tablemap.review.colours import EDGES, LABELS, of_stop

INKS = {name: one for name, one in vars(palette).items() if isinstance(one, Ink)}
LEAST_DISTANCE = 20
"""Of two colours in RGB: nearer ones are taken for the same."""


def test_contrast_is_that_of_the_standard() -> None:
    """Black on white has 21 to 1, a colour on itself 1 to 1, and WCAG's grey #767676 4.54 to 1."""
    assert palette.contrast((0, 0, 0), (255, 255, 255)) == pytest.approx(21.0)
    assert palette.contrast((9, 8, 7), (9, 8, 7)) == pytest.approx(1.0)
    assert palette.contrast((118, 118, 118), (255, 255, 255)) == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("name", INKS)
def test_a_meaning_can_be_seen(name: str) -> None:
    """As points and lines in the viewer, and as text on paper."""
    ink = INKS[name]
    assert palette.contrast(ink.on_dark, palette.BACKGROUND) >= palette.LEAST_VISIBLE
    assert palette.contrast(ink.on_paper, palette.PAPER) >= palette.LEAST_CONTRAST


def test_labels_can_be_read_in_both_themes() -> None:
    """On what the viewer lays under them, measured in pictures of both."""
    dark, light = palette.label_backgrounds()
    assert dark < light
    for background in (dark, light):
        assert palette.contrast(palette.LABEL, background) >= palette.LEAST_CONTRAST


def test_stops_and_parts_can_be_seen() -> None:
    """Each stop's colour on the background, and a part's name on its own colour on the page."""
    for index in range(60):
        assert palette.contrast(of_stop(index), palette.BACKGROUND) >= palette.LEAST_VISIBLE
    for colour in PARTS.values():
        assert palette.contrast(WHITE, colour) >= palette.LEAST_CONTRAST
        assert palette.contrast(colour, palette.BACKGROUND) >= palette.LEAST_VISIBLE


def test_one_colour_has_one_meaning() -> None:
    """No two meanings, labels or kinds of edges look the same in the viewer."""
    meanings = {
        "meanings": {name: one.on_dark for name, one in INKS.items()},
        "labels": dict(LABELS.values()),
        "edges": dict(EDGES.values()),
    }
    for group in meanings.values():
        for (a, first), (b, second) in combinations(group.items(), 2):
            away = float(np.linalg.norm(np.subtract(first, second)))
            assert away >= LEAST_DISTANCE, f"{a} and {b} are {away:.0f} apart"
