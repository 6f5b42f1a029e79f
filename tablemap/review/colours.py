"""The palette's colours for the viewer: labels, edge kinds, stops, and scales of figures."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Floats
from tablemap.palette import Colour
from tablemap.stages.outline import EdgeKind
from tablemap.stages.segmentation import Label

LABELS: dict[Label, tuple[str, Colour]] = {
    Label.UNKNOWN: ("no depth", (25, 25, 30)),
    Label.FLOOR: ("floor", (84, 96, 116)),
    Label.TOP: ("table top", palette.MODEL.on_dark),
    Label.ON_TOP: ("on the top", palette.IN_THE_WAY.on_dark),
    Label.BEHIND: ("behind or below", (50, 70, 80)),
    Label.FRONT: ("in front or above", (165, 65, 130)),
    Label.OTHER_TOP: ("another surface", palette.OTHER_SURFACE.on_dark),
}
EDGES: dict[EdgeKind, tuple[str, Colour]] = {
    EdgeKind.TABLE: ("table", palette.TABLE_EDGE.on_dark),
    EdgeKind.BORDER: ("image_border", (105, 105, 115)),
    EdgeKind.OCCLUDED: ("occluded", palette.IN_THE_WAY.on_dark),
    EdgeKind.MISSING: ("no_depth", palette.LEFT_OUT.on_dark),
    EdgeKind.BENT: ("bent_depth", palette.BENT.on_dark),
}
STATUS: dict[str, Colour] = {name: ink.on_dark for name, ink in palette.STATUS.items()}
LEVEL: Colour = (235, 235, 235)
"""Of a signed distance of nothing."""


def of_stop(index: int) -> Colour:
    """Return the colour of a snapshot: neighbours in time differ."""
    red, green, blue = colorsys.hsv_to_rgb((0.08 + index * 0.618034) % 1.0, 0.5, 0.98)
    return int(red * 255), int(green * 255), int(blue * 255)


def diverging(values: Floats, limit: float) -> NDArray[np.uint8]:
    """Colour (n,) signed values: inside at -limit, white at 0, outside at +limit; (n, 3) uint8."""
    share = np.clip(np.nan_to_num(np.asarray(values, dtype=np.float64)) / limit, -1.0, 1.0)
    share = share[..., None]
    ends = np.where(share < 0, np.array(palette.INSIDE.on_dark), np.array(palette.OUTSIDE.on_dark))
    blend = (1 - np.abs(share)) * np.array(LEVEL) + np.abs(share) * ends
    return np.asarray(blend, dtype=np.uint8)


def severity(values: Floats, limit: float) -> NDArray[np.uint8]:
    """Colour (n,) sizes: green at 0, amber at half, red at the limit and beyond; (n, 3) uint8."""
    share = np.clip(np.nan_to_num(np.asarray(values, dtype=np.float64), nan=limit) / limit, 0, 1)
    anchors = np.array([STATUS["measured"], STATUS["inferred"], STATUS["unseen"]], dtype=np.float64)
    channels = [np.interp(share, [0.0, 0.5, 1.0], anchors[:, k]) for k in range(3)]
    return np.asarray(np.stack(channels, axis=-1), dtype=np.uint8)
