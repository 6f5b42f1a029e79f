"""Comparison of a model with the truth: every error of one run.

The best SE(2) fit of the snapshots' poses brings both into one frame, so that the free offset of
the localisation does not count. Raw errors have a sign; lengths are in metres, angles in radians.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment

from tablemap.evaluation.truth import TrueSnapshot, TrueSurface, Truth
from tablemap.geometry import Floats, Pose2, wrap_angle
from tablemap.model import Dimension, SnapshotPose, TableModel, TableSurface
from tablemap.model.shapes import shape_named
from tablemap.stages.surface.shapes.shape import extents

MEASURED = "measured"
LEG_REACH = 0.10
"""A leg farther than this from every true leg counts as invented, metres."""
ADMITTED_SIGMAS = 3.0
"""An error within this many of its stated sigmas counts as admitted."""
SILENT = 0.02
"""An unwarned, unadmitted error above this is a silent failure, metres."""
HARMLESS = 0.008
"""A warning is a false alarm where every figure is within this, metres."""

SEES_TOP = 0.1
"""A view sees the top if it shows at least this share of its area unhidden."""
_SAME_STAMP_NS = 50_000_000
_BOUND = 1.96
_MISSED = 2 / 0.05
"""A 95 % interval's score grows by this much for each unit that the truth lies outside."""

LARGEST_TURN = float(np.radians(5.0))
"""A top turned more than this against the snapshots is itself wrong, radians."""


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
        return None if self.sigma is None else abs(self.error) <= _BOUND * self.sigma

    @property
    def interval_width(self) -> float | None:
        """The width of the stated 95 % interval; None without a sigma."""
        return None if self.sigma is None else 2 * _BOUND * self.sigma

    @property
    def interval_score(self) -> float | None:
        """The score of the stated 95 % interval, lower is better; None without a sigma.

        It is the interval's width plus 40 times the distance of the truth outside of it. Both too
        wide and too narrow intervals score badly (Gneiting and Raftery 2007, "Strictly Proper
        Scoring Rules, Prediction, and Estimation", equation 43).
        """
        if self.sigma is None:
            return None
        half = _BOUND * self.sigma
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
    """The errors of one run; what the truth does not know is None or empty."""

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

    @property
    def measured(self) -> tuple[Error, ...]:
        """Every length that the model gives as measured."""
        figures = [*self.dimensions, *([self.height] if self.height else [])]
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


def score(model: TableModel, truth: Truth) -> Score:
    """Compare a model with the truth of its recording."""
    truth_from_model, poses, headings = _align_snapshots(model, truth)
    outline = iou = None
    if truth.surface.outline and (truth_from_model or truth.snapshots is None):
        place = truth_from_model or Pose2()
        estimated = shapely.Polygon(place.apply(model.surface.outline)).buffer(0)
        true = shapely.Polygon(truth.surface.outline).buffer(0)
        outline = _outline_distance(estimated, true)
        iou = float(estimated.intersection(true).area / estimated.union(true).area)
    return Score(
        shape=model.surface.shape,
        true_shape=truth.surface.shape,
        dimensions=_dimension_errors(model.surface, truth),
        angle=_angle_error(model.surface, truth.surface),
        height=_height_error(model, truth),
        poses=poses,
        headings=headings,
        outline=outline,
        iou=iou,
        legs=_score_legs(model, truth, truth_from_model),
        doubts=tuple(w.code for w in model.warnings if w.code.startswith("accuracy.")),
        weights=_weights(model.surface),
        views=_score_views(model, truth),
        corner_radius=_radius_error(model.surface, truth.surface),
    )


def _weights(surface: TableSurface) -> dict[str, float]:
    """Return each shape's weight; of two fits of one shape, the better one's."""
    weights: dict[str, float] = {}
    for name, weight in (
        *((other.shape, other.score) for other in surface.alternatives),
        (surface.shape, surface.score),
    ):
        weights[name] = max(weight, weights.get(name, 0.0))
    return weights


def fit_rigid(source: Floats, target: Floats) -> Pose2:
    """Return the SE(2) pose that best maps (n, 2) points onto their partners (Umeyama 1991)."""
    from_mean, to_mean = source.mean(axis=0), target.mean(axis=0)
    a, b = source - from_mean, target - to_mean
    yaw = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    turned = Pose2(0.0, 0.0, yaw).apply(from_mean)
    return Pose2(float(to_mean[0] - turned[0]), float(to_mean[1] - turned[1]), yaw)


