"""What the viewer shows when the file opens: the story first, its evidence in the tabs."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tablemap.review import colours
from tablemap.review.stream import FEW_STOPS, Scene

ROUND = 2.3
"""Distance of the eye, in multiples of what it shows, for a view of the stops round the table."""
NEAR = 2.7
"""The same for a view of the table alone."""
ALL_OF_IT = 3.3
"""The same, so that the table is in the picture whole, with its numbers."""
MOST_ROUND = 4.0
EYE_ASIDE = 0.3  # radians from straight before the table: two of its sides are told apart
MOST_ASIDE = 0.9

Shown = rrb.EntityBehavior | rr.LineStrips3D | rr.Points3D


def blueprint(scene: Scene) -> rrb.Blueprint:
    """Return the layout, its eyes placed by what is known of the scene so far.

    A run that failed has tabs for the stages that began alone: the others have nothing to show.
    """
    begun = {name for name, _ in scene.stages}
    tabs: list[rrb.Container] = [_overview(scene)]
    for stage, tab in (
        ("calibration", _views),
        ("registration", _registration),
        ("outline", _surface),
        ("legs", _legs),
    ):
        if scene.localised and (stage in begun or not scene.failed):
            tabs.append(tab(scene))
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


def _overview(scene: Scene) -> rrb.Horizontal:
    shown = [
        "/model/**",
        "/other_tables/**",
        "/registration/stops",
        "/registration/after/scan/**",
        "/trajectory/registered",
    ]
    if len(scene.localised) <= FEW_STOPS:
        shown.append("/registration/after/clutter/**")
    if "legs" not in scene.reached:
        shown += [
            "/registration/after/**",
            "/segmentation/candidates/**",
            "/outline/edges/table/**",
            "/surface/chosen",
            "/trajectory/localised",
        ]
    if "registration" not in scene.reached:
        shown += [
            "/registration/localised_stops",
            "/segmentation/points",
            "/laser/scan",
            "/robot/**",
            "/camera",
        ]
    reach = max(ROUND * _surround(scene), ALL_OF_IT * scene.extent)
    return rrb.Horizontal(
        _space(
            scene,
            "Table and stops",
            shown,
            reach=reach,
            steepness=1.3,
            aside=_between_stops(scene),
            overrides=_quiet(scene),
        ),
        rrb.Vertical(
            rrb.TextDocumentView(origin="/summary", name="Summary"),
            rrb.Spatial2DView(origin="/camera/depth", name="Depth at the snapshot"),
            row_shares=[1.7, 1.0],
        ),
        column_shares=[1.7, 1.0],
        name="Overview",
    )


def _views(scene: Scene) -> rrb.Horizontal:
    shown = [
        "/camera/**",
        "/segmentation/points",
        "/segmentation/candidates/**",
        "/laser/scan",
        "/robot/**",
        "- /camera/depth",
        "- /camera/colour",
    ]
    last: list[rrb.View] = [rrb.TextDocumentView(origin="/calibration/summary", name="Calibration")]
    if scene.has_colour:
        last.insert(0, rrb.Spatial2DView(origin="/camera/colour", name="Colour"))
    return rrb.Horizontal(
        rrb.Vertical(
            _space(scene, "Segmented view", shown, reach=ROUND * _surround(scene), steepness=0.8),
            rrb.TextDocumentView(origin="/segmentation/summary", name="Tables and views"),
            row_shares=[1.6, 1.0],
        ),
        rrb.Vertical(
            rrb.Spatial2DView(
                origin="/segmentation/labels",
                name="Labels",
                contents=["/segmentation/labels"],
            ),
            rrb.Spatial2DView(origin="/camera/depth", name="Depth"),
            rrb.Tabs(contents=last),
        ),
        column_shares=[1.5, 1.0],
        name="Views",
    )


def _registration(scene: Scene) -> rrb.Vertical:
    stops = "/registration/stops"
    after = ["/registration/after/**", "/registration/graph_in_map/**", stops]
    before = ["/registration/before/**", "/registration/localised_stops"]
    paths = ["/trajectory/**", stops, "/odometry/scan", "/registration/graph_before"]
    return rrb.Vertical(
        rrb.Horizontal(
            _space(scene, "As localised", before, reach=ROUND * _surround(scene), steepness=4.0),
            _space(scene, "As registered", after, reach=ROUND * _surround(scene), steepness=4.0),
        ),
        rrb.Horizontal(
            rrb.TextDocumentView(origin="/registration/summary", name="Pairs and checks"),
            rrb.Tabs(
                rrb.GraphView(origin="/registration/graph", name="Pose graph"),
                rrb.TimeSeriesView(origin="/registration/correction_mm", name="Correction (mm)"),
                rrb.Vertical(
                    rrb.TimeSeriesView(origin="/registration/iterations/rmse_mm", name="RMSE (mm)"),
                    rrb.TimeSeriesView(origin="/registration/iterations/fitness", name="Fitness"),
                    rrb.TimeSeriesView(origin="/registration/iterations/inliers", name="Inliers"),
                    name="On timeline iteration",
                ),
                _space(scene, "Trajectories", paths, reach=ROUND * _surround(scene), steepness=4.0),
                rrb.TextDocumentView(origin="/odometry/summary", name="Odometry"),
                rrb.TimeSeriesView(origin="/odometry/threshold_m", name="On timeline sensor_time"),
            ),
        ),
        row_shares=[1.4, 1.0],
        name="Registration",
    )


def _surface(scene: Scene) -> rrb.Horizontal:
    edges = [
        "/outline/edges/**",
        "/surface/chosen",
        "/surface/hull",
        "/model/uncertainty/**",
        "- /outline/edges/image_border/**",
    ]
    fit = ["/surface/residuals", "/surface/candidates/**", "/model/uncertainty/**"]
    return rrb.Horizontal(
        rrb.Tabs(
            _space(scene, "Edges by kind", edges, reach=NEAR * scene.extent, steepness=5.0),
            _space(
                scene, "Residuals and candidates", fit, reach=NEAR * scene.extent, steepness=5.0
            ),
        ),
        rrb.Vertical(
            rrb.Tabs(
                rrb.TextDocumentView(origin="/surface/summary", name="Choice"),
                rrb.TextDocumentView(origin="/outline/summary", name="Edge counts"),
                rrb.TextDocumentView(origin="/surface/crosscheck", name="Camera against laser"),
            ),
            rrb.Tabs(
                rrb.Spatial2DView(
                    origin="/surface/unrolled",
                    name="Residuals along the outline",
                    visual_bounds=rrb.VisualBounds2D(x_range=(-65, 425), y_range=(-125, 150)),
                ),
                rrb.BarChartView(origin="/surface/residual_histogram_mm", name="Histogram (mm)"),
                rrb.TimeSeriesView(origin="/outline/height_mm", name="Height by view (mm)"),
            ),
            row_shares=[1.2, 1.0],
        ),
        column_shares=[1.3, 1.0],
        name="Surface",
    )


def _legs(scene: Scene) -> rrb.Horizontal:
    shown = ["/legs/**", f"/surface/candidates/{scene.shape}", "/model/legs/**"]
    return rrb.Horizontal(
        _space(
            scene, "Legs from the laser's height", shown, reach=NEAR * scene.extent, steepness=1.2
        ),
        rrb.TextDocumentView(origin="/legs/summary", name="Legs"),
        column_shares=[1.4, 1.0],
        name="Legs",
    )


def _timings() -> rrb.Vertical:
    return rrb.Vertical(
        rrb.Horizontal(
            rrb.Spatial2DView(
                origin="/timing",
                name="Stages",
                contents=["/timing/bars", "/timing/names"],
                visual_bounds=rrb.VisualBounds2D(x_range=(-160, 430), y_range=(-20, 270)),
            ),
            rrb.TextDocumentView(origin="/timing/summary", name="Seconds"),
            column_shares=[1.6, 1.0],
        ),
        rrb.TextLogView(origin="/log", name="Warnings and what was set aside"),
        name="Timings",
    )


def _middle(scene: Scene) -> tuple[float, float]:
    """Return the place that a view of the stops round the table looks at."""
    stops = [(pose.x, pose.y) for pose in scene.localised]
    if scene.centre is None:
        return tuple(np.mean(stops, axis=0).tolist()) if stops else (0.0, 0.0)
    if not stops:
        return scene.centre
    away = np.array(stops) - np.array(scene.centre)
    reach = MOST_ROUND * scene.extent
    low = np.minimum(np.clip(away, -reach, reach).min(axis=0), -scene.extent)
    high = np.maximum(np.clip(away, -reach, reach).max(axis=0), scene.extent)
    middle = np.array(scene.centre) + (low + high) / 2
    return float(middle[0]), float(middle[1])


def _surround(scene: Scene) -> float:
    """Return how far from the middle the table and the stops reach, within reason (metres)."""
    if not scene.localised:
        return 2 * scene.extent
    middle = np.array(_middle(scene))
    away = np.linalg.norm([pose.translation - middle for pose in scene.localised], axis=1)
    if scene.centre is None:
        return float(max(np.median(away), 2 * scene.extent))
    table = float(np.linalg.norm(np.array(scene.centre) - middle)) + scene.extent
    return min(max(float(np.median(away)), table), MOST_ROUND * scene.extent)


def _between_stops(scene: Scene) -> float:
    """Return how far aside (radians) the eye stands, so that no stop hides the table."""
    x, y = scene.centre or (0.0, 0.0)
    seen = [math.atan2(pose.y - y, pose.x - x) for pose in scene.localised]
    aside = np.linspace(EYE_ASIDE / 2, MOST_ASIDE, 40)
    if not seen:
        return EYE_ASIDE
    away = (scene.yaw - math.pi / 2 + aside)[:, None] - np.array(seen)
    gaps = np.abs((away + math.pi) % (2 * math.pi) - math.pi).min(axis=1)
    return float(aside[np.argmax(gaps)])


def _quiet(scene: Scene) -> dict[str, Shown]:
    """Return what lets the model stand out: one colour for scans and clutter, thin paths."""
    quiet: dict[str, Shown] = {
        "/model/uncertainty": rrb.EntityBehavior(visible=False),
        "/trajectory/registered": rr.LineStrips3D.from_fields(
            colors=[colours.MUTED], radii=rr.Radius.ui_points(1.0)
        ),
    }
    for k in range(len(scene.localised)):
        for path, tint in (("scan", colours.WALL), ("clutter", colours.CLUTTER)):
            quiet[f"/registration/after/{path}/{k:02d}"] = rr.Points3D.from_fields(colors=[tint])
    return quiet


def _space(
    scene: Scene,
    name: str,
    contents: list[str],
    *,
    reach: float,
    steepness: float,
    aside: float = 0.0,
    overrides: Mapping[rr.datatypes.EntityPath | str, Shown] | None = None,
) -> rrb.Spatial3DView:
    """Return a 3D view that looks at the table from ``reach`` metres away, its length across.

    ``steepness`` is how far the eye rises for each metre that it stands back, ``aside`` how far
    (radians) it stands from straight before the table.
    """
    frame = scene.names.fixed if scene.names else "map"
    x, y = _middle(scene) if reach >= ROUND * _surround(scene) else scene.centre or (0.0, 0.0)
    back = reach / math.hypot(1.0, steepness)
    target = (x, y, 0.8 * scene.height)
    heading = scene.yaw - math.pi / 2 + (aside or EYE_ASIDE / max(steepness, 1.0) ** 2)
    eye = (x + back * math.cos(heading), y + back * math.sin(heading), target[2] + steepness * back)
    return rrb.Spatial3DView(
        name=name,
        origin="/",
        contents=contents,
        overrides=overrides,
        spatial_information=rrb.SpatialInformation(target_frame=frame),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0)
        ),
    )
