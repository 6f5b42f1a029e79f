"""Whether anything confirms the headings of views registered by their depth, or contradicts them.

A round top's edges fit at any heading. Then only two things tie a view's heading to the others':
the wheels, and upright surfaces behind the table that another view saw too.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.stages.registration.depth.check import Checked, statistics_of
from tablemap.stages.registration.depth.edges import turning_edges
from tablemap.stages.registration.depth.sight import Sighting, UprightSight, sighting
from tablemap.stages.registration.result import StopCheck, StopScan

# The limits lie between right registrations of simulated tables and ones that were made wrong on
# purpose. Both include walking people and furniture that is moved.
_LEAST_POINTS = 40
_PARTNERS = 4  # the other views that share most of a view's sight
_GOOD_SCORE = 0.45
_SMALL_VIOLATION = 0.15
_BAD_SCORE = 0.35
_MARGIN = 0.1
_BETTER = 0.3  # of score: a turned pose that fits so much better shows that this one is wrong
_TURNS = np.radians([-30, -25, -20, -16, -12, -9, -6, 6, 9, 12, 16, 20, 25, 30])


@dataclass(frozen=True)
class _Company:
    """The views in groups whose members' headings are tied to each other."""

    group: dict[int, int]

    def tie(self, first: int, second: int) -> None:
        """Make one group of two views' groups."""
        gone, kept = self.group[first], self.group[second]
        self.group.update({i: kept for i, group in self.group.items() if group == gone})

    def tied(self, first: int, second: int) -> bool:
        """Tell whether two views are in one group."""
        return self.group[first] == self.group[second]

    def greater_half(self, counted: Collection[int]) -> frozenset[int]:
        """Return the group with more than half of the counted views, empty where there is none."""
        groups = [self.group[i] for i in counted]
        largest = max(groups, key=groups.count, default=-1)
        members = frozenset(i for i, group in self.group.items() if group == largest)
        return members if 2 * groups.count(largest) > len(groups) else frozenset()


def check_headings(
    checked: Checked,
    sights: Mapping[int, UprightSight],
    edges: Sequence[StopScan | None],
    poses: Floats,
    ties: Iterable[tuple[int, int]],
) -> tuple[tuple[StopCheck, ...], tuple[ProcessWarning, ...]]:
    """Check the headings of the views that passed so far, at ``poses`` (n, 3).

    ``ties`` are pairs of views whose relative heading is known from elsewhere, as from the wheels.
    Edges tie a view to all others where any turn about the top fits clearly worse. Uprights tie
    two views where they fit, and any turn fits clearly worse. A view fails where its uprights
    contradict another view's. It still passes where it is tied to more than half of the views that
    show the top, as people walk. The warning names the views that show the top and that nothing
    ties to such a half.
    """
    views = [check.index for check in checked.checks if check.passed]
    if len(views) < 2:
        return checked.checks, ()
    located = [Pose2.from_array(pose) for pose in poses]
    centre = _centre(edges, located, views)
    sightings = _sightings(sights, located, views)
    company = _Company({i: i for i in views})
    against = {
        pair
        for pair, seen in sightings.items()
        if seen.score < _BAD_SCORE
        and (
            seen.violation > _SMALL_VIOLATION
            or _best_turned(sights, located, pair, centre) > seen.score + _BETTER
        )
    }
    for first, second in ties:
        if {first, second} <= company.group.keys() and (
            max(first, second),
            min(first, second),
        ) not in against:
            company.tie(first, second)
    turning = turning_edges({i: edges[i] for i in views}, located, list(_turns(centre)))
    for first, second in itertools.pairwise(turning):
        company.tie(first, second)
    for pair, seen in sightings.items():
        if company.tied(*pair) or seen.score < _GOOD_SCORE or seen.violation > _SMALL_VIOLATION:
            continue
        if seen.score > _best_turned(sights, located, pair, centre) + _MARGIN:
            company.tie(*pair)
    # A view without an edge of the top says nothing about the top, whatever its heading.
    showing = [i for i in views if edges[i] is not None] or views
    tied = company.greater_half(showing)
    checks = tuple(
        _judged(check, sightings, against, tied) if check.passed else check
        for check in checked.checks
    )
    unknown = [i for i in showing if checks[i].passed and i not in tied]
    return checks, _unchecked(unknown)


