"""What is known of a shape is read from its record: nothing else asks for shapes by their names."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely
from msgspec import structs

import tablemap
from tablemap import model as m
from tablemap.archive.comparison import compare
from tablemap.cli.printing import size_text
from tablemap.config import load_config
from tablemap.errors import TablemapError
from tablemap.evaluation.metrics import score
from tablemap.evaluation.truth import Truth
from tablemap.export import export_model
from tablemap.export.building import build
from tablemap.export.registry import all_formats
from tablemap.geometry import Pose2
from tablemap.model import TableModel, json_schema
from tablemap.model.shapes import MESH, SHAPES, ShapeRecord, shape_named
from tablemap.model.summary import summary_rows
from tablemap.review.dimensions import log_dimensions
from tablemap.review.page.plan import plan
from tablemap.review.room import Eye, Room
from tablemap.review.text import surface as surface_text
from tablemap.simulation import load_scenario, scenario_names
from tablemap.stages.legs.layout import Frame, symmetric_sets
from tablemap.stages.surface import Surface
from tablemap.stages.surface.shapes.registry import POLYGONS, PRIMITIVES
from tests.making import made_up_run
from tests.making.models import rectangle_model

BLOB = ShapeRecord(
    name="blob",
    adjective="blobby",
    lengths=("reach", "breadth"),
    angle="lean",
    symmetry=2 * math.pi / 3,
    is_mirrored=False,
    corners=3,
)
SIZES = {"reach": 1.187, "breadth": 0.806, "lean": 1.2}

OTHER_WORDS = {
    "evaluation/published.py": set(SHAPES),  # scenarios, and what the report called them
    "export/formats/moveit.py": {"mesh"},  # a solid's triangles
    "export/formats/urdf.py": {"mesh"},
    "simulation/scenario.py": {"polygon"},  # legs at the corners
    "simulation/table.py": {"polygon"},
}
"""Where a word that names a shape means something else."""


@pytest.fixture(autouse=True)
def _known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SHAPES, BLOB.name, BLOB)


def blob(**changes: Any) -> TableModel:
    """Return a blob that is as large as the rectangle."""
    model = rectangle_model(**changes)
    dimensions = {
        name: m.Dimension(value=value, sigma=0.002, status="measured")
        for name, value in SIZES.items()
    }
    surface = structs.replace(model.surface, shape=BLOB.name, dimensions=dimensions)
    return structs.replace(model, surface=surface)


def test_only_the_records_name_shapes() -> None:
    """No literal of the package's code is a shape's name, apart from words that mean another."""
    package = Path(tablemap.__file__).parent
    found = []
    for file in sorted(package.rglob("*.py")):
        home = file.relative_to(package).as_posix()
        known = set() if home == "model/shapes.py" else set(SHAPES) - OTHER_WORDS.get(home, set())
        found += [
            f"{home}:{node.lineno}: {node.value}"
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
            if isinstance(node, ast.Constant) and node.value in known
        ]
    assert found == []


def test_every_shape_has_its_fit_and_a_scenario() -> None:
    """Apart from the hull, which is there where no fit is."""
    records = set(SHAPES.values()) - {BLOB, MESH}
    assert {fit.record for fit in (*PRIMITIVES, *POLYGONS)} == records
    drawn = {load_scenario(name).table.shape for name in scenario_names()}
    assert drawn == {record.name for record in records}


def test_an_unknown_shape_is_an_error() -> None:
    """With the ones that there are."""
    with pytest.raises(TablemapError, match=r"circle, .*, blob.*'blot'"):
        shape_named("blot")


def test_a_model_of_a_new_shape_is_read_and_listed() -> None:
    """Its file is read back, the schema has its name, and people read its figures."""
    text = blob().to_json()
    assert TableModel.from_json(text).to_json() == text
    assert BLOB.name in json_schema()["$defs"]["TableSurface"]["properties"]["shape"]["enum"]
    rows = dict(summary_rows(blob()))
    assert rows["reach"] == "1.1870 m +- 2.0 mm"
    assert rows["lean"] == "68.75 +- 0.11 deg"
    assert size_text(BLOB.name, SIZES) == "1.187 x 0.806"


def test_two_models_of_a_new_shape_are_compared_by_its_symmetry() -> None:
    """Yaws on either side of a third of a turn are neighbours."""
    found = compare(blob(yaw=0.01), blob(yaw=BLOB.yaw_period - 0.01))
    figures = {row.name: row.difference for row in found.figures}
    assert figures["yaw"] == pytest.approx(-0.02)
    assert {"reach", "breadth", "lean"} <= figures.keys()


def test_a_new_shape_is_scored_by_its_own_figures() -> None:
    """Its lengths with their sigmas; its legs in its own frame, whatever the snapshots' heading."""
    model = blob()
    pose = model.surface.pose
    truth = Truth.read(
        {
            "surface": {
                "shape": BLOB.name,
                "dimensions": SIZES,
                "pose": {"x": pose.x, "y": pose.y, "yaw": pose.yaw + BLOB.yaw_period},
            },
            "legs": [
                {"shape": leg.shape, "x": leg.x, "y": leg.y, "dimensions": {"diameter": 0.05}}
                for leg in model.legs
            ],
            "snapshots": [
                {"stamp_ns": each.stamp_ns, "map_from_base": each.map_from_base.fields()}
                for each in model.snapshots
            ],
        }
    )
    about = Pose2(pose.x, pose.y, 0.0)
    motion = about @ Pose2(yaw=0.01) @ about.inverse()
    snapshots = []
    for each in model.snapshots:
        at = each.map_from_base
        place = motion @ Pose2(at.x, at.y, at.yaw)
        turned = m.PlanarPose(x=place.x, y=place.y, yaw=place.yaw)
        snapshots.append(structs.replace(each, map_from_base=turned))
    result = score(structs.replace(model, snapshots=tuple(snapshots)), truth)
    figures = [(each.name, each.sigma) for each in result.dimensions]
    assert figures == [("reach", 0.002), ("breadth", 0.002)]
    assert max(abs(each.error) for each in result.dimensions) < 1e-9
    assert result.angle is None
    assert max(place.error for place in result.legs.places) < 5e-6


