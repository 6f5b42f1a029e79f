"""The run itself: stages, their times, warnings, and how the run ended."""

from __future__ import annotations

from collections.abc import Iterable

import rerun as rr

from tablemap import palette
from tablemap.errors import ProcessWarning, is_doubt
from tablemap.events import RunFailed, StageFinished, StageStarted
from tablemap.model import WarningEntry
from tablemap.review import story
from tablemap.review.markdown import table
from tablemap.review.stream import Stream

BAR_WIDTH = 400.0
BAR_PITCH = 30.0
BAR_HEIGHT = 20.0
CHOICE = "segmentation"
"""The stage that chooses the table; it also refuses models."""
LABEL_DROP = 11.0  # the viewer writes labels this far below their points


def log_started(stream: Stream, started: StageStarted) -> None:
    """Begin a stage: the next rows belong to it (stage 0 is the opening of the recording)."""
    stream.stage = started.index + 1
    stream.scene.stages.append((started.name, None))
    stream.scene.told = ""
    stream.hold()


def log_finished(stream: Stream, finished: StageFinished) -> None:
    """End a stage: draw the times so far, and write everything to the disk."""
    stages = stream.scene.stages
    if (finished.name, None) in stages:
        stages.remove((finished.name, None))
    stages.append((finished.name, finished.seconds))
    stream.scene.reached.add(finished.name)
    stream.hold()
    if not stream.scene.is_modelled:  # the stages of further tables come after the model
        told = stream.scene.told
        stream.at_stage()
        stream.text("summary", story.so_far(finished.name, told))
        stream.hold_in_drive()
        stream.text("summary", story.still_going(finished.name, told))
        stream.hold()
    totals = _totals(stages)
    stream.text("timing/summary", _timings(stages))
    _log_bars(stream, [(name, seconds) for name, seconds, _ in totals if seconds is not None])
    stream.flush()


def _log_bars(stream: Stream, stages: list[tuple[str, float]]) -> None:
    longest = max(max(seconds for _, seconds in stages), 1e-9)
    widths = [max(BAR_WIDTH * seconds / longest, 1.0) for _, seconds in stages]
    tops = [BAR_PITCH * k for k in range(len(stages))]
    stream.log_flat(
        "timing/bars",
        rr.LineStrips2D(
            [
                [(0.0, top + BAR_HEIGHT / 2), (width, top + BAR_HEIGHT / 2)]
                for width, top in zip(widths, tops, strict=True)
            ],
            colors=[palette.LEFT_OUT.on_dark],
            radii=BAR_HEIGHT / 2,
        ),
    )
    stream.flat_names(
        "timing/names",
        [(-80.0, top + BAR_HEIGHT / 2 - LABEL_DROP) for top in tops],
        [f"{name} {seconds:.2f} s" for name, seconds in stages],
    )


def log_failure(stream: Stream, failed: RunFailed, *, found: str) -> None:
    """Say in the summary and in the log that the run has no model, and why.

    ``found`` are the surfaces that were seen, for a stage that told nothing itself. A model that
    was refused when it was there is taken away.
    """
    scene = stream.scene
    scene.failed, scene.is_modelled = True, False
    stream.hold()
    if failed.stage == CHOICE:
        for drawn in ("model", "doubts"):
            stream.rec.log(drawn, rr.Clear(recursive=True))
    stream.text("summary", story.failure(failed.stage, failed.message, scene.told or found))
    if stream.config.level != "off":
        stream.say(f"{failed.stage}: {failed.message}", level="ERROR")
    stream.flush()


def log_warnings(
    stream: Stream, warnings: Iterable[ProcessWarning | WarningEntry], *, about: str = ""
) -> None:
    """Log warnings at the times that they concern; ``about`` names their table."""
    for warning in warnings:
        log_warning(stream, warning, about=about)


def log_warning(stream: Stream, warning: ProcessWarning | WarningEntry, *, about: str = "") -> None:
    """Log one warning at the time that it concerns, in the shell's words."""
    if warning.stamp_ns is None:
        stream.hold()
    else:
        stream.at(warning.stamp_ns, snapshot=stream.scene.snapshot_at(warning.stamp_ns))
    message = f"{about}{warning.code}: {warning.message}"
    stream.say(message, level="WARN" if is_doubt(warning.code) else "INFO")


def _totals(stages: list[tuple[str, float | None]]) -> list[tuple[str, float | None, int]]:
    """Return each stage's name, seconds and number of runs: with many tables some run often."""
    names = dict.fromkeys(name for name, _ in stages)
    ended = {name: [s for one, s in stages if one == name and s is not None] for name in names}
    return [(name, sum(ended[name]) if ended[name] else None, len(ended[name])) for name in names]


def _timings(stages: list[tuple[str, float | None]]) -> str:
    """Return how long each stage took, and how often it ran where that was more than once."""
    rows = [
        (
            name if times == 1 else f"{name}, {times} times",
            "not ended" if seconds is None else f"{seconds:.2f} s",
        )
        for name, seconds, times in _totals(stages)
    ]
    total = sum(seconds for _, seconds in stages if seconds is not None)
    return "\n".join([f"## {total:.1f} s", table(("stage", "time"), rows)])
