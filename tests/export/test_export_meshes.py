"""GLB, OBJ, PLY and URDF: closed, and the model's geometry, as trimesh and yourdfpy read them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy

from tablemap.export import export_model
from tests.making.exported import (
    HEIGHT,
    MODELS,
    POSE,
    assert_all_agree,
    in_map,
    solid_of,
    solids_of,
)

Z_UP_FROM_Y_UP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("shape", MODELS)
def test_glb_is_y_up_with_a_node_a_part(shape: str, tmp_path: Path) -> None:
    """Turned back, each node is its part."""
    export_model(MODELS[shape], ["glb"], output=tmp_path)
    scene = trimesh.load_scene(tmp_path / "glb" / "table.glb")
    assert scene.bounds[1, 1] == pytest.approx(HEIGHT, abs=1e-4)
    found = {}
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        mesh = scene.geometry[geometry].copy()
        found[node] = solid_of(mesh.apply_transform(Z_UP_FROM_Y_UP @ matrix))
    assert_all_agree(found, MODELS[shape])


@pytest.mark.parametrize("shape", MODELS)
def test_obj_has_an_object_a_part(shape: str, tmp_path: Path) -> None:
    """Z up, metres."""
    export_model(MODELS[shape], ["obj"], output=tmp_path)
    scene = trimesh.load_scene(tmp_path / "obj" / "table.obj", split_objects=True)
    found = {name: solid_of(mesh) for name, mesh in scene.geometry.items()}
    if list(found) == ["table.obj"]:
        found = {"top": found["table.obj"]}
    assert_all_agree(found, MODELS[shape])


@pytest.mark.parametrize("shape", MODELS)
def test_ply_has_all_parts(shape: str, tmp_path: Path) -> None:
    """As one mesh of as many closed bodies."""
    export_model(MODELS[shape], ["ply"], output=tmp_path)
    bodies = trimesh.load_mesh(tmp_path / "ply" / "table.ply").split()
    names = list(solids_of(MODELS[shape]))
    bodies = sorted(bodies, key=lambda body: -body.bounds[1, 2])
    assert len(bodies) == len(names)
    found = [solid_of(body) for body in bodies]
    placed = {"top": found.pop(0)}
    for name in names[1:]:
        place = solids_of(MODELS[shape])[name].outline.centroid
        placed[name] = min(found, key=lambda solid: solid.outline.centroid.distance(place))
    assert_all_agree(placed, MODELS[shape])


@pytest.mark.parametrize(("to", "up"), [("glb", "y"), ("obj", "z"), ("ply", "z")])
def test_the_world_file_places_a_mesh(to: str, up: str, tmp_path: Path) -> None:
    """Its matrix takes the file's coordinates into the map."""
    export_model(MODELS["U"], [to], output=tmp_path)
    placement = json.loads((tmp_path / to / "table.world.json").read_text())
    assert (placement["frame"], placement["up"]) == ("map", up)
    mesh = trimesh.load_scene(tmp_path / to / placement["object"]).to_mesh()
    mesh.apply_transform(np.array(placement["map_from_object"]))
    expected = in_map(solids_of(MODELS["U"])["top"].outline)
    np.testing.assert_allclose(mesh.bounds[:, :2].ravel(), np.array(expected.bounds), atol=1e-4)
    assert mesh.bounds[:, 2] == pytest.approx([0.05, 0.05 + HEIGHT], abs=1e-4)


@pytest.mark.parametrize("kind", ["visuals", "collisions"])
@pytest.mark.parametrize("shape", MODELS)
def test_urdf_has_the_models_geometry(shape: str, kind: str, tmp_path: Path) -> None:
    """One link in the table's frame; tops that are no primitive as a mesh beside it."""
    export_model(MODELS[shape], ["urdf"], output=tmp_path)
    robot = yourdfpy.URDF.load(str(tmp_path / "urdf" / "table.urdf"))
    assert robot.validate()
    (link,) = robot.robot.links
    found = {}
    for element in getattr(link, kind):
        geometry = element.geometry
        if geometry.box is not None:
            mesh = trimesh.creation.box(geometry.box.size)
        elif geometry.cylinder is not None:
            mesh = trimesh.creation.cylinder(
                radius=geometry.cylinder.radius, height=geometry.cylinder.length, sections=384
            )
        else:
            mesh = trimesh.load_mesh(tmp_path / "urdf" / geometry.mesh.filename)
        name = element.name.rsplit("_", 1)[0]
        found[name] = solid_of(mesh.apply_transform(element.origin))
    assert_all_agree(found, MODELS[shape])


@pytest.mark.parametrize("shape", ["rectangle", "L", "U"])
def test_the_urdf_world_places_the_table(shape: str, tmp_path: Path) -> None:
    """A fixed joint from the map; the meshes are found, and stand where the table does."""
    export_model(MODELS[shape], ["urdf"], output=tmp_path)
    world = yourdfpy.URDF.load(str(tmp_path / "urdf" / "table.world.urdf"))
    assert world.validate()
    assert world.base_link == "map"
    matrix = world.get_transform("table", "map")
    floor_z = MODELS[shape].floor_z
    np.testing.assert_allclose(matrix[:3, 3], [POSE.x, POSE.y, floor_z], atol=1e-6)
    assert np.arctan2(matrix[1, 0], matrix[0, 0]) == pytest.approx(POSE.yaw, abs=1e-6)
    expected = in_map(solids_of(MODELS[shape])["top"].outline).bounds
    np.testing.assert_allclose(world.scene.bounds[:, :2].ravel(), expected, atol=1e-4)
    assert world.scene.bounds[1, 2] == pytest.approx(floor_z + HEIGHT, abs=1e-4)
