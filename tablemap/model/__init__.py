"""The model of a table: ``table.json``, and questions to it."""

from typing import TYPE_CHECKING

from tablemap.imports import on_demand

if TYPE_CHECKING:
    from tablemap.model.table import (
        Alternative,
        CalibrationEntry,
        Dimension,
        Edge,
        Figure,
        Level,
        PlanarPose,
        Point,
        PoseSigma,
        SnapshotPose,
        Status,
        SurfacePose,
        TableLeg,
        TableModel,
        TableSurface,
        Verdict,
        WarningEntry,
        json_schema,
    )

__all__ = [
    "Alternative",
    "CalibrationEntry",
    "Dimension",
    "Edge",
    "Figure",
    "Level",
    "PlanarPose",
    "Point",
    "PoseSigma",
    "SnapshotPose",
    "Status",
    "SurfacePose",
    "TableLeg",
    "TableModel",
    "TableSurface",
    "Verdict",
    "WarningEntry",
    "json_schema",
]

__getattr__ = on_demand(__name__, dict.fromkeys(__all__, "tablemap.model.table"))
