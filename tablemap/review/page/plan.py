"""A table from above as SVG: sides by status, dimensions with sigmas, legs, stops round it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from tablemap import palette
from tablemap.geometry import Floats, Pose2
from tablemap.model import Figure, TableLeg, TableModel
from tablemap.model.shapes import shape_named
from tablemap.review.doubted import DoubtLines, farthest
from tablemap.review.numbering import from_one_place, numbered
from tablemap.review.wording import length
from tablemap.words import escape

DASHES = {"measured": "none", "inferred": "9 5", "unseen": "2 5"}
STATUS = {name: (ink.css, DASHES[name]) for name, ink in palette.STATUS.items()}
WIDTH = 760.0  # pixels
MARGIN = 0.30  # metres round what is drawn
MOST_AWAY = 3.0  # times the table's reach: stops farther away are left out of the drawing
LEG_WITHOUT_SIZE = 0.04
MOST_LABELLED_SIDES = 12
HEADING = 0.22  # metres
LABEL = 13.0  # pixels
NAME = (120.0, LABEL)  # pixels, of a doubt's name
NUMBER = palette.LEFT_OUT.css

Pixels = Callable[[Floats], Floats]


def plan(model: TableModel, doubts: Sequence[DoubtLines] = ()) -> str:
    """Return the SVG in the table's own frame: its length to the right.

    ``doubts`` are outlined, with their names.
    """
    surface = model.surface
    pose = Pose2(surface.pose.x, surface.pose.y, surface.pose.yaw)
    outline = _local(pose, surface.outline)
    if len(outline) < 3:
        return "<p>There is no outline to draw.</p>"
    reach = float(np.linalg.norm(outline, axis=1).max())
    stops = {
        k: pose.inverse() @ Pose2(s.map_from_base.x, s.map_from_base.y, s.map_from_base.yaw)
        for k, s in enumerate(model.snapshots)
    }
    near = {k: s for k, s in stops.items() if np.hypot(s.x, s.y) <= MOST_AWAY * reach}
    drawn = np.concatenate([outline, *[s.translation[None] for s in near.values()]])
    low, high = drawn.min(axis=0) - MARGIN, drawn.max(axis=0) + MARGIN
    scale = WIDTH / float((high - low)[0])
    height = float((high - low)[1]) * scale

    def pixels(points: Floats) -> Floats:
        return np.asarray((points - [low[0], high[1]]) * [scale, -scale])

    parts = [f'<polygon points="{_points(pixels(outline))}" fill="{palette.MODEL.tint}"/>']
    for k, leg in enumerate(model.legs, start=1):
        parts.append(_leg(leg, k, pose, pixels, scale))
    sides = []
    for edge in surface.edges:
        colour, dash = STATUS[edge.status]
        side = _local(pose, edge.points)
        parts.append(
            f'<polyline points="{_points(pixels(side))}" fill="none" stroke="{colour}" '
            f'stroke-width="3" stroke-dasharray="{dash}"><title>{edge.status}</title></polyline>'
        )
        sides.append(side)
    if sum(edge.is_straight for edge in surface.edges) <= MOST_LABELLED_SIDES:
        for k, (side, edge) in enumerate(zip(sides, surface.edges, strict=True)):
            is_told = edge.is_straight and not surface.dimensions
            told = f"{length(side):.3f} m" if is_told else ""
            parts += _beside(k, side, told, STATUS[edge.status][0], pixels)
    parts += _labels(model, outline, pixels)
    for views in from_one_place(list(stops.values())):
        if views[0] in near:
            used = any(model.snapshots[k].used for k in views)
            parts.append(_stop(numbered(views), near[views[0]], pixels, used=used))
    parts += _doubts(doubts, pose, pixels)
    parts.append(_axes(pose, scale, height, model.frame))
    left_out = len(stops) - len(near)
    told = ' <span class="doubt">Yellow-green</span>: what the doubts are about.' if doubts else ""
    note = f" {left_out} stops farther off are not drawn." if left_out else ""
    return (
        f'<svg viewBox="0 0 {WIDTH:.0f} {height:.1f}" width="{WIDTH:.0f}" '
        f'height="{height:.0f}" font-family="sans-serif" font-size="13" role="img">'
        "<title>The table from above</title>" + "".join(parts) + "</svg>"
        '<p class="muted">Sides: <span class="measured">measured</span>, '
        '<span class="inferred">inferred (dashed)</span>, '
        '<span class="unseen">unseen (dotted)</span>. '
        "Grey numbers: the sides and the legs of the tables below. Circles with a line: the stops "
        f"and their headings, grey where not used.{told}{note}</p>"
    )


def _doubts(doubts: Sequence[DoubtLines], pose: Pose2, pixels: Pixels) -> list[str]:
    """Draw the doubts' lines, and their names outside of the top, each once."""
    parts: list[str] = []
    named: dict[str, Floats] = {}
    middle = pixels(np.zeros((1, 2)))[0]
    for doubt in doubts:
        drawn = [pixels(_local(pose, line[:, :2])) for line in doubt.lines]
        parts += [
            f'<polyline points="{_points(line)}" fill="none" stroke="{palette.DOUBT.css}" '
            f'stroke-width="2"><title>{doubt.name}</title></polyline>'
            for line in drawn
        ]
        if doubt.name in named:
            continue
        first = drawn[0]
        is_closed = np.allclose(first[0], first[-1])
        at = farthest(first, middle) if is_closed else (first[0] + first[-1]) / 2
        outward = (at - middle) / max(float(np.linalg.norm(at - middle)), 1e-9)
        place = at + 2.3 * LABEL * outward  # beyond the dimensions
        step = np.array([0.0, math.copysign(LABEL / 2, outward[1])])
        while any((np.abs(place - other) < NAME).all() for other in named.values()):
            place = place + step
        named[doubt.name] = place
    return parts + [_text(place, name, palette.DOUBT.css) for name, place in named.items()]


