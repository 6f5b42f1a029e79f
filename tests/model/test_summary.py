"""The few lines that people read first."""

from __future__ import annotations

from msgspec import structs

from tablemap import model as m
from tablemap.model.summary import doubts, judged, line, summary_rows
from tests.making.models import rectangle_model

UNSEEN = m.WarningEntry(
    code="accuracy.unseen_side",
    stage="surface",
    message="1 of 4 sides was not seen.",
    stamp_ns=None,
)
NOTE = m.WarningEntry(
    code="legs.no_laser", stage="legs", message="There is no laser.", stamp_ns=None
)


def doubted() -> m.TableModel:
    """A rectangle with a side that was not seen, and a note."""
    verdict = m.Verdict(level="doubtful", reasons=(UNSEEN.message,))
    return structs.replace(rectangle_model(), warnings=(NOTE, UNSEEN), verdict=verdict)


def test_a_verdict_in_one_line_has_the_codes_of_its_doubts() -> None:
    """A table beside the chosen one has one line: it says why it is doubtful; notes are none."""
    assert judged(doubted()) == "doubtful (accuracy.unseen_side)"
    assert line(doubted()).endswith(", doubtful (accuracy.unseen_side)")
    assert doubts(doubted()) == ["accuracy.unseen_side: 1 of 4 sides was not seen."]
    assert line(rectangle_model()).endswith(", good")


def test_a_polygon_has_its_extent() -> None:
    """It has no dimensions, and its size is what is read first; along its own axes."""
    rectangle = rectangle_model(length=1.2, width=0.8, yaw=0.7)
    surface = structs.replace(rectangle.surface, shape="polygon", dimensions={})
    polygon = structs.replace(rectangle, surface=surface)
    assert dict(summary_rows(polygon))["extent"] == "1.2000 x 0.8000 m over all"
    assert "extent" not in dict(summary_rows(rectangle))


def test_a_circle_has_no_heading() -> None:
    """Its yaw is 0 by definition, and no sigma of it says anything."""
    rectangle = rectangle_model()
    surface = structs.replace(rectangle.surface, shape="circle", dimensions={})
    circle = structs.replace(rectangle, surface=surface)
    assert dict(summary_rows(rectangle))["place in map"].endswith("mm, yaw 21.20 +- 0.11 deg")
    assert dict(summary_rows(circle))["place in map"] == "(0.310, -0.220) m +- 2 mm"
