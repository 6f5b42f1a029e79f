"""What the floor of all views says about the camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.snapshots import Snapshot


@dataclass(frozen=True)
class FocalLength:
    """The focal length that the floor asks for.

    - ``scale``: factor on fx and fy, with its ``sigma``
    - ``tilts``: how many different tilts it rests on
    - ``applied``: whether it is clear enough to correct the snapshots
    """

    scale: float
    sigma: float
    tilts: int
    applied: bool


@dataclass(frozen=True, eq=False)
class Calibration:
    """What the floor of all views says about the camera.

    - ``roll``, ``pitch``: radians about the base's x and y axes, or about the head's where the
      camera errs with a head that turns; they turn the recorded camera into the corrected one
    - ``depth_scale``: factor on every depth
    - ``height_correction``: metres that lift the camera where the floor lies beside z = 0
    - ``covariance``: (3, 3) of roll, pitch and depth scale, priors included
    - ``floor_pixels``: how many pixels of all views show the floor
    - ``floor_rms_before``, ``floor_rms_after``: the floor's residuals in metres
    - ``snapshots``: the corrected ones, in the order given
    - ``joint_covariance``: (5, 5) of roll, pitch, depth scale, height and an offset of depth; the
      floor ties the height to the scale, and the offset (metres, added after the scale) is fitted
      only to depth published in coarse steps, whose rounding is unknown
    - ``by_view``: by snapshot index (3,) roll, pitch and height on top of the common ones, where
      the views' floors disagreed
    - ``focal``: the focal length that the floor asks for, where views tilted differently enough
      show it; the corrected snapshots have it only where the evidence is clear
    - ``floor_z``: metres, the floor in the fixed frame; the corrected snapshots count z from it
    """

    roll: float
    pitch: float
    depth_scale: float
    height_correction: float
    covariance: Floats
    floor_pixels: int
    floor_rms_before: float
    floor_rms_after: float
    snapshots: tuple[Snapshot, ...]
    warnings: tuple[ProcessWarning, ...]
    joint_covariance: Floats
    by_view: dict[int, Floats]
    focal: FocalLength | None = None
    floor_z: float = 0.0

    def top_covariance(self, height: float) -> Floats:
        """Return what the camera leaves unknown of a level top: (3, 3), of its height above the
        floor in metres, of how far it is from the camera as a share of that, and of the camera's
        own height in metres.

        A point at that height below a camera at height c has z = c + h + s (z - c): its error is
        that of h plus (z - c) times that of s, plus what an offset along the ray does.
        """
        if not self.snapshots:
            return np.zeros((3, 3))
        camera = float(np.median([s.base_from_camera[2, 3] for s in self.snapshots]))
        axis = float(np.median([s.base_from_camera[2, 2] for s in self.snapshots]))
        drop = min(height - camera, -0.1)
        gradient = np.array(
            [
                [0.0, 0.0, drop, 1.0, axis],
                [0.0, 0.0, 1.0, 0.0, axis / drop],
                [0.0, 0.0, 0.0, 1.0, 0.0],
            ]
        )
        result: Floats = gradient @ self.joint_covariance @ gradient.T
        return result
