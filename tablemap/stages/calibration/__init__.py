"""The camera's tilt, height and depth field, from the floor and the top."""

from tablemap.stages.calibration.levels import SeenTop
from tablemap.stages.calibration.result import Calibration, TopBelief
from tablemap.stages.calibration.rivals import CAMERA_HEIGHT, TOP_DEPTH, Rival
from tablemap.stages.calibration.stage import calibrate, flatten
from tablemap.stages.calibration.steps import FloorStep, find_step

__all__ = [
    "CAMERA_HEIGHT",
    "TOP_DEPTH",
    "Calibration",
    "FloorStep",
    "Rival",
    "SeenTop",
    "TopBelief",
    "calibrate",
    "find_step",
    "flatten",
]
