"""A suite of scenarios, many seeds, both methods: simulated, processed and scored in parallel."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import msgspec

from tablemap.config import Config, dump_config
from tablemap.errors import TablemapError
from tablemap.evaluation.aggregate import RunScore, summarise
from tablemap.evaluation.metrics import score
from tablemap.evaluation.truth import Truth
from tablemap.events import StageFinished
from tablemap.files import is_file, read_text, write_whole
from tablemap.inputs import Input
from tablemap.paths import AnyPath
from tablemap.remote import is_remote
from tablemap.version import __version__
from tablemap.words import known_name

METHODS = ("tablemap", "report")


@dataclass(frozen=True)
class Case:
    """One recording to be scored: a scenario with a seed, or a file (``recording``)."""

    scenario: str
    seed: int
    methods: tuple[str, ...]
    nominal: bool = False
    recording: Path | None = None


@dataclass(frozen=True)
class Evaluation:
    """All runs of a suite and where their figures were saved."""

    suite: str
    seeds: tuple[int, ...]
    runs: tuple[RunScore, ...]

    def figures(self) -> dict[str, object]:
        """Return the content of ``scores.json``, by suite if all suites were run."""
        from tablemap.simulation import SUITES
        from tablemap.simulation import suite as scenarios_of

        suites = {name: scenarios_of(name) for name in (SUITES if self.suite == "all" else ())}
        methods = {}
        for method in dict.fromkeys(run.method for run in self.runs):
            own = [run for run in self.runs if run.method == method]
            scenarios = dict.fromkeys(run.scenario for run in own)
            methods[method] = {
                "overall": summarise(own),
                "suites": {
                    name: summarise([run for run in own if run.scenario in members])
                    for name, members in suites.items()
                },
                "scenarios": {
                    name: summarise([run for run in own if run.scenario == name])
                    for name in scenarios
                },
            }
        return {"suite": self.suite, "seeds": list(self.seeds), "methods": methods}


def cases_of(
    suite: str,
    *,
    recordings: Sequence[Path],
    seeds: Sequence[int],
    methods: tuple[str, ...],
    nominal: bool,
) -> list[Case]:
    """Return the cases of a suite (or one scenario), or of recordings with a truth file each.

    Raises `TablemapError` for an unknown suite, or a recording without truth.
    """
    if recordings:
        for recording in recordings:
            Input.of(recording).check()
            if not Truth.beside(recording).is_file():
                raise TablemapError(
                    f"expected {Truth.beside(recording).name} beside the recording: {recording}"
                )
        return [Case(path.stem, 0, methods, recording=path) for path in recordings]
    from tablemap.simulation import SUITES, scenario_names
    from tablemap.simulation import suite as scenarios_of

    suite = known_name(suite, [*scenario_names(), *SUITES, "all"])
    names = [suite] if suite in scenario_names() else list(scenarios_of(suite))
    return [Case(name, seed, methods, nominal=nominal) for name in names for seed in seeds]


def evaluate(
    cases: Sequence[Case],
    *,
    config: Config,
    output: Path,
    jobs: int,
    progress: Callable[[RunScore], None],
) -> list[RunScore]:
    """Score all cases with ``jobs`` processes; skip those whose scores are already in ``output``.

    A score is kept if it comes from the same code and config. Runs are returned in the order of the
    cases.
    """
    store = output / "cases"
    store.mkdir(parents=True, exist_ok=True)
    key = _key(config)
    done: dict[tuple[int, str], RunScore] = {}
    waiting: list[tuple[int, Case]] = []
    for number, case in enumerate(cases):
        missing = []
        for method in case.methods:
            held = _load(_file(store, case, method), key)
            if held:
                done[number, method] = held
                progress(held)
            else:
                missing.append(method)
        if missing:
            waiting.append(
                (
                    number,
                    Case(case.scenario, case.seed, tuple(missing), case.nominal, case.recording),
                )
            )
    for number, run in _run_all(waiting, config, jobs):
        _save(_file(store, cases[number], run.method), key, run)
        done[number, run.method] = run
        progress(run)
    return [done[number, m] for number, case in enumerate(cases) for m in case.methods]


def _run_all(
    waiting: Sequence[tuple[int, Case]], config: Config, jobs: int
) -> Iterator[tuple[int, RunScore]]:
    if jobs <= 1:
        for number, case in waiting:
            for run in run_case(case, config):
                yield number, run
        return
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        futures: dict[Future[list[RunScore]], int] = {
            pool.submit(run_case, case, config): number for number, case in waiting
        }
        pending = set(futures)
        try:
            while pending:
                finished, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in finished:
                    for run in future.result():
                        yield futures[future], run
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def run_case(case: Case, config: Config) -> list[RunScore]:
    """Simulate a case's recording if it has none, and score each method's model of it."""
    if case.recording:
        truth = Truth.load(Truth.beside(case.recording))
        return [_run(case, method, case.recording, truth, config) for method in case.methods]
    from tablemap.simulation import load_scenario, simulate, write

    with tempfile.TemporaryDirectory(prefix="tablemap-") as folder:
        recording = Path(folder) / f"{case.scenario}.mcap"
        world = simulate(load_scenario(case.scenario), seed=case.seed, nominal=case.nominal)
        write(world, recording)
        truth = Truth.load(Truth.beside(recording))
        return [_run(case, method, recording, truth, config) for method in case.methods]


def _run(case: Case, method: str, recording: Path, truth: Truth, config: Config) -> RunScore:
    from tablemap.recording import open_recording

    if method == "report":
        from tablemap.baseline.method import process
    else:
        from tablemap.pipeline import process
    seconds: dict[str, float] = {}

    def record(event: object) -> None:
        if isinstance(event, StageFinished):
            seconds[event.name] = round(event.seconds, 4)

    started = time.perf_counter()
    try:
        opened = open_recording(recording, topics=config.topics, limits=config.limits)
        processed = process(opened, config=config, record=record)
        result = score(processed.model, truth)
        return RunScore(case.scenario, case.seed, method, result, None, seconds)
    except TablemapError as error:
        return RunScore(case.scenario, case.seed, method, None, str(error), seconds)
    except Exception as error:  # a defect in one case counts, and must not end the suite
        seconds["until defect"] = time.perf_counter() - started
        return RunScore(
            case.scenario, case.seed, method, None, f"{type(error).__name__}: {error}", seconds
        )


def _key(config: Config) -> str:
    """Return the key of a kept score: a digest of the package's source and the config."""
    digest = hashlib.sha256(f"{__version__}\n{dump_config(config)}".encode())
    package = Path(__file__).resolve().parent.parent
    for file in sorted([*package.rglob("*.py"), *package.rglob("*.toml")]):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _file(store: Path, case: Case, method: str) -> Path:
    kind = "-nominal" if case.nominal else ""
    return store / f"{case.scenario}-{case.seed}{kind}-{method}.json"


