"""Depth that bends: a multiplier that is smooth over the image and grows with the distance.

The depth of structured-light cameras errs by such a field, 1 to 2 % in the corners at 2 m:
Teichman, Miller and Thrun (2013), "Unsupervised Intrinsic Calibration of Depth Sensors via SLAM"
(CLAMS). The families here differ from each other on purpose, so that no one set of polynomials fits
all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Floats
from tablemap.simulation.scenario import CameraSection

REFERENCE = 2.0
"""The distance at which a bend is stated, metres."""

FAMILIES = ("radial", "waves", "patches")

_FARTHEST = 5.0  # metres: the growth with the distance ends here
_LIKENESS = 0.9  # correlation of the growth with the field itself
_SPREAD = 2 / 3, 4 / 3
_TABLE = (7, 9)  # rows and columns of the field in the truth file


@dataclass(frozen=True, eq=False)
class Bend:
    """The factor on depth z: 1 + ``offset`` + ``growth`` (z - 2 m), with z limited to 5 m.

    family: how the field was made
    offset: (height, width), the multiplier's departure from 1 at 2 m, its mean 0
    growth: (height, width), a metre
    """

    family: str
    offset: Floats
    growth: Floats

    def multiplier(self, depth: Floats) -> Floats:
        """Return the factors (height x width,) of true depths (height x width,) in metres."""
        beyond = np.clip(depth, 0.0, _FARTHEST) - REFERENCE
        return np.asarray(1.0 + self.offset.ravel() + self.growth.ravel() * beyond)

    def truth(self) -> dict[str, object]:
        """Return the truth file's entry: the field at evenly spaced pixels, corners included."""
        height, width = self.offset.shape
        rows = np.rint(np.linspace(0, height - 1, _TABLE[0])).astype(int)
        columns = np.rint(np.linspace(0, width - 1, _TABLE[1])).astype(int)
        at = np.ix_(rows, columns)
        return {
            "family": self.family,
            "most_at_2m": float(np.abs(self.offset).max()),
            "rms_at_2m": float(np.sqrt(np.mean(self.offset**2))),
            "rows": rows.tolist(),
            "columns": columns.tolist(),
            "offset_at_2m": np.round(self.offset[at], 6).tolist(),
            "growth_per_metre": np.round(self.growth[at], 6).tolist(),
        }


def draw_bend(camera: CameraSection, rng: np.random.Generator) -> Bend | None:
    """Draw a recording's field; None where the camera's depth does not bend."""
    if not camera.bend_percent:
        return None
    drawn = FAMILIES[int(rng.integers(len(FAMILIES)))]
    family = drawn if camera.bend_family == "drawn" else camera.bend_family
    # Half an image's width is 1, whatever the number of pixels: the field is that of the lens.
    half = camera.width / 2
    x = np.asarray((np.arange(camera.width) + 0.5) / half - 1.0, dtype=np.float64)
    y = np.asarray((np.arange(camera.height) + 0.5 - camera.height / 2) / half, dtype=np.float64)
    most = camera.bend_percent / 100 * rng.uniform(*_SPREAD)
    offset, other = (most * _unit(_field(family, x, y, rng)) for _ in range(2))
    growth = _LIKENESS * offset + np.sqrt(1 - _LIKENESS**2) * other
    return Bend(family, offset, camera.bend_growth / REFERENCE * growth)


def _field(family: str, x: Floats, y: Floats, rng: np.random.Generator) -> Floats:
    """Return a random (len(y), len(x)) field of a family, of any size and mean."""
    if family == "radial":
        # A lens that is not quite centred.
        centre = np.clip(rng.normal(0.0, 0.12, 2), -0.3, 0.3)
        squared = (x - centre[0]) ** 2 + (y[:, None] - centre[1]) ** 2
        squared /= x[-1] ** 2 + y[-1] ** 2
        second, fourth = rng.normal(size=2)
        return np.asarray(second * squared + fourth * squared**2)
    if family == "waves":
        count = np.array([(i, j) for i in range(4) for j in range(-3, 4) if i or j > 0])
        amplitudes = rng.normal(size=len(count)) / np.sum(count**2, axis=1)
        return _waves(x, y, np.pi / 2 * count, amplitudes, rng)
    # A Gaussian random field by its spectrum (Rahimi and Recht 2007, random Fourier features).
    length = rng.uniform(0.45, 0.8)
    frequencies = rng.normal(size=(64, 2)) / length
    return _waves(x, y, frequencies, rng.normal(size=64), rng)


def _waves(
    x: Floats, y: Floats, frequencies: Floats, amplitudes: Floats, rng: np.random.Generator
) -> Floats:
    """Sum cosines of random phase; ``frequencies`` (k, 2) in radians a unit of x and y."""
    phases = rng.uniform(0, 2 * np.pi, len(frequencies))
    along = np.multiply.outer(x, frequencies[:, 0]) + phases
    across = np.multiply.outer(y, frequencies[:, 1])
    # cos(a + b) = cos a cos b - sin a sin b: two products of matrices.
    return np.asarray(
        (amplitudes * np.cos(across)) @ np.cos(along).T
        - (amplitudes * np.sin(across)) @ np.sin(along).T
    )


def _unit(field: Floats) -> Floats:
    """Return a field with mean 0 and nowhere more than 1."""
    field = field - field.mean()
    return np.asarray(field / np.abs(field).max())
