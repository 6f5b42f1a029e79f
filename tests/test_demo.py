"""The demo, end to end, as a user runs it."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from tablemap.archive import load_run
from tablemap.evaluation.metrics import score
from tablemap.evaluation.score import Score
from tablemap.evaluation.truth import Truth
from tablemap.model import TableModel
from tests.making.command import tablemap_here

LIBRARIES = {
    *("PIL", "google", "numpy", "open3d", "pydantic", "pydantic_settings", "rerun", "rich"),
    *("rosbags", "ruamel", "scipy", "shapely", "typer"),
}
"""All of many modules that processing imports, whoever asks for them."""

MANY_MODULES = 20

OF_SCIPY = {"_lib", "constants", "linalg", "ndimage", "sparse", "spatial", "special"}


@pytest.fixture(scope="module")
def result(finished: tuple[Path, object], demo_recording: Path) -> Score:
    """The demo's score."""
    return score(TableModel.load(finished[0]), Truth.load(Truth.beside(demo_recording)))


def test_the_demo_s_table_is_found_as_it_is(result: Score) -> None:
    """Shape, dimensions within 15 mm, height within 8 mm, four legs within 20 mm."""
    assert result.shape == "rectangle"
    assert [round(1000 * abs(d.error)) for d in result.dimensions] == pytest.approx([0, 0], abs=15)
    assert abs(result.height.error) < 0.008
    assert (result.legs.found, result.legs.missed, result.legs.invented) == (4, 0, 0)
    assert max(place.error for place in result.legs.places) < 0.020


def test_the_demo_raises_no_doubt(result: Score, finished: tuple[Path, object]) -> None:
    """A right model of a good recording is called good."""
    assert result.doubts == ()
    assert TableModel.load(finished[0]).verdict.level == "good"


def test_stdout_is_one_json_line_and_stderr_is_for_people(
    finished: tuple[Path, subprocess.CompletedProcess[str]], demo_recording: Path
) -> None:
    """Others script against the line."""
    run, done = finished
    assert done.stdout.count("\n") == 1
    line = json.loads(done.stdout)
    assert line == {
        "recording": str(demo_recording),
        "run": str(run),
        "status": "ok",
        "error": None,
        "model": str(run / "table.json"),
        "verdict": "good",
        "reasons": [],
        "figures": line["figures"],
        "others": [],
    }
    model = TableModel.load(run)
    for name, figure in model.surface.dimensions.items():
        assert line["figures"][name] == figure.value
        assert line["figures"][f"{name}_sigma"] == figure.sigma
    assert f"tablemap view {run}" in done.stderr
    for word in ("shape", "rectangle", "length", "height", "legs", "verdict"):
        assert word in done.stderr


def test_the_run_folder_keeps_the_contract(
    finished: tuple[Path, object], demo_recording: Path
) -> None:
    """Files, manifest, and ``latest``."""
    run = finished[0]
    names = {path.name for path in run.iterdir()}
    assert names == {
        "run.rrd",
        "report.html",
        "results.npz",
        "table.json",
        "manifest.json",
        "config.toml",
        "trajectory.tum",
        "exports",
    }
    exported = {path.name for path in (run / "exports").glob("*/*")}
    assert exported >= {"table.svg", "table.pgm", "table.yaml"}
    manifest = json.loads((run / "manifest.json").read_text())
    assert manifest["status"] == "ok"
    assert len(manifest["recording"]["sha256"]) == 64
    assert manifest["recording"]["size"] == demo_recording.stat().st_size
    assert set(manifest["timings"]) >= {"snapshots", "registration", "surface", "legs"}
    assert (run.parent / "latest").resolve() == run
    assert load_run(run.parent).path == run.resolve()
    assert (run / "run.rrd").stat().st_size < 10_000_000


