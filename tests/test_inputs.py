"""What a recording is given as: a file, a bag's folder, or several files of one drive."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from tablemap.archive import load_run
from tablemap.archive.packing import pack, unpack
from tablemap.archive.verification import find_input
from tablemap.config import Config
from tablemap.errors import RecordingError
from tablemap.inputs import Input
from tablemap.recording import open_recording
from tablemap.runs import Job, done_already, expand
from tablemap.runs.running import run
from tests.making import messages as w
from tests.making.command import tablemap, tablemap_here
from tests.making.drives import check_drive, copy_to_bag, copy_to_bag2, seconds


@pytest.fixture
def halves(tmp_path: Path) -> list[Path]:
    """One drive in two files."""
    source = tmp_path / "source.mcap"
    w.write_drive(source)
    parts = (seconds(0, 2.3), seconds(2.3, 9))
    return [copy_to_bag2(source, tmp_path / f"b{i}", keep=keep) for i, keep in enumerate(parts)]


def test_files_of_one_drive_are_read_as_one(halves: list[Path]) -> None:
    """In whatever order they are named; one that is named twice counts once."""
    for given in (halves, halves[::-1], [*halves, halves[0]]):
        with open_recording(given) as recording:
            check_drive(recording)


def test_input_is_its_files(tmp_path: Path, halves: list[Path]) -> None:
    """Sizes add up; the hash is the file's, or that of what sha256sum says of several."""
    one = Input.of(halves[0])
    assert one.sha256() == hashlib.sha256(halves[0].read_bytes()).hexdigest()
    several = Input.of(halves)
    assert several.size() == sum(file.stat().st_size for file in halves)
    lines = "".join(
        f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in halves
    )
    assert several.sha256() == hashlib.sha256(lines.encode()).hexdigest()
    folder = Input.of(halves[0].parent)
    assert folder == Input.of(halves[0].parent / "metadata.yaml")
    assert [file.name for file in folder.files()] == ["b0.mcap", "metadata.yaml"]
    (halves[0].parent / "notes.txt").write_text("of no account")
    assert len(folder.files()) == 2
    assert folder.sha256() not in (one.sha256(), several.sha256())
    assert (folder.stem, one.stem, str(several)) == ("b0", "b0", f"{halves[0]} and 1 more")
    assert Input.of(tmp_path / "lap_1.2.db3.zstd").stem == "lap_1.2"


@pytest.mark.parametrize("kind", ["folder", "several"])
def test_run_of_several_files_is_known_checked_and_packed(
    tmp_path: Path, halves: list[Path], kind: str
) -> None:
    """The manifest names them all; each byte of each counts."""
    given = halves[0].parent if kind == "folder" else halves
    outcome = run(given, output=tmp_path / "runs")
    assert outcome.run is not None
    assert outcome.run.path.parent.name == "b0"
    entry = load_run(outcome.run).manifest.recording
    assert entry.input == Input.of(given).resolved()
    assert (entry.size, entry.sha256) == (Input.of(given).size(), Input.of(given).sha256())
    assert find_input(outcome.run) == entry.input
    packed = pack(load_run(outcome.run), tmp_path / "packed.tar.zst", with_input=True)
    content = halves[0].read_bytes()
    halves[0].write_bytes(content[:-1] + b"\0")
    with pytest.raises(RecordingError, match="SHA-256"):
        find_input(outcome.run)
    back = unpack(packed, tmp_path / "back")
    assert find_input(back).files()[0].read_bytes() == content
    assert done_already(given, Job(tmp_path / "runs", Config())) is None  # it left no model


