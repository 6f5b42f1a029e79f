"""Camera tilt, depth scale and focal length, given away by the floor."""

from tablemap.stages.calibration.result import Calibration
from tablemap.stages.calibration.stage import calibrate

__all__ = ["Calibration", "calibrate"]
