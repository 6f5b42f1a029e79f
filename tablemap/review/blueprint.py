"""The viewer's layout when the file opens: the overview first, then a tab for each stage."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from tablemap import palette
from tablemap.review.eyes import (
    Overrides,
    of_pairs,
    of_table,
    overview_eye,
    round_table,
    seen_from,
    table_eye,
)
from tablemap.review.legend import with_legend
from tablemap.review.stream import FEW_STOPS, DrawnScene

PLOT = rrb.archetypes.PlotBackground(color=palette.BACKGROUND)
QUIET_LEGEND = rrb.PlotLegend(visible=False)
Contents = rrb.View | rrb.Container


def blueprint(scene: DrawnScene) -> rrb.Blueprint:
    """Return the layout, with its eyes placed by the known part of the scene.

    Only stages that began have tabs, and only what was drawn: the others have nothing to show.
    """
    begun = {name for name, _ in scene.stages}
    tabs: list[rrb.Container] = [_overview(scene)]
    for stage, tab, has_data in (
        ("calibration", _views, True),
        ("odometry", _odometry, scene.has_laser),
        ("registration", _registration, True),
        ("registration", _pairs, scene.pairs_reach is not None),
        ("outline", _surface, True),
        ("legs", _legs, True),
    ):
        if scene.localised and stage in begun and has_data:
            tabs.append(tab(scene))
    if scene.tables:
        tabs.append(rrb.Tabs(*[_table(n, one) for n, one in scene.tables.items()], name="Tables"))
    if scene.stages:
        tabs.append(_timings())
    return rrb.Blueprint(
        rrb.Tabs(contents=tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="snapshot"),
        auto_views=False,
        auto_layout=False,
    )


def _beside(name: str, share: float, left: Contents, *right: Contents) -> rrb.Horizontal:
    """Return ``left``, ``share`` times as wide as the column of ``right`` views beside it."""
    column = right[0] if len(right) == 1 else rrb.Vertical(*right)
    return rrb.Horizontal(left, column, column_shares=[share, 1.0], name=name)


def _text(origin: str, name: str) -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=origin, name=name)


def _plot(origin: str, name: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=QUIET_LEGEND, background=PLOT)


def _flat(
    origin: str, name: str, *, bounds: rrb.VisualBounds2D | None = None, **more: Any
) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=origin, name=name, background=palette.BACKGROUND, visual_bounds=bounds, **more
    )


def _overview(scene: DrawnScene) -> rrb.Container:
    shown = [
        "/model/**",
        "/surface/beside/**",
        "/registration/bases/**" if len(scene.localised) <= FEW_STOPS else "/registration/stops/**",
        "/registration/after/scan/**",
        "/trajectory/registered" if len(scene.localised) <= FEW_STOPS else "/trajectory/cameras",
        "/story/**",
        "/stop/**",
    ]
    for number in scene.tables:
        shown += [f"/tables/{number:02d}/model/{part}/**" for part in ("top", "legs")]
    if len(scene.localised) <= FEW_STOPS:
        shown.append("/registration/after/clutter/**")
    if "legs" not in scene.reached:
        shown += [
            "/registration/after/**",
            "/segmentation/candidates/**",
            "/outline/edges/table/**",
            "/surface/chosen/**",
            "/trajectory/localised",
        ]
    if "registration" not in scene.reached:
        shown += [
            "/registration/localised_stops/**",
            "/segmentation/points",
            "/laser/scan",
            "/robot/**",
            "/camera",
        ]
    space = seen_from(overview_eye(scene), scene, "Table and stops", shown, overrides=_quiet(scene))
    right: list[Contents] = [_text("/summary", "Summary")]
    if scene.localised:
        image = _image(scene, "colour" if scene.has_colour and scene.colour_fits else "depth")
        right = [rrb.Vertical(*right, image, row_shares=[1.7, 1.0])]
    return _beside("Overview", 1.7, with_legend(space, "overview", height=620), *right)


def _quiet(scene: DrawnScene) -> Overrides:
    """Return overrides that make the model stand out: one colour for scans, thin paths."""
    quiet: Overrides = {
        "/model/uncertainty": rrb.EntityBehavior(visible=False),
        "/trajectory/registered": rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(1.0)),
    }
    for k in range(len(scene.localised)):
        for path, tint in (
            ("scan", palette.LASER.on_dark),
            ("clutter", palette.IN_THE_WAY.on_dark),
        ):
            quiet[f"/registration/after/{path}/{k:02d}"] = rr.Points3D.from_fields(colors=[tint])
    return quiet


def _image(scene: DrawnScene, what: str) -> rrb.Spatial2DView:
    """Return a view of the snapshot's depth or colour with edge points and model drawn into it."""
    if what == "colour" and not scene.colour_fits:
        return _flat("/camera/colour", "Colour (of another camera)")
    shown = [f"/camera/{what}", "/camera/edges/**", "/camera/model/**", "/camera/candidates/**"]
    return _flat(
        f"/camera/{what}",
        f"{what.capitalize()} with {'the surfaces found' if scene.failed else 'the model'}",
        contents=shown,
        overrides={"/camera/edges/image_border": rrb.EntityBehavior(visible=False)},
    )


