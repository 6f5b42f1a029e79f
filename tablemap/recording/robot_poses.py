"""Where a robot and its sensors were, as its recording says."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tablemap.errors import RecordingError
from tablemap.geometry import Bools, Floats
from tablemap.recording.tf.frame_roles import FrameNames, base_from, fixed_from_bases
from tablemap.recording.tf.frames import Stamps, TransformTree
from tablemap.recording.tf.poses import PoseTrack


class RobotPoses:
    """The poses of a recording's robot: its base, camera, laser and wheels.

    - ``tree``: the robot's transforms
    - ``names``: its frames by role
    - ``localisation``: the topic of poses that TF lacked; None if TF has them
    """

    tree: TransformTree
    names: FrameNames
    localisation: PoseTrack | None = None

    def base_from_laser(self, stamp_ns: int) -> Floats:
        """Return the (4, 4) pose of the laser in the base.

        Raises `RecordingError` without a laser, or if its pose is unknown at the stamp.
        """
        if self.names.laser is None:
            raise RecordingError("The recording has no laser whose place is known.")
        poses, valid = self._base_from(self.names.laser, np.array([stamp_ns]))
        if not valid[0]:
            raise RecordingError(f"The laser's pose is not known at {stamp_ns} ns.")
        return np.array(poses[0])

    def base_from_cameras(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return the optical frame's (n, 4, 4) poses in the base, and which of them are known."""
        return self._base_from(self.names.camera, np.asarray(stamps_ns, dtype=np.int64))

    def fixed_from_base(self, stamp_ns: int) -> Floats | None:
        """Return the localised (4, 4) pose of the base, or None where it is not known."""
        poses, valid = self.fixed_from_bases([stamp_ns])
        return poses[0] if valid[0] else None

    def fixed_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return the localised (n, 4, 4) poses at (n,) stamps, and which of them are known."""
        return fixed_from_bases(self.tree, self.names, np.asarray(stamps_ns, dtype=np.int64))

    def localised_sigma(self, stamp_ns: int) -> Floats | None:
        """Return the recorded sigmas of the localised pose: x, y (metres) and yaw (radians).

        None if the poses come from TF, which has no covariances, or none was recorded.
        """
        if self.localisation is None:
            return None
        sigma = self.localisation.sigmas_at(np.array([stamp_ns], dtype=np.int64))[0]
        return sigma if np.all(np.isfinite(sigma)) else None

    def odom_from_base(self, stamp_ns: int) -> Floats | None:
        """Return the wheel odometry's (4, 4) pose, or None without one."""
        poses, valid = self.odom_from_bases([stamp_ns])
        return poses[0] if valid[0] else None

    def odom_from_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return the wheel odometry's (n, 4, 4) poses, and which of them are known."""
        stamps = np.asarray(stamps_ns, dtype=np.int64)
        if self.names.odom is None:
            nowhere = np.broadcast_to(np.eye(4), (len(stamps), 4, 4))
            return nowhere, np.zeros(len(stamps), dtype=bool)
        poses, valid = self.tree.lookup(self.names.odom, self.names.carrier, stamps)
        if self.names.base_is_virtual:
            carried, known = self._base_from(self.names.camera, stamps)
            poses = poses @ np.linalg.inv(carried)
            valid = valid & known
        return poses, valid

    def driven_bases(self, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return the base's (n, 4, 4) poses by the wheels, and which of them are known.

        The poses are those of the localisation where the wheels tell none at all.
        """
        poses, known = self.odom_from_bases(stamps_ns)
        return (poses, known) if known.any() else self.fixed_from_bases(stamps_ns)

    def _base_from(self, frame: str, stamps_ns: Stamps) -> tuple[Floats, Bools]:
        return base_from(self.tree, self.names, frame, stamps_ns)
