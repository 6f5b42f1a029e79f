"""The scores of many runs as one set of figures: medians, 95th percentiles, worst, shares."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tablemap.evaluation.score import MEASURED, YAW, Error, Score, ViewScore
from tablemap.model.shapes import PARALLELOGRAM, shape_named

Spread = dict[str, float | None]
"""``median``, ``p95`` and ``worst`` of absolute values; None where there are none."""


@dataclass(frozen=True)
class RunScore:
    """One run of a suite: ``score`` is None where the run failed, and ``error`` says why."""

    scenario: str
    seed: int
    method: str
    score: Score | None
    error: str | None
    seconds: dict[str, float]

    @property
    def right_shape(self) -> bool:
        """Whether the shape is the true one; the report has one word for all quadrilaterals."""
        if self.score is None:
            return False
        if self.method == "report" and self.score.shape == PARALLELOGRAM.name:
            return shape_named(self.score.true_shape).is_quadrilateral
        return self.score.shape == self.score.true_shape


def summarise(runs: Sequence[RunScore]) -> dict[str, object]:
    """Return the figures of ``scores.json`` for a group of runs.

    Only dimensions that the model calls measured count; ``unmeasured`` is the number of others.
    ``coverage_95`` is the share of stated 95 % intervals that contain the truth, over dimensions,
    angles, heights and places of legs. ``interval_score_mm`` (see `Error.interval_score`) and
    ``interval_width_mm`` are means over the intervals of dimensions and heights: they show
    intervals that are too wide. ``views`` counts the views that truly see the top.
    """
    scores = [run.score for run in runs if run.score]
    lengths = [e for s in scores for e in s.dimensions]
    measured = [e for e in lengths if e.status == MEASURED]
    angles = [s.angle for s in scores if s.angle]
    heights = [s.height for s in scores if s.height]
    thicknesses = [s.thickness for s in scores if s.thickness]
    in_map = [e for s in scores for e in s.place]
    legs = [s.legs for s in scores if s.legs]
    places = [e for leg in legs for e in leg.places]
    sizes = [e for leg in legs for e in leg.sizes]
    return {
        "runs": len(runs),
        "failed": len(runs) - len(scores),
        "shape_accuracy": _share(run.right_shape for run in runs if run.score),
        "shapes": _confusion(scores),
        "dimension_mm": _millimetres(measured),
        "dimension_excess_mm": spread(1000 * e.excess for e in measured),
        "unmeasured": len(lengths) - len(measured),
        "angle_deg": spread(np.degrees(e.error) for e in angles),
        "height_mm": _millimetres(heights),
        "height_excess_mm": spread(1000 * e.excess for e in heights),
        "thickness_mm": _millimetres(thicknesses),
        "place_in_map_mm": _millimetres(e for e in in_map if e.name != YAW),
        "pose_mm": spread(1000 * e.error for s in scores for e in s.poses),
        "pose_deg": spread(np.degrees(h) for s in scores for h in s.headings),
        "outline_mm": spread(1000 * s.outline for s in scores if s.outline is not None),
        "iou": _mean(s.iou for s in scores if s.iou is not None),
        "legs": {
            "found": sum(leg.found for leg in legs),
            "missed": sum(leg.missed for leg in legs),
            "invented": sum(leg.invented for leg in legs),
            "place_mm": _millimetres(places),
            "size_mm": _millimetres(sizes),
        },
        "coverage_95": _coverage([*measured, *angles, *heights, *places]),
        "coverage_95_by": {
            "dimensions": _coverage(measured),
            "angles": _coverage(angles),
            "heights": _coverage(heights),
            "thicknesses": _coverage(thicknesses),
            "places_in_map": _coverage(in_map),
            "leg_places": _coverage(places),
            "leg_sizes": _coverage(sizes),
        },
        "interval_score_mm": _mean_mm(e.interval_score for e in [*measured, *heights]),
        "interval_width_mm": _mean_mm(e.interval_width for e in [*measured, *heights]),
        "interval_score_by": {
            "dimensions_mm": _mean_mm(e.interval_score for e in measured),
            "heights_mm": _mean_mm(e.interval_score for e in heights),
            "leg_places_mm": _mean_mm(e.interval_score for e in places),
        },
        "interval_width_by": {
            "dimensions_mm": _mean_mm(e.interval_width for e in measured),
            "heights_mm": _mean_mm(e.interval_width for e in heights),
            "leg_places_mm": _mean_mm(e.interval_width for e in places),
        },
        "views": _views(s.views for s in scores if s.views),
        "silent_failures": sum(s.silent_failure for s in scores),
        "false_alarms": sum(s.false_alarm for s in scores),
        "seconds": _seconds(runs),
    }


def spread(values: Iterable[float]) -> Spread:
    """Return median, 95th percentile and worst of absolute values."""
    array = np.abs(np.fromiter(values, dtype=np.float64))
    if not len(array):
        return {"median": None, "p95": None, "worst": None}
    median, p95 = np.percentile(array, [50, 95])
    return {"median": _round(median), "p95": _round(p95), "worst": _round(array.max())}


def _millimetres(errors: Iterable[Error]) -> Spread:
    return spread(1000 * e.error for e in errors)


def _coverage(errors: Iterable[Error]) -> float | None:
    return _share(covered for e in errors if (covered := e.covered) is not None)


def _mean_mm(values: Iterable[float | None]) -> float | None:
    return _mean(1000 * value for value in values if value is not None)


def _views(views: Iterable[ViewScore]) -> dict[str, float | None]:
    """Return how many views see the top, and the share of them that was used."""
    counted = list(views)
    seeing, used = sum(v.seeing for v in counted), sum(v.used for v in counted)
    return {"seeing": seeing, "used": used, "share": _round(used / seeing) if seeing else None}


def _share(hits: Iterable[bool]) -> float | None:
    array = np.fromiter(hits, dtype=bool)
    return _round(array.mean()) if len(array) else None


def _mean(values: Iterable[float]) -> float | None:
    array = np.fromiter(values, dtype=np.float64)
    return _round(array.mean()) if len(array) else None


def _confusion(scores: Sequence[Score]) -> dict[str, dict[str, int]]:
    """Return, for each true shape, how often each shape was found."""
    table: dict[str, Counter[str]] = {}
    for score in scores:
        table.setdefault(score.true_shape, Counter())[score.shape] += 1
    return {true: dict(sorted(called.items())) for true, called in sorted(table.items())}


def _seconds(runs: Sequence[RunScore]) -> dict[str, float | None]:
    """Return the median seconds of each stage, and of all together as ``total``."""
    finished = [run.seconds for run in runs if run.seconds]
    stages = list(dict.fromkeys(stage for seconds in finished for stage in seconds))
    medians = {
        stage: _round(np.median([s[stage] for s in finished if stage in s])) for stage in stages
    }
    return {**medians, "total": spread(sum(s.values()) for s in finished)["median"]}


def _round(value: float) -> float:
    return round(float(value), 4)
