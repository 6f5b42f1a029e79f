"""Two models are compared figure by figure, against what their sigmas allow."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import pytest
from msgspec import structs

from tablemap.archive.comparison import Comparison, Difference, compare
from tablemap.archive.drawing import draw_both
from tests.making.models import rectangle_model


def named(comparison: Comparison, name: str) -> Difference:
    """Return the one figure of that name."""
    (found,) = (each for each in comparison.figures if each.name == name)
    return found


def test_a_model_is_itself() -> None:
    """No difference, full overlap, four legs."""
    same = compare(rectangle_model(), rectangle_model())
    assert {each.difference for each in same.figures} == {0.0}
    assert same.overlap == pytest.approx(1.0)
    assert same.farthest == pytest.approx(0.0, abs=1e-9)
    assert sum(each.name.endswith("place") for each in same.figures) == 4
    assert all(a == b for _, a, b in same.words)


def test_differences_are_counted_in_both_sigmas_together() -> None:
    """6 mm at 2 mm each are 2.1 sigmas."""
    found = compare(rectangle_model(), rectangle_model(length=1.193))
    length = named(found, "length")
    assert length.difference == pytest.approx(0.006)
    assert length.sigma == pytest.approx(0.002 * math.sqrt(2))
    assert length.sigmas == pytest.approx(3 / math.sqrt(2))
    assert named(found, "width").difference == 0.0


def test_moved_tables_overlap_less() -> None:
    """By 10 cm along x: the farthest point is 10 cm away and x says so."""
    found = compare(rectangle_model(yaw=0.0), rectangle_model(yaw=0.0, x=0.41))
    assert named(found, "x").difference == pytest.approx(0.10)
    assert found.farthest == pytest.approx(0.10, abs=1e-6)
    assert found.overlap == pytest.approx(1.087 / 1.287, abs=1e-6)
    assert named(found, "leg 1 place").difference == pytest.approx(0.10)


def test_a_rectangle_turned_by_almost_half_a_turn_is_nearly_itself() -> None:
    """Yaw wraps at the shape's symmetry."""
    found = compare(rectangle_model(yaw=0.01), rectangle_model(yaw=math.pi - 0.01))
    assert named(found, "yaw").difference == pytest.approx(-0.02)


@pytest.mark.parametrize(
    ("shapes", "period"),
    [
        (("polygon", "polygon"), math.pi),
        (("rectangle", "parallelogram"), math.pi),
        (("rectangle", "square"), math.pi / 2),
    ],
)
def test_yaws_differ_by_less_than_either_shape_can_tell(
    shapes: tuple[str, str], period: float
) -> None:
    """A yaw just above nought and one just below the period are neighbours."""
    models = [
        structs.replace(model, surface=structs.replace(model.surface, shape=shape))
        for model, shape in zip(
            (rectangle_model(yaw=0.01), rectangle_model(yaw=period - 0.01)), shapes, strict=True
        )
    ]
    assert named(compare(*models), "yaw").difference == pytest.approx(-0.02)


def test_a_circle_s_yaw_is_not_compared() -> None:
    """It has none, whatever the other has."""
    model = rectangle_model()
    round_ = structs.replace(model, surface=structs.replace(model.surface, shape="circle"))
    assert "yaw" not in {each.name for each in compare(model, round_).figures}


def test_a_lost_leg_pairs_no_other() -> None:
    """Three pairs of three legs and four."""
    found = compare(rectangle_model(), rectangle_model(legs=3))
    places = [each for each in found.figures if each.name.endswith("place")]
    assert [each.difference for each in places] == [0.0, 0.0, 0.0]


def test_no_sigma_no_count() -> None:
    """A figure without a covariance behind it is compared without one."""
    bare = rectangle_model()
    height = structs.replace(bare.surface.height, sigma=None)
    bare = structs.replace(bare, surface=structs.replace(bare.surface, height=height))
    found = named(compare(rectangle_model(height=0.7), bare), "height")
    assert found.difference == pytest.approx(0.043)
    assert found.sigmas is None


def test_tables_of_two_frames_are_compared_without_their_place() -> None:
    """Nobody knows how the frames lie."""
    other = structs.replace(rectangle_model(), frame="odom")
    found = compare(rectangle_model(), other)
    assert (found.overlap, found.farthest) == (None, None)
    assert "x" not in {each.name for each in found.figures}
    assert ("frame", "map", "odom") in found.words


def test_the_drawing_is_svg_with_both_outlines() -> None:
    """Two groups: an outline and four legs each; names are text, whatever they hold."""
    text = draw_both(rectangle_model(), rectangle_model(x=0.5), names=("a <1>", "b & c"))
    root = ElementTree.fromstring(text)
    groups = root.findall("{*}g")
    assert [len(list(group)) for group in groups] == [5, 5]
    assert [each.text for each in root.findall("{*}text")] == ["a <1>", "b & c", "0.5 m in map"]
    width = float(root.attrib["width"])
    for polygon in root.iter("{http://www.w3.org/2000/svg}polygon"):
        for corner in polygon.attrib["points"].split():
            assert 0 < float(corner.split(",")[0]) < width