def _views(scene: DrawnScene) -> rrb.Container:
    shown = [
        "/camera/**",
        "/segmentation/points",
        "/segmentation/candidates/**",
        "/laser/scan",
        "/robot/**",
        "- /camera/depth",
        "- /camera/colour",
        "- /camera/edges/**",
        "- /camera/model/**",
        "- /camera/candidates/**",
    ]
    flatness = rrb.Grid(
        *[
            _flat(f"/calibration/{surface}_{when}", f"{surface} {when}")
            for surface in sorted(scene.flatness)
            for when in ("before", "after")
        ],
        name="Flatness",
    )
    labels = [_flat("/segmentation/labels", "Labels", contents=["/segmentation/labels"])]
    if not scene.has_labels:
        labels = []
    last: list[Contents] = [_text("/calibration/summary", "Calibration")]
    if scene.flatness:
        last.append(with_legend(flatness, "flatness", height=200))
    if scene.has_colour:
        last.insert(0, _image(scene, "colour"))
    return _beside(
        "Views",
        1.5,
        rrb.Vertical(
            with_legend(
                round_table(scene, "Segmented view", shown, steepness=0.8), "views", height=380
            ),
            _text("/segmentation/summary", "Tables and views"),
            row_shares=[1.6, 1.0],
        ),
        *labels,
        with_legend(_image(scene, "depth"), "image", height=200),
        rrb.Tabs(*last),
    )


def _odometry(scene: DrawnScene) -> rrb.Container:
    shown = ["/odometry/scan", "/odometry/local_map"]
    shown += [f"/trajectory/{one}" for one in ("localised", "odometry", "wheels")]
    return _beside(
        "Odometry",
        1.5,
        with_legend(
            round_table(
                scene, "Scan on KISS-ICP's map: timeline 'sensor_time'", shown, steepness=4.0
            ),
            "odometry",
            height=620,
        ),
        _text("/odometry/summary", "Odometry"),
        _plot("/odometry/correction_mm", "Scan against its prior (mm)"),
        _plot("/odometry/threshold_mm", "Threshold (mm)"),
    )


def _registration(scene: DrawnScene) -> rrb.Container:
    stops = "/registration/stops/**"
    after = [
        "/registration/after/**",
        "/registration/graph_in_map/**",
        "/registration/graph_worst",
        "/registration/graph_at_stop",
        "/stop/**",
        stops,
    ]
    all_pairs: Overrides = {"/registration/graph_in_map": rrb.EntityBehavior(visible=False)}
    before = ["/registration/before/**", "/registration/localised_stops/**"]
    paths = [
        "/trajectory/**",
        "- /trajectory/registered",
        "- /trajectory/cameras",
        stops,
        "/registration/graph_before",
    ]
    return rrb.Vertical(
        rrb.Horizontal(
            round_table(scene, "As localised", before, steepness=4.0),
            with_legend(
                round_table(
                    scene,
                    "As registered: pairs of the stop, and the worst",
                    after,
                    steepness=4.0,
                    overrides=all_pairs,
                ),
                "registration",
                height=350,
            ),
        ),
        rrb.Horizontal(
            _text("/registration/summary", "Pairs and checks")
            if scene.has_laser
            else rrb.Tabs(
                _text("/registration/summary", "Pairs and checks"),
                _text("/odometry/summary", "Odometry"),
            ),
            rrb.Tabs(
                rrb.GraphView(origin="/registration/graph", name="Pose graph"),
                _plot("/registration/correction_mm", "Correction (mm)"),
                with_legend(
                    round_table(scene, "Trajectories", paths, steepness=4.0),
                    "ways",
                    height=240,
                    in_tabs=True,
                ),
            ),
        ),
        row_shares=[1.4, 1.0],
        name="Registration",
    )


