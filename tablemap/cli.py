"""The command line: parse, call the library, print.

Results go to stdout, words for people to stderr. Heavy imports wait inside the commands.
"""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tablemap import __version__
from tablemap.errors import ConfigError, TablemapError

if TYPE_CHECKING:
    from rich.console import Console

    from tablemap.config import Config
    from tablemap.evaluation.aggregate import RunScore
    from tablemap.model import TableModel
    from tablemap.pipeline import Tables
    from tablemap.recording import RecordingInfo
    from tablemap.running import Outcome

app = typer.Typer(
    name="tablemap",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line; turn what went wrong into one sentence and an exit code."""
    terminated = False

    def terminate(_signal: int, _frame: FrameType | None) -> None:
        nonlocal terminated
        terminated = True
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, terminate)
    try:
        app()
    except SystemExit as end:
        sys.exit(143 if terminated and end.code == 130 else end.code)
    except Exception as error:
        if "--debug" in sys.argv:
            raise
        sentence = str(error) if isinstance(error, TablemapError) else _defect(error)
        typer.echo(f"tablemap: {sentence}", err=True)
        sys.exit(2 if isinstance(error, ConfigError) else 1)


def _defect(error: Exception) -> str:
    return (
        f"this is a defect of tablemap: {type(error).__name__}: {error}; "
        "run again with --debug and report what it prints."
    )


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"tablemap {__version__}")
        raise typer.Exit


Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]


@app.callback()
def tablemap(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Turn a robot's recording of a table into a model of the table."""


@app.command()
def process(
    recordings: Annotated[list[Path], typer.Argument(help="MCAP recordings.", metavar="RECORDING")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder of run folders.", metavar="DIR")
    ] = Path("runs"),
    config: Annotated[
        Path | None, typer.Option("--config", help="Settings in TOML.", metavar="FILE")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="One setting; repeatable.", metavar="SECTION.KEY=VALUE"),
    ] = None,
    near: Annotated[
        tuple[float, float] | None,
        typer.Option("--near", help="The table nearest to this place in the map.", metavar="X Y"),
    ] = None,
    every_table: Annotated[
        bool, typer.Option("--all", help="Model every table; the others go to tables/NN.json.")
    ] = False,
    method: Annotated[
        Literal["tablemap", "report"],
        typer.Option("--method", help="Our method, or the bachelor report's as the baseline."),
    ] = "tablemap",
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON line a recording on stdout.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors alone.")] = False,
    debug: Debug = False,
) -> None:
    """Model the table in each RECORDING; every step goes into DIR/<recording>/<run>/run.rrd."""
    from rich.console import Console

    from tablemap.config import load_config

    if every_table and near is not None:
        raise typer.BadParameter("--near and --all exclude each other.")
    tables: Tables = near or ("all" if every_table else "best")
    resolved = load_config(config, overrides=settings or ())
    outcomes = []
    for path in recordings:
        outcome = _process_one(
            path, output=output, config=resolved, tables=tables, method=method, quiet=quiet
        )
        outcomes.append(outcome)
        if as_json:
            typer.echo(json.dumps(_outcome_line(outcome)))
        elif outcome.error and outcome.status == "failed":
            typer.echo(f"tablemap: {outcome.error}", err=True)
        if outcome.model and outcome.run and not quiet:
            console = _stderr() if as_json else Console(highlight=False)
            _print_model(outcome.model, outcome.run.path, console=console)
    statuses = {outcome.status for outcome in outcomes}
    raise typer.Exit(1 if "failed" in statuses else 3 if "partial" in statuses else 0)


def _process_one(
    path: Path,
    *,
    output: Path,
    config: Config,
    tables: Tables,
    method: Literal["tablemap", "report"],
    quiet: bool,
) -> Outcome:
    from tablemap.record import StageStarted
    from tablemap.running import run

    process_to = partial(run, output=output, config=config, tables=tables, method=method)
    if quiet:
        return process_to(path)
    with _progress(path.name) as advance:

        def progress(event: object) -> None:
            if isinstance(event, StageStarted):
                advance(event.name, event.index)

        return process_to(path, progress=progress)


