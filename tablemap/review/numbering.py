"""Short names for what is many: views from one place by their numbers, clusters by letters."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from string import ascii_lowercase

import numpy as np

from tablemap.geometry import Pose2

SAME_PLACE_M = 0.02


def from_one_place(bases: Sequence[Pose2]) -> list[range]:
    """Return runs of views from one place of the base: those of a head that turned."""
    steps = [np.linalg.norm(b.translation - a.translation) for a, b in pairwise(bases)]
    starts = [k for k in range(len(bases)) if k == 0 or steps[k - 1] >= SAME_PLACE_M]
    return [range(a, b) for a, b in pairwise([*starts, len(bases)])]


def numbered(views: range) -> str:
    """Return the numbers of views from one place, as one label."""
    return str(views[0]) if len(views) == 1 else f"{views[0]}-{views[-1]}"


def letter(number: int) -> str:
    """Return a cluster's letters, as a spreadsheet's columns have them: a to z, aa, ab."""
    more, last = divmod(number, len(ascii_lowercase))
    return (letter(more - 1) if more else "") + ascii_lowercase[last]
