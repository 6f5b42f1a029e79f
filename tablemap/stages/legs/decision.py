"""Which candidates are legs: the evidence for and against each, weighed together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablemap.stages.legs.candidates import UNDER_ANOTHER, LegCandidate
from tablemap.stages.legs.chairs import chair_like
from tablemap.stages.legs.layout import Frame, are_alike, rectangles, table_sets
from tablemap.words import counted

_SLIVER = 0.1  # of the silhouettes of the thing beside it
_WIDE = 0.2  # metres: beside legs that carry the top, a wider thing is hardly one of them

# The evidence for and against a leg, in one unit. A candidate that the depth camera saw reach the
# top is a leg unless it stands like a chair's. Without such a look, its place must speak for it.
_REACHES_TOP = 3.0  # the depth camera followed it up to the top
_REACHES_BESIDE = 1.0  # the same beyond the top, where the back of a chair reaches as high
_OF_COMPLETE_SET = 2.0  # all its partners stand where the top's symmetry puts them
_OF_PARTIAL_SET = 1.0  # only some partners stand there, or they make up a second set
_IN_THE_MIDDLE = 3.0  # pedestals stand there, and clutter rarely does
_NEAR_A_CORNER = 1.0  # legs stand there, but people and bags do too
_OF_A_CHAIR = -2.5  # it and others stand like the legs of a chair
_BEYOND_THE_TOP = -1.5  # feet may stand there, but so do all things beside the table
_BESIDE_A_SET = -1.0  # the table has a complete set, and the candidate is not part of it
_LEAST_FOR_A_LEG = 1.0


def judge(candidates: list[LegCandidate], frame: Frame) -> list[LegCandidate]:
    """Weigh the layout and depth of all candidates, and give a reason to each that is no leg."""
    candidates = _without_fragments(candidates)
    alive = [i for i, candidate in enumerate(candidates) if candidate.reason is None]
    places = np.array([candidate.place for candidate in candidates]).reshape(-1, 2)
    slender = [i for i in alive if candidates[i].cluster.slender]
    wide = [i for i in alive if not candidates[i].cluster.slender]
    complete, partial, own = table_sets(frame, places, slender, wide)
    # Legs of a surface that touches the table form no chair together with the table's legs.
    free = [
        i
        for i, candidate in enumerate(candidates)
        if candidate.cluster.slender and candidate.reason != UNDER_ANOTHER
    ]
    at = {i: k for k, i in enumerate(free)}
    chairs = {free[k] for k in chair_like(frame, places[free], {at[i] for i in own if i in at})}
    judged = list(candidates)
    for i in alive:
        place = candidates[i].place
        signs = _Signs(
            reaches_top=candidates[i].reach.is_up or candidates[i].end.is_at_top,
            in_complete_set=i in complete,
            in_partial_set=i in partial,
            in_chair=i in chairs,
            is_central=frame.is_central(place),
            is_near_corner=frame.near_corner(place),
            is_beyond=frame.is_beyond(place),
            table_has_set=bool(complete),
        )
        if signs.score() < _LEAST_FOR_A_LEG:
            judged[i] = replace(candidates[i], reason=signs.objection(frame.inset(place)))
    return _doubted(_completed(judged, slender, frame), complete, chairs, frame)


def _doubted(
    judged: list[LegCandidate], complete: set[int], chairs: set[int], frame: Frame
) -> list[LegCandidate]:
    """Set aside what no view saw meet the top, if other legs carry it and are made otherwise.

    ``complete`` are the indices of a complete set of legs, ``chairs`` of things that stand like
    chairs' legs. A shin or a post of almost the top's height cannot be told from a leg then.
    """
    legs = [i for i, candidate in enumerate(judged) if candidate.reason is None]
    central = [i for i in legs if frame.is_central(judged[i].place)]
    carry = [i for i in legs if i in complete] or central
    if not carry:
        return judged
    sizes = np.array([judged[i].size for i in carry])
    usual = float(np.median(sizes))
    result = list(judged)
    for i in legs:
        candidate = judged[i]
        # Beside a pedestal, that a thing is as wide as the column says nothing for it.
        alike = bool(complete) and bool(are_alike(np.array([candidate.size]), usual)[0])
        # Beyond the top, things of its height need not touch it.
        meets = candidate.end.is_at_top and not frame.is_beyond(candidate.place)
        if i in carry or i in central or meets or (alike and i not in chairs):
            continue
        # Against such a layout, one view through the gap above it is enough.
        ends = candidate.end.shown > 0 and not candidate.end.opposed
        unseen = candidate.end.hidden
        upper = f"its upper {100 * unseen:.0f} cm" if np.isfinite(unseen) else "its upper end"
        reason = (
            f"{100 * candidate.size:.0f} cm across, and "
            f"{candidate.end if ends else f'no view saw {upper}'}; "
            f"{counted(len(carry), 'leg')} of {100 * usual:.0f} cm {_carry(len(carry))} the top"
        )
        is_unsure = not ends and candidate.cluster.slender and candidate.size <= _WIDE
        result[i] = replace(candidate, reason=reason, is_unsure=is_unsure)
    return result


def _carry(count: int) -> str:
    return "carries" if count == 1 else "carry"


def _completed(judged: list[LegCandidate], slender: list[int], frame: Frame) -> list[LegCandidate]:
    """Accept things under the top that stand in a rectangle with a leg of their own size.

    ``slender`` are those that only their layout or a lack of looks spoke against. The rectangle
    with most legs counts, as long as the table has fewer than four.
    """
    pool = [i for i in slender if not frame.is_beyond(judged[i].place)]
    kept = {k for k, i in enumerate(pool) if judged[i].reason is None}
    if not 0 < len(kept) < _LEGS:
        return judged
    places = np.array([judged[i].place for i in pool])
    fours = rectangles(places, np.array([judged[i].size for i in pool]))
    best = max(fours, key=lambda four: len(kept & set(four)), default=())
    result = list(judged)
    if kept & set(best):
        for k in best:
            result[pool[k]] = replace(judged[pool[k]], reason=None)
    return result


_LEGS = 4


@dataclass(frozen=True)
class _Signs:
    """Signs that tell a leg from clutter: its place, and the looks of the depth camera."""

    reaches_top: bool
    in_complete_set: bool
    in_partial_set: bool
    in_chair: bool
    is_central: bool
    is_near_corner: bool
    is_beyond: bool
    table_has_set: bool

    def score(self) -> float:
        """Return the evidence for a leg minus the evidence against it."""
        score = 0.0
        if self.reaches_top:
            score += _REACHES_BESIDE if self.is_beyond else _REACHES_TOP
        if self.in_complete_set:
            score += _OF_COMPLETE_SET
        elif self.in_partial_set and not (self.in_chair and self.table_has_set):
            score += _OF_PARTIAL_SET
        if self.is_central:
            score += _IN_THE_MIDDLE
        elif self.is_near_corner:
            score += _NEAR_A_CORNER
        if self.in_chair:
            score += _OF_A_CHAIR
        if self.is_beyond:
            score += _BEYOND_THE_TOP
        if self.table_has_set and not self.in_complete_set and not self.is_central:
            score += _BESIDE_A_SET
        return score

    def objection(self, inset: float) -> str:
        """Return the strongest sign against it, at ``inset`` metres inside the outline."""
        if self.in_chair:
            return "stands like the leg of a chair, and was not seen to reach the top"
        if self.is_beyond:
            return f"stands {100 * -inset:.0f} cm beyond the top, without partners"
        if self.table_has_set:
            return "stands inside a complete set of legs, and was not seen to reach the top"
        return "neither its place nor the depth camera shows that it is a leg"


def _without_fragments(candidates: list[LegCandidate]) -> list[LegCandidate]:
    """Reject candidates that overlap one with more evidence: they are pieces of its silhouette."""

    def weight(i: int) -> int:
        evidence = candidates[i].evidence
        return len(evidence.sigma) if evidence is not None else 0

    kept: list[int] = []
    result = list(candidates)
    for i in sorted(range(len(candidates)), key=weight, reverse=True):
        if candidates[i].reason is not None:
            continue
        for k in kept:
            apart = np.linalg.norm(candidates[i].place - candidates[k].place)
            # Noisy ranges scatter slivers of a leg: their fit may be small, their spread is not.
            sliver = weight(i) < _SLIVER * weight(k)
            own = max(candidates[i].size, candidates[i].cluster.size if sliver else 0.0)
            reach = 0.5 * (own + candidates[k].size) + 0.01
            if candidates[k].cluster.slender and apart < reach:
                result[i] = replace(candidates[i], reason="a fragment of the leg beside it")
                break
        else:
            kept.append(i)
    return result
