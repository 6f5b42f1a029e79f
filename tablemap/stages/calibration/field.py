"""A depth image that bends: a smooth multiplier over the image that grows with the distance.

Depth cameras see a wall as a shallow bowl: their depth errs by such a field, one or two percent in
the corners (Teichman, Miller and Thrun, "Unsupervised Intrinsic Calibration of Depth Sensors via
SLAM", RSS 2013). The field here has two polynomials of third degree in the image: its value at
`REFERENCE_M`, and its change with each metre of distance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats
from tablemap.stages.snapshots import Camera, Snapshot

REFERENCE_M = 1.7
"""The distance to which the first half of the coefficients belongs."""

TERMS = ("1", "u", "v", "r2", "uv", "u2-v2", "u3", "u2v", "uv2", "v3")
"""The terms of the polynomial; u and v are -1 to 1 over the image, r2 is (u2 + v2) / 2."""

QUADRATIC = (3, 4, 5)
_CUBIC = slice(6, 10)
_SIZE = 0.005  # of linear and quadratic terms: CLAMS shows one to two percent in the corners
_CUBIC_SIZE = 0.003
_CONSTANT_SIZE = 0.008  # an Orbbec Astra was measured to be 1.1 % off
_GROWTH = 0.5  # of these sizes: prior of the change with a metre of distance


def prior_sigmas(size: float) -> Floats:
    """Return the prior standard deviations (2 * len(TERMS),), scaled by ``size``.

    A camera may have a wrong scale but little bend: so ``size`` does not act on the constant term.
    """
    at_reference = np.full(len(TERMS), _SIZE * size)
    at_reference[_CUBIC] = _CUBIC_SIZE * size
    growth = _GROWTH * at_reference
    growth[0] = _GROWTH * _SIZE * size
    at_reference[0] = max(_CONSTANT_SIZE, _SIZE * size)
    return np.concatenate([at_reference, growth])


def bending_size(coefficients: Floats) -> float:
    """Return the RMS of the quadratic terms over their usual prior: the measured ``size``."""
    return float(np.sqrt(np.mean(coefficients[list(QUADRATIC)] ** 2)) / _SIZE)


def image_coordinates(camera: Camera) -> tuple[Floats, Floats]:
    """Return u (width,) and v (height,) of the pixels, -1 to 1."""
    u = (np.arange(camera.width) + 0.5) / camera.width * 2 - 1
    v = (np.arange(camera.height) + 0.5) / camera.height * 2 - 1
    return u, v


def terms(u: NDArray[np.floating], v: NDArray[np.floating]) -> Floats:
    """Return the (len(TERMS), ...) terms of image coordinates."""
    u, v = np.broadcast_arrays(u, v)
    one = np.ones_like(u)
    rows = [one, u, v, (u * u + v * v) / 2, u * v, u * u - v * v, u**3, u * u * v, u * v * v, v**3]
    return np.stack(rows).astype(np.float64)


@dataclass(frozen=True, eq=False)
class DepthField:
    """The true depth over the measured one: 1 + b(u, v) + g(u, v) (z - REFERENCE_M).

    coefficients: (2 * len(TERMS),), of b, then of g (per metre)
    """

    coefficients: Floats

    def multiplier(self, camera: Camera, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the (height, width) factors of measured depths in metres, NaN where these are."""
        u, v = image_coordinates(camera)
        half = len(TERMS)
        # The sums are separable in u and v: two small matrix products are enough.
        bend = _surface(self.coefficients[:half], u, v)
        growth = _surface(self.coefficients[half:], u, v)
        factor: NDArray[np.float32] = 1 + bend + growth * (depth - np.float32(REFERENCE_M))
        return factor

    def at(self, u: float, v: float, depth: float) -> float:
        """Return the factor at one place of the image."""
        half = len(TERMS)
        row = terms(np.array(u), np.array(v))
        return float(
            1
            + row @ self.coefficients[:half]
            + (row @ self.coefficients[half:]) * (depth - REFERENCE_M)
        )

    def corrected(self, snapshot: Snapshot) -> Snapshot:
        """Return a snapshot with its depth multiplied by the field."""
        factor = self.multiplier(snapshot.camera, snapshot.depth)
        return replace(snapshot, depth=(snapshot.depth * factor).astype(np.float32))


def _surface(coefficients: Floats, u: Floats, v: Floats) -> NDArray[np.float32]:
    """Return a polynomial over the image (len(v), len(u))."""
    c = dict(zip(TERMS, coefficients, strict=True))
    by_v = np.stack([np.ones_like(v), v, v * v, v**3], axis=1)
    by_u = np.stack([np.ones_like(u), u, u * u, u**3])
    table = np.array(
        [
            [c["1"], c["u"], c["r2"] / 2 + c["u2-v2"], c["u3"]],
            [c["v"], c["uv"], c["u2v"], 0.0],
            [c["r2"] / 2 - c["u2-v2"], c["uv2"], 0.0, 0.0],
            [c["v3"], 0.0, 0.0, 0.0],
        ]
    )
    return np.asarray(by_v @ table @ by_u, dtype=np.float32)