def _local(pose: Pose2, points: object) -> Floats:
    return pose.inverse().apply(np.array(points, dtype=np.float64).reshape(-1, 2))


def _points(points: Floats) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _text(place: Floats, text: str, colour: str = palette.TEXT.css) -> str:
    return (
        f'<text x="{place[0]:.1f}" y="{place[1]:.1f}" text-anchor="middle" '
        f'dominant-baseline="middle" fill="{colour}" stroke="white" stroke-width="4" '
        f'paint-order="stroke">{escape(text)}</text>'
    )


def _written(name: str, figure: Figure) -> str:
    spread = "" if figure.sigma is None else f" ± {1000 * figure.sigma:.1f} mm"
    return f"{name} {figure.value:.3f} m{spread}"


def _labels(model: TableModel, outline: Floats, pixels: Pixels) -> list[str]:
    """Write the lengths in the middle of a round top, else below and to the right of the top."""
    record, dimensions = shape_named(model.surface.shape), model.surface.dimensions
    low, high = pixels(outline).min(axis=0), pixels(outline).max(axis=0)
    middle = (low + high) / 2
    if record.is_round:
        places = [middle, middle + np.array([0.0, 1.5 * LABEL])]
    else:
        places = [np.array([middle[0], high[1] + LABEL]), np.array([high[0] + LABEL, middle[1]])]
    parts = []
    for name, place, turn in zip(record.lengths, places, (0, -90), strict=False):
        if name in dimensions:
            text = _text(
                place, _written(name, dimensions[name]), STATUS[dimensions[name].status][0]
            )
            parts.append(_turned(text, place, turn) if turn and not record.is_round else text)
    return parts


