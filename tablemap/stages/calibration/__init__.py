"""The camera's tilt, height and depth field, from the floor and the top."""

from tablemap.stages.calibration.levels import SeenTop
from tablemap.stages.calibration.result import Calibration, TopBelief
from tablemap.stages.calibration.stage import calibrate, flatten

__all__ = ["Calibration", "SeenTop", "TopBelief", "calibrate", "flatten"]
