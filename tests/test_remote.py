"""Recordings on a server: read as those of this machine, and no more of them than is needed."""

from __future__ import annotations

import functools
import http.server
import json
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from tablemap.archive import RunFolder, load_run
from tablemap.archive.index import list_runs
from tablemap.archive.publishing import destination
from tablemap.errors import RecordingError, TablemapError
from tablemap.export import export_run
from tablemap.inputs import Input
from tablemap.model import TableModel
from tablemap.recording import convert, inspect, open_recording
from tablemap.remote import RemotePath, _store, place_at
from tablemap.review.viewer.viewer import is_review, review_file
from tablemap.runs.redrawing import redraw
from tablemap.runs.running import reprocess
from tests.making import messages as w
from tests.making.command import tablemap, tablemap_here
from tests.making.drives import check_drive, copy_to_bag, copy_to_bag2
from tests.making.models import rectangle_model
from tests.making.run_folders import make_run
from tests.making.s3_server import BUCKET, Server, s3_server


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """A server with an empty bucket."""
    _store.cache_clear()
    with s3_server(monkeypatch) as served:
        yield served
    _store.cache_clear()


def test_only_what_is_needed_is_fetched(tmp_path: Path, server: Server) -> None:
    """Of a drive with 19 MB that nothing needs, for the most part in chunks of their own."""
    path = tmp_path / "drive.mcap"
    noise = np.random.default_rng(1).bytes(400_000).hex()

    def depth(recorder: w.RosRecorder, stamp_ns: int) -> None:
        w.raw_depth(recorder, stamp_ns)
        for _ in range(8):
            packets = recorder.type("std_msgs/msg/String")(data=noise)
            recorder.write("/lidar/packets", "std_msgs/msg/String", packets, stamp_ns)

    w.write_drive(path, depth=depth, chunk_size=20_000)
    url = server.put(path, "laps/drive.mcap")
    size = path.stat().st_size
    assert size > 19_000_000
    info = inspect(url)
    assert (info.path, info.size_bytes, info.missing) == (url, size, ())
    assert server.fetched() < size / 5, server.ranges
    with open_recording(url) as recording:
        check_drive(recording)
    assert server.fetched() < size / 3, server.ranges
    assert {name for name, _ in server.ranges} == {f"/{BUCKET}/laps/drive.mcap"}
    assert len(server.ranges) < 120


def test_every_container_is_read_from_there(tmp_path: Path, server: Server) -> None:
    """A folder with a database, a bag of ROS 1, a packed file, a file that was cut short."""
    source = tmp_path / "source.mcap"
    w.write_drive(source)
    copy_to_bag2(source, tmp_path / "lap_3.1", storage=StoragePlugin.SQLITE3)
    for file in (tmp_path / "lap_3.1").iterdir():
        server.put(file, f"laps/lap_3.1/{file.name}")
    folder = f"s3://{BUCKET}/laps/lap_3.1"
    assert Input.of(folder).stem == "lap_3.1"
    packed = copy_to_bag2(source, tmp_path / "packed", compression=CompressionMode.FILE)
    w.write_drive(tmp_path / "ros1.mcap", version=1)
    copy_to_bag(tmp_path / "ros1.mcap", tmp_path / "drive.bag")
    bag = server.put(tmp_path / "drive.bag", "drive.bag")
    for given in (folder, f"{folder}/metadata.yaml", server.put(packed, "p.mcap.zstd"), bag):
        with open_recording(given) as recording:
            check_drive(recording)
    (tmp_path / "cut.mcap").write_bytes(source.read_bytes()[:-9000])
    with open_recording(server.put(tmp_path / "cut.mcap", "cut.mcap")) as recording:
        assert "recording.truncated" in {warning.code for warning in recording.warnings}
        assert len(list(recording.depth_frames())) >= 3
    done = convert(folder, tmp_path / "copy.mcap")
    with open_recording(done.path) as recording:
        check_drive(recording)


