"""The top: height, primitives, their choice and their uncertainty."""

from tablemap.stages.surface.motion import Mounting, camera_motion
from tablemap.stages.surface.result import FittedFigure, Primitive, Surface, SurfaceEdge
from tablemap.stages.surface.stage import fit_surface

__all__ = [
    "FittedFigure",
    "Mounting",
    "Primitive",
    "Surface",
    "SurfaceEdge",
    "camera_motion",
    "fit_surface",
]
