"""Results as markdown tables, for the viewer's text panes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from tablemap.calibration import Calibration
from tablemap.legs import Legs
from tablemap.model import Dimension, Edge, Figure, TableModel
from tablemap.odometry import Odometry
from tablemap.outline import EdgeKind, Outline
from tablemap.registration import Pair, Registration
from tablemap.segmentation import Segmentation
from tablemap.surface import Surface

MOST_ROWS = 60
MOST_SIDES = 12
ANGLES = {"angle"}
LEAST_WEIGHT = 0.005
LEGEND = (
    "Edge points: green the table's, orange where something stood before or on it, violet where "
    "depth was missing. Sides: green measured, amber inferred, red unseen; beside them their 95 % "
    "bands, magnified."
)


def table(header: tuple[str, ...], rows: Iterable[tuple[object, ...]]) -> str:
    """Return a markdown table; a cell's bars and line breaks do not break it."""
    lines = ["| " + " | ".join(header) + " |", "|" + " --- |" * len(header)]
    for row in rows:
        cells = (str(cell).replace("|", "/").replace("\n", " ") for cell in row)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def metres(value: float, sigma: float | None) -> str:
    """Write a length with its standard deviation, or say that there is none."""
    return f"{value:.3f} m" + (f" ± {1000 * sigma:.1f} mm" if sigma is not None else "")


def _figure(name: str, value: float, sigma: float | None) -> str:
    if name in ANGLES:
        spread = f" ± {np.degrees(sigma):.2f}°" if sigma is not None else ""
        return f"{np.degrees(value):.2f}°{spread}"
    return metres(value, sigma)


def model(result: TableModel, *, magnified: tuple[float, float]) -> str:
    """Return the summary of a finished run: verdict first.

    ``magnified`` says how many times too large the place's ellipse and the sides' bands are drawn.
    """
    surface = result.surface
    rows: list[tuple[object, ...]] = [
        (name, _figure(name, one.value, one.sigma), one.status)
        for name, one in surface.dimensions.items()
    ]
    if not rows and len(surface.edges) <= MOST_SIDES:
        lengths = ", ".join(f"{_reach(edge):.3f}" for edge in surface.edges)
        rows.append(("sides", f"{lengths} m", ""))
    rows.append(("height", metres(surface.height.value, surface.height.sigma), ""))
    rows.append(_optional("thickness", surface.thickness))
    if surface.corner_radius is not None:
        rows.append(_optional("corner radius", surface.corner_radius))
    pose = surface.pose
    deviations = np.sqrt(np.maximum(np.diag(np.array(pose.covariance)), 0.0))
    lines = [
        f"# {surface.shape.capitalize()}: {result.verdict.level}",
        *[f"- {reason}" for reason in result.verdict.reasons],
        "",
        table(("figure", "value", "status"), rows),
        "",
        f"**Pose** in `{result.frame}`: x {metres(pose.x, float(deviations[0]))}, "
        f"y {metres(pose.y, float(deviations[1]))}, "
        f"yaw {np.degrees(pose.yaw):.2f} ± {np.degrees(float(deviations[2])):.2f}°",
        "",
        f"**Shape** {surface.shape} {surface.score:.2f}"
        + "".join(
            f", {other.shape} {other.score:.2f}"
            for other in surface.alternatives
            if other.score >= LEAST_WEIGHT
        ),
        "",
        f"## {len(result.legs)} legs",
    ]
    if result.legs:
        lines.append(
            table(
                ("leg", "x, y (m)", "size (mm)", "status"),
                [
                    (
                        f"{k} {leg.shape}",
                        f"{leg.x:.3f}, {leg.y:.3f}"
                        + (f" ± {leg.position_sigma:.3f}" if leg.position_sigma else ""),
                        " x ".join(f"{1000 * one.value:.0f}" for one in leg.dimensions.values()),
                        leg.status,
                    )
                    for k, leg in enumerate(result.legs)
                ],
            )
        )
    used = sum(snapshot.used for snapshot in result.snapshots)
    lines += ["", f"**Views** {used} used of {len(result.snapshots)}", ""]
    unused = [(k, one.reason) for k, one in enumerate(result.snapshots) if not one.used]
    if unused:
        lines.append(table(("view not used", "reason"), unused[:MOST_ROWS]))
    lines += ["", f"## {len(result.warnings)} warnings"]
    if result.warnings:
        lines.append(
            table(
                ("code", "message"),
                [(one.code, one.message) for one in result.warnings[:MOST_ROWS]],
            )
        )
    place, sides = magnified
    lines += [
        "",
        f"On the top, 95 % intervals: the place's ellipse {place:.0f} times as large, "
        f"the sides' bands {sides:.0f} times.",
    ]
    if surface.thickness is None:
        lines.append("The thickness was not measured; the top is drawn 30 mm thick.")
    return "\n".join(lines)


