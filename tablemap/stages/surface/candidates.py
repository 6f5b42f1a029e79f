"""Every primitive, fitted from its best start, and the hull in case no primitive is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats
from tablemap.model.shapes import MESH
from tablemap.stages.surface.choice import (
    Criterion,
    assumed_noise,
    criterion,
    dispersion_of,
    estimate_noise,
)
from tablemap.stages.surface.cuts import chamfered, seems_round
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import (
    Anchor,
    JointFit,
    Spread,
    fit_jointly,
    measure,
    spread_of,
    unfitted,
)
from tablemap.stages.surface.polygons import polygons
from tablemap.stages.surface.residuals import Noise, State
from tablemap.stages.surface.shapes.curved import Circle
from tablemap.stages.surface.shapes.registry import PRIMITIVES
from tablemap.stages.surface.shapes.rounded import Rounded
from tablemap.stages.surface.shapes.shape import Shape, area
from tablemap.stages.surface.shapes.straight import Parallelogram, Polygon, Rectangle, Sided
from tablemap.stages.surface.starts import generators
from tablemap.stages.surface.status import hold_unseen, own_statuses, sights


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted shape with its uncertainty and its cost.

    ``is_hull`` marks the hull, which is no primitive.
    """

    fit: JointFit
    spread: Spread
    criterion: Criterion
    cost: float
    inlier_fraction: float
    is_hull: bool = False

    @property
    def name(self) -> str:
        """The shape's name in the model."""
        return (MESH if self.is_hull else self.fit.shape.record).name


def fit_candidates(
    evidence: Evidence, config: SurfaceConfig, random: np.random.Generator
) -> list[Candidate]:
    """Fit every primitive, each kind from its best start, and the hull; cheapest first."""
    sigma = float(np.median(evidence.sigma))
    wide = (max(0.03 / sigma, config.loss_sigmas), max(0.01 / sigma, config.loss_sigmas))
    narrow = (config.loss_sigmas,)
    coarse = evidence.thinned(config.points_coarse)
    assumed = assumed_noise(evidence)

    def quickly(starts: list[State], gates: tuple[float, ...]) -> list[JointFit]:
        """Fit all starts to few points; return the one with the least residuals, if any."""
        fits = [
            _settle(start, coarse, config, gates, assumed_noise(coarse))
            for start in starts
            if start.shape.is_plausible()
        ]
        return sorted(fits, key=_raw_cost)[:1]

    def fully(fit: JointFit) -> JointFit:
        return _settle(fit.state, evidence, config, narrow, assumed)

    def hopeful(fits: list[JointFit]) -> list[JointFit]:
        """Return the fits to few points that fits to all of them may bring near the best one."""
        costs = [_cost(fit, coarse, config) for fit in fits]
        most = min(costs, default=0.0) + _HOPELESS_OF_FEW
        return [fit for fit, cost in zip(fits, costs, strict=True) if cost <= most]

    def rounded(sharp: list[JointFit]) -> list[JointFit]:
        """Round the corners of fitted shapes; return the cheapest, unless it seems sharp.

        A fit that is not told from a sharp one must not tell of the noise either.
        """
        fits = [
            found
            for fit in sharp
            if isinstance(fit.shape, Sided) and _seems_round(fit.shape, fit.state, coarse, config)
            for found in quickly(
                [replace(fit.state, shape=start) for start in Rounded.starts_of(fit.shape)],
                (wide[1], *narrow),
            )
        ]
        cheapest = sorted(fits, key=lambda fit: _cost(fit, coarse, config))[:1]
        round_ones = [
            fully(fit)
            for fit in cheapest
            if isinstance(fit.shape, Rounded) and fit.shape.radius > fit.shape.seeming(config)
        ]
        return [
            fit
            for fit in round_ones
            if fit.shape.is_told(spread_of(fit, evidence, config).covariance, config)
        ]

    def cut(sharp: list[JointFit]) -> list[JointFit]:
        """Cut the corners of fitted shapes where that explains the points better."""
        return [
            fully(found)
            for fit in sharp
            for found in quickly(
                [replace(fit.state, shape=start) for start in chamfered(fit, coarse, config)],
                (wide[1], *narrow),
            )
        ]

    starts = generators(evidence, config, random)
    quick: dict[type[Shape], list[JointFit]] = {}
    for kind in PRIMITIVES:
        inside = [
            start
            for box in quick.get(Rectangle, [])
            for start in kind.starts_in(box.shape.parameters)
        ]
        # A kind that starts only from a fitted rectangle starts near its place.
        gates = (*wide, *narrow) if kind in starts else (wide[1], *narrow)
        own = [unfitted(start, coarse) for start in (*inside, *starts.get(kind, []))]
        quick[kind] = quickly(own, gates)
    few = [fit for found in quick.values() for fit in found]
    likely = hopeful(few)
    fits = [
        fully(fit) if fit in likely else measure(fit.state, evidence, config, noise=assumed)
        for fit in few
    ]
    straight = hopeful([fit for fit in few if isinstance(fit.shape, Sided)])
    primitive = [
        *([fit] for fit in fits),
        *(rounded([fit]) for fit, of_few in zip(fits, few, strict=True) if of_few in straight),
    ]
    simple = [fit for found in primitive for fit in found]
    # The nuisances of the best simple shape place the points well for the search for polygons.
    placed = min(simple, key=_raw_cost, default=None)
    if placed is not None and _inliers(placed, evidence) > 0.8:
        nuisances, points, normals = placed.state, placed.points, placed.normals
    else:
        nuisances = unfitted(_ANY_SHAPE, evidence)
        points, normals = evidence.points, evidence.normals
    proposed = polygons(points, normals, evidence, config)
    promising = _promising(proposed, coarse, nuisances, config, wide[1])
    polygonal = [
        _settle(replace(nuisances, shape=fit.shape), evidence, config, (wide[1], *narrow), assumed)
        for fit in promising[:_MOST_POLYGONS]
    ]
    cuts = cut([*quick.get(Rectangle, []), *promising[:_MOST_POLYGONS]])
    return _weighed([*primitive, polygonal, rounded(promising), cuts], evidence, config, assumed)


