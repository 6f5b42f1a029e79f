"""A model's summary: the few lines that people read first."""

from __future__ import annotations

import math

from tablemap.model import Figure, TableModel, TableSurface
from tablemap.model.shapes import is_angle, shape_named


def summary_rows(model: TableModel) -> list[tuple[str, str]]:
    """Return the rows (name, text) of a model's summary; lengths in metres, sigmas in mm."""
    surface, pose = model.surface, model.surface.pose
    sigma_xy = math.sqrt(max(pose.covariance[0][0] + pose.covariance[1][1], 0.0) / 2)
    sigma_yaw = math.degrees(math.sqrt(max(pose.covariance[2][2], 0.0)))
    rows = [("shape", f"{surface.shape}, weight {surface.score:.2f}{_alternatives(model)}")]
    for name, figure in surface.dimensions.items():
        text = angle(figure) if is_angle(name) else length(figure)
        rows.append((name, text if figure.status == "measured" else f"{text}, {figure.status}"))
    if not surface.dimensions and surface.outline:
        rows.append(("extent", _extent(surface)))
    if surface.corner_radius:
        rows.append(("corner radius", length(surface.corner_radius)))
    rows.append(("height", length(surface.height)))
    if surface.thickness:
        rows.append(("thickness", length(surface.thickness)))
    place = f"({pose.x:z.3f}, {pose.y:z.3f}) m +- {1000 * sigma_xy:.0f} mm"
    if has_heading(model):
        place += f", yaw {math.degrees(pose.yaw):z.2f} +- {sigma_yaw:.2f} deg"
    rows.append((f"place in {model.frame}", place))
    rows.append(("legs", _legs(model)))
    used = sum(snapshot.used for snapshot in model.snapshots)
    rows.append(("views", f"{used} of {len(model.snapshots)} used"))
    rows.append(("verdict", model.verdict.level))
    return rows


def has_heading(model: TableModel) -> bool:
    """Tell whether the yaw says something: a circle looks the same in every direction."""
    return shape_named(model.surface.shape).symmetry != 0


def doubts(model: TableModel) -> list[str]:
    """Return why a model is not good: the verdict's reasons, each with its warning's code."""
    codes = {warning.message: warning.code for warning in model.warnings}
    return [
        f"{codes[reason]}: {reason}" if reason in codes else reason
        for reason in model.verdict.reasons
    ]


def notes(model: TableModel) -> list[str]:
    """Return the warnings that are no reasons of the verdict, each with its code."""
    return [
        f"{warning.code}: {warning.message}"
        for warning in model.warnings
        if warning.message not in model.verdict.reasons
    ]


def line(model: TableModel) -> str:
    """Return a model in one line: shape, dimensions, height, place, verdict and codes of doubts."""
    surface = model.surface
    lengths = [
        f"{figure.value:.3f}" for name, figure in surface.dimensions.items() if not is_angle(name)
    ]
    size = f" {' x '.join(lengths)} m" if lengths else ""
    place = f"at ({surface.pose.x:z.2f}, {surface.pose.y:z.2f})"
    return f"{surface.shape}{size}, {surface.height.value:.3f} m high, {place}, {judged(model)}"


def judged(model: TableModel) -> str:
    """Return the verdict in one line, and the codes of what speaks against the model."""
    reasons = model.verdict.reasons
    codes = dict.fromkeys(one.code for one in model.warnings if one.message in reasons)
    return f"{model.verdict.level} ({', '.join(codes)})" if codes else model.verdict.level


def length(figure: Figure) -> str:
    """Return a length in metres with its sigma in millimetres, if it has one."""
    if figure.sigma is None:
        return f"{figure.value:.4f} m"
    return f"{figure.value:.4f} m +- {1000 * figure.sigma:.1f} mm"


def angle(figure: Figure) -> str:
    """Return an angle in degrees with its sigma, if it has one."""
    value = f"{math.degrees(figure.value):.2f}"
    return (
        f"{value} deg"
        if figure.sigma is None
        else f"{value} +- {math.degrees(figure.sigma):.2f} deg"
    )


def _extent(surface: TableSurface) -> str:
    """Return how far an outline without dimensions of its own reaches, along its yaw and across."""
    c, s = math.cos(surface.pose.yaw), math.sin(surface.pose.yaw)
    along = [c * x + s * y for x, y in surface.outline]
    across = [c * y - s * x for x, y in surface.outline]
    return f"{max(along) - min(along):.4f} x {max(across) - min(across):.4f} m over all"


def _alternatives(model: TableModel) -> str:
    others = [other for other in model.surface.alternatives if other.score >= 0.01]
    return "".join(f" ({other.shape} {other.score:.2f})" for other in others)


def _legs(model: TableModel) -> str:
    if not model.legs:
        return "none found"
    shapes = sorted({shape_named(leg.shape).adjective for leg in model.legs})
    inferred = sum(leg.status != "measured" for leg in model.legs)
    note = f", {inferred} of them inferred" if inferred else ""
    return f"{len(model.legs)}, {' and '.join(shapes)}{note}"
