"""From all views' edges to the chosen top with its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.errors import EstimationError
from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import CORNER_RADIUS
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration
from tablemap.stages.surface.budget import budget_of
from tablemap.stages.surface.candidates import Candidate, fit_candidates, hull_of, refit_candidates
from tablemap.stages.surface.choice import weights
from tablemap.stages.surface.departures import Departure, bowed_sides, departures
from tablemap.stages.surface.doubts import doubts
from tablemap.stages.surface.evidence import Evidence, gather
from tablemap.stages.surface.height import height_of
from tablemap.stages.surface.joint import JointFit, corrected_poses
from tablemap.stages.surface.motion import Mounting
from tablemap.stages.surface.priors import face_widening
from tablemap.stages.surface.result import FittedFigure, Primitive, Surface, SurfaceEdge
from tablemap.stages.surface.rims import hidden_corners, hidden_rims
from tablemap.stages.surface.shapes.shape import Shape
from tablemap.stages.surface.shapes.sides import UNSEEN
from tablemap.stages.surface.status import own_statuses, sights
from tablemap.words import counted


def fit_surface(
    outline: Outline,
    registration: Registration,
    *,
    config: SurfaceConfig,
    sensors: SensorsConfig,
    seed: int,
    mounting: Mounting | None = None,
    first: Surface | None = None,
) -> Surface:
    """Fit every primitive to the table edges of all views at once and choose among them.

    ``mounting`` is what the table's legs say of the camera, once they are known. If ``first`` is a
    fit to the same outline without that, its shapes are where this one starts. Raises
    `EstimationError` if too little of the top was seen for any outline.
    """
    evidence, warnings = gather(outline, registration, config, sensors, mounting)
    if first is not None and first.states:
        candidates = refit_candidates(evidence, config, first.states)
    else:
        candidates = fit_candidates(evidence, config, np.random.default_rng(seed))
    if not candidates:
        raise EstimationError(
            f"expected an outline through {counted(len(evidence.points), 'point')} on the table's "
            "edge; no shape, not even their hull, has an area; record views from more sides of the "
            "table"
        )
    standing = [c for c in candidates if c.is_hull or c.inlier_fraction >= config.minimum_inliers]
    fallen = [c for c in candidates if c not in standing]
    scores = weights([c.cost for c in standing]) if standing else []
    if not standing:
        standing, fallen, scores = candidates, [], weights([c.cost for c in candidates])
    chosen = standing[0]
    primitives = [
        _primitive(candidate, score, evidence, config)
        for candidate, score in zip(standing + fallen, scores + [0.0] * len(fallen), strict=True)
    ]
    away: list[Departure] = []
    rims: list[Departure] = []
    corners: list[Departure] = []
    if not chosen.is_hull:
        away = departures(chosen.fit, evidence) or bowed_sides(chosen.fit, evidence)
        rims = hidden_rims(chosen.fit, outline, evidence, config)
        corners = hidden_corners(chosen.fit, outline, evidence)
    figures = _budgeted(chosen, standing, scores, away, rims, evidence, config)
    radius = figures.pop(CORNER_RADIUS, None)
    edges = _edges(chosen, [*away, *rims, *corners], evidence, config)
    if radius is not None and corners:  # every second edge is a corner's arc
        radius = _perhaps_sharp(radius, 2 * len(corners) / len(edges))
    height, distant = height_of(outline, chosen)
    relative = _pose_covariance(chosen)
    if rims:  # one of two opposite sides shifts the middle by half
        relative[:2, :2] += np.eye(2) * _mean_square(rims) / 4
    return Surface(
        shape=chosen.name,
        pose=primitives[0].pose,
        covariance=_in_map(relative, chosen, evidence, registration),
        relative_covariance=relative,
        height=height,
        thickness=_thickness(outline, mounting, sensors),
        dimensions=figures,
        corner_radius=radius,
        outline=primitives[0].outline,
        edges=edges,
        score=scores[0],
        candidates=tuple(primitives),
        map_from_base={
            index: Pose2.from_array(pose + np.array([*evidence.origin, 0.0]))
            for index, pose in enumerate(corrected_poses(chosen.fit, evidence))
        },
        points=chosen.fit.points + evidence.origin,
        residuals=chosen.fit.distance,
        hull=hull_of(evidence, chosen.fit.points[chosen.fit.misfit < 5]) + evidence.origin,
        warnings=(
            *warnings,
            *distant,
            *doubts(chosen, primitives, edges, figures, away, rims, corners, evidence, config),
        ),
        beside=outline.beside,
        states=tuple(c.fit.state for c in candidates if not c.is_hull),
    )


def _thickness(
    outline: Outline, mounting: Mounting | None, sensors: SensorsConfig
) -> FittedFigure | None:
    """Take off the side face what depth adds to its lower end, which stands before a background."""
    if outline.thickness is None:
        return None
    pixels, uncertain = face_widening(mounting, sensors)
    value = max(outline.thickness - pixels * outline.thickness_per_px, _THINNEST)
    own = _finite(outline.thickness_sigma)
    if own is None:
        return FittedFigure(value, None)
    return FittedFigure(value, float(np.hypot(own, uncertain * outline.thickness_per_px)))


_THINNEST = 0.001  # metres


def _finite(sigma: float | None) -> float | None:
    return float(sigma) if sigma is not None and np.isfinite(sigma) else None


def _primitive(
    candidate: Candidate,
    score: float,
    evidence: Evidence,
    config: SurfaceConfig,
) -> Primitive:
    figures = _figures(candidate, evidence, config)
    radius = figures.pop(CORNER_RADIUS, None)
    return Primitive(
        shape=candidate.name,
        pose=_pose(candidate.fit.shape, evidence),
        dimensions=figures,
        outline=candidate.fit.shape.outline() + evidence.origin,
        cost=candidate.cost,
        score=score,
        inlier_fraction=candidate.inlier_fraction,
        residuals=candidate.fit.distance,
        corner_radius=radius,
    )


def _pose(shape: Shape, evidence: Evidence) -> Pose2:
    x, y, yaw = shape.describe()[0]
    period = shape.record.yaw_period
    yaw = yaw % period if period else 0.0
    return Pose2(float(x + evidence.origin[0]), float(y + evidence.origin[1]), float(yaw))


def _figures(
    candidate: Candidate, evidence: Evidence, config: SurfaceConfig
) -> dict[str, FittedFigure]:
    if candidate.is_hull:
        return {}
    fit, record = candidate.fit, candidate.fit.shape.record
    _, values = fit.shape.describe()
    if not values:
        return {}
    seen = sights(fit, evidence, config)
    sides = fit.shape.side_statuses(own_statuses(seen, config))
    status = fit.shape.dimension_statuses(seen, sides)
    jacobian = _derivative(fit.shape)[3:]
    variance = np.einsum("ij,jk,ik->i", jacobian, candidate.spread.covariance, jacobian)
    unbounded = _unbounded(fit)
    systematic = config.dimension_systematic
    figures = {}
    for index, (name, value) in enumerate(values.items()):
        extra = systematic
        if name == record.angle:
            extra = systematic / min(values[length] for length in record.lengths)
        sigma = float(np.hypot(np.sqrt(max(variance[index], 0.0)), extra))
        # If nothing bounds a side from outside, the covariance says nothing about its figure.
        is_open = status[name] == UNSEEN and (unbounded or sigma > value)
        figures[name] = FittedFigure(value, None if is_open else sigma, status[name])
    return figures


def _budgeted(
    chosen: Candidate,
    standing: Sequence[Candidate],
    scores: Sequence[float],
    away: Sequence[Departure],
    rims: Sequence[Departure],
    evidence: Evidence,
    config: SurfaceConfig,
) -> dict[str, FittedFigure]:
    """Return the figures of the chosen shape with the parts of their variance.

    Four parts are added that the fit's covariance lacks: other shapes that explain the edges nearly
    as well have other dimensions; a figure of a shape that the edge does not follow is as uncertain
    as the edge is far from it; a rim without depth lies beyond the edge on both sides; and a partly
    seen side may bend where it was not seen.
    """
    figures = _figures(chosen, evidence, config)
    if not figures:
        return figures
    fit = chosen.fit
    names = list(fit.shape.describe()[1])
    budgets = budget_of(fit, evidence, config, _derivative(fit.shape)[3:])
    hidden = [1.0 / max(sight.fraction, 0.05) - 1.0 for sight in sights(fit, evidence, config)]
    share = (_HIDDEN_M * float(np.mean(hidden))) ** 2
    alternatives = [
        (score, candidate.fit.shape.describe()[1])
        for candidate, score in zip(standing, scores, strict=True)
        if not candidate.is_hull
    ]
    result = {}
    for name, figure in figures.items():
        if figure.sigma is None:
            result[name] = figure
            continue
        parts = budgets[names.index(name)]
        parts["other"] = max(figure.sigma**2 - sum(parts.values()), 0.0)
        parts["shape"] = sum(
            score * (values[name] - figure.value) ** 2
            for score, values in alternatives
            if name in values
        )
        if away and name != fit.shape.record.angle:
            parts["shape"] += _mean_square(away)
        if rims and name != fit.shape.record.angle:  # on both sides
            parts["shape"] += 4 * _mean_square(rims)
        parts["share"] = share if name != fit.shape.record.angle else 0.0
        sigma = float(np.sqrt(sum(parts.values())))
        result[name] = replace(figure, sigma=sigma, budget=parts)
    return result


def _perhaps_sharp(radius: FittedFigure, share: float) -> FittedFigure:
    """Widen the radius of corners by the ``share`` of them without depth, which may be sharp."""
    if radius.sigma is None:
        return radius
    parts = dict(radius.budget or {})
    parts["shape"] = parts.get("shape", 0.0) + (share * radius.value) ** 2
    return replace(radius, sigma=float(np.hypot(radius.sigma, share * radius.value)), budget=parts)


def _mean_square(away: Sequence[Departure]) -> float:
    return float(np.mean(np.concatenate([departure.offsets for departure in away]) ** 2))


_HIDDEN_M = 0.0005  # metres: bend of an unseen part that is as long as the seen part


def _unbounded(fit: JointFit) -> bool:
    return any(not anchor.is_bounded for anchor in fit.anchors)


def _derivative(shape: Shape) -> Floats:
    """Differentiate the pose and the dimensions (3 + d, k) by the parameters, numerically."""

    def described(parameters: Floats) -> Floats:
        pose, values = shape.at(parameters).describe()
        return np.concatenate([pose, np.array(list(values.values()))])

    here = described(shape.parameters)
    result = np.empty((len(here), len(shape.parameters)))
    for index in range(len(shape.parameters)):
        step = np.zeros(len(shape.parameters))
        step[index] = 1e-6
        change = described(shape.parameters + step) - described(shape.parameters - step)
        # The yaw may jump by half a turn: the axis is the same.
        change[2] = (change[2] + np.pi / 2) % np.pi - np.pi / 2
        result[:, index] = change / 2e-6
    return result


def _pose_covariance(candidate: Candidate) -> Floats:
    """Return the covariance (3, 3) of the top's pose against the stops."""
    jacobian = _derivative(candidate.fit.shape)[:3]
    covariance: Floats = jacobian @ candidate.spread.covariance @ jacobian.T
    return (covariance + covariance.T) / 2


