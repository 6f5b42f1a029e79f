"""Collection of transforms by edge, publisher and robot, from which the TF tree is made."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from tablemap.config import LimitsConfig
from tablemap.errors import RecordingError
from tablemap.geometry import Floats, Ints
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
from tablemap.words import counted

FARTHEST = 2e7
"""Damaged messages may have any number: a place farther away is not on Earth (UTM, ECEF)."""
LONE_SHARE = 20
"""What is said by so many times fewer messages than something else is not believed."""
A_HABIT = 10
"""Transforms of one edge, all of them invalid: more than damage makes."""


@dataclass
class _PoseSamples:
    """The samples of an edge from one publisher: stamps, seven numbers each, and the last one.

    ``counts`` are the messages that each stands for.
    """

    stamps: array[int] = field(default_factory=lambda: array("q"))
    poses: array[float] = field(default_factory=lambda: array("d"))
    counts: array[int] = field(default_factory=lambda: array("q"))
    latest: int = 0

    def add(self, stamp_ns: int, values: array[float], number: int) -> None:
        """Add a sample; of a run of equal samples only the first and the last are kept."""
        self.latest = number
        if self.poses[-14:] == values * 2 and self.stamps[-1] <= stamp_ns:
            self.stamps[-1] = stamp_ns
            self.counts[-1] += 1
            return
        self.stamps.append(stamp_ns)
        self.poses.extend(values)
        self.counts.append(1)


@dataclass(frozen=True)
class _Sender:
    """The sender of a transform: its topic's namespace, its channel, and whether it is static."""

    namespace: str
    publisher: int
    is_static: bool


class TransformCollector:
    """Gathers transforms into a `TransformTree`.

    ``rejected`` counts invalid transforms by parent, child and reason; it is set when the tree is
    made. ``never_valid`` are those of edges that nobody ever sent valid: no damage, but a node that
    does not know them. ``lags`` has how long after their stamps the moving ones were logged.
    `add` raises `RecordingError` if there are more frames than the limits allow.
    """

    def __init__(self, limits: LimitsConfig | None = None) -> None:
        self._limits = limits or LimitsConfig()
        self.rejected: Counter[tuple[str, str, str]] = Counter()
        self.never_valid: Counter[tuple[str, str, str]] = Counter()
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
        self.never_valid = Counter()
        sent = {
            key: {
                sender: samples
                for sender, samples in senders.items()
                if sender.namespace not in without
            }
            for key, senders in self._edges.items()
        }
        lone = _lone_parents(sent)
        self.rejected.update(lone)
        left_out = {(parent, child) for parent, child, _ in lone}
        edges = [self._edge(key, own) for key, own in sent.items() if key not in left_out]
        return TransformTree([edge for edge in edges if edge is not None], self._limits)

    @property
    def has_static(self) -> bool:
        """Whether a topic of static transforms has messages."""
        return any(sender.is_static for senders in self._edges.values() for sender in senders)

    def lost(self) -> str:
        """Say how many transforms were rejected, between which frames, and why."""
        shown = [
            f"{counted(number, 'transform')} from {parent or '(no name)'} to "
            f"{child or '(no name)'} ({reason})"
            for (parent, child, reason), number in (
                *self.rejected.most_common(),
                *self.never_valid.most_common(),
            )
        ]
        more = f" and of {len(shown) - 3} more frames" if len(shown) > 3 else ""
        return f"{', '.join(shown[:3])}{more} were left out."

    def _edge(
        self, key: tuple[str, str], senders: dict[_Sender, _PoseSamples]
    ) -> TransformEdge | None:
        moving: list[Track] = []
        static: list[Track] = []
        counts: list[Ints] = []
        left_out: Counter[tuple[str, str, str]] = Counter()
        for sender, samples in sorted(senders.items(), key=lambda each: each[1].latest):
            track, own_counts, unsound = _sound(samples)
            for reason, number in unsound.items():
                left_out[(*key, reason)] += number
            if not len(track.stamps_ns):
                continue
            if sender.is_static:
                static.append(track)
                counts.append(own_counts)
            else:
                moving.append(track)
        is_habit = not moving and not static and left_out.total() >= A_HABIT
        (self.never_valid if is_habit else self.rejected).update(left_out)
        if static:
            static, lone = _agreed(static, counts)
            if lone:
                self.rejected[(*key, "nearly all others have it elsewhere")] += lone
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


