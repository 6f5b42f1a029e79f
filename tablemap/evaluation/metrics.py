"""Comparison of a model with the truth: every error of one run."""

from __future__ import annotations

import numpy as np
import shapely

from tablemap.errors import is_doubt
from tablemap.evaluation.alignment import align, matched
from tablemap.evaluation.leg_places import score_legs, symmetry
from tablemap.evaluation.score import MEASURED, YAW, Error, Score, ViewScore
from tablemap.evaluation.truth import TrueSurface, Truth
from tablemap.geometry import Pose2, wrap_angle
from tablemap.model import TableModel, TableSurface
from tablemap.model.shapes import shape_named
from tablemap.stages.surface.shapes.shape import extents

SEES_TOP = 0.1
"""A view sees the top if it shows at least this share of its area unhidden."""


def score(model: TableModel, truth: Truth) -> Score:
    """Compare a model with the truth of its recording."""
    aligned = align(model, truth)
    truth_from_model = aligned.truth_from_model
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
        poses=aligned.poses,
        headings=aligned.headings,
        outline=outline,
        iou=iou,
        legs=score_legs(model, truth, truth_from_model),
        doubts=tuple(w.code for w in model.warnings if is_doubt(w.code)),
        weights=_weights(model.surface),
        views=_score_views(model, truth),
        corner_radius=_radius_error(model.surface, truth.surface),
        thickness=_thickness_error(model.surface, truth.surface),
        place=_place_errors(model, truth),
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


def _score_views(model: TableModel, truth: Truth) -> ViewScore | None:
    """Count the rests that see the top, and those used; None if the truth does not know."""
    seen = {
        known.rest: known.sees_top >= SEES_TOP
        for known in truth.snapshots or ()
        if known.rest is not None and known.sees_top is not None
    }
    if not seen:
        return None
    used = {known.rest for snapshot, known in matched(model, truth) if snapshot.used}
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


def _thickness_error(surface: TableSurface, true: TrueSurface) -> Error | None:
    figure, size = surface.thickness, true.thickness
    if figure is None or size is None:
        return None
    error = figure.value - size
    return Error("thickness", error, figure.sigma, size, abs(error))


def _place_errors(model: TableModel, truth: Truth) -> tuple[Error, ...]:
    """Compare the pose of the top in the map, which the localisation gives, with the true one."""
    true, found = truth.surface.pose, model.surface.pose
    if true is None:
        return ()
    x, y, yaw = (float(sigma) for sigma in np.sqrt(np.diag(np.array(found.covariance))))
    errors = [("place x", found.x - true.x, x, true.x), ("place y", found.y - true.y, y, true.y)]
    period = symmetry(model.surface, truth.surface)
    if period:
        errors.append((YAW, wrap_angle(found.yaw - true.yaw, period), yaw, true.yaw))
    return tuple(Error(name, error, sigma, size, abs(error)) for name, error, sigma, size in errors)


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
