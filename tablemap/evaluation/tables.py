"""Scores as tables and drawings: ``scores.md``, an SVG of all errors, and the report's tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tablemap import palette
from tablemap.evaluation.aggregate import RunScore, summarise
from tablemap.evaluation.listing import named_figures
from tablemap.evaluation.published import PUBLISHED
from tablemap.evaluation.score import YAW, Error, Score
from tablemap.model.shapes import CIRCLE, PARALLELOGRAM, SHAPES, is_angle
from tablemap.words import escape

Rows = list[list[str]]


def score_rows(figures: Mapping[str, Any]) -> Rows:
    """Return a header and one row a scenario and method, then suites, ``overall`` last."""
    header = [
        "scenario",
        "method",
        "runs",
        "failed",
        "shape",
        "dimension mm",
        "beyond sensor",
        "angle deg",
        "height mm",
        "thickness mm",
        "place in map mm",
        "pose mm",
        "pose deg",
        "outline mm",
        "IoU",
        "legs found/missed/invented",
        "leg place mm",
        "leg size mm",
        "in 95 %",
        "interval score mm",
        "interval width mm",
        "views used",
        "silent",
        "false alarms",
        "s",
    ]
    rows = [header]
    methods = figures["methods"]
    scenarios = dict.fromkeys(s for method in methods.values() for s in method["scenarios"])
    for scenario in scenarios:
        for method, group in methods.items():
            if scenario in group["scenarios"]:
                rows.append(_row(scenario, method, group["scenarios"][scenario]))
    for suite in dict.fromkeys(s for method in methods.values() for s in method["suites"]):
        for method, group in methods.items():
            if group["suites"][suite]["runs"]:
                rows.append(_row(f"**{suite}**", method, group["suites"][suite]))
    rows.extend(_row("**overall**", method, group["overall"]) for method, group in methods.items())
    return rows


def run_rows(run: RunScore, score: Score) -> tuple[Rows, Rows]:
    """Return a header and one row a figure of a single run; and what is counted or remarked."""
    rows = [["", "truth", "model", "error", "sigma", "in 95 %", "status"]]
    right = "right" if run.right_shape else "wrong"
    rows.append(["shape", score.true_shape, score.shape, right, "", "", ""])
    for name, figure in named_figures(run):
        if is_angle(name) or name == YAW:
            size, model = (f"{np.degrees(x):.2f} deg" for x in _sizes(figure))
            error, sigma = f"{np.degrees(figure.error):+.2f} deg", figure.sigma
            stated = "" if sigma is None else f"{np.degrees(sigma):.2f} deg"
        else:
            size, model = (f"{x:.4f} m" for x in _sizes(figure))
            error, sigma = f"{1000 * figure.error:+.1f} mm", figure.sigma
            stated = "" if sigma is None else f"{1000 * sigma:.1f} mm"
        if name.endswith("place"):  # a distance from where the leg truly stands
            size = model = ""
        held = "" if figure.covered is None else "yes" if figure.covered else "no"
        rows.append([name, size, model, error, stated, held, figure.status])
    f: Mapping[str, Any] = summarise([run])
    return rows, [
        ["poses", f"{_spread(f['pose_mm'])} mm, {_spread(f['pose_deg'], 3)} deg"],
        ["outline", f"{_figure(f['outline_mm']['worst'])} mm, IoU {_figure(f['iou'], 3)}"],
        ["legs", _legs(score)],
        ["views", _views(score)],
        ["remark", _remark(run) or "none"],
    ]


def _sizes(figure: Error) -> tuple[float, float]:
    return figure.size, figure.size + figure.error


def _legs(score: Score) -> str:
    legs = score.legs
    if legs is None:
        return "their truth is not known"
    return f"{legs.found} found, {legs.missed} missed, {legs.invented} invented"


def _views(score: Score) -> str:
    views = score.views
    if views is None:
        return "which see the top is not known"
    return f"{views.used} used of {views.seeing} that see the top"


def _row(scenario: str, method: str, f: Mapping[str, Any]) -> list[str]:
    legs = f["legs"]
    return [
        scenario,
        method,
        str(f["runs"]),
        str(f["failed"]),
        _percent(f["shape_accuracy"]),
        _spread(f["dimension_mm"]),
        _spread(f["dimension_excess_mm"]),
        _spread(f["angle_deg"], 2),
        _spread(f["height_mm"]),
        _spread(f["thickness_mm"]),
        _spread(f["place_in_map_mm"]),
        _spread(f["pose_mm"]),
        _spread(f["pose_deg"], 3),
        _spread(f["outline_mm"]),
        _figure(f["iou"], 3),
        f"{legs['found']}/{legs['missed']}/{legs['invented']}",
        _spread(legs["place_mm"]),
        _spread(legs["size_mm"]),
        _percent(f["coverage_95"]),
        _figure(f["interval_score_mm"]),
        _figure(f["interval_width_mm"]),
        f"{f['views']['used']}/{f['views']['seeing']}" if f["views"]["seeing"] else "-",
        str(f["silent_failures"]),
        str(f["false_alarms"]),
        _figure(f["seconds"]["total"]),
    ]


def _spread(figure: Mapping[str, float | None], decimals: int = 1) -> str:
    if figure["median"] is None:
        return "-"
    return " / ".join(f"{figure[key]:.{decimals}f}" for key in ("median", "p95", "worst"))


def _figure(value: float | None, decimals: int = 1) -> str:
    return "-" if value is None else f"{value:.{decimals}f}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"


def markdown(rows: Rows) -> str:
    """Return rows, the first being the header, as a Markdown table."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    lines.insert(1, "|" + "---|" * len(rows[0]))
    return "\n".join(lines) + "\n"