def _beside(number: int, side: Floats, reach: str, colour: str, pixels: Pixels) -> list[str]:
    """Write a side's number inside of the top, and its length outside, along the side."""
    ends = pixels(side)
    along = ends[-1] - ends[0]
    # The outline is counter-clockwise, but pixel rows run down: this normal points inward.
    inward = np.array([along[1], -along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    middle = (ends[0] + ends[-1]) / 2 if len(ends) == 2 else ends[len(ends) // 2]
    parts = [_text(middle + LABEL * inward, str(number), NUMBER)]
    if reach:
        place = middle - LABEL * inward
        turn = math.degrees(math.atan2(along[1], along[0]))
        upright = (turn + 90) % 180 - 90
        parts.append(_turned(_text(place, reach, colour), place, upright))
    return parts


def _turned(text: str, place: Floats, degrees: float) -> str:
    turn = f' transform="rotate({degrees:.1f} {place[0]:.1f} {place[1]:.1f})"'
    return text.replace("<text", f"<text{turn}", 1)


def _leg(leg: TableLeg, number: int, pose: Pose2, pixels: Pixels, scale: float) -> str:
    local = pose.inverse() @ Pose2(leg.x, leg.y, leg.yaw)
    record = shape_named(leg.shape)
    sizes = record.extents({name: figure.value for name, figure in leg.dimensions.items()})
    half = np.array(sizes or (LEG_WITHOUT_SIZE, LEG_WITHOUT_SIZE)) / 2
    colour, dash = STATUS[leg.status]
    style = (
        f'fill="{palette.MODEL.css}" fill-opacity="0.5" stroke="{colour}" stroke-width="1.5" '
        f'stroke-dasharray="{dash}"'
    )
    centre = pixels(local.translation)
    title = f"<title>leg {number}: {leg.shape}, {leg.status}</title>"
    inward = pixels(np.zeros(2)) - centre
    away = inward / max(float(np.linalg.norm(inward)), 1e-9)
    reach = scale * float(half.max())
    name = _text(centre + (reach + LABEL) * away, str(number), NUMBER)
    if record.is_elliptic:
        return (
            f'<circle cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{scale * half[0]:.1f}" {style}>'
            f"{title}</circle>{name}"
        )
    corners = local.apply(half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]))
    return f'<polygon points="{_points(pixels(corners))}" {style}>{title}</polygon>{name}'


def _stop(label: str, stop: Pose2, pixels: Pixels, *, used: bool) -> str:
    colour = (palette.REGISTERED if used else palette.LEFT_OUT).css
    radius = max(9, 3 + 3 * len(label))
    centre, ahead = pixels(stop.apply(np.array([[0.0, 0.0], [HEADING, 0.0]])))
    return (
        f'<line x1="{centre[0]:.1f}" y1="{centre[1]:.1f}" x2="{ahead[0]:.1f}" '
        f'y2="{ahead[1]:.1f}" stroke="{colour}" stroke-width="2"/>'
        f'<circle cx="{centre[0]:.1f}" cy="{centre[1]:.1f}" r="{radius}" fill="{colour}"/>'
        f'<text x="{centre[0]:.1f}" y="{centre[1]:.1f}" text-anchor="middle" '
        f'dominant-baseline="central" font-size="10" fill="white">{label}</text>'
    )


def _axes(pose: Pose2, scale: float, height: float, frame: str) -> str:
    """Draw a scale bar, and the axes of the frame that the poses are in."""
    bar = next((b for b in (1.0, 0.5, 0.2, 0.1) if b * scale < WIDTH / 4), 0.1)
    parts = [
        f'<path d="M12 {height - 14:.1f} h{bar * scale:.1f}" stroke="{palette.TEXT.css}" '
        'stroke-width="3"/>'
        f'<text x="{20 + bar * scale:.1f}" y="{height - 10:.1f}">{bar:g} m</text>'
    ]
    origin = np.array([45.0, 45.0])
    for name, way in (("x", [1.0, 0.0]), ("y", [0.0, 1.0])):
        tip = origin + 30 * pose.inverse().rotate(np.array(way)) * [1.0, -1.0]
        parts.append(
            f'<path d="M{origin[0]:.1f} {origin[1]:.1f} L{tip[0]:.1f} {tip[1]:.1f}" '
            f'stroke="{palette.LEFT_OUT.css}" stroke-width="2"/>'
        )
        parts.append(_text(origin + 1.35 * (tip - origin), name, palette.LEFT_OUT.css))
    parts.append(
        f'<text x="12" y="{origin[1] + 55:.1f}" fill="{palette.LEFT_OUT.css}">'
        f"{escape(frame)}</text>"
    )
    return "".join(parts)
