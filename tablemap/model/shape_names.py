"""Fields of documents that hold the name of a shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated

from msgspec import Meta

from tablemap.model.shapes import SHAPES, ShapeRecord


class _Names:
    """The names of the shapes for which ``meant`` is true, of those that there are by then."""

    def __init__(self, meant: Callable[[ShapeRecord], bool]) -> None:
        self._meant = meant

    def __iter__(self) -> Iterator[str]:
        return (record.name for record in SHAPES.values() if self._meant(record))

    def read(self, name: object) -> object:
        """Return the name. Raises `ValueError` where it is none of these."""
        if isinstance(name, str) and name not in self:
            raise ValueError(f"expected one of {', '.join(self)}; found {name!r}")
        return name


def names_of(meant: Callable[[ShapeRecord], bool]) -> Meta:
    """Return what limits a field to the names of the shapes for which ``meant`` is true."""
    names = _Names(meant)
    return Meta(extra={"read": names.read, "names": names})


ShapeName = Annotated[str, names_of(lambda record: True)]
"""The name of any shape."""
SectionName = Annotated[str, names_of(lambda record: record.is_section)]
"""The name of a leg's cross-section."""
