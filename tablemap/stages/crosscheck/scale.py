"""The laser's range scale against the camera's depth, as edges and legs show it together."""

from __future__ import annotations

import numpy as np

from tablemap.config import SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.stages.crosscheck.solve import MountingSolution

_LEAST = 0.01  # a share: less is what lens, depth and laser of ordinary drives make together
_CLEAR = 4.0  # standard deviations


def scale_excess(solution: MountingSolution) -> float:
    """Return by what share the laser's scale is off beyond the estimate's own sigma."""
    share, sigma = solution.range_scale
    return float(np.sqrt(max(share**2 - sigma**2, 0.0)))


def wrong_scale(solution: MountingSolution, sensors: SensorsConfig) -> tuple[ProcessWarning, ...]:
    """Doubt a laser whose ranges are clearly longer or shorter than the camera's depth.

    All views and legs are placed by the laser: with them, sizes are off by the same share.
    """
    share, sigma = solution.range_scale
    # The part of the answer that is not the prior's.
    told = 1.0 - (sigma / sensors.laser_range_scale_sigma_wide) ** 2
    if told <= 0.0:
        return ()
    share, sigma = share / told, float(sigma / np.sqrt(told))
    if abs(share) < max(_LEAST, _CLEAR * sigma):
        return ()
    message = (
        f"The laser's ranges are {100 * abs(share):.1f} % (sigma {100 * sigma:.1f}) too "
        f"{'long' if share > 0 else 'short'} for the camera's depth, as edges and legs show; sizes "
        "and places of legs follow the laser, and may be wrong by as much. Measure a distance "
        "with the laser, and check the camera's focal length, height and depth scale."
    )
    return (ProcessWarning("accuracy.laser_scale", "crosscheck", message),)
