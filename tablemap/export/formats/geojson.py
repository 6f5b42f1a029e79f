"""GeoJSON in local metres of the map, for plans and GIS; it is not in longitude and latitude.

RFC 7946 assumes WGS 84 unless agreed otherwise. In the format's 2008 version ``"crs": null`` says
that no reference system may be assumed; ``reference`` names ours.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from tablemap.export.registry import Format

if TYPE_CHECKING:
    from tablemap.config import ExportConfig
    from tablemap.export.solid import Solid, SolidPart


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.geojson: a feature for the top and one for each leg."""
    model = solid.model
    surface = model.surface
    top = {
        "part": "top",
        "shape": surface.shape,
        "height": surface.height.fields(),
        "floor_z": model.floor_z,
        "thickness": surface.thickness and surface.thickness.fields(),
        "pose": {"x": surface.pose.x, "y": surface.pose.y, "yaw": surface.pose.yaw},
        "dimensions": {name: size.fields() for name, size in surface.dimensions.items()},
        "verdict": model.verdict.level,
    }
    features = [_feature(solid, solid.top, top)]
    for part, leg in zip(solid.legs, model.legs, strict=False):
        features.append(_feature(solid, part, {"part": part.name, **leg.fields()}))
    document = {
        "type": "FeatureCollection",
        "name": solid.name,
        "crs": None,
        "reference": {
            "kind": "local Cartesian, not WGS 84",
            "frame": model.frame,
            "axes": ["x", "y"],
            "units": "metres",
        },
        "features": features,
    }
    return {f"{solid.name}.geojson": (json.dumps(document, ensure_ascii=False) + "\n").encode()}


def _feature(solid: Solid, part: SolidPart, properties: dict[str, Any]) -> dict[str, Any]:
    import numpy as np

    ring = np.round(solid.map_from_table.apply(part.ring()), 6)
    closed = np.vstack([ring, ring[:1]]) + 0.0
    return {
        "type": "Feature",
        "id": part.name,
        "geometry": {"type": "Polygon", "coordinates": [closed.tolist()]},
        "properties": properties,
    }


FORMAT = Format(
    name="geojson",
    description="outlines for plans and GIS, in local metres",
    files=("{name}.geojson",),
    world=None,
    write=write,
)
