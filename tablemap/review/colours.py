"""One palette: a colour has the same meaning in every view."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray

from tablemap.geometry import Floats
from tablemap.stages.outline import EdgeKind
from tablemap.stages.segmentation import Label

Colour = tuple[int, int, int]

LABELS: dict[Label, tuple[str, Colour]] = {
    Label.UNKNOWN: ("no depth", (25, 25, 30)),
    Label.FLOOR: ("floor", (84, 96, 116)),
    Label.TOP: ("table top", (240, 180, 60)),
    Label.ON_TOP: ("on the top", (225, 90, 170)),
    Label.BEHIND: ("behind or below", (50, 120, 130)),
    Label.FRONT: ("in front or above", (200, 80, 60)),
    Label.OTHER_TOP: ("another surface", (140, 110, 210)),
}
EDGES: dict[EdgeKind, tuple[str, Colour]] = {
    EdgeKind.TABLE: ("table", (90, 215, 120)),
    EdgeKind.BORDER: ("image_border", (130, 130, 140)),
    EdgeKind.OCCLUDED: ("occluded", (245, 150, 50)),
    EdgeKind.MISSING: ("no_depth", (170, 120, 230)),
    EdgeKind.BENT: ("bent_depth", (190, 160, 120)),
}
STATUS: dict[str, Colour] = {
    "measured": (90, 215, 120),
    "inferred": (250, 185, 60),
    "unseen": (240, 80, 80),
}
LOCALISED: Colour = (240, 110, 90)
WHEELS: Colour = (230, 200, 90)
ODOMETRY: Colour = (110, 170, 250)
REGISTERED: Colour = (90, 215, 120)
USED: Colour = (90, 215, 120)
DROPPED: Colour = (240, 80, 80)
MUTED: Colour = (120, 120, 130)
WOOD: Colour = (196, 152, 98)
INK: Colour = (150, 150, 160)
WALL: Colour = (110, 150, 215)
CLUTTER: Colour = (225, 90, 170)


def of_stop(index: int) -> Colour:
    """Return the colour of a snapshot: neighbours in time differ."""
    red, green, blue = colorsys.hsv_to_rgb((0.08 + index * 0.618034) % 1.0, 0.62, 0.98)
    return int(red * 255), int(green * 255), int(blue * 255)


def diverging(values: Floats, limit: float) -> NDArray[np.uint8]:
    """Colour (n,) values: blue at -limit, white at 0, red at +limit; (n, 3) uint8."""
    share = np.clip(np.nan_to_num(np.asarray(values, dtype=np.float64)) / limit, -1.0, 1.0)[:, None]
    white = np.array([235.0, 235.0, 235.0])
    ends = np.where(share < 0, np.array([60.0, 120.0, 250.0]), np.array([250.0, 80.0, 60.0]))
    blend = (1 - np.abs(share)) * white + np.abs(share) * ends
    return np.asarray(blend, dtype=np.uint8)


def severity(values: Floats, limit: float) -> NDArray[np.uint8]:
    """Colour (n,) sizes: green at 0, amber at half, red at the limit and beyond; (n, 3) uint8."""
    share = np.clip(np.nan_to_num(np.asarray(values, dtype=np.float64), nan=limit) / limit, 0, 1)
    anchors = np.array([STATUS["measured"], STATUS["inferred"], STATUS["unseen"]], dtype=np.float64)
    channels = [np.interp(share, [0.0, 0.5, 1.0], anchors[:, k]) for k in range(3)]
    return np.asarray(np.stack(channels, axis=-1), dtype=np.uint8)
