"""One tab of the viewer for each stage, and for each table beside the chosen one."""

from __future__ import annotations

import rerun.blueprint as rrb

from tablemap.review.eyes import (
    Overrides,
    edges_eye,
    legs_eye,
    of_pairs,
    pair_eye,
    seen_from,
    stops_eye,
    table_eye,
    views_eye,
)
from tablemap.review.legend import with_legend
from tablemap.review.matrix import bounds
from tablemap.review.panes import (
    PLOT,
    Contents,
    beside,
    flat,
    image,
    image_of_table,
    plot,
    tabbed,
    text,
)
from tablemap.review.scene import FEW_STOPS, DrawnScene


def views(scene: DrawnScene) -> rrb.Container:
    """Return the tab of the snapshots: labelled points and images, candidates, calibration."""
    shown = [
        "/camera/**",
        "/segmentation/points",
        "/segmentation/candidates/**",
        "/laser/scan",
        "/robot/**",
        "/doubts/views/**",
        "- /camera/depth",
        "- /camera/colour",
        "- /camera/edges/**",
        "- /camera/model/**",
        "- /camera/candidates/**",
        "- /camera/doubts",
        "- /camera/mended",
    ]
    flatness = rrb.Grid(
        *[
            flat(f"/calibration/{surface}_{when}", f"{surface} {when}")
            for surface in sorted(scene.flatness)
            for when in ("before", "after")
        ],
        name="Flatness",
    )
    labels = []
    if scene.has_labels:
        labelled = flat("/segmentation/labels", "Labels", contents=["/segmentation/labels"])
        labels.append(with_legend(labelled, "labels", height=200))
    last: list[Contents] = [text("/calibration/summary", "Calibration")]
    if scene.flatness:
        last.append(with_legend(flatness, "flatness", height=200))
    if scene.has_colour:
        last.insert(0, image(scene, "colour"))
    return beside(
        "Views",
        1.5,
        rrb.Vertical(
            with_legend(
                seen_from(views_eye(scene), scene, "Segmented view", shown), "views", height=380
            ),
            text("/segmentation/summary", "Tables and views"),
            row_shares=[1.6, 1.0],
        ),
        *labels,
        with_legend(image(scene, "depth"), "image", height=200),
        tabbed(scene, *last),
    )


def odometry(scene: DrawnScene) -> rrb.Container:
    """Return the tab of the laser's odometry."""
    shown = ["/odometry/scan", "/odometry/local_map"]
    shown += [f"/trajectory/{one}" for one in ("localised", "odometry", "wheels")]
    return beside(
        "Odometry",
        1.5,
        with_legend(
            seen_from(
                stops_eye(scene), scene, "Scan on KISS-ICP's map: timeline 'sensor_time'", shown
            ),
            "odometry",
            height=620,
        ),
        text("/odometry/summary", "Odometry"),
        plot("/odometry/correction_mm", "Scan against its prior (mm)"),
        plot("/odometry/threshold_mm", "Threshold (mm)"),
    )


