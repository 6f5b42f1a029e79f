"""A sensor's clock against that of TF: how far it is off, and whether the motion shows it.

Every message has the time at which it was logged beside the stamp of its header. Where the
stamps of one sensor lie further behind the log than those of TF, either its messages take longer
on the way, or its clock is off. The motion tells which: what a sensor sees changes when the robot
moves, and images that were taken at the stops were taken while it stood.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field

import numpy as np

from tablemap.geometry import Bools, Floats, Ints

SECOND_NS = 1_000_000_000
SUSPECT_S = 0.1
"""A smaller difference of lags is usual on the way."""
NAMED_LATE_S, NAMED_EARLY_S = 1.0, 0.3
"""What is named though no motion shows it: nothing takes longer, and nothing arrives early."""

_MOST_LAGS = 4096
_STEADY_S = 0.25  # a clock that is off is off by the same; a slow network is not
_STEP_S = 0.02
_AROUND_S = 1.0  # of the difference of the lags, and of none
_FEWEST_CHANGES = 20
_LEAST_CORRELATION, _LEAST_GAIN = 0.5, 0.03
_PARTS = 6  # of a drive: one after the other is left out
_LEAST_SIGMA_S = 0.01
_WAYS_SIGMA_S = 0.03  # messages of two sensors are so much longer or shorter on their way
_STILL_S = 0.2  # an image at a stop is so far from the motion
_STILL_M = 0.01  # metres, or half a radian, within this time
_LEAST_IMAGES = 3
_ARM = 0.5  # metres for a radian
# Where the log's times tell nothing, as in a converted log, the motion must tell it clearly.
_FARTHEST_S, _SEARCH_STEP_S = 10.0, 0.1
_FITS_WELL, _FITS_BETTER = 0.8, 0.25  # correlation that proves an offset, and more than without
_SURE_S = 0.05  # sigma of an offset that is proved so
_FEWEST_STOPS = 6  # of images: fewer stand by chance at some offset
_BETWEEN_STOPS_S = 1.0


@dataclass
class Lags:
    """How long after their stamps messages were logged, thinned to a bounded number."""

    _kept: array[int] = field(default_factory=lambda: array("q"))
    _stride: int = 1
    _seen: int = 0

    def add(self, lag_ns: int) -> None:
        """Take a message's lag."""
        if self._seen % self._stride == 0:
            self._kept.append(lag_ns)
            if len(self._kept) > _MOST_LAGS:
                self._kept = self._kept[::2]
                self._stride *= 2
        self._seen += 1

    def seconds(self) -> Floats:
        """Return the kept lags (n,)."""
        return np.array(self._kept, dtype=np.int64) / SECOND_NS


@dataclass(frozen=True)
class ClockDifference:
    """By how much a sensor's clock seems to be behind that of TF, and whether it is steady.

    ``lag``: seconds from the sensor's stamps to their log times, negative where they are ahead.
    """

    seconds: float
    lag: float
    is_steady: bool

    @property
    def is_suspect(self) -> bool:
        """Whether it is more than messages usually differ on their way."""
        return abs(self.seconds) > SUSPECT_S

    @property
    def is_named(self) -> bool:
        """Whether it is more than any way of a message explains."""
        is_early = max(self.seconds, self.lag) < -NAMED_EARLY_S
        return self.seconds > NAMED_LATE_S or is_early


def difference(sensor_lags: Floats, tf_lags: Floats) -> ClockDifference | None:
    """Compare the lags of a sensor's messages (n,) with those of TF (m,), seconds."""
    if not len(sensor_lags) or not len(tf_lags):
        return None
    low, middle, high = np.quantile(sensor_lags, [0.1, 0.5, 0.9])
    steady = bool(high - low < _STEADY_S)
    return ClockDifference(float(middle - np.median(tf_lags)), float(middle), steady)


