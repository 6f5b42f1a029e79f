"""Runs and models in any format: where files go, what is warned of, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from msgspec import structs
from PIL import Image

from tablemap import model as m
from tablemap.archive import RunFolder
from tablemap.config import Config, ExportConfig
from tablemap.errors import WARNING_CODES, ConfigError, TablemapError
from tablemap.export import all_formats, export_model, export_run
from tests.making.command import tablemap_here
from tests.making.exported import MODELS


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    """A finished run with the table and another one."""
    recording = tmp_path / "lap.mcap"
    recording.write_bytes(b"")
    folder = RunFolder.create(
        tmp_path / "runs", recording, method="tablemap", tables="all", config=Config()
    )
    folder.write("table.json", MODELS["rectangle"].to_json())
    folder.write("tables/01.json", MODELS["mesh"].to_json())
    folder.finish("ok")
    return folder


def _changed(model: m.TableModel, **surface: object) -> m.TableModel:
    return structs.replace(model, surface=structs.replace(model.surface, **surface))


def test_every_format_repeats_byte_for_byte(tmp_path: Path) -> None:
    """In a folder of its own each, and nothing else is left lying about."""
    first = export_model(MODELS["U"], list(all_formats()), output=tmp_path / "a").files
    second = export_model(MODELS["U"], list(all_formats()), output=tmp_path / "b").files
    assert {file.relative_to(tmp_path / "a").parts[0] for file in first} == set(all_formats())
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in second]
    assert {file for file in (tmp_path / "a").rglob("*") if file.is_file()} == set(first)


def test_an_unknown_thickness_is_configured_and_warned_of(tmp_path: Path) -> None:
    """The legs end where the assumed top begins; a known thickness is silent."""
    config = ExportConfig(thickness=0.05)
    exported = export_model(MODELS["mesh"], ["moveit"], output=tmp_path, config=config)
    (warning,) = exported.warnings
    assert warning.code == "export.assumed_thickness"
    assert "50 mm" in warning.message
    assert "0.693" in (tmp_path / "moveit" / "table.scene").read_text()
    assert export_model(MODELS["rectangle"], ["moveit"], output=tmp_path).warnings == ()


def test_what_doubts_the_figures_is_warned_of(tmp_path: Path) -> None:
    """A bound, a doubtful verdict, an outline that crosses itself, a top on no legs."""
    model = MODELS["rectangle"]
    length = structs.replace(model.surface.dimensions["length"], status="unseen")
    unseen = _changed(model, dimensions={**model.surface.dimensions, "length": length})
    doubtful = structs.replace(model, verdict=m.Verdict(level="doubtful", reasons=("why",)))
    bow = ((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.4))
    crossed = _changed(model, shape="mesh", dimensions={}, outline=bow)
    codes = []
    for each in (unseen, doubtful, crossed, structs.replace(model, legs=())):
        exported = export_model(each, ["glb", "sdf", "nav2"], output=tmp_path)
        codes += [warning.code for warning in exported.warnings]
    expected = ["bound", "verdict", "outline_repaired", "no_legs"]
    assert codes == [f"export.{name}" for name in expected]
    assert set(codes) <= set(WARNING_CODES)


@pytest.mark.parametrize(
    "surface",
    [
        {"shape": "mesh", "outline": ((0.0, 0.0), (1.0, 0.0))},
        {"shape": "mesh", "outline": ((0.0, 0.0), (1.0, 0.0), (2.0, 0.0))},
        {"shape": "mesh", "outline": ()},
        {"height": m.Figure(value=0.0, sigma=None)},
        {"thickness": m.Figure(value=0.0, sigma=None)},
    ],
)
def test_a_model_that_encloses_nothing_is_refused(
    surface: dict[str, object], tmp_path: Path
) -> None:
    """In one sentence, and nothing is written."""
    with pytest.raises(TablemapError, match="nothing is exported"):
        export_model(_changed(MODELS["rectangle"], **surface), ["glb"], output=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_leg_without_its_size_is_refused(tmp_path: Path) -> None:
    """In one sentence that says which, and nothing is written."""
    model = MODELS["rectangle"]
    first = structs.replace(model.legs[0], dimensions={})
    model = structs.replace(model, legs=(first, *model.legs[1:]))
    with pytest.raises(TablemapError, match="leg 1, found no size"):
        export_model(model, ["glb"], output=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_format_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    """With the ones that there are."""
    with pytest.raises(ConfigError, match=r"geojson.*'stl'"):
        export_model(MODELS["rectangle"], ["glb", "stl"], output=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    """What cannot be written leaves the earlier files as they were, and no half ones."""
    export_model(MODELS["rectangle"], ["svg"], output=tmp_path)
    before = (tmp_path / "svg" / "table.svg").read_bytes()
    (tmp_path / "glb").write_text("in the way")
    with pytest.raises(TablemapError, match="cannot be written"):
        export_model(MODELS["L"], ["svg", "glb"], output=tmp_path)
    assert (tmp_path / "svg" / "table.svg").read_bytes() == before
    assert sorted(file.name for file in tmp_path.rglob("*")) == ["glb", "svg", "table.svg"]


def test_a_mask_too_large_is_refused(tmp_path: Path) -> None:
    """Before memory is filled."""
    config = ExportConfig(resolution=1e-5)
    with pytest.raises(TablemapError, match="too large"):
        export_model(MODELS["rectangle"], ["nav2"], output=tmp_path, config=config)


def test_a_run_exports_all_its_tables(run: RunFolder) -> None:
    """Into its ``exports/``; the recording's folder stands for its last run."""
    expected = {
        run.path / "exports" / "svg" / "table.svg",
        run.path / "exports" / "svg" / "table_01.svg",
    }
    assert set(export_run(run.path, ["svg"]).files) == expected
    assert {file.resolve() for file in export_run(run.path.parent, ["svg"]).files} == {
        file.resolve() for file in expected
    }
    (alone,) = export_run(run.path / "tables" / "01.json", ["svg"]).files
    assert alone == run.path / "exports" / "svg" / "table_01.svg"


