"""What a review holds of the chosen table is shown by a view: nothing is logged for nobody."""

from __future__ import annotations

from pathlib import Path

import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from tablemap.config import ReviewConfig
from tablemap.review import Reviewer
from tablemap.review.blueprint import blueprint
from tests.making import made_up_run as made_up
from tests.making.marked_run import mended

NOT_DRAWN = ("/", "/__properties", "/tf", "/segmentation")
"""Of the file itself, poses between frames, and the colours of the labels."""


def views(part: object) -> list[rrb.View]:
    """All views of a layout."""
    if isinstance(part, rrb.View):
        return [part]
    return [one for inner in getattr(part, "contents", []) for one in views(inner)]


def is_in(expression: str, path: str) -> bool:
    """Tell whether an expression of a view's contents has an entity."""
    if expression.endswith("/**"):
        return path == expression[:-3] or path.startswith(expression[:-2])
    return path == expression


def shows(view: rrb.View, path: str) -> bool:
    """Tell whether a view shows an entity: of its expressions the most exact one decides."""
    said = [view.contents] if isinstance(view.contents, str) else list(view.contents or [])
    named = [(one.startswith("- "), one.removeprefix("- ")) for one in map(str, said)]
    full = [(is_out, one.replace("$origin", str(view.origin))) for is_out, one in named]
    met = [(len(one), not is_out) for is_out, one in full if is_in(one, path)]
    return max(met, default=(0, False))[1]


def unseen(stops: int, folder: Path) -> set[str]:
    """What a review of so many stops holds, and no view of its layout shows."""
    path = folder / f"{stops}.rrd"
    config = ReviewConfig()
    with Reviewer(path, run_id="shown", recording_name="made up", config=config) as reviewer:
        for one in mended(made_up.results(stops=stops), view=1):
            reviewer(one)
        shown = views(blueprint(reviewer._stream.scene).root_container)
    logged = {chunk.entity_path for chunk in RrdReader(path).stream()}
    return {
        one
        for one in logged
        if not any(shows(view, one) for view in shown)
        and one not in NOT_DRAWN
        and not one.startswith(("/__properties/", "/tf/", "/tables/"))
    }


def test_all_that_is_logged_has_a_view(tmp_path: Path) -> None:
    """Where stops are few, or where they are many: then they are drawn otherwise."""
    assert unseen(6, tmp_path) & unseen(18, tmp_path) == set()
