"""SDF 1.6 as Gazebo reads it: a ``polyline`` is extruded from its pose upwards."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tablemap.export.formats.sdf import FILES, WORLD, geometry_element, model_element, model_files
from tablemap.export.registry import Format
from tablemap.export.solid import Prism, Solid
from tablemap.export.text import child, pose_text

if TYPE_CHECKING:
    from tablemap.config import ExportConfig


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME/model.sdf, NAME/model.config, and NAME.world.sdf that places it.

    The model has one link, so that its parts stay together if a user makes it movable.
    """
    root, model = model_element(solid)
    link = child(model, "link", name="link")
    for part in solid.parts:
        z = part.bottom if isinstance(part.shape, Prism) else part.z
        for kind in ("collision", "visual"):
            element = child(link, kind, name=f"{part.name}_{kind}")
            child(element, "pose", pose_text(part.place.x, part.place.y, z, part.place.yaw))
            geometry_element(element, part.shape)
    return model_files(solid, root)


FORMAT = Format(
    name="gazebo",
    description="SDF 1.6 for Gazebo",
    files=FILES,
    world=WORLD,
    write=write,
)
