"""The error that all depths share where depth comes in coarse steps.

Nothing tells how the driver rounded. A depth that was cut off is half a step short, everywhere. If
a disparity was cut off, its depth is half a step too long, and steps grow with the distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats
from tablemap.stages.snapshots.noise import SLAB_M, value_steps

REFERENCE_M = 1.7
"""The distance to which the step and its error belong."""


@dataclass(frozen=True)
class Rounding:
    """The coarse steps between the depth values of a camera.

    step: metres between two values at `REFERENCE_M`, 0 where steps are fine
    power: of the distance, with which steps grow: 0 for a depth, 2 for a disparity
    """

    step: float = 0.0
    power: int = 0

    @property
    def sigma(self) -> float:
        """Return the standard deviation of the common error at `REFERENCE_M`, metres."""
        return _SIGMA_STEPS * self.step

    def share(self, depth: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the common error at depths (...) in metres, divided by that at `REFERENCE_M`."""
        shares: NDArray[np.floating] = (depth / REFERENCE_M) ** self.power
        return shares


FINE = Rounding()
"""The rounding of a camera whose steps are fine, or do not show."""


def find_rounding(depths: Sequence[NDArray[np.float32]]) -> Rounding:
    """Return how coarse the steps of single depth images (height, width) are, in metres."""
    found = [_steps(depth) for depth in depths]
    if 2 * sum(len(steps) > 0 for _, steps in found) <= len(found):
        return FINE
    at, steps = (np.concatenate(parts) for parts in zip(*found, strict=True))
    laws = []
    for power in (0, 2):
        scaled = np.log(steps * (REFERENCE_M / at) ** power)
        middle = float(np.median(scaled))
        laws.append((float(np.median(np.abs(scaled - middle))), power, float(np.exp(middle))))
    _, power, step = min(laws)
    return Rounding(step, power) if step > _FINE_SHARE * REFERENCE_M else FINE


def _steps(depth: NDArray[np.float32]) -> tuple[Floats, Floats]:
    """Return the distances and steps (n,) of the slabs of one image in which steps show."""
    steps = value_steps(depth, round(_FARTHEST_M / SLAB_M)).astype(np.float64)
    at = SLAB_M * np.arange(0.5, len(steps), dtype=np.float64)
    return at[steps > 0], steps[steps > 0]


_FINE_SHARE = 0.0075  # of the distance: the steps of structured light are finer
_FARTHEST_M = 3.0
_SIGMA_STEPS = 0.5**1.5  # rounded, or cut off by half a step: one is as likely as the other
