"""Two models from above in one SVG: the first in full lines, the second dashed."""

from __future__ import annotations

import math

from tablemap import palette
from tablemap.errors import TablemapError
from tablemap.files import write_whole
from tablemap.model import TableLeg, TableModel
from tablemap.model.shapes import shape_named
from tablemap.paths import AnyPath, as_path
from tablemap.words import escape

COLOURS = (palette.FIRST.css, palette.SECOND.css)
MARGIN = 0.25  # metres round both tables
PIXELS = 640  # the longer side of the room that is drawn
LEG_WITHOUT_SIZE = 0.04
STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


def write_drawing(file: AnyPath, a: TableModel, b: TableModel, *, names: tuple[str, str]) -> None:
    """Write `draw_both` into ``file``, and make its folder.

    Raises `TablemapError` if the file cannot be written.
    """
    file = as_path(file)
    try:
        write_whole(file, draw_both(a, b, names=names))
    except OSError as error:
        raise TablemapError(f"the drawing cannot be written ({error.strerror}): {file}") from error


def draw_both(a: TableModel, b: TableModel, *, names: tuple[str, str]) -> str:
    """Return an SVG of both models in the map, north (y) up, with a scale bar."""
    points = [
        point
        for model in (a, b)
        for point in (
            *model.surface.outline,
            *((leg.x, leg.y) for leg in model.legs),
            (model.surface.pose.x, model.surface.pose.y),
        )
    ]
    left, right = min(p[0] for p in points) - MARGIN, max(p[0] for p in points) + MARGIN
    low, high = min(p[1] for p in points) - MARGIN, max(p[1] for p in points) + MARGIN
    scale = PIXELS / max(right - left, high - low)
    width, height = (right - left) * scale, (high - low) * scale
    bar = max((step for step in STEPS if step * scale < width / 3), default=STEPS[0])
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height + 64:.0f}" '
        f'viewBox="0 0 {width:.1f} {height + 64:.1f}" font-family="sans-serif" font-size="13">',
        f'<rect width="{width:.1f}" height="{height + 64:.1f}" fill="white"/>',
    ]
    for model, colour, dash in ((a, COLOURS[0], "none"), (b, COLOURS[1], "7 5")):
        shapes = [_polygon(list(model.surface.outline), left, high, scale)]
        shapes += [_leg(leg, left, high, scale) for leg in model.legs]
        style = f'stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"'
        lines.append(f'<g fill="{colour}" fill-opacity="0.08" {style}>')
        lines += [*shapes, "</g>"]
    for row, (name, colour) in enumerate(zip(names, COLOURS, strict=True)):
        y = height + 18 + 18 * row
        lines.append(f'<text x="10" y="{y:.1f}" fill="{colour}">{escape(name)}</text>')
    y = height + 50
    lines.append(
        f'<path d="M10 {y:.1f} h{bar * scale:.1f}" stroke="black" stroke-width="3"/>'
        f'<text x="{16 + bar * scale:.1f}" y="{y + 4:.1f}">{bar:g} m in {escape(a.frame)}</text>'
    )
    return "\n".join([*lines, "</svg>"]) + "\n"


def _polygon(points: list[tuple[float, float]], left: float, high: float, scale: float) -> str:
    text = " ".join(f"{(x - left) * scale:.2f},{(high - y) * scale:.2f}" for x, y in points)
    return f'<polygon points="{text}"/>'


def _leg(leg: TableLeg, left: float, high: float, scale: float) -> str:
    record = shape_named(leg.shape)
    sizes = record.extents({name: figure.value for name, figure in leg.dimensions.items()})
    along, across = (size / 2 for size in sizes or (LEG_WITHOUT_SIZE, LEG_WITHOUT_SIZE))
    if record.is_elliptic:
        x, y = (leg.x - left) * scale, (high - leg.y) * scale
        return f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{along * scale:.2f}"/>'
    c, s = math.cos(leg.yaw), math.sin(leg.yaw)
    corners = [(along, across), (-along, across), (-along, -across), (along, -across)]
    turned = [(leg.x + c * u - s * v, leg.y + s * u + c * v) for u, v in corners]
    return _polygon(turned, left, high, scale)
