"""The result of the calibration: the camera's corrections by floor and top."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.calibration.adjustment import COUNT, FIELD, PLACE, Adjustment, Beliefs
from tablemap.stages.calibration.field import REFERENCE_M, TERMS, DepthField
from tablemap.stages.calibration.rivals import Rival, rivals
from tablemap.stages.snapshots import Snapshot


@dataclass(frozen=True)
class TopBelief:
    """The uncertainty of a level top in the camera's views.

    covariance: (4, 4), of height of the top above the floor (metres), distance of the top from the
        camera (as a share of it), roll and pitch of the camera (radians)
    view_tilt: of a single view's roll and pitch, radians
    view_lift: of a single view's camera above the top, metres
    lean: metres that a single view's camera moves with each radian of the view's roll and pitch,
        as far as these are a lean of the base
    view_shift: of a single view's camera along its base, metres, whatever its pitch
    is_held: whether the camera was held by a hand
    sag: metres that the top's middle lies above its rim, negative where it sags; and its sigma
    rivals: explanations of the top's height and distance; the edges decide between them
    """

    covariance: Floats
    view_tilt: float
    view_lift: float
    lean: tuple[float, float]
    view_shift: float
    is_held: bool
    sag: tuple[float, float] = (0.0, 0.0)
    rivals: tuple[Rival, ...] = ()


@dataclass(frozen=True, eq=False)
class LevelResiduals:
    """Heights of floor or top above level, in blocks of the image: metres, NaN where not seen.

    before: (rows, columns), as recorded but for the camera's common tilt and height
    after: (rows, columns), with the depth field
    """

    before: Floats
    after: Floats


@dataclass(frozen=True, eq=False)
class Calibration:
    """The camera's corrections, from floor and top of all views.

    adjustment: tilt, height, depth field and their covariance
    beliefs: the priors of the adjustment
    floor_pixels: how many pixels of all views show the floor
    floor_rms_before, floor_rms_after: residuals of the floor, metres
    floor, top: the same over the image; None where it was not seen
    sees_top: whether the top took part in the adjustment
    recorded: the snapshots as recorded, in the order given, z counted from the floor's level
    snapshots: the corrected ones
    turns: (views,), radians that the axes of roll and pitch turned with the head
    floor_z: metres, the floor in the fixed frame; the corrected snapshots count z from it
    is_cluttered: whether what is seen near the floor's level is not flat, and so no floor
    warnings: doubts about the camera or the floor
    """

    adjustment: Adjustment
    beliefs: Beliefs
    floor_pixels: int
    floor_rms_before: float
    floor_rms_after: float
    recorded: tuple[Snapshot, ...]
    snapshots: tuple[Snapshot, ...]
    warnings: tuple[ProcessWarning, ...]
    turns: Floats
    floor: LevelResiduals | None = None
    top: LevelResiduals | None = None
    sees_top: bool = False
    floor_z: float = 0.0
    is_cluttered: bool = False

    @property
    def roll(self) -> float:
        """Radians about the base's x axis, or the head's where the camera errs with a head."""
        return self.adjustment.common.roll

    @property
    def pitch(self) -> float:
        """Radians about the base's y axis, or the head's where the camera errs with a head."""
        return self.adjustment.common.pitch

    @property
    def height_correction(self) -> float:
        """Metres that the camera is higher than recorded."""
        return self.adjustment.common.height

    @property
    def field(self) -> DepthField:
        """The factor on every depth."""
        return self.adjustment.field

    @property
    def depth_scale(self) -> float:
        """Factor on depths in the middle of the image, at `REFERENCE_M`."""
        return self.adjustment.scale

    @property
    def lifts(self) -> dict[int, float]:
        """Metres that each snapshot's camera is higher than all, by the snapshot's index."""
        lifts = self.adjustment.own[:, 2].tolist()
        return {each.index: lift for each, lift in zip(self.recorded, lifts, strict=True)}

    @property
    def covariance(self) -> Floats:
        """The (3, 3) covariance of roll, pitch and depth scale."""
        rows = np.zeros((3, COUNT))
        rows[0, PLACE["roll"]] = rows[1, PLACE["pitch"]] = rows[2, FIELD.start] = 1.0
        result: Floats = rows @ self.adjustment.covariance @ rows.T
        return result

    def top_belief(self, height: float, surface_depth_sigma: float = 0.0) -> TopBelief:
        """Return the uncertainty of a level top at a height above the floor.

        Let the camera be at height c, with a factor m on its depth. A point of a top at height h
        then appears at c + m (h - c). So the error of the height is that of c plus (h - c) times
        that of m. If the top took part in the adjustment, its height comes from there. The depth of
        the top may err by ``surface_depth_sigma`` (metres) otherwise than that of the floor.
        """
        if not self.snapshots:
            return TopBelief(np.zeros((4, 4)), 0.0, 0.0, (0.0, 0.0), 0.0, False)
        camera = float(np.median([s.base_from_camera[2, 3] for s in self.snapshots]))
        axis = float(np.median([s.base_from_camera[2, 2] for s in self.snapshots]))
        drop = max(camera - height, 0.1)
        rows = np.zeros((4, COUNT))
        if self.sees_top:
            rows[0, PLACE["top"]] = 1.0
        else:
            growth = FIELD.start + len(TERMS)
            rows[0, PLACE["height"]] = 1.0
            rows[0, FIELD.start] = -drop
            rows[0, growth] = -drop * (drop / max(-axis, 0.1) - REFERENCE_M)
            shifted = float(self.beliefs.rounding.share(np.array(drop / max(-axis, 0.1))))
            rows[0, PLACE["offset"]] = axis * shifted
        rows[1] = -rows[0] / drop
        rows[1, PLACE["height"]] += 1.0 / drop
        rows[2, PLACE["roll"]] = rows[3, PLACE["pitch"]] = 1.0
        own = np.sqrt(np.mean(self.adjustment.own_sigma**2, axis=0))
        pitches = np.sqrt(np.mean(self.adjustment.own[:, 1] ** 2) + own[1] ** 2)
        by_roll, by_pitch = self.beliefs.lean_share
        lower = axis * np.array([1.0, -1.0 / drop, 0.0, 0.0])
        return TopBelief(
            covariance=rows @ self.adjustment.covariance @ rows.T
            + surface_depth_sigma**2 * np.outer(lower, lower),
            view_tilt=float(np.hypot(own[0], own[1]) / np.sqrt(2)),
            view_lift=float(own[2]),
            lean=(by_roll * camera, by_pitch * camera),
            view_shift=float(camera * pitches * np.sqrt(by_pitch * (1 - by_pitch))),
            is_held=self.beliefs.common.lean_x > 0,
            sag=(self.adjustment.common.sag, self.adjustment.sigma("sag"))
            if self.sees_top
            else (0.0, 0.0),
            rivals=rivals(self.adjustment, self.beliefs, rows[:2], lower[:2], surface_depth_sigma),
        )
