"""table.json is written and read by its contract."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tablemap.errors import TablemapError
from tablemap.model import Figure, TableModel, json_schema
from tablemap.model.shapes import SHAPES
from tests.making.models import rectangle_model


def test_a_written_model_reads_back_the_same() -> None:
    """Writing twice gives the same bytes."""
    text = rectangle_model().to_json()
    again = TableModel.from_json(text)
    assert again.to_json() == text
    assert again.surface.dimensions["length"].value == pytest.approx(1.187, abs=1e-6)


def test_a_model_as_written_holds_what_its_file_holds() -> None:
    """A sigma of 5.94997 mm is 5.9 mm, and 5.95 of the file are 6.0: all tell that of the file."""
    made = rectangle_model(sigma=0.00594997, length=1.18700049)
    written = made.as_written()
    assert written != made
    assert written == TableModel.from_json(made.to_json())
    assert written.to_json() == made.to_json()


def test_the_document_has_the_contract_s_fields() -> None:
    """Others script against these names."""
    document = json.loads(rectangle_model().to_json())
    assert document["schema"] == "tablemap/table/1"
    assert {"frame", "floor_z", "surface", "legs", "snapshots", "verdict", "warnings"} <= set(
        document
    )
    assert set(document["surface"]) >= {
        "shape",
        "pose",
        "height",
        "thickness",
        "dimensions",
        "corner_radius",
        "outline",
        "edges",
        "score",
        "alternatives",
    }
    assert set(document["surface"]["pose"]) == {"x", "y", "yaw", "covariance"}
    assert set(document["snapshots"][0]) == {"stamp_ns", "map_from_base", "sigma", "used", "reason"}


def test_unknown_fields_are_ignored() -> None:
    """A later version may add fields."""
    document = json.loads(rectangle_model().to_json())
    document["surface"]["colour"] = "brown"
    document["new"] = [1, 2]
    assert TableModel.from_json(json.dumps(document)) == TableModel.from_json(
        rectangle_model().to_json()
    )


@pytest.mark.parametrize("where", ["surface", "alternatives", "legs"])
def test_a_shape_that_is_none_is_refused(where: str) -> None:
    """With its place in the file and the shapes that there are."""
    document = json.loads(rectangle_model().to_json())
    surface = document["surface"]
    part = {"surface": surface, "alternatives": surface["alternatives"][0]}
    part.get(where, document["legs"][0])["shape"] = "blob"
    with pytest.raises(TablemapError, match=rf"{where}.*expected one of circle,.*found 'blob'"):
        TableModel.from_json(json.dumps(document))


def test_the_schema_lists_the_shapes() -> None:
    """Those of a top, and those of a leg's cross-section."""
    parts = json_schema()["$defs"]
    assert parts["TableSurface"]["properties"]["shape"]["enum"] == list(SHAPES)
    assert parts["TableLeg"]["properties"]["shape"]["enum"] == ["circle", "rectangle"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hello", "JSON"),
        ("[]", "schema"),
        ('{"schema": "tablemap/table/2"}', "tablemap/table/2"),
        ('{"schema": "tablemap/table/1", "frame": "map"}', "damaged"),
    ],
)
def test_what_is_no_model_is_refused_in_a_sentence(text: str, words: str) -> None:
    """No validation report of many lines reaches the user."""
    with pytest.raises(TablemapError, match=words) as caught:
        TableModel.from_json(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "value", "where"),
    [
        (("floor_z",), "0", "floor_z"),
        (("snapshots", 0, "used"), 1, r"snapshots\[0\]\.used"),
        (("surface", "outline", 1), [0.0], r"surface\.outline\[1\]"),
        (("surface", "edges", 0, "status"), "guessed", r"surface\.edges\[0\]\.status"),
        (("surface", "pose", "covariance"), [], r"surface\.pose\.covariance"),
        (("legs", 0, "dimensions"), None, r"legs\[0\]\.dimensions"),
    ],
)
def test_damage_is_said_with_its_place(
    keys: tuple[str | int, ...], value: object, where: str
) -> None:
    """By the names of the fields that lead to it."""
    document = json.loads(rectangle_model().to_json())
    part = document
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    with pytest.raises(TablemapError, match=rf"damaged at {where}: "):
        TableModel.from_json(json.dumps(document))


def test_numbers_of_numpy_become_python_s() -> None:
    """Stages compute with them, JSON knows none."""
    figure = Figure(value=np.float64(1.5), sigma=np.float32(0.25), budget={"noise": np.float64(1)})
    assert (figure.value, figure.sigma, figure.budget) == (1.5, 0.25, {"noise": 1.0})
    assert json.loads(json.dumps(figure.fields())) == figure.fields()


def test_what_changes_a_part_is_checked_too() -> None:
    """There is no way past it."""
    with pytest.raises(TablemapError, match="finite"):
        structs.replace(rectangle_model().surface.height, value=float("inf"))


def test_no_figure_is_ever_nan() -> None:
    """What is not known is null, never NaN."""
    with pytest.raises(ValueError, match="finite"):
        rectangle_model(length=float("nan"))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    """With its path."""
    with pytest.raises(TablemapError, match=r"table\.json"):
        TableModel.load(tmp_path)
