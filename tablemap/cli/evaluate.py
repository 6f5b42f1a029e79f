"""``tablemap evaluate``: models against the truth."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.options import ConfigFile, Json, Settings
from tablemap.cli.printing import aligned, say, stderr_console
from tablemap.remote import is_remote
from tablemap.words import shown

if TYPE_CHECKING:
    from tablemap.evaluation.aggregate import RunScore

commands = Commands()


@commands.command()
def evaluate(
    paths: Annotated[
        list[str] | None,
        typer.Argument(
            help="Run folders, or recordings with NAME.truth.json beside them; none: a suite.",
            metavar="PATH...",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option("--truth", help="The truth of a run's recording.", metavar="FILE"),
    ] = None,
    suite: Annotated[
        str,
        typer.Option(
            "--suite",
            help="report, hard, real_sensors, all, or one scenario's name.",
            metavar="NAME",
            autocompletion=completing.suites,
        ),
    ] = "report",
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, help="Seeds a scenario.", metavar="N")
    ] = 3,
    first_seed: Annotated[
        int, typer.Option("--first-seed", min=0, help="The first seed.", metavar="N")
    ] = 0,
    nominal: Annotated[
        bool, typer.Option("--nominal", help="Keep the scenarios' sizes; draw the rest.")
    ] = False,
    method: Annotated[
        Literal["both", "tablemap", "report"],
        typer.Option("--method", help="Which to score.", case_sensitive=False),
    ] = "both",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Folder of the scores; else scores, of run folders none.",
            metavar="DIR",
        ),
    ] = None,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", min=1, help="Processes at once.", metavar="N")
    ] = 2,
    tables: Annotated[
        bool,
        typer.Option(
            "--tables", help="Print the report's tables: as published, by its method, by ours."
        ),
    ] = False,
    config: ConfigFile = None,
    settings: Settings = None,
    as_json: Json = False,
) -> None:
    """Score models against the truth: run folders, recordings, or a suite of scenarios."""
    from tablemap.config import load_config
    from tablemap.evaluation import suite as suites
    from tablemap.evaluation.tables import (
        markdown,
        report_tables,
        run_rows,
        score_rows,
    )

    resolved = load_config(config, overrides=settings or ())
    methods = suites.METHODS if method == "both" else (method,)
    runs = [path for path in paths or [] if is_remote(path) or Path(path).is_dir()]
    if runs:
        if len(runs) != len(paths or []):
            raise typer.BadParameter("give run folders or recordings, not both.")
        if truth and len(runs) > 1:
            raise typer.BadParameter("--truth is of one run's recording; give that run alone.")
        if tables:
            raise typer.BadParameter("--tables are of a suite, not of run folders.")
        scored = [suites.score_run(run, truth) for run in runs]
        evaluation = suites.Evaluation("runs", (), tuple(scored))
    else:
        if truth:
            raise typer.BadParameter("--truth goes with a run folder.")
        cases = suites.cases_of(
            suite if not tables else "report",
            recordings=[Path(path) for path in paths or []],
            seeds=range(first_seed, first_seed + seeds),
            methods=methods,
            nominal=nominal or tables,
        )
        output = output or Path("scores")
        with _cases(len(cases) * len(methods)) as progress:
            scored = suites.evaluate(
                cases, config=resolved, output=output, jobs=jobs, progress=progress
            )
        name = "recordings" if paths else suite
        used = () if paths else tuple(range(first_seed, first_seed + seeds))
        evaluation = suites.Evaluation(name, used, tuple(scored))
    if output:
        suites.save(evaluation, output)
        say(f"scores in {output}", err=True)
    if as_json:
        say(json.dumps(evaluation.figures(), indent=1))
    elif tables:
        for title, rows in report_tables(evaluation.runs).items():
            say(f"{title}\n\n{markdown(rows)}")
    elif len(scored) == 1 and scored[0].score:
        say("\n\n".join(map(aligned, run_rows(scored[0], scored[0].score))))
    else:
        say(markdown(score_rows(evaluation.figures())))


@contextmanager
def _cases(total: int) -> Iterator[Callable[[RunScore], None]]:
    """Show on stderr how many runs are scored, and each one that failed."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn

    console = stderr_console()
    with Progress(
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task("", total=total)

        def progress(run: RunScore) -> None:
            bar.advance(task)
            if run.error:
                said = shown(f"{run.scenario} {run.seed} {run.method} failed: {run.error}")
                console.print(said, soft_wrap=True)

        yield progress
