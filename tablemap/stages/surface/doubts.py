"""Warnings of the surface stage: what speaks against the chosen shape or its figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from tablemap.config import SurfaceConfig
from tablemap.errors import ProcessWarning, WarnedPlace
from tablemap.geometry import Floats, wrap_angles
from tablemap.model.shapes import MESH, POLYGON
from tablemap.stages.surface.candidates import Candidate
from tablemap.stages.surface.choice import contradicting_cells
from tablemap.stages.surface.cuts import blunt_corners
from tablemap.stages.surface.departures import Departure
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.inner import inner_edges
from tablemap.stages.surface.joint import strain_of
from tablemap.stages.surface.result import FittedFigure, Primitive, SurfaceEdge
from tablemap.stages.surface.shapes.rounded import Rounded
from tablemap.stages.surface.shapes.shape import area, signed_distance
from tablemap.stages.surface.shapes.sides import INFERRED, MEASURED, UNSEEN
from tablemap.stages.surface.shapes.straight import Sided
from tablemap.words import counted


def doubts(
    chosen: Candidate,
    primitives: list[Primitive],
    edges: tuple[SurfaceEdge, ...],
    figures: dict[str, FittedFigure],
    away: Sequence[Departure],
    rims: Sequence[Departure],
    corners: Sequence[Departure],
    evidence: Evidence,
    config: SurfaceConfig,
) -> list[ProcessWarning]:
    """Return the doubts about the chosen shape, its sides and its figures."""
    found: list[ProcessWarning] = []
    best = primitives[0]
    if chosen.is_hull:
        found.append(
            _doubt(
                "accuracy.no_primitive",
                "No shape fits the edge of the top; the outline is the hull of the seen top.",
            )
        )
    for other in primitives[1:]:
        differs = np.abs(signed_distance(other.outline, best.outline)).max()
        if other.score > config.ambiguous_score and other.shape != best.shape and differs > 0.003:
            found.append(
                _doubt(
                    "accuracy.shape_ambiguous",
                    f"The top is called a {best.shape} (weight {best.score:.2f}), and a "
                    f"{other.shape} (weight {other.score:.2f}) explains its edge nearly as well.",
                    [WarnedPlace.ring(other.outline)],
                )
            )
    found += _like_another(chosen, primitives) or _hardly_bent(chosen, primitives, evidence)
    found += _partly_seen(chosen, edges, figures, config)
    if len(evidence.views) < 3:
        found.append(
            _doubt(
                "accuracy.few_views",
                f"Only {counted(len(evidence.views), 'view')} saw the edge of the top.",
            )
        )
    scatter = max(chosen.fit.noise.near, chosen.fit.noise.far)
    if scatter > 3:
        found.append(
            _doubt(
                "accuracy.poor_fit",
                f"Edge points scatter {scatter:.1f} times as far about the outline "
                "as their sigmas say.",
            )
        )
    source, strain = strain_of(chosen.fit, evidence)
    if strain > _STRAINED:
        found.append(
            _doubt(
                "accuracy.views_disagree",
                "The edges of the views fit together only with errors of the "
                f"{_ERRORS.get(source, source)} {strain:.1f} times as large as is believed of "
                "them; the table may have been moved during the drive, or a view's pose is wrong.",
            )
        )
    found += _not_followed(chosen, away, evidence) or _without_corner(chosen, evidence, config)
    found += _without_depth(rims, evidence)
    found += _corners_without_depth(chosen, corners, evidence)
    cells = contradicting_cells(chosen.fit.shape.outline(), evidence, config)
    if len(cells) * evidence.cell**2 > 0.02:
        found.append(
            _doubt(
                "accuracy.votes_contradict",
                f"{len(cells) * evidence.cell**2:.3f} square metres contradict the outline: top "
                "was seen outside it, or free space inside it.",
                _patches(cells + evidence.origin, evidence.cell),
            )
        )
    points = chosen.fit.points[evidence.is_whole]
    for edge in inner_edges(points, chosen.fit.shape.outline(), config)[:1]:
        found.append(
            _doubt(
                "accuracy.inner_edge",
                f"{edge.points} edge points form an edge of {edge.length:.2f} m in the outline; "
                "another surface of this height may touch the table.",
                [WarnedPlace.along(edge.ends + evidence.origin)],
            )
        )
    return found


def _doubt(code: str, message: str, places: Iterable[WarnedPlace] = ()) -> ProcessWarning:
    return ProcessWarning(code, "surface", message, places=tuple(places))


def _patches(cells: Floats, size: float) -> list[WarnedPlace]:
    """Return the outlines of the largest patches of square cells (n, 2) of the map."""
    low, high = cells - size / 2, cells + size / 2
    squares = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1], ccw=True)
    patches = shapely.get_parts(shapely.union_all(squares).simplify(size / 2))
    largest = sorted(patches, key=shapely.area, reverse=True)[:_MOST_PATCHES]
    return [WarnedPlace.along(shapely.get_coordinates(one.exterior)) for one in largest]


def _stretches(found: Sequence[Departure], evidence: Evidence) -> list[WarnedPlace]:
    """Return the stretches along the outline."""
    return [WarnedPlace.along(one.places + evidence.origin) for one in found]


_MOST_PATCHES = 12
_MARK = 0.03  # metres: radius of a circle about a corner


_STRAINED = 1.15  # where views fit together it is 0.1 to 0.9
_ERRORS = {"poses": "places", "depth": "cameras' heights", "tilt": "cameras' tilts"}


def _like_another(chosen: Candidate, primitives: Sequence[Primitive]) -> list[ProcessWarning]:
    """Doubt a polygon that but for a small part of its edge is a simple shape.

    A magazine that lies over the edge is as flat as the top, and seems to be a part of it. Tables
    with so small a notch or bump are rare.
    """
    best = primitives[0]
    if not isinstance(chosen.fit.shape, Sided) or chosen.is_hull or best.shape != POLYGON.name:
        return []
    if shapely.Polygon(best.outline).convex_hull.area < _FILLED * area(best.outline):
        return []
    ring = shapely.LinearRing(best.outline)
    places = shapely.get_coordinates(
        ring.interpolate(np.linspace(0.0, 1.0, _SAMPLES, endpoint=False), normalized=True)
    )
    for other in primitives[1:]:
        if other.shape in (POLYGON.name, MESH.name):
            continue
        apart = np.abs(signed_distance(places, other.outline))
        if np.mean(apart < _ALIKE) >= _MOSTLY and apart.max() > _APART:
            length = float(np.mean(apart >= _ALIKE)) * ring.length
            return [
                _doubt(
                    "accuracy.shape_ambiguous",
                    f"But for {length:.2f} m of its edge the top is a {other.shape}; there it lies "
                    f"up to {1e3 * apart.max():.0f} mm off. A thing as flat as paper that lies "
                    "over the edge looks so, and so does one that hides a part of it.",
                    [WarnedPlace.ring(other.outline)],
                )
            ]
    return []


def _hardly_bent(
    chosen: Candidate, primitives: Sequence[Primitive], evidence: Evidence
) -> list[ProcessWarning]:
    """Doubt a polygon with a side that bends inward a little, or steps by centimetres.

    A thin cloth or a board that lies over an end of a table makes it that much wider there. Tables
    with so small an inward bend are rare: an L has right angles, and a kidney is a curve.
    """
    shape = chosen.fit.shape
    if not isinstance(shape, Sided) or chosen.is_hull or primitives[0].shape != POLYGON.name:
        return []
    corners = shape.corners
    along = np.roll(corners, -1, axis=0) - corners
    length = np.linalg.norm(along, axis=1)
    shorter = np.minimum(length, np.roll(length, 1))
    heading = np.arctan2(along[:, 1], along[:, 0])
    turn = wrap_angles(heading - np.roll(heading, 1))
    step = (shorter < _LEAST_STEP) & (np.maximum(length, np.roll(length, 1)) > _LONG)
    bend = (turn > -_SMALL_TURN) & (shorter > _LONG)
    odd = np.flatnonzero((turn < 0) & (bend | step))
    others = [each.shape for each in primitives if each.shape not in (POLYGON.name, MESH.name)]
    if not len(odd) or not others:
        return []
    x, y = corners[odd[0]] + evidence.origin
    how = (
        f"bends inward by {np.degrees(-turn[odd[0]]):.0f} degrees"
        if bend[odd[0]]
        else f"steps by {1e3 * shorter[odd[0]]:.0f} mm"
    )
    return [
        _doubt(
            "accuracy.shape_ambiguous",
            f"At ({x:.2f}, {y:.2f}) in the map a side of the polygon {how}, as hardly a table's "
            f"does. It may be a {others[0]}, and a cloth or a board that lies over its edge, or a "
            "thing that hides a part of it, looks so.",
            [WarnedPlace.about((x, y), _MARK)],
        )
    ]


_LEAST_STEP, _LONG = 0.075, 0.2  # metres: of a step that is meant so, and of a side beside a bend
_SMALL_TURN = np.deg2rad(20.0)

_SAMPLES = 500
_ALIKE, _APART = 0.008, 0.02  # metres between two outlines
_MOSTLY = 0.85  # share of the outline
_FILLED = 1.003  # area of the convex hull over that of the outline: more is not convex


_NARROW = 0.004  # metres: a rim that only widens the sigmas, as of a dark side face


def _without_depth(rims: Sequence[Departure], evidence: Evidence) -> list[ProcessWarning]:
    """Warn of a rim that gives no depth: how long and how wide."""
    rims = [rim for rim in rims if rim.farthest > _NARROW]
    if not rims:
        return []
    length = sum(rim.length for rim in rims)
    widest = max(rim.farthest for rim in rims)
    return [
        _doubt(
            "accuracy.hidden_rim",
            f"Along {length:.2f} m of the top's edge, the depth ends up to {1e3 * widest:.0f} mm "
            "before the background begins, as beside a rim of chrome or of a dark colour; the top "
            "may go on as far there.",
            _stretches(rims, evidence),
        )
    ]


def _corners_without_depth(
    chosen: Candidate, corners: Sequence[Departure], evidence: Evidence
) -> list[ProcessWarning]:
    """Warn of corners that seem to be round, as their depth is missing."""
    shape = chosen.fit.shape
    if not corners or not isinstance(shape, Rounded):
        return []
    farthest = max(corner.farthest for corner in corners)
    return [
        _doubt(
            "accuracy.hidden_rim",
            f"At {len(corners)} of {counted(len(shape.corners), 'corner')} the depth is missing, "
            f"so that a radius of {shape.radius:.3f} m was fitted to the edges of holes; the top "
            f"may have sharp corners, which lie {1e3 * farthest:.0f} mm farther out.",
            _stretches(corners, evidence),
        )
    ]


def _not_followed(
    chosen: Candidate, away: Sequence[Departure], evidence: Evidence
) -> list[ProcessWarning]:
    """Warn of an edge that does not follow the outline: how far off, how long, and where."""
    if not away:
        return []
    worst = max(away, key=lambda departure: abs(departure.farthest))
    x, y = worst.place + evidence.origin
    length = sum(departure.length for departure in away)
    where = "outside" if worst.farthest > 0 else "inside"
    return [
        _doubt(
            "accuracy.outline",
            f"Along {length:.2f} m, the top's edge does not follow the {chosen.name}: it lies up "
            f"to {1e3 * abs(worst.farthest):.0f} mm {where} the outline, farthest at "
            f"({x:.2f}, {y:.2f}) in the map.",
            _stretches(away, evidence),
        )
    ]


def _without_corner(
    chosen: Candidate, evidence: Evidence, config: SurfaceConfig
) -> list[ProcessWarning]:
    """Warn of corners that the edge passes inside, too few or too small for another shape."""
    blunt = [] if chosen.is_hull else blunt_corners(chosen.fit, evidence, config)
    if not blunt:
        return []
    place, inside = max(blunt, key=lambda corner: corner[1])
    x, y = place + evidence.origin
    return [
        _doubt(
            "accuracy.outline",
            f"At {counted(len(blunt), 'corner')} of the {chosen.name} the top's edge passes up to "
            f"{1e3 * inside:.0f} mm inside, as where a corner is cut off or round: farthest at "
            f"({x:.2f}, {y:.2f}) in the map.",
            [WarnedPlace.about(one + evidence.origin, _MARK) for one, _ in blunt],
        )
    ]


def _partly_seen(
    chosen: Candidate,
    edges: tuple[SurfaceEdge, ...],
    figures: dict[str, FittedFigure],
    config: SurfaceConfig,
) -> list[ProcessWarning]:
    """Warn of sides that were not seen, or only in part; doubt the figures that depend on them."""
    if not isinstance(chosen.fit.shape, Sided) or chosen.is_hull:
        if all(figure.status == MEASURED for figure in figures.values()):
            return []
        sigmas = [figure.sigma for figure in figures.values()]
        share = float(np.mean([edge.seen_fraction for edge in edges]))
        message = f"Only {100 * share:.0f} % of the top's edge was seen."
        where = [WarnedPlace.along(one.points) for one in edges if one.status != MEASURED]
        return [_doubt(_partly_code(sigmas, config), message, where)]
    found = []
    sides = [k for k, edge in enumerate(edges) if len(edge.points) == 2]
    unseen = [k for k in sides if edges[k].status == UNSEEN]
    if unseen:
        seen = "were not seen and are" if len(unseen) > 1 else "was not seen and is"
        found.append(
            _doubt(
                "accuracy.unseen_side",
                f"{_sides_of(edges, unseen, sides)} {seen} only bounded.",
                [WarnedPlace.along(edges[k].points) for k in unseen],
            )
        )
    partly = [k for k in sides if edges[k].status == INFERRED]
    if partly:
        sigmas = [_end_sigma(chosen, k) for k in partly]
        were = "were" if len(partly) > 1 else "was"
        message = f"{_sides_of(edges, partly, sides)} {were} seen only in part."
        where = [WarnedPlace.along(edges[k].points) for k in partly]
        found.append(_doubt(_partly_code(sigmas, config), message, where))
    return found


def _partly_code(sigmas: Sequence[float | None], config: SurfaceConfig) -> str:
    held = all(sigma is not None and sigma < config.held_sigma for sigma in sigmas)
    return "surface.inferred_side" if held else "accuracy.inferred_side"


def _end_sigma(chosen: Candidate, side: int) -> float:
    """Return the standard deviation across a straight side at its less certain end, metres."""
    shape, covariance = chosen.fit.shape, chosen.spread.covariance
    piece = shape.pieces()[side]
    along = piece[1] - piece[0]
    outward = np.array([along[1], -along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    rows = shape.measure(piece, np.tile(outward, (2, 1))).jacobian
    return float(np.sqrt(np.einsum("ij,jk,ik->i", rows, covariance, rows).max()))


def _sides_of(edges: tuple[SurfaceEdge, ...], chosen: list[int], sides: list[int]) -> str:
    named = ", ".join(
        f"{np.linalg.norm(edges[k].points[1] - edges[k].points[0]):.2f} m" for k in chosen
    )
    return f"{len(chosen)} of {counted(len(sides), 'side')} ({named})"
