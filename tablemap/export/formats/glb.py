"""Binary glTF 2.0: metres, y up as glTF requires, one node a part."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tablemap.export.meshes import scene
from tablemap.export.placement import WORLD, placement, z_up_from_y_up
from tablemap.export.registry import Format

if TYPE_CHECKING:
    from tablemap.config import ExportConfig
    from tablemap.export.solid import Solid


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.glb and its world file."""
    from tablemap.geometry import invert

    name = f"{solid.name}.glb"
    parts: Any = scene(solid, invert(z_up_from_y_up()))
    content: bytes = parts.export(file_type="glb")
    return {
        name: content,
        WORLD.format(name=solid.name): placement(solid, file=name, up="y"),
    }


FORMAT = Format(
    name="glb",
    description="a mesh in binary glTF 2.0, y up",
    files=("{name}.glb", WORLD),
    world=WORLD,
    write=write,
)
