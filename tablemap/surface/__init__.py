"""The top: height, primitives, their choice and their uncertainty."""

from tablemap.surface.fit import fit_surface
from tablemap.surface.result import Figure, Primitive, Surface, SurfaceEdge

__all__ = ["Figure", "Primitive", "Surface", "SurfaceEdge", "fit_surface"]