def _lone_parents(
    sent: Mapping[tuple[str, str], Mapping[_Sender, _PoseSamples]],
) -> Counter[tuple[str, str, str]]:
    """Return the edges, with why and how often, whose child nearly always has another parent.

    One wrong letter makes such an edge, and would leave the child with two parents.
    """
    counts: dict[tuple[str, bool], Counter[str]] = {}
    for (parent, child), senders in sent.items():
        for sender, samples in senders.items():
            own = counts.setdefault((child, sender.is_static), Counter())
            own[parent] += sum(samples.counts)
    lone: Counter[tuple[str, str, str]] = Counter()
    for (child, is_static), parents in counts.items():
        (usual, most), *others = parents.most_common()
        for parent, count in others:
            elsewhere = counts.get((child, not is_static), Counter())
            if count * LONE_SHARE <= most and parent not in elsewhere:
                lone[(parent, child, f"{most} others have it below {usual}")] += count
    return lone


def _sound(samples: _PoseSamples) -> tuple[Track, Ints, Counter[str]]:
    """Return the valid samples in their order with their counts, and the others by reason."""
    stamps = np.array(samples.stamps, dtype=np.int64)
    counts = np.array(samples.counts, dtype=np.int64)
    poses = np.array(samples.poses).reshape(-1, 7)
    with np.errstate(over="ignore"):  # damaged ones may have any number
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
    unsound = Counter({reason: int(counts[which].sum()) for reason, which in reasons.items()})
    stamps, poses, norms = stamps[sound], poses[sound], norms[sound]
    poses[:, 3:] /= norms[:, None]
    return Track(stamps, poses), counts[sound], +unsound


def _agreed(tracks: list[Track], counts: list[Ints]) -> tuple[list[Track], int]:
    """Return static transforms without values that hardly a message has, and those messages."""
    _, which = np.unique(
        np.concatenate([track.poses for track in tracks]), axis=0, return_inverse=True
    )
    weights = np.concatenate(counts)
    totals = np.bincount(which.ravel(), weights=weights)
    is_kept = (totals * LONE_SHARE > totals.max())[which.ravel()]
    parts = np.split(is_kept, np.cumsum([len(own) for own in counts])[:-1])
    kept = [
        Track(track.stamps_ns[part], track.poses[part])
        for track, part in zip(tracks, parts, strict=True)
        if part.any()
    ]
    return kept, int(weights[~is_kept].sum())


def _by_stamp(track: Track) -> Track:
    order = np.argsort(track.stamps_ns, kind="stable")
    return Track(track.stamps_ns[order], track.poses[order])


def _static_edge(key: tuple[str, str], tracks: list[Track]) -> TransformEdge:
    """Return an edge that never moves; of several values the last one counts, as in tf2."""
    latest = tracks[-1]
    poses: Floats = np.concatenate([track.poses for track in tracks])
    metres, radians = spread(poses, latest.poses[-1])
    different = metres > STATIC_METRES or radians > STATIC_RADIANS
    conflict = Conflict(*key, 2, metres, radians, is_static=True) if different else None
    pose = latest.poses[-1:]
    return TransformEdge(*key, latest.stamps_ns[-1:], pose[:, :3], pose[:, 3:], conflict)


def _conflict(key: tuple[str, str], source: Separated) -> Conflict | None:
    if source.sources == 1:
        return None
    return Conflict(*key, source.sources, source.metres, source.radians)
