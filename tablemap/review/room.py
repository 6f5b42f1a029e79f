"""Room for labels in a view: where each is clear of the table, of lines and of other labels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import PIL.Image
import PIL.ImageDraw
import shapely
from numpy.typing import NDArray

from tablemap.geometry import Floats
from tablemap.masks import grown
from tablemap.review.clouds import raised

Size = tuple[int, int]
SIZE: Size = (640, 540)
"""Pixels of a view in a small window; in a larger one its labels need a smaller share of it."""
LOW: Size = (520, 300)
"""The same of a view that has half of the window's height."""
FIELD_OF_VIEW = math.radians(55.0)  # of the viewer, from above to below
NEAREST = 0.1  # metres before the eye
LETTER, ENDS, HIGH = 7.2, 10.0, 22.0  # pixels of a label
LABEL_DROP = 11.0  # the viewer writes labels this far below their points
FARTHEST, STEP = 180, 4  # pixels from a label's anchor
DIRECTIONS = 24
NEAR_STEPS = 10  # the nearest places, which are looked at first
CROSSED = 300  # pixels that a label hides for each other label that its leader would cross
SAMPLES = np.linspace(0.0, 1.0, 16)  # of the way from an anchor to its label
TURN_COST = 0.5  # of a label that stands where it should not point to, in its distance
LEAST_LEADER = 12.0  # pixels between a label and what it names, from which a line joins them