def _align_snapshots(
    model: TableModel, truth: Truth
) -> tuple[Pose2 | None, tuple[Error, ...], tuple[float, ...]]:
    """Fit the used snapshots onto the true ones; return the fit and the residual of each pose."""
    estimated, true, sigmas = [], [], []
    for snapshot, known in _matched(model, truth):
        if not snapshot.used:
            continue
        pose = known.map_from_base
        true.append(Pose2(pose.x, pose.y, pose.yaw))
        at = snapshot.map_from_base
        estimated.append(Pose2(at.x, at.y, at.yaw))
        sigmas.append(snapshot.sigma.xy if snapshot.sigma else None)
    if len(true) < 2:
        return None, (), ()
    fit = fit_rigid(
        np.array([p.translation for p in estimated]), np.array([p.translation for p in true])
    )
    poses, headings = [], []
    for i, (e, t) in enumerate(zip(estimated, true, strict=True)):
        placed = fit @ e
        distance = float(np.hypot(placed.x - t.x, placed.y - t.y))
        # The stated sigma is for one axis; the distance has two.
        sigma = None if sigmas[i] is None else sigmas[i] * np.sqrt(2)
        poses.append(Error("pose", distance, sigma, 0.0, distance))
        headings.append(abs(wrap_angle(placed.yaw - t.yaw)))
    return fit, tuple(poses), tuple(headings)


def _matched(model: TableModel, truth: Truth) -> Iterator[tuple[SnapshotPose, TrueSnapshot]]:
    """Yield each of the model's snapshots that has a true one of its stamp, with that one."""
    if not truth.snapshots:
        return
    known = sorted(truth.snapshots, key=lambda snapshot: snapshot.stamp_ns)
    stamps = np.array([snapshot.stamp_ns for snapshot in known], dtype=np.int64)
    for snapshot in model.snapshots:
        i = int(np.argmin(np.abs(stamps - snapshot.stamp_ns)))
        if abs(int(stamps[i]) - snapshot.stamp_ns) <= _SAME_STAMP_NS:
            yield snapshot, known[i]


def _score_views(model: TableModel, truth: Truth) -> ViewScore | None:
    """Count the rests that see the top, and those used; None if the truth does not know."""
    seen = {
        known.rest: known.sees_top >= SEES_TOP
        for known in truth.snapshots or ()
        if known.rest is not None and known.sees_top is not None
    }
    if not seen:
        return None
    used = {known.rest for snapshot, known in _matched(model, truth) if snapshot.used}
    seeing = {rest for rest, sees in seen.items() if sees}
    return ViewScore(len(seeing), len(seeing & used))


def _dimension_errors(surface: TableSurface, truth: Truth) -> tuple[Error, ...]:
    """Compare dimensions by name for equal numbers of corners, else extents of the outlines."""
    true = truth.surface
    called, meant = shape_named(surface.shape), shape_named(true.shape)
    pairs: list[tuple[str, float, float | None, str, float]] = []
    named = meant.extents(true.dimensions or {})
    long_short = (max(named), min(named)) if named else None
    if long_short and called.corners == meant.corners is not None:
        lengths = [item for item in surface.dimensions.items() if item[0] in called.lengths]
        if len(lengths) == 1:
            figure = lengths[0][1]
            names = (
                [("size", long_short[0])]
                if len(set(long_short)) == 1
                else list(zip(("length", "width"), long_short, strict=True))
            )
            pairs = [(n, figure.value, figure.sigma, figure.status, value) for n, value in names]
        else:
            lengths.sort(key=lambda item: -item[1].value)
            pairs = [
                (name, figure.value, figure.sigma, figure.status, value)
                for (name, figure), value in zip(lengths, long_short, strict=False)
            ]
    elif expected := extents(np.array(true.outline)) if true.outline else long_short:
        statuses = {edge.status for edge in surface.edges}
        status = MEASURED if statuses <= {MEASURED} else "inferred"
        for name, value, size in zip(
            ("length", "width"), extents(np.array(surface.outline)), expected, strict=True
        ):
            pairs.append((name, value, None, status, size))
    scale = _scale_error(truth)
    tolerance = true.tolerance.dimensions
    return tuple(
        Error(
            name,
            value - size,
            sigma,
            size,
            max(0.0, abs(value - size) - scale * size - tolerance),
            status,
        )
        for name, value, sigma, status, size in pairs
    )


def _angle_error(surface: TableSurface, true: TrueSurface) -> Error | None:
    called, meant = shape_named(surface.shape), shape_named(true.shape)
    if not called.is_quadrilateral or not meant.is_quadrilateral:
        return None
    expected = (true.dimensions or {}).get(meant.angle, np.pi / 2) if meant.angle else np.pi / 2
    figure = surface.dimensions.get(called.angle) if called.angle else None
    value, sigma = (figure.value, figure.sigma) if figure else (np.pi / 2, None)
    error = float(value - expected)
    return Error("angle", error, sigma, float(expected), abs(error))


