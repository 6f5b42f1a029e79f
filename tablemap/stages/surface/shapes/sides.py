"""What was seen of an outline's sides, and what follows for a figure that two of them bound."""

from __future__ import annotations

from dataclasses import dataclass

MEASURED, INFERRED, UNSEEN = "measured", "inferred", "unseen"


@dataclass(frozen=True)
class Sight:
    """How much of a side was seen.

    fraction: the share of its length that edge points show.
    spread: the share of its length from the first seen part to the last.
    """

    fraction: float
    spread: float


def worst(*status: str) -> str:
    """Return the status of what all of these bound: the least known one's."""
    order = (UNSEEN, INFERRED, MEASURED)
    return min(status, key=order.index)


def inferred_at_least(status: tuple[str, ...]) -> tuple[str, ...]:
    """Return the same for sides that follow from the others where they were not seen."""
    return tuple(INFERRED if each == UNSEEN else each for each in status)


def longest_gap(seen: list[bool]) -> int:
    """Return the longest run of unseen neighbours on a ring."""
    if not any(seen):
        return len(seen)
    longest = run = 0
    for value in seen + seen:
        run = 0 if value else run + 1
        longest = max(longest, run)
    return min(longest, len(seen))
