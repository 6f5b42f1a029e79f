"""MoveIt's planning scene: a ``.scene`` file and a CollisionObject message as YAML, in the map.

The ``.scene`` has the form with an object's pose and subframes (MoveIt 1.1 and 2).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from tablemap.export.meshes import part_mesh
from tablemap.export.registry import Format
from tablemap.export.solid import Box, Cylinder, Prism, Solid, SolidPart
from tablemap.export.text import ANGLE_DECIMALS, number, numbers

if TYPE_CHECKING:
    import trimesh

    from tablemap.config import ExportConfig

BOX, CYLINDER, ADD = 1, 3, 0
COLOUR = "0.72 0.53 0.34 1"

Pose = tuple[float, float, float, float]
"""x, y, z and yaw."""


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.scene and NAME.collision_object.yaml."""
    import yaml

    meshes = {part.name: part_mesh(part) for part in solid.parts if isinstance(part.shape, Prism)}
    # The C dumper is ten times faster on the vertices of a round top.
    message = yaml.dump(
        _message(solid, meshes), Dumper=yaml.CSafeDumper, sort_keys=False, default_flow_style=None
    )
    return {
        f"{solid.name}.scene": _scene(solid, meshes).encode(),
        f"{solid.name}.collision_object.yaml": message.encode(),
    }


def _object_pose(solid: Solid) -> Pose:
    pose = solid.map_from_table
    return pose.x, pose.y, solid.model.floor_z, pose.yaw


def _part_pose(part: SolidPart) -> Pose:
    """Return the shape's pose in the table's frame; a mesh's vertices are in it already."""
    if isinstance(part.shape, Prism):
        return 0.0, 0.0, 0.0, 0.0
    return part.place.x, part.place.y, part.z, part.place.yaw


def _top_frame(solid: Solid) -> Pose:
    return 0.0, 0.0, solid.height, 0.0


def _scene(solid: Solid, meshes: dict[str, trimesh.Trimesh]) -> str:
    lines = [solid.name, f"* {solid.name}", *_pose_lines(_object_pose(solid))]
    lines.append(str(len(solid.parts)))
    for part in solid.parts:
        match part.shape:
            case Box(length, width, height):
                lines += ["box", numbers((length, width, height))]
            case Cylinder(radius, height):
                lines += ["cylinder", numbers((radius, height))]
            case Prism():
                mesh = meshes[part.name]
                lines += ["mesh", f"{len(mesh.vertices)} {len(mesh.faces)}"]
                lines += [numbers(vertex) for vertex in mesh.vertices]
                lines += ["{} {} {}".format(*face) for face in mesh.faces.tolist()]
        lines += [*_pose_lines(_part_pose(part)), COLOUR]
    lines += ["1", "top", *_pose_lines(_top_frame(solid)), "."]
    return "\n".join(lines) + "\n"


def _pose_lines(pose: Pose) -> list[str]:
    x, y, z, yaw = pose
    return [
        numbers((x, y, z)),
        " ".join(number(value, ANGLE_DECIMALS) for value in _quaternion(yaw)),
    ]


def _quaternion(yaw: float) -> tuple[float, float, float, float]:
    """Return a turn about z as x, y, z, w."""
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def _message(solid: Solid, meshes: dict[str, trimesh.Trimesh]) -> dict[str, Any]:
    primitives = [part for part in solid.parts if not isinstance(part.shape, Prism)]
    prisms = [part for part in solid.parts if isinstance(part.shape, Prism)]
    return {
        "header": {"frame_id": solid.model.frame},
        "pose": _pose_entry(_object_pose(solid)),
        "id": solid.name,
        "primitives": [_primitive(part) for part in primitives],
        "primitive_poses": [_pose_entry(_part_pose(part)) for part in primitives],
        "meshes": [_mesh(meshes[part.name]) for part in prisms],
        "mesh_poses": [_pose_entry(_part_pose(part)) for part in prisms],
        "subframe_names": ["top"],
        "subframe_poses": [_pose_entry(_top_frame(solid))],
        "operation": ADD,
    }


def _primitive(part: SolidPart) -> dict[str, Any]:
    match part.shape:
        case Cylinder(radius, height):
            return {"type": CYLINDER, "dimensions": [round(height, 6), round(radius, 6)]}
        case Box(length, width, height):
            return {"type": BOX, "dimensions": [round(v, 6) for v in (length, width, height)]}
        case _:
            raise TypeError(f"{part.name} is no primitive")


def _mesh(mesh: trimesh.Trimesh) -> dict[str, Any]:
    return {
        "triangles": [{"vertex_indices": face} for face in mesh.faces.tolist()],
        "vertices": [
            dict(zip("xyz", vertex, strict=True)) for vertex in mesh.vertices.round(6).tolist()
        ],
    }


def _pose_entry(pose: Pose) -> dict[str, dict[str, float]]:
    x, y, z, yaw = pose
    position = {"x": round(x, 6), "y": round(y, 6), "z": round(z, 6)}
    turn = [round(value, 9) for value in _quaternion(yaw)]
    return {"position": position, "orientation": dict(zip("xyzw", turn, strict=True))}


FORMAT = Format(
    name="moveit",
    description="MoveIt's planning scene",
    files=("{name}.scene", "{name}.collision_object.yaml"),
    world=None,
    write=write,
)