def test_all_tables_of_a_run_are_in_one_keep_out_mask(run: RunFolder) -> None:
    """For Nav2 takes one: it covers what the tables' own masks cover, and has all polygons."""
    alone = run.path / "tables" / "01.json"
    moved = json.loads(alone.read_text())
    moved["legs"] = []
    for corner in moved["surface"]["outline"]:
        corner[0] += 3.0
    alone.write_text(json.dumps(moved))
    files = export_run(run.path, ["nav2"]).files
    assert {file.name for file in files} == {"table.pgm", "table.yaml", "table.polygon.yaml"}
    both = _occupied(run.path / "exports" / "nav2" / "table.yaml")
    single = []
    for file in (run.path / "table.json", alone):
        _, server, _ = export_run(file, ["nav2"], output=run.path / file.stem).files
        single.append(_occupied(server))
    assert not single[0] & single[1]
    assert both == single[0] | single[1]
    outline = yaml.safe_load((run.path / "exports" / "nav2" / "table.polygon.yaml").read_text())
    assert len(outline["polygons"]) == 2


def _occupied(server: Path) -> set[tuple[int, int]]:
    """Return the occupied cells of a mask, counted from the map's origin."""
    said = yaml.safe_load(server.read_text())
    with Image.open(server.parent / said["image"]) as image:
        rows, columns = np.nonzero(np.flipud(np.array(image)) == 0)
    x, y = np.round(np.array(said["origin"][:2]) / said["resolution"]).astype(int)
    return set(zip((columns + x).tolist(), (rows + y).tolist(), strict=True))


def test_the_command_writes_and_prints_paths(run: RunFolder, tmp_path: Path) -> None:
    """Paths on stdout, warnings on stderr."""
    done = tablemap_here("export", run.path, "--to", "nav2", "--to", "sdf", "--padding", "0.2")
    assert done.returncode == 0, done.stderr
    files = [Path(line) for line in done.stdout.splitlines()]
    assert run.path / "exports" / "sdf" / "table" / "model.sdf" in files
    assert all(file.is_file() for file in files)
    assert "padding: 0.2" in (run.path / "exports/nav2/table.polygon.yaml").read_text()
    assert "export.assumed_thickness" in done.stderr
    out = tmp_path / "desk.glb"
    done = tablemap_here("export", run.path, "--to", "glb", "--output", out, "--json")
    assert json.loads(done.stdout) == {
        "files": [str(out), str(tmp_path / "desk.world.json")],
        "warnings": [],
    }
    assert out.read_bytes()[:4] == b"glTF"


def test_the_command_refuses_in_one_sentence(run: RunFolder, tmp_path: Path) -> None:
    """An unknown format is wrong usage; a run without a model, or none, cannot be exported."""
    failed = RunFolder.create(
        tmp_path / "runs", tmp_path / "lap.mcap", method="tablemap", tables="best", config=Config()
    )
    failed.finish("failed", error="no table was seen")
    cases = [
        (run.path, "stl", 2, "stl"),
        (failed.path, "glb", 1, "no table was seen"),
        (tmp_path / "nowhere", "glb", 1, "run folder"),
    ]
    for path, to, code, words in cases:
        done = tablemap_here("export", path, "--to", to)
        assert done.returncode == code
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    done = tablemap_here("process", tmp_path / "lap.mcap", "--export", "stl", cwd=tmp_path)
    assert done.returncode == 2
    assert not (failed.path / "exports").exists()


@pytest.mark.slow
def test_process_exports_what_it_modelled(demo_recording: Path, tmp_path: Path) -> None:
    """Into the run's folder."""
    done = tablemap_here(
        "process", demo_recording, "-o", tmp_path, "--export", "glb", "--export", "nav2", "-q"
    )
    assert done.returncode == 0, done.stderr
    exports = tmp_path / "demo" / "latest" / "exports"
    assert (exports / "glb" / "table.glb").is_file()
    assert (exports / "nav2" / "table.pgm").is_file()
