"""A folder of rosbag2: which files of it hold the drive, in the order of ``metadata.yaml``."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from tablemap.errors import ProcessWarning, RecordingError
from tablemap.files import is_file, read_text
from tablemap.inputs import METADATA, is_recording
from tablemap.words import shortened

_MOST_BYTES = 2 * 2**20  # of metadata.yaml
_MOST_DEPTH = 32  # collections within each other in it
_MOST_FILES = 10_000


def files_of(folder: Path, *, warnings: list[ProcessWarning]) -> list[Path]:
    """Return the files of a bag's folder; ``warnings`` name the files that it lacks.

    Without a readable ``metadata.yaml`` the folder must contain exactly one recording. Raises
    `RecordingError` if it is unclear which files belong together, or there is no file.
    """
    inside = sorted(each for each in folder.iterdir() if is_recording(each))
    listed = _listed(folder, warnings)
    if listed is None:
        if len(inside) == 1:
            return inside
        if not inside:
            raise RecordingError(
                f"Expected a recording and found a folder with none inside: {folder}"
            )
        raise RecordingError(
            f"The folder has {len(inside)} recordings and no {METADATA} to say what belongs "
            "together; name one of them; files of one drive are for `process` --together: "
            f"{folder}"
        )
    files = [folder / name for name in listed]
    missing = [file.name for file in files if not is_file(file)]
    if missing:
        warnings.append(
            ProcessWarning(
                "recording.truncated",
                "recording",
                f"The bag's {METADATA} names files that are not in the folder, so that what they "
                f"hold was not read: {shortened(', '.join(missing))}.",
            )
        )
    # A killed recorder leaves files that it has not listed.
    stem = files[0].name.rpartition("_")[0] if files else ""
    files += [each for each in inside if each not in files and _continues(each, stem)]
    found = [file for file in files if is_file(file)]
    if not found:
        raise RecordingError(f"None of the files that the bag's {METADATA} names is in {folder}")
    return found


def _continues(file: Path, stem: str) -> bool:
    """Tell whether a file is another part of a bag with parts ``STEM_0``, ``STEM_1`` and so on."""
    before, _, number = file.name.partition(".")[0].rpartition("_")
    return bool(stem) and before == stem and number.isdigit()


def _listed(folder: Path, warnings: list[ProcessWarning]) -> list[str] | None:
    """Return the names in ``metadata.yaml``, None where there is none that can be read."""
    file = folder / METADATA
    if not file.is_file():
        return None
    try:
        text = read_text(file, most_bytes=_MOST_BYTES)
        _check_depth(text)
        # Texts alone: neither numbers nor merged mappings, which multiply.
        tree: Any = yaml.load(text, Loader=yaml.CBaseLoader)
        names = tree["rosbag2_bagfile_information"]["relative_file_paths"]
        if not isinstance(names, list) or len(names) > _MOST_FILES:
            raise TypeError("no list of files")
        return [PurePosixPath(name).name for name in names]
    except (OSError, ValueError, yaml.YAMLError, KeyError, TypeError):
        warnings.append(
            ProcessWarning(
                "recording.damaged",
                "recording",
                f"The bag's {METADATA} cannot be read; the folder's files were read without it.",
            )
        )
        return None


def _check_depth(text: str) -> None:
    """Raise `ValueError` for collections within each other as rosbag2 never writes them."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CBaseLoader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > _MOST_DEPTH:
            raise ValueError("too deep")
