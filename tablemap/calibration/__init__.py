"""Camera tilt, depth scale and focal length, given away by the floor."""

from tablemap.calibration.calibrate import Calibration, calibrate

__all__ = ["Calibration", "calibrate"]
