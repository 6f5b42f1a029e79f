"""Shadows of a sensor's projector, or of a stereo camera's second eye, beside the top.

A sensor with a baseline b between its two eyes has no depth where a nearer surface hides the
background from one of them. In an image row this gap is as wide as the parallax f b (1/z - 1/z'),
and all such gaps lie on the same side of what is in front (Khoshelham and Elberink, Sensors 2012).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from tablemap.geometry import Bools, Floats, Ints
from tablemap.masks import counted

_Floats32 = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Gaps:
    """Missing pixels of one image between a lower surface and the top, on one side of the top.

    - ``rows``, ``columns``: (n,) of the pixels
    - ``reach``: (n,) pixels from the top's end to the gap's end, or to the pixel in a torn gap
    - ``parallax``: (n,) pixels that a baseline of a metre would make
    - ``begins``: (n,) where a whole gap begins; each such gap is one sign of the baseline
    """

    rows: Ints
    columns: Ints
    reach: Ints
    parallax: Floats
    begins: Bools


@dataclass(frozen=True)
class Shadow:
    """The side of the top on which the sensor has its shadow, and its baseline in metres."""

    side: int
    baseline: float

    def cast_on(self, gaps: tuple[Gaps, Gaps], shape: tuple[int, int]) -> Bools:
        """Return a mask of the image's pixels that lie in the shadow."""
        found = np.zeros(shape, dtype=bool)
        own = gaps[self.side]
        covered = own.reach <= self.baseline * own.parallax + _ROUNDING_PX
        found[own.rows[covered], own.columns[covered]] = True
        return found


def find_gaps(
    depth: _Floats32, top: Bools, below: Bools, front: Bools, known: Bools, fx: float
) -> tuple[Gaps, Gaps]:
    """Find the gaps to the left and to the right of the top in one image (rows, columns)."""
    missing = ~known
    if not top.any() or not missing.any():
        none = np.empty(0, dtype=np.int64)
        empty = Gaps(none, none, none, np.empty(0), np.empty(0, dtype=bool))
        return empty, empty
    # Use the disparity of the background about a pixel: at a ragged edge its own row may lack it.
    weight = counted(below, 17).astype(np.float32) / np.float32(17**2)
    inverse = np.zeros(depth.shape, dtype=np.float32)
    np.divide(1.0, depth, out=inverse, where=below)
    inverse = uniform_filter(inverse, 17, mode="constant")
    around = np.full(depth.shape, np.nan, dtype=np.float32)
    np.divide(inverse, weight, out=around, where=weight > 5 / 17**2)
    sides = []
    for flip in (False, True):
        turned = slice(None, None, -1 if flip else 1)
        z, behind = depth[:, turned], around[:, turned]
        is_top, is_below, gone = top[:, turned], below[:, turned], missing[:, turned]
        sure = is_top | is_below | front[:, turned]
        width = z.shape[1]
        columns = np.arange(width, dtype=np.int32)
        before = np.maximum.accumulate(np.where(is_below, columns, np.int32(-1)), axis=1)
        last = np.maximum.accumulate(np.where(sure, columns, np.int32(-1)), axis=1)
        ahead = np.minimum.accumulate(np.where(is_top, columns, np.int32(width))[:, ::-1], axis=1)[
            :, ::-1
        ]
        whole = (before >= 0) & (before == last)
        v, u = np.nonzero(gone & (whole | np.isfinite(behind)) & (ahead < width))
        left, right, is_whole = before[v, u], ahead[v, u], whole[v, u]
        background = np.where(is_whole, 1 / z[v, np.maximum(left, 0)], behind[v, u])
        sides.append(
            Gaps(
                rows=v,
                columns=(width - 1 - u) if flip else u,
                # A gap that ends at a lower surface must not be wider than the whole shadow.
                reach=np.where(is_whole, right - left - 1, right - u),
                parallax=fx * (1 / z[v, right] - background),
                begins=is_whole & (u == left + 1),
            )
        )
    return sides[0], sides[1]


def find_shadow(views: list[tuple[Gaps, Gaps]], believed: float) -> Shadow | None:
    """Find the sensor's shadow from the gaps of all views; None if no side clearly has one.

    The widths of all shadows agree in one baseline; other gaps have any width. ``believed`` is the
    sensor's stated baseline, metres: 0 for one without a shadow. The images may show a wider one.
    """
    if believed <= 0 or not views:
        return None
    shown = [np.sort(_baselines([gaps[side] for gaps in views])) for side in (0, 1)]
    best, shadow = 0.0, None
    for low, high in ((_LIKE[0] * believed, _LIKE[1] * believed), (0.0, _WIDEST)):
        modes = [_mode(each[(each > low) & (each < high)]) for each in shown]
        side = 0 if modes[0][1] >= modes[1][1] else 1
        baseline, count = modes[side]
        margin = count - _CLEAR * modes[1 - side][1]
        if count >= _LEAST_GAPS and margin > best:
            best, shadow = margin, Shadow(side, max(baseline, believed))
    return shadow


def _baselines(views: list[Gaps]) -> Floats:
    """Return the baselines, metres, that wide whole gaps of one side would have as shadows."""
    wide = [gaps.begins & (gaps.reach > _WIDE_PX) & (gaps.parallax > 0) for gaps in views]
    shown: Floats = np.concatenate(
        [gaps.reach[kept] / gaps.parallax[kept] for gaps, kept in zip(views, wide, strict=True)]
    )
    return shown


def _mode(shown: Floats) -> tuple[float, int]:
    """Return the baseline in which most of the sorted baselines agree, and how many do."""
    if len(shown) == 0:
        return 0.0, 0
    ends = np.searchsorted(shown, shown * (1 + _ALIKE))
    alike = ends - np.arange(len(shown))
    first = int(alike.argmax())
    return float(np.median(shown[first : ends[first]])), int(alike[first])


_ROUNDING_PX = 2
_WIDE_PX = 3
_LEAST_GAPS = 20
_WIDEST = 0.3  # metres between two eyes
_LIKE = 0.5, 1.3  # baselines that the images show of a stated one, as shares of it
_ALIKE = 0.1  # baselines that differ by less than this share are one
_CLEAR = 1.5  # times as many gaps that agree as on the other side
