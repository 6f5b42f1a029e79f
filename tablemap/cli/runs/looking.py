"""``tablemap runs show``, ``compare`` and ``verify``: the contents of runs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tablemap.cli.commands import Commands
from tablemap.cli.options import Json
from tablemap.cli.printing import (
    aligned,
    complain,
    metres_text,
    named_rows,
    other_entry,
    other_rows,
    say,
    wide,
)
from tablemap.cli.runs.arguments import Run
from tablemap.errors import TablemapError

if TYPE_CHECKING:
    from tablemap.archive import RunFolder
    from tablemap.archive.comparison import Comparison
    from tablemap.archive.conditions import Apart
    from tablemap.archive.spread import Spreads

commands = Commands()


@commands.command()
def show(run: Run, as_json: Json = False) -> None:
    """Show what a RUN was made of, how it ended, and its model."""
    from tablemap.archive import load_run
    from tablemap.model.summary import doubts, notes, summary_rows

    folder = load_run(run)
    manifest = folder.manifest
    has_ended = manifest.status != "running"
    model = folder.model if has_ended and (folder.path / "table.json").is_file() else None
    others = folder.others if has_ended else ()
    if as_json:
        document = {
            "path": folder.address,
            "manifest": manifest.fields(),
            "model": json.loads(model.to_json()) if model else None,
            "others": [other_entry(other, folder) for other in others],
        }
        say(json.dumps(document, indent=1))
        return
    rows = [
        ("run", folder.address),
        ("recording", manifest.recording.path),
        ("method", f"{manifest.method}, seed {manifest.seed}"),
        ("tablemap", manifest.versions.get("tablemap", "unknown")),
        *_changed_rows(folder),
        ("started", manifest.started),
        ("seconds", f"{sum(manifest.timings.values()):.1f}"),
        ("status", "dead" if folder.is_dead else manifest.status),
        *([("error", manifest.error)] if manifest.error else []),
        *(summary_rows(model) if model else []),
        *other_rows(others),
        *([("because", doubt) for doubt in doubts(model)] if model else []),
        *([("note", note) for note in notes(model)] if model else []),
    ]
    say(named_rows(rows, wide(sys.stdout)))


@commands.command()
def compare(
    runs: Annotated[list[str], typer.Argument(help="Two run folders, or more.", metavar="A B...")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Write compare.svg and .rrd of A and B here.", metavar="DIR"
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show the models of A and B side by side; of more runs the spread and the outliers."""
    from tablemap.archive import load_run
    from tablemap.archive.comparison import compare as compare_models
    from tablemap.archive.conditions import versions_apart
    from tablemap.archive.spread import spread

    if len(runs) < 2:
        raise typer.BadParameter("give two runs, or more.")
    if output and len(runs) > 2:
        raise typer.BadParameter(f"--output draws two runs, found {len(runs)}.")
    folders = [load_run(run) for run in runs]
    letters = _letters(len(folders))
    apart = {"settings": _settings_apart(folders), "versions": versions_apart(*folders)}
    if len(folders) == 2:
        found = compare_models(folders[0].model, folders[1].model)
        document, rows = found.to_dict(), _comparison_rows(found)
    else:
        spreads = spread([run.model for run in folders])
        document, rows = spreads.to_dict(), _spread_rows(spreads, letters)
    if as_json:
        conditions = {
            kind: {
                name: dict(zip(map(str.lower, letters), values, strict=True))
                for name, values in differing.items()
            }
            for kind, differing in apart.items()
        }
        named = {letter.lower(): run.address for letter, run in zip(letters, folders, strict=True)}
        say(json.dumps({**named, **document, **conditions}, indent=1))
    else:
        if len(folders) > 2:
            say(aligned(zip(letters, (run.address for run in folders), strict=True)) + "\n")
        say(aligned(rows))
        for kind, differing in apart.items():
            if differing:
                values = [(name, *map(str, each)) for name, each in differing.items()]
                say("\n" + aligned([(kind, *letters), *values]))
    if output:
        for file in _draw(folders[0], folders[1], output):
            say(file, err=True)


def _letters(number: int) -> list[str]:
    """Return names for so many runs: A to Z, then A2 and so on."""
    alphabet = [chr(ord("A") + k) for k in range(26)]
    return [f"{alphabet[k % 26]}{k // 26 + 1 if k >= 26 else ''}" for k in range(number)]


