"""Nothing that a file claims eats the machine: each limit stops it, and is named."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import pytest

from tablemap.config import LimitsConfig
from tablemap.recording import inspect
from tablemap.structs import fields_of
from tests.making import hostile
from tests.making import messages as w
from tests.making.bounds import check_bounded, said

Change = dict[str, int | float]

LOWERED: dict[str, Change] = {
    "record_mib": {},  # of these four the files below say it, which are as large as they are
    "unpacked_mib": {},
    "expansion": {},
    "chunk_mib": {},
    "channels": {"channels": 3},
    "messages": {"messages": 20},
    "chunk_messages": {"chunk_messages": 2},
    "schemas": {"schemas": 2},
    "schema_kib": {"schema_kib": 1},
    "schema_parts": {"schema_parts": 3},
    "schema_depth": {"schema_depth": 1},
    "beams": {"beams": 10},
    "pixels": {"pixels": 100},
    "frames": {"frames": 2},
    "frame_depth": {"frame_depth": 1},
    "name_bytes": {"name_bytes": 12},
    "idle_seconds": {"idle_seconds": 1e-9},
    "message_parts": {"message_parts": 1},
}
"""Settings under which the ordinary drive has too much of something."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound recording."""
    path = tmp_path_factory.mktemp("sound") / "drive.mcap"
    w.write_drive(path, version=1)
    return path


def test_the_defaults_stop_nothing_of_a_sound_recording(drive: Path) -> None:
    """Nothing is said at all."""
    assert said(drive, LimitsConfig()).strip() == ""


def test_every_limit_is_tried() -> None:
    """A new limit needs a case of its own."""
    assert LOWERED.keys() == fields_of(LimitsConfig).keys()


@pytest.mark.parametrize("name", [name for name, change in LOWERED.items() if change])
def test_what_is_over_a_limit_names_its_setting(drive: Path, name: str, tmp_path: Path) -> None:
    """The sentence says which setting to raise, and its value."""
    if name == "message_parts":  # the reader of ordinary transforms needs no list of objects
        drive = tmp_path / "parts.mcap"
        hostile.json_list(drive, 100)
    elif name == "schema_kib":  # the drive's own are smaller
        drive = tmp_path / "long.mcap"
        fields = b"uint8 x\n" * 200
        hostile.one_topic(drive, "sensor_msgs/Image", "ros1msg", fields, "ros1", b"")
    limits = LimitsConfig(**LOWERED[name])
    assert f"limits.{name} = {LOWERED[name][name]}" in said(drive, limits)


def test_a_list_of_too_many_parts_is_refused_in_every_encoding(tmp_path: Path) -> None:
    """ROS, protobuf and JSON alike; one of as many as are allowed is read."""
    limits = LimitsConfig(message_parts=50)
    makers: tuple[Callable[[Path, int], None], ...] = (
        hostile.ros_list,
        hostile.protobuf_list,
        hostile.json_list,
    )
    for make in makers:
        path = tmp_path / f"{make.__name__}.mcap"
        make(path, 60)
        assert "over limits.message_parts = 50" in said(path, limits), make
        make(path, 40)
        assert "message_parts" not in said(path, limits), make


def test_no_chunk_is_read_twice_for_one_mention_more(tmp_path: Path) -> None:
    """A summary that names one chunk ten thousand times is not believed."""
    path = tmp_path / "often.mcap"
    hostile.one_chunk_named_often(path)
    found = inspect(path)
    assert found.messages == 1
    assert "names one part of the file twice" in found.warnings[0].message


def test_a_frame_with_many_parents_is_shown_once(tmp_path: Path) -> None:
    """2^24 ways lead to the last frame of the diamonds; each edge is a line."""
    path = tmp_path / "diamonds.mcap"
    hostile.tree_of_diamonds(path)
    lines = inspect(path).tree_lines()
    assert len(lines) == 24 * 4 + 2 + len(w.STATIC_EDGES) + 3
    assert sum("as above" in line for line in lines) > 20


def test_a_chain_of_thousands_is_shown_to_its_first_levels(tmp_path: Path) -> None:
    """Each level is a line, indented by its depth: all would be megabytes of blanks."""
    path = tmp_path / "chain.mcap"
    hostile.chain_of_thousands(path)
    lines = inspect(path).tree_lines()
    assert any(line.endswith("... (more below)") for line in lines)
    assert sum(map(len, lines)) < 10_000


def test_times_that_no_number_holds_are_left_out(tmp_path: Path) -> None:
    """In chunks and outside of them."""
    path = tmp_path / "times.mcap"
    hostile.times_after_the_end_of_time(path)
    found = inspect(path)
    assert found.messages == 0
    assert any("without a header or a time" in each.message for each in found.warnings)


@pytest.mark.parametrize(
    "make", [hostile.attachment_without_end, hostile.chunk_that_ends_beyond_all_files]
)
def test_lengths_beyond_all_files_are_said(make: Callable[[Path], None], tmp_path: Path) -> None:
    """No number of 64 bits leads out of the file."""
    path = tmp_path / "long.mcap"
    make(path)
    assert any(each.code == "recording.truncated" for each in inspect(path).warnings)


def test_memory_of_a_small_message_is_small() -> None:
    """A million empty messages are an index of a few numbers each until they are asked for."""
    from tablemap.recording.mcap.container import Container

    records = hostile.channel(1, 0, "/it", "raw") + hostile.message(1, 1, b"") * 900_000
    container = Container(io.BytesIO(hostile.file_of(hostile.chunk(records))))
    assert container.counts == {1: 900_000}
    found = container.span_messages(container.spans[0], {1})
    assert len(found) == 900_000
    assert sum(1 for _ in container.messages([1])) == 900_000


@pytest.mark.slow
@pytest.mark.parametrize("name", hostile.CASES)
def test_hostile_files_are_read_or_refused_in_a_gigabyte_and_ten_seconds(
    name: str, tmp_path: Path
) -> None:
    """By `info` and by the library; what is said is a sentence, and no defect."""
    path = tmp_path / f"{name}.mcap"
    hostile.CASES[name](path)
    check_bounded(path)
