"""Choose the table and label every view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tablemap.config import SegmentationConfig, SensorsConfig
from tablemap.errors import EstimationError, ProcessWarning, WarnedPlace
from tablemap.events import Record, ignore
from tablemap.stages.segmentation.candidates import STRIDE_PX, TIE, rank_tables, seats_beside
from tablemap.stages.segmentation.height import Height, Plane, joint_height
from tablemap.stages.segmentation.labelling import label_view
from tablemap.stages.segmentation.result import (
    Segmentation,
    TableCandidate,
    TableRefused,
    TablesFound,
    ViewSegmentation,
)
from tablemap.stages.segmentation.views import SampledView, look
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted

_MOST_CHOICES = 4  # candidates that are tried after the first; each costs as much as that
_MOST_OPTIONS = 3  # places that a sentence names


def segment(
    snapshots: tuple[Snapshot, ...],
    *,
    config: SegmentationConfig,
    sensors: SensorsConfig,
    near: tuple[float, float] | None = None,
    candidate: TableCandidate | None = None,
    stride: int = 1,
    record: Record = ignore,
) -> Segmentation:
    """Choose the table (nearest to ``near`` in the map, or the best seen) and label every view.

    ``stride``: 1 labels every pixel, `STRIDE_PX` only those by which the table is chosen.

    All candidates go to ``record`` before one is chosen. A ``candidate`` of `find_tables`, if
    given, is taken without a choice. A surface that gave no table, and for which no other one is
    taken, goes to ``record`` with the labelled views. Raises `EstimationError` if there is no
    table, none near the place, or no view that sees it.
    """
    coarse = [look(s, stride=STRIDE_PX) for s in snapshots]
    if candidate is not None:
        try:
            return _labelled(coarse, (candidate,), candidate, [], config, sensors, stride)
        except EstimationError:
            record(TableRefused(candidate, _levelled(coarse, candidate, config)))
            raise
    candidates = rank_tables(coarse, config)
    record(TablesFound(candidates))
    chosen, warnings = _choose(candidates, near, config)
    try:
        return _labelled(coarse, candidates, chosen, warnings, config, sensors, stride)
    except EstimationError as failure:
        if near is not None:
            record(TableRefused(chosen, _levelled(coarse, chosen, config)))
            raise
        for other in candidates:
            if other is chosen:
                continue
            second = _second_choice(chosen, other, failure)
            try:
                return _labelled(coarse, candidates, other, [second], config, sensors, stride)
            except EstimationError:
                continue
        record(TableRefused(chosen, _levelled(coarse, chosen, config)))
        raise EstimationError(none_gave_a_table(failure, candidates)) from failure


def next_choices(first: Segmentation) -> list[TableCandidate]:
    """Return the candidates to try if the chosen one gives no model, the likeliest first."""
    others = [candidate for candidate in first.candidates if not candidate.chosen]
    return [candidate for candidate in others if not candidate.is_closed][:_MOST_CHOICES]


def choose_next(
    snapshots: tuple[Snapshot, ...],
    first: Segmentation,
    candidate: TableCandidate,
    failure: EstimationError,
    *,
    config: SegmentationConfig,
    sensors: SensorsConfig,
) -> Segmentation:
    """Label every view roughly for another candidate: the chosen one gave no model (``failure``).

    Raises `EstimationError` as `segment` does.
    """
    chosen = next(each for each in first.candidates if each.chosen)
    again = segment(
        snapshots, config=config, sensors=sensors, candidate=candidate, stride=STRIDE_PX
    )
    candidates = tuple(replace(each, chosen=each is candidate) for each in first.candidates)
    warnings = (_second_choice(chosen, candidate, failure), *again.warnings)
    return replace(again, candidates=candidates, warnings=warnings)


def none_gave_a_table(failure: EstimationError, candidates: tuple[TableCandidate, ...]) -> str:
    """Say what failed, and where the likeliest candidates are, as options of the command line."""
    if len(candidates) == 1:
        return str(failure)
    return f"{failure}; no other candidate gave a table either: {_options(candidates)}"


def _options(candidates: Sequence[TableCandidate]) -> str:
    """Name the places of the first candidates, and say how many more there are."""
    named = ", ".join(
        f"--near {c.x:.2f} {c.y:.2f} ({c.height:.2f} m high)" for c in candidates[:_MOST_OPTIONS]
    )
    more = len(candidates) - _MOST_OPTIONS
    return f"{named}, and {more} more (tab Views of the run has all)" if more > 0 else named


def _second_choice(
    chosen: TableCandidate, other: TableCandidate, failure: EstimationError
) -> ProcessWarning:
    message = (
        f"the surface at {_place(chosen)}, {chosen.height:.2f} m high, was the first choice and "
        f"gave no table ({failure}); the one at {_place(other)}, {other.height:.2f} m high, was "
        "taken"
    )
    return ProcessWarning("accuracy.second_choice", "segmentation", message, places=_hulls(chosen))


def _levelled(
    coarse: list[SampledView], candidate: TableCandidate, config: SegmentationConfig
) -> tuple[ViewSegmentation, ...]:
    """Label every view as if the candidate were a level top."""
    level = Plane(candidate.height, 0.0, 0.0)
    return tuple(
        label_view(look(view.snapshot, stride=1, coarser=view), level, candidate, config)
        for view in coarse
    )


def _labelled(
    coarse: list[SampledView],
    candidates: tuple[TableCandidate, ...],
    chosen: TableCandidate,
    warnings: list[ProcessWarning],
    config: SegmentationConfig,
    sensors: SensorsConfig,
    stride: int,
) -> Segmentation:
    """Label every view, given the table. Raises `EstimationError` where no view sees it."""
    candidates = tuple(replace(c, chosen=c is chosen) for c in candidates)
    height = joint_height(coarse, chosen, config, sensors)
    if height is None:
        raise EstimationError(
            f"Expected a table top of {chosen.height:.2f} m height at {_place(chosen)} in the map, "
            f"but none of {counted(len(coarse), 'view')} shows enough of it"
        )
    views = [
        label_view(
            view if view.stride == stride else look(view.snapshot, stride=stride, coarser=view),
            height.planes.get(view.snapshot.index, Plane(height.value, 0.0, 0.0)),
            chosen,
            config,
        )
        for view in coarse
    ]
    used = [view for view in views if view.sees_table]
    if not used:
        raise EstimationError(
            f"Expected views of the table top at {_place(chosen)} in the map, but none of "
            f"{counted(len(views), 'view')} shows it: {views[0].reason}"
        )
    return Segmentation(
        views=tuple(views),
        height=height.value,
        height_sigma=height.sigma,
        candidates=candidates,
        warnings=(*warnings, *_doubts(height), *_hardly(chosen)),
        height_apart=_apart(height),
    )


def _hardly(chosen: TableCandidate) -> list[ProcessWarning]:
    """Doubt a table under which nothing was seen but a front."""
    if not chosen.is_closed:
        return []
    message = f"The chosen surface at {_place(chosen)} is probably no table: {chosen.reason}"
    return [ProcessWarning("accuracy.hardly_table", "segmentation", message, places=_hulls(chosen))]


def _hulls(*candidates: TableCandidate) -> tuple[WarnedPlace, ...]:
    """Return the outlines of candidates at their heights."""
    return tuple(
        WarnedPlace.ring(one.hull, height=one.height) for one in candidates if len(one.hull)
    )


def segment_again(
    snapshots: tuple[Snapshot, ...],
    first: Segmentation,
    *,
    config: SegmentationConfig,
    sensors: SensorsConfig,
    record: Record = ignore,
) -> Segmentation:
    """Label every view again, with the same table, after the snapshots were corrected further.

    Raises `EstimationError` as `segment` does.
    """
    chosen = next(candidate for candidate in first.candidates if candidate.chosen)
    again = segment(snapshots, config=config, sensors=sensors, candidate=chosen, record=record)
    kept = [w for w in first.warnings if w.code in _OF_THE_CHOICE]
    return replace(again, candidates=first.candidates, warnings=(*kept, *again.warnings))


_OF_THE_CHOICE = ("segmentation.table_tie", "accuracy.second_choice")


def _place(candidate: TableCandidate) -> str:
    return f"({candidate.x:.2f}, {candidate.y:.2f})"


def _choose(
    candidates: tuple[TableCandidate, ...],
    near: tuple[float, float] | None,
    config: SegmentationConfig,
) -> tuple[TableCandidate, list[ProcessWarning]]:
    """Return the chosen candidate, and a warning if another one is nearly as good."""
    if near is not None:
        distances = [float(np.hypot(c.x - near[0], c.y - near[1])) for c in candidates]
        best = int(np.argmin(distances))
        if distances[best] > config.near_distance:
            nearest = [candidates[k] for k in np.argsort(distances, kind="stable")]
            raise EstimationError(
                f"Expected a table within {config.near_distance} m of --near {near[0]} {near[1]}, "
                f"found other candidates: {_options(nearest)}"
            )
        return candidates[best], []
    chosen = candidates[0]
    ties = [c for c in candidates[1:] if c.weight >= TIE * chosen.weight]
    tables = [c for c in candidates[1:] if seats_beside(chosen, c)]
    if not ties and not tables:
        return chosen, []
    if ties:
        message = (
            f"The table at {_place(chosen)} was chosen; other surfaces are nearly as likely: "
            f"{_options(ties)}"
        )
    else:
        message = (
            f"The surface at {_place(chosen)} was chosen, though it is as small as a seat and a "
            "higher surface lies beside it, as of a table that the camera hardly sees: "
            f"{_options(tables)}"
        )
    return chosen, [ProcessWarning("segmentation.table_tie", "segmentation", message)]


_MANY_ELSEWHERE = 0.25  # share of the views: two may measure a tray, a book or a seat


def _apart(height: Height) -> float:
    """Return how far off the height is in many other views, metres; 0 where only a few differ."""
    count = len(height.elsewhere) + len(height.planes)
    if len(height.elsewhere) <= max(2.0, _MANY_ELSEWHERE * count):
        return 0.0
    return abs(float(np.median(height.elsewhere)) - height.value)


def _doubts(height: Height) -> list[ProcessWarning]:
    found = []
    if height.scatter > 0.01:
        message = f"The top's height varies by {1000 * height.scatter:.0f} mm between views"
        found.append(ProcessWarning("accuracy.height_scatter", "segmentation", message))
    count = len(height.elsewhere) + len(height.planes)
    if _apart(height):
        message = (
            f"In {len(height.elsewhere)} of {counted(count, 'view')}, the surface at the table's "
            f"place is {np.median(height.elsewhere):.3f} m high, not {height.value:.3f} m; the "
            "table may have been raised or lowered during the drive"
        )
        found.append(ProcessWarning("accuracy.height_scatter", "segmentation", message))
    if height.other_level is not None:
        message = (
            f"Within the top lies another level, {1000 * (height.value - height.other_level):.0f} "
            "mm lower; if a tray or a cloth covers most of the table, that one is its top; clear "
            "the table and record it again"
        )
        seen = height.other_outline
        places = () if seen is None else (WarnedPlace.along(seen, height=height.other_level),)
        found.append(ProcessWarning("accuracy.two_levels", "segmentation", message, places=places))
    return found