def _pairs(scene: DrawnScene) -> rrb.Container:
    return _beside(
        "Pairs",
        2.0,
        rrb.Tabs(
            with_legend(
                round_table(
                    scene,
                    "Worst pair of the stop",
                    ["/registration/pair_at_stop/**"],
                    steepness=4.0,
                ),
                "pair",
                height=620,
                in_tabs=True,
            ),
            with_legend(
                of_pairs(scene, "All pairs: choose the timeline 'iteration' and scrub"),
                "pairs",
                height=620,
                in_tabs=True,
            ),
        ),
        _text("/registration/pairs/summary", "Pairs side by side"),
        _plot("/registration/iterations/rmse_mm", "RMSE (mm)"),
        _plot("/registration/iterations/fitness", "Fitness"),
        _plot("/registration/iterations/inliers", "Inliers"),
    )


def _surface(scene: DrawnScene) -> rrb.Container:
    edges = [
        "/outline/edges/**",
        "/surface/chosen/**",
        "/surface/hull",
        "/surface/beside/**",
        "/model/uncertainty/**",
        "- /outline/edges/image_border/**",
    ]
    fit = ["/surface/residuals", "/surface/candidates/**", "/model/uncertainty/**"]
    return _beside(
        "Surface",
        1.3,
        rrb.Tabs(
            with_legend(
                of_table(scene, "Edges by kind", edges, steepness=5.0),
                "edges",
                height=600,
                in_tabs=True,
            ),
            with_legend(
                of_table(scene, "Residuals and candidates", fit, steepness=5.0),
                "residuals",
                height=620,
                in_tabs=True,
            ),
        ),
        rrb.Tabs(
            _text("/surface/summary", "Choice"),
            _text("/outline/summary", "Edge counts"),
            _text("/surface/crosscheck", "Camera against laser"),
        ),
        rrb.Tabs(
            _flat(
                "/surface/unrolled",
                "Residuals along the outline",
                bounds=rrb.VisualBounds2D(x_range=(-65, 425), y_range=(-125, 150)),
            ),
            rrb.BarChartView(
                origin="/surface/residual_histogram_mm",
                name="Histogram (mm)",
                background=PLOT,
            ),
            _flat("/surface/budget", "Where the sigma comes from"),
            rrb.TimeSeriesView(
                origin="/outline/height_mm",
                name="Height by view (mm)",
                background=PLOT,
            ),
        ),
    )


def _legs(scene: DrawnScene) -> rrb.Container:
    shown = ["/legs/**", f"/surface/candidates/{scene.shape}", "/model/legs/**"]
    return _beside(
        "Legs",
        1.4,
        with_legend(
            of_table(scene, "Legs from the laser's height", shown, steepness=1.2),
            "legs",
            height=600,
        ),
        _text("/legs/summary", "Legs"),
    )


def _table(number: int, scene: DrawnScene) -> rrb.Container:
    """Return the tab of a table beside the chosen one."""
    below = f"/tables/{number:02d}"
    shown = [
        f"{below}/{one}" for one in ("model/**", "outline/edges/table/**", "legs/**", "surface/**")
    ]
    flat = ("candidates/**", "residuals", "unrolled/**", "budget/**", "chosen/names")
    shown += [f"- {below}/surface/{one}" for one in flat]
    shown.append(f"- {below}/legs/names")
    shown += [f"- {below}/model/uncertainty/**"]
    return _beside(
        f"Table {number:02d}",
        1.4,
        seen_from(table_eye(scene), scene, "Table beside the chosen one", shown),
        rrb.Tabs(
            _text(f"{below}/summary", "Summary"),
            _text(f"{below}/surface/summary", "Choice"),
            _text(f"{below}/legs/summary", "Legs"),
        ),
    )


def _timings() -> rrb.Container:
    return rrb.Vertical(
        _beside(
            "Stages and seconds",
            1.6,
            _flat(
                "/timing",
                "Stages",
                bounds=rrb.VisualBounds2D(x_range=(-160, 430), y_range=(-20, 270)),
                contents=["/timing/bars", "/timing/names"],
            ),
            _text("/timing/summary", "Seconds"),
        ),
        rrb.TextLogView(origin="/log", name="Warnings and what was set aside"),
        name="Timings",
    )