@dataclass(frozen=True)
class Eye:
    """Where a view's eye begins, and what it looks at: (3,) each, metres, in the map."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]

    def pixels(self, points: Floats, size: Size = SIZE) -> tuple[Floats, Floats]:
        """Return where points (..., 3) lie in a picture, and how far ahead they are, metres."""
        seen = (points - np.array(self.position)) @ self._axes
        depth = np.maximum(seen[..., 2], NEAREST)
        return np.array(size) / 2 + _focal(size) * seen[..., :2] / depth[..., None], depth

    def beside(self, point: Floats, pixels: Floats, size: Size = SIZE) -> Floats:
        """Return the point (3,) as far ahead as a point (3,), so many pixels (2,) beside it."""
        (_,), (depth,) = self.pixels(point[None], size)
        return np.asarray(point + self._axes[:, :2] @ pixels * float(depth) / _focal(size))

    @cached_property
    def _axes(self) -> Floats:
        """Return the directions to the right, down and ahead as columns (3, 3)."""
        ahead = np.subtract(self.target, self.position)
        ahead /= max(float(np.linalg.norm(ahead)), 1e-9)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= max(float(np.linalg.norm(right)), 1e-9)
        return np.column_stack([right, -np.cross(right, ahead), ahead])


def _focal(size: Size) -> float:
    return size[1] / 2 / math.tan(FIELD_OF_VIEW / 2)


@dataclass(frozen=True)
class PlacedNames:
    """Where labels are clear.

    - ``places``: a place (3,) for each label
    - ``leaders``: lines (2, 3) from what a label names to the label, for those that stepped aside
    """

    places: list[Floats]
    leaders: list[Floats]


class Room:
    """The picture of a view as its eye begins; what is drawn takes its room, labels look for it."""

    def __init__(self, eye: Eye, size: Size = SIZE) -> None:
        self.eye = eye
        self._size = size
        self._taken = PIL.Image.new("L", size, 0)
        self._draw = PIL.ImageDraw.Draw(self._taken)
        self._labels: list[tuple[Floats, Floats]] = []

    def copy(self) -> Room:
        """Return another room with the same things in it."""
        other = Room(self.eye, self._size)
        other._taken.paste(self._taken)
        other._labels = [*self._labels]
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

    def take_points(self, points: NDArray[np.floating], *, reach: int = 2) -> None:
        """Take the room of points (n, 3), each drawn ``reach`` pixels to every side."""
        places = self._on_picture(np.asarray(points, dtype=np.float64).reshape(-1, 3))
        wide, high = self._taken.size
        is_in = ((places >= 0) & (places < (wide, high))).all(axis=1)
        columns, rows = places[is_in].astype(int).T
        dots = np.zeros((high, wide), dtype=bool)
        dots[rows, columns] = True
        self._taken.paste(1, mask=PIL.Image.fromarray(grown(dots, 2 * reach + 1)))

    def names(
        self,
        texts: Sequence[str],
        anchors: NDArray[np.floating],
        *,
        away: NDArray[np.floating],
        shown: bool = True,
    ) -> PlacedNames:
        """Place labels one after the other near their ``anchors`` (n, 3); see `place`.

        ``away`` (n, 2), or (2,) for all, is tried first. A label without text, or that is not
        ``shown``, stays.
        """
        anchors = np.asarray(anchors, dtype=np.float64).reshape(-1, 3)
        directions = np.broadcast_to(away, (len(anchors), 2))
        placed = PlacedNames([], [])
        for text, anchor, direction in zip(texts, anchors, directions, strict=True):
            if not (shown and text) or not np.isfinite(anchor).all():
                placed.places.append(anchor)
                continue
            place = self.place(text, anchor, away=direction)
            placed.places.append(place)
            leader = self._leader(text, anchor, place)
            if leader is not None:
                placed.leaders.append(leader)
        return placed

    def _leader(self, text: str, anchor: Floats, place: Floats) -> Floats | None:
        """Return a line (2, 3) from an anchor to the nearest side of its label, if it is far."""
        (named, point), _ = self.eye.pixels(np.stack([anchor, place]), self._size)
        middle = point + np.array([0.0, LABEL_DROP])
        half = np.array([LETTER * len(text) + ENDS, HIGH]) / 2
        side = np.clip(named, middle - half, middle + half)
        if np.linalg.norm(side - named) < LEAST_LEADER:
            return None
        line = np.stack([anchor, self.eye.beside(place, side - point, self._size)])
        self.take_line(line, width=1)
        return line

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
        sides = np.clip(pixel, middle - half, middle + half)
        moved = np.linalg.norm(middle - middle[0, 0], axis=-1)
        moved = moved * (1 + TURN_COST * (1 - np.cos(turns)))
        ends, low, high = sides.reshape(-1, 2), middle - half, middle + half
        # Mostly one of the nearest is clear. Then what is farther need not be looked at.
        hidden = self._count(low[:NEAR_STEPS], high[:NEAR_STEPS]).ravel()
        near = np.where(hidden == 0, moved[:NEAR_STEPS].ravel(), np.inf)
        near[near >= moved[NEAR_STEPS:].min()] = np.inf
        flat = self._first_clear(pixel, ends, near)
        if flat is None:
            flat = self._clearest(pixel, ends, self._count(low, high).ravel(), moved.ravel())
        best = np.unravel_index(flat, moved.shape)
        if keeps:
            low, high = middle[best] - half, middle[best] + half
            self._draw.rectangle((*low, *high), fill=1)
            self._labels.append((low, high))
        return np.asarray(places[best])

    def _clearest(
        self, anchor: Floats, ends: Floats, hidden: NDArray[np.int64], moved: Floats
    ) -> int:
        """Return which place hides least, and is moved least of those.

        The leaders from an anchor (2,) to the ``ends`` (n, 2) count, and ``hidden`` (n,) pixels.
        """
        free = self._first_clear(anchor, ends, np.where(hidden == hidden.min(), moved, np.inf))
        if free is not None:
            return free
        hidden = hidden + CROSSED * self._crossed(anchor, ends)
        return int(np.lexsort((moved, hidden))[0])

    def _first_clear(self, anchor: Floats, ends: Floats, moved: Floats) -> int | None:
        """Return the first place whose leader from an anchor (2,) crosses no label.

        ``moved`` (n,) is the order of the places with the ``ends`` (n, 2); infinite ones are none.
        """
        free = np.flatnonzero(np.isfinite(moved))
        free = free[np.argsort(moved[free], kind="stable")]
        for first in range(0, len(free), DIRECTIONS):
            some = free[first : first + DIRECTIONS]
            clear = self._crossed(anchor, ends[some]) == 0
            if clear.any():
                return int(some[np.argmax(clear)])
        return None

    def _crossed(self, anchor: Floats, ends: Floats) -> NDArray[np.int64]:
        """Return how many labels a leader from an anchor (2,) to each of (..., 2) would cross."""
        crossed = np.zeros(ends.shape[:-1], dtype=np.int64)
        if not self._labels:
            return crossed
        ways = anchor + SAMPLES[:, None] * (ends - anchor)[..., None, :]
        for low, high in self._labels:
            crossed += ((ways > low) & (ways < high)).all(axis=-1).any(axis=-1)
        return crossed

    def _on_picture(self, points: Floats) -> Floats:
        return self.eye.pixels(points, self._size)[0]

    def _count(self, low: Floats, high: Floats) -> NDArray[np.int64]:
        """Return how many pixels are taken between corners (..., 2); all beside the picture are."""
        wanted = np.rint(np.stack([low, high])).astype(np.int64)
        corners = np.clip(wanted, 0, self._taken.size)
        beside = np.prod(wanted[1] - wanted[0], axis=-1) - np.prod(corners[1] - corners[0], axis=-1)
        # Sums over the part that the corners span: the whole picture is ten times as much.
        flat = corners.reshape(-1, 2)
        first, last = flat.min(axis=0), flat.max(axis=0)
        taken = np.asarray(self._taken.crop((*first.tolist(), *last.tolist())))
        sums = np.pad(taken.cumsum(axis=0, dtype=np.int32), ((1, 0), (1, 0)))
        sums = sums.cumsum(axis=1, dtype=np.int32)
        (left, above), (right, below) = np.moveaxis(corners - first, -1, 1)
        counts = sums[below, right] - sums[above, right] - sums[below, left] + sums[above, left]
        return np.asarray(beside + counts)
