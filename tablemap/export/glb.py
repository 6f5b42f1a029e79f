"""Binary glTF 2.0: metres, y up as glTF has it, one node a part."""

from __future__ import annotations

from typing import Any

from tablemap.config import ExportConfig
from tablemap.export.meshes import scene
from tablemap.export.placement import Z_UP_FROM_Y_UP, placement
from tablemap.export.solid import Solid
from tablemap.geometry import invert


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.glb and where it stands."""
    name = f"{solid.name}.glb"
    parts: Any = scene(solid, invert(Z_UP_FROM_Y_UP))
    content: bytes = parts.export(file_type="glb")
    return {
        name: content,
        f"{solid.name}.world.json": placement(solid, file=name, up="y"),
    }
