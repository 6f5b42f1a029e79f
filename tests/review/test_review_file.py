"""The .rrd of a made-up drive: what is in it, where on the timelines, and how large it is."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from msgspec import structs
from rerun.chunk import RrdReader

from tablemap.config import ReviewConfig
from tablemap.errors import ProcessWarning, TablemapError, WarnedPlace
from tablemap.events import OfTable, OtherTable, RunFailed, StageFinished, StageStarted
from tablemap.model import TableModel, WarningEntry
from tablemap.pipeline import STAGES
from tablemap.recording.messages import CompressedImage, Image
from tablemap.review import Reviewer
from tablemap.review.images import colour_archetype, depth_archetype, encode_depth
from tablemap.review.schema import ENTITIES, SCHEMA, TIMELINES
from tablemap.stages.calibration import Calibration
from tablemap.stages.legs import Legs
from tablemap.stages.outline import EdgeKind, Outline
from tablemap.stages.registration import Registration
from tablemap.stages.segmentation import Segmentation, TableRefused
from tablemap.stages.surface import Surface
from tests.making import made_up_run as made_up
from tests.making import reviews
from tests.making.marked_run import doubted, mended
from tests.making.reviews import columns, eye_of, eye_of_first_view, write

STOPS = 8


@pytest.fixture(autouse=True)
def strict() -> None:
    """Bad data raises instead of being left out."""
    rr.set_strict_mode(True)


@pytest.fixture(scope="module")
def run() -> list[object]:
    """All results of a made-up run."""
    return made_up.results(stops=STOPS)


@pytest.fixture(scope="module")
def review(run: list[object], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Their review, at the standard level."""
    return write(tmp_path_factory.mktemp("review") / "run.rrd", run)


THREADS = Path("/proc/self/task")


@pytest.mark.skipif(not THREADS.is_dir(), reason="counts threads as Linux shows them")
def test_many_runs_in_one_process_leave_no_threads(tmp_path: Path) -> None:
    """Ten reviews need no more threads than one, whatever layouts they send."""
    few = made_up.results(stops=3)
    write(tmp_path / "0" / "run.rrd", few)
    after_one = len(list(THREADS.iterdir()))
    for k in range(1, 10):
        write(tmp_path / str(k) / "run.rrd", few)
    assert len(list(THREADS.iterdir())) <= after_one


def test_tables_beside_the_chosen_one_share_a_layout(run: list[object], tmp_path: Path) -> None:
    """Every layout stays in the file: however many tables come, one more is sent, at the end."""

    def layouts(results: list[object], name: str) -> int:
        return len(RrdReader(write(tmp_path / name / "run.rrd", results)).blueprints())

    alone = layouts([one for one in run if not isinstance(one, (OfTable, OtherTable))], "alone")
    more = [OtherTable(number, "a front closes the space under it") for number in range(3, 9)]
    assert layouts([*run, *more], "beside") == alone + 1


def rows(path: Path) -> dict[str, int]:
    """Rows by entity."""
    counts: dict[str, int] = {}
    for chunk in RrdReader(path).stream():
        counts[chunk.entity_path] = counts.get(chunk.entity_path, 0) + chunk.num_rows
    return counts


def timelines(path: Path, entity: str) -> set[str]:
    """The timelines that an entity has rows on."""
    return {
        name
        for chunk in RrdReader(path).stream()
        if chunk.entity_path == entity
        for name in chunk.timeline_names
    }