def _seems_round(sharp: Sided, state: State, evidence: Evidence, config: SurfaceConfig) -> bool:
    """Tell whether any radius explains the points better than sharp corners, without a fit.

    To measure a dozen radii takes a tenth of the time of a fit, and most tables' corners are sharp.
    """
    noise = assumed_noise(evidence)

    def cost(shape: Shape) -> float:
        return _raw_cost(measure(replace(state, shape=shape), evidence, config, noise=noise))

    least = cost(sharp)
    return any(cost(shape) < least for shape in Rounded.of_all_radii(sharp, config))


def refit_candidates(
    evidence: Evidence, config: SurfaceConfig, states: Sequence[State]
) -> list[Candidate]:
    """Fit the primitives again from the states of an earlier fit to the same points.

    For evidence whose priors alone have changed: each shape is near its best place already.
    """
    assumed = assumed_noise(evidence)
    fits = [measure(state, evidence, config, noise=assumed) for state in states]
    costs = [_cost(fit, evidence, config) for fit in fits]
    near = min(costs, default=0.0) + _HOPELESS
    gates = (config.loss_sigmas,)
    fits = [
        _settle(fit.state, evidence, config, gates, assumed) if cost <= near else fit
        for fit, cost in zip(fits, costs, strict=True)
    ]
    return _weighed([[fit] for fit in fits], evidence, config, assumed)


