"""Edges of the top: where they are, what made them; height and thickness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import minimum_filter

from tablemap.config import CalibrationConfig, OutlineConfig, SensorsConfig
from tablemap.errors import EstimationError
from tablemap.geometry import Bools
from tablemap.stages.calibration import calibrate
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges, find_edges
from tablemap.stages.outline.thickness import (
    RIM_SIGMA_M,
    FaceEnds,
    joint_rim,
    joint_thickness,
)
from tablemap.stages.segmentation import Label, Segmentation
from tablemap.stages.snapshots import Snapshot
from tests.making.casting import Box, Drum, looking
from tests.making.photographs import CAMERA, Scene, photograph, segmentation_of

CONFIG = OutlineConfig()
SENSORS = SensorsConfig()
LOW_CAMERA, HIGH_CAMERA = looking(1.09, np.radians(32.0)), looking(1.38, np.radians(40.0))
TOP = Box(1.3, 0.1, 0.8, 0.7, 0.72, 0.745, 0.3)


def outline_of(scene: Scene, *mounts: np.ndarray, seed: int = 0) -> Outline:
    """Photograph the scene from each mounting and find its edges."""
    rng = np.random.default_rng(seed)
    shots = [photograph(scene, pose, rng, index=i) for i, pose in enumerate(mounts)]
    return find_edges(
        tuple(snapshot for snapshot, _ in shots),
        segmentation_of([view for _, view in shots], scene.top.high),
        config=CONFIG,
        sensors=SENSORS,
    )


def errors_mm(scene: Scene, view: ViewEdges, *, near: bool) -> np.ndarray:
    """Return how far outside the true outline the table edges of a view lie, millimetres."""
    chosen = (view.kind == EdgeKind.TABLE) & (view.is_near == near)
    return scene.top.outside(view.points[chosen]) * 1e3


@pytest.mark.parametrize("pose", [LOW_CAMERA, HIGH_CAMERA], ids=["low", "high"])
@pytest.mark.parametrize(
    "top",
    [TOP, Drum(1.25, 0.0, 0.8, 0.72, 0.745), Box(1.3, 0.1, 0.8, 0.7, 0.705, 0.745, 0.7)],
    ids=["rectangle", "circle", "thick"],
)
def test_near_and_far_edges_lie_on_the_outline(top: Box | Drum, pose: np.ndarray) -> None:
    """Neither the side face at near edges nor the mixed pixels at far ones shift the edge."""
    scene = Scene(top)
    (view,) = outline_of(scene, pose).views
    near, far = errors_mm(scene, view, near=True), errors_mm(scene, view, near=False)
    assert min(len(near), len(far)) > 80
    assert abs(np.median(near)) < 0.5
    assert abs(np.median(far)) < 0.7
    assert np.std(near) < 2.0
    assert np.std(far) < 3.0


def test_sigma_covers_the_scatter_without_wild_excess() -> None:
    """Errors over sigma scatter by at most one, and by no less than a tenth."""
    scene = Scene(TOP)
    for view in outline_of(scene, LOW_CAMERA, HIGH_CAMERA).views:
        table = view.kind == EdgeKind.TABLE
        ratio = scene.top.outside(view.points[table]) / view.sigma[table]
        assert 0.1 < np.std(ratio) < 1.1


def test_normals_are_outward_units() -> None:
    """On a circle the normals point away from its centre."""
    scene = Scene(Drum(1.25, 0.0, 0.8, 0.72, 0.745))
    (view,) = outline_of(scene, HIGH_CAMERA).views
    table = view.kind == EdgeKind.TABLE
    radial = view.points[table] - np.array([1.25, 0.0])
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    cosine = np.sum(radial * view.normals[table], axis=1)
    np.testing.assert_allclose(np.linalg.norm(view.normals[table], axis=1), 1.0, atol=1e-9)
    assert np.percentile(cosine, 2) > np.cos(np.radians(20))
    # Near is where the camera stands outside the edge's tangent.
    toward = np.sum((view.camera_xy - view.points[table]) * view.normals[table], axis=1)
    assert np.mean((toward > 0) == view.is_near[table]) > 0.95


def test_height_and_thickness() -> None:
    """Height to half a millimetre; thickness to two where the lower end of the face is seen."""
    outline = outline_of(Scene(TOP), LOW_CAMERA, HIGH_CAMERA)
    assert outline.height == pytest.approx(0.745, abs=5e-4)
    assert outline.height_sigma < 2e-3
    assert set(outline.height_by_view) == {0, 1}
    assert outline.thickness == pytest.approx(0.025, abs=2e-3)
    assert outline.thickness_sigma is not None
    assert 2e-4 < outline.thickness_sigma < 3e-3


def bent(snapshot: Snapshot, top: Bools, further: float) -> Snapshot:
    """Let the rows about the near rim of the top read further, by up to so many metres."""
    rows = np.arange(snapshot.depth.shape[0])[:, None]
    rim = np.flatnonzero(top.any(axis=1))[-1]
    more = further * np.exp(-(((rows - rim) / 80.0) ** 2))
    return replace(snapshot, depth=(snapshot.depth + more).astype(np.float32))


def aims_mm(scene: Scene, pose: np.ndarray, view: ViewEdges) -> np.ndarray:
    """Return how far outside the rim the rays of near edges meet the top's level, millimetres."""
    u, v = view.pixels[(view.kind == EdgeKind.TABLE) & view.is_near].T
    rays = np.column_stack(
        [(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(len(u))]
    )
    rays = rays @ pose[:3, :3].T
    reach = (scene.top.high - pose[2, 3]) / rays[:, 2]
    return scene.top.outside(pose[:2, 3] + reach[:, None] * rays[:, :2]) * 1e3


@pytest.mark.parametrize("further", [-0.004, 0.004])
def test_near_edges_do_not_follow_a_bend(further: float) -> None:
    """Where top and side face read too far together, the edge between them stays."""
    scene = Scene(TOP)
    shot, view = photograph(scene, HIGH_CAMERA, np.random.default_rng(0))
    found = [
        find_edges(
            (snapshot,), segmentation_of([view], 0.745), config=CONFIG, sensors=SENSORS
        ).views[0]
        for snapshot in (shot, bent(shot, view.labels == Label.TOP, further))
    ]
    flat, after = (aims_mm(scene, HIGH_CAMERA, edges) for edges in found)
    assert len(after) > 0.9 * len(flat)
    assert abs(np.median(after) - np.median(flat)) < 0.5


def test_a_face_that_reads_nearer_is_no_round_rim() -> None:
    """Where surfaces may err apart, by millimetres, a millimetre shows no bevel."""
    faces = [FaceEnds(*[np.zeros(0)] * 3, bulge=np.full(200, 0.0015)) for _ in range(4)]
    assert joint_rim(faces) == (0.0015, RIM_SIGMA_M)
    rim = joint_rim(faces, surface_depth_sigma=0.002)
    assert rim is not None
    assert rim[1] == pytest.approx(np.hypot(RIM_SIGMA_M, 0.002))


def test_depth_in_steps_of_centimetres_shows_no_round_rim() -> None:
    """A face of one or two depth values may seem to lie millimetres outside of a sharp edge."""
    for seed in range(3):
        coarse = outline_of(Scene(TOP, steps=0.02), LOW_CAMERA, HIGH_CAMERA, seed=seed)
        assert coarse.rim is not None
        assert coarse.rim_sigma is not None
        assert coarse.rim_sigma > 0.004
        assert abs(coarse.rim) < 2 * coarse.rim_sigma
    fine = outline_of(Scene(TOP), LOW_CAMERA, HIGH_CAMERA)
    assert fine.rim_sigma is not None
    assert fine.rim_sigma < 0.001


@pytest.mark.parametrize(("views", "apart", "least"), [(1, 0.0, 2.0), (2, 4.0, 1.7), (8, 0.0, 0.5)])
def test_few_views_and_views_that_differ_leave_the_thickness_open(
    views: int, apart: float, least: float
) -> None:
    """Millimetres: one view errs by a pixel; many that agree tell it to a part of a pixel."""
    rng = np.random.default_rng(0)
    faces = [
        FaceEnds(
            drop=0.025 + 0.0005 * rng.normal(size=60) + 0.001 * apart * (i % 2),
            resolution=np.full(60, 0.002),
            tau=np.zeros(60),
            bulge=np.zeros(0),
        )
        for i in range(views)
    ]
    thickness = joint_thickness(faces, config=CONFIG)
    assert thickness is not None
    assert least <= 1e3 * thickness.sigma < 2 * least


def test_a_pixel_more_of_the_face_is_as_high_as_the_face_shows() -> None:
    """A face that the camera sees from high above is steep in the image: a pixel spans more."""
    for pose in (LOW_CAMERA, HIGH_CAMERA):
        outline = outline_of(Scene(TOP), pose)
        away, down = np.hypot(TOP.x - 0.35, TOP.y) - pose[0, 3], pose[2, 3] - TOP.high
        sight = np.hypot(away, down)
        assert outline.thickness_per_px == pytest.approx(sight**2 / away / CAMERA.fy, rel=0.15)


def test_depth_in_steps_of_centimetres_leaves_the_thickness_open() -> None:
    """A face of one or two depth values may lie centimetres off, and its end with it."""
    coarse = outline_of(Scene(TOP, steps=0.02), LOW_CAMERA, HIGH_CAMERA)
    fine = outline_of(Scene(TOP), LOW_CAMERA, HIGH_CAMERA)
    assert fine.thickness_sigma is not None
    assert fine.thickness_sigma < 0.0015
    assert coarse.thickness_sigma is not None
    assert coarse.thickness_sigma > 0.0022
    assert coarse.thickness == pytest.approx(0.025, abs=2 * coarse.thickness_sigma)


def test_apron_is_not_the_thickness() -> None:
    """An apron set back by 3 cm does not count as side face."""
    scene = Scene(TOP, (Box(1.3, 0.1, 0.74, 0.64, 0.62, 0.72, 0.3),))
    assert outline_of(scene, LOW_CAMERA, HIGH_CAMERA).thickness == pytest.approx(0.025, abs=2e-3)


def test_solid_block_has_no_thickness() -> None:
    """A face that reaches the floor gives no thickness."""
    assert outline_of(Scene(replace(TOP, low=0.0)), LOW_CAMERA).thickness is None


def test_bevelled_rim_puts_near_edges_at_the_face() -> None:
    """A rim that falls 8 mm is dull and its near edges lie on the face; a sharp one is not."""
    steps = np.linspace(0.0, 0.008, 5)
    tiers = [Box(TOP.x, TOP.y, 0.8 - 2 * s, 0.7 - 2 * s, 0.705, 0.737 + s, TOP.yaw) for s in steps]
    bevelled = outline_of(Scene(tiers[-1], tuple(tiers[:-1])), LOW_CAMERA)
    assert bevelled.is_dull
    for view in bevelled.views:
        near = (view.kind == EdgeKind.TABLE) & view.is_near
        assert near.sum() > 80
        assert abs(np.median(tiers[0].outside(view.points[near]))) < 1e-3
    sharp = outline_of(Scene(replace(TOP, low=0.705)), LOW_CAMERA, HIGH_CAMERA)
    assert sharp.rim == pytest.approx(0.0, abs=4e-4)
    assert not sharp.is_dull


def test_thin_top() -> None:
    """A top of 8 mm, hardly more than the tolerance, comes out within 2.5 mm at near edges."""
    scene = Scene(replace(TOP, low=0.737))
    (view,) = outline_of(scene, LOW_CAMERA).views
    assert abs(np.median(errors_mm(scene, view, near=True))) < 2.5


@pytest.mark.parametrize("baseline", [0.05, 0.075, 0.12])
def test_shadows_beside_an_edge_are_bridged(baseline: float) -> None:
    """The dark strip that a sensor leaves on the floor neither hides nor shifts the edge.

    So it is with a baseline that is wider than the one that is believed.
    """
    scene = Scene(TOP, shadow_baseline=baseline)
    (view,) = outline_of(scene, HIGH_CAMERA).views
    far = errors_mm(scene, view, near=False)
    assert len(far) > 120
    assert abs(np.median(far)) < 2.0
    assert np.percentile(np.abs(far), 95) < 8.0


def test_a_wider_top_moves_only_edges_with_the_background_beside_them() -> None:
    """A pixel is worth millimetres at far edges and nothing before a side face.

    Where the side face is a sliver, the point is as uncertain as a pixel.
    """
    (view,) = outline_of(Scene(TOP), HIGH_CAMERA).views
    table = view.kind == EdgeKind.TABLE
    far, near = table & ~view.is_near, table & view.is_near
    assert (view.widening[far] > 0.0005).all()
    assert np.mean(view.widening[near] == 0) > 0.8
    sliver = near & (view.widening > 0)
    assert (view.sigma[sliver] > view.widening[sliver]).all()


def test_what_stereo_widens_hides_no_edge() -> None:
    """Beyond far edges two pixels have the depth of the top before them: they are no occluder."""
    scene = Scene(TOP, noise=0.2)
    shot, view = photograph(scene, LOW_CAMERA, np.random.default_rng(0))
    depth = np.nan_to_num(shot.depth, nan=np.float32(9.0))
    nearest = minimum_filter(depth, 5)
    widened = replace(shot, depth=np.where(depth - nearest > 0.06, nearest, shot.depth))
    sensors, _ = SensorsConfig(depth_camera="stereo").of_camera(None)
    segmentation = segmentation_of([view], 0.745)
    sharp, wide = (
        find_edges((each,), segmentation, config=CONFIG, sensors=sensors).views[0]
        for each in (shot, widened)
    )
    far = [np.count_nonzero((e.kind == EdgeKind.TABLE) & ~e.is_near) for e in (sharp, wide)]
    assert far[1] > 0.9 * far[0]
    assert np.count_nonzero(wide.kind == EdgeKind.OCCLUDED) <= 10
    moved = np.median(errors_mm(scene, wide, near=False)) - np.median(
        errors_mm(scene, sharp, near=False)
    )
    pixel = 1e3 * np.median(wide.widening[(wide.kind == EdgeKind.TABLE) & ~wide.is_near])
    assert 1.5 * pixel < moved < 3.0 * pixel


def test_coarse_depth_steps_give_edges_with_honest_sigma() -> None:
    """Steps of 39 mm scatter the near edges by centimetres, and the sigma says so."""
    scene = Scene(replace(TOP, low=0.70), steps=0.039)
    (view,) = outline_of(scene, LOW_CAMERA).views
    near = errors_mm(scene, view, near=True)
    table = view.kind == EdgeKind.TABLE
    sigma = view.sigma[table & view.is_near] * 1e3
    assert len(near) > 50
    assert np.std(near / sigma) < 1.6
    assert np.median(sigma) > 4.0
    assert abs(np.median(errors_mm(scene, view, near=False))) < 2.0


@pytest.mark.parametrize(
    "clutter",
    [
        Box(1.62, 0.0, 0.2, 0.2, 0.745, 0.95),
        Box(0.95, 0.1, 0.25, 0.2, 0.745, 0.85),
        Box(0.75, 0.1, 0.05, 0.3, 0.0, 0.95),
    ],
    ids=["far-edge", "overhanging-near-edge", "chair-back"],
)
def test_clutter_is_no_table_edge(clutter: Box) -> None:
    """No table edge lies off the outline, whatever stands on, over or beside it."""
    scene = Scene(replace(TOP, yaw=0.0), (clutter,))
    (view,) = outline_of(scene, HIGH_CAMERA).views
    table = view.kind == EdgeKind.TABLE
    off = np.abs(scene.top.outside(view.points[table]))
    assert table.sum() > 80
    assert np.mean(off > 0.015) < 0.01
    assert np.sum(view.kind == EdgeKind.OCCLUDED) > 5


def test_end_of_the_image_is_a_border() -> None:
    """Where the image cuts the top, the end is no table edge."""
    scene = Scene(Box(1.4, 0.0, 0.8, 3.0, 0.70, 0.74))
    (view,) = outline_of(scene, HIGH_CAMERA).views
    border = view.kind == EdgeKind.BORDER
    assert border.sum() > 50
    assert np.median(scene.top.outside(view.points[border])) < -0.05
    assert len(errors_mm(scene, view, near=False)) > 80


def test_missing_depth_is_no_table_edge() -> None:
    """A wide hole in the depth that swallows an edge is said to be missing."""
    scene = Scene(TOP)
    snapshot, view = photograph(scene, HIGH_CAMERA, np.random.default_rng(0))
    rows, columns = np.nonzero(view.labels == Label.TOP)
    middle = int(np.median(rows))
    hole = slice(middle - 40, middle + 40), slice(int(np.median(columns)), columns.max() + 40)
    depth, labels = snapshot.depth.copy(), view.labels.copy()
    depth[hole], labels[hole] = np.nan, Label.UNKNOWN
    outline = find_edges(
        (replace(snapshot, depth=depth),),
        segmentation_of([replace(view, labels=labels)], 0.745),
        config=CONFIG,
        sensors=SENSORS,
    )
    (edges,) = outline.views
    table = edges.kind == EdgeKind.TABLE
    assert np.max(np.abs(scene.top.outside(edges.points[table]))) < 0.02
    assert np.sum(edges.kind == EdgeKind.MISSING) > 20


@pytest.mark.parametrize("kept", [4, 6])
def test_what_is_left_of_a_torn_edge_is_uncertain(kept: int) -> None:
    """Where a far edge mostly lacks depth, the ends between lie pixels inside, and may.

    Matching windows tear the edge of a dark top so before a bright floor: of every twenty columns,
    a few read the floor in the outer four pixels of the top, and the others have no depth.
    """
    scene = Scene(TOP)
    snapshot, view = photograph(scene, HIGH_CAMERA, np.random.default_rng(0))
    top = view.labels == Label.TOP
    rows, columns = np.arange(len(top))[:, None], np.arange(top.shape[1])[None, :]
    inside_px = np.where(top.any(axis=0), rows - top.argmax(axis=0), len(top))
    wins = columns % 20 < kept
    floor, lost = top & wins & (inside_px < 4), top & ~wins & (inside_px < 12)
    pose = snapshot.base_from_camera
    on_floor = -pose[2, 3] / (snapshot.camera.rays @ pose[2, :3])
    depth = np.where(floor, on_floor, np.where(lost, np.nan, snapshot.depth)).astype(np.float32)
    labels = np.where(floor, Label.BEHIND, np.where(lost, Label.UNKNOWN, view.labels))
    whole, left = (
        find_edges((shot,), segmentation_of([seen], TOP.high), config=CONFIG, sensors=SENSORS)
        for shot, seen in (
            (snapshot, view),
            (replace(snapshot, depth=depth), replace(view, labels=labels.astype(np.uint8))),
        )
    )
    far, near = errors_mm(scene, left.views[0], near=False), left.views[0].is_near
    table = left.views[0].kind == EdgeKind.TABLE
    sigma = 1e3 * left.views[0].sigma
    pixel = 1e3 * left.views[0].metres_per_px
    off = far / pixel[table & ~near]
    assert np.count_nonzero(off < -2) > 10
    assert np.mean((sigma / pixel)[table & ~near][off < -2] > 3.5) > 0.8
    assert np.count_nonzero(table & near) > 80
    np.testing.assert_allclose(
        np.median(sigma[table & near]),
        1e3 * np.median(whole.views[0].sigma[whole.views[0].is_near]),
        rtol=0.1,
    )


def test_small_holes_do_not_tear_an_edge() -> None:
    """A far edge that lacks depth in places still counts."""
    scene = Scene(TOP)
    snapshot, view = photograph(scene, HIGH_CAMERA, np.random.default_rng(0))
    lost = (view.labels == Label.TOP) & (np.arange(snapshot.depth.shape[1])[None, :] % 60 < 6)
    found = [
        find_edges(
            (replace(snapshot, depth=depth.astype(np.float32)),),
            segmentation_of([view], TOP.high),
            config=CONFIG,
            sensors=SENSORS,
        ).views[0]
        for depth in (snapshot.depth, np.where(lost, np.nan, snapshot.depth))
    ]
    whole, holed = (e.sigma[(e.kind == EdgeKind.TABLE) & ~e.is_near] for e in found)
    assert len(holed) > 0.7 * len(whole)
    assert np.mean(holed > 2 * np.median(whole)) < 0.2


@pytest.mark.parametrize("rim", [0.02, 0.04])
def test_ends_at_a_rim_without_depth_tell_its_width(rim: float) -> None:
    """Near ends are at missing depth; where the pixels are smallest, the hole is as wide."""
    scene = Scene(TOP)
    snapshot, view = photograph(scene, HIGH_CAMERA, np.random.default_rng(0))
    pose = snapshot.base_from_camera
    rays = snapshot.camera.rays @ pose[:3, :3].T
    on_plane = pose[:2, 3] + rays[..., :2] * ((TOP.high - pose[2, 3]) / rays[..., 2])[..., None]
    inside = -TOP.outside(on_plane.reshape(-1, 2)).reshape(rays.shape[:2])
    dark = (view.labels == Label.TOP) & (inside < rim)
    outline = find_edges(
        (replace(snapshot, depth=np.where(dark, np.nan, snapshot.depth).astype(np.float32)),),
        segmentation_of(
            [replace(view, labels=np.where(dark, 0, view.labels).astype(np.uint8))], TOP.high
        ),
        config=CONFIG,
        sensors=SENSORS,
    )
    (edges,) = outline.views
    near = edges.is_near & np.isin(edges.kind, (EdgeKind.TABLE, EdgeKind.MISSING))
    assert np.mean(edges.kind[near] == EdgeKind.MISSING) > 0.6
    told = np.isfinite(edges.hole) & ~edges.is_near
    sharp = told & (edges.metres_per_px < 1.5 * edges.metres_per_px[told].min())
    pixel = float(np.median(edges.metres_per_px[sharp]))
    assert np.median(edges.hole[sharp]) == pytest.approx(rim, abs=1.5 * pixel)


def test_views_that_were_left_out_for_their_height_widen_its_sigma() -> None:
    """The top that they saw is as likely the table's: the sigma reaches it."""
    shot, view = photograph(Scene(TOP), HIGH_CAMERA, np.random.default_rng(0), index=0)
    alike = segmentation_of([view], TOP.high)
    one, other = (
        find_edges((shot,), replace(alike, height_apart=apart), config=CONFIG, sensors=SENSORS)
        for apart in (0.0, 0.02)
    )
    assert other.height == one.height
    assert other.height_sigma == pytest.approx(np.hypot(one.height_sigma, 0.02))


@pytest.mark.parametrize(("rise", "is_doubted"), [(0.0, False), (0.004, False), (0.02, True)])
def test_a_top_that_was_raised_between_views_is_doubted(rise: float, is_doubted: bool) -> None:
    """Two of four views show it higher: the height's sigma reaches both."""
    rng = np.random.default_rng(0)
    high = replace(TOP, low=TOP.low + rise, high=TOP.high + rise)
    shots = [
        photograph(Scene(high if index > 1 else TOP), HIGH_CAMERA, rng, index=index)
        for index in range(4)
    ]
    outline = find_edges(
        tuple(snapshot for snapshot, _ in shots),
        segmentation_of([view for _, view in shots], TOP.high + rise / 2),
        config=CONFIG,
        sensors=SENSORS,
    )
    codes = {warning.code for warning in outline.warnings}
    assert ("accuracy.height_scatter" in codes) == is_doubted
    assert abs(outline.height - TOP.high) < max(2 * outline.height_sigma, 0.001)
    assert abs(outline.height - high.high) < max(2 * outline.height_sigma, 0.001)


@pytest.mark.parametrize("lift", [0.0, 0.0015])
def test_what_the_calibration_took_for_lifts_of_the_camera_counts(lift: float) -> None:
    """Raised by 6 mm, of which 3 mm went into the cameras' own heights: doubted all the same."""
    rng = np.random.default_rng(0)
    rise = 0.006 - 2 * lift
    high = replace(TOP, low=TOP.low + rise, high=TOP.high + rise)
    shots = [
        photograph(Scene(high if index > 1 else TOP), HIGH_CAMERA, rng, index=index)
        for index in range(4)
    ]
    snapshots = tuple(snapshot for snapshot, _ in shots)
    plain = calibrate(snapshots, config=CalibrationConfig(), sensors=SENSORS)
    own = np.zeros((4, 3))
    own[:, 2] = [lift, lift, -lift, -lift]
    calibration = replace(plain, adjustment=replace(plain.adjustment, own=own))
    outline = find_edges(
        snapshots,
        segmentation_of([view for _, view in shots], TOP.high + rise / 2),
        config=CONFIG,
        sensors=SENSORS,
        calibration=calibration,
    )
    assert "accuracy.height_scatter" in {warning.code for warning in outline.warnings}
    # What is plotted is what is doubted: the views' heights before the cameras' are adjusted.
    seen = [outline.height_by_view[index] for index in range(4)]
    assert np.mean(seen[2:]) - np.mean(seen[:2]) == pytest.approx(0.006, abs=0.0015)
    assert outline.height_sigma > 0.003


def test_votes_lie_on_their_own_side() -> None:
    """Points seen as top lie on the top, points seen through off it."""
    scene = Scene(TOP)
    (view,) = outline_of(scene, HIGH_CAMERA).views
    assert len(view.top) > 500
    assert scene.top.outside(view.top).max() < 0.003
    assert len(view.free) > 500
    assert scene.top.outside(view.free).min() > -0.012


def test_repeats_bit_for_bit() -> None:
    """The same views give the same edges."""
    scene = Scene(TOP)
    first, second = outline_of(scene, LOW_CAMERA), outline_of(scene, LOW_CAMERA)
    np.testing.assert_array_equal(first.views[0].points, second.views[0].points)
    assert first.height == second.height


def test_nothing_seen_is_an_error_and_little_is_a_warning() -> None:
    """No top at all raises; a view with hardly any is set aside with its reason."""
    scene = Scene(TOP)
    snapshot, view = photograph(scene, LOW_CAMERA, np.random.default_rng(0))
    blind = replace(snapshot, index=1, depth=np.full_like(snapshot.depth, np.nan))
    dark = replace(view, index=1, labels=np.zeros_like(view.labels))
    with pytest.raises(EstimationError, match="no edges"):
        find_edges((blind,), segmentation_of([dark], 0.745), config=CONFIG, sensors=SENSORS)
    with pytest.raises(EstimationError, match="no edges"):
        find_edges((), Segmentation((), 0.745, 0.002, (), ()), config=CONFIG, sensors=SENSORS)
    outline = find_edges(
        (snapshot, blind),
        segmentation_of([view, dark], 0.745),
        config=CONFIG,
        sensors=SENSORS,
    )
    assert [edges.index for edges in outline.views] == [0]
    assert [warning.code for warning in outline.warnings] == ["outline.view_without_edges"]


def test_a_raised_rim_is_named_as_the_cause() -> None:
    """A rim of 20 mm along all four sides hides the top's end: the error says so."""
    top = Box(1.3, 0.1, 0.8, 0.7, 0.72, 0.745)
    low, high = top.low, top.high + 0.02
    rim = (
        Box(1.3 - 0.3925, 0.1, 0.015, 0.7, low, high),
        Box(1.3 + 0.3925, 0.1, 0.015, 0.7, low, high),
        Box(1.3, 0.1 - 0.3425, 0.8, 0.015, low, high),
        Box(1.3, 0.1 + 0.3425, 0.8, 0.015, low, high),
    )
    with pytest.raises(EstimationError, match="a raised rim"):
        outline_of(Scene(top, rim), LOW_CAMERA, HIGH_CAMERA)
