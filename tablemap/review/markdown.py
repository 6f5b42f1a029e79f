"""Markdown for the viewer's text panes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tablemap.errors import ProcessWarning, is_doubt
from tablemap.model.shapes import is_angle

MOST_ROWS = 60


def table(header: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    """Return a markdown table; a cell's bars and line breaks do not break it."""
    lines = ["| " + " | ".join(header) + " |", "|" + " --- |" * len(header)]
    for row in rows:
        cells = (str(cell).replace("|", "/").replace("\n", " ") for cell in row)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def links(**entities: str) -> str:
    """Return a line with links to entities, by their names; a click selects them in the viewer."""
    named = [f"[{name.replace('_', ' ')}](recording://{path})" for name, path in entities.items()]
    return f"Select: {', '.join(named)}"


def told(warnings: Iterable[ProcessWarning]) -> list[str]:
    """Return a stage's warnings as lines, what doubts the figures first.

    They stand beside the view that shows what they are about.
    """
    ordered = sorted(warnings, key=lambda one: not is_doubt(one.code))
    return [*(f"- `{one.code}`: {one.message}" for one in ordered[:MOST_ROWS]), ""]


def metres(value: float, sigma: float | None) -> str:
    """Write a length with its standard deviation, or say that there is none."""
    return f"{value:z.3f} m" + (f" ± {1000 * sigma:.1f} mm" if sigma is not None else "")


def figure(name: str, value: float, sigma: float | None) -> str:
    """Write a dimension by its name: an angle in degrees, all else in metres."""
    if is_angle(name):
        spread = f" ± {np.degrees(sigma):.2f}°" if sigma is not None else ""
        return f"{np.degrees(value):z.2f}°{spread}"
    return metres(value, sigma)
