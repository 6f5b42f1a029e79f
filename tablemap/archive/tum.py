"""The drive as a file in the format of the TUM RGB-D benchmark."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tablemap.stages.odometry import Trajectory


def trajectory_tum(trajectory: Trajectory) -> str:
    """Return base poses as TUM lines: seconds, x y z, qx qy qz qw, nine decimals."""
    import numpy as np

    lines = []
    for stamp, (x, y, yaw) in zip(trajectory.stamps_ns.tolist(), trajectory.poses, strict=True):
        seconds = f"{stamp // 10**9}.{stamp % 10**9:09d}"
        place = f"{x:.9f} {y:.9f} {0:.9f}"
        lines.append(
            f"{seconds} {place} {0:.9f} {0:.9f} {np.sin(yaw / 2):.9f} {np.cos(yaw / 2):.9f}"
        )
    return "\n".join(lines) + "\n"
