"""Whether views registered by their depth are where they should be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from scipy.spatial import cKDTree

from tablemap.geometry import Floats, Pose2
from tablemap.stages.outline import Outline, ViewEdges
from tablemap.stages.registration.result import DepthStatistics, StopCheck, StopScan

# The limits lie between right registrations of simulated tables and ones that were made wrong on
# purpose.
_NEAR = 0.10
_CONSISTENT = 0.015
_NORMAL_COSINE = 0.9
_LEAST_CONSISTENT = 0.4
_FEW_POINTS = 30
_MOST_POINTS = 200
_VOTE_STRIDE = 2
_VOTE_APART = 0.02  # metres: a point nearer to a vote than this is on the area that votes cover
_VOTE_MARGIN = 0.04
_LARGEST_VIOLATION = 0.04
_FEW_DOUBTS = 0.2  # of the others: a view that has slid along a side contradicts only a few
_DOUBTFUL = 4.0  # times what is usual among the others


@dataclass(frozen=True)
class Checked:
    """The views' ``checks``, and the ``company``: indices of the largest group that agrees."""

    checks: tuple[StopCheck, ...]
    company: frozenset[int]

    @property
    def passed(self) -> int:
        """How many passed."""
        return sum(check.passed for check in self.checks)


def check_views(
    outline: Outline | None, edges: Sequence[StopScan | None], poses: Floats
) -> Checked:
    """Compare each view's edges and votes with those of every other, all at ``poses`` (n, 3).

    The largest company of views that agree with each other passes, and the other views fail. Where
    this company is not more than half of the views, all fail. The statistics are medians over the
    company. A view without edges has no statistics and passes: its pose rests on odometry,
    localisation and pairs, and its sigma says so.
    """
    votes = {} if outline is None else {view.index: view for view in outline.views}
    located = [Pose2.from_array(pose) for pose in poses]
    views = {
        i: _EdgeView(located[i], edge, votes[edge.index])
        for i, edge in enumerate(edges)
        if edge is not None
    }
    compared = {(i, j): _compare(views[i], views[j]) for i in views for j in views if i != j}
    agree = {(i, j): not (_judge(compared[i, j]) or _judge(compared[j, i])) for i, j in compared}
    company = _company(sorted(views), agree, compared)
    checks = []
    for i in range(len(edges)):
        partners = [j for j in views if j != i]
        if i not in views or not partners:
            checks.append(StopCheck(i, True, None, ()))
            continue
        against = [j for j in partners if j in company] or partners
        median = _median([compared[i, j] for j in against])
        statistics = DepthStatistics(
            edge_points=median.edge_points,
            shared=median.shared,
            consistent=median.consistent,
            violation=median.violation,
            agreeing=float(np.mean([agree[i, j] for j in partners])),
        )
        reasons: tuple[str, ...] = ()
        if i not in company:
            reasons = _judge(median) or ("it contradicts views that agree with each other",)
        elif 2 * len(company) <= len(views):
            reasons = (f"only {len(company)} of {len(views)} views agree with each other",)
        checks.append(StopCheck(i, not reasons, statistics, reasons))
    return Checked(tuple(checks), frozenset(company))


def statistics_of(check: StopCheck) -> DepthStatistics:
    """Return a check's statistics; they may still grow."""
    return check.statistics if isinstance(check.statistics, DepthStatistics) else DepthStatistics()


def _company(
    views: Sequence[int],
    agree: dict[tuple[int, int], bool],
    compared: dict[tuple[int, int], _Agreement],
) -> set[int]:
    """Drop the views that contradict too many others, worst first, and return the rest."""
    company = set(views)
    while len(company) > 1:
        against = {i: [j for j in company if i != j and not agree[i, j]] for i in company}
        fit = {
            i: float(np.median([compared[i, j].consistent for j in company if j != i]))
            for i in company
        }
        worst = max(sorted(company), key=lambda i: (len(against[i]), -fit[i]))
        # A view goes if it contradicts more of the others than is usual. Where all views contradict
        # several others, a contradiction says less; one each may be about the same bad view.
        usual = np.median([len(set(against[i]) - {worst}) for i in company - {worst}])
        most = max(1.0, _FEW_DOUBTS * (len(company) - 1), _DOUBTFUL * (float(usual) - 1))
        if len(against[worst]) <= min(most, (len(company) - 1) / 2):
            break
        company.remove(worst)
    return company