def _weighed(
    fits: list[list[JointFit]], evidence: Evidence, config: SurfaceConfig, assumed: Noise
) -> list[Candidate]:
    """Fit all again with the noise that the residuals show, and keep the cheapest of each kind."""
    everything = [fit for found in fits for fit in found]
    noise = assumed
    if everything:
        # The closest fit shows the noise: the residuals of a wrong shape are not only noise.
        noise = estimate_noise(min(everything, key=_raw_cost), evidence)
    costs = [[_cost(fit, evidence, config) for fit in found] for found in fits]
    least = min((cost for its in costs for cost in its), default=np.inf)
    candidates = []
    for found, its in zip(fits, costs, strict=True):
        refined = []
        for fit, cost in zip(found, its, strict=True):
            fit = _normalised(fit)
            if cost > least + _HOPELESS:
                fit = measure(fit.state, evidence, config, noise=noise)
            else:
                fit = _settle(fit.state, evidence, config, (config.loss_sigmas,), noise)
            if fit.shape.normalised() is not fit.shape:
                state = _normalised(fit).state
                fit = _settle(state, evidence, config, (config.loss_sigmas,), noise)
            candidate = _candidate(fit, evidence, config)
            if _is_supported(candidate, evidence, config) and not seems_round(
                fit, evidence, config
            ):
                refined.append(candidate)
        if refined:
            candidates.append(min(refined, key=lambda candidate: candidate.cost))
    hull = _hull_candidate(evidence, config, noise, candidates)
    if hull is not None:
        candidates.append(hull)
    if not candidates:
        return []
    closest = min((candidate.fit for candidate in candidates), key=_raw_cost)
    dispersion = dispersion_of(closest)
    weighed = [replace(each, cost=each.criterion.cost(dispersion)) for each in candidates]
    return sorted(_unbent(weighed, evidence, config), key=lambda candidate: candidate.cost)


def _unbent(
    candidates: list[Candidate], evidence: Evidence, config: SurfaceConfig
) -> list[Candidate]:
    """Reduce the evidence for skewed shapes, as a bent drive makes a rectangle look skewed.

    The evidence for an angle is d^2 / sigma^2. If the poses may be bent by ``Evidence.skew_sigma``,
    it is only d^2 / (sigma^2 + skew^2). A parallelogram has one free angle more than a rectangle,
    and any other figure of four sides has three more.
    """
    upright = {_is_rounded(c): c for c in reversed(candidates) if isinstance(_sharp(c), Rectangle)}
    if not evidence.skew_sigma:
        return candidates
    result = []
    for each in candidates:
        rectangle, shape = upright.get(_is_rounded(each)), _sharp(each)
        freed = 0
        if isinstance(shape, Parallelogram):
            freed, angles = 1, slice(5, 6)
        elif isinstance(shape, Polygon) and len(shape.parameters) == 8:
            freed, angles = 3, slice(0, 4)
        if freed and rectangle is not None:
            effective = max(len(each.fit.distance) / each.fit.noise.kappa, 2.0)
            penalty = freed * (float(np.log(effective)) + config.symmetry_cost)
            advantage = max(rectangle.cost - (each.cost - penalty), 0.0)
            variance = float(np.mean(np.diag(each.spread.covariance)[angles]))
            share = variance / (variance + evidence.skew_sigma**2)
            each = replace(each, cost=rectangle.cost + penalty - share * advantage)
        result.append(each)
    return result


def _is_rounded(candidate: Candidate) -> bool:
    return isinstance(candidate.fit.shape, Rounded)


def _sharp(candidate: Candidate) -> Shape:
    shape = candidate.fit.shape
    return shape.sharp if isinstance(shape, Rounded) else shape


def _normalised(fit: JointFit) -> JointFit:
    return replace(fit, state=replace(fit.state, shape=fit.shape.normalised()))


def _settle(
    start: State,
    evidence: Evidence,
    config: SurfaceConfig,
    gates: tuple[float, ...],
    noise: Noise,
) -> JointFit:
    """Fit with each loss scale in turn; before each, anchor the sides without edge points."""
    if not isinstance(start.shape, Sided):
        return fit_jointly(start, evidence, config, gates=gates, iterations=8, noise=noise)

    def held(fit: JointFit, gate: float, anchors: tuple[Anchor, ...]) -> JointFit:
        return fit_jointly(
            fit.state, evidence, config, gates=(gate,), iterations=8, anchors=anchors, noise=noise
        )

    fit = measure(start, evidence, config, noise=noise)
    for gate in gates:
        fit = held(fit, gate, hold_unseen(fit, evidence, config))
    # The last fit may have taken a side away from its edge points, or brought it to some.
    anchors = hold_unseen(fit, evidence, config)
    if [anchor.side for anchor in anchors] != [anchor.side for anchor in fit.anchors]:
        fit = held(fit, gates[-1], anchors)
    return fit


