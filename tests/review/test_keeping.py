"""A run's review is drawn again from what the run keeps: the same one, without the recording."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from tablemap.archive import load_run
from tablemap.archive.verification import check_files
from tablemap.config import ReviewConfig
from tablemap.errors import EstimationError, TablemapError
from tablemap.events import RunFailed
from tablemap.review import Reviewer
from tablemap.review.keeping.codec import DEPTH_STEP, EVENTS, DepthImage, Encoder, decoded
from tablemap.review.keeping.results import Keeper, replayed
from tablemap.runs.redrawing import left_out, redraw
from tablemap.runs.running import RESULTS, REVIEW
from tablemap.stages.segmentation import Label, TableRefused
from tests.making import made_up_run as made_up
from tests.making.reviews import columns, run_until

CONFIG = ReviewConfig()


def drawn(path: Path, events: list[object]) -> Path:
    """The review of results and events."""
    with Reviewer(path, run_id="kept", recording_name="made up", config=CONFIG) as review:
        for one in events:
            review(one)
    return path


def kept(path: Path, events: list[object]) -> Path:
    """What is kept of them."""
    with Keeper(path, CONFIG) as keep:
        for one in events:
            keep(one)
    return path


def rows(path: Path) -> dict[str, int]:
    """Rows by entity."""
    counts: dict[str, int] = {}
    for chunk in RrdReader(path).stream():
        counts[chunk.entity_path] = counts.get(chunk.entity_path, 0) + chunk.num_rows
    return counts


@pytest.fixture(scope="module")
def events() -> list[object]:
    """All results of a made-up run."""
    return made_up.results(stops=4)


def test_the_review_is_the_same(events: list[object], tmp_path: Path) -> None:
    """Entities, rows, texts and figures; and the results are smaller than what is drawn of them."""
    first = drawn(tmp_path / "first.rrd", events)
    file = kept(tmp_path / RESULTS, events)
    second = drawn(tmp_path / "second.rrd", list(replayed(file)))
    assert rows(second) == rows(first)
    assert file.stat().st_size <= first.stat().st_size
    pages = [entity for entity in rows(first) if "summary" in entity or entity.startswith("/log/")]
    assert len(pages) > 8
    for entity in pages:
        for name in ("TextDocument:text", "TextLog:text"):
            assert sorted(map(str, columns(second, entity, name))) == sorted(
                map(str, columns(first, entity, name))
            )
    for entity, name in (
        ("/segmentation/points", "Points3D:positions"),
        ("/laser/scan", "Points3D:positions"),
        ("/odometry/scan", "Points3D:positions"),
        ("/outline/edges/table/03", "Points3D:positions"),
        ("/surface/residuals", "Points3D:positions"),
        ("/tf/base", "Transform3D:translation"),
    ):
        ours, theirs = (columns(path, entity, name) for path in (second, first))
        assert len(ours) == len(theirs) > 0
        for one, other in zip(ours, theirs, strict=True):
            assert np.allclose(np.ravel(one), np.ravel(other), atol=0.002)
    for entity, name in (
        ("/camera/depth", "EncodedDepthImage:blob"),
        ("/camera/colour", "EncodedImage:blob"),
        ("/segmentation/labels", "SegmentationImage:buffer"),
    ):
        assert columns(second, entity, name) == columns(first, entity, name)


@pytest.mark.parametrize("end", ["no snapshot was labelled", "a surface was refused"])
def test_a_failed_run_is_drawn_again(end: str, events: list[object], tmp_path: Path) -> None:
    """With points and labels, for which the depth images are needed."""
    until = next(k for k, one in enumerate(events) if type(one).__name__ == "Segmentation")
    failed = events[:until]
    if end == "a surface was refused":
        seen = events[until]
        failed.append(TableRefused(seen.candidates[0], seen.views))  # type: ignore[attr-defined]
    failed.append(RunFailed("segmentation", end))
    first = drawn(tmp_path / "first.rrd", failed)
    second = drawn(tmp_path / "second.rrd", list(replayed(kept(tmp_path / RESULTS, failed))))
    assert rows(second) == rows(first)
    assert len(columns(second, "/segmentation/points", "Points3D:positions")) == 4


def fail() -> None:
    """What a stage raises."""
    raise EstimationError("no two views overlap")


def test_a_run_without_its_review_gets_it_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files are as the manifest has them again."""
    run = run_until("registration", fail, tmp_path, monkeypatch.setattr)
    assert RESULTS in run.manifest.files
    before = rows(run.path / REVIEW)
    (run.path / REVIEW).unlink()
    assert not all(check.passed for check in check_files(load_run(run.path)))
    assert redraw(run) == run.path / REVIEW
    assert rows(run.path / REVIEW) == before
    assert all(check.passed for check in check_files(load_run(run.path)))
    (run.path / RESULTS).unlink()
    with pytest.raises(TablemapError, match="keeps no results"):
        redraw(run)


