"""The parts of each figure's variance, as one bar a figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from tablemap.palette import Colour

WHITE: Colour = (255, 255, 255)
"""Of the parts' names, which are written on them."""
PARTS: dict[str, Colour] = {
    "noise": (84, 104, 114),
    "poses": (36, 106, 180),
    "drive_scale": (74, 98, 176),
    "depth": (156, 88, 16),
    "tilt": (170, 60, 64),
    "focal": (126, 72, 160),
    "mount": (38, 116, 66),
    "rim": (124, 100, 20),
    "level": (120, 90, 60),
    "floor": (88, 104, 36),
    "shape": (164, 58, 120),
    "share": (28, 112, 114),
    "other": (104, 104, 104),
}
"""The parts in the order of the bar, each with a colour on which white can be read."""

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


class BudgetedTop(Protocol):
    """A top whose figures have budgets."""

    @property
    def dimensions(self) -> Mapping[str, Budgeted]:
        """The figures by name."""
        ...

    @property
    def corner_radius(self) -> Budgeted | None:
        """The radius of round corners."""
        ...

    @property
    def height(self) -> Budgeted:
        """The height above the floor."""
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


def bars(top: BudgetedTop) -> list[Bar]:
    """Return a bar for each figure of a top that has a budget."""
    result = []
    radius = {"corner radius": top.corner_radius} if top.corner_radius else {}
    for name, figure in {**top.dimensions, **radius, "height": top.height}.items():
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