def test_the_story_is_complete(review: Path) -> None:
    """Each stage's part is there, under a path that reads like the pipeline."""
    found = rows(review)
    for path in (
        "/summary",
        "/tf/odom",
        "/tf/base",
        "/tf/camera",
        "/camera/depth",
        "/camera/colour",
        "/laser/scan",
        "/trajectory/localised",
        "/trajectory/wheels",
        "/trajectory/odometry",
        "/trajectory/registered",
        "/calibration/summary",
        "/segmentation/labels",
        "/segmentation/points",
        "/segmentation/candidates/chosen",
        "/segmentation/candidates/others",
        "/odometry/scan",
        "/odometry/local_map",
        "/odometry/threshold_mm",
        "/odometry/correction_mm",
        "/registration/before/scan/03",
        "/registration/after/scan/03",
        "/registration/before/top/03",
        "/registration/after/top/03",
        "/registration/iterations/rmse_mm",
        "/registration/pairs/05_to_03/target",
        "/registration/pairs/05_to_03/source",
        "/registration/pairs/05_to_03/motion",
        "/registration/graph_in_map/depth_dropped",
        "/registration/matrix/pairs",
        "/registration/matrix/at_stop",
        "/outline/edges/table/03",
        "/outline/edges/occluded/03",
        "/outline/height_mm/by_view",
        "/surface/hull",
        "/surface/candidates/ellipse",
        "/surface/chosen",
        "/surface/residuals",
        "/surface/unrolled/residuals",
        "/legs/evidence",
        "/legs/03/fit",
        "/legs/rejected/reasons",
        "/model/top",
        "/model/legs/03",
        "/model/dimensions",
        "/model/uncertainty/place",
        "/timing/bars",
        "/log/info",
    ):
        assert found.get(path, 0) > 0, f"nothing logged at {path}"


def pattern(path: str) -> re.Pattern[str]:
    """The entities that a path of the schema stands for."""
    parts = {"NN": r"\d+", "*": "[^/]+", "**": ".+"}
    return re.compile("/".join(parts.get(one, re.escape(one)) for one in path.split("/")))


def test_the_schema_has_every_entity(run: list[object], tmp_path: Path) -> None:
    """What is logged is described, and what is described is logged; the file says so itself."""
    place = WarnedPlace.about((made_up.TABLE.x, made_up.TABLE.y), 0.1)
    doubt = ProcessWarning("accuracy.unsure_legs", "legs", "a leg or none", places=(place,))
    review = write(tmp_path / "run.rrd", mended(doubted(run, doubt), view=1))
    found = [path for path in rows(review) if not path.startswith("/__properties")]
    unsaid = [p for p in found if not any(pattern(one).fullmatch(p) for one in ENTITIES)]
    assert unsaid == []
    unmet = [one for one in ENTITIES if not any(pattern(one).fullmatch(p) for p in found)]
    assert unmet == []
    properties = [
        chunk.to_record_batch().to_pydict()
        for chunk in RrdReader(review).stream()
        if chunk.entity_path == "/__properties/review"
    ]
    assert any([SCHEMA] in one.get("schema", []) for one in properties)
    assert any("/camera/depth: Enc" in str(one.get("entities")) for one in properties)


def test_the_schema_has_every_timeline(review: Path) -> None:
    """And no other is used."""
    used = {name for chunk in RrdReader(review).stream() for name in chunk.timeline_names}
    assert used == set(TIMELINES)


def snapshots_of(path: Path, entity: str) -> list[int]:
    """The snapshots that an entity has rows of."""
    found: list[int] = []
    for chunk in RrdReader(path).stream():
        if chunk.entity_path == entity and "snapshot" in chunk.timeline_names:
            found += chunk.to_record_batch().to_pydict()["snapshot"]
    return sorted(found)


@pytest.mark.parametrize(
    "entity",
    [
        "/camera/depth",
        "/camera/colour",
        "/camera/edges/table",
        "/camera/model/outline",
        "/camera/model/legs",
        "/segmentation/labels",
    ],
)
def test_images_are_there_once_a_snapshot(review: Path, entity: str) -> None:
    """Each image of a stop, and what is drawn into it, is of that stop alone."""
    assert snapshots_of(review, entity) == list(range(STOPS))


