"""SDF: valid by Debian's sdformat-sdf, and the model's geometry as ED and Gazebo see it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from lxml import etree
from shapely import affinity

from tablemap.export import export_model
from tests.making.exported import HEIGHT, MODELS, POSE, Solid, assert_agree, assert_all_agree

SCHEMAS = sorted(Path("/usr/share").glob("sdformat*/1.6/root.xsd"))


@pytest.fixture(scope="module")
def schema(tmp_path_factory: pytest.TempPathFactory) -> etree.XMLSchema:
    """SDF 1.6, as its authors define it; its parts refer to each other, not to the network."""
    if not SCHEMAS:
        pytest.skip("no SDF 1.6 schema; install Debian's sdformat-sdf")
    folder = tmp_path_factory.mktemp("schema")
    for file in SCHEMAS[0].parent.glob("*.xsd"):
        text = file.read_text(encoding="utf-8").replace("http://sdformat.org/schemas/", "")
        # A simulation's state declares model, link and light once more, which XML Schema forbids.
        for part in ("<xsd:include schemaLocation='state.xsd'/>", "<xsd:element ref='state'/>"):
            text = text.replace(part, "")
        (folder / file.name).write_text(text)
    if not (folder / "types.xsd").exists():
        (folder / "types.xsd").write_text(_types())
    # As generated, a pose may have a frame and no numbers.
    (folder / "pose.xsd").write_text(
        _schema_of(
            "<xsd:include schemaLocation='types.xsd'/><xsd:element name='pose'><xsd:complexType>"
            "<xsd:simpleContent><xsd:extension base='pose'><xsd:attribute name='frame' "
            "type='xsd:string'/></xsd:extension></xsd:simpleContent></xsd:complexType></xsd:element>"
        )
    )
    return etree.XMLSchema(etree.parse(str(folder / "root.xsd")))


def _types() -> str:
    """Return the schema's tuples of numbers, which Debian's package leaves out."""
    counts = {"vector2d": 2, "vector3": 3, "color": 4, "pose": 6, "time": 2}
    types = "".join(
        f"<xsd:simpleType name='{name}'><xsd:restriction><xsd:simpleType>"
        "<xsd:list itemType='xsd:double'/></xsd:simpleType>"
        f"<xsd:length value='{count}'/></xsd:restriction></xsd:simpleType>"
        for name, count in counts.items()
    )
    return _schema_of(types)


def _schema_of(content: str) -> str:
    return f"<xsd:schema xmlns:xsd='http://www.w3.org/2001/XMLSchema'>{content}</xsd:schema>"


@pytest.mark.parametrize("shape", MODELS)
@pytest.mark.parametrize("to", ["sdf", "gazebo"])
def test_sdf_is_valid(shape: str, to: str, schema: etree.XMLSchema, tmp_path: Path) -> None:
    """Model and world; but for ED's own volume, which the schema does not know."""
    export_model(MODELS[shape], [to], output=tmp_path)
    for file in ("table/model.sdf", "table.world.sdf"):
        document = etree.parse(str(tmp_path / to / file))
        volumes = document.findall(".//virtual_volume")
        assert len(volumes) == (1 if (to, file) == ("sdf", "table/model.sdf") else 0)
        # The generated schema leaves an included model's pose out; the specification has it.
        for element in volumes + document.findall("./world/include/pose"):
            element.getparent().remove(element)
        schema.assertValid(document)


def test_the_schema_refuses_what_is_no_sdf(schema: etree.XMLSchema) -> None:
    """So that the tests above can fail."""
    assert not schema.validate(etree.fromstring("<sdf version='1.6'><model/></sdf>"))


@pytest.mark.parametrize("kind", ["visual", "collision"])
@pytest.mark.parametrize("shape", MODELS)
@pytest.mark.parametrize("to", ["sdf", "gazebo"])
def test_sdf_has_the_models_geometry(shape: str, to: str, kind: str, tmp_path: Path) -> None:
    """A polyline lies about its pose for ED, and above it for Gazebo."""
    export_model(MODELS[shape], [to], output=tmp_path)
    root = etree.parse(str(tmp_path / to / "table" / "model.sdf")).getroot()
    found = {}
    for link in root.findall("./model/link"):
        for element in link.findall(kind):
            name = element.get("name").removesuffix(f"_{kind}")
            found[name] = _solid(element, _pose(link), centred=to == "sdf")
    assert_all_agree(found, MODELS[shape])


@pytest.mark.parametrize("shape", MODELS)
def test_on_top_of_lies_over_the_top(shape: str, tmp_path: Path) -> None:
    """The top's outline, from 2 cm above it to 30 cm higher."""
    export_model(MODELS[shape], ["sdf"], output=tmp_path)
    root = etree.parse(str(tmp_path / "sdf" / "table" / "model.sdf")).getroot()
    (volume,) = root.findall("./model/link[@name='on_top_of']/virtual_volume")
    found = _solid(volume, np.zeros(6), centred=True)
    top = _solid(
        root.find("./model/link[@name='top']/visual"),
        _pose(root.find("./model/link[@name='top']")),
        centred=True,
    )
    assert_agree(found, Solid(top.outline, HEIGHT + 0.02, HEIGHT + 0.32))


@pytest.mark.parametrize("to", ["sdf", "gazebo"])
def test_the_world_places_the_model(to: str, tmp_path: Path) -> None:
    """By the name of its folder, on the recording's floor."""
    export_model(MODELS["U"], [to], output=tmp_path, name="desk")
    include = etree.parse(str(tmp_path / to / "desk.world.sdf")).find("./world/include")
    assert include.findtext("uri") == "model://desk"
    np.testing.assert_allclose(_pose(include), [POSE.x, POSE.y, 0.05, 0, 0, POSE.yaw], atol=1e-6)
    config = etree.parse(str(tmp_path / to / "desk" / "model.config"))
    assert config.findtext("name") == "desk"
    assert config.findtext("sdf") == "model.sdf"


def _pose(element: etree._Element) -> np.ndarray:
    text = element.findtext("pose")
    return np.array([float(part) for part in text.split()]) if text else np.zeros(6)


def _solid(element: etree._Element, link: np.ndarray, *, centred: bool) -> Solid:
    """Return an element's geometry in the model's frame; only one of the two poses is set."""
    x, y, z, roll, pitch, yaw = link + _pose(element)
    assert (roll, pitch) == (0, 0)
    (shape,) = element.find("geometry")
    bottom = -0.5
    if shape.tag == "box":
        length, width, height = (float(part) for part in shape.findtext("size").split())
        outline = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    elif shape.tag == "cylinder":
        height = float(shape.findtext("length"))
        outline = shapely.Point(0, 0).buffer(float(shape.findtext("radius")), quad_segs=96)
    else:
        height = float(shape.findtext("height"))
        points = [tuple(map(float, point.text.split(" "))) for point in shape.findall("point")]
        assert points[0] != points[-1]
        outline = shapely.Polygon(points)
        assert outline.exterior.is_ccw
        bottom = -0.5 if centred else 0.0
    placed = affinity.translate(
        affinity.rotate(outline, yaw, origin=(0, 0), use_radians=True), x, y
    )
    return Solid(placed, z + bottom * height, z + (bottom + 1) * height)