def _in_map(
    relative: Floats, candidate: Candidate, evidence: Evidence, registration: Registration
) -> Floats:
    """Add the covariance of the stops in the map."""
    centre = candidate.fit.shape.describe()[0][:2]
    lever = centre - evidence.poses[:, :2].mean(axis=0)
    carry = np.eye(3)
    carry[:2, 2] = [-lever[1], lever[0]]
    covariance = relative + carry @ registration.placement_covariance @ carry.T
    result: Floats = (covariance + covariance.T) / 2
    return result


def _edges(
    candidate: Candidate,
    away: Sequence[Departure],
    evidence: Evidence,
    config: SurfaceConfig,
) -> tuple[SurfaceEdge, ...]:
    fit = candidate.fit
    seen = sights(fit, evidence, config)
    status = fit.shape.side_statuses(own_statuses(seen, config))
    unbounded = {anchor.side for anchor in fit.anchors if not anchor.is_bounded}
    systematic = config.dimension_systematic
    pieces = fit.shape.pieces()
    lines = [shapely.LineString(piece) for piece in pieces]
    departing: dict[int, list[Departure]] = {}
    for departure in away:
        index = departure.side
        if index is None:
            middle = shapely.Point(departure.place)
            index = int(np.argmin([line.distance(middle) for line in lines]))
        departing.setdefault(index, []).append(departure)
    edges = []
    for index, piece in enumerate(pieces):
        middle = piece[len(piece) // 2] if len(piece) > 2 else piece.mean(axis=0)
        along = piece[-1] - piece[0]
        outward = np.array([along[1], -along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
        row = fit.shape.measure(middle[None], outward[None]).jacobian[0]
        variance = max(row @ candidate.spread.covariance @ row, 0) + systematic**2
        if index in departing:
            variance += _mean_square(departing[index])
        sigma: float | None = float(np.sqrt(variance))
        if candidate.is_hull or index in unbounded:
            sigma = None
        edges.append(
            SurfaceEdge(piece + evidence.origin, status[index], sigma, seen[index].fraction)
        )
    return tuple(edges)