def _radius_error(surface: TableSurface, true: TrueSurface) -> Error | None:
    """Compare the radius of round corners; that of sharp ones is 0."""
    if true.corner_radius is None:
        return None
    figure = surface.corner_radius
    value, sigma = (figure.value, figure.sigma) if figure else (0.0, None)
    error = value - true.corner_radius
    return Error("corner radius", error, sigma, true.corner_radius, abs(error))


def _height_error(model: TableModel, truth: Truth) -> Error | None:
    if truth.surface.height is None:
        return None
    figure, size = model.surface.height, truth.surface.height
    error = figure.value - size
    explained = _scale_error(truth) * size + truth.surface.tolerance.height
    if truth.sensor and truth.sensor.pitch and truth.snapshots and truth.surface.pose:
        place = truth.surface.pose
        ranges = [
            np.hypot(s.map_from_base.x - place.x, s.map_from_base.y - place.y)
            for s in truth.snapshots
        ]
        explained += float(np.mean(ranges)) * abs(truth.sensor.pitch)
    return Error("height", error, figure.sigma, size, max(0.0, abs(error) - explained))


def _scale_error(truth: Truth) -> float:
    scale = truth.sensor.depth_scale if truth.sensor else None
    return abs(scale - 1.0) if scale else 0.0


def _outline_distance(estimated: shapely.Geometry, true: shapely.Geometry) -> float:
    """Return the symmetric Hausdorff distance of two outlines, sampled every 5 mm."""
    one_way = [
        shapely.distance(
            shapely.points(shapely.get_coordinates(shapely.segmentize(a.boundary, 0.005))),
            b.boundary,
        ).max()
        for a, b in ((estimated, true), (true, estimated))
    ]
    return float(max(one_way))


def _score_legs(model: TableModel, truth: Truth, truth_from_model: Pose2 | None) -> LegScore | None:
    """Pair legs by the least total distance; places are compared in the top's own frame."""
    if truth.legs is None or truth.surface.pose is None:
        return None
    true_pose = truth.surface.pose
    if not truth.legs or not model.legs:
        return LegScore(0, len(truth.legs), len(model.legs), (), ())
    if truth_from_model is None:
        own = model.surface.pose
        truth_from_model = (
            Pose2(true_pose.x, true_pose.y, true_pose.yaw) @ Pose2(own.x, own.y, own.yaw).inverse()
        )
    centroid = truth_from_model.apply([model.surface.pose.x, model.surface.pose.y])
    estimated = truth_from_model.apply([[leg.x, leg.y] for leg in model.legs]) - centroid
    estimated = _turn_of(model.surface, truth.surface, truth_from_model).rotate(estimated)
    true = np.array([[leg.x, leg.y] for leg in truth.legs]) - [true_pose.x, true_pose.y]
    distances = np.hypot(*(estimated[:, None] - true[None]).transpose(2, 0, 1))
    rows, columns = linear_sum_assignment(np.minimum(distances, LEG_REACH))
    places, sizes = [], []
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        if distances[i, j] > LEG_REACH:
            continue
        leg, truth_leg = model.legs[i], truth.legs[j]
        sigma = leg.position_sigma
        distance = float(distances[i, j])
        # 95 % of a two-dimensional normal lie within 2.448 sigma: scaled so that 1.96 is the bound.
        planar = None if sigma is None else sigma * 2.448 / _BOUND
        places.append(Error("leg", distance, planar, 0.0, distance, leg.status))
        sizes.append(_leg_size(leg.dimensions, truth_leg.dimensions, leg.status))
    found = len(places)
    return LegScore(
        found,
        len(truth.legs) - found,
        len(model.legs) - found,
        tuple(places),
        tuple(sizes),
    )


def _turn_of(surface: TableSurface, true: TrueSurface, truth_from_model: Pose2) -> Pose2:
    """Return the turn of the top onto the true top, if its shape has a heading.

    The fit of the snapshots' poses has its own error: a laser that is not at its place in TF turns
    all poses, but does not turn the table.
    """
    # A shape that is known only by its outline has no heading of its own; nor has a circle.
    periods = [shape_named(shape).symmetry for shape in (surface.shape, true.shape)]
    period = min(period or 0.0 for period in periods)
    if not period or true.pose is None:
        return Pose2()
    turn = wrap_angle(true.pose.yaw - truth_from_model.yaw - surface.pose.yaw, period)
    return Pose2(0.0, 0.0, turn if abs(turn) < LARGEST_TURN else 0.0)


def _leg_size(estimated: dict[str, Dimension], true: dict[str, float], status: str) -> Error:
    """Compare the largest dimension of each."""
    figure = max(estimated.values(), key=lambda f: f.value)
    size = max(true.values())
    error = float(figure.value - size)
    return Error("leg size", error, figure.sigma, size, abs(error), status)
