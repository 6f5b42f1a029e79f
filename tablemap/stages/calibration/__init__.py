"""Camera tilt, depth scale and focal length, given away by the floor."""

from tablemap.stages.calibration.stage import Calibration, calibrate

__all__ = ["Calibration", "calibrate"]
