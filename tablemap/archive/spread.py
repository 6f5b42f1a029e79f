"""The spread of three models or more: the middle and width of each figure, and its outliers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from tablemap.archive.folder import load_model
from tablemap.archive.index import figures_of
from tablemap.errors import TablemapError
from tablemap.geometry import Floats, wrap_angles
from tablemap.model import TableModel
from tablemap.model.shapes import shape_named
from tablemap.paths import AnyPath
from tablemap.robust import mad_sigma

LEAST_MODELS = 3
OUTLIER_SIGMAS = 3.0
LEAST_SPREAD = 1e-4
"""Metres or radians: figures of one recording agree so far on all machines."""

_NO_FIGURES = ("score", "legs", "views", "warnings")
_OF_PLACE = ("x", "y", "yaw")


@dataclass(frozen=True)
class FigureSpread:
    """One figure of several models (metres, radians).

    - ``values``: of each model, None if it lacks the figure
    - ``median``, ``low``, ``high``, ``deviation``: middle, ends and standard deviation of the known
      values; angles count from the first one on, so that they do not wrap
    - ``sigma``: the median of the stated sigmas, None if none is stated
    - ``outliers``: which models are farther from the median than 3 robust standard deviations, and
      than their own sigma
    """

    name: str
    values: tuple[float | None, ...]
    median: float
    low: float
    high: float
    deviation: float
    sigma: float | None
    outliers: tuple[int, ...]


@dataclass(frozen=True)
class Spreads:
    """What several models agree on: ``words`` are name and the value of each model."""

    words: tuple[tuple[str, tuple[str, ...]], ...]
    figures: tuple[FigureSpread, ...]

    def to_dict(self) -> dict[str, object]:
        """Return the spreads as values for JSON."""
        return {
            "words": {name: list(values) for name, values in self.words},
            "figures": [asdict(each) for each in self.figures],
        }


def spread(models: Sequence[TableModel | AnyPath]) -> Spreads:
    """Return the spread of each figure over models; each is a model, a run or a ``table.json``.

    Places are compared if all models are in one frame. Raises `TablemapError` for fewer than three
    models, and if one cannot be read.
    """
    loaded = [load_model(model) for model in models]
    if len(loaded) < LEAST_MODELS:
        raise TablemapError(f"expected three models or more, found {len(loaded)}.")
    words = (
        ("shape", tuple(model.surface.shape for model in loaded)),
        ("verdict", tuple(model.verdict.level for model in loaded)),
        ("frame", tuple(model.frame for model in loaded)),
        ("legs", tuple(str(len(model.legs)) for model in loaded)),
    )
    figures = [figures_of(model) for model in loaded]
    names = [
        name
        for name in dict.fromkeys(name for each in figures for name in each)
        if not name.endswith("_sigma") and name not in _NO_FIGURES
    ]
    if len({model.frame for model in loaded}) > 1:
        names = [name for name in names if name not in _OF_PLACE]
    period = min(shape_named(model.surface.shape).yaw_period for model in loaded)
    if not period:
        names = [name for name in names if name != "yaw"]
    return Spreads(words, tuple(_spread(name, figures, period) for name in names))


def _spread(name: str, figures: Sequence[dict[str, float]], period: float) -> FigureSpread:
    values = [each.get(name) for each in figures]
    known = np.array([math.nan if value is None else value for value in values])
    if name == "yaw":
        known = known[0] + wrap_angles(known - known[0], period)
    sigmas = np.array([each.get(f"{name}_sigma", math.nan) for each in figures])
    median = float(np.nanmedian(known))
    return FigureSpread(
        name=name,
        values=tuple(values),
        median=median,
        low=float(np.nanmin(known)),
        high=float(np.nanmax(known)),
        deviation=float(np.nanstd(known)),
        sigma=float(np.nanmedian(sigmas)) if np.isfinite(sigmas).any() else None,
        outliers=tuple(_outliers(known - median, sigmas)),
    )


def _outliers(deviations: Floats, sigmas: Floats) -> list[int]:
    """Return which (n,) deviations from the median stand out; NaN is an unknown one."""
    usual = mad_sigma(deviations[np.isfinite(deviations)])
    limits = np.fmax(OUTLIER_SIGMAS * max(usual, LEAST_SPREAD), sigmas)
    places: list[int] = np.flatnonzero(np.abs(deviations) > limits).tolist()
    return places
