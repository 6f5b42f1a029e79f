"""The pieces of the viewer's layout: panes of text, plots, images, and columns of them."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from tablemap import palette
from tablemap.review.scene import DrawnScene

PLOT = rrb.archetypes.PlotBackground(color=palette.BACKGROUND)
QUIET_LEGEND = rrb.PlotLegend(visible=False)
Contents = rrb.View | rrb.Container


def beside(name: str, share: float, left: Contents, *right: Contents) -> rrb.Horizontal:
    """Return ``left``, ``share`` times as wide as the column of ``right`` views beside it."""
    column = right[0] if len(right) == 1 else rrb.Vertical(*right)
    return rrb.Horizontal(left, column, column_shares=[share, 1.0], name=name)


def text(origin: str, name: str) -> rrb.TextDocumentView:
    """Return a pane of markdown."""
    return rrb.TextDocumentView(origin=origin, name=name)


def plot(origin: str, name: str) -> rrb.TimeSeriesView:
    """Return a plot of numbers over time."""
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=QUIET_LEGEND, background=PLOT)


def tabbed(scene: DrawnScene, *parts: Contents) -> rrb.Tabs:
    """Return parts as tabs; the one that shows what a doubt is about is in front, else the first.

    What is doubted has its code in `SHOWN_BY`.
    """
    named = [str(part.name) for part in parts]
    wanted = [name for code, name in SHOWN_BY.items() if code in scene.doubts and name in named]
    return rrb.Tabs(*parts, active_tab=named.index(wanted[0]) if wanted else 0)


SHOWN_BY = {
    "accuracy.height_scatter": "Height by view (mm)",
    "accuracy.poor_fit": "Histogram (mm)",
    "accuracy.shape_ambiguous": "Residuals and candidates",
    "accuracy.localisation": "Trajectories",
    "accuracy.calibration": "Calibration",
    "accuracy.calibration_flawed": "Calibration",
    "accuracy.calibrations_disagree": "Calibration",
    "accuracy.depth_meaning": "Calibration",
    "accuracy.floor": "Calibration",
    "accuracy.floor_level": "Calibration",
    "accuracy.floor_step": "Calibration",
}
"""The tab, of those within a stage's tab, that shows what a doubt is about."""


def flat(
    origin: str, name: str, *, bounds: rrb.VisualBounds2D | None = None, **more: Any
) -> rrb.Spatial2DView:
    """Return a view of what is flat, on the palette's background."""
    return rrb.Spatial2DView(
        origin=origin, name=name, background=palette.BACKGROUND, visual_bounds=bounds, **more
    )


def image(scene: DrawnScene, what: str) -> rrb.Spatial2DView:
    """Return a view of the snapshot's depth or colour with edge points and model drawn into it."""
    if what == "colour" and not scene.colour_fits:
        return flat("/camera/colour", "Colour (of another camera)")
    drawn = ("edges/**", "model/**", "candidates/**", "doubts")
    shown = [f"/camera/{one}" for one in (what, *drawn)]
    if what == "depth" and scene.is_mended:
        shown.append("/camera/mended")
    overrides: dict[Any, Any] = {"/camera/edges/image_border": rrb.EntityBehavior(visible=False)}
    for number in scene.tables:
        other = f"/tables/{number:02d}/camera/model/outline"
        shown.append(other)
        overrides[other] = rr.LineStrips2D.from_fields(colors=[palette.LEFT_OUT.on_dark])
    return flat(
        f"/camera/{what}",
        f"{what.capitalize()} with {'the surfaces found' if scene.failed else 'the model'}",
        contents=shown,
        overrides=overrides,
    )


def best_image(scene: DrawnScene) -> str:
    """Return which image shows most: colour where it fits the depth, else depth."""
    return "colour" if scene.has_colour and scene.colour_fits else "depth"


def image_of_table(number: int, scene: DrawnScene) -> rrb.Spatial2DView | None:
    """Return the image that shows most of a table beside the chosen one, with its model.

    It is of one snapshot, wherever the cursor is. None if no view shows the table's edge.
    """
    if scene.best is None:
        return None
    below = f"/tables/{number:02d}/view"
    return flat(below, f"View {scene.best} with table {number:02d}", contents=[f"{below}/**"])
