"""The choice of runs to remove, and their removal without leaving half of one."""

from __future__ import annotations

import contextlib
import shutil
from collections import defaultdict
from collections.abc import Collection, Sequence
from datetime import datetime, timedelta
from pathlib import Path

from tablemap.archive.folder import LATEST, RunFolder, load_run
from tablemap.archive.index import RunRow
from tablemap.archive.manifest import LEAVE_A_MODEL
from tablemap.archive.selection import known_statuses, started
from tablemap.errors import ConfigError, TablemapError
from tablemap.files import is_folder, is_link
from tablemap.paths import AnyPath, as_path

HIDDEN = ".pruned-"


def to_prune(
    rows: Sequence[RunRow],
    *,
    now: datetime,
    older_than: timedelta | None = None,
    status: Collection[str] = (),
    keep: int | None = None,
    latest: Collection[str] = (),
) -> list[RunRow]:
    """Return the runs that match every given criterion, oldest first.

    Of each recording the ``keep`` newest runs with a model stay. The paths in ``latest`` (see
    `named_latest`) always stay, and so do runs that are ``running``. Runs that are ``damaged``
    match only if ``status`` names this. A run without a date, or from the future, counts as new,
    and as none of the newest.

    Raises `ConfigError` if no criterion is given, a status is unknown, or ``keep`` is negative.
    """
    if older_than is None and keep is None and not status:
        raise ConfigError(
            "say which runs may go: --older-than DAYS, --status STATUS, or all but --keep N."
        )
    statuses = known_statuses(status)
    if keep is not None and keep < 0:
        raise ConfigError(f"expected how many runs to keep, found {keep}.")
    by_recording: dict[str, list[RunRow]] = defaultdict(list)
    for row in sorted(rows, key=lambda row: (row.started, row.path), reverse=True):
        begun = started(row)
        if row.status != "running" and (begun is None or begun <= now):
            by_recording[row.recording].append(row)
    going = []
    for own in by_recording.values():
        with_model = [row.path for row in own if row.status in LEAVE_A_MODEL]
        held = {*with_model[: keep or 0], *latest}
        for row in own:
            begun = started(row)
            if row.path in held:
                continue
            if statuses and row.status not in statuses:
                continue
            if not statuses and row.status == "damaged":
                continue
            if older_than is not None and (begun is None or now - begun < older_than):
                continue
            going.append(row)
    return sorted(going, key=lambda row: (row.started, row.path))


def named_latest(folder: AnyPath) -> set[str]:
    """Return the runs that ``latest`` names, a recording each: paths relative to ``folder``."""
    links = as_path(folder).glob(f"*/{LATEST}")
    return {
        f"{link.parent.name}/{link.resolve().name}"
        for link in links
        if is_link(link) and is_folder(link)
    }


def prune(folder: AnyPath, rows: Sequence[RunRow]) -> None:
    """Remove runs of ``folder``; ``latest`` then points to the newest remaining run with a model.

    All are hidden before the first is removed, so that a half removed run is no longer a run.
    Hidden runs from an interrupted call are removed, too. Raises `TablemapError` if a run cannot be
    removed.
    """
    folder = as_path(folder)
    runs = [folder / row.path for row in rows]
    try:
        for run in runs:
            _refuse_live(run)
        for run in runs:
            run.rename(run.with_name(f"{HIDDEN}{run.name}"))
        for hidden in folder.glob(f"*/{HIDDEN}*"):
            shutil.rmtree(hidden)
        for recording in {row.recording for row in rows}:
            _renew_latest(folder / recording)
    except OSError as error:
        raise TablemapError(
            f"a run cannot be removed ({error.strerror}): {error.filename}"
        ) from error


def _refuse_live(run: Path) -> None:
    """Raise `TablemapError` where a run goes on that was listed as one that had ended."""
    try:
        folder = load_run(run)
    except TablemapError:  # a damaged one does not go on
        return
    if folder.manifest.status == "running" and not folder.is_dead:
        raise TablemapError(f"the run goes on, and nothing was removed: {run}")


def _renew_latest(recording: Path) -> None:
    link = recording / LATEST
    if not link.is_symlink() or link.exists():
        return
    left: list[RunFolder] = []
    for path in recording.iterdir():
        if path.is_symlink() or path.name.startswith(".") or not path.is_dir():
            continue
        with contextlib.suppress(TablemapError):  # a damaged run is not the latest
            run = load_run(path)
            if run.manifest.status in LEAVE_A_MODEL:
                left.append(run)
    if left:
        max(left, key=lambda run: (run.manifest.finished or "", run.path.name)).become_latest()
        return
    link.unlink()
    if not any(recording.iterdir()):
        recording.rmdir()
