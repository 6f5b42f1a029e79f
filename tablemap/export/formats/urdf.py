"""URDF: one link in the table's frame; a top that is no primitive refers to a mesh file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element

from tablemap.export.meshes import part_mesh
from tablemap.export.registry import Format
from tablemap.export.solid import Box, Cylinder, Prism, Solid, SolidPart
from tablemap.export.text import ANGLE_DECIMALS, child, number, numbers, xml_bytes

if TYPE_CHECKING:
    from tablemap.config import ExportConfig


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.urdf, its meshes, and NAME.world.urdf with the table fixed to the map's link."""
    root = Element("robot", name=solid.name)
    _add_table(root, solid, config)
    world = Element("robot", name=f"{solid.name}_world")
    child(world, "link", name=f"{solid.model.frame}")
    _add_table(world, solid, config)
    joint = child(world, "joint", name=f"{solid.model.frame}_to_{solid.name}", type="fixed")
    child(joint, "parent", link=solid.model.frame)
    child(joint, "child", link=_link_name(solid))
    pose = solid.map_from_table
    _add_origin(joint, pose.x, pose.y, solid.model.floor_z, pose.yaw)
    files = {
        f"{solid.name}.urdf": xml_bytes(root),
        f"{solid.name}.world.urdf": xml_bytes(world),
    }
    for part in solid.parts:
        if isinstance(part.shape, Prism):
            mesh: Any = part_mesh(part)
            files[_mesh_name(solid, part)] = mesh.export(file_type="stl")
    return files


def _add_table(root: Element, solid: Solid, config: ExportConfig) -> None:
    link = child(root, "link", name=_link_name(solid))
    for part in solid.parts:
        for kind in ("visual", "collision"):
            element = child(link, kind, name=f"{part.name}_{kind}")
            if isinstance(part.shape, Prism):
                _add_origin(element, 0, 0, 0, 0)
            else:
                _add_origin(element, part.place.x, part.place.y, part.z, part.place.yaw)
            geometry = child(element, "geometry")
            match part.shape:
                case Box(length, width, height):
                    child(geometry, "box", size=numbers((length, width, height)))
                case Cylinder(radius, height):
                    child(geometry, "cylinder", radius=number(radius), length=number(height))
                case Prism():
                    file = f"{config.mesh_prefix}{_mesh_name(solid, part)}"
                    child(geometry, "mesh", filename=file)


def _add_origin(parent: Element, x: float, y: float, z: float, yaw: float) -> None:
    child(parent, "origin", xyz=numbers((x, y, z)), rpy=f"0 0 {number(yaw, ANGLE_DECIMALS)}")


def _link_name(solid: Solid) -> str:
    # The link must not have the same name as the map's frame.
    return solid.name if solid.name != solid.model.frame else f"{solid.name}_link"


def _mesh_name(solid: Solid, part: SolidPart) -> str:
    return f"{solid.name}_{part.name}.stl"


FORMAT = Format(
    name="urdf",
    description="one link, for robot_description and tf",
    files=("{name}.urdf", "{name}.world.urdf", "{name}_*.stl"),
    world="{name}.world.urdf",
    write=write,
)
