"""The viewer's layout when the file opens: the overview first, then a tab for each stage."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from tablemap import palette
from tablemap.review import tabs
from tablemap.review.eyes import Overrides, overview_eye, seen_from
from tablemap.review.legend import with_legend
from tablemap.review.panes import Contents, beside, best_image, image, text
from tablemap.review.scene import FEW_STOPS, DrawnScene


def blueprint(scene: DrawnScene) -> rrb.Blueprint:
    """Return the layout, with its eyes placed by the known part of the scene.

    Only stages that began have tabs, and only what was drawn: the others have nothing to show.
    """
    begun = {name for name, _ in scene.stages}
    shown: list[rrb.Container] = [_overview(scene)]
    for stage, tab, has_data in (
        ("calibration", tabs.views, True),
        ("odometry", tabs.odometry, scene.has_laser),
        ("registration", tabs.registration, True),
        ("registration", tabs.pairs, scene.pairs_reach is not None),
        ("outline", tabs.surface, True),
        ("legs", tabs.legs, True),
    ):
        if scene.localised and stage in begun and has_data:
            shown.append(tab(scene))
    if scene.tables:
        beside_it = [tabs.table(number, one) for number, one in scene.tables.items()]
        shown.append(rrb.Tabs(*beside_it, name="Tables"))
    if scene.stages:
        shown.append(tabs.timings())
    return rrb.Blueprint(
        rrb.Tabs(contents=shown, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="snapshot"),
        auto_views=False,
        auto_layout=False,
    )


def _overview(scene: DrawnScene) -> rrb.Container:
    shown = [
        "/model/**",
        "/surface/beside",
        "/registration/bases/**" if len(scene.localised) <= FEW_STOPS else "/registration/stops/**",
        "/registration/after/scan/**",
        "/trajectory/registered" if len(scene.localised) <= FEW_STOPS else "/trajectory/cameras",
        "/story/**",
        "/stop/**",
        "/doubts/overview/**",
    ]
    for number in scene.tables:
        below = f"/tables/{number:02d}"
        shown += [f"{below}/model/top/**", f"{below}/model/legs/**", f"{below}/name/**"]
    if len(scene.localised) <= FEW_STOPS:
        shown.append("/registration/after/clutter/**")
    if "legs" not in scene.reached or scene.failed:
        shown += ["/segmentation/candidates/**", "/trajectory/localised"]
    if scene.failed:  # the names stand clear for this view's own eye
        shown += [f"- /segmentation/candidates/{which}/names/**" for which in ("chosen", "others")]
    if "legs" not in scene.reached:
        shown += ["/registration/after/**", "/outline/edges/table/**", "/surface/chosen/**"]
    if "registration" not in scene.reached:
        shown += [
            "/registration/localised_stops/**",
            "/segmentation/points",
            "/laser/scan",
            "/robot/**",
            "/camera",
        ]
    space = seen_from(overview_eye(scene), scene, "Table and stops", shown, overrides=_quiet(scene))
    right: list[Contents] = [text("/summary", "Summary")]
    if scene.localised:
        right = [rrb.Vertical(*right, image(scene, best_image(scene)), row_shares=[1.7, 1.0])]
    return beside("Overview", 1.7, with_legend(space, "overview", height=620), *right)


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
