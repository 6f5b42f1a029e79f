"""A table's model in the formats of other programs: one module a format.

Object formats are in the table's frame (origin on the floor under the top's pose, x along the
length, z up) with a world file that places them; MoveIt, Nav2 and GeoJSON are in the map.
"""

from tablemap.export.formats import FORMATS, Exported, check_formats, export_model, export_run

__all__ = ["FORMATS", "Exported", "check_formats", "export_model", "export_run"]
