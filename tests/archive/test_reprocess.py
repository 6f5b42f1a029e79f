"""A run processed again by the real pipeline."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tablemap.archive import load_run
from tests.making.command import tablemap_here

pytestmark = pytest.mark.slow


def test_a_run_is_repeated_byte_for_byte(
    finished: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    """By its own recording and settings, into a folder beside it, which becomes the latest."""
    run = finished[0]
    done = tablemap_here("runs", "reprocess", run, "--json", "--quiet")
    assert done.returncode == 0, done.stderr
    line = json.loads(done.stdout)
    again = Path(line["run"])
    assert again != run
    assert again.parent == run.parent
    assert (again / "table.json").read_bytes() == (run / "table.json").read_bytes()
    assert (again / "config.toml").read_bytes() == (run / "config.toml").read_bytes()
    compared = json.loads(tablemap_here("runs", "compare", run, again, "--json").stdout)
    assert compared["overlap"] == pytest.approx(1.0)
    assert tablemap_here("runs", "verify", again).returncode == 0
    assert (run.parent / "latest").resolve() == again.resolve()


def test_a_packed_run_is_repeated_with_changes(
    finished: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    """From the recording that was packed with it; the changes are in the new run's settings."""
    packed = tmp_path / "demo.tar.zst"
    assert tablemap_here("runs", "pack", finished[0], "-o", packed, "--input").returncode == 0
    (elsewhere,) = tablemap_here("runs", "unpack", packed, "-o", tmp_path / "runs").stdout.split()
    changes = ["--set", "review.level=off", "--set", "seed=7"]
    done = tablemap_here("runs", "reprocess", elsewhere, *changes, "--json", "-o", tmp_path / "new")
    line = json.loads(done.stdout)
    assert line["status"] == "ok"
    new = load_run(Path(line["run"]))
    assert new.path.is_relative_to(tmp_path / "new")
    assert (new.config.seed, new.config.review.level) == (7, "off")
    old = load_run(finished[0]).model
    for name, size in new.model.surface.dimensions.items():
        assert size.value == pytest.approx(old.surface.dimensions[name].value, abs=0.003)
