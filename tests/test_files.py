"""A file is there whole, or as it was before."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from tablemap.files import whole_file, whole_files, write_whole


def test_a_file_and_its_folder_appear_with_all_that_was_written(tmp_path: Path) -> None:
    """Text goes out as UTF-8 with its line ends, and nothing else is left in the folder."""
    target = tmp_path / "new" / "word.txt"
    write_whole(target, "10 \u00b5m\n")
    write_whole(target, "12 \u00b5m\r\n")
    assert target.read_bytes() == b"12 \xc2\xb5m\r\n"
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_ends_the_writing_leaves_the_earlier_file(
    tmp_path: Path, error: type[BaseException]
) -> None:
    """An error or an interrupt on the way leaves what was there, and no half file."""
    target = tmp_path / "table.json"
    target.write_text("earlier")
    with pytest.raises(error), whole_file(target) as part:
        part.write_text("half")
        assert target.read_text() == "earlier"
        raise error
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"table.json": "earlier"}


def test_an_error_names_the_file_that_was_asked_for(tmp_path: Path) -> None:
    """Not the temporary one beside it, which nobody has heard of."""
    (tmp_path / "word.txt").mkdir()
    with pytest.raises(OSError, match="directory") as raised:
        write_whole(tmp_path / "word.txt", "10")
    assert raised.value.filename == str(tmp_path / "word.txt")


def test_a_full_disk_names_the_file_that_was_asked_for(tmp_path: Path) -> None:
    """The system says that the disk is full, and not of which file."""
    target = tmp_path / "top.png"
    with pytest.raises(OSError, match="No space left") as raised, whole_file(target):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert raised.value.filename == str(target)


def test_of_several_files_none_appears_before_all_are_written(tmp_path: Path) -> None:
    """One that was not written keeps the others from their names."""
    first, second = tmp_path / "a", tmp_path / "b"
    with pytest.raises(FileNotFoundError), whole_files([first, second]) as (part, _):
        part.write_text("whole")
    assert list(tmp_path.iterdir()) == []
