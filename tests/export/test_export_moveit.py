"""MoveIt: a CollisionObject as PyYAML reads it, and the .scene token by token as MoveIt does."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from tablemap.export import export_model
from tests.making.exported import HEIGHT, MODELS, POSE, Solid, assert_all_agree, solid_of


def _matrix(position: list[float], quaternion_xyzw: list[float]) -> np.ndarray:
    x, y, z, w = quaternion_xyzw
    matrix = trimesh.transformations.quaternion_matrix([w, x, y, z])
    matrix[:3, 3] = position
    return matrix


def _entry_matrix(pose: dict[str, dict[str, float]]) -> np.ndarray:
    return _matrix(
        [pose["position"][axis] for axis in "xyz"], [pose["orientation"][axis] for axis in "xyzw"]
    )


def _cylinder(height: float, radius: float) -> trimesh.Trimesh:
    return trimesh.creation.cylinder(radius=radius, height=height, sections=384)


def _named(solids: list[Solid]) -> dict[str, Solid]:
    """Name the parts as their order says, the top being the highest."""
    solids = sorted(solids, key=lambda solid: -solid.top)
    return {"top": solids[0]} | {f"leg_{i}": leg for i, leg in enumerate(solids[1:], start=1)}


@pytest.mark.parametrize("shape", MODELS)
def test_the_collision_object_is_the_table_in_the_map(shape: str, tmp_path: Path) -> None:
    """Placed by its pose; primitives where there are some, a mesh for other tops."""
    export_model(MODELS[shape], ["moveit"], output=tmp_path)
    message = yaml.load(
        (tmp_path / "moveit" / "table.collision_object.yaml").read_text(), yaml.CSafeLoader
    )
    assert message["header"]["frame_id"] == "map"
    assert (message["id"], message["operation"]) == ("table", 0)
    expected = _matrix(
        [POSE.x, POSE.y, MODELS[shape].floor_z],
        [0, 0, np.sin(POSE.yaw / 2), np.cos(POSE.yaw / 2)],
    )
    np.testing.assert_allclose(_entry_matrix(message["pose"]), expected, atol=1e-6)
    solids = []
    for primitive, pose in zip(message["primitives"], message["primitive_poses"], strict=True):
        sizes = primitive["dimensions"]
        mesh = trimesh.creation.box(sizes) if primitive["type"] == 1 else _cylinder(*sizes)
        solids.append(solid_of(mesh.apply_transform(_entry_matrix(pose))))
    for entry, pose in zip(message["meshes"], message["mesh_poses"], strict=True):
        vertices = [[vertex[axis] for axis in "xyz"] for vertex in entry["vertices"]]
        faces = [triangle["vertex_indices"] for triangle in entry["triangles"]]
        mesh = trimesh.Trimesh(vertices, faces)
        solids.append(solid_of(mesh.apply_transform(_entry_matrix(pose))))
    assert_all_agree(_named(solids), MODELS[shape])
    assert message["subframe_names"] == ["top"]
    assert message["subframe_poses"][0]["position"]["z"] == pytest.approx(HEIGHT)


@pytest.mark.parametrize("shape", MODELS)
def test_the_scene_has_pose_shapes_and_subframes(shape: str, tmp_path: Path) -> None:
    """As `PlanningScene::loadGeometryFromStream` reads them."""
    export_model(MODELS[shape], ["moveit"], output=tmp_path)
    text = (tmp_path / "moveit" / "table.scene").read_text()
    lines = text.splitlines()
    assert lines[:2] == ["table", "* table"]
    # The line after the object's name tells the form with an object's pose from the older one.
    assert " " in lines[2]
    tokens = iter(" ".join(lines[2:]).split())
    pose = _read_pose(tokens)
    np.testing.assert_allclose(pose[:3, 3], [POSE.x, POSE.y, MODELS[shape].floor_z], atol=1e-6)
    assert np.arctan2(pose[1, 0], pose[0, 0]) == pytest.approx(POSE.yaw, abs=1e-6)
    solids = []
    for _ in range(int(next(tokens))):
        mesh = _read_shape(tokens)
        solids.append(solid_of(mesh.apply_transform(_read_pose(tokens))))
        colour = _read(tokens, 4)
        assert colour.max() <= 1
    assert_all_agree(_named(solids), MODELS[shape])
    assert (next(tokens), next(tokens)) == ("1", "top")
    np.testing.assert_allclose(_read_pose(tokens)[:3, 3], [0, 0, HEIGHT], atol=1e-6)
    assert list(tokens) == ["."]


def _read(tokens: Iterator[str], count: int) -> np.ndarray:
    return np.array([float(next(tokens)) for _ in range(count)])


def _read_pose(tokens: Iterator[str]) -> np.ndarray:
    return _matrix(list(_read(tokens, 3)), list(_read(tokens, 4)))


def _read_shape(tokens: Iterator[str]) -> trimesh.Trimesh:
    kind = next(tokens)
    if kind == "box":
        return trimesh.creation.box(_read(tokens, 3))
    if kind == "cylinder":
        radius, length = _read(tokens, 2)
        return _cylinder(length, radius)
    assert kind == "mesh"
    vertices, faces = _read(tokens, 2).astype(int)
    points = _read(tokens, 3 * vertices).reshape(-1, 3)
    return trimesh.Trimesh(points, _read(tokens, 3 * faces).astype(int).reshape(-1, 3))
