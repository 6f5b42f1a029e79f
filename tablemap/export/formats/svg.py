"""SVG: a plan of the table in its own frame, one to one in millimetres, x right and y up.

Sides that were measured are drawn in full, inferred ones dashed, unseen ones dotted.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

from tablemap import palette
from tablemap.export.registry import Format
from tablemap.export.text import ANGLE_DECIMALS, child, number, xml_bytes
from tablemap.model.shapes import is_angle

if TYPE_CHECKING:
    from tablemap.config import ExportConfig
    from tablemap.export.solid import Solid
    from tablemap.geometry import Floats
    from tablemap.model import TableModel

MARGIN = 60.0
DASHES = {"measured": "none", "inferred": "24 12", "unseen": "4 10"}


def write(solid: Solid, config: ExportConfig) -> dict[str, bytes]:
    """Return NAME.svg; its description gives the table's pose in the map."""
    import numpy as np

    rings = {part.name: _drawn(part.ring()) for part in solid.parts}
    corners = np.concatenate(list(rings.values()))
    lines = _description(solid.model)
    left, upper = corners.min(axis=0) - MARGIN
    width, height = np.ptp(corners, axis=0) + 2 * MARGIN
    caption = 30.0 * (len(lines) + 1)
    root = Element(
        "svg",
        xmlns="http://www.w3.org/2000/svg",
        width=f"{number(width, 3)}mm",
        height=f"{number(height + caption, 3)}mm",
        viewBox=" ".join(number(value, 3) for value in (left, upper, width, height + caption)),
    )
    child(root, "title", f"{solid.name}, from above, millimetres")
    pose = solid.map_from_table
    child(
        root,
        "desc",
        f"Origin in {solid.model.frame}: x {number(pose.x)} m, y {number(pose.y)} m, "
        f"yaw {number(pose.yaw, ANGLE_DECIMALS)} rad.",
    )
    child(root, "path", id="top", d=_path(rings["top"]), fill=palette.MODEL.tint, stroke="none")
    for part in solid.legs:
        child(
            root,
            "path",
            id=part.name,
            d=_path(rings[part.name]),
            fill=palette.MODEL.css,
            stroke="none",
        ).set("fill-opacity", "0.6")
    for edge in solid.model.surface.edges:
        points = solid.map_from_table.inverse().apply(np.array(edge.points, dtype=np.float64))
        side = child(
            root, "polyline", points=_points(_drawn(points)), fill="none", stroke=palette.TEXT.css
        )
        side.set("stroke-width", "3")
        side.set("stroke-dasharray", DASHES[edge.status])
    cross = child(
        root, "path", id="origin", d="M -20 0 L 20 0 M 0 -20 L 0 20", stroke=palette.LOCALISED.css
    )
    cross.set("stroke-width", "2")
    for number_, line in enumerate(lines, start=1):
        text = child(root, "text", line, x=number(left + MARGIN, 3))
        text.set("y", number(upper + height + 30.0 * number_, 3))
        text.set("font-size", "22")
        text.set("font-family", "sans-serif")
    return {f"{solid.name}.svg": xml_bytes(root)}


def _drawn(points: Floats) -> Floats:
    """Return millimetres with y down, as SVG requires."""
    drawn: Floats = points * [1e3, -1e3]
    return drawn


def _points(points: Floats) -> str:
    return " ".join(f"{number(x, 3)},{number(y, 3)}" for x, y in points)


def _path(ring: Floats) -> str:
    return "M " + " L ".join(f"{number(x, 3)} {number(y, 3)}" for x, y in ring) + " Z"


def _description(model: TableModel) -> list[str]:
    surface = model.surface
    lines = [f"{surface.shape}, {model.verdict.level}"]
    for name, size in surface.dimensions.items():
        value, sigma, unit = size.value, size.sigma, "mm"
        factor = 1e3
        if is_angle(name):
            factor, unit = math.degrees(1), "°"
        spread = "" if sigma is None else f" ± {factor * sigma:.1f}"
        lines.append(f"{name} {factor * value:.1f}{spread} {unit}, {size.status}")
    sigma = surface.height.sigma
    spread = "" if sigma is None else f" ± {1e3 * sigma:.1f}"
    lines.append(f"height {1e3 * surface.height.value:.1f}{spread} mm")
    return lines


FORMAT = Format(
    name="svg",
    description="a plan from above, one to one",
    files=("{name}.svg",),
    world=None,
    write=write,
)