def test_the_review_is_read_back(finished: tuple[Path, object]) -> None:
    """Images and views as many as the model has snapshots; its figures as in table.json."""
    model = TableModel.load(finished[0])
    rows: Counter[str] = Counter()
    seen: Counter[str] = Counter()
    texts: dict[str, list[str]] = {}
    timelines: set[str] = set()
    for chunk in RrdReader(finished[0] / "run.rrd").stream():
        timelines |= set(chunk.timeline_names)
        if not chunk.is_static:
            rows[chunk.entity_path] += chunk.num_rows
        # Alone on the stage timeline an image is shown again beside that stage's result.
        if "snapshot" in chunk.timeline_names:
            seen[chunk.entity_path] += chunk.num_rows
        if chunk.entity_path in ("/model/dimensions", "/summary"):
            columns = chunk.to_record_batch().to_pydict()
            texts.setdefault(chunk.entity_path, []).append(str(columns))
    assert timelines == {"sensor_time", "snapshot", "stage", "iteration"}
    used = sum(snapshot.used for snapshot in model.snapshots)
    for path in ("/camera/depth", "/segmentation/labels", "/segmentation/points"):
        assert seen[path] == len(model.snapshots)
    for part in ("scan", "top"):
        for moment in ("before", "after"):
            shown = [path for path in rows if path.startswith(f"/registration/{moment}/{part}/")]
            assert len(shown) == used
    assert len([path for path in rows if path.startswith("/model/legs/")]) == len(model.legs)
    for name, figure in model.surface.dimensions.items():
        assert f"{name} {figure.value:.3f} m" in "".join(texts["/model/dimensions"])
    assert model.verdict.level in "".join(texts["/summary"])
    drive = (finished[0] / "trajectory.tum").read_text().splitlines()
    assert rows["/odometry/threshold_mm"] == rows["/odometry/correction_mm"] == len(drive)
    assert rows["/odometry/local_map"] > 10
    motions = [path for path in rows if path.endswith("/motion")]
    assert len(motions) >= used - 1
    # Where it began, each iteration, and where it ended on the other timelines.
    most = rows["/registration/iterations/fitness"] + 2
    assert max(rows[path] for path in motions) == most
    assert all(3 < rows[path] <= most for path in motions)
    for path in motions:
        assert rows[path.replace("/motion", "/source")] == 1


def test_the_report_has_the_model_s_figures(finished: tuple[Path, object]) -> None:
    """And where they come from."""
    html = (finished[0] / "report.html").read_text(encoding="utf-8")
    model, manifest = TableModel.load(finished[0]), load_run(finished[0]).manifest
    for figure in (*model.surface.dimensions.values(), model.surface.height):
        assert f"{figure.value:.4f} m" in html
    assert manifest.recording.sha256 is not None
    assert manifest.recording.sha256 in html
    assert model.verdict.level in html


def test_the_trajectory_covers_the_drive(finished: tuple[Path, object]) -> None:
    """One line a stamp, ascending, and the base is near the table throughout."""
    rows = [
        [float(value) for value in line.split()]
        for line in (finished[0] / "trajectory.tum").read_text().splitlines()
    ]
    stamps = [row[0] for row in rows]
    assert len(rows) > 50
    assert stamps == sorted(stamps)
    pose = TableModel.load(finished[0]).surface.pose
    assert all(math.hypot(row[1] - pose.x, row[2] - pose.y) < 4.0 for row in rows)


@pytest.fixture(scope="module")
def repeated(
    finished: tuple[Path, object], demo_recording: Path, tmp_path_factory: pytest.TempPathFactory
) -> subprocess.CompletedProcess[str]:
    """The demo once more by the config that its run wrote, after a file that is no recording."""
    folder = tmp_path_factory.mktemp("repeated")
    text = folder / "notes.mcap"
    text.write_text("this is no recording\n")
    config = finished[0] / "config.toml"
    output = folder / "runs"
    return tablemap_here(
        "process", text, demo_recording, "-o", output, "--config", config, "--json", "--quiet"
    )


def test_the_written_config_repeats_the_run_byte_for_byte(
    finished: tuple[Path, object], repeated: subprocess.CompletedProcess[str]
) -> None:
    """config.toml holds every setting, and the same input gives the same bytes."""
    run = finished[0]
    assert tomllib.loads((run / "config.toml").read_text())["seed"] == 0
    model = Path(json.loads(repeated.stdout.splitlines()[-1])["model"])
    assert model.read_bytes() == (run / "table.json").read_bytes()


