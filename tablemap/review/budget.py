"""The parts of each figure's variance, as one bar a figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from tablemap.review.colours import Colour

PARTS: dict[str, Colour] = {
    "noise": (120, 144, 156),
    "poses": (100, 160, 230),
    "drive_scale": (70, 110, 190),
    "depth": (235, 150, 60),
    "tilt": (210, 95, 95),
    "focal": (170, 110, 200),
    "mount": (95, 175, 120),
    "rim": (200, 175, 80),
    "level": (150, 120, 90),
    "shape": (225, 120, 180),
    "share": (90, 180, 180),
    "other": (160, 160, 160),
}
"""The parts in the order of the bar, each with its colour."""

_NAMED = 0.08  # a smaller share of a bar has no room for its name


class Budgeted(Protocol):
    """A figure with the parts of its variance."""

    @property
    def sigma(self) -> float | None:
        """The standard deviation, metres or radians."""
        ...

    @property
    def budget(self) -> Mapping[str, float] | None:
        """The parts of the variance, by their names."""
        ...


@dataclass(frozen=True)
class Stretch:
    """A part of a bar, from ``start`` to ``end`` (0 to 1), with its name if there is room."""

    part: str
    start: float
    end: float
    label: str

    @property
    def colour(self) -> Colour:
        """The part's colour."""
        return PARTS[self.part]


@dataclass(frozen=True)
class Bar:
    """One figure: its name with sigma, and the stretches of its variance."""

    title: str
    stretches: tuple[Stretch, ...]


def bars(figures: Mapping[str, Budgeted]) -> list[Bar]:
    """Return a bar for each figure that has a budget."""
    result = []
    for name, figure in figures.items():
        total = sum(figure.budget.values()) if figure.budget else 0.0
        if figure.sigma is None or figure.budget is None or total <= 0:
            continue
        end = 0.0
        stretches = []
        for part in PARTS:
            share = figure.budget.get(part, 0.0) / total
            if share > 0:
                label = part.replace("_", " ") if share >= _NAMED else ""
                stretches.append(Stretch(part, end, end + share, label))
                end += share
        unit = f"{1e3 * figure.sigma:.1f} {'mrad' if name == 'angle' else 'mm'}"
        result.append(Bar(f"{name}, sigma {unit}", tuple(stretches)))
    return result
