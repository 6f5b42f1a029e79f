"""Numbers and XML for the formats."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from tablemap.words import shown, shown_lines

DECIMALS = 6
ANGLE_DECIMALS = 9


def number(value: float, decimals: int = DECIMALS) -> str:
    """Return a figure without trailing zeros: metres to the micrometre."""
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}".rstrip("0").rstrip(".")


def numbers(values: Iterable[float]) -> str:
    """Return metres with a space between."""
    return " ".join(number(value) for value in values)


def pose_text(x: float, y: float, z: float, yaw: float) -> str:
    """Return x y z roll pitch yaw, metres and radians."""
    return f"{numbers((x, y, z))} 0 0 {number(yaw, ANGLE_DECIMALS)}"


def child(
    parent: ElementTree.Element, tag: str, text: str = "", **attributes: str
) -> ElementTree.Element:
    """Add an element and return it."""
    element = ElementTree.SubElement(parent, tag, attributes)
    element.text = text or None
    return element


def xml_bytes(root: ElementTree.Element) -> bytes:
    """Return an indented document."""
    for element in root.iter():
        # XML has no way to hold what moves a terminal's cursor; names of frames may.
        element.text = element.text and shown_lines(element.text)
        element.attrib.update({name: shown(value) for name, value in element.attrib.items()})
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()
