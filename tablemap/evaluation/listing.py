"""Every figure of every run as CSV, for a spreadsheet or a data frame."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence

from tablemap.evaluation.aggregate import RunScore
from tablemap.evaluation.score import Error

COLUMNS = (
    "scenario",
    "seed",
    "method",
    "figure",
    "truth",
    "error",
    "sigma",
    "status",
    "covered",
    "interval_score",
    "interval_width",
)
"""Lengths in metres, angles in radians; empty where nothing is stated."""


def figures_csv(runs: Sequence[RunScore]) -> str:
    """Return a header and one line a figure."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for run in runs:
        for name, error in named_figures(run):
            written = (
                name,
                f"{error.size:.6f}",
                f"{error.error:.6f}",
                _written(error.sigma),
                error.status,
                "" if error.covered is None else str(error.covered).lower(),
                _written(error.interval_score),
                _written(error.interval_width),
            )
            writer.writerow([run.scenario, run.seed, run.method, *written])
    return stream.getvalue()


def named_figures(run: RunScore) -> Iterator[tuple[str, Error]]:
    """Yield every figure of a run with its name; none of a run that failed."""
    score = run.score
    if score is None:
        return
    figures = [*score.dimensions, score.corner_radius, score.angle, score.height, score.thickness]
    yield from ((figure.name, figure) for figure in figures if figure)
    yield from ((figure.name, figure) for figure in score.place)
    if score.legs:
        yield from ((f"leg {i} place", place) for i, place in enumerate(score.legs.places))
        yield from ((f"leg {i} size", size) for i, size in enumerate(score.legs.sizes))


def _written(value: float | None) -> str:
    return "" if value is None else f"{value:.6f}"
