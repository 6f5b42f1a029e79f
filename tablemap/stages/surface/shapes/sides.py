"""How much of each side was seen, and the status of a figure that two sides bound."""

from __future__ import annotations

from dataclasses import dataclass

MEASURED, INFERRED, UNSEEN = "measured", "inferred", "unseen"


@dataclass(frozen=True)
class Sight:
    """How much of a side was seen.

    fraction: the share of its length that edge points show.
    spread: the share of its length from the first seen part to the last.
    length: metres that edge points show.
    beyond: the share of its length along which the top was seen to go on beyond it; 0 where the
        rest tells the side's status.
    """

    fraction: float
    spread: float
    length: float
    beyond: float = 0.0


def worst(*status: str) -> str:
    """Return the status of a figure that sides of these statuses bound: the worst one."""
    order = (UNSEEN, INFERRED, MEASURED)
    return min(status, key=order.index)


def inferred_at_least(status: tuple[str, ...]) -> tuple[str, ...]:
    """Return the statuses of sides that follow from each other: unseen ones are inferred."""
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
