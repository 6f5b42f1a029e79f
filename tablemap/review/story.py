"""The summary that a reviewer reads first: verdict and figures, or why there is no model."""

from __future__ import annotations

import numpy as np

from tablemap.model import Dimension, Figure, TableModel
from tablemap.model.summary import doubts, has_heading
from tablemap.review.markdown import MOST_ROWS, figure, links, metres, table
from tablemap.review.wording import length
from tablemap.words import counted

MOST_SIDES = 12
LEAST_WEIGHT = 0.005
COLOURS = (
    "In the overview numbered arrows (pyramids where they are many) are the robot's stops. The "
    "strip below each view explains its colours; where a side was not seen, its figure is a bound."
)


def model(result: TableModel, *, magnified: tuple[float, float]) -> str:
    """Return the summary of a finished run: verdict first.

    ``magnified`` are the magnifications of the place's ellipse and of the sides' bands.
    """
    surface = result.surface
    rows: list[tuple[object, ...]] = [
        (name, figure(name, one.value, one.sigma), one.status)
        for name, one in surface.dimensions.items()
    ]
    sides = ""
    straight = [edge.points for edge in surface.edges if edge.is_straight]
    if not rows and len(straight) <= MOST_SIDES:
        sides = f"**Sides** {', '.join(f'{length(points):.3f}' for points in straight)} m"
    rows.append(("height", metres(surface.height.value, surface.height.sigma), ""))
    rows.append(_optional("thickness", surface.thickness))
    if surface.corner_radius is not None:
        rows.append(_optional("corner radius", surface.corner_radius))
    pose = surface.pose
    deviations = np.sqrt(np.maximum(np.diag(np.array(pose.covariance)), 0.0))
    lines = [
        f"# {surface.shape.capitalize()}: {result.verdict.level}",
        *[f"- {doubt}" for doubt in doubts(result)],
        "",
        table(("figure", "value", "status"), rows),
        "",
        sides,
        "",
        links(top="model/top", dimensions="model/dimensions", uncertainty="model/uncertainty"),
        "",
        f"**Pose** in `{result.frame}`: x {metres(pose.x, float(deviations[0]))}, "
        f"y {metres(pose.y, float(deviations[1]))}"
        + (
            f", yaw {np.degrees(pose.yaw):z.2f} ± {np.degrees(float(deviations[2])):.2f}°"
            if has_heading(result)
            else ""
        ),
        "",
        f"**Shape** {surface.shape} {surface.score:.2f}"
        + "".join(
            f", {other.shape} {other.score:.2f}"
            for other in surface.alternatives
            if other.score >= LEAST_WEIGHT
        ),
        "",
        f"## {counted(len(result.legs), 'leg')}",
    ]
    if result.legs:
        lines.append(
            table(
                ("leg", "x, y (m)", "size (mm)", "status"),
                [
                    (
                        f"{k} {leg.shape}",
                        f"{leg.x:z.3f}, {leg.y:z.3f}"
                        + (f" ± {leg.position_sigma:.3f}" if leg.position_sigma else ""),
                        " x ".join(f"{1000 * one.value:.0f}" for one in leg.dimensions.values()),
                        leg.status,
                    )
                    for k, leg in enumerate(result.legs, start=1)
                ],
            )
        )
    used = sum(snapshot.used for snapshot in result.snapshots)
    lines += ["", f"**Views** {used} used of {len(result.snapshots)}", ""]
    unused = [(k, one.reason) for k, one in enumerate(result.snapshots) if not one.used]
    if unused:
        lines += [f"- view {k} was not used: {reason}" for k, reason in unused[:MOST_ROWS]]
    lines += ["", f"## {counted(len(result.warnings), 'warning')}"]
    if result.warnings:
        lines += [f"- `{one.code}`: {one.message}" for one in result.warnings[:MOST_ROWS]]
    place, bands = magnified
    lines += [
        "",
        f"On the top, 95 % intervals: the place's ellipse {place:.0f} times as large, "
        f"the sides' bands {bands:.0f} times.",
    ]
    if result.legs or result.snapshots:
        lines.append(COLOURS)
    if surface.thickness is None:
        lines.append("The thickness was not measured; the top is drawn 30 mm thick.")
    return "\n".join(lines)


def _optional(name: str, one: Figure | None) -> tuple[object, ...]:
    if one is None:
        return name, "not measured", ""
    status = one.status if isinstance(one, Dimension) else ""
    return name, metres(one.value, one.sigma), status


def failure(stage: str, message: str, told: str) -> str:
    """Return the summary of a run without a model: why, and what the stage ``told`` before."""
    found = f"\n## Found before that\n\n{told}\n" if told else ""
    return f"# No model\n\nThe run ended in **{stage}**:\n\n> {message}\n{found}"


def no_other_model(number: int, message: str) -> str:
    """Return the summary of a table beside the chosen one that has no model."""
    return f"# Table {number:02d}: no model\n\n> {message}\n"


def running(recording: str) -> str:
    """Return the summary before the first stage has ended."""
    return f"# Still going: opening\n\n`{recording}` is being opened, or the run was ended here.\n"


def so_far(stage: str, told: str) -> str:
    """Return the summary at a stage: its own result, and that there is no model yet."""
    return f"# After {stage}: no model yet\n\n{told}\n"


def still_going(stage: str, told: str) -> str:
    """Return the summary of a run that goes on after a stage; a killed one leaves it behind."""
    return (
        f"# Still going: {stage} is done\n\n"
        f"There is no model yet. The next stage has begun, or the run was ended here.\n\n{told}\n"
    )