def scores_markdown(figures: Mapping[str, Any], runs: Sequence[RunScore]) -> str:
    """Return ``scores.md``: the table, then every run that failed or erred without a warning."""
    seeds = figures["seeds"]
    span = f"{min(seeds)} to {max(seeds)}" if seeds else "none"
    parts = [
        f"# Scores of `{figures['suite']}`, seeds {span}\n",
        "Errors are median / 95th percentile / worst. Interval scores and widths are means over"
        " the 95 % intervals of dimensions and heights; a score is the width and 40 times what"
        " the truth lies outside. Views used are of those that see a tenth of the top or more.\n",
        markdown(score_rows(figures)),
    ]
    remarks = [
        f"- {run.scenario} {run.seed} {run.method}: {text}"
        for run in runs
        if (text := _remark(run))
    ]
    if remarks:
        parts.append("## Runs to look at\n")
        parts.append("\n".join(remarks) + "\n")
    return "\n".join(parts)


def _remark(run: RunScore) -> str:
    if run.score is None:
        return f"failed: {run.error}"
    words = []
    if not run.right_shape:
        words.append(f"a {run.score.true_shape} called {run.score.shape}")
    if run.score.silent_failure:
        bad = max((*run.score.measured, *run.score.poses), key=lambda e: abs(e.error))
        words.append(f"silent failure: {bad.name} {1000 * bad.error:+.0f} mm")
    if run.score.false_alarm:
        words.append(f"false alarm: {', '.join(sorted(set(run.score.doubts)))}")
    return "; ".join(words)


def report_tables(runs: Sequence[RunScore]) -> dict[str, Rows]:
    """Return the report's tables in its layout: published, its method here, tablemap here.

    A figure of several seeds is the nominal truth plus the median of estimate minus truth.
    """
    layouts = {
        "Table 1: length, width and angle (m, degrees)": "size",
        "Table 2: height (m)": "height",
        "Table 3: scores of parallelogram and circle": "scores",
        "Table 4: shape": "shape",
    }
    tables = {}
    for title, column in layouts.items():
        rows = [["dataset", "truth", "report, published", "report's method here", "tablemap here"]]
        for scenario, published in PUBLISHED.items():
            cells = [
                _report_cell(
                    [r for r in runs if r.scenario == scenario and r.method == method], column
                )
                for method in ("report", "tablemap")
            ]
            stated = published.get(column) or _published_shape(published)
            rows.append([scenario, published["truth"], stated, *cells])
        tables[title] = rows
    return tables