@contextmanager
def _progress(name: str) -> Iterator[Callable[[str, int], None]]:
    """Show a bar on stderr that names the stage; the given function moves it on."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from tablemap.pipeline import STAGES

    columns = (
        TextColumn("{task.fields[recording]}"),
        BarColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, TimeElapsedColumn(), console=_stderr(), transient=True) as bar:
        task = bar.add_task("opening", total=len(STAGES), recording=name)
        yield lambda stage, index: bar.update(task, description=stage, completed=index)


def _stderr() -> Console:
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def _outcome_line(outcome: Outcome) -> dict[str, str | None]:
    run = outcome.run
    return {
        "recording": str(outcome.recording),
        "run": str(run.path) if run else None,
        "status": outcome.status,
        "error": outcome.error,
        "model": str(run.path / "table.json") if run and outcome.model else None,
    }


def _print_model(model: TableModel, run: Path, *, console: Console) -> None:
    from rich.table import Table

    from tablemap.summary import summary_rows

    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, text in summary_rows(model):
        table.add_row(name, text)
    console.print(table)
    console.print(f"\nrun      {run}", soft_wrap=True)
    console.print(f"open it  tablemap view {run}", soft_wrap=True)


@app.command()
def info(
    recording: Annotated[Path, typer.Argument(help="MCAP recording.", metavar="RECORDING")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="A topics setting; repeatable.", metavar="TOPICS.KEY=NAME"),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Show a RECORDING's topics, roles and frames, and what is missing for processing."""
    from tablemap.config import load_config
    from tablemap.recording import inspect

    found = inspect(recording, topics=load_config(overrides=settings or ()).topics)
    if as_json:
        typer.echo(json.dumps(found.to_dict(), indent=1))
    else:
        typer.echo("\n".join(_info_lines(found)))


def _info_lines(found: RecordingInfo) -> Iterator[str]:
    from datetime import UTC, datetime

    start = datetime.fromtimestamp(found.start_ns / 1e9, UTC)
    megabytes = found.size_bytes / 1e6
    yield f"{found.path}: {megabytes:.1f} MB, {found.messages} messages, {found.profile}"
    yield f"{start:%Y-%m-%d %H:%M:%S} UTC, {found.duration_s:.1f} s"
    yield "\ntopics"
    for topic in sorted(found.topics, key=lambda topic: (topic.role is None, topic.name)):
        rate = "" if topic.rate_hz is None else f" at {topic.rate_hz:.1f} Hz"
        detail = f"; {topic.detail}" if topic.detail else ""
        yield f"  {topic.role or '-':<12} {topic.name}"
        yield f"  {'':<12} {topic.count}{rate}, {topic.schema}{detail}"
        if topic.problem:
            yield f"  {'':<12} {topic.problem}"
    yield "\nframes" + (" (sampled)" if found.frames_sampled else "")
    yield from (f"  {line}" for line in found.tree_lines())
    if roles := found.frame_roles:
        yield f"  fixed: {roles.fixed}, odometry: {roles.odom or 'none'}, base: {roles.base}"
        yield f"  camera: {roles.camera}, laser: {roles.laser or 'none'}"
    yield ""
    yield from (f"warning: {warning.code}: {warning.message}" for warning in found.warnings)
    yield from (f"missing: {missing}" for missing in found.missing)
    if not found.missing:
        yield f"ready: tablemap process {found.path}"


@app.command()
def simulate(
    scenario: Annotated[
        str, typer.Argument(help="Name of a scenario, or a TOML file.", metavar="SCENARIO")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The MCAP to write.", metavar="FILE")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Draws sizes, places, noise.")] = 0,
    nominal: Annotated[
        bool, typer.Option("--nominal", help="Keep the scenario's sizes; draw the rest.")
    ] = False,
    profile: Annotated[
        Literal["ros1", "ros2"], typer.Option("--profile", help="Messages of ROS 1 or ROS 2.")
    ] = "ros1",
    listing: Annotated[bool, typer.Option("--list", help="List the scenarios instead.")] = False,
    debug: Debug = False,
) -> None:
    """Write a recording of a simulated table, and NAME.truth.json beside it."""
    from tablemap.simulation import load_scenario, scenario_names, write
    from tablemap.simulation import simulate as simulate_scenario

    if listing:
        for name in scenario_names():
            typer.echo(name)
        return
    if not scenario or output is None:
        raise typer.BadParameter("give a SCENARIO and --output FILE, or --list.")
    world = simulate_scenario(load_scenario(scenario), seed=seed, nominal=nominal)
    write(world, output, profile=profile)
    typer.echo(output)


