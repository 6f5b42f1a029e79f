"""A table's model in the formats of other programs: one module a format, in ``formats``.

Object formats use the table's frame (origin on the floor under the top's pose, x along the length,
z up), with a world file that places the object. MoveIt, Nav2 and GeoJSON use the map.
"""

from tablemap.export.registry import Format, all_formats, check_formats
from tablemap.export.writing import Exported, export_model, export_run

__all__ = ["Exported", "Format", "all_formats", "check_formats", "export_model", "export_run"]
