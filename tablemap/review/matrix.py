"""All pairs at once, however many: a matrix of the stops, coloured by how well each pair agrees."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from tablemap import palette
from tablemap.review import colours, text
from tablemap.review.stream import Stream
from tablemap.stages.registration import Pair, Registration

CELL = 10.0  # units of the plot
RADIUS = 0.42 * CELL  # of a pair's dot
MOST_NUMBERED = 9  # stops on each axis that have their numbers
ASIDE = 0.09  # of the matrix's width, to the numbers beside it
LABEL_DROP = 0.045  # of that too: the viewer writes labels below their points
RESIDUAL_LIMIT = 0.02
"""Metres by which the registered poses disagree with a pair, from which it is drawn in red."""


def log_matrix(stream: Stream, registration: Registration) -> None:
    """Draw each pair as a cell of its two stops, and each stop on the diagonal.

    Where two stops have several pairs, the cell has the worst of those that were used. A stop has
    the mean of its used pairs. The row and column of the stop at the cursor are framed.
    """
    count = len(registration.map_from_base)
    if not count:
        return
    worst: dict[tuple[int, int], Pair] = {}
    left: dict[int, list[float]] = {}
    for pair in reversed(text.worst_first(registration)):
        ends = min(pair.source, pair.target), max(pair.source, pair.target)
        if pair.used or ends not in worst:
            worst[ends] = pair
        for index in ends if pair.used else ():
            left.setdefault(index, []).append(text.pair_residual(registration, pair))
    shown = list(worst.values())
    places = np.array([(pair.target, pair.source) for pair in shown]).reshape(-1, 2)
    stream.log_flat(
        "registration/matrix/pairs",
        rr.Points2D(
            CELL * (np.concatenate([places, places[:, ::-1]]) + 0.5),
            colors=np.concatenate(2 * [tints(registration, shown)]),
            radii=RADIUS,
            labels=2 * [told(registration, pair) for pair in shown],
            show_labels=False,
        ),
    )
    mean = np.array([np.mean(left.get(k, [np.nan])) for k in range(count)])
    of_stops = colours.severity(mean, RESIDUAL_LIMIT)
    of_stops[~np.array(registration.used, dtype=bool)] = palette.LEFT_OUT.on_dark
    stream.log_flat(
        "registration/matrix/stops",
        rr.Points2D(
            CELL * (np.repeat(np.arange(count)[:, None], 2, axis=1) + 0.5),
            colors=of_stops,
            radii=RADIUS,
            labels=[
                f"stop {k}: off by {1000 * off:.1f} mm in the mean"
                if np.isfinite(off)
                else f"stop {k}"
                for k, off in enumerate(mean)
            ],
            show_labels=False,
        ),
    )
    step = -(-count // MOST_NUMBERED)
    numbered = np.arange(0, count, step)
    along = (numbered + 0.5) * CELL
    aside, drop = ASIDE * CELL * count, LABEL_DROP * CELL * count
    stream.flat_names(
        "registration/matrix/names",
        np.concatenate(
            [
                np.column_stack([along, np.full(len(along), -aside - drop)]),
                np.column_stack([np.full(len(along), -aside), along - drop]),
            ]
        ),
        [str(k) for k in numbered] * 2,
    )
    for index, stamp in enumerate(stream.scene.stamps_ns[:count]):
        stream.at_stop(stamp, index)
        stream.log_flat(
            "registration/matrix/at_stop",
            rr.Boxes2D(
                mins=[(0.0, CELL * index), (CELL * index, 0.0)],
                sizes=[(CELL * count, CELL), (CELL, CELL * count)],
                colors=[palette.REGISTERED.on_dark],
                radii=rr.Radius.ui_points(0.6),
            ),
        )
    stream.hold()


def bounds(count: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges in x and y that show a matrix of so many stops with its numbers."""
    wide = CELL * max(count, 1)
    ends = (-2.0 * ASIDE * wide, (1.0 + ASIDE / 2) * wide)
    return ends, ends


def tints(registration: Registration, pairs: list[Pair]) -> NDArray[np.uint8]:
    """Return the pairs' colours (n, 3): by their residuals at the registered poses, or dropped."""
    residuals = [text.pair_residual(registration, pair) for pair in pairs]
    found = colours.severity(np.array(residuals), RESIDUAL_LIMIT)
    found[[not pair.used for pair in pairs]] = palette.LEFT_OUT.on_dark
    return found


def told(registration: Registration, pair: Pair) -> str:
    """Return what a pair says on hovering."""
    name = f"{pair.source} to {pair.target}, {pair.kind}"
    if not pair.used:
        return f"{name}: {pair.reason}"
    return f"{name}: off by {1000 * text.pair_residual(registration, pair):.1f} mm"
