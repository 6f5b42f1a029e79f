"""A run's review made anew from the results that the run keeps."""

from __future__ import annotations

from pathlib import Path

from tablemap.archive.folder import RunFolder, check_writable, load_run
from tablemap.errors import TablemapError
from tablemap.files import whole_file
from tablemap.paths import AnyPath
from tablemap.runs.running import RESULTS, REVIEW
from tablemap.words import shown


def redraw(run: AnyPath) -> Path:
    """Make ``run.rrd`` anew out of ``results.npz``, without the recording; return its path.

    The earlier file stays until the new one is whole. Raises `TablemapError` if the run goes on or
    keeps no results, or if a file cannot be read or written.
    """
    check_writable(run)
    folder = load_run(run)
    results = folder.path / RESULTS
    if folder.manifest.status == "running":
        raise TablemapError(f"expected a finished run, found one that is running: {folder.path}")
    if not results.is_file():
        raise TablemapError(
            f"this run keeps no {RESULTS}: it is of an older version, or was made with "
            f"review.level=off; `tablemap runs reprocess` makes it again: {folder.path}"
        )
    try:
        with whole_file(folder.path / REVIEW) as part:
            _draw(folder, results, part)
    except OSError as error:
        raise TablemapError(f"the review cannot be written ({error.strerror}): {folder}") from error
    _note(folder)
    return folder.path / REVIEW


def left_out(run: AnyPath) -> str | None:
    """Say in one sentence what a review made anew has not, or None if it has all."""
    folder = load_run(run)
    if folder.config.review.level != "full":
        return None
    return (
        f"{REVIEW} was made without the scans and depth images between the stops, which "
        "review.level=full draws and a run does not keep; `tablemap runs reprocess` draws them "
        f"from the recording: {folder.path}"
    )


def _draw(folder: RunFolder, results: Path, part: Path) -> None:
    from tablemap.review import Reviewer
    from tablemap.review.keeping.results import replayed

    manifest = folder.manifest
    with Reviewer(
        part,
        run_id=manifest.run_id,
        recording_name=shown(manifest.recording.input.stem),
        config=folder.config.review,
    ) as review:
        for event in replayed(results):
            review(event)


def _note(folder: RunFolder) -> None:
    """Write the new file's hash into the manifest, where that has hashes."""
    files = folder.manifest.files
    if files:
        folder.update(files={**files, REVIEW: folder.hashes()[REVIEW]})
