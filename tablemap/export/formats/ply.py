"""Binary PLY: metres, z up, all parts as one mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tablemap.export.meshes import part_mesh
from tablemap.export.placement import WORLD, placement
from tablemap.export.registry import Format

if TYPE_CHECKING:
    from tablemap.config import ExportConfig
    from tablemap.export.solid import Solid


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.ply and its world file."""
    from trimesh.exchange.ply import export_ply
    from trimesh.util import concatenate

    name = f"{solid.name}.ply"
    whole = concatenate([part_mesh(part) for part in solid.parts])
    content: bytes = export_ply(whole, vertex_normal=False)
    return {name: content, WORLD.format(name=solid.name): placement(solid, file=name)}


FORMAT = Format(
    name="ply",
    description="a mesh in binary PLY, z up",
    files=("{name}.ply", WORLD),
    world=WORLD,
    write=write,
)
