"""Two models in one .rrd: the first with its figures, the second muted."""

from __future__ import annotations

from pathlib import Path

from tablemap.config import ReviewConfig
from tablemap.events import OtherTable
from tablemap.files import whole_file
from tablemap.model import TableModel
from tablemap.review.blueprint import blueprint
from tablemap.review.legend import log_legends
from tablemap.review.solid import log_model
from tablemap.review.stream import Stream
from tablemap.review.tables import Tables


def write_overlay(
    file: Path, a: TableModel, b: TableModel, *, names: tuple[str, str], name: str
) -> None:
    """Write both models, in the map, into ``file``; the file appears only when complete.

    Raises `TablemapError` if it cannot be written.
    """
    with whole_file(file) as part:
        stream = Stream(part, run_id=name, recording_name=name, config=ReviewConfig())
        log_legends(stream)
        log_model(stream, a)
        Tables().log_outcome(stream, OtherTable(1, b))
        stream.text("compared", f"**solid:** {names[0]}\n\n**muted:** {names[1]}")
        stream.show(blueprint(stream.scene))
        stream.close()
