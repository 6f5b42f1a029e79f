"""Errors of the published attitude: the base leans, and the head is turned a little further."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tablemap.geometry import Floats
from tablemap.simulation.drive import Drive, eased
from tablemap.simulation.scenario import Scenario
from tablemap.simulation.seeds import Generators, clipped_normal


@dataclass(frozen=True, eq=False)
class Attitude:
    """The unpublished part of the robot's attitude; between stops and rests it changes smoothly.

    lean: (stops, 2) roll and pitch of the base about its own axes, radians
    encoders: (rests, 2) pan and tilt by which the head is turned further than published, radians
    """

    drive: Drive
    lean: Floats
    encoders: Floats

    def leans(self, seconds: Floats) -> Floats:
        """Return the base's roll and pitch (n, 2) at times."""
        return self._at(seconds, self.drive.stops, self.lean)

    def turns(self, seconds: Floats) -> Floats:
        """Return the head's pan and tilt (n, 2) beyond the published ones."""
        return self._at(seconds, self.drive.rests, self.encoders)

    def leaning(self, base: Floats, second: float) -> Floats | None:
        """Return the motion (4, 4) in the map that leans everything on a base at a pose (3,).

        None if the base stands upright.
        """
        roll, pitch = self.leans(np.array([second]))[0]
        if not (roll or pitch):
            return None
        heading = Rotation.from_euler("z", base[2])
        turn = heading * Rotation.from_euler("xy", [roll, pitch]) * heading.inv()
        motion = np.eye(4)
        motion[:3, :3] = turn.as_matrix()
        foot = np.array([base[0], base[1], 0.0])
        motion[:3, 3] = foot - motion[:3, :3] @ foot
        return motion

    def truth(self) -> dict[str, object]:
        """Return the truth file's entries, in the order of stops and of the head's rests."""
        roll, pitch = self.lean.T.tolist()
        pan, tilt = self.encoders.T.tolist()
        return {"lean": {"roll": roll, "pitch": pitch}, "encoders": {"pan": pan, "tilt": tilt}}

    @staticmethod
    def _at(seconds: Floats, spans: Floats, values: Floats) -> Floats:
        return np.column_stack([eased(seconds, spans, column) for column in values.T])


def draw_attitude(scenario: Scenario, drive: Drive, generator: Generators) -> Attitude:
    """Draw the lean of the base at each stop and the encoders' errors at each rest of the head."""
    lean = clipped_normal(generator("lean"), (len(drive.stops), 2))
    encoders = clipped_normal(generator("encoders"), (len(drive.rests), 2))
    head = scenario.head
    turned = np.array([head.pan_sigma_deg, head.tilt_sigma_deg]) * encoders
    turned[0::2, 0] -= head.pan_play_deg / 2
    turned[1::2, 0] += head.pan_play_deg / 2
    return Attitude(drive, np.deg2rad(scenario.ground.lean_sigma_deg) * lean, np.deg2rad(turned))
