"""Nav2's keep-out mask: an occupancy image with its YAML, and the polygon, in the map.

A cell is occupied as soon as the padded footprint (top and legs) touches it.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tablemap.errors import TablemapError
from tablemap.export.registry import Format

if TYPE_CHECKING:
    import numpy as np
    import shapely
    from numpy.typing import NDArray

    from tablemap.config import ExportConfig
    from tablemap.export.solid import Solid

FREE, OCCUPIED = 254, 0
LARGEST_IMAGE = 20_000_000


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.pgm, NAME.yaml (as map_server reads them) and NAME.polygon.yaml."""
    return write_all([solid], config)


def write_all(solids: Sequence[Solid], config: ExportConfig) -> dict[str, bytes]:
    """Return the same files with all tables, for Nav2 takes one mask; the first one names them."""
    import numpy as np
    import yaml
    from PIL import Image

    first = solids[0]
    polygons = footprint(solids, config.padding)
    image, origin = _mask(polygons, config)
    encoded = io.BytesIO()
    Image.fromarray(image).save(encoded, format="PPM")
    server = {
        "image": f"{first.name}.pgm",
        "mode": "trinary",
        "resolution": config.resolution,
        "origin": [*origin, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    outline = {
        "frame_id": first.model.frame,
        "padding": config.padding,
        "polygons": [
            np.round(polygon.exterior.coords, 6)[:-1].tolist() for polygon in polygons.geoms
        ],
    }
    return {
        f"{first.name}.pgm": encoded.getvalue(),
        f"{first.name}.yaml": yaml.safe_dump(server, sort_keys=False).encode(),
        f"{first.name}.polygon.yaml": yaml.safe_dump(
            outline, sort_keys=False, default_flow_style=None
        ).encode(),
    }


def footprint(solids: Sequence[Solid], padding: float) -> shapely.MultiPolygon:
    """Return tops and legs in the map, grown by ``padding`` metres, without holes."""
    import shapely

    from tablemap.export.rings import arc_steps

    rings = [solid.map_from_table.apply(part.ring()) for solid in solids for part in solid.parts]
    united = shapely.union_all([shapely.Polygon(ring) for ring in rings])
    if padding > 0:
        united = united.buffer(padding, quad_segs=arc_steps(padding))
    pieces = shapely.get_parts(united)
    return shapely.MultiPolygon(
        [shapely.Polygon(piece.exterior) for piece in shapely.orient_polygons(pieces)]
    )


def _mask(
    polygons: shapely.MultiPolygon, config: ExportConfig
) -> tuple[NDArray[np.uint8], tuple[float, float]]:
    """Return the image (rows from the top down) and its lower left corner in the map, metres."""
    import numpy as np
    import shapely

    cell = config.resolution
    west, south, east, north = polygons.bounds
    # The origin is on whole cells, so that masks of one resolution have one grid.
    first = np.floor((np.array([west, south]) - config.margin) / cell).astype(np.int64)
    last = np.ceil((np.array([east, north]) + config.margin) / cell).astype(np.int64)
    columns, rows = (last - first).tolist()
    if columns * rows > LARGEST_IMAGE:
        raise TablemapError(
            f"a keep-out mask of {columns} x {rows} cells is too large; raise export.resolution "
            "or lower --padding."
        )
    x = (first[0] + np.arange(columns)) * cell
    y = (first[1] + np.arange(rows)) * cell
    shapely.prepare(polygons)
    occupied = np.stack(
        [
            shapely.intersects(polygons, shapely.box(x, bottom, x + cell, bottom + cell))
            for bottom in y
        ]
    )
    image = np.where(occupied[::-1], OCCUPIED, FREE).astype(np.uint8)
    return image, (round(float(first[0] * cell), 9), round(float(first[1] * cell), 9))


FORMAT = Format(
    name="nav2",
    description="a keep-out mask for Nav2's map_server, and its polygon",
    files=("{name}.pgm", "{name}.yaml", "{name}.polygon.yaml"),
    world=None,
    write=write,
    write_all=write_all,
)
