"""SDF 1.6 as TU/e's ED reads it: ``model.sdf`` and ``model.config``, a folder a model.

A ``polyline`` lies half above and half below its pose. The link ``on_top_of`` is the volume for
things on the table.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

from tablemap.export.registry import Format
from tablemap.export.solid import Box, Cylinder, Prism, Solid, SolidPart
from tablemap.export.text import child, number, numbers, pose_text, xml_bytes

if TYPE_CHECKING:
    from tablemap.config import ExportConfig

VERSION = "1.6"
WORLD = "{name}.world.sdf"
FILES = ("{name}/model.sdf", "{name}/model.config", WORLD)


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME/model.sdf, NAME/model.config, and NAME.world.sdf that places it."""
    root, model = model_element(solid)
    for part in solid.parts:
        _add_link(model, part, part.z)
    above = config.on_top_of_gap + config.on_top_of_height / 2
    link = child(model, "link", name="on_top_of")
    volume = child(link, "virtual_volume", name="on_top_of_vv")
    geometry_element(volume, solid.top.shape, height=config.on_top_of_height)
    child(volume, "pose", pose_text(0, 0, solid.height + above, 0))
    return model_files(solid, root)


def model_element(solid: Solid) -> tuple[Element, Element]:
    """Return the root of a document and the static model in it."""
    root = Element("sdf", version=VERSION)
    model = child(root, "model", name=solid.name)
    child(model, "static", "true")
    return root, model


def _add_link(model: Element, part: SolidPart, z: float) -> None:
    link = child(model, "link", name=part.name)
    child(link, "pose", pose_text(part.place.x, part.place.y, z, part.place.yaw))
    for kind in ("collision", "visual"):
        geometry_element(child(link, kind, name=f"{part.name}_{kind}"), part.shape)


def geometry_element(
    parent: Element, shape: Box | Cylinder | Prism, *, height: float | None = None
) -> None:
    """Add a shape, at its own height or another, metres."""
    geometry = child(parent, "geometry")
    tall = shape.height if height is None else height
    match shape:
        case Box(length, width):
            child(child(geometry, "box"), "size", numbers((length, width, tall)))
        case Cylinder(radius):
            cylinder = child(geometry, "cylinder")
            child(cylinder, "radius", number(radius))
            child(cylinder, "length", number(tall))
        case Prism(ring):
            polyline = child(geometry, "polyline")
            for point in ring:
                child(polyline, "point", numbers(point))
            child(polyline, "height", number(tall))


def model_files(solid: Solid, root: Element) -> dict[str, bytes]:
    """Return the model's folder and the world that includes it."""
    config = Element("model")
    child(config, "name", solid.name)
    child(config, "version", "1.0")
    child(config, "sdf", "model.sdf", version=VERSION)
    author = child(config, "author")
    child(author, "name", "tablemap")
    child(config, "description", f"A table ({solid.model.surface.shape}), as measured.")
    return {
        f"{solid.name}/model.sdf": xml_bytes(root),
        f"{solid.name}/model.config": xml_bytes(config),
        f"{solid.name}.world.sdf": xml_bytes(_world(solid)),
    }


def _world(solid: Solid) -> Element:
    pose = solid.map_from_table
    root = Element("sdf", version=VERSION)
    world = child(root, "world", name=f"{solid.name}_in_{solid.model.frame}")
    include = child(world, "include")
    child(include, "uri", f"model://{solid.name}")
    child(include, "name", solid.name)
    child(include, "pose", pose_text(pose.x, pose.y, solid.model.floor_z, pose.yaw))
    return root


FORMAT = Format(
    name="sdf",
    description="SDF 1.6 for TU/e's ED",
    files=FILES,
    world=WORLD,
    write=write,
)
