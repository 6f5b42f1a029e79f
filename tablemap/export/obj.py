"""Wavefront OBJ: metres, z up, one object a part."""

from __future__ import annotations

from tablemap.config import ExportConfig
from tablemap.export.meshes import part_mesh
from tablemap.export.placement import placement
from tablemap.export.solid import Solid
from tablemap.export.text import numbers


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.obj and where it stands."""
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
        f"{solid.name}.world.json": placement(solid, file=name),
    }