def registration(scene: DrawnScene) -> rrb.Container:
    """Return the tab of the stops before and after their registration, with pairs and ways."""
    stops = "/registration/stops/**"
    after = [
        "/registration/after/**",
        "/registration/graph_in_map/**",
        "/registration/graph_worst",
        "/registration/graph_at_stop",
        "/stop/**",
        "/doubts/registration/**",
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
    if len(scene.localised) <= FEW_STOPS:
        after.append("- /stop/camera/names")  # the stops have their numbers there
    ends = bounds(len(scene.localised))
    return rrb.Vertical(
        rrb.Horizontal(
            seen_from(stops_eye(scene), scene, "As localised", before),
            with_legend(
                seen_from(
                    stops_eye(scene),
                    scene,
                    "As registered: pairs of the stop, and the worst",
                    after,
                    overrides=all_pairs,
                ),
                "registration",
                height=350,
            ),
        ),
        rrb.Horizontal(
            text("/registration/summary", "Pairs and checks")
            if scene.has_laser
            else rrb.Tabs(
                text("/registration/summary", "Pairs and checks"),
                text("/odometry/summary", "Odometry"),
            ),
            tabbed(
                scene,
                with_legend(
                    flat(
                        "/registration/matrix",
                        "Pose graph as a matrix",
                        bounds=rrb.VisualBounds2D(x_range=ends[0], y_range=ends[1]),
                    ),
                    "registration",
                    height=240,
                    in_tabs=True,
                ),
                plot("/registration/correction_mm", "Correction (mm)"),
                with_legend(
                    seen_from(stops_eye(scene), scene, "Trajectories", paths),
                    "ways",
                    height=240,
                    in_tabs=True,
                ),
            ),
        ),
        row_shares=[1.4, 1.0],
        name="Registration",
    )


def pairs(scene: DrawnScene) -> rrb.Container:
    """Return the tab of the pairs as ICP aligned them."""
    return beside(
        "Pairs",
        2.0,
        rrb.Tabs(
            with_legend(
                seen_from(
                    pair_eye(scene),
                    scene,
                    "Worst pair of the stop",
                    ["/registration/pair_at_stop/**"],
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
        text("/registration/pairs/summary", "Pairs side by side"),
        plot("/registration/iterations/rmse_mm", "RMSE (mm)"),
        plot("/registration/iterations/fitness", "Fitness"),
        plot("/registration/iterations/inliers", "Inliers"),
    )


def surface(scene: DrawnScene) -> rrb.Container:
    """Return the tab of the top: edges, candidates, residuals, and the parts of its sigmas."""
    edges = [
        "/outline/edges/**",
        "/surface/chosen/**",
        "/surface/hull",
        "/surface/beside/**",
        "/model/uncertainty/**",
        "/doubts/surface/**",
    ]
    fit = [
        "/surface/residuals",
        "/surface/candidates/**",
        "/model/uncertainty/**",
        "/doubts/surface/**",
        "/outline/top/**",
    ]
    seen_as_top: Overrides = {"/outline/top": rrb.EntityBehavior(visible=False)}
    return beside(
        "Surface",
        1.3,
        tabbed(
            scene,
            with_legend(
                seen_from(edges_eye(scene), scene, "Edges by kind", edges),
                "edges",
                height=600,
                in_tabs=True,
            ),
            with_legend(
                seen_from(
                    edges_eye(scene),
                    scene,
                    "Residuals and candidates",
                    fit,
                    overrides=seen_as_top,
                ),
                "residuals",
                height=620,
                in_tabs=True,
            ),
        ),
        rrb.Tabs(
            text("/surface/summary", "Choice"),
            text("/outline/summary", "Edge counts"),
            text("/surface/crosscheck", "Camera against laser"),
        ),
        tabbed(
            scene,
            flat(
                "/surface/unrolled",
                "Residuals along the outline",
                bounds=rrb.VisualBounds2D(x_range=(-65, 425), y_range=(-125, 150)),
            ),
            rrb.BarChartView(
                origin="/surface/residual_histogram_mm",
                name="Histogram (mm)",
                background=PLOT,
            ),
            flat("/surface/budget", "Where the sigma comes from"),
            rrb.TimeSeriesView(
                origin="/outline/height_mm",
                name="Height by view (mm)",
                background=PLOT,
            ),
        ),
    )


def legs(scene: DrawnScene) -> rrb.Container:
    """Return the tab of the legs, and of what was taken for none."""
    shown = ["/legs/**", "/model/legs/**", "/doubts/legs/**"]
    if scene.chosen:
        shown.append(f"/{scene.chosen}")
    return beside(
        "Legs",
        1.4,
        with_legend(
            seen_from(legs_eye(scene), scene, "Legs from the laser's height", shown),
            "legs",
            height=600,
        ),
        text("/legs/summary", "Legs"),
    )


def table(number: int, scene: DrawnScene) -> rrb.Container:
    """Return the tab of a table beside the chosen one."""
    below = f"/tables/{number:02d}"
    shown = [
        f"{below}/{one}" for one in ("model/**", "outline/edges/table/**", "legs/**", "surface/**")
    ]
    flat = ("candidates/**", "residuals", "unrolled/**", "budget/**", "chosen/names/**")
    shown += [f"- {below}/surface/{one}" for one in flat]
    shown.append(f"- {below}/legs/names/**")
    shown += [f"- {below}/model/uncertainty/**", f"{below}/doubts/overview/**"]
    space = seen_from(table_eye(scene), scene, "Table beside the chosen one", shown)
    camera = image_of_table(number, scene)
    told = rrb.Tabs(
        text(f"{below}/summary", "Summary"),
        text(f"{below}/surface/summary", "Choice"),
        text(f"{below}/legs/summary", "Legs"),
    )
    return beside(
        f"Table {number:02d}",
        1.4,
        with_legend(space, "tables", height=620),
        told,
        *([camera] if camera else []),
    )


def timings() -> rrb.Container:
    """Return the tab of the stages' times, the warnings and what was set aside."""
    return rrb.Vertical(
        beside(
            "Stages and seconds",
            1.6,
            flat(
                "/timing",
                "Stages",
                bounds=rrb.VisualBounds2D(x_range=(-160, 430), y_range=(-20, 270)),
                contents=["/timing/bars", "/timing/names"],
            ),
            text("/timing/summary", "Seconds"),
        ),
        rrb.TextLogView(origin="/log", name="Warnings and what was set aside"),
        name="Timings",
    )
