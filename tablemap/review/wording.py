"""Sentences and rows that the viewer's text and the page share, so that they agree."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np

from tablemap.geometry import Floats
from tablemap.stages.surface import Primitive

CLUTTER_MM = 30.0
"""Edge points this far from the fitted outline are of something else."""


class Sized(Protocol):
    """A figure with a value."""

    @property
    def value(self) -> float:
        """In metres."""
        ...


def spread(sigma: float | None) -> str:
    """Write a standard deviation (metres), or that there is none."""
    return "none" if sigma is None else f"{1000 * sigma:.1f} mm"


def sizes(dimensions: Mapping[str, Sized]) -> str:
    """Write a leg's dimensions."""
    return ", ".join(f"{name} {1000 * one.value:.0f} mm" for name, one in dimensions.items())


def seen(share: float) -> str:
    """Write which share of a side was seen."""
    return f"{100 * share:.0f} %"


def length(points: Iterable[Sequence[float]] | Floats) -> float:
    """Return the length of a line (n, 2), metres."""
    return float(np.linalg.norm(np.diff(np.array(points), axis=0), axis=1).sum())


def candidate_names(candidates: Sequence[Primitive]) -> list[str]:
    """Return a name for each candidate shape; of those of one shape, each has its own."""
    found: list[str] = []
    for one in candidates:
        name = one.shape if one.corner_radius is None else f"rounded {one.shape}"
        before = sum(other.rstrip(" 0123456789") == name for other in found)
        found.append(f"{name} {before + 1}" if before else name)
    return found


def residuals(metres: Floats) -> str:
    """Return how near the edge points (n,) lie to the outline, and how many are clutter."""
    finite = 1000 * metres[np.isfinite(metres)]
    near = np.abs(finite[np.abs(finite) < CLUTTER_MM])
    median, most = np.percentile(near, [50, 95]) if len(near) else (np.nan, np.nan)
    far = len(finite) - len(near)
    return (
        f"Residuals of {len(near)} edge points: half are within {median:.1f} mm, "
        f"95 % within {most:.1f} mm."
    ) + (
        f" {far} more {'is' if far == 1 else 'are'} {CLUTTER_MM:.0f} mm or further away: clutter, "
        "not the table's edge."
        if far
        else ""
    )
