"""Collection of transforms by edge, publisher and robot, from which the TF tree is made."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from tablemap.config import LimitsConfig
from tablemap.errors import RecordingError
from tablemap.geometry import Floats
from tablemap.recording.clocks import Lags
from tablemap.recording.messages import TransformStamped
from tablemap.recording.tf.frames import TransformEdge, TransformTree
from tablemap.recording.tf.tracks import (
    STATIC_METRES,
    STATIC_RADIANS,
    Conflict,
    Separated,
    Track,
    agree,
    joined,
    separate,
    spread,
)

FARTHEST = 1e6
"""Damaged messages may have any number: a place a thousand kilometres away is not valid."""


@dataclass
class _PoseSamples:
    """The samples of an edge from one publisher: stamps, seven numbers each, and the last one."""

    stamps: array[int] = field(default_factory=lambda: array("q"))
    poses: array[float] = field(default_factory=lambda: array("d"))
    latest: int = 0

    def add(self, stamp_ns: int, values: array[float], number: int) -> None:
        """Add a sample; of a run of equal samples only the first and the last are kept."""
        self.latest = number
        if self.poses[-14:] == values * 2 and self.stamps[-1] <= stamp_ns:
            self.stamps[-1] = stamp_ns
            return
        self.stamps.append(stamp_ns)
        self.poses.extend(values)


@dataclass(frozen=True)
class _Sender:
    """The sender of a transform: its topic's namespace, its channel, and whether it is static."""

    namespace: str
    publisher: int
    is_static: bool


class TransformCollector:
    """Gathers transforms into a `TransformTree`.

    ``rejected`` counts invalid transforms by parent, child and reason; it is set when the tree is
    made. ``lags`` has how long after their stamps the moving ones were logged.
    `add` raises `RecordingError` if there are more frames than the limits allow.
    """

    def __init__(self, limits: LimitsConfig | None = None) -> None:
        self._limits = limits or LimitsConfig()
        self.rejected: Counter[tuple[str, str, str]] = Counter()
        self.lags: dict[tuple[str, str], Lags] = {}
        self._misnamed: dict[tuple[str, str], int] = {}
        self._edges: dict[tuple[str, str], dict[_Sender, _PoseSamples]] = {}
        self._taken = 0

    def add(
        self,
        transform: TransformStamped,
        *,
        publisher: int = 0,
        namespace: str = "",
        log_ns: int | None = None,
    ) -> None:
        """Add a transform from its channel and namespace; ``log_ns`` is when it was logged."""
        key = (transform.parent_frame, transform.child_frame)
        if log_ns is not None and not transform.is_static:
            self.lags.setdefault(key, Lags()).add(log_ns - transform.stamp_ns)
        if key[0] == key[1] or not all(key):
            self._misnamed[key] = self._misnamed.get(key, 0) + 1
            return
        senders = self._edges.setdefault(key, {})
        if len(self._edges) > self._limits.frames:
            raise RecordingError(
                f"The recording has transforms between {len(self._edges)} frames or more, "
                f"{self._limits.over('frames')}; raise the limit if it is sound."
            )
        sender = _Sender(namespace, publisher, transform.is_static)
        if sender not in senders:
            senders[sender] = _PoseSamples()
        values = array("d", (*transform.translation, *transform.rotation))
        self._taken += 1
        senders[sender].add(transform.stamp_ns, values, self._taken)

    def robots(self) -> tuple[str, ...]:
        """Return, sorted, the namespaces that send the same edges with different motions."""
        found: set[str] = set()
        for senders in self._edges.values():
            tracks: dict[str, list[Track]] = {}
            for sender, samples in senders.items():
                track = _by_stamp(_sound(samples)[0])
                if not sender.is_static and len(track.stamps_ns):
                    tracks.setdefault(sender.namespace, []).append(track)
            if len(tracks) > 1:
                each = {name: joined(own) for name, own in tracks.items()}
                first = next(iter(each))
                found |= {
                    robot
                    for name in each
                    if name != first and not agree(each[first], each[name])
                    for robot in (first, name)
                }
        return tuple(sorted(found))

    def tree(self, *, without: Collection[str] = ()) -> TransformTree:
        """Return the tree of all transforms except those of some namespaces."""
        self.rejected = Counter(
            {
                (*key, "a frame that is its own parent, or has no name"): count
                for key, count in self._misnamed.items()
            }
        )
        edges = []
        for key, senders in self._edges.items():
            sent = {
                sender: samples
                for sender, samples in senders.items()
                if sender.namespace not in without
            }
            edge = self._edge(key, sent)
            if edge is not None:
                edges.append(edge)
        return TransformTree(edges, self._limits)

    @property
    def has_static(self) -> bool:
        """Whether a topic of static transforms has messages."""
        return any(sender.is_static for senders in self._edges.values() for sender in senders)

    def lost(self) -> str:
        """Say how many transforms were rejected, between which frames, and why."""
        shown = [
            f"{number} transforms from {parent or '(no name)'} to {child or '(no name)'} ({reason})"
            for (parent, child, reason), number in self.rejected.most_common()
        ]
        more = f" and of {len(shown) - 3} more frames" if len(shown) > 3 else ""
        return f"{', '.join(shown[:3])}{more} were left out, as they are no rigid motions."

    def _edge(
        self, key: tuple[str, str], senders: dict[_Sender, _PoseSamples]
    ) -> TransformEdge | None:
        moving: list[Track] = []
        static: list[Track] = []
        for sender, samples in sorted(senders.items(), key=lambda each: each[1].latest):
            track, unsound = _sound(samples)
            for reason, number in unsound.items():
                self.rejected[(*key, reason)] += number
            if len(track.stamps_ns):
                (static if sender.is_static else moving).append(track)
        if not moving:
            return _static_edge(key, static) if static else None
        source = separate([_by_stamp(track) for track in moving], static)
        track = source.track
        if np.ptp(track.poses, axis=0).max() == 0:
            track = Track(track.stamps_ns[-1:], track.poses[-1:])
        # Of several samples with one stamp the first counts, as in tf2.
        stamps, first = np.unique(track.stamps_ns, return_index=True)
        places, turns = track.poses[first, :3], track.poses[first, 3:]
        return TransformEdge(*key, stamps, places, turns, _conflict(key, source))