def _save(file: Path, key: str, run: RunScore) -> None:
    document = {"key": key, "run": msgspec.to_builtins(run, enc_hook=float)}
    write_whole(file, json.dumps(document, indent=1))


def _load(file: Path, key: str) -> RunScore | None:
    try:
        document = json.loads(read_text(file))
        return msgspec.convert(document["run"], RunScore) if document["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError, msgspec.ValidationError):
        return None


def score_run(run: AnyPath, truth: AnyPath | None = None) -> RunScore:
    """Score a finished run folder against a truth file, by default the one beside its recording.

    Raises `TablemapError` if the run left no model or there is no truth.
    """
    from tablemap.archive import load_run

    folder = load_run(run)
    manifest = folder.manifest
    if truth is None and is_remote(manifest.recording.path):
        raise TablemapError(
            "expected --truth FILE, since the run's recording is on a server: "
            f"{manifest.recording.path}"
        )
    file = truth or Truth.beside(Path(manifest.recording.path))
    if truth is None and not is_file(Truth.beside(Path(manifest.recording.path))):
        raise TablemapError(
            f"expected a truth beside the run's recording, found none; give --truth FILE: {file}"
        )
    result = score(folder.model, Truth.load(file))
    name = Path(manifest.recording.path).stem
    return RunScore(name, manifest.seed, manifest.method, result, None, manifest.timings)


def save(evaluation: Evaluation, output: Path) -> None:
    """Write ``scores.json``, ``scores.md``, ``figures.csv`` and ``errors.svg``."""
    from tablemap.evaluation.listing import figures_csv
    from tablemap.evaluation.tables import error_svg, scores_markdown

    figures = evaluation.figures()
    texts = {
        "scores.json": json.dumps(figures, indent=1) + "\n",
        "scores.md": scores_markdown(figures, evaluation.runs),
        "figures.csv": figures_csv(evaluation.runs),
        "errors.svg": error_svg(evaluation.runs),
    }
    for name, text in texts.items():
        write_whole(output / name, text)