@dataclass(frozen=True, eq=False)
class Way:
    """The way that a sensor went, by TF: (n,) stamps ascending, (n,) metres up to each.

    A radian of turning counts as half a metre. ``known`` (n,) says where TF has a pose.
    """

    stamps_ns: Ints
    metres: Floats
    known: Bools

    @staticmethod
    def of(stamps_ns: Ints, poses: Floats, known: Bools) -> Way:
        """Make it of poses (n, 4, 4) at stamps, of which some are known."""
        steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
        turns = np.einsum("nij,nij->n", poses[1:, :3, :3], poses[:-1, :3, :3])
        steps = steps + _ARM * np.arccos(np.clip((turns - 1) / 2, -1, 1))
        steps = np.where(known[1:] & known[:-1], steps, 0.0)
        return Way(stamps_ns, np.concatenate([[0.0], np.cumsum(steps)]), known)

    def between(self, first_ns: Ints, second_ns: Ints) -> tuple[Floats, Bools]:
        """Return the metres gone between stamps (n,) and (n,), and where they are known."""
        gone = self._at(self.metres, second_ns) - self._at(self.metres, first_ns)
        share = self.known.astype(np.float64)
        known = (self._at(share, first_ns) > 0.99) & (self._at(share, second_ns) > 0.99)
        inside = (first_ns >= self.stamps_ns[0]) & (second_ns <= self.stamps_ns[-1])
        return gone, known & inside

    def _at(self, values: Floats, stamps_ns: Ints) -> Floats:
        begin = self.stamps_ns[0]
        at, known = (stamps_ns - begin) * 1e-9, (self.stamps_ns - begin) * 1e-9
        return np.asarray(np.interp(at, known, values), dtype=np.float64)


@dataclass(frozen=True)
class ShownOffset:
    """The seconds to add to a sensor's stamps, and their standard deviation, by the motion."""

    seconds: float
    sigma: float

    def decided(self, by_log_s: float) -> float | None:
        """Return the offset if the motion tells a clock that is off from messages that come late.

        ``by_log_s`` is how much later the messages were logged. If the clock is off by that, both
        are weighed: of the log it is known as well as ways of messages are alike.
        """
        sigma = max(self.sigma, _LEAST_SIGMA_S)
        is_late = abs(self.seconds) < 3 * sigma
        is_off = abs(self.seconds - by_log_s) < 3 * np.hypot(sigma, _WAYS_SIGMA_S)
        if is_late and not is_off:
            return 0.0
        if is_off and not is_late:
            weight = sigma**-2 / (sigma**-2 + _WAYS_SIGMA_S**-2)
            return float(weight * self.seconds + (1 - weight) * by_log_s)
        return None if is_late or sigma > _WAYS_SIGMA_S else self.seconds


def offset_by_change(
    first_ns: Ints, second_ns: Ints, change: Floats, way: Way, *, about_s: float
) -> ShownOffset | None:
    """Return the seconds to add to a sensor's stamps so that its changes fit the motion.

    ``change`` (n,) says how much what it sees differs between two stamps. Offsets about zero and
    about ``about_s`` are tried. None where the changes do not tell, in all of the drive or without
    some part of it. The sigma is that of the jackknife (Efron and Stein, Annals of Statistics,
    1981).
    """
    if len(change) < _FEWEST_CHANGES:
        return None
    whole = _best_offset(first_ns, second_ns, change, way, about_s)
    if whole is None:
        return None
    part = np.arange(len(change)) * _PARTS // len(change)
    left = [part != each for each in range(_PARTS)]
    without = [_best_offset(first_ns[w], second_ns[w], change[w], way, about_s) for w in left]
    known = np.array([each for each in without if each is not None])
    if len(known) < _PARTS:
        return None
    sigma = float(np.sqrt((_PARTS - 1) * np.mean(np.square(known - known.mean()))))
    return ShownOffset(whole, sigma)


@dataclass(frozen=True)
class OffsetBesideLog:
    """An offset by the motion alone, and whether no other one does nearly as well."""

    seconds: float
    is_sure: bool


