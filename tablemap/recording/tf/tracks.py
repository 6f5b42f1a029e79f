"""Detection of several sources that send one TF edge and disagree.

If two localisers, or two odometries, send the same edge, its samples alternate between two places.
Their interpolation would be a motion that never happened.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablemap.geometry import Bools, Floats, Ints

MAX_GAP_NS = 2_000_000_000
"""A longer gap is not interpolated, unless the edge stood still."""

CONFLICT_METRES = 0.02
CONFLICT_RADIANS = np.radians(1.0)
STATIC_METRES = 0.005
STATIC_RADIANS = np.radians(0.3)

_ARM = 0.5  # metres for a radian
_GATE_METRES = 0.01
_GATE_SPEEDS = 3.0  # times the usual speed of the edge: a faster sample belongs to another track
_FEWEST_JUMPS = 10
_FEWEST_SAMPLES = 10
_LEAST_SHARE = 0.05  # least share of all samples for a second source
_IN_TURN = 0.7  # least share of a source's samples with samples of another one between them
_LIFE_NS = 1_000_000_000  # a track without a sample for so long has ended
_LAGS = 5  # most sources that are distinguished


@dataclass(frozen=True, eq=False)
class Track:
    """Samples of an edge: (n,) stamps ascending, (n, 7) x, y, z and a unit quaternion xyzw."""

    stamps_ns: Ints
    poses: Floats


@dataclass(frozen=True)
class Conflict:
    """An edge whose ``sources`` disagree by up to ``metres`` and ``radians``.

    ``is_static``: it is sent as one that never moves, with several values.
    """

    parent: str
    child: str
    sources: int
    metres: float
    radians: float
    is_static: bool = False

    def __str__(self) -> str:
        apart = f"up to {self.metres:.2f} m and {np.degrees(self.radians):.1f} degrees"
        if self.is_static:
            return (
                f"The static transform from {self.parent} to {self.child} was sent with values "
                f"that lie {apart} apart; the last one was taken for the whole drive. Correct the "
                "sender that is wrong; if the sensor was moved or calibrated meanwhile, process "
                "the part since then (--start)."
            )
        number = {2: "Two", 3: "Three"}.get(self.sources, str(self.sources))
        return (
            f"{number} sources send the transform from {self.parent} to {self.child}, and disagree "
            f"by {apart}; the one that sent most was taken. Stop the others and record again."
        )


@dataclass(frozen=True, eq=False)
class Separated:
    """The samples of the source that sent most, and the conflict with the others, if any."""

    track: Track
    sources: int = 1
    metres: float = 0.0
    radians: float = 0.0


def separate(moving: Sequence[Track], static: Sequence[Track] = ()) -> Separated:
    """Divide an edge's samples by source, given one track for each publisher.

    Publishers that agree, or that take turns, are one source. A ``static`` publisher beside a
    moving one is another source if its values differ. If all messages came from one publisher,
    as far as the recording shows, continuity distinguishes the sources. The source with most
    samples is taken, of several such the first.
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
    """Tell whether two tracks were sent during the same time, and agree."""
    overlap, metres, radians = _apart(first, second)
    return overlap > 0 and not is_conflict(metres, radians)


def spread(poses: Floats, pose: Floats) -> tuple[float, float]:
    """Return the distance of poses (n, 7) from a pose (7,): 90th percentile, metres and radians."""
    metres = np.linalg.norm(poses[:, :3] - pose[:3], axis=1)
    radians = 2 * np.arccos(np.clip(np.abs(poses[:, 3:] @ pose[3:]), 0, 1))
    return float(np.quantile(metres, 0.9)), float(np.quantile(radians, 0.9))


def by_continuity(track: Track) -> list[Track]:
    """Divide a track whose samples alternate between places; the part with most samples is first.

    A track that jumps once and stays there, or that jitters, is not divided.
    """
    count = len(track.stamps_ns)
    if count < 2 * _FEWEST_SAMPLES:
        return [track]
    places, seconds = _places(track.poses), track.stamps_ns / 1e9
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    waits = np.maximum(np.diff(seconds), 1e-6)
    # A few samples always include one of the same source: the slowest step is the real motion.
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
        # A track that jumps to and fro stays at each place for a while; two sources alternate.
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
        # A source that jumps continues in a new track; a track that goes on is another source.
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
    """Return the share of the second's samples within the first, and their distance from it.

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
    """Return which stamps lie between two samples of a track without a gap."""
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
    """Return coordinates (n, 7) in metres, whose distances are those of the poses."""
    # The chord of a quaternion is half of its angle.
    return np.column_stack([poses[:, :3], 2 * _ARM * _aligned(poses[:, 3:])])


def _aligned(quaternions: Floats) -> Floats:
    """Return quaternions (n, 4), each with the sign that is nearer to the one before."""
    cosine = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    signs = np.cumprod(np.concatenate([[1.0], np.where(cosine < 0, -1.0, 1.0)]))
    return np.asarray(quaternions * signs[:, None])