def _reach(edge: Edge) -> float:
    """Return a side's length in metres."""
    return float(np.linalg.norm(np.diff(np.array(edge.points), axis=0), axis=1).sum())


def _optional(name: str, figure: Figure | None) -> tuple[object, ...]:
    if figure is None:
        return name, "not measured", ""
    status = figure.status if isinstance(figure, Dimension) else ""
    return name, metres(figure.value, figure.sigma), status


def failure(stage: str, message: str) -> str:
    """Return the summary of a run that has no model."""
    return f"# No model\n\nThe run ended in **{stage}**:\n\n> {message}\n"


def running(recording: str) -> str:
    """Return the summary of a run that has not ended: what a crash leaves behind."""
    return f"# Running\n\n`{recording}`: the run has not ended, or was killed. No model yet.\n"


def calibration(result: Calibration) -> str:
    """Return the camera's corrections."""
    sigmas = np.sqrt(np.maximum(np.diag(result.covariance), 0.0))
    return "\n".join(
        [
            "## Camera, from the floor",
            table(
                ("correction", "value"),
                [
                    ("roll", f"{np.degrees(result.roll):.3f} ± {np.degrees(sigmas[0]):.3f}°"),
                    ("pitch", f"{np.degrees(result.pitch):.3f} ± {np.degrees(sigmas[1]):.3f}°"),
                    ("depth scale", f"{result.depth_scale:.5f} ± {sigmas[2]:.5f}"),
                    ("height", f"{1000 * result.height_correction:.1f} mm"),
                    ("floor pixels", result.floor_pixels),
                    ("floor rms before", f"{1000 * result.floor_rms_before:.1f} mm"),
                    ("floor rms after", f"{1000 * result.floor_rms_after:.1f} mm"),
                ],
            ),
        ]
    )


def segmentation(result: Segmentation) -> str:
    """Return the candidate tables and the views' verdicts."""
    candidates = [
        (
            f"{k}{' (chosen)' if one.chosen else ''}",
            f"{one.x:.2f}, {one.y:.2f}",
            f"{one.height:.3f}",
            f"{one.area:.2f}",
            len(one.views),
            f"{one.weight:.2f}",
        )
        for k, one in enumerate(result.candidates[:MOST_ROWS])
    ]
    views = [
        (
            view.index,
            "yes" if view.sees_table else "no",
            view.top_pixels,
            "" if view.height is None else f"{view.height:.3f}",
            view.reason or "",
        )
        for view in result.views[:MOST_ROWS]
    ]
    return "\n".join(
        [
            f"## Top at {metres(result.height, result.height_sigma)}",
            table(("table", "x, y", "height", "m²", "views", "weight"), candidates),
            "",
            *[
                f"- table {k} was not taken: {one.reason}"
                for k, one in enumerate(result.candidates[:MOST_ROWS])
                if one.reason
            ],
            "",
            table(("view", "sees it", "top pixels", "height", "reason"), views),
        ]
    )


def odometry(result: Odometry) -> str:
    """Return what the odometry rests on."""
    spread = np.sqrt(np.maximum(np.diag(result.covariance_per_metre), 0.0))
    return "\n".join(
        [
            f"## Odometry from {result.source}",
            f"{result.scans_used} scans used, {result.scans_skipped} skipped. "
            f"Error per metre: {1000 * max(spread[0], spread[1]):.1f} mm, "
            f"{np.degrees(spread[2]):.2f}°.",
        ]
    )


def pair_residual(result: Registration, pair: Pair) -> float:
    """Return how far (metres) a pair's measurement lies from the registered poses."""
    poses = result.map_from_base
    registered = poses[pair.target].inverse() @ poses[pair.source]
    left = registered.inverse() @ pair.target_from_source
    return float(np.hypot(left.x, left.y))


