"""The choice of the table, and labels of all pixels: floor, top, things on it, the rest."""

from tablemap.stages.segmentation.candidates import STRIDE_PX, find_tables
from tablemap.stages.segmentation.result import (
    Label,
    Segmentation,
    TableCandidate,
    TableRefused,
    TablesFound,
    ViewSegmentation,
)
from tablemap.stages.segmentation.stage import (
    choose_next,
    next_choices,
    none_gave_a_table,
    segment,
    segment_again,
)

__all__ = [
    "STRIDE_PX",
    "Label",
    "Segmentation",
    "TableCandidate",
    "TableRefused",
    "TablesFound",
    "ViewSegmentation",
    "choose_next",
    "find_tables",
    "next_choices",
    "none_gave_a_table",
    "segment",
    "segment_again",
]