def _promising(
    shapes: list[Sided],
    coarse: Evidence,
    nuisances: State,
    config: SurfaceConfig,
    gate: float,
) -> list[JointFit]:
    """Fit the polygons quickly, to few points; the best ones first."""
    noise = assumed_noise(coarse)
    fits = [
        _settle(replace(nuisances, shape=shape), coarse, config, (gate, config.loss_sigmas), noise)
        for shape in shapes
    ]
    plausible = [fit for fit in fits if fit.shape.is_plausible()]
    return sorted(plausible, key=lambda fit: _cost(fit, coarse, config))


_MOST_POLYGONS = 2  # that are fitted to all points

# A candidate whose cost exceeds the least cost by this much has a weight of practically zero.
_HOPELESS = 100.0
_HOPELESS_OF_FEW = 3 * _HOPELESS  # few points say it less surely

_ANY_SHAPE = Circle(np.array([0.0, 0.0, 0.5]))


def hull_of(evidence: Evidence, points: Floats) -> Floats:
    """Return the concave hull (n, 2), counter-clockwise, of all seen top and the edge points."""
    seen = shapely.MultiPoint(np.concatenate([evidence.top, points]))
    ring = shapely.concave_hull(seen, ratio=0.15)
    if not isinstance(ring, shapely.Polygon) or ring.is_empty:
        ring = shapely.convex_hull(seen)
    if not isinstance(ring, shapely.Polygon):
        return np.empty((0, 2))
    corners = np.asarray(ring.exterior.coords)[:-1]
    return corners if area(corners) > 0 else corners[::-1]


def _cost(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> float:
    return criterion(fit, evidence, config).cost()


def _raw_cost(fit: JointFit) -> float:
    return fit.data_cost / fit.noise.kappa + fit.prior_cost


def _inliers(fit: JointFit, evidence: Evidence) -> float:
    limit = np.maximum(3 * fit.noise.sigma(evidence), 0.01)
    return float(np.mean((fit.side >= 0) & (np.abs(fit.distance) < limit)))


def _candidate(
    fit: JointFit, evidence: Evidence, config: SurfaceConfig, *, is_hull: bool = False
) -> Candidate:
    weighed = criterion(fit, evidence, config)
    return Candidate(
        fit=fit,
        spread=spread_of(fit, evidence, config),
        criterion=weighed,
        cost=weighed.cost(),
        inlier_fraction=_inliers(fit, evidence),
        is_hull=is_hull,
    )


def _is_supported(candidate: Candidate, evidence: Evidence, config: SurfaceConfig) -> bool:
    """Tell whether the evidence is able to support this shape."""
    fit = candidate.fit
    if not fit.shape.is_plausible() or not np.isfinite(fit.data_cost):
        return False
    own = own_statuses(sights(fit, evidence, config), config)
    return fit.shape.is_shown(own) and fit.shape.is_told(candidate.spread.covariance, config)


def _hull_candidate(
    evidence: Evidence, config: SurfaceConfig, noise: Noise, candidates: list[Candidate]
) -> Candidate | None:
    """Take the hull of the seen top as a polygon, with the parameters of all its sides."""
    if candidates:
        fit = min((candidate.fit for candidate in candidates), key=_raw_cost)
        nuisances, points = fit.state, fit.points[fit.misfit < 5]
    else:
        nuisances, points = unfitted(_ANY_SHAPE, evidence), evidence.points
    ring = hull_of(evidence, points)
    for tolerance in (0.01, 0.02, 0.04):
        if len(ring) < 3:
            return None
        simple = np.asarray(shapely.Polygon(ring).simplify(tolerance).exterior.coords)[:-1]
        shape = _through(simple if area(simple) > 0 else simple[::-1])
        if shape.is_plausible():
            measured = measure(replace(nuisances, shape=shape), evidence, config, noise=noise)
            return _candidate(measured, evidence, config, is_hull=True)
    return None


def _through(ring: Floats) -> Polygon:
    along = np.roll(ring, -1, axis=0) - ring
    angle = np.unwrap(np.arctan2(-along[:, 0], along[:, 1]))
    offset = ring[:, 0] * np.cos(angle) + ring[:, 1] * np.sin(angle)
    return Polygon(np.concatenate([angle, offset]))
