"""Residuals of the outline's fit as SVG: along the outline, and as a histogram."""

from __future__ import annotations

import numpy as np
import shapely

from tablemap import palette
from tablemap.geometry import Floats
from tablemap.review import wording
from tablemap.review.budget import BudgetedTop, bars
from tablemap.stages.surface import Surface
from tablemap.words import escape

WIDTH, HEIGHT = 760.0, 200.0
LEFT, RIGHT = 60.0, 40.0
LIMIT_MM = 10.0
MARKS_MM = (-10, -5, 0, 5, 10)
MOST_POINTS = 3000
MOST_CORNERS = 12
BINS = 41


def unrolled(surface: Surface) -> str:
    """Return the residuals in millimetres once round the outline, its corners as lines."""
    if len(surface.outline) < 3 or len(surface.points) == 0:
        return ""
    finite = np.isfinite(surface.residuals)
    step = max(1, -(-int(finite.sum()) // MOST_POINTS))
    points, residuals = surface.points[finite][::step], 1000 * surface.residuals[finite][::step]
    ring = shapely.LinearRing(surface.outline)
    along = shapely.line_locate_point(ring, shapely.points(points)) / ring.length
    x = LEFT + (WIDTH - LEFT) * along
    y = _height(np.clip(residuals, -LIMIT_MM, LIMIT_MM))
    dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x, y, strict=True))
    corners = ""
    if len(surface.outline) <= MOST_CORNERS:
        shares = shapely.line_locate_point(ring, shapely.points(surface.outline)) / ring.length
        places = LEFT + (WIDTH - LEFT) * shares
        corners = "".join(f"M{place:.1f} 10V{HEIGHT - 10:.1f}" for place in places)
    marks = "".join(
        f'<path d="M{LEFT:.0f} {_height(m):.1f}H{WIDTH:.0f}" stroke="#ddd"/>'
        f'<text x="{LEFT - 6:.0f}" y="{_height(m) + 4:.1f}" text-anchor="end">{_mark(m)}</text>'
        for m in MARKS_MM
    )
    return _svg(
        "Residuals along the outline",
        HEIGHT + 20,
        marks
        + f'<path d="{corners}" stroke="#bbb"/>'
        + f'<path d="{dots}" stroke="{palette.TABLE_EDGE.css}" stroke-width="2.4" '
        'stroke-linecap="round" stroke-opacity="0.45"/>'
        + f'<text x="{(LEFT + WIDTH) / 2:.0f}" y="{HEIGHT + 14:.0f}" text-anchor="middle">'
        f"once round the outline, {ring.length:.2f} m, corners as lines; what is farther off than "
        f"{LIMIT_MM:.0f} mm is drawn at the border</text>",
    )


def histogram(residuals: Floats) -> str:
    """Return a histogram of the residuals in millimetres, with a sentence on half and 95 %."""
    finite = 1000 * residuals[np.isfinite(residuals)]
    if len(finite) == 0:
        return ""
    edges = np.linspace(-LIMIT_MM, LIMIT_MM, BINS + 1)
    counts, _ = np.histogram(np.clip(finite, -LIMIT_MM, LIMIT_MM), bins=edges)
    wide = (WIDTH - LEFT) / BINS
    tall = (HEIGHT / 2 - 10) * counts / max(int(counts.max()), 1)
    bars = "".join(
        f'<rect x="{LEFT + k * wide:.1f}" y="{HEIGHT / 2 - one:.1f}" width="{wide - 1:.1f}" '
        f'height="{one:.1f}"/>'
        for k, one in enumerate(tall)
    )
    labels = "".join(
        f'<text x="{LEFT + (WIDTH - LEFT) * (m / LIMIT_MM + 1) / 2:.1f}" '
        f'y="{HEIGHT / 2 + 16:.0f}" text-anchor="middle">{_mark(m)}</text>'
        for m in MARKS_MM
    )
    return (
        _svg(
            "Residuals by size",
            HEIGHT / 2 + 24,
            f'<g fill="{palette.TABLE_EDGE.css}" stroke="none">{bars}</g>{labels}',
        )
        + f"<p>{escape(wording.residuals(residuals))}</p>"
    )


def variance_bars(surface: BudgetedTop) -> str:
    """Return one bar a figure that shows where its variance comes from."""
    drawn = bars(surface)
    if not drawn:
        return ""
    left, wide, tall = 190.0, WIDTH - 190.0, 26.0
    content = ""
    for row, bar in enumerate(drawn):
        top = 6 + row * tall
        content += (
            f'<text x="{left - 8:.0f}" y="{top + 14:.0f}" text-anchor="end">{bar.title}</text>'
        )
        for one in bar.stretches:
            x, length = left + wide * one.start, wide * (one.end - one.start)
            colour = "rgb({}, {}, {})".format(*one.colour)
            content += (
                f'<rect x="{x:.1f}" y="{top:.1f}" width="{length:.1f}" height="19" '
                f'fill="{colour}"><title>{one.part} {one.end - one.start:.0%}</title></rect>'
            )
            if one.label:
                content += (
                    f'<text x="{x + length / 2:.1f}" y="{top + 14:.1f}" '
                    f'text-anchor="middle" fill="white">{one.label}</text>'
                )
    return _svg("Where each figure's variance comes from", 12 + tall * len(drawn), content)


def _mark(millimetres: int) -> str:
    return f"{millimetres:+d} mm" if millimetres else "0 mm"


def _height(millimetres: float | Floats) -> Floats:
    scale = (HEIGHT - 20) / 2 / LIMIT_MM
    return np.asarray(HEIGHT / 2 - scale * np.asarray(millimetres, dtype=np.float64))


def _svg(title: str, height: float, content: str) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH + RIGHT:.0f} {height:.0f}" width="{WIDTH + RIGHT:.0f}" '
        f'height="{height:.0f}" font-family="sans-serif" font-size="12" role="img" fill="none">'
        f'<title>{title}</title><g fill="{palette.TEXT.css}">{content}</g></svg>'
    )
