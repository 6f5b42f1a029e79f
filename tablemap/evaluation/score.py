"""The errors of one run, and what is said of them: covered, silent, a false alarm.

Raw errors have a sign; lengths are in metres, angles in radians.
"""

from __future__ import annotations

from dataclasses import dataclass

MEASURED = "measured"
YAW = "place yaw"
"""The name of the error of the top's heading in the map."""
BOUND = 1.96
"""The stated 95 % interval reaches this many sigmas to either side."""
ADMITTED_SIGMAS = 3.0
"""An error within this many of its stated sigmas counts as admitted."""
SILENT = 0.02
"""An unwarned, unadmitted error above this is a silent failure, metres."""
HARMLESS = 0.008
"""A warning is a false alarm where every figure is within this, metres."""
_MISSED = 2 / 0.05
"""A 95 % interval's score grows by this much for each unit that the truth lies outside."""


@dataclass(frozen=True)
class Error:
    """One figure's error.

    - ``error``: estimate minus truth
    - ``sigma``: the stated standard deviation
    - ``size``: the true value
    - ``excess``: the part of |error| that the injected sensor errors and the truth's own tolerance
      do not explain
    - ``status``: that of the figure
    """

    name: str
    error: float
    sigma: float | None
    size: float
    excess: float
    status: str = MEASURED

    @property
    def covered(self) -> bool | None:
        """Whether the stated 95 % interval contains the truth; None without a sigma."""
        return None if self.sigma is None else abs(self.error) <= BOUND * self.sigma

    @property
    def interval_width(self) -> float | None:
        """The width of the stated 95 % interval; None without a sigma."""
        return None if self.sigma is None else 2 * BOUND * self.sigma

    @property
    def interval_score(self) -> float | None:
        """The score of the stated 95 % interval, lower is better; None without a sigma.

        It is the interval's width plus 40 times the distance of the truth outside of it. Both too
        wide and too narrow intervals score badly (Gneiting and Raftery 2007, "Strictly Proper
        Scoring Rules, Prediction, and Estimation", equation 43).
        """
        if self.sigma is None:
            return None
        half = BOUND * self.sigma
        return 2 * half + _MISSED * max(0.0, abs(self.error) - half)

    @property
    def admitted(self) -> bool:
        """Whether the error is within the limit by its stated sigma."""
        return self.sigma is not None and abs(self.error) <= ADMITTED_SIGMAS * self.sigma


@dataclass(frozen=True)
class LegScore:
    """Legs found, missed and invented; place errors relative to the table; size errors."""

    found: int
    missed: int
    invented: int
    places: tuple[Error, ...]
    sizes: tuple[Error, ...]


@dataclass(frozen=True)
class ViewScore:
    """Number of views, one a rest of the head, that truly see the top, and of those used."""

    seeing: int
    used: int


@dataclass(frozen=True)
class Score:
    """The errors of one run; what the truth does not know is None or empty.

    ``place`` is the pose of the top in the map: x, y and yaw.
    """

    shape: str
    true_shape: str
    dimensions: tuple[Error, ...]
    angle: Error | None
    height: Error | None
    poses: tuple[Error, ...]
    headings: tuple[float, ...]
    outline: float | None
    iou: float | None
    legs: LegScore | None
    doubts: tuple[str, ...]
    weights: dict[str, float]
    views: ViewScore | None = None
    corner_radius: Error | None = None
    thickness: Error | None = None
    place: tuple[Error, ...] = ()

    @property
    def measured(self) -> tuple[Error, ...]:
        """Every length that the model gives as measured."""
        figures = [*self.dimensions, *(f for f in (self.height, self.thickness) if f)]
        if self.legs:
            figures.extend(self.legs.places)
        return tuple(figure for figure in figures if figure.status == MEASURED)

    @property
    def silent_failure(self) -> bool:
        """Whether a figure errs by over 2 cm, and neither a warning nor its sigma admits this."""
        bad = [f for f in (*self.measured, *self.poses) if abs(f.error) > SILENT and not f.admitted]
        return bool(bad) and not self.doubts

    @property
    def false_alarm(self) -> bool:
        """Whether a warning doubts figures that are all within 8 mm, with the right shape."""
        right = self.shape == self.true_shape
        return bool(self.doubts) and right and all(abs(f.error) <= HARMLESS for f in self.measured)