def _settings_apart(runs: list[RunFolder]) -> Apart:
    """Return the settings that differ; settings that cannot be read are a warning on stderr."""
    from tablemap.archive.conditions import settings_apart

    try:
        return settings_apart(*runs)
    except TablemapError as error:
        complain(f"the settings are not compared: {error}", kind="warning")
        return {}


def _spread_rows(found: Spreads, letters: list[str]) -> Iterator[tuple[str, ...]]:
    """Return a row for each word, with who differs from most, and for each figure's spread."""
    from collections import Counter

    from tablemap.model.shapes import is_angle

    yield ("", "median", "from", "to", "deviation", "sigma", "outliers")
    for name, values in found.words:
        usual, _ = Counter(values).most_common(1)[0]
        others = [
            f"{letter} {value}"
            for letter, value in zip(letters, values, strict=True)
            if value != usual
        ]
        yield (name, usual, "", "", "", "", ", ".join(others))
    for row in found.figures:
        angle = row.name == "yaw" or is_angle(row.name)
        ends = [_degrees(x) if angle else _metres(x) for x in (row.median, row.low, row.high)]
        widths = [
            _degrees(x) if angle else "" if x is None else f"{1000 * x:.1f} mm"
            for x in (row.deviation, row.sigma)
        ]
        outliers = ", ".join(letters[k] for k in row.outliers)
        lacking = ", ".join(
            letter for letter, value in zip(letters, row.values, strict=True) if value is None
        )
        said = [outliers, f"not in {lacking}" if lacking else ""]
        yield (row.name, *ends, *widths, "; ".join(filter(None, said)))


def _changed_rows(run: RunFolder) -> Iterator[tuple[str, str]]:
    """Return a row for each setting that is not the default."""
    from tablemap.archive.conditions import changed_settings

    try:
        for name, (default, value) in changed_settings(run).items():
            yield ("setting", f"{name} = {value} (default {default})")
    except TablemapError as error:
        yield ("settings", f"unknown: {error}")


def _comparison_rows(compared: Comparison) -> Iterator[tuple[str, ...]]:
    from tablemap.model.shapes import is_angle

    yield ("", "A", "B", "B - A", "sigma", "sigmas")
    for name, a, b in compared.words:
        yield (name, a, b, "" if a == b else "differs", "", "")
    for row in compared.figures:
        angle = row.name == "yaw" or is_angle(row.name)
        values = [_degrees(x) if angle else _metres(x) for x in (row.a, row.b)]
        apart = [
            _degrees(x) if angle else "" if x is None else f"{1000 * x:.1f} mm"
            for x in (row.difference, row.sigma)
        ]
        yield (row.name, *values, *apart, "" if row.sigmas is None else f"{row.sigmas:.1f}")
    if compared.overlap is not None and compared.farthest is not None:
        yield (
            "outlines",
            f"{100 * compared.overlap:.1f} % common",
            "",
            f"{1000 * compared.farthest:.1f} mm at most",
            "",
            "",
        )


def _metres(value: float | None) -> str:
    return "" if value is None else f"{metres_text(value)} m"


def _degrees(value: float | None) -> str:
    import math

    return "" if value is None else f"{math.degrees(value):.2f} deg"


def _draw(a: RunFolder, b: RunFolder, output: Path) -> tuple[Path, Path]:
    from tablemap.archive.drawing import write_drawing
    from tablemap.review.overlay import write_overlay

    names = (f"{a.path.parent.name}/{a.path.name}", f"{b.path.parent.name}/{b.path.name}")
    drawing, overlay = output / "compare.svg", output / "compare.rrd"
    write_drawing(drawing, a.model, b.model, names=names)
    write_overlay(overlay, a.model, b.model, names=names, name=" and ".join(names))
    return drawing, overlay


@commands.command()
def verify(
    runs: Annotated[list[str], typer.Argument(help="Run folders.", metavar="RUN...")],
    as_json: Json = False,
) -> None:
    """Check that the RUNs and their recordings are what they were."""
    from dataclasses import asdict

    from tablemap.archive import load_run
    from tablemap.runs.verification import verify as verify_run

    failed = False
    for path in runs:
        run = load_run(path)
        checks = verify_run(run)
        failed |= not all(check.passed for check in checks)
        if as_json:
            document = {"run": run.address, "checks": [asdict(check) for check in checks]}
            say(json.dumps(document))
        else:
            say(run.address)
            rows = [(f"  {each.outcome}", each.name, each.detail or "") for each in checks]
            say(aligned(rows))
    raise typer.Exit(1 if failed else 0)
