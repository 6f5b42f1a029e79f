"""Figures of several models: their middle, their width, and which stand out."""

from __future__ import annotations

import math

import pytest
from msgspec import structs

from tablemap.archive.spread import FigureSpread, spread
from tablemap.errors import TablemapError
from tablemap.model import TableModel
from tests.making.models import rectangle_model


def named(models: list[TableModel], name: str) -> FigureSpread:
    """Return the spread of the figure of that name."""
    (found,) = (each for each in spread(models).figures if each.name == name)
    return found


def test_the_middle_is_a_median() -> None:
    """One wrong run moves it to its neighbour at most, and is named."""
    lengths = (1.186, 1.187, 1.188, 1.187, 1.400)
    found = named([rectangle_model(length=each) for each in lengths], "length")
    assert (found.median, found.low, found.high) == (1.187, 1.186, 1.400)
    assert found.outliers == (4,)
    assert found.sigma == 0.002


def test_what_a_sigma_admits_is_no_outlier() -> None:
    """Equal but for one, which is 1.9 mm off at a sigma of 2 mm."""
    lengths = (1.187, 1.187, 1.187, 1.1889)
    assert named([rectangle_model(length=each) for each in lengths], "length").outliers == ()


def test_yaws_on_both_sides_of_the_wrap_are_neighbours() -> None:
    """A rectangle repeats after half a turn."""
    models = [rectangle_model(yaw=yaw) for yaw in (0.01, math.pi - 0.01, 0.02)]
    found = named(models, "yaw")
    assert found.high - found.low == pytest.approx(0.03)
    assert found.outliers == ()


def test_a_figure_that_one_lacks_is_that_of_the_others() -> None:
    """The one without it is said, and no outlier."""
    bare = rectangle_model()
    surface = structs.replace(bare.surface, shape="mesh", dimensions={})
    models = [rectangle_model(), structs.replace(bare, surface=surface), rectangle_model()]
    found = named(models, "length")
    assert found.values == (1.187, None, 1.187)
    assert (found.median, found.outliers) == (1.187, ())


def test_places_in_several_frames_are_not_compared() -> None:
    """Nobody knows how the frames lie."""
    other = structs.replace(rectangle_model(), frame="odom")
    found = spread([rectangle_model(), other, rectangle_model()])
    assert {"x", "y", "yaw"}.isdisjoint(each.name for each in found.figures)
    assert ("frame", ("map", "odom", "map")) in found.words


def test_two_models_have_no_spread() -> None:
    """They are compared."""
    with pytest.raises(TablemapError, match="three models or more, found 2"):
        spread([rectangle_model(), rectangle_model()])