def test_what_is_done_is_not_done_again(
    finished: tuple[Path, object], demo_recording: Path
) -> None:
    """The same line, of the same run, in no time; and the run is what was written."""
    run = finished[0]
    again = tablemap_here("process", demo_recording, "--output", run.parent.parent, "--json")
    assert json.loads(again.stdout)["run"] == str(run)
    assert "--again" in again.stderr
    assert [path.name for path in run.parent.iterdir() if not path.is_symlink()] == [run.name]
    verified = tablemap_here("runs", "verify", run, "--json")
    assert verified.returncode == 0, verified.stdout
    checks = {check["name"]: check["outcome"] for check in json.loads(verified.stdout)["checks"]}
    assert set(checks.values()) == {"ok"}
    assert {"run.rrd", "review", "recording", "settings"} <= checks.keys()


def test_a_recording_that_was_cut_short_is_used_and_said_to_be(
    demo_recording: Path, tmp_path: Path
) -> None:
    """Exit 3, status partial, a warning; the model of what was left stands."""
    cut = tmp_path / "cut.mcap"
    data = demo_recording.read_bytes()
    cut.write_bytes(data[: int(0.8 * len(data))])
    done = tablemap_here("process", cut, "-o", tmp_path / "runs", "--json", "--review", "off")
    line = json.loads(done.stdout)
    assert (done.returncode, line["status"]) == (3, "partial"), done.stderr
    model = TableModel.load(Path(line["model"]))
    assert "recording.truncated" in {warning.code for warning in model.warnings}
    assert model.surface.shape == "rectangle"


def test_one_bad_recording_does_not_stop_the_next(
    repeated: subprocess.CompletedProcess[str],
) -> None:
    """One line each, and the exit code of the worst."""
    lines = [json.loads(line) for line in repeated.stdout.splitlines()]
    assert [line["status"] for line in lines] == ["failed", "ok"]
    assert repeated.returncode == 1
    failed = Path(lines[0]["run"])
    assert {"manifest.json", "report.html", "run.rrd"} <= {path.name for path in failed.iterdir()}
    assert not (failed / "table.json").exists()


def test_evaluate_scores_a_run(finished: tuple[Path, object], demo_recording: Path) -> None:
    """Against the truth beside its recording, or the one that is given."""
    for extra in ([], ["--truth", Truth.beside(demo_recording)]):
        done = tablemap_here("evaluate", finished[0], *extra, "--json")
        assert done.returncode == 0, done.stderr
        overall = json.loads(done.stdout)["methods"]["tablemap"]["overall"]
        assert overall["shape_accuracy"] == 1
        assert overall["legs"]["found"] == 4


def test_info_names_every_role(demo_recording: Path) -> None:
    """For people and for scripts."""
    done = tablemap_here("info", demo_recording)
    assert done.returncode == 0
    for word in (
        "depth",
        "laser",
        "calibration",
        "colour",
        "/tf",
        "base_range_sensor_link",
        "ready",
    ):
        assert word in done.stdout
    checked = tablemap_here("info", demo_recording, "--json", "--check")
    assert checked.returncode == 0
    document = json.loads(checked.stdout)
    assert document["processable"] is True
    assert {topic["role"] for topic in document["topics"]} >= {"depth", "laser", "transforms"}


def test_near_a_place_without_a_table_names_the_places_that_have_one(
    demo_recording: Path, tmp_path: Path
) -> None:
    """One sentence, no traceback."""
    done = tablemap_here("process", demo_recording, "-o", tmp_path, "--near", "40", "40", "--quiet")
    assert done.returncode == 1
    assert re.search(r"0\.\d", done.stderr)
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_processing_imports_no_library_that_it_does_not_need(demo_imports: list[str]) -> None:
    """Libraries bring others along: Open3D dash and IPython, pyarrow pandas, trimesh networkx."""
    ours = {"tablemap", *sys.stdlib_module_names}
    modules = Counter(name.split(".")[0] for name in demo_imports)
    large = {name for name, count in modules.items() if count > MANY_MODULES}
    assert large - ours <= LIBRARIES


def test_processing_imports_no_part_of_scipy_that_it_does_not_need(
    demo_imports: list[str],
) -> None:
    """``scipy.stats`` alone takes as long as all that is needed of it."""
    packages = {name.split(".")[1] for name in demo_imports if name.count(".") == 2}
    packages &= {name.split(".")[1] for name in demo_imports if name.startswith("scipy.")}
    assert packages <= OF_SCIPY
