"""A table's model in the formats of other programs: one module a format, in ``formats``.

Object formats are in the table's frame (origin on the floor under the top's pose, x along the
length, z up) with a world file that places them; MoveIt, Nav2 and GeoJSON are in the map.
"""

from tablemap.export.registry import Format, all_formats, check_formats
from tablemap.export.writing import Exported, export_model, export_run

__all__ = ["Exported", "Format", "all_formats", "check_formats", "export_model", "export_run"]
