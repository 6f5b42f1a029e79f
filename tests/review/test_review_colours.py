"""The colours of a review: its labels can be read in both themes, and each tab explains its own."""

from __future__ import annotations

from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from tablemap import palette
from tablemap.review.legend import LEGENDS
from tests.making import made_up_run as made_up
from tests.making.reviews import write


@pytest.fixture(scope="module")
def review(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The review of a made-up run."""
    return write(tmp_path_factory.mktemp("colours") / "run.rrd", made_up.results(stops=8))


def test_all_shown_labels_have_the_labels_colour(review: Path) -> None:
    """Text is drawn in its entity's colour, and no other one can be read in both themes."""
    white = (255 << 24) + (255 << 16) + (255 << 8) + 255
    assert palette.LABEL == (255, 255, 255)
    found = 0
    for chunk in RrdReader(review).stream():
        rows = chunk.to_record_batch().to_pydict()
        for name in [one for one in rows if one.endswith(":labels")]:
            kind, texts = name.split(":")[0], rows[name]
            shown = rows.get(f"{kind}:show_labels", [None] * len(texts))
            for labels, is_shown, colours in zip(texts, shown, rows[f"{kind}:colors"], strict=True):
                if labels and is_shown != [False]:
                    assert set(colours) == {white}, chunk.entity_path
                    found += len(labels)
    assert found > 50


def test_each_view_with_labels_has_the_palette_s_background(review: Path) -> None:
    """Else the light theme would lay white under colours that are made for a dark background."""
    kinds: dict[str, str] = {}
    backgrounds: dict[str, int] = {}
    reader = RrdReader(review)
    for store in reader.blueprints():
        for chunk in reader.stream(store=store):
            rows = chunk.to_record_batch().to_pydict()
            path = chunk.entity_path
            for kind in rows.get("ViewBlueprint:class_identifier", []):
                kinds[path] = kind[0]
            for name in rows:
                if name.endswith("Background:color"):
                    backgrounds[path.rsplit("/", 1)[0]] = rows[name][0][0]
    named = {view: str(kind) for view, kind in kinds.items()}
    assert len(named) > 20
    red, green, blue = palette.BACKGROUND
    dark = (red << 24) + (green << 16) + (blue << 8) + 255
    for view, kind in named.items():
        if kind not in ("TextDocument", "TextLog"):
            assert backgrounds.get(view) == dark, kind


def test_every_legend_is_in_the_file(review: Path) -> None:
    """Each strip has its colours and its words."""
    there = {chunk.entity_path for chunk in RrdReader(review).stream()}
    assert {f"/legend/{name}/words" for name in LEGENDS} <= there