def _judged(
    check: StopCheck,
    sightings: Mapping[tuple[int, int], Sighting],
    against: Iterable[tuple[int, int]],
    tied: frozenset[int],
) -> StopCheck:
    own = [seen for pair, seen in sightings.items() if check.index in pair]
    points = sum(seen.points for seen in own)
    statistics = replace(
        statistics_of(check), heading_tied=check.index in tied, upright_points=points
    )
    if points:
        statistics = replace(
            statistics,
            upright_score=sum(seen.points * seen.score for seen in own) / points,
            upright_violation=sum(seen.points * seen.violation for seen in own) / points,
        )
    others = sum(check.index in pair for pair in against)
    reasons: tuple[str, ...] = ()
    if others and check.index not in tied:
        views = "another view" if others == 1 else f"{others} other views"
        reasons = (f"its upright surfaces contradict {views}, and nothing confirms its heading",)
    return replace(
        check,
        passed=not reasons,
        statistics=statistics,
        reasons=(*check.reasons, *reasons),
    )


def _unchecked(unknown: Sequence[int]) -> tuple[ProcessWarning, ...]:
    if not unknown:
        return ()
    message = (
        f"nothing confirms the heading of snapshots {', '.join(map(str, unknown))}: there are no "
        "wheels, no upright surface that another view saw too, and no edge that fits in one way "
        "alone; record wheel odometry or a laser, or views that overlap more"
    )
    code = "accuracy.registration_unchecked"
    return (ProcessWarning(code, "registration", message),)


def _sightings(
    sights: Mapping[int, UprightSight], located: Sequence[Pose2], views: Sequence[int]
) -> dict[tuple[int, int], Sighting]:
    """Return the (later, earlier) pairs that share enough: the ``_PARTNERS`` best of each view."""
    every = {
        (i, j): seen
        for j, i in itertools.combinations([i for i in views if i in sights], 2)
        if (seen := _sighting(sights, located, (i, j))).points >= _LEAST_POINTS
    }
    chosen = set()
    for view in views:
        own = sorted((-seen.points, pair) for pair, seen in every.items() if view in pair)
        chosen |= {pair for _, pair in own[:_PARTNERS]}
    return {pair: seen for pair, seen in every.items() if pair in chosen}


def _sighting(
    sights: Mapping[int, UprightSight],
    located: Sequence[Pose2],
    pair: tuple[int, int],
    moved: Pose2 | None = None,
) -> Sighting:
    first, second = pair
    pose = located[first] if moved is None else moved @ located[first]
    return sighting(sights[first], sights[second], located[second].inverse() @ pose)


def _best_turned(
    sights: Mapping[int, UprightSight],
    located: Sequence[Pose2],
    pair: tuple[int, int],
    centre: Floats,
) -> float:
    """Return the best score of a pair with one view turned about the table, or on its spot."""
    least = max(_LEAST_POINTS, _sighting(sights, located, pair).points // 2)
    scores = [0.0]
    for moved in itertools.chain(_turns(centre), _turns(located[pair[0]].translation)):
        seen = _sighting(sights, located, pair, moved)
        # With few points left in sight anything fits.
        if seen.points >= least:
            scores.append(seen.score)
    return max(scores)


def _turns(centre: Floats) -> Iterator[Pose2]:
    for turn in _TURNS:
        about = Pose2(float(centre[0]), float(centre[1]), 0.0)
        yield about @ Pose2(0.0, 0.0, float(turn)) @ about.inverse()


def _centre(
    edges: Sequence[StopScan | None], located: Sequence[Pose2], views: Sequence[int]
) -> Floats:
    """Return the middle (2,) of the top's edges, or of the views where there are none."""
    seen = [located[i].apply(edge.points) for i in views if (edge := edges[i]) is not None]
    if seen:
        points = np.concatenate(seen)
        return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2, dtype=np.float64)
    places = np.array([located[i].translation for i in views])
    return np.asarray(places.mean(axis=0), dtype=np.float64)