def test_at_level_full_it_says_what_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The scans and depth images between the stops; at the other levels nothing is."""
    from tablemap.cli import main

    standard = run_until("registration", fail, tmp_path / "standard", monkeypatch.setattr)
    assert left_out(standard) is None
    full = run_until(
        "registration",
        fail,
        tmp_path / "full",
        monkeypatch.setattr,
        review=ReviewConfig(level="full"),
    )
    before = rows(full.path / REVIEW)
    monkeypatch.setattr("sys.argv", ["tablemap", "runs", "redraw", str(full.path)])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code in (0, None)
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert "without the scans and depth images between the stops" in said
    after = rows(full.path / REVIEW)
    lacking = {one for one in before if after.get(one, 0) < before[one]}
    assert lacking <= {"/camera", "/camera/depth", "/laser/scan", "/tf/camera", "/tf/laser"}
    assert lacking >= {"/camera/depth", "/laser/scan"}


def test_an_end_on_the_way_keeps_what_there_was(events: list[object], tmp_path: Path) -> None:
    """The file is whole though an error ends the run; at level off there is none."""
    with pytest.raises(EstimationError), Keeper(tmp_path / RESULTS, CONFIG) as keep:
        for one in events[:6]:
            keep(one)
        raise EstimationError("nothing")
    assert len(list(replayed(tmp_path / RESULTS))) == 6
    with Keeper(tmp_path / "off.npz", ReviewConfig(level="off")) as keep:
        keep(events[0])
    assert not (tmp_path / "off.npz").exists()


def test_values_come_back(tmp_path: Path) -> None:
    """Each kind of value, and a depth image to half a step; NumPy reads the arrays too."""
    pixels = np.array([[np.nan, 0.5, 30.0], [1.0002, 1.0004, np.inf]], dtype=np.float32)
    image = DepthImage(pixels)
    values = [None, True, 3, "ä", float("inf"), (1, [2.5]), {1: "a"}, b"xyz", Label.TOP]
    large = np.linspace(0.0, 1.0, 1000)
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as file:
        encoder = Encoder(file)
        told = [encoder.value(one) for one in (values, large, np.arange(3), large, image)]
        encoder.depth(image)
        file.writestr(EVENTS, json.dumps(told))
        with pytest.raises(TypeError, match="Path"):
            encoder.value(tmp_path)
    back, far, few, _, depth = decoded(tmp_path / "x.npz")
    assert back == values
    assert far.dtype == np.float64
    assert np.allclose(far, large, atol=1e-7)
    assert few.dtype == np.arange(3).dtype
    assert np.isnan(depth[0, 0])
    assert np.allclose(depth[:, 1], pixels[:, 1], atol=DEPTH_STEP)
    assert np.allclose(depth[0, 2], 30.0, atol=DEPTH_STEP)
    with np.load(tmp_path / "x.npz") as arrays:
        assert sorted(arrays.files) == ["a0", "a1", "a2", "depth0", EVENTS]


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    """A damaged file, and results of another version."""
    (tmp_path / "cut.npz").write_bytes(b"PK\x03\x04 cut")
    with pytest.raises(TablemapError, match="cannot be read"):
        list(replayed(tmp_path / "cut.npz"))
    for event, words in (
        ({"$kind": "StageStarted", "fields": {"name": "legs"}}, "without index"),
        ({"$kind": "Nonsense", "fields": {}}, "Nonsense"),
    ):
        with zipfile.ZipFile(tmp_path / "other.npz", "w") as file:
            file.writestr(EVENTS, json.dumps([event]))
        with pytest.raises(TablemapError, match=words):
            list(replayed(tmp_path / "other.npz"))
