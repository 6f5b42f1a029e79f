"""How long scans took that do not say it: a moment, or a turn of the laser's mirror.

Many drivers leave ``time_increment`` at zero, for scans of a moment (a simulator's, or one cut from
a point cloud) and for those of a slow mirror alike. On a drive that stops it does not matter. On
one that never does, a mirror that turns five times a second puts beams centimetres off. The joint
polish sees which it is: it estimates the share of a turn, and the scans are taken anew with it. On
a ring the share passes in part for ranges that bend with the beam's angle, which is as good.
"""

from __future__ import annotations

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.recording import Recording

_CLEAR_SIGMAS = 5.0
_LEAST_SHARE = 0.1  # of a turn: less is not told from the motion's own errors
_SETTLED_SHARE = 0.03
_MOST_SHARE = 1.5


def turn_seconds(recording: Recording) -> float:
    """Return the time from one scan to the next, seconds: that of a turn; 0 if it is unknown."""
    stamps = recording.scan_stamps()
    return float(np.median(np.diff(stamps))) * 1e-9 if len(stamps) > 1 else 0.0


def told_share(sweep: tuple[float, float] | None, taken: float) -> float:
    """Return the share of a turn that is still missing in scans taken with another; 0: none.

    ``sweep`` is what the polish found, with its sigma. The first step must be clear; those after it
    only bring to an end what it began.
    """
    if sweep is None:
        return 0.0
    share, sigma = sweep
    least = max(sigma, _SETTLED_SHARE) if taken else max(_CLEAR_SIGMAS * sigma, _LEAST_SHARE)
    return share if abs(share) > least and abs(taken + share) < _MOST_SHARE else 0.0


def said_of(share: float, recording: Recording) -> list[ProcessWarning]:
    """Return the note on the share that was taken, if any."""
    if not share:
        return []
    seconds = abs(share) * turn_seconds(recording)
    return [
        ProcessWarning(
            "registration.sweep",
            "registration",
            f"The scans on {recording.names.laser} say no time_increment, but by the registration "
            f"their beams were taken one after the other; they were moved as far as the robot went "
            f"in {seconds:.2f} s from the first to the last; let the driver say time_increment",
        )
    ]