@app.command()
def evaluate(
    paths: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Run folders, or recordings with NAME.truth.json beside them; none: a suite.",
            metavar="PATH",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option("--truth", help="The truth of a run's recording.", metavar="FILE"),
    ] = None,
    suite: Annotated[
        str, typer.Option("--suite", help="report, hard, all, or one scenario's name.")
    ] = "report",
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Seeds a scenario.")] = 3,
    first_seed: Annotated[int, typer.Option("--first-seed", min=0, help="The first seed.")] = 0,
    nominal: Annotated[
        bool, typer.Option("--nominal", help="Keep the scenarios' sizes; draw the rest.")
    ] = False,
    method: Annotated[
        Literal["both", "tablemap", "report"], typer.Option("--method", help="Which to score.")
    ] = "both",
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Folder of the scores.", metavar="DIR")
    ] = Path("scores"),
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Processes at once.")] = 2,
    tables: Annotated[
        bool, typer.Option("--tables", help="Print the report's tables: published, its, ours.")
    ] = False,
    config: Annotated[
        Path | None, typer.Option("--config", help="Settings in TOML.", metavar="FILE")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="One setting; repeatable.", metavar="SECTION.KEY=VALUE"),
    ] = None,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Score models against the truth: run folders, recordings, or a suite of scenarios."""
    from tablemap.config import load_config
    from tablemap.evaluation import suite as suites
    from tablemap.evaluation.tables import markdown, report_tables, score_rows

    resolved = load_config(config, overrides=settings or ())
    methods = suites.METHODS if method == "both" else (method,)
    runs = [path for path in paths or [] if path.is_dir()]
    if runs:
        if len(runs) != len(paths or []):
            raise typer.BadParameter("give run folders or recordings, not both.")
        scored = [suites.score_run(run, truth) for run in runs]
        evaluation = suites.Evaluation("runs", (), tuple(scored))
    else:
        if truth:
            raise typer.BadParameter("--truth goes with a run folder.")
        cases = suites.cases_of(
            suite if not tables else "report",
            recordings=paths or [],
            seeds=range(first_seed, first_seed + seeds),
            methods=methods,
            nominal=nominal or tables,
        )
        with _cases(len(cases) * len(methods)) as progress:
            scored = suites.evaluate(
                cases, config=resolved, output=output, jobs=jobs, progress=progress
            )
        name = "recordings" if paths else suite
        used = () if paths else tuple(range(first_seed, first_seed + seeds))
        evaluation = suites.Evaluation(name, used, tuple(scored))
        suites.save(evaluation, output)
        typer.echo(f"scores in {output}", err=True)
    if as_json:
        typer.echo(json.dumps(evaluation.figures(), indent=1))
    elif tables:
        for title, rows in report_tables(evaluation.runs).items():
            typer.echo(f"{title}\n\n{markdown(rows)}")
    else:
        typer.echo(markdown(score_rows(evaluation.figures())))


@contextmanager
def _cases(total: int) -> Iterator[Callable[[RunScore], None]]:
    """Show on stderr how many runs are scored, and each one that failed."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn

    console = _stderr()
    with Progress(
        BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=console, transient=True
    ) as bar:
        task = bar.add_task("", total=total)

        def progress(run: RunScore) -> None:
            bar.advance(task)
            if run.error:
                bar.print(f"{run.scenario} {run.seed} {run.method} failed: {run.error}")

        yield progress


@app.command()
def view(
    run: Annotated[Path, typer.Argument(help="Run folder, or an .rrd file.", metavar="RUN")],
    debug: Debug = False,
) -> None:
    """Open a RUN in the Rerun Viewer."""
    from tablemap.review.viewer import open_viewer

    open_viewer(run)
