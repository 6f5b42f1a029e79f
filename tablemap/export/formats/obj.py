"""Wavefront OBJ: metres, z up, one object a part."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tablemap.export.meshes import part_mesh
from tablemap.export.placement import WORLD, placement
from tablemap.export.registry import Format
from tablemap.export.text import numbers

if TYPE_CHECKING:
    from tablemap.config import ExportConfig
    from tablemap.export.solid import Solid


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.obj and its world file."""
    lines = ["# metres, z up, in the table's frame"]
    first = 1
    for part in solid.parts:
        mesh = part_mesh(part)
        lines.append(f"o {part.name}")
        lines += [f"v {numbers(vertex)}" for vertex in mesh.vertices]
        lines += ["f {} {} {}".format(*face) for face in (mesh.faces + first).tolist()]
        first += len(mesh.vertices)
    name = f"{solid.name}.obj"
    return {
        name: ("\n".join(lines) + "\n").encode(),
        WORLD.format(name=solid.name): placement(solid, file=name),
    }


FORMAT = Format(
    name="obj",
    description="a mesh in Wavefront OBJ, z up",
    files=("{name}.obj", WORLD),
    world=WORLD,
    write=write,
)