def test_the_best_view_stands_for_all_on_stage(run: list[object], review: Path) -> None:
    """Where no snapshot is chosen, the images and what is drawn into them are of one stop.

    It is the one that shows most of the table's edge, of those that are used.
    """
    used = next(one for one in run if isinstance(one, Registration)).used
    seen = {
        view.index: int(np.sum(view.kind == EdgeKind.TABLE))
        for one in run
        if isinstance(one, Outline)
        for view in one.views
        if used[view.index]
    }
    best = max(seen, key=lambda index: seen[index])
    images: list[tuple[int, int | None, object]] = []
    for chunk in RrdReader(review).stream():
        if chunk.entity_path == "/camera/depth" and "stage" in chunk.timeline_names:
            batch = chunk.to_record_batch().to_pydict()
            numbers = batch.get("snapshot", [None] * chunk.num_rows)
            images += zip(batch["stage"], numbers, batch["EncodedDepthImage:blob"], strict=True)
    (of_best,) = [blob for _, number, blob in images if number == best]
    last = max(stage for stage, _, _ in images)
    assert [blob for stage, number, blob in images if stage == last] == [of_best]
    lines = [
        chunk.to_record_batch().to_pydict()["snapshot"]
        for chunk in RrdReader(review).stream()
        if chunk.entity_path == "/camera/model/outline" and chunk.timeline_names
    ]
    assert [one for rows_of in lines for one in rows_of][-1] == best


def test_results_are_on_all_timelines(review: Path) -> None:
    """Results hold on every timeline; sensor data have their time and their snapshot."""
    everywhere = {"stage", "sensor_time", "snapshot", "iteration"}
    assert everywhere <= timelines(review, "/model/top")
    assert {"stage", "sensor_time", "snapshot"} <= timelines(review, "/camera/depth")
    assert timelines(review, "/registration/iterations/fitness") == {"iteration"}
    assert "log_time" not in timelines(review, "/model/top")