@pytest.mark.parametrize("what", ["a pipe", "a device"])
def test_what_never_ends_is_refused_by_name(tmp_path: Path, what: str) -> None:
    """As a recording, alone or in a bag's folder, as settings, as a list, and as a packed run."""
    file = tmp_path / "lap.mcap"
    os.mkfifo(file) if what == "a pipe" else file.symlink_to("/dev/zero")
    for arguments in (
        ("info", file),
        ("convert", file, "-o", tmp_path / "out.mcap"),
        ("process", file, "-o", tmp_path / "runs"),
        ("process", "--together", file, file, "-o", tmp_path / "runs"),
        ("process", f"@{file}", "-o", tmp_path / "runs"),
        ("process", __file__, "--config", file, "-o", tmp_path / "runs"),
        ("config", "--config", file),
        ("simulate", tmp_path / "lap.toml", "-o", tmp_path / "out.mcap"),
        ("runs", "unpack", file),
    ):
        if arguments[0] == "simulate":
            file.rename(tmp_path / "lap.toml")
        done = tablemap_here(*arguments, cwd=tmp_path)
        assert done.returncode in (1, 2), arguments
        said = " ".join(done.stderr.split())
        assert "regular file" in said, (arguments, said)
        assert "lap." in said, (arguments, said)
        if arguments[0] == "simulate":
            (tmp_path / "lap.toml").rename(file)
    for name in ("lap.mcap", "metadata.yaml"):
        folder = tmp_path / name[:3]
        folder.mkdir()
        file.rename(folder / name)
        done = tablemap_here("info", folder)
        assert done.returncode == 1, done.stdout
        assert "none inside" in done.stderr
        (folder / name).rename(file)


def test_a_folder_that_cannot_be_read_is_said_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may well have recordings inside."""

    def refused(path: Path) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "iterdir", refused)
    with pytest.raises(RecordingError, match=r"the folder cannot be read \(Permission denied\)"):
        Input.of(tmp_path).check()


def test_files_together_are_one_recording(halves: list[Path]) -> None:
    """Without it they are recordings of their own."""
    assert expand(halves) == [Input.of(file) for file in halves]
    assert expand(halves, together=True) == [Input.of(halves)]


def table_of(tmp_path: Path, *arguments: object) -> bytes:
    """Process as the command does, and return the table."""
    options = ("--output", tmp_path / "runs", "--review", "off", "--json", "-q")
    done = tablemap("process", *arguments, *options)
    assert done.returncode == 0, done.stderr
    return Path(json.loads(done.stdout)["model"]).read_bytes()


@pytest.mark.slow
def test_every_container_gives_the_same_table(tmp_path: Path, plain_recording: Path) -> None:
    """ROS 2 as one MCAP, as a database of packed messages, as two files, and converted."""
    packed = tmp_path / "packed"
    copy_to_bag2(
        plain_recording,
        packed,
        storage=StoragePlugin.SQLITE3,
        compression=CompressionMode.MESSAGE,
    )
    with plain_recording.open("rb") as file:
        statistics = make_reader(file).get_summary().statistics  # type: ignore[union-attr]
    middle = (statistics.message_start_time + statistics.message_end_time) // 2  # type: ignore[union-attr]
    halves = [
        copy_to_bag2(plain_recording, tmp_path / "first", keep=lambda time: time < middle),
        copy_to_bag2(plain_recording, tmp_path / "second", keep=lambda time: time >= middle),
    ]
    table = table_of(tmp_path, plain_recording)
    copy = tmp_path / "copy.mcap"
    assert tablemap("convert", *halves, "-o", copy).returncode == 0
    assert table_of(tmp_path, copy) == table
    assert table_of(tmp_path, packed) == table
    assert table_of(tmp_path, "--together", *halves) == table


@pytest.mark.slow
def test_bag_of_ros1_gives_the_same_table(tmp_path: Path, demo_recording: Path) -> None:
    """The demo as the bag that it could have been recorded as."""
    copy_to_bag(demo_recording, tmp_path / "demo.bag")
    assert table_of(tmp_path, tmp_path / "demo.bag") == table_of(tmp_path, demo_recording)


def test_an_absolute_input_keeps_the_names_of_links(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Runs are named after the link that was given, wherever they are made."""
    (tmp_path / "first.mcap").symlink_to(tmp_path / "demo.mcap")
    (tmp_path / "demo.mcap").touch()
    monkeypatch.chdir(tmp_path)
    given = Input.of("first.mcap")
    assert given.absolute() == Input((str(tmp_path / "first.mcap"),))
    assert given.resolved().stem == "demo"
    assert Input.of("s3://bucket/first.mcap").absolute().places == ("s3://bucket/first.mcap",)