@contextmanager
def _web_server(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Serve a folder by ranges, as a plain web server; hand out its address and what is asked."""
    asked: list[str] = []

    class Ranged(http.server.SimpleHTTPRequestHandler):
        def do_GET(self) -> None:
            span = self.headers["Range"]
            asked.append(span)
            first, last = map(int, span.removeprefix("bytes=").split("-"))
            whole = Path(self.translate_path(self.path)).read_bytes()
            data = whole[first : last + 1]
            self.send_response(206)
            self.send_header("Content-Length", str(len(data)))
            end = first + len(data) - 1
            self.send_header("Content-Range", f"bytes {first}-{end}/{len(whole)}")
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: object) -> None:
            pass

    handler = functools.partial(Ranged, directory=str(folder))
    served = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=served.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{served.server_port}", asked
    finally:
        served.shutdown()


def test_https_is_read_by_ranges(tmp_path: Path) -> None:
    """Of a plain web server that knows them, here without encryption."""
    w.write_drive(tmp_path / "drive.mcap")
    with _web_server(tmp_path) as (url, asked):
        with open_recording(f"{url}/drive.mcap") as recording:
            check_drive(recording)
        assert asked


@pytest.fixture
def google(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Server:
    """The same bucket as Google's XML interface serves it, without a password."""
    account = tmp_path / "account.json"
    access = {
        "gcs_base_url": server.url,
        "disable_oauth": True,
        "client_email": "",
        "private_key": "",
        "private_key_id": "",
    }
    account.write_text(json.dumps(access))
    monkeypatch.setenv("GOOGLE_SERVICE_ACCOUNT", str(account))
    return server


def test_google_storage(tmp_path: Path, google: Server) -> None:
    """``gs://`` is read by ranges, file or folder, and runs are put there."""
    path = tmp_path / "drive.mcap"
    w.write_drive(path)
    copy_to_bag2(path, tmp_path / "lap", storage=StoragePlugin.MCAP)
    google.put(path, "drive.mcap")
    for file in (tmp_path / "lap").iterdir():
        google.put(file, f"lap/{file.name}")
    for given in (f"gs://{BUCKET}/drive.mcap", f"gs://{BUCKET}/lap"):
        assert not inspect(given).missing
        with open_recording(given) as recording:
            check_drive(recording)
    assert google.ranges
    made = make_run(tmp_path / "stage", "lap/one", rectangle_model())
    with destination(f"gs://{BUCKET}/runs") as place:
        shutil.copytree(made.path, place.folder / "lap" / "one")
        place.publish(place.folder / "lap" / "one")
    kept = RemotePath(f"gs://{BUCKET}/runs/lap/one/table.json")
    assert kept.read_text() == rectangle_model().to_json()
    with pytest.raises(RecordingError, match="no such file"):
        open_recording(f"gs://{BUCKET}/nothing.mcap")


@pytest.mark.parametrize(
    ("place", "says"),
    [
        (f"s3://{BUCKET}/none.mcap", "no such file"),
        ("s3://nobody-has-this/none.mcap", "404 Not Found"),
        (f"s3://{BUCKET}/text.txt", "found text"),
        ("http://127.0.0.1:9/drive.mcap", "cannot be opened"),
    ],
)
def test_what_cannot_be_read_is_said_in_a_sentence(
    tmp_path: Path, server: Server, place: str, says: str
) -> None:
    """With the place, and no trace of the library."""
    (tmp_path / "text.txt").write_text("nothing of the kind")
    server.put(tmp_path / "text.txt", "text.txt")
    with pytest.raises(RecordingError, match=f"(?i){says}") as caught:
        open_recording(place)
    assert place in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_command_takes_places(tmp_path: Path, server: Server) -> None:
    """Beside files of this machine."""
    w.write_drive(tmp_path / "drive.mcap")
    url = server.put(tmp_path / "drive.mcap", "drive.mcap")
    done = tablemap("info", url, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["path"] == url
    done = tablemap("convert", url, "-o", tmp_path / "copy.mcap", "-q")
    assert done.returncode == 0, done.stderr


def test_reads_are_those_of_a_file(tmp_path: Path, server: Server) -> None:
    """Any sequence of seeks and reads gives the bytes of the object."""
    content = os.urandom(300_000)
    (tmp_path / "bytes").write_bytes(content)
    rng = np.random.default_rng(2)
    with RemotePath(server.put(tmp_path / "bytes", "bytes")).open() as file:
        for _ in range(60):
            at, length = int(rng.integers(0, 310_000)), int(10 ** rng.uniform(0, 5.3))
            file.seek(at)
            assert file.read(length) == content[at : at + length]
            assert file.read(20) == content[at + length : at + length + 20]
        assert file.seek(-5, 2) == len(content) - 5
        assert file.read() == content[-5:]


def test_runs_are_put_there(tmp_path: Path, server: Server) -> None:
    """Every file of a run, failed or not, its manifest too; the JSON line tells where."""
    w.write_drive(tmp_path / "drive.mcap")
    url = server.put(tmp_path / "drive.mcap", "laps/drive.mcap")
    output = f"s3://{BUCKET}/runs/tuesday"
    done = tablemap("process", url, "--output", output, "--json", "--review", "off", "-q")
    line = json.loads(done.stdout)
    assert (done.returncode, line["status"], line["recording"]) == (1, "failed", url)
    assert line["run"].startswith(f"{output}/drive/")
    run = RemotePath(line["run"])
    manifest = json.loads((run / "manifest.json").read_text())
    assert manifest["status"] == "failed"
    assert manifest["recording"] == {
        "path": url,
        "size": (tmp_path / "drive.mcap").stat().st_size,
        "sha256": None,
        "together": [],
        "raw": [],
    }
    assert {file.name for file in run.iterdir()} >= {"run.rrd", "report.html", "config.toml"}
    assert not (run.parent / "latest").is_file()


def test_runs_there_are_shown(tmp_path: Path, server: Server) -> None:
    """By their own address, or by that of their recording; nothing is written beside them."""
    made = make_run(tmp_path / "stage", "lap/one", rectangle_model())
    with destination(f"s3://{BUCKET}/runs") as place:
        shutil.copytree(made.path, place.folder / "lap" / "one")
        (place.folder / "lap" / "one" / "run.rrd").write_bytes(b"RRF2 and more")
        place.publish(place.folder / "lap" / "one")
    lap = f"s3://{BUCKET}/runs/lap"
    for run in (f"{lap}/one", f"{lap}/one/table.json", lap, f"{lap}/latest"):
        found = load_run(run)
        assert found.manifest == made.manifest
        assert found.model == made.model
        assert is_review(run)
    assert review_file(lap).read_bytes() == b"RRF2 and more"
    done = tablemap("runs", "show", lap)
    assert done.returncode == 0, done.stderr
    assert "rectangle" in done.stdout
    refused = tablemap("runs", "reprocess", lap)
    assert refused.returncode == 2
    assert "--output" in refused.stderr
    assert not is_review(f"s3://{BUCKET}/runs/drive.mcap")
    with pytest.raises(TablemapError, match=r"manifest\.json, found none: s3://"):
        load_run(f"s3://{BUCKET}/runs/other")


def test_run_that_left_a_model_is_the_latest(tmp_path: Path, server: Server) -> None:
    """A disk has a link for that; and where the server does not answer the run is kept."""
    made = make_run(tmp_path / "stage", "lap/one", rectangle_model())
    with destination(f"s3://{BUCKET}/runs") as place:
        shutil.copytree(made.path, place.folder / "lap" / "one")
        place.publish(place.folder / "lap" / "one")
        folder = place.folder
    assert not folder.exists()
    kept = RemotePath(f"s3://{BUCKET}/runs/lap")
    assert (kept / "latest").read_text() == "one\n"
    assert (kept / "one" / "table.json").read_text() == rectangle_model().to_json()
    with destination("s3://nobody-has-this/runs") as place:
        run = place.folder / "lap" / "one"
        shutil.copytree(made.path, run)
        with pytest.raises(TablemapError, match=rf"\(No such bucket\) and stays at {run}"):
            place.publish(run)
    assert (run / "table.json").is_file()
    shutil.rmtree(place.folder)


def _put_run(folder: Path, root: str, name: str) -> RunFolder:
    """Write a run as `process` does, put it below a place, and return what was put."""
    made = make_run(folder, name, rectangle_model())
    with destination(root) as place:
        kept = place.folder / name
        shutil.copytree(made.path, kept)
        (kept / "run.rrd").write_bytes(b"RRF2 and more")
        place.publish(kept)
    return made


def test_runs_there_are_listed_and_compared(tmp_path: Path, server: Server) -> None:
    """As those of a folder here, by their addresses; a damaged one has its row."""
    root = f"s3://{BUCKET}/listed"
    rows = [_put_run(tmp_path / "stage", root, name) for name in ("lap/one", "lap/two", "room/x")]
    (tmp_path / "manifest.json").write_text("{")
    server.put(tmp_path / "manifest.json", "listed/room/y/manifest.json")
    listed = list_runs(root)
    assert [row.path for row in listed] == ["lap/one", "lap/two", "room/x", "room/y"]
    assert listed[:3] == list_runs(tmp_path / "stage")
    assert (listed[3].status, listed[3].shape) == ("damaged", None)
    done = tablemap("runs", "list", root, "--recording", "lap", "--json")
    assert done.returncode == 0, done.stderr
    assert [row["path"] for row in json.loads(done.stdout)] == ["lap/one", "lap/two"]
    done = tablemap("runs", "compare", f"{root}/lap/one", rows[1].path, "--json")
    compared = json.loads(done.stdout)
    assert (compared["a"], compared["b"]) == (f"{root}/lap/one", str(rows[1].path))
    done = tablemap("runs", "list", f"s3://{BUCKET}/nothing")
    assert done.returncode == 1
    assert f"No such place): s3://{BUCKET}/nothing" in done.stderr


def test_runs_there_are_exported_and_scored(
    tmp_path: Path, server: Server, demo_recording: Path
) -> None:
    """To files of this machine, which must be named."""
    root = f"s3://{BUCKET}/exported"
    _put_run(tmp_path / "stage", root, "lap/one")
    done = tablemap("export", f"{root}/lap", "--to", "svg", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()) == tmp_path / "out" / "svg" / "table.svg"
    refused = tablemap("export", f"{root}/lap", "--to", "svg")
    assert refused.returncode == 2
    assert "--output" in refused.stderr
    truth = demo_recording.with_name("demo.truth.json")
    done = tablemap("evaluate", f"{root}/lap", "--truth", truth, "--json")
    assert done.returncode == 0, done.stderr
    loaded = TableModel.load(f"{root}/lap/one/table.json")
    assert loaded == load_run(f"{root}/lap").model
    assert loaded.to_json() == rectangle_model().to_json()


def test_runs_of_a_web_server_are_read(tmp_path: Path) -> None:
    """By their own address, for such a server lists nothing, and that is said."""
    made = make_run(tmp_path, "lap/one", rectangle_model())
    made.update(files=made.hashes())
    with _web_server(tmp_path) as (url, _):
        found = load_run(f"{url}/lap/one")
        assert found.model == made.model
        assert found.address == f"{url}/lap/one"
        with pytest.raises(TablemapError, match=r"give a place as s3:// or gs://.*/lap"):
            list_runs(f"{url}/lap")
        made.update(files={"../../outside": ""})
        with pytest.raises(TablemapError, match="manifest is damaged"):
            load_run(f"{url}/lap/one")


@pytest.mark.parametrize(
    "words",
    [
        ("runs", "prune", "s3://b/runs"),
        ("runs", "serve", "s3://b/runs"),
        ("runs", "unpack", "packed.tar.zst", "-o", "s3://b/runs"),
        ("convert", "drive.mcap", "-o", "s3://b/copy.mcap"),
        ("simulate", "demo", "--output", "gs://b/demo.mcap"),
        ("evaluate", "--output", "s3://b/scores"),
        ("process", "drive.mcap", "--config", "https://b/settings.toml"),
    ],
)
def test_what_is_of_this_machine_alone_says_so(tmp_path: Path, words: tuple[str, ...]) -> None:
    """In one sentence that names the place and the way out; no folder ``s3:`` is made."""
    (place,) = (word for word in words if "://" in word)
    done = tablemap_here(*words, cwd=tmp_path)
    assert done.returncode == 2
    said = " ".join(done.stderr.replace("│", " ").split())
    assert f"expected a path of this machine, found {place}; copy" in said
    assert list(tmp_path.iterdir()) == []


def test_what_would_write_beside_a_run_there_says_so(tmp_path: Path, server: Server) -> None:
    """From Python too; the copy that is read goes with the program."""
    root = f"s3://{BUCKET}/written"
    _put_run(tmp_path / "stage", root, "lap/one")
    for write in (
        lambda: redraw(f"{root}/lap"),
        lambda: export_run(f"{root}/lap", ["svg"]),
        lambda: export_run(load_run(f"{root}/lap"), ["svg"]),
        lambda: reprocess(f"{root}/lap"),
    ):
        with pytest.raises(TablemapError, match=rf"a run of this machine to write to.*{root}/lap"):
            write()
    with pytest.raises(TablemapError, match=r"a path of this machine, found .*s3://b/out"):
        export_run(tmp_path / "stage" / "lap" / "one", ["svg"], output="s3://b/out")


@pytest.mark.slow
def test_a_drive_there_gives_the_same_table(
    tmp_path: Path, server: Server, plain_recording: Path
) -> None:
    """Byte for byte."""
    url = server.put(plain_recording, "plain.mcap")
    tables = []
    for given, output in ((plain_recording, tmp_path / "runs"), (url, f"s3://{BUCKET}/runs")):
        done = tablemap("process", given, "-o", output, "--json", "--review", "off", "-q")
        assert done.returncode == 0, done.stderr
        model = json.loads(done.stdout)["model"]
        tables.append(place_at(model).read_text())
    assert tables[0] == tables[1]