def test_sensor_time_is_exact(review: Path) -> None:
    """Stamps keep their nanoseconds."""
    expected = {made_up.START_NS + i * made_up.STOP_NS + made_up.STOP_NS // 2 for i in range(STOPS)}
    found: set[int] = set()
    for chunk in RrdReader(review).stream():
        if chunk.entity_path == "/camera/depth" and "sensor_time" in chunk.timeline_names:
            batch = chunk.to_record_batch()
            column = batch.column(batch.schema.get_field_index("sensor_time"))
            found |= {int(value) for value in column.cast("int64").to_pylist()}
    assert found == expected


def test_levels_bound_the_size(run: list[object], review: Path, tmp_path: Path) -> None:
    """A made-up lap of eight stops is small; ``off`` has summary and models alone."""
    off = write(tmp_path / "off.rrd", run, level="off")
    assert review.stat().st_size < 10e6
    assert off.stat().st_size < 0.2 * review.stat().st_size
    found = rows(off)
    assert {path.split("/")[1] for path in found} == {
        "",
        "__properties",
        "summary",
        "model",
        "tables",
        "legend",
    }
    assert found["/model/top"] > 0
    assert found["/summary"] > 0
    assert not any("/outline" in path or "/surface" in path for path in found)


def test_full_carries_every_scan(run: list[object], review: Path, tmp_path: Path) -> None:
    """``full`` has scans that ``standard`` thins."""
    full = write(tmp_path / "full.rrd", run, level="full")
    assert rows(full)["/odometry/scan"] > rows(review)["/odometry/scan"]


def test_a_failed_run_says_why(run: list[object], tmp_path: Path) -> None:
    """A run that ends early has what was done, and the reason as its summary."""
    until = next(i for i, one in enumerate(run) if isinstance(one, Registration))
    failed = [*run[:until], RunFailed("registration", "no two views overlap")]
    path = write(tmp_path / "failed.rrd", failed)
    assert "/model/top" not in rows(path)
    assert any("no two views overlap" in str(one) for one in texts(path, "/summary"))


def test_a_failed_choice_shows_what_there_was_to_choose(run: list[object], tmp_path: Path) -> None:
    """Where no table is near enough, the candidates are drawn and listed."""
    until = next(i for i, one in enumerate(run) if isinstance(one, Segmentation))
    failed = [*run[:until], RunFailed("segmentation", "no table near 9 9")]
    path = write(tmp_path / "failed.rrd", failed)
    found = columns(path, "/segmentation/candidates/others", "LineStrips3D:labels")
    assert len(found[-1]) == 2
    assert "0.74 m high" in found[-1][0]
    for page in ("/segmentation/summary", "/summary"):
        assert "seen by one view" in str(texts(path, page)[-1])
    drawn = columns(path, "/camera/candidates", "LineStrips2D:labels")
    assert len(drawn) == STOPS
    assert "0: 0.74 m" in str(drawn)
    assert "1: 0.50 m" in str(drawn)


def test_a_refused_surface_shows_its_labels_and_reasons(run: list[object], tmp_path: Path) -> None:
    """Where the surface gave no table: labels, points and reasons, and no calibration again."""
    until, seen = next((i, one) for i, one in enumerate(run) if isinstance(one, Segmentation))
    calibration = next(one for one in run if isinstance(one, Calibration))
    views = tuple(replace(one, sees_table=False, reason="its rim rises") for one in seen.views)
    refused = TableRefused(seen.candidates[0], views)
    failed = [*run[:until], calibration, refused, RunFailed("segmentation", "none shows it")]
    path = write(tmp_path / "refused.rrd", failed)
    found = rows(path)
    assert found["/segmentation/labels"] == STOPS
    assert len(columns(path, "/segmentation/points", "Points3D:class_ids")) == STOPS
    summary = str(texts(path, "/summary")[-1])
    assert f"- view {STOPS - 1}: its rim rises" in summary
    assert "depth scale" not in summary
    before = [*run[: run.index(calibration)], calibration, RunFailed("segmentation", "no surface")]
    path = write(tmp_path / "unlabelled.rrd", before)
    assert len(columns(path, "/segmentation/points", "Points3D:positions")) == STOPS
    assert "/segmentation/labels" not in rows(path)


def test_a_refused_model_is_taken_away(run: list[object], tmp_path: Path) -> None:
    """Instead the surfaces are listed, numbered, and drawn into the images again."""
    until = next(i for i, one in enumerate(run) if isinstance(one, TableModel)) + 1
    again = [StageStarted("segmentation", 9), RunFailed("segmentation", "it may be anything")]
    path = write(tmp_path / "anything.rrd", [*run[:until], *again])
    assert len(columns(path, "/model", "Clear:is_recursive")) == 1
    summary = str(texts(path, "/summary")[-1])
    assert "it may be anything" in summary
    assert "seen by one view" in summary
    assert "1: 0.50 m" in str(columns(path, "/camera/candidates", "LineStrips2D:labels")[-STOPS:])
    assert not any(columns(path, "/camera/model/outline", "LineStrips2D:strips")[-STOPS:])
    html = reviews.page([*run[:until], *again], status="failed", error="it may be anything")
    assert "No model" in html


def test_a_pair_moves_from_its_start_to_its_end(review: Path) -> None:
    """Over ``iteration`` the source's frame goes where ICP had it; elsewhere it is at the end."""
    moved, ended = [], []
    for chunk in RrdReader(review).stream():
        if chunk.entity_path == "/registration/pairs/04_to_03/motion":
            batch = chunk.to_record_batch().to_pydict()
            places = [one[0] for one in batch["Transform3D:translation"]]
            if chunk.timeline_names == ["iteration"]:
                moved += sorted(zip(batch["iteration"], places, strict=True))
            else:
                ended += places
    assert [step for step, _ in moved] == list(range(13))
    away = [float(np.linalg.norm(np.subtract(place, moved[-1][1]))) for _, place in moved]
    assert away[0] > 0.3
    assert np.all(np.diff(away) <= 0)
    assert ended == [moved[-1][1]]


def test_other_tables_stand_below_their_number(review: Path) -> None:
    """One with its model and how it came about, one with the reason why there is none."""
    found = rows(review)
    for path in (
        "model/top",
        "model/legs/03",
        "model/dimensions",
        "surface/chosen",
        "legs/evidence",
    ):
        assert found[f"/tables/01/{path}"] > 0
    assert "/tables/02/model/top" not in found
    assert any("none of 8 views" in str(one) for one in texts(review, "/tables/02/summary"))
    assert found["/model/legs/03"] == found["/tables/01/model/legs/03"]


def test_warnings_are_logged_once_at_their_time(review: Path) -> None:
    """A warning that a stage and the model both carry is one row, at the stop that it concerns."""
    said = []
    for chunk in RrdReader(review).stream():
        if chunk.entity_path.startswith("/log/"):
            batch = chunk.to_record_batch().to_pydict()
            snapshots = batch.get("snapshot", [None] * chunk.num_rows)
            said += zip(snapshots, batch["TextLog:text"], strict=True)
            # Of lines at one time the viewer mixes up the levels: each level has its own entity.
            assert {str(level[0]).lower() for level in batch["TextLog:level"]} == {
                chunk.entity_path.removeprefix("/log/")
            }
    doubts = [snapshot for snapshot, text in said if "a made-up doubt" in text[0]]
    assert doubts == [5]
    dropped = [snapshot for snapshot, text in said if "pair 5 to 3 dropped" in text[0]]
    assert dropped == [5]


def test_the_log_has_the_doubts_that_stayed(tmp_path: Path) -> None:
    """Not those of a stage that ran again, nor those that a later one withdrew."""
    run = made_up.results(stops=4)
    model = next(one for one in run if isinstance(one, TableModel))
    legs = next(one for one in run if isinstance(one, Legs))
    first, last = (
        replace(legs, warnings=(ProcessWarning("legs.no_return", "legs", said),))
        for said in ("of the first fit", "of the last fit")
    )
    entry = WarningEntry(
        code="legs.no_return", stage="legs", message="of the last fit", stamp_ns=None
    )
    told = structs.replace(model, warnings=(entry,))
    begun = [one for one in run if not isinstance(one, (Legs, TableModel, OtherTable, OfTable))]
    for k, end in enumerate((told, RunFailed("legs", "no legs"))):
        path = write(tmp_path / str(k) / "run.rrd", [*begun, first, last, end])
        said = [str(text[0]) for text in columns(path, "/log/info", "TextLog:text")]
        assert [text for text in said if "no_return" in text] == ["legs.no_return: of the last fit"]


def test_stages_that_ran_again_are_told_once(tmp_path: Path) -> None:
    """With many tables some stages run often: one bar and one row each, with the sum."""
    more = [StageStarted("surface", 9), StageFinished("surface", 9, 0.5), StageStarted("legs", 10)]
    begun = [StageStarted("surface", 0), StageFinished("surface", 0, 1.0)]
    path = write(tmp_path / "again" / "run.rrd", [made_up.MadeUpRecording(stops=3), *begun, *more])
    page = str(texts(path, "/timing/summary")[-1][0])
    assert "| surface, 2 times | 1.50 s |" in page
    assert page.count("surface") == 1
    assert columns(path, "/timing/names", "Points2D:labels")[-1] == ["surface 1.50 s"]


def test_a_failed_run_keeps_the_eyes_of_its_last_surface(run: list[object], tmp_path: Path) -> None:
    """The first view shows all that was found; tabs of the surface that was tried show that one."""
    end = next(k for k, one in enumerate(run) if isinstance(one, TableModel))
    failed = [*run[:end], RunFailed("segmentation", "no surface gave a table")]
    path = write(tmp_path / "refused" / "run.rrd", failed)
    whole = write(tmp_path / "whole" / "run.rrd", run)
    for name in ("Edges by kind", "Legs"):
        far, near = (eye_of(one, name) for one in (path, whole))
        assert np.allclose(far.target, near.target, atol=0.01)
        assert np.allclose(far.position, near.position, rtol=0.02)
    assert not np.allclose(
        eye_of_first_view(path).position, eye_of_first_view(whole).position, rtol=0.02
    )


def texts(path: Path, entity: str) -> list[list[object]]:
    """The pages of text of an entity."""
    return columns(path, entity, "TextDocument:text")


def test_empty_results_are_drawn(run: list[object], tmp_path: Path) -> None:
    """Results with nothing in them are no error."""
    poor: list[object] = []
    for one in run:
        if isinstance(one, Surface):
            poor.append(made_up.emptied(one))
        elif isinstance(one, Segmentation):
            poor.append(replace(one, candidates=()))
        elif isinstance(one, Registration):
            poor.append(replace(one, pairs=(), checks=(), stop_scans=()))
        else:
            poor.append(one)
    assert rows(write(tmp_path / "poor.rrd", poor))["/surface/summary"] > 0


def test_an_unwritable_place_is_said(tmp_path: Path) -> None:
    """A file that cannot be made is an error with its path."""
    path = tmp_path / "missing" / "run.rrd"
    with pytest.raises(TablemapError, match="missing"):
        Reviewer(path, run_id="nowhere", recording_name="made up", config=ReviewConfig())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_said(run: list[object], tmp_path: Path) -> None:
    """A disk that fills up is an error, not a silent loss."""
    path = tmp_path / "run.rrd"
    path.symlink_to("/dev/full")
    with (
        pytest.raises(TablemapError, match=r"run\.rrd"),
        Reviewer(path, run_id="full", recording_name="made up", config=ReviewConfig()) as record,
    ):
        for one in run:
            record(one)


def test_recorded_png_is_passed_through() -> None:
    """A compressedDepth PNG keeps its bytes without the ROS header."""
    depth = np.full((6, 8), 1.234, dtype=np.float32)
    png = encode_depth(depth)
    message = CompressedImage(1, "camera", "16UC1; compressedDepth png", bytes(12) + png)
    shown = depth_archetype(message, depth)
    assert shown.blob is not None
    assert bytes(shown.blob.as_arrow_array().to_pylist()[0]) == png


@pytest.mark.parametrize("form", ["32FC1; compressedDepth png", "16UC1; compressedDepth rvl"])
def test_other_depth_becomes_millimetres(form: str) -> None:
    """Inverse depth and RVL are written anew from the decoded metres."""
    depth = np.array([[1.234, np.nan]], dtype=np.float32)
    shown = depth_archetype(CompressedImage(1, "camera", form, bytes(12) + b"other"), depth)
    assert shown.blob is not None
    assert bytes(shown.blob.as_arrow_array().to_pylist()[0]) == encode_depth(depth)


def test_unknown_colour_is_left_out() -> None:
    """A colour encoding that the viewer cannot show is None, whatever its bytes."""
    assert colour_archetype(Image(1, "camera", 2, 2, "bayer_rggb8", False, 2, bytes(4))) is None
    assert colour_archetype(Image(1, "camera", 2, 2, "rgb8", False, 6, bytes(5))) is None
    assert colour_archetype(CompressedImage(1, "camera", "webp", b"RIFF")) is None
    assert colour_archetype(Image(1, "camera", 2, 2, "rgb8", False, 6, bytes(12))) is not None


def test_each_stage_tells_its_result(review: Path) -> None:
    """Over ``stage`` the summary is that stage's own text, and at the end the model's."""
    told: dict[int, str] = {}
    for chunk in RrdReader(review).stream():
        if chunk.entity_path == "/summary" and "stage" in chunk.timeline_names:
            batch = chunk.to_record_batch().to_pydict()
            pages = [one[0] for one in batch["TextDocument:text"]]
            told |= dict(zip(batch["stage"], pages, strict=True))
    assert sorted(told) == list(range(len(STAGES) + 1))
    for number, (name, words) in enumerate(
        [
            ("snapshots", f"{STOPS} snapshots"),
            ("calibration", "depth scale"),
            ("segmentation", "Candidate tables"),
            ("odometry", "scans used"),
            ("registration", "Stops registered by"),
            ("outline", "Edges by view"),
            ("surface", "Residuals of"),
            ("legs", "4 legs"),
        ],
        start=1,
    ):
        assert f"After {name}" in told[number]
        assert words in told[number]
    assert "doubtful" in told[len(STAGES)]
    assert not any("killed" in one for one in told.values())


def test_the_first_findings_give_way_to_the_model(review: Path) -> None:
    """Stops, candidates, edges and top are drawn at their stages and empty with the model."""
    for path, stage in (("stops", 1), ("candidates", 3), ("edges", 6), ("top", 7)):
        sizes: dict[int, int] = {}
        for chunk in RrdReader(review).stream():
            if chunk.entity_path == f"/story/{path}" and "stage" in chunk.timeline_names:
                batch = chunk.to_record_batch().to_pydict()
                (name,) = [one for one in batch if re.search(r":(vectors|strips|positions)$", one)]
                sizes |= {s: len(v) for s, v in zip(batch["stage"], batch[name], strict=True)}
        assert sizes[stage] > 0
        assert sizes[len(STAGES)] == 0
