"""Edges of the top in each view, and the cause of each edge point."""

from tablemap.stages.outline.result import EdgeKind, Outline, ViewEdges
from tablemap.stages.outline.stage import find_edges

__all__ = ["EdgeKind", "Outline", "ViewEdges", "find_edges"]
