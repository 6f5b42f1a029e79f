"""A camera's lens: the directions of its pixels."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tablemap.geometry import Bools, Floats
from tablemap.simulation.scenario import CameraSection

FX, FY, CX, CY = 538.391, 538.085, 315.307, 233.048
"""The intrinsics of the HSR's head camera at 640 x 480 pixels."""


class Lens:
    """A lens with the intrinsics that the robot publishes, ``recorded_k``, and the true ``k``."""

    def __init__(self, camera: CameraSection, focal_scale: float) -> None:
        self.settings = camera
        self.width, self.height = camera.width, camera.height
        sx, sy = camera.width / 640, camera.height / 480
        self.recorded_k = np.array(
            [
                [FX * sx, 0.0, (CX + 0.5) * sx - 0.5],
                [0.0, FY * sy, (CY + 0.5) * sy - 0.5],
                [0.0, 0.0, 1.0],
            ]
        )
        if camera.intrinsics:
            fx, fy, cx, cy = camera.intrinsics
            self.recorded_k = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        self.k = self.recorded_k * [[focal_scale], [focal_scale], [1.0]]
        self.k[:2, 2] = self.recorded_k[:2, 2]

    @cached_property
    def pixels(self) -> Floats:
        """The (height x width, 2) columns and rows of the pixels' centres."""
        v, u = np.mgrid[0 : self.height, 0 : self.width]
        return np.column_stack([u.ravel(), v.ravel()]).astype(np.float64)

    @cached_property
    def rays(self) -> Floats:
        """The (height x width, 3) rays of the pixels, z = 1, in the camera's frame."""
        return self.directions(self.pixels)

    def directions(self, pixels: Floats) -> Floats:
        """Return the (n, 3) rays of (n, 2) image places, z = 1, through the lens."""
        distorted = (pixels - self.k[:2, 2]) / (self.k[0, 0], self.k[1, 1])
        plain = distorted
        if any(self.settings.distortion):
            k1, k2, p1, p2, k3 = self.settings.distortion
            # The plumb-bob model is undone by iteration, as OpenCV's undistortPoints does it.
            for _ in range(12):
                x, y = plain[:, 0], plain[:, 1]
                r2 = x * x + y * y
                radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
                shift = np.column_stack(
                    [
                        2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                        p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
                    ]
                )
                plain = (distorted - shift) / radial[:, None]
        return np.column_stack([plain, np.ones(len(plain))])

    def sees(self, points: Floats) -> Bools:
        """Return which points (n, 3) of the camera's frame lie within its image."""
        ahead = points[:, 2] > 0
        x, y = (points[:, :2] / np.where(ahead, points[:, 2], 1.0)[:, None]).T
        k1, k2, p1, p2, k3 = self.settings.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        u, v = self.k[0, 0] * u + self.k[0, 2], self.k[1, 1] * v + self.k[1, 2]
        within = (np.abs(u + 0.5 - self.width / 2) < self.width / 2) & (
            np.abs(v + 0.5 - self.height / 2) < self.height / 2
        )
        return np.asarray(ahead & within)
