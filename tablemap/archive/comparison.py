"""Comparison of two models: the differences, their sizes, and their sizes in sigmas."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from tablemap.archive.folder import load_model
from tablemap.geometry import wrap_angle
from tablemap.model import Figure, TableLeg, TableModel
from tablemap.model.shapes import shape_named
from tablemap.paths import AnyPath

SAME_LEG = 0.25
"""Legs farther apart than this are different legs, metres."""
STEP, MOST_STEPS = 0.01, 10_000
"""Metres between the points of an outline that are compared, and most of them."""


@dataclass(frozen=True)
class Difference:
    """One figure of both models (metres, radians); None where a model lacks it.

    - ``difference``: b - a
    - ``sigma``: of the difference, as if both were independent; two runs on one recording are not,
      so that theirs is too large
    - ``sigmas``: the size of the difference divided by its sigma
    """

    name: str
    a: float | None
    b: float | None
    difference: float | None = None
    sigma: float | None = None

    @property
    def sigmas(self) -> float | None:
        """The difference's size in its sigma."""
        if self.difference is None or not self.sigma:
            return None
        return abs(self.difference) / self.sigma


@dataclass(frozen=True)
class Comparison:
    """Model ``b`` against model ``a``.

    - ``words``: values that are not numbers: name, a's, b's
    - ``overlap``: the intersection of both outlines over their union
    - ``farthest``: metres, the largest distance from one outline to the other (Hausdorff)

    The last two are None if the frames differ or an outline has no area.
    """

    words: tuple[tuple[str, str, str], ...]
    figures: tuple[Difference, ...]
    overlap: float | None
    farthest: float | None

    def to_dict(self) -> dict[str, object]:
        """Return the comparison as values for JSON."""
        return {
            "words": {name: {"a": a, "b": b} for name, a, b in self.words},
            "figures": [{**asdict(each), "sigmas": each.sigmas} for each in self.figures],
            "overlap": self.overlap,
            "farthest": self.farthest,
        }


def compare(a: TableModel | AnyPath, b: TableModel | AnyPath) -> Comparison:
    """Compare two models; each is a model, a run or a ``table.json``.

    If both models are in one frame, legs are paired by their places. Raises `TablemapError` if a
    model cannot be read.
    """
    a, b = load_model(a), load_model(b)
    top_a, top_b = a.surface, b.surface
    words = [
        ("shape", top_a.shape, top_b.shape),
        ("verdict", a.verdict.level, b.verdict.level),
        ("frame", a.frame, b.frame),
        ("legs", str(len(a.legs)), str(len(b.legs))),
        ("views", _views(a), _views(b)),
    ]
    rows = [
        _figure(name, top_a.dimensions.get(name), top_b.dimensions.get(name))
        for name in dict.fromkeys([*top_a.dimensions, *top_b.dimensions])
    ]
    if top_a.corner_radius or top_b.corner_radius:
        rows.append(_figure("corner_radius", top_a.corner_radius, top_b.corner_radius))
    rows.append(_figure("height", top_a.height, top_b.height))
    if top_a.thickness or top_b.thickness:
        rows.append(_figure("thickness", top_a.thickness, top_b.thickness))
    overlap = farthest = None
    if a.frame == b.frame:
        rows.extend(_place(a, b))
        rows.extend(_legs(a.legs, b.legs))
        overlap, farthest = _outlines(a, b)
    return Comparison(tuple(words), tuple(rows), overlap, farthest)


def _views(model: TableModel) -> str:
    return f"{sum(each.used for each in model.snapshots)} of {len(model.snapshots)}"


def _figure(name: str, a: Figure | None, b: Figure | None) -> Difference:
    if a is None or b is None:
        return Difference(name, a.value if a else None, b.value if b else None)
    return Difference(name, a.value, b.value, b.value - a.value, _together(a.sigma, b.sigma))


def _together(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else math.hypot(a, b)


def _place(a: TableModel, b: TableModel) -> list[Difference]:
    rows = []
    # Compare yaws within the smaller of the two shapes' periods.
    period = min(shape_named(model.surface.shape).yaw_period for model in (a, b))
    for k, name in enumerate(("x", "y", "yaw")):
        first, second = (getattr(model.surface.pose, name) for model in (a, b))
        variance = sum(model.surface.pose.covariance[k][k] for model in (a, b))
        difference = second - first
        if name == "yaw":
            if not period:
                continue
            difference = wrap_angle(difference, period)
        rows.append(Difference(name, first, second, difference, math.sqrt(max(variance, 0.0))))
    return rows


def _legs(a: tuple[TableLeg, ...], b: tuple[TableLeg, ...]) -> list[Difference]:
    """Return for each pair of legs their distance and the differences of their sizes."""
    if not a or not b:
        return []
    from scipy.optimize import linear_sum_assignment

    places_a, places_b = (np.array([[leg.x, leg.y] for leg in legs]) for legs in (a, b))
    apart = np.linalg.norm(places_a[:, None] - places_b[None], axis=-1)
    # Distances are capped at the limit, so that a missing leg does not change the other pairs.
    pairs = zip(*linear_sum_assignment(np.minimum(apart, SAME_LEG)), strict=True)
    rows = []
    for i, j in pairs:
        if apart[i, j] >= SAME_LEG:
            continue
        first, second, name = a[i], b[j], f"leg {i + 1}"
        sigma = _together(first.position_sigma, second.position_sigma)
        rows.append(Difference(f"{name} place", None, None, float(apart[i, j]), sigma))
        rows.extend(
            _figure(f"{name} {key}", figure, second.dimensions[key])
            for key, figure in first.dimensions.items()
            if key in second.dimensions
        )
    return rows


def _outlines(a: TableModel, b: TableModel) -> tuple[float | None, float | None]:
    import shapely

    tops = [
        shapely.make_valid(shapely.Polygon(model.surface.outline))
        if len(model.surface.outline) > 2
        else shapely.Polygon()
        for model in (a, b)
    ]
    if min(top.area for top in tops) <= 0:
        return None, None
    union = tops[0].union(tops[1]).area
    edges = [top.boundary.segmentize(max(STEP, top.length / MOST_STEPS)) for top in tops]
    return float(tops[0].intersection(tops[1]).area / union), float(
        shapely.hausdorff_distance(*edges)
    )