@dataclass(frozen=True)
class _Agreement:
    """How one view fits another, or its median over several; see `DepthStatistics`."""

    edge_points: float
    shared: float
    consistent: float
    violation: float


def _median(agreements: Sequence[_Agreement]) -> _Agreement:
    rows = np.median([astuple(one) for one in agreements], axis=0)
    return _Agreement(*map(float, rows))


class _EdgeView:
    """A view's edges and votes in the map, with the trees to find them."""

    def __init__(self, pose: Pose2, edge: StopScan, votes: ViewEdges) -> None:
        every = max(1, len(edge.points) // _MOST_POINTS)
        self.points = pose.apply(edge.points[::every])
        self.normals = pose.rotate(edge.normals[::every])
        self.noise = edge.noise
        self.tree = cKDTree(self.points)
        self.top, self.free = (pose.apply(_finite(part)) for part in (votes.top, votes.free))
        self.top_tree, self.free_tree = cKDTree(self.top), cKDTree(self.free)


def _compare(own: _EdgeView, other: _EdgeView) -> _Agreement:
    distance, nearest = other.tree.query(own.points, k=4, distance_upper_bound=_NEAR)
    near = np.isfinite(distance)
    nearest = np.where(near, nearest, 0)
    normals = other.normals[nearest]
    # Where the other view's edge turns a corner, or ends early, there is nothing to compare.
    near &= np.einsum("nki,ni->nk", normals, own.normals) > _NORMAL_COSINE
    apart = np.einsum("nki,nki->nk", normals, own.points[:, None] - other.points[nearest])
    limit = max(_CONSISTENT, 3 * float(np.hypot(own.noise, other.noise)))
    shared = near.any(axis=1)
    on = (near & (np.abs(apart) < limit)).any(axis=1)
    against = _inside(own.top, other.free_tree, other.top_tree)
    against += _inside(own.free, other.top_tree, other.free_tree)
    return _Agreement(
        edge_points=float(len(own.points)),
        shared=float(shared.mean()),
        consistent=float(on.sum() / max(shared.sum(), 1)),
        violation=against / max(len(own.top), 1),
    )


def _inside(points: Floats, region: cKDTree, opposite: cKDTree) -> int:
    """Count the points that lie in a region and outside the margin of the opposite region."""
    if min(len(points), region.n, opposite.n) == 0:
        return 0
    amid, _ = region.query(points, distance_upper_bound=_VOTE_APART)
    amid_points = points[np.isfinite(amid)]
    if len(amid_points) == 0:
        return 0
    beside, _ = opposite.query(amid_points, distance_upper_bound=_VOTE_MARGIN)
    return int((~np.isfinite(beside)).sum())


def _finite(points: Floats) -> Floats:
    kept = points[np.isfinite(points).all(axis=1)][::_VOTE_STRIDE]
    return np.asarray(kept.reshape(-1, 2), dtype=np.float64)


def _judge(seen: _Agreement) -> tuple[str, ...]:
    reasons = []
    if seen.edge_points * seen.shared >= _FEW_POINTS and seen.consistent < _LEAST_CONSISTENT:
        reasons.append(
            f"only {100 * seen.consistent:.0f} % of the edge that other views saw too agrees"
        )
    if seen.violation > _LARGEST_VIOLATION:
        reasons.append(
            f"{100 * seen.violation:.0f} % of the top that it saw contradicts other views"
        )
    return tuple(reasons)
