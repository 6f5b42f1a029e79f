"""Whether the samples of a TF edge come from one source, or from several that disagree.

Two localisers, or two odometries, that send the same edge make a track that alternates between two
places. Interpolated, it would be a motion that never was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Bools, Floats, Ints

MAX_GAP_NS = 2_000_000_000
"""Over a longer gap nothing is interpolated, unless the edge stood still."""

CONFLICT_METRES = 0.02
CONFLICT_RADIANS = np.radians(1.0)
STATIC_METRES = 0.005
STATIC_RADIANS = np.radians(0.3)

_ARM = 0.5  # metres that a radian counts as
_GATE_METRES = 0.01
_GATE_SPEEDS = 3.0  # times the usual speed of the edge, that a sample may be away from its track
_FEWEST_JUMPS = 10
_FEWEST_SAMPLES = 10
_LEAST_SHARE = 0.05  # of all samples, that a second source sends
_IN_TURN = 0.7  # of a source's samples, between which samples of another lie
_LIFE_NS = 1_000_000_000  # a track that got no sample for so long has ended
_LAGS = 5  # sources that are told apart


@dataclass(frozen=True, eq=False)
class Track:
    """Samples of an edge: (n,) stamps ascending, (n, 7) x, y, z and a unit quaternion xyzw."""

    stamps_ns: Ints
    poses: Floats


@dataclass(frozen=True)
class Conflict:
    """An edge of which ``sources`` disagree by up to so many metres and radians."""

    parent: str
    child: str
    sources: int
    metres: float
    radians: float

    def __str__(self) -> str:
        number = {2: "Two", 3: "Three"}.get(self.sources, str(self.sources))
        return (
            f"{number} sources send the transform from {self.parent} to {self.child}, and disagree "
            f"by up to {self.metres:.2f} m and {np.degrees(self.radians):.1f} degrees"
        )


@dataclass(frozen=True, eq=False)
class Separated:
    """The samples of the source that sent most, and how far the others are off, if they are."""

    track: Track
    sources: int = 1
    metres: float = 0.0
    radians: float = 0.0


def separate(moving: Sequence[Track], static: Sequence[Track] = ()) -> Separated:
    """Part an edge's samples by source, given one track for each publisher.

    Publishers that agree, or that take turns, are one source; what a ``static`` one sends beside a
    moving one is another where it differs. Where each message came from the same publisher, as far
    as the recording tells, sources are told apart by continuity. The one with most samples is
    taken, of several such the first.
    """
    ordered = sorted(moving, key=lambda track: (-len(track.stamps_ns), track.stamps_ns[0]))
    main, off = ordered[0], list[tuple[float, float]]()
    for track in ordered[1:]:
        overlap, metres, radians = _apart(main, track)
        if overlap >= _FEWEST_SAMPLES and is_conflict(metres, radians):
            off.append((metres, radians))
        else:
            main = joined([main, track])
    sources = by_continuity(main)
    off += [_apart(sources[0], track)[1:] for track in sources[1:]]
    for track in static:
        metres, radians = spread(sources[0].poses, track.poses[-1])
        if is_conflict(metres, radians):
            off.append((metres, radians))
    if not off:
        return Separated(sources[0])
    return Separated(sources[0], 1 + len(off), max(m for m, _ in off), max(r for _, r in off))


def is_conflict(metres: float, radians: float) -> bool:
    """Tell whether sources of one edge are so far apart that one of them is wrong."""
    return metres > CONFLICT_METRES or radians > CONFLICT_RADIANS


def agree(first: Track, second: Track) -> bool:
    """Tell whether two tracks were sent at the same time, and are the same."""
    overlap, metres, radians = _apart(first, second)
    return overlap > 0 and not is_conflict(metres, radians)


def spread(poses: Floats, pose: Floats) -> tuple[float, float]:
    """Return how far (n, 7) poses are from another (7,): 90th percentile, metres and radians."""
    metres = np.linalg.norm(poses[:, :3] - pose[:3], axis=1)
    radians = 2 * np.arccos(np.clip(np.abs(poses[:, 3:] @ pose[3:]), 0, 1))
    return float(np.quantile(metres, 0.9)), float(np.quantile(radians, 0.9))


def by_continuity(track: Track) -> list[Track]:
    """Part a track where its samples alternate between places; the one with most samples first.

    A track that jumps and stays there, or jitters, is one.
    """
    count = len(track.stamps_ns)
    if count < 2 * _FEWEST_SAMPLES:
        return [track]
    places, seconds = _places(track.poses), track.stamps_ns / 1e9
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    waits = np.maximum(np.diff(seconds), 1e-6)
    # Among a few samples there is always one of the same source: the slowest step is its motion.
    speed = np.full(count - _LAGS, np.inf)
    for lag in range(1, _LAGS + 1):
        step = np.linalg.norm(places[lag:] - places[:-lag], axis=1)
        slow = step / np.maximum(seconds[lag:] - seconds[:-lag], 1e-6)
        speed = np.minimum(speed, slow[: len(speed)])
    usual = _GATE_SPEEDS * float(np.quantile(speed, 0.9))
    if int(np.sum(steps > usual * waits + _GATE_METRES)) < _FEWEST_JUMPS:
        return [track]
    sources = _sources(track.stamps_ns, places, usual)
    least = max(_FEWEST_SAMPLES, _LEAST_SHARE * count)
    parts = [Track(track.stamps_ns[own], track.poses[own]) for own in sources if len(own) >= least]
    parts.sort(key=lambda part: (-len(part.stamps_ns), part.stamps_ns[0]))
    kept = parts[:1]
    for part in parts[1:]:
        overlap, far, turned = _apart(kept[0], part)
        own = np.linalg.norm(np.diff(_places(part.poses), axis=0), axis=1)
        clear = far + _ARM * turned > 4 * float(np.median(own))
        # One that jumps to and fro stays at each place for a while; two sources send in turn.
        before = np.searchsorted(kept[0].stamps_ns, part.stamps_ns)
        clear &= float(np.mean(np.diff(before) > 0)) > _IN_TURN
        if clear and overlap >= least and is_conflict(far, turned):
            kept.append(part)
    return kept if len(kept) > 1 else [track]


def _sources(stamps_ns: Ints, places: Floats, usual: float) -> list[Ints]:
    """Give each sample to the track that it continues; tracks that follow on are one source."""
    tracks: list[list[int]] = []
    speeds: list[Floats] = []
    alive: list[int] = []
    for i, stamp in enumerate(stamps_ns.tolist()):
        alive = [k for k in alive if stamp - stamps_ns[tracks[k][-1]] <= _LIFE_NS]
        best, least = -1, np.inf
        for k in alive:
            seconds = (stamp - int(stamps_ns[tracks[k][-1]])) / 1e9
            away = places[i] - places[tracks[k][-1]] - speeds[k] * seconds
            distance = float(np.sqrt(away @ away))
            if distance <= usual * seconds + _GATE_METRES and distance < least:
                best, least = k, distance
        if best < 0:
            alive.append(len(tracks))
            tracks.append([i])
            speeds.append(np.zeros(places.shape[1]))
            continue
        last = tracks[best][-1]
        seconds = max((stamp - int(stamps_ns[last])) / 1e9, 1e-6)
        speeds[best] = (places[i] - places[last]) / seconds
        tracks[best].append(i)
    chains: list[list[int]] = []
    for track in tracks:
        # A source that jumps goes on in a new track; one that still goes on is another.
        ended = [chain for chain in chains if chain[-1] < track[0]]
        if ended:
            start = places[track[0]]
            min(ended, key=lambda chain: float(np.sum((places[chain[-1]] - start) ** 2))).extend(
                track
            )
        else:
            chains.append(list(track))
    return [np.array(chain, dtype=np.int64) for chain in chains]


def _apart(first: Track, second: Track) -> tuple[int, float, float]:
    """Return how many samples of the second lie within the first, and how far these are off.

    The distance is the 90th percentile in metres and radians.
    """
    inside = _within(first, second.stamps_ns)
    stamps, poses = second.stamps_ns[inside], second.poses[inside]
    if len(stamps) == 0:
        return 0, 0.0, 0.0
    at = stamps.astype(np.float64)
    known = first.stamps_ns.astype(np.float64)
    turns = _aligned(first.poses[:, 3:])
    own = np.column_stack(
        [np.interp(at, known, column) for column in (*first.poses[:, :3].T, *turns.T)]
    )
    metres = np.linalg.norm(own[:, :3] - poses[:, :3], axis=1)
    norms = np.maximum(np.linalg.norm(own[:, 3:], axis=1), 1e-12)
    cosine = np.abs(np.sum(own[:, 3:] * poses[:, 3:], axis=1)) / norms
    radians = 2 * np.arccos(np.clip(cosine, 0, 1))
    return len(stamps), float(np.quantile(metres, 0.9)), float(np.quantile(radians, 0.9))


def _within(track: Track, stamps_ns: Ints) -> Bools:
    """Return which stamps lie between two samples of a track that are no gap apart."""
    if len(track.stamps_ns) < 2:
        return np.zeros(len(stamps_ns), dtype=bool)
    after = np.clip(np.searchsorted(track.stamps_ns, stamps_ns), 1, len(track.stamps_ns) - 1)
    first, last = track.stamps_ns[after - 1], track.stamps_ns[after]
    between = (first <= stamps_ns) & (stamps_ns <= last)
    return np.asarray(between & (last - first <= MAX_GAP_NS))


def joined(tracks: Sequence[Track]) -> Track:
    """Return the samples of all tracks by their stamps."""
    stamps = np.concatenate([track.stamps_ns for track in tracks])
    poses = np.concatenate([track.poses for track in tracks])
    order = np.argsort(stamps, kind="stable")
    return Track(stamps[order], poses[order])


def _places(poses: Floats) -> Floats:
    """Return (n, 7) coordinates in metres, in which near poses are near."""
    # The chord of a quaternion is half of its angle.
    return np.column_stack([poses[:, :3], 2 * _ARM * _aligned(poses[:, 3:])])


def _aligned(quaternions: Floats) -> Floats:
    """Return (n, 4) quaternions, each of the sign that is nearer to the one before."""
    cosine = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    signs = np.cumprod(np.concatenate([[1.0], np.where(cosine < 0, -1.0, 1.0)]))
    return np.asarray(quaternions * signs[:, None])
