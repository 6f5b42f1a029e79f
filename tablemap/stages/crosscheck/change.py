"""Whether camera and laser moved against each other during the drive: the legs show it by view."""

from __future__ import annotations

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.robust import mad_sigma
from tablemap.stages.crosscheck.rows import Rows

_LEAST = 0.015  # metres: bent images and clutter made 6 mm in simulated drives
_CLEAR = 5.0  # standard errors
_SCATTER = 0.002  # metres: views of one camera scatter by at least as much
_LARGEST_SIGMA = 0.005  # metres: a view that says less of its offset does not count
_FEWEST = 2  # views before and after


def moved_on_the_way(sighted: Rows) -> tuple[ProcessWarning, ...]:
    """Doubt views of which the later ones see all legs elsewhere than the earlier ones did.

    ``sighted`` are the rows of the legs. One offset of the camera fits all views then only as a
    mean, and each half of the outline is shifted the other way.
    """
    views, offsets = _by_view(sighted)
    best, shift, split = _CLEAR, np.zeros(2), 0
    for k in range(_FEWEST, len(views) - _FEWEST + 1):
        before, after = np.median(offsets[:k], axis=0), np.median(offsets[k:], axis=0)
        left = np.concatenate([offsets[:k] - before, offsets[k:] - after])
        scatter = np.maximum([mad_sigma(left[:, 0]), mad_sigma(left[:, 1])], _SCATTER)
        error = scatter * np.sqrt(1.0 / k + 1.0 / (len(views) - k))
        clear = float(np.max(np.abs(after - before) / error))
        if clear > best:
            best, shift, split = clear, after - before, k
    if np.hypot(*shift) < _LEAST:
        return ()
    forward, leftward = 1e3 * shift
    message = (
        f"From view {views[split]} on the camera is {abs(forward):.0f} mm further "
        f"{'forward' if forward > 0 else 'back'} and {abs(leftward):.0f} mm further "
        f"{'left' if leftward > 0 else 'right'} of its place in TF than before, as legs that laser "
        "and camera see show: camera or laser was moved on the robot, or the camera's calibration "
        "or TF changed; process the part before or after alone (--start, --end)."
    )
    return (ProcessWarning("accuracy.views_disagree", "crosscheck", message),)


def _by_view(rows: Rows) -> tuple[list[int], Floats]:
    """Return views in time order, and by each alone the camera's offset (v, 2), metres.

    It is forward and leftward of the base.
    """
    axes = (rows.forward, rows.left)
    slopes = np.column_stack([np.einsum("ij,ij->i", rows.normal, axis) for axis in axes])
    views, offsets = [], []
    for view in np.unique(rows.view):
        own = rows.view == view
        slope, weight = slopes[own], 1.0 / rows.variance[own]
        information = slope.T @ (weight[:, None] * slope)
        if np.linalg.eigvalsh(information)[0] < _LARGEST_SIGMA**-2:
            continue
        views.append(int(view))
        offsets.append(-np.linalg.solve(information, slope.T @ (weight * rows.distance[own])))
    return views, np.array(offsets).reshape(-1, 2)
