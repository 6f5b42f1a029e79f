"""The world file for formats that have none of their own: the object's pose in the map."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from tablemap.export.solid import Solid
    from tablemap.geometry import Floats

WORLD = "{name}.world.json"
"""The file's name; ``{name}`` stands for the table's name."""


def z_up_from_y_up() -> Floats:
    """Return the (4, 4) turn of glTF's axes (y up) to REP 103's (z up)."""
    import numpy as np

    return np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def placement(solid: Solid, *, file: str, up: Literal["y", "z"] = "z") -> bytes:
    """Return JSON with the pose of the table's frame, and the matrix for the file's coordinates.

    ``map_from_object`` (4, 4) maps a point with the coordinates and up axis of ``file`` to the map.
    """
    import numpy as np

    matrix = solid.map_from_table.lifted()
    matrix[2, 3] = solid.model.floor_z
    if up == "y":
        matrix = matrix @ z_up_from_y_up()
    pose = solid.map_from_table
    document = {
        "schema": "tablemap/placement/1",
        "frame": solid.model.frame,
        "object": file,
        "units": "metres",
        "up": up,
        "pose": {"x": pose.x, "y": pose.y, "z": solid.model.floor_z, "yaw": round(pose.yaw, 9)},
        "map_from_object": (np.round(matrix, 9) + 0.0).tolist(),
    }
    return (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode()
