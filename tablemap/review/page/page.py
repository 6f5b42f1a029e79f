"""``report.html``: a run on one page that needs nothing else, to read, print and send."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np

from tablemap import palette
from tablemap.archive.manifest import Manifest
from tablemap.events import OtherTable, RunFailed
from tablemap.model import TableModel
from tablemap.model.summary import doubts, summary_rows
from tablemap.review import wording
from tablemap.review.doubted import Doubted, DoubtLines
from tablemap.review.page.picture import BestView
from tablemap.review.page.plan import plan
from tablemap.review.page.plots import histogram, unrolled, variance_bars
from tablemap.review.progress import CHOICE
from tablemap.stages.surface import Surface
from tablemap.words import escape

STYLE = (
    """
:root { color-scheme: light; }
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 60em; padding: 0 1em;
  background: white; }
h1 { font-size: 1.6em; margin: 0 0 .2em; } h2 { font-size: 1.15em; margin: 1.6em 0 .4em; }
table { border-collapse: collapse; font-size: .93em; }
td, th { text-align: left; vertical-align: top; padding: .18em 1.2em .18em 0;
  border-bottom: 1px solid #ddd; overflow-wrap: anywhere; }
td:first-child, th, .short { white-space: nowrap; } th { font-weight: 600; }
svg { max-width: 100%; height: auto; }
section, tr { break-inside: avoid; } h2 { break-after: avoid; }
@media (max-width: 45em) {
  .drawn { overflow-x: auto; } .drawn svg { min-width: 36em; }
  .worded, .worded tbody { display: block; }
  .worded tr { display: flex; flex-wrap: wrap; border-bottom: 1px solid #ddd; }
  .worded td, .worded th { border: 0; } .worded td:not(.short) { flex: 1 0 100%; }
}
@media print { body { margin: 0; max-width: none; font-size: 11px; } }
"""
    + f"body {{ color: {palette.TEXT.css}; }}\n.muted {{ color: {palette.LEFT_OUT.css}; }}\n"
    + f".doubt {{ color: {palette.DOUBT.css}; }}\n"
    + "".join(
        f".{name} {{ color: {ink.css}; }}\n"
        for name, ink in {**palette.VERDICT, **palette.STATUS}.items()
    )
)
MOST_ROWS = 200
MANY = 3
"""Columns that stand beside a long text on any screen."""
STATUSES = ("measured", "inferred", "unseen", "good", "doubtful", "failed")
NO_TABLE = "nothing by itself; it gave no table"
OPTION = re.compile(r"--[a-z][a-z-]*(?: -?[0-9]+[.][0-9]+)*")
SHORT = 24
"""Letters of a cell that stays one line: long texts beside it give way."""


class Page:
    """Collects a run's results for the page; call it with each result when it is there."""

    def __init__(self) -> None:
        self._model: TableModel | None = None
        self._surface: Surface | None = None
        self._failure: RunFailed | None = None
        self._others: list[OtherTable] = []
        self._best = BestView()
        self._doubted = Doubted()

    def __call__(self, result: object) -> None:
        """Take a result or an event of the run."""
        self._best(result)
        self._doubted.take(result)
        if isinstance(result, TableModel):
            self._model = result
        elif isinstance(result, Surface):
            self._surface = result
        elif isinstance(result, OtherTable):
            self._others.append(result)
        elif isinstance(result, RunFailed):
            self._failure = result
            if result.stage == CHOICE:
                self._model = None  # it was refused

    def html(self, manifest: Manifest, *, status: str, error: str | None) -> str:
        """Return the page of a run that ended with ``status``."""
        model, name = self._model, escape(manifest.recording.path.rsplit("/", 1)[-1])
        if model is None:
            stage = self._failure.stage if self._failure else "recording"
            body = [
                f'<h1 class="failed">No model of {name}</h1>',
                f"<p>The run ended in <b>{escape(stage)}</b>:</p>",
                f"<blockquote>{_told(error or 'no reason was given')}</blockquote>",
                *_found(self._best),
                _stages_done(manifest, stage, status),
            ]
        else:
            body = [
                *_model(model, name, self._surface, self._best, self._doubted.of(model)),
                *_beside(self._others),
            ]
            if error:
                body.insert(1, f'<p class="doubtful">{escape(status)}: {escape(error)}</p>')
        return "\n".join(
            [
                "<!DOCTYPE html>",
                '<html lang="en"><head><meta charset="utf-8">',
                '<meta name="viewport" content="width=device-width">',
                f"<title>{name}: {escape(model.surface.shape if model else 'no model')}</title>",
                f"<style>{STYLE}</style></head><body>",
                *body,
                _provenance(manifest, status),
                "</body></html>\n",
            ]
        )


def _found(best: BestView) -> Iterable[str]:
    """Write which surfaces were seen where none was a table, and show the likeliest."""
    if not best.found:
        return
    picture = best.svg_of_found()
    if picture:
        yield f"<section><h2>In the camera's image</h2>{picture}</section>"
    yield f"<h2>Surfaces found ({len(best.found)})</h2>"
    yield _table(
        ("surface", "x, y in m", "height", "area", "views", "against it"),
        [
            (
                k,
                f"{one.x:z.2f}, {one.y:z.2f}",
                f"{one.height:.3f} m",
                f"{one.area:.2f} m²",
                len(one.views),
                one.reason or NO_TABLE,
            )
            for k, one in enumerate(best.found[:MOST_ROWS])
        ],
    )


def _model(
    model: TableModel,
    name: str,
    surface: Surface | None,
    best: BestView,
    places: list[DoubtLines],
) -> Iterable[str]:
    verdict = model.verdict
    yield (
        f'<h1>{escape(model.surface.shape.capitalize())}: <span class="{verdict.level}">'
        f"{verdict.level}</span></h1>"
    )
    yield f'<p class="muted">The table in {name}</p>'
    if verdict.reasons:
        yield "<ul>" + "".join(f"<li>{_told(doubt)}</li>" for doubt in doubts(model)) + "</ul>"
    rows = [row for row in summary_rows(model) if row[0] != "verdict"]
    yield _table((), [(name, text.replace("+-", "±")) for name, text in rows])
    picture = best.svg(model, places)
    if picture:
        yield f"<section><h2>In the camera's image</h2>{picture}</section>"
    yield f'<section class="drawn"><h2>From above</h2>{plan(model, places)}</section>'
    drawn = variance_bars(model.surface)
    if drawn:
        yield (f'<section class="drawn"><h2>Where the uncertainty comes from</h2>{drawn}</section>')
    yield "<h2>Sides</h2>"
    yield _table(
        ("side", "length", "status", "seen", "sigma"),
        [
            (
                k,
                f"{wording.length(edge.points):.3f} m",
                edge.status,
                wording.seen(edge.seen_fraction),
                wording.spread(edge.sigma),
            )
            for k, edge in enumerate(model.surface.edges)
        ],
    )
    if surface is not None and np.isfinite(surface.residuals).any():
        yield (
            '<section class="drawn"><h2>Edge points against the outline</h2>'
            f"{unrolled(surface)}{histogram(surface.residuals)}</section>"
        )
    yield f"<h2>Legs ({len(model.legs)})</h2>"
    if model.legs:
        yield _table(
            ("leg", "x, y in m", "sigma", "size", "status"),
            [
                (
                    f"{k} {leg.shape}",
                    f"{leg.x:z.3f}, {leg.y:z.3f}",
                    wording.spread(leg.position_sigma),
                    wording.sizes(leg.dimensions),
                    leg.status,
                )
                for k, leg in enumerate(model.legs, start=1)
            ],
        )
    yield "<h2>Stops</h2>"
    yield _table(
        ("stop", "x, y in m", "heading", "sigma", "used"),
        [
            (
                k,
                f"{one.map_from_base.x:z.3f}, {one.map_from_base.y:z.3f}",
                f"{math.degrees(one.map_from_base.yaw):z.1f}°",
                wording.spread(None if one.sigma is None else one.sigma.xy),
                "yes" if one.used else one.reason or "no",
            )
            for k, one in enumerate(model.snapshots[:MOST_ROWS])
        ],
    )
    yield f"<h2>Warnings ({len(model.warnings)})</h2>"
    if model.warnings:
        yield _table(
            ("code", "message"),
            [(one.code, one.message) for one in model.warnings[:MOST_ROWS]],
        )


def _beside(others: Sequence[OtherTable]) -> Iterable[str]:
    """Write a row for each other table: its model and its doubts, or why there is none."""
    if not others:
        return
    yield "<h2>Other tables</h2>"
    yield _table(
        ("table", "verdict", "x, y in m", "height", "what it is"),
        [
            (f"{one.number:02d}", *_other(one.outcome))
            if isinstance(one.outcome, TableModel)
            else (f"{one.number:02d}", "none", "", "", one.outcome)
            for one in others
        ],
    )


def _other(model: TableModel) -> tuple[str, ...]:
    surface = model.surface
    sizes = " x ".join(f"{size.value:.3f}" for size in surface.dimensions.values())
    return (
        model.verdict.level,
        f"{surface.pose.x:z.3f}, {surface.pose.y:z.3f}",
        f"{surface.height.value:.3f} m",
        "; ".join([f"{surface.shape} {sizes}", *doubts(model)]),
    )


def _stages_done(manifest: Manifest, last: str, status: str) -> str:
    rows = [
        (name, f"{seconds:.2f} s") for name, seconds in manifest.timings.items() if name != last
    ]
    return "<h2>How far it came</h2>" + _table(("stage", "time"), [*rows, (last, status)])


def _provenance(manifest: Manifest, status: str) -> str:
    rows: list[tuple[object, ...]] = [
        ("recording", manifest.recording.path),
        ("size", f"{manifest.recording.size} bytes"),
        ("SHA-256", manifest.recording.sha256 or "not read to its end"),
        ("run", manifest.run_id),
        ("status", status),
        ("started", manifest.started),
        ("method", manifest.method),
        ("tables", manifest.tables),
        ("seed", manifest.seed),
        ("seconds", ", ".join(f"{name} {s:.2f}" for name, s in manifest.timings.items())),
        ("versions", ", ".join(f"{name} {v}" for name, v in manifest.versions.items())),
    ]
    return "<h2>Where this comes from</h2>" + _table((), rows)


def _table(header: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    """Write a table; of one with many columns narrow screens show long texts in their own line."""
    cells = [tuple(map(str, row)) for row in rows]
    is_worded = len(header) > MANY and any(len(cell) > SHORT for row in cells for cell in row)
    lines = ['<table class="worded">' if is_worded else "<table>"]
    if header:
        lines.append("<tr>" + "".join(f"<th>{escape(one)}</th>" for one in header) + "</tr>")
    lines += ["<tr>" + "".join(map(_cell, row)) + "</tr>" for row in cells]
    return "\n".join([*lines, "</table>"])


def _cell(text: str) -> str:
    kinds = [text] * (text in STATUSES) + ["short"] * (len(text) <= SHORT)
    named = f' class="{" ".join(kinds)}"' if kinds else ""
    return f"<td{named}>{_told(text)}</td>"


def _told(text: str) -> str:
    """Escape a text; an option of the command line and its numbers stay on one line."""
    return OPTION.sub(r'<span class="short">\g<0></span>', escape(text))