def _sound(samples: _PoseSamples) -> tuple[Track, Counter[str]]:
    """Return the valid samples in their order, and the number of others by reason."""
    stamps = np.array(samples.stamps, dtype=np.int64)
    poses = np.array(samples.poses).reshape(-1, 7)
    sent = np.linalg.norm(poses[:, 3:], axis=1)
    poses = np.where(np.abs(poses) < FARTHEST, poses, np.nan)
    norms = np.linalg.norm(poses[:, 3:], axis=1)
    finite = np.all(np.isfinite(poses), axis=1)
    sound = finite & (np.abs(norms - 1) < 0.1)
    reasons = {
        "a quaternion of zeros": finite & (sent < 1e-9),
        "a quaternion that is not of length 1": finite & ~sound & (sent >= 1e-9),
        "a place or turn that is no number, or too large": ~finite,
    }
    unsound = Counter({reason: int(np.sum(which)) for reason, which in reasons.items()})
    stamps, poses, norms = stamps[sound], poses[sound], norms[sound]
    poses[:, 3:] /= norms[:, None]
    return Track(stamps, poses), +unsound


def _by_stamp(track: Track) -> Track:
    order = np.argsort(track.stamps_ns, kind="stable")
    return Track(track.stamps_ns[order], track.poses[order])


def _static_edge(key: tuple[str, str], tracks: list[Track]) -> TransformEdge:
    """Return an edge that never moves; of several values the last one counts, as in tf2."""
    latest = tracks[-1]
    poses: Floats = np.concatenate([track.poses for track in tracks])
    metres, radians = spread(poses, latest.poses[-1])
    different = metres > STATIC_METRES or radians > STATIC_RADIANS
    conflict = Conflict(*key, 2, metres, radians) if different else None
    pose = latest.poses[-1:]
    return TransformEdge(*key, latest.stamps_ns[-1:], pose[:, :3], pose[:, 3:], conflict)


def _conflict(key: tuple[str, str], source: Separated) -> Conflict | None:
    if source.sources == 1:
        return None
    return Conflict(*key, source.sources, source.metres, source.radians)