def _published_shape(published: Mapping[str, str]) -> str:
    if published["size"].startswith("d "):
        return CIRCLE.name
    return PARALLELOGRAM.name


def _report_cell(runs: Sequence[RunScore], column: str) -> str:
    scores = [run.score for run in runs if run.score]
    if not scores:
        return "-"
    if column == "shape":
        return ", ".join(sorted({score.shape for score in scores}))
    if column == "height":
        heights = [s.height for s in scores if s.height]
        return f"{np.median([h.size + h.error for h in heights]):.3f}" if heights else "-"
    if column == "scores":
        families = (
            [shape.name for shape in SHAPES.values() if shape.is_quadrilateral],
            [shape.name for shape in SHAPES.values() if shape.is_round],
        )
        medians = [
            float(np.median([max(s.weights.get(name, 0.0) for name in names) for s in scores]))
            for names in families
        ]
        return " ".join(f"{value:.3f}".lstrip("0") or "0" for value in medians)
    sizes: dict[str, list[float]] = {}
    for s in scores:
        for error in s.dimensions:
            sizes.setdefault(error.name, []).append(error.size + error.error)
    values = [float(np.median(v)) for v in sizes.values()]
    text = " x ".join(f"{value:.3f}" for value in sorted(values))
    angles = [np.degrees(s.angle.size + s.angle.error) for s in scores if s.angle]
    return f"{text}, {np.median(angles):.1f}" if angles else text


def error_svg(runs: Sequence[RunScore]) -> str:
    """Return a strip plot: each run's largest measured dimension error, by scenario and method."""
    scenarios = list(dict.fromkeys(run.scenario for run in runs))
    methods = list(dict.fromkeys(run.method for run in runs))
    colours = dict(zip(methods, (palette.FIRST.css, palette.SECOND.css), strict=False))
    left, row, width = 210, 22, 760
    ticks = [0.1, 1, 10, 100, 1000]

    def across(error: float) -> float:
        return float(left + (np.log10(np.clip(error, 0.1, 1000)) + 1) / 4 * (width - left - 20))

    height = row * len(scenarios) + 60
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="sans-serif" font-size="12">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    parts.extend(
        f'<line x1="{across(tick):.1f}" y1="30" x2="{across(tick):.1f}" y2="{height - 25}" '
        f'stroke="#ddd"/><text x="{across(tick):.1f}" y="{height - 8}" '
        f'text-anchor="middle">{tick:g} mm</text>'
        for tick in ticks
    )
    parts.extend(
        f'<circle cx="{left + 150 * number}" cy="14" r="4" fill="{colours[method]}"/>'
        f'<text x="{left + 10 + 150 * number}" y="18">{escape(method)}</text>'
        for number, method in enumerate(methods)
    )
    for number, scenario in enumerate(scenarios):
        y = 40 + row * number
        parts.append(
            f'<text x="{left - 12}" y="{y + 4}" text-anchor="end">{escape(scenario)}</text>'
        )
        for run in runs:
            if run.scenario == scenario and run.score and run.score.dimensions:
                worst = 1000 * max(abs(error.error) for error in run.score.dimensions)
                offset = 4 * methods.index(run.method) - 2
                parts.append(
                    f'<circle cx="{across(worst):.1f}" cy="{y + offset}" r="3.5" '
                    f'fill="{colours[run.method]}" fill-opacity="0.6"/>'
                )
    return "\n".join([*parts, "</svg>\n"])