def test_a_new_shape_is_drawn_with_its_lengths() -> None:
    """On the page and in the viewer, the angle as one in the viewer's text."""
    drawing = plan(blob())
    assert "reach 1.187 m" in drawing
    assert "breadth 0.806 m" in drawing
    logged: dict[str, Any] = {}
    outline = np.array(blob().surface.outline)
    stream = SimpleNamespace(
        log=logged.__setitem__,
        names=lambda path, _, texts, **__: logged.__setitem__(path, list(texts)),
    )
    log_dimensions(stream, blob(), outline, 0.74, Room(Eye((2.0, -2.0, 2.0), (0.3, -0.2, 0.7))))
    expected = ["reach 1.187 m ± 2.0 mm", "breadth 0.806 m ± 2.0 mm"]
    assert logged["model/dimensions/names"][:2] == expected
    surface = next(one for one in made_up_run.results(stops=3) if isinstance(one, Surface))
    primitive = replace(
        surface.candidates[0],
        shape=BLOB.name,
        dimensions={"lean": replace(surface.height, value=1.2)},
    )
    assert "lean 68.75°" in surface_text(replace(surface, candidates=(primitive,)))


def test_a_new_shape_is_exported_by_its_outline(tmp_path: Path) -> None:
    """In every format."""
    solid, _ = build(blob(), load_config().export, name="table")
    outline = shapely.Polygon(blob().surface.outline)
    assert shapely.Polygon(solid.top.ring()).area == pytest.approx(outline.area, rel=1e-5)
    names = list(all_formats())
    written = export_model(blob(), names, output=tmp_path).files
    assert {file.relative_to(tmp_path).parts[0] for file in written} == set(names)


def test_legs_under_a_new_shape_are_partners_by_its_turns() -> None:
    """Three legs a third of a turn apart make a set; under a rectangle they do not."""
    surface = next(one for one in made_up_run.results(stops=3) if isinstance(one, Surface))
    places = np.array(
        [
            surface.pose.apply([0.3 * math.cos(turn), 0.3 * math.sin(turn)])
            for turn in (0.2 + np.arange(3) * BLOB.yaw_period).tolist()
        ]
    )
    sets = [
        [
            members
            for members, _ in symmetric_sets(Frame(top, shapely.Polygon(top.outline)), places, 0.01)
        ]
        for top in (replace(surface, shape=BLOB.name), surface)
    ]
    assert sets == [[(0, 1, 2)], []]
