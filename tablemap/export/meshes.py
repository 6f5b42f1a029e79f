"""Triangles of a table's parts: closed, and one mesh a part."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import trimesh

    from tablemap.export.solid import Solid, SolidPart
    from tablemap.geometry import Floats


def part_mesh(part: SolidPart) -> trimesh.Trimesh:
    """Return the part as a watertight mesh in the table's frame, metres, z up."""
    import shapely
    from trimesh.creation import extrude_polygon

    mesh = extrude_polygon(shapely.Polygon(part.ring()), height=part.shape.height, engine="earcut")
    mesh.apply_translation([0.0, 0.0, part.bottom])
    return mesh


def scene(solid: Solid, target_from_table: Floats | None = None) -> trimesh.Scene:
    """Return the parts by their names; ``target_from_table`` (4, 4) is baked into the vertices."""
    import trimesh

    result = trimesh.Scene()
    for part in solid.parts:
        mesh = part_mesh(part)
        if target_from_table is not None:
            mesh.apply_transform(target_from_table)
        result.add_geometry(mesh, node_name=part.name, geom_name=part.name)
    return result