def registration(result: Registration) -> str:
    """Return the checks of the stops and the pairs, the dropped and the worst first."""
    checks = [
        (
            one.index,
            "passed" if one.passed else "failed",
            ", ".join(f"{name} {value:.3g}" for name, value in one.statistics.items()),
            "; ".join(one.reasons),
        )
        for one in result.checks[:MOST_ROWS]
    ]
    ordered = sorted(result.pairs, key=lambda pair: (pair.used, -pair_residual(result, pair)))
    pairs = [
        (
            f"{one.source} to {one.target}",
            one.kind,
            f"{1000 * pair_residual(result, one):.1f}",
            f"{one.fitness:.2f}",
            f"{1000 * one.rmse:.1f}",
            one.inliers,
            "used" if one.used else "dropped",
        )
        for one in ordered[:MOST_ROWS]
    ]
    counts = Counter((pair.kind, pair.used) for pair in result.pairs)
    said = ", ".join(
        f"{count} {kind} {'used' if used else 'dropped'}" for (kind, used), count in counts.items()
    )
    return "\n".join(
        [
            f"## Stops registered by {result.source}",
            f"{sum(result.used)} of {len(result.used)} used; systematic sigma "
            f"{1000 * result.systematic:.1f} mm. Pairs: {said or 'none'}.",
            "",
            table(
                ("pair", "kind", "residual mm", "fitness", "rmse mm", "inliers", "result"), pairs
            ),
            "",
            *[
                f"- {one.source} to {one.target} was dropped: {one.reason}"
                for one in ordered[:MOST_ROWS]
                if not one.used
            ],
            "",
            table(("stop", "check", "statistics", "reasons"), checks),
        ]
    )


def outline(result: Outline) -> str:
    """Return how many edge points of each kind every view has."""
    rows = [
        (view.index, *[int(np.sum(view.kind == kind)) for kind in EdgeKind])
        for view in result.views[:MOST_ROWS]
    ]
    thickness = (
        "not seen" if result.thickness is None else metres(result.thickness, result.thickness_sigma)
    )
    header = ("view", *[kind.name.lower() for kind in EdgeKind])
    return "\n".join(
        [
            f"## Edges at {metres(result.height, result.height_sigma)}",
            f"Thickness {thickness}. {LEGEND}",
            "",
            table(header, rows),
        ]
    )


def surface(result: Surface) -> str:
    """Return the candidates by score, and the sides by status."""
    candidates = [
        (
            one.shape + (" (chosen)" if one.shape == result.shape else ""),
            f"{one.score:.3f}",
            f"{one.cost:.1f}",
            f"{100 * one.inlier_fraction:.0f} %",
            ", ".join(
                f"{name} {_figure(name, figure.value, figure.sigma)}"
                for name, figure in one.dimensions.items()
            ),
        )
        for one in sorted(result.candidates, key=lambda one: -one.score)
    ]
    sides = [
        (
            k,
            one.status,
            f"{100 * one.seen_fraction:.0f} %",
            "none" if one.sigma is None else f"{1000 * one.sigma:.1f} mm",
        )
        for k, one in enumerate(result.edges[:MOST_ROWS])
    ]
    finite = 1000 * result.residuals[np.isfinite(result.residuals)]
    median, most = np.percentile(np.abs(finite), [50, 95]) if len(finite) else (np.nan, np.nan)
    return "\n".join(
        [
            f"## {result.shape.capitalize()}",
            f"Residuals of {len(finite)} edge points: half are within {median:.1f} mm, "
            f"95 % within {most:.1f} mm.",
            "",
            LEGEND,
            "",
            table(("shape", "weight", "cost", "inliers", "dimensions"), candidates),
            "",
            table(("side", "status", "seen", "sigma"), sides),
        ]
    )


def legs(result: Legs) -> str:
    """Return the legs and what was set aside."""
    found = [
        (
            f"{k} {one.shape}",
            f"{one.x:.3f}, {one.y:.3f}",
            "none" if one.position_sigma is None else f"{1000 * one.position_sigma:.1f} mm",
            ", ".join(f"{name} {1000 * f.value:.0f} mm" for name, f in one.dimensions.items()),
            one.status,
            one.views,
        )
        for k, one in enumerate(result.legs)
    ]
    rejected = [
        f"- at {one.x:.2f}, {one.y:.2f} ({len(one.points)} points): {one.reason}"
        for one in result.rejected[:MOST_ROWS]
    ]
    return "\n".join(
        [
            f"## {len(result.legs)} legs",
            table(("leg", "x, y", "sigma", "size", "status", "views"), found) if found else "",
            "",
            f"## {len(result.rejected)} clusters set aside",
            *rejected,
        ]
    )


def timings(stages: list[tuple[str, float | None]]) -> str:
    """Return how long each stage took."""
    rows = [(name, "not ended" if s is None else f"{s:.2f} s") for name, s in stages]
    total = sum(seconds for _, seconds in stages if seconds is not None)
    return "\n".join([f"## {total:.1f} s", table(("stage", "time"), rows)])
