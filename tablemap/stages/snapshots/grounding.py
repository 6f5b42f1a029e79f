"""The base's height and tilt in the fixed frame: believed, unless the floor shows that they drift.

Odometry in space, as of a tracking camera or a scanner in three dimensions, drifts in height and
tilt by centimetres and degrees. A base on wheels stands on its floor all the while. If the floor
lies still in the base, and wanders in the fixed frame, height and tilt are such a drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import ndimage

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, invert, transform
from tablemap.stages.snapshots.result import Snapshot

_LEAST_RISE, _LEAST_TILT = 0.01, np.radians(0.3)  # metres, radians: smaller ones harm nothing
_FEWEST_VIEWS = 4  # that see the floor
_STEADIER = 0.5  # times the scatter of the floor in the fixed frame
_STRIDE_PX = 6
_NEAR = 2.5  # metres from the base: farther away a tilt counts for more than a height
_BELOW = 0.4  # metres below the camera: nearer levels are no floor
_BIN = 0.01
_LEAST_PIXELS = 60
_SHARE = 0.3  # of the pixels of the widest level, that make a lower one the floor


def on_the_ground(
    snapshots: Sequence[Snapshot], mounts: Sequence[Floats]
) -> tuple[list[Snapshot], tuple[ProcessWarning, ...]]:
    """Return the snapshots with the base on its ground if its height and tilt drift, and a note.

    ``mounts`` are the cameras' (4, 4) poses in the base itself, one a snapshot.
    """
    leans = [
        one.base_from_camera @ invert(mount) for one, mount in zip(snapshots, mounts, strict=True)
    ]
    if len(snapshots) < _FEWEST_VIEWS:
        return list(snapshots), ()
    rise = float(np.ptp([lean[2, 3] for lean in leans]))
    tilt = float(max(np.arccos(np.clip(lean[2, 2], -1, 1)) for lean in leans))
    if rise < _LEAST_RISE and tilt < _LEAST_TILT:
        return list(snapshots), ()
    grounded = [
        replace(one, base_from_camera=mount, base_z=0.0)
        for one, mount in zip(snapshots, mounts, strict=True)
    ]
    recorded = np.array([_floor(one) for one in snapshots])
    still = np.array([_floor(one) for one in grounded])
    seen = np.isfinite(recorded) & np.isfinite(still)
    if seen.sum() < _FEWEST_VIEWS:
        return list(snapshots), ()
    wanders, rests = float(np.std(recorded[seen])), float(np.std(still[seen]))
    if wanders < _LEAST_RISE or rests > _STEADIER * wanders:
        return list(snapshots), ()
    message = (
        f"the base rises by {100 * rise:.0f} cm and tilts by up to {np.degrees(tilt):.1f} degrees "
        "in the fixed frame, and the floor that the camera sees rises and tilts with it: this is a "
        "drift of the odometry or localisation; the base was taken as standing level on its floor"
    )
    return grounded, (ProcessWarning("snapshots.grounded", "snapshots", message),)


def _floor(snapshot: Snapshot) -> float:
    """Return the z of the lowest wide level near the base, NaN without one."""
    depth = snapshot.depth[::_STRIDE_PX, ::_STRIDE_PX]
    rays = snapshot.camera.rays[::_STRIDE_PX, ::_STRIDE_PX]
    points = transform(snapshot.base_from_camera, (rays * depth[..., None]).reshape(-1, 3))
    with np.errstate(invalid="ignore"):
        near = np.hypot(points[:, 0], points[:, 1]) < _NEAR
        near &= points[:, 2] < snapshot.base_from_camera[2, 3] - _BELOW
    z = points[near, 2]
    if len(z) < _LEAST_PIXELS:
        return float("nan")
    low = float(z.min())
    counts = np.bincount(((z - low) / _BIN).astype(np.int64))
    wide = ndimage.uniform_filter1d(counts.astype(np.float64), 5, mode="constant") * 5
    first = int(np.flatnonzero(wide >= max(_LEAST_PIXELS, _SHARE * wide.max()))[:1].sum())
    if wide[first] < _LEAST_PIXELS:
        return float("nan")
    best = first + int(np.argmax(wide[first : first + 8]))
    level = low + (best + 0.5) * _BIN
    return float(np.median(z[np.abs(z - level) < 3 * _BIN]))
