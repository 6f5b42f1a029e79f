"""The TF tree over time: the recorded samples of edges, with lookup for many stamps at once.

Between two samples the place is interpolated linearly and the attitude on the great circle. Nothing
is extrapolated by more than `TOLERANCE_NS`. A gap longer than `MAX_GAP_NS` is interpolated only if
its ends agree (`GAP_METRES`, `GAP_RADIANS`), which bounds the error. An edge that is static, or
whose samples are all equal, is valid at any time, and so is an edge that is held.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from tablemap.config import LimitsConfig
from tablemap.errors import RecordingError
from tablemap.geometry import Bools, Floats, Ints
from tablemap.recording.tf.tracks import MAX_GAP_NS, Conflict

TOLERANCE_NS = 100_000_000
GAP_METRES = 0.05
GAP_RADIANS = 0.05

Stamps = Ints
"""Nanoseconds of sensor time."""


@dataclass(frozen=True, eq=False)
class TransformEdge:
    """``parent_from_child`` over time: (n,) stamps ascending, (n, 3) metres, (n, 4) xyzw.

    - ``conflict``: other sources sent the edge, too, with other values
    - ``is_held``: each sample is valid until the next one, the first one before it, too
    """

    parent: str
    child: str
    stamps_ns: Stamps
    translations: Floats
    quaternions: Floats
    conflict: Conflict | None = None
    is_held: bool = False

    @property
    def is_static(self) -> bool:
        """Whether the edge never changes."""
        return len(self.stamps_ns) == 1

    @cached_property
    def _constant(self) -> Floats:
        return np.asarray(_matrices(self.translations[:1], self.quaternions[:1])[0])

    @cached_property
    def _bridged(self) -> Bools:
        """A mask (n - 1,) of the gaps between samples that may be interpolated."""
        moved = np.linalg.norm(np.diff(self.translations, axis=0), axis=1)
        cosine = np.abs(np.sum(self.quaternions[1:] * self.quaternions[:-1], axis=1))
        turned = 2 * np.arccos(np.clip(cosine, 0, 1))
        agree = (moved <= GAP_METRES) & (turned <= GAP_RADIANS)
        return np.asarray(agree | (np.diff(self.stamps_ns) <= MAX_GAP_NS))

    def at(self, stamps_ns: Stamps) -> tuple[Floats, Bools]:
        """Return poses (n, 4, 4), and a mask (n,) of those covered by samples."""
        if self.is_static:
            shape = (len(stamps_ns), 4, 4)
            return np.broadcast_to(self._constant, shape), np.ones(len(stamps_ns), dtype=bool)
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, len(self.stamps_ns) - 1)
        before = after - 1
        since = stamps_ns - self.stamps_ns[before]
        until = self.stamps_ns[after] - stamps_ns
        fraction = np.clip(since / (since + until), 0.0, 1.0)
        valid = (since >= -TOLERANCE_NS) & (until >= -TOLERANCE_NS)
        near = np.minimum(np.abs(since), np.abs(until)) <= TOLERANCE_NS
        unbridged = ~self._bridged[before]
        valid &= near | ~unbridged
        # In a gap that may not be interpolated, a stamp close to a sample takes that sample.
        fraction = np.where(unbridged, np.rint(fraction), fraction)
        if self.is_held:
            fraction = np.where(valid | (until < 0), fraction, 0.0)
            valid = np.ones_like(valid)
        places = self.translations[before] * (1 - fraction[:, None])
        places += self.translations[after] * fraction[:, None]
        turns = slerp(self.quaternions[before], self.quaternions[after], fraction)
        return _matrices(places, turns), valid


class TransformTree:
    """The edges of a recording, by child and parent."""

    def __init__(self, edges: Iterable[TransformEdge], limits: LimitsConfig | None = None) -> None:
        self._limits = limits or LimitsConfig()
        self.edges: dict[str, list[TransformEdge]] = {}
        for edge in edges:
            self.edges.setdefault(edge.child, []).append(edge)
        self._ways: dict[tuple[str, str], tuple[list[TransformEdge], list[TransformEdge]]] = {}

    def with_edges(self, edges: Iterable[TransformEdge]) -> TransformTree:
        """Return a tree of other edges, with the limits of this one."""
        return TransformTree(edges, self._limits)

    @property
    def all_edges(self) -> tuple[TransformEdge, ...]:
        """The edges of all frames, in one row."""
        return tuple(edge for edges in self.edges.values() for edge in edges)

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """All frames, sorted by name."""
        parents = {edge.parent for edge in self.all_edges}
        return tuple(sorted(parents | set(self.edges)))

    def chain(self, frame: str) -> list[TransformEdge]:
        """Return the edges from a frame up to its root.

        Raises `RecordingError` if a frame on the way has several parents or is its own ancestor, or
        if the way is longer than the limits allow.
        """
        edges: list[TransformEdge] = []
        seen = {frame}
        while frame in self.edges:
            choices = self.edges[frame]
            if len(choices) > 1:
                names = " and ".join(sorted(repr(edge.parent) for edge in choices))
                raise RecordingError(
                    f"The TF frame {frame!r} has several parents ({names}), so that no pose can be "
                    "told; record with one publisher for each frame."
                )
            edges.append(choices[0])
            frame = choices[0].parent
            if frame in seen:
                raise RecordingError(
                    f"The TF frame {frame!r} is its own ancestor, so that no pose can be told; "
                    "record with one publisher for each frame."
                )
            seen.add(frame)
            if len(edges) > self._limits.frame_depth:
                raise RecordingError(
                    f"The TF frame {edges[0].child!r} hangs from a chain of {len(edges)} frames or "
                    f"more, {self._limits.over('frame_depth')}."
                )
        return edges

    def root(self, frame: str) -> str:
        """Return the root of the tree that a frame is in."""
        chain = self.chain(frame)
        return chain[-1].parent if chain else frame

    def connected(self, first: str, second: str) -> bool:
        """Tell whether the first frame has a pose in the tree of the second."""
        if first not in self.frames or second not in self.frames:
            return False
        root = self.root(second)
        try:
            return self.root(first) == root
        except RecordingError:
            return False

    def path(self, target: str, source: str) -> tuple[list[TransformEdge], list[TransformEdge]]:
        """Return the edges from the target, and from the source, up to their common ancestor.

        Raises `RecordingError` if the frames are not in one tree.
        """
        if (target, source) not in self._ways:
            self._ways[target, source] = self._way(target, source)
        return self._ways[target, source]

    def _way(self, target: str, source: str) -> tuple[list[TransformEdge], list[TransformEdge]]:
        for frame in (target, source):
            if frame not in self.frames:
                raise RecordingError(
                    f"The TF tree has no frame {frame!r}; its frames are {_listed(self.frames)}."
                )
        up_target, up_source = self.chain(target), self.chain(source)
        ancestors = [target, *(edge.parent for edge in up_target)]
        ascended = [source, *(edge.parent for edge in up_source)]
        for steps, frame in enumerate(ascended):
            if frame in ancestors:
                return up_target[: ancestors.index(frame)], up_source[:steps]
        raise RecordingError(
            f"The TF frames {target!r} and {source!r} are not connected: the one hangs from "
            f"{ancestors[-1]!r}, the other from {ascended[-1]!r}; record the transforms between."
        )

    def lookup(self, target: str, source: str, stamps_ns: ArrayLike) -> tuple[Floats, Bools]:
        """Return ``target_from_source`` (n, 4, 4) at (n,) stamps, and which of them are covered.

        Raises `RecordingError` if the frames are not connected.
        """
        stamps = np.atleast_1d(np.asarray(stamps_ns, dtype=np.int64))
        up_target, up_source = self.path(target, source)
        poses = np.broadcast_to(np.eye(4), (len(stamps), 4, 4))
        valid = np.ones(len(stamps), dtype=bool)
        for edge in up_source:
            edge_poses, covered = edge.at(stamps)
            poses = edge_poses @ poses
            valid &= covered
        back = np.broadcast_to(np.eye(4), (len(stamps), 4, 4))
        for edge in up_target:
            edge_poses, covered = edge.at(stamps)
            back = edge_poses @ back
            valid &= covered
        return (_inverses(back) @ poses if up_target else np.array(poses)), valid

    def moving_edges(self, target: str, source: str) -> list[TransformEdge]:
        """Return the edges between two frames that change over time."""
        up_target, up_source = self.path(target, source)
        return [edge for edge in (*up_target, *up_source) if not edge.is_static]


def slerp(first: Floats, second: Floats, fraction: Floats) -> Floats:
    """Interpolate (n, 4) unit quaternions on the shorter great circle by (n,) fractions."""
    cosine = np.sum(first * second, axis=1, keepdims=True)
    second = np.where(cosine < 0, -second, second)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    t = fraction[:, None]
    small = angle < 1e-4  # here the chord equals the arc, and the sine is too small a divisor
    sine = np.where(small, 1.0, np.sin(angle))
    weight_first = np.where(small, 1 - t, np.sin((1 - t) * angle) / sine)
    weight_second = np.where(small, t, np.sin(t * angle) / sine)
    mixed = weight_first * first + weight_second * second
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def _matrices(translations: Floats, quaternions: Floats) -> Floats:
    matrices = np.zeros((len(translations), 4, 4))
    if len(translations):
        matrices[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    matrices[:, :3, 3] = translations
    matrices[:, 3, 3] = 1.0
    return matrices


def _inverses(poses: Floats) -> Floats:
    inverses = np.zeros_like(poses)
    turned = np.swapaxes(poses[:, :3, :3], 1, 2)
    inverses[:, :3, :3] = turned
    inverses[:, :3, 3] = -(turned @ poses[:, :3, 3:])[..., 0]
    inverses[:, 3, 3] = 1.0
    return inverses


def _listed(names: Iterable[str], most: int = 12) -> str:
    names = list(names)
    shown = ", ".join(names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown or "none"
