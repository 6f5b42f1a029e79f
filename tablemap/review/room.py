"""Room for labels in a view: where each is clear of the table, of lines and of other labels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import PIL.Image
import PIL.ImageDraw
import shapely
from numpy.typing import NDArray

from tablemap.geometry import Floats
from tablemap.review.clouds import raised

Size = tuple[int, int]
SIZE: Size = (640, 540)
"""Pixels of a view in a small window; in a larger one its labels need a smaller share of it."""
LOW: Size = (520, 300)
"""The same of a view that has half of the window's height."""
FIELD_OF_VIEW = math.radians(55.0)  # of the viewer, from above to below
NEAREST = 0.1  # metres before the eye
BORDER = 220  # pixels round the picture that count as taken: as wide as a long label
LETTER, ENDS, HIGH = 7.2, 10.0, 22.0  # pixels of a label
LABEL_DROP = 11.0  # the viewer writes labels this far below their points
FARTHEST, STEP = 180, 4  # pixels from a label's anchor
DIRECTIONS = 24
TURN_COST = 0.5  # of a label that stands where it should not point to, in its distance


@dataclass(frozen=True)
class Eye:
    """Where a view's eye begins, and what it looks at: (3,) each, metres, in the map."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]

    def pixels(self, points: Floats, size: Size = SIZE) -> tuple[Floats, Floats]:
        """Return where points (..., 3) lie in a picture, and how far ahead they are, metres."""
        ahead = np.subtract(self.target, self.position)
        ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= max(float(np.linalg.norm(right)), 1e-9)
        seen = (points - np.array(self.position)) @ np.column_stack(
            [right, -np.cross(right, ahead), ahead]
        )
        depth = np.maximum(seen[..., 2], NEAREST)
        return np.array(size) / 2 + _focal(size) * seen[..., :2] / depth[..., None], depth


def _focal(size: Size) -> float:
    return size[1] / 2 / math.tan(FIELD_OF_VIEW / 2)


class Room:
    """The picture of a view as its eye begins; what is drawn takes its room, labels look for it."""

    def __init__(self, eye: Eye, size: Size = SIZE) -> None:
        self.eye = eye
        self._size = size
        wide, high = size
        self._taken = PIL.Image.new("L", (wide + 2 * BORDER, high + 2 * BORDER), 1)
        self._draw = PIL.ImageDraw.Draw(self._taken)
        self._draw.rectangle((BORDER, BORDER, BORDER + wide, BORDER + high), fill=0)

    def copy(self) -> Room:
        """Return another room with the same things in it."""
        other = Room(self.eye, self._size)
        other._taken.paste(self._taken)
        return other

    def take_solid(self, outline: Floats, bottom: float, top: float) -> None:
        """Take the room of a prism over an outline (n, 2), between two heights."""
        levels = [raised(outline, one).astype(np.float64) for one in (bottom, top)]
        hull = shapely.MultiPoint(self._on_picture(np.concatenate(levels))).convex_hull
        if hull.geom_type == "Polygon":
            self._draw.polygon([tuple(one) for one in hull.exterior.coords], fill=1)

    def take_line(self, points: NDArray[np.floating], *, width: int = 3) -> None:
        """Take the room of a line (n, 3)."""
        places = self._on_picture(np.asarray(points, dtype=np.float64))
        self._draw.line([tuple(one) for one in places], fill=1, width=width)

    def place(self, text: str, anchor: Floats, *, away: Floats, keeps: bool = True) -> Floats:
        """Return the place (3,) near ``anchor`` (3,), level with it, at which a label is clear.

        ``away`` (2,) is the direction in the map that is tried first. Where there is no clear
        place it is the one that hides least. With ``keeps`` the label takes its room.
        """
        (pixel,), (depth,) = self.eye.pixels(anchor[None], self._size)
        is_in = ((pixel >= 0) & (pixel < self._size)).all()
        if not is_in:
            return anchor
        turns = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        steps = np.arange(0, FARTHEST, STEP)
        first = math.atan2(away[1], away[0])
        level = np.column_stack([np.cos(first + turns), np.sin(first + turns), 0 * turns])
        places = anchor + steps[:, None, None] * (float(depth) / _focal(self._size)) * level
        seen = self.eye.pixels(places, self._size)[0]
        half = np.array([LETTER * len(text) + ENDS, HIGH]) / 2
        middle = seen + np.array([0.0, LABEL_DROP])
        hidden = self._count(middle - half, middle + half)
        moved = np.linalg.norm(middle - middle[0, 0], axis=-1)
        moved = moved * (1 + TURN_COST * (1 - np.cos(turns)))
        best = np.unravel_index(np.lexsort((moved.ravel(), hidden.ravel()))[0], moved.shape)
        if keeps:
            low, high = (middle[best] - half + BORDER, middle[best] + half + BORDER)
            self._draw.rectangle((*low, *high), fill=1)
        return np.asarray(places[best])

    def _on_picture(self, points: Floats) -> Floats:
        return self.eye.pixels(points, self._size)[0] + BORDER

    def _count(self, low: Floats, high: Floats) -> NDArray[np.int32]:
        """Return how many pixels are taken between corners (..., 2)."""
        corners = np.rint(np.stack([low, high]) + BORDER).astype(int)
        corners = np.clip(corners, 0, self._taken.size)
        # Sums over the part that the corners span: the whole picture is ten times as much.
        flat = corners.reshape(-1, 2)
        first, last = flat.min(axis=0), flat.max(axis=0)
        taken = np.asarray(self._taken.crop((*first.tolist(), *last.tolist())))
        sums = np.pad(taken.cumsum(axis=0, dtype=np.int32), ((1, 0), (1, 0)))
        sums = sums.cumsum(axis=1, dtype=np.int32)
        (left, above), (right, below) = np.moveaxis(corners - first, -1, 1)
        counts: NDArray[np.int32] = sums[below, right] - sums[above, right]
        counts += sums[above, left] - sums[below, left]
        return counts
