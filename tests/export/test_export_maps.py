"""Nav2, GeoJSON and SVG: read back by pillow, PyYAML, shapely and svg.path."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
import svg.path
import yaml
from msgspec import structs
from PIL import Image

from tablemap.config import ExportConfig
from tablemap.export import export_model
from tests.making.exported import MODELS, TOLERANCE, in_map, solids_of


def _mask(folder: Path) -> tuple[np.ndarray, dict[str, object]]:
    server = yaml.safe_load((folder / "table.yaml").read_text())
    with Image.open(folder / server["image"]) as image:
        assert (image.format, image.mode) == ("PPM", "L")
        return np.array(image), server


def _footprint(shape: str, padding: float) -> shapely.Geometry:
    parts = [in_map(solid.outline) for solid in solids_of(MODELS[shape]).values()]
    return shapely.union_all(parts).buffer(padding, quad_segs=96)


@pytest.mark.parametrize("padding", [0.0, 0.25])
@pytest.mark.parametrize("shape", MODELS)
def test_the_keep_out_mask_covers_the_table(shape: str, padding: float, tmp_path: Path) -> None:
    """Cells that the padded table touches are occupied, none beyond, and free ones lie round."""
    config = ExportConfig(padding=padding, resolution=0.04)
    export_model(MODELS[shape], ["nav2"], output=tmp_path, config=config)
    image, server = _mask(tmp_path / "nav2")
    assert server["mode"] == "trinary"
    assert server["negate"] == 0
    occupancy = (255 - image) / 255
    occupied = occupancy > server["occupied_thresh"]
    assert (occupied | (occupancy < server["free_thresh"])).all()
    cell = server["resolution"]
    x0, y0, yaw = server["origin"]
    assert yaw == 0
    rows, columns = np.nonzero(occupied)
    x, y = x0 + columns * cell, y0 + (len(image) - 1 - rows) * cell
    covered = shapely.union_all(shapely.box(x, y, x + cell, y + cell))
    footprint = _footprint(shape, padding)
    assert footprint.difference(covered).area < 1e-6
    assert covered.difference(footprint.buffer(cell * np.sqrt(2) + TOLERANCE)).area == 0
    border = [occupied[0], occupied[-1], occupied[:, 0], occupied[:, -1]]
    assert not np.concatenate(border).any()


@pytest.mark.parametrize("padding", [0.0, 0.25])
@pytest.mark.parametrize("shape", MODELS)
def test_the_keep_out_polygon_is_the_padded_table(
    shape: str, padding: float, tmp_path: Path
) -> None:
    """In the map, to 0.1 mm."""
    config = ExportConfig(padding=padding)
    export_model(MODELS[shape], ["nav2"], output=tmp_path, config=config)
    outline = yaml.safe_load((tmp_path / "nav2" / "table.polygon.yaml").read_text())
    assert outline["frame_id"] == "map"
    (ring,) = outline["polygons"]
    expected = _footprint(shape, padding)
    assert shapely.hausdorff_distance(shapely.LinearRing(ring), expected.exterior) < TOLERANCE


def test_a_leg_that_stands_out_is_kept_clear_too(tmp_path: Path) -> None:
    """Top and legs, not the top alone."""
    model = MODELS["circle"]
    x, y = model.surface.pose.x + 0.44, model.surface.pose.y
    leg = structs.replace(model.legs[0], x=x, y=y)
    export_model(structs.replace(model, legs=(leg,)), ["nav2"], output=tmp_path)
    outline = yaml.safe_load((tmp_path / "nav2" / "table.polygon.yaml").read_text())
    (ring,) = outline["polygons"]
    assert np.array(ring)[:, 0].max() == pytest.approx(x + 0.155, abs=1e-4)


@pytest.mark.parametrize("shape", MODELS)
def test_geojson_is_the_table_in_the_map(shape: str, tmp_path: Path) -> None:
    """Closed, counter-clockwise rings in local metres, marked as no longitude and latitude."""
    export_model(MODELS[shape], ["geojson"], output=tmp_path)
    text = (tmp_path / "geojson" / "table.geojson").read_text()
    document = json.loads(text)
    assert document["crs"] is None
    assert document["reference"]["frame"] == "map"
    assert document["reference"]["units"] == "metres"
    collection = shapely.from_geojson(text)
    expected = solids_of(MODELS[shape])
    assert [feature["id"] for feature in document["features"]] == list(expected)
    for polygon, solid in zip(collection.geoms, expected.values(), strict=True):
        assert polygon.is_valid
        assert polygon.exterior.is_ccw
        apart = shapely.hausdorff_distance(polygon.exterior, in_map(solid.outline).exterior)
        assert apart < TOLERANCE
    top = document["features"][0]["properties"]
    assert top["shape"] == MODELS[shape].surface.shape
    assert top["height"]["value"] == pytest.approx(0.743)


@pytest.mark.parametrize("shape", MODELS)
def test_svg_is_to_scale(shape: str, tmp_path: Path) -> None:
    """Millimetres in the table's frame, y up on the page, one user unit a millimetre."""
    export_model(MODELS[shape], ["svg"], output=tmp_path)
    root = ElementTree.parse(tmp_path / "svg" / "table.svg").getroot()
    left, upper, width, height = map(float, root.attrib["viewBox"].split())
    assert root.attrib["width"] == f"{width:g}mm" or float(root.attrib["width"][:-2]) == width
    assert float(root.attrib["height"].removesuffix("mm")) == height
    paths = {
        path.attrib["id"]: svg.path.parse_path(path.attrib["d"])
        for path in root.iter("{http://www.w3.org/2000/svg}path")
    }
    page = shapely.box(left, upper, left + width, upper + height)
    for name, solid in solids_of(MODELS[shape]).items():
        drawn = shapely.LinearRing([(step.end.real, step.end.imag) for step in paths[name][:-1]])
        assert page.contains(drawn)
        ring = shapely.LinearRing(np.array(drawn.coords) * [1e-3, -1e-3])
        assert shapely.hausdorff_distance(ring, solid.outline.exterior) < TOLERANCE


def test_svg_tells_what_was_measured(tmp_path: Path) -> None:
    """Sides that were not seen are dotted."""
    model = MODELS["rectangle"]
    edges = (structs.replace(model.surface.edges[0], status="unseen"),)
    surface = structs.replace(model.surface, edges=edges + model.surface.edges[1:])
    export_model(structs.replace(model, surface=surface), ["svg"], output=tmp_path)
    root = ElementTree.parse(tmp_path / "svg" / "table.svg").getroot()
    sides = root.findall("{http://www.w3.org/2000/svg}polyline")
    dashes = [side.attrib["stroke-dasharray"] for side in sides]
    assert dashes == ["4 10", "none", "none", "none"]


def test_a_leg_apart_from_the_top_has_a_polygon_of_its_own(tmp_path: Path) -> None:
    """As one that the top does not reach over."""
    model = MODELS["circle"]
    leg = structs.replace(model.legs[0], x=model.surface.pose.x + 1.0)
    export_model(structs.replace(model, legs=(leg,)), ["nav2"], output=tmp_path)
    outline = yaml.safe_load((tmp_path / "nav2" / "table.polygon.yaml").read_text())
    assert len(outline["polygons"]) == 2