def offset_beside_log(
    first_ns: Ints, second_ns: Ints, change: Floats, way: Way
) -> OffsetBesideLog | None:
    """Return the seconds that the motion shows though the log's times show none, or None.

    The arguments are those of `offset_by_change`. None where the changes fit the motion as it is.
    """
    as_it_is = _fit(first_ns, second_ns, change, way, 0.0)
    if len(change) < _FEWEST_CHANGES or as_it_is > 1.0 - _FITS_BETTER:
        return None
    tried = np.arange(-_FARTHEST_S, _FARTHEST_S + _SEARCH_STEP_S / 2, _SEARCH_STEP_S)
    fits = np.array([_fit(first_ns, second_ns, change, way, each) for each in tried])
    best = int(np.argmax(fits))
    if fits[best] < max(_FITS_WELL, as_it_is + _FITS_BETTER):
        return None
    # Stops that follow each other evenly fit at several offsets.
    far = fits[np.abs(tried - tried[best]) > _AROUND_S]
    shown = offset_by_change(first_ns, second_ns, change, way, about_s=float(tried[best]))
    if shown is None or fits[best] < float(np.max(far)) + _LEAST_GAIN:
        return OffsetBesideLog(float(tried[best]), False)
    return OffsetBesideLog(shown.seconds, shown.sigma < _SURE_S)


def offset_of_stops(stamps_ns: Ints, way: Way) -> float | None:
    """Return the offset at which all images were taken at stops, though now most were not.

    None where images come all the time, or from few places, and where several offsets do.
    """
    begins = np.diff(stamps_ns) > _BETWEEN_STOPS_S * SECOND_NS
    if int(begins.sum()) + 1 < _FEWEST_STOPS:
        return None
    if 2 * int(_stand(stamps_ns, way).sum()) > len(stamps_ns):
        return None
    tried = np.arange(-_FARTHEST_S, _FARTHEST_S + _SEARCH_STEP_S / 2, _SEARCH_STEP_S)
    fits = np.array([stands_at(stamps_ns + round(each * SECOND_NS), way) for each in tried])
    found = np.flatnonzero(fits)
    if not len(found) or np.any(np.diff(found) > 1):
        return None
    return float(tried[found].mean())


def _best_offset(
    first_ns: Ints, second_ns: Ints, change: Floats, way: Way, about_s: float
) -> float | None:
    near = np.arange(-_AROUND_S, _AROUND_S + _STEP_S / 2, _STEP_S)
    tried = np.unique(np.round(np.concatenate([near, about_s + near]), 3))
    fits = np.array([_fit(first_ns, second_ns, change, way, each) for each in tried])
    best = int(np.argmax(fits))
    far = fits[np.abs(tried - tried[best]) > _AROUND_S / 2]
    if fits[best] < _LEAST_CORRELATION or fits[best] - float(np.max(far)) < _LEAST_GAIN:
        return None
    if not 0 < best < len(tried) - 1 or tried[best + 1] - tried[best - 1] > 3 * _STEP_S:
        return float(tried[best])
    before, at, after = fits[best - 1 : best + 2]
    bend = before - 2 * at + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(tried[best] + np.clip(shift, -1, 1) * _STEP_S)


def stands_at(stamps_ns: Ints, way: Way) -> bool:
    """Tell whether the robot stood round each of the stamps (n,), as at planned stops."""
    return len(stamps_ns) >= _LEAST_IMAGES and bool(np.all(_stand(stamps_ns, way)))


def _stand(stamps_ns: Ints, way: Way) -> Bools:
    """Return round which of the stamps (n,) the robot is known to have stood."""
    around = round(_STILL_S * SECOND_NS)
    gone, known = way.between(stamps_ns - around, stamps_ns + around)
    return known & (gone < _STILL_M)


def _fit(first_ns: Ints, second_ns: Ints, change: Floats, way: Way, offset_s: float) -> float:
    """Return the correlation of changes with the motion at shifted stamps, -1 without overlap."""
    shift = round(offset_s * SECOND_NS)
    gone, known = way.between(first_ns + shift, second_ns + shift)
    if known.sum() < max(_FEWEST_CHANGES, 0.5 * len(change)):
        return -1.0
    motion, seen = np.sqrt(np.maximum(gone[known], 0.0)), np.sqrt(change[known])
    if motion.std() < 1e-6 or seen.std() < 1e-9:
        return -1.0
    return float(np.corrcoef(motion, seen)[0, 1])
