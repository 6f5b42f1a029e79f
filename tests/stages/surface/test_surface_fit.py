"""Shape, size and sigmas of the top come out of noisy edge points of misplaced views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.errors import EstimationError
from tablemap.geometry import Pose2
from tablemap.stages.calibration import TopBelief
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges
from tablemap.stages.registration import Registration
from tablemap.stages.surface import Mounting, Surface, fit_surface
from tablemap.stages.surface.shapes.shape import area, signed_distance
from tablemap.stages.surface.shapes.sides import Sight
from tablemap.stages.surface.status import own_statuses
from tests.making.edges import (
    Bench,
    Table,
    box_table,
    cut_off,
    desk,
    ellipse_table,
    l_table,
    observe,
    rounded,
    school_table,
    stadium_table,
)

SENSORS = SensorsConfig()

POSE = Pose2(0.31, -0.22, 0.37)
TABLES = {
    "circle": ellipse_table(0.9, 0.9, POSE),
    "ellipse of one per cent": ellipse_table(1.0, 0.98, POSE),
    "rectangle": box_table(1.2, 0.8, POSE),
    "square": box_table(0.55, 0.55, POSE),
    "parallelogram": box_table(1.2, 0.8, POSE, np.radians(91.0)),
    "rounded rectangle": rounded(box_table(1.0, 0.6, POSE), 0.08),
    "rounded square": rounded(box_table(0.7, 0.7, POSE), 0.06),
    "rounded parallelogram": rounded(box_table(1.2, 0.8, POSE, np.radians(70.0)), 0.08),
    "rounded trapezoid": rounded(school_table(POSE), 0.06),
    "rounded L": rounded(l_table(POSE), 0.05),
    "rectangle with cut corners": cut_off(box_table(1.2, 0.8, POSE), 0.04),
    "L with cut corners": cut_off(l_table(POSE), 0.04),
    "stadium": stadium_table(1.6, 0.8, POSE),
    "short stadium": stadium_table(1.1, 0.9, POSE),
    "desk with a cut-out": desk(POSE),
    "L": l_table(POSE),
}


def _fit(table: Table, bench: Bench, seed: int) -> Surface:
    outline, registration = observe(table, bench, np.random.default_rng(seed))
    return fit_surface(outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)


def _fit_views(
    outline: Outline,
    registration: Registration,
    views: list[ViewEdges],
    mounting: Mounting | None = None,
) -> Surface:
    """Fit the surface to other views of the same outline."""
    seen, config = replace(outline, views=tuple(views)), SurfaceConfig()
    return fit_surface(
        seen, registration, config=config, sensors=SENSORS, seed=0, mounting=mounting
    )


@pytest.mark.parametrize("name", TABLES)
def test_every_shape_is_found_to_millimetres(name: str) -> None:
    """Right shape, outline within 4 mm, dimensions within 4 mm and four sigmas, all measured."""
    table = TABLES[name]
    surface = _fit(table, Bench(), 5)
    assert surface.shape == table.shape
    assert np.abs(signed_distance(surface.outline, table.outline)).max() < 0.004
    assert area(surface.outline) > 0
    for key, truth in table.dimensions.items():
        figure = surface.dimensions[key]
        assert figure.status == "measured"
        assert abs(figure.value - truth) < 0.004
        assert figure.sigma is not None
        assert abs(figure.value - truth) < 4 * figure.sigma
        assert figure.sigma < 0.005
    assert {edge.status for edge in surface.edges} <= {"measured", "inferred"}
    assert sum(candidate.score for candidate in surface.candidates) == pytest.approx(1.0)
    assert (surface.corner_radius is None) == (table.corner_radius is None)
    if surface.corner_radius is not None:
        assert surface.corner_radius.sigma is not None
        error = abs(surface.corner_radius.value - (table.corner_radius or 0.0))
        assert error < min(0.006, 4 * surface.corner_radius.sigma)
        assert surface.corner_radius.budget is not None


def _seen_by(view: ViewEdges, turn: float, left: float) -> ViewEdges:
    """Return what a camera reports that is believed turned and shifted: radians and metres."""
    pan, eye = Pose2(0.0, 0.0, turn), view.camera_xy
    shift = np.array([0.0, left])
    return replace(
        view,
        points=pan.apply(view.points - eye) + eye + shift,
        normals=pan.rotate(view.normals),
        top=pan.apply(view.top - eye) + eye + shift,
        free=pan.apply(view.free - eye) + eye + shift,
    )


@pytest.mark.parametrize("play", [0.4, 1.0])
def test_the_play_of_the_head_moves_no_side(play: float) -> None:
    """The head stands on one side of its play at every other stop: a degree costs no millimetre."""
    outline, registration = observe(TABLES["rectangle"], Bench(), np.random.default_rng(5))
    panned = [
        _seen_by(view, np.radians(play) * (0.5 - view.index % 2), 0.0) for view in outline.views
    ]
    still, played = (
        fit_surface(seen, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
        for seen in (outline, replace(outline, views=tuple(panned)))
    )
    assert played.shape == "rectangle"
    for name, figure in played.dimensions.items():
        before = still.dimensions[name]
        assert figure.sigma is not None and before.sigma is not None
        assert abs(figure.value - before.value) < 0.001
        assert figure.sigma < 1.1 * before.sigma


def test_pose_errors_of_centimetres_are_taken_up_by_the_nuisances() -> None:
    """Views 10 mm and 0.3 degrees off still give a rectangle to 5 mm, and better placed views."""
    bench = replace(Bench(), place_sigma=0.01, yaw_sigma=np.radians(0.3))
    surface = _fit(TABLES["rectangle"], bench, 2)
    assert surface.shape == "rectangle"
    assert abs(surface.dimensions["length"].value - 1.2) < 0.005
    assert abs(surface.dimensions["width"].value - 0.8) < 0.005


def test_a_dull_rim_leaves_the_size_to_the_near_edges() -> None:
    """Far edges that end 7 mm early take nothing off a table whose near edges lie on the face."""
    bench = replace(Bench(), far_bias=-2.8)
    outline, registration = observe(TABLES["rectangle"], bench, np.random.default_rng(3))
    dull = replace(outline, rim=0.002, rim_sigma=0.0002)
    surface = fit_surface(dull, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    for key, truth in TABLES["rectangle"].dimensions.items():
        figure = surface.dimensions[key]
        assert figure.sigma is not None
        assert abs(figure.value - truth) < min(0.003, 3 * figure.sigma)


def test_stereo_is_believed_to_widen_until_legs_tell_otherwise() -> None:
    """Far edges 1.5 px outside are expected of stereo; a leg as wide as it is denies them."""
    stereo, _ = SensorsConfig(depth_camera="stereo").of_camera(None)
    bench = replace(Bench(), far_bias=1.5 / SENSORS.edge_sigma_px, bias_sigma=0.0)
    slim = Mounting(np.zeros((4, 4)), np.zeros(4), 1.0, widening=(0.1, 0.1))
    errors = []
    for seed in range(3):
        outline, registration = observe(TABLES["rectangle"], bench, np.random.default_rng(seed))
        alone, denied = (
            fit_surface(
                outline,
                registration,
                config=SurfaceConfig(),
                sensors=stereo,
                seed=0,
                mounting=mounting,
            )
            for mounting in (None, slim)
        )
        for key, truth in TABLES["rectangle"].dimensions.items():
            figure, other = alone.dimensions[key], denied.dimensions[key]
            assert figure.sigma is not None
            assert abs(figure.value - truth) < 2.5 * figure.sigma
            errors.append([figure.value - truth, other.value - truth])
    believed, refused = np.mean(errors, axis=0)
    assert abs(believed) < 0.5 * refused


def test_legs_tell_how_much_stereo_widens_far_edges() -> None:
    """Far edges 1 px outside: the legs, as much wider, take the error out of every dimension."""
    far_bias = 1.0 / SENSORS.edge_sigma_px
    bench = replace(Bench(), far_bias=far_bias, bias_sigma=0.0)
    wide = Mounting(np.zeros((4, 4)), np.zeros(4), 1.0, widening=(1.0, 0.1))
    unclear = replace(wide, widening=(0.3, 0.15))
    errors = []
    for seed in range(3):
        outline, registration = observe(TABLES["rectangle"], bench, np.random.default_rng(seed))
        found = [
            fit_surface(
                outline,
                registration,
                config=SurfaceConfig(),
                sensors=SENSORS,
                seed=0,
                mounting=mounting,
            )
            for mounting in (None, unclear, wide)
        ]
        for key, truth in TABLES["rectangle"].dimensions.items():
            alone, unsure, told = (surface.dimensions[key] for surface in found)
            assert told.sigma is not None
            assert abs(told.value - truth) < min(0.003, 2.5 * told.sigma)
            assert told.value < alone.value
            assert unsure.value == alone.value
            errors.append([alone.value - truth, told.value - truth])
    before, after = np.mean(errors, axis=0)
    assert abs(after) < 0.3 * before


@pytest.mark.parametrize(("left", "turn"), [(0.0, 0.0), (0.05, -0.035), (-0.03, 0.02)])
def test_what_the_legs_clearly_show_of_the_camera_is_believed(left: float, turn: float) -> None:
    """Late stamps on a drive that never stops turn the top against the legs: they undo it.

    The camera seems to sit centimetres beside its place in TF, and turned by degrees.
    """
    outline, registration = observe(TABLES["rectangle"], Bench(), np.random.default_rng(5))
    views = [_seen_by(view, -turn, -left) for view in outline.views]
    information = np.diag(np.array([0.0015, 0.0015, 0.001, 0.002]) ** -2.0)
    mounting = Mounting(information, information @ np.array([0.0, left, turn, 0.0]), 1.0)
    surface = _fit_views(outline, registration, views, mounting)
    assert surface.shape == "rectangle"
    assert surface.pose.yaw == pytest.approx(POSE.yaw, abs=0.003)
    for name, truth in TABLES["rectangle"].dimensions.items():
        assert surface.dimensions[name].value == pytest.approx(truth, abs=0.003)


@pytest.mark.parametrize("name", ["rectangle", "circle", "desk with a cut-out"])
def test_a_fit_with_other_priors_may_start_from_the_first(name: str) -> None:
    """It ends where a fit from scratch does, to a tenth of a sigma, and weighs the same shapes."""
    outline, registration = observe(TABLES[name], Bench(), np.random.default_rng(5))
    tight = np.diag(np.array([0.0005, 0.0005, np.radians(0.02), 0.01]) ** -2.0)
    mounting = Mounting(tight, np.zeros(4), 1.0)
    alone = fit_surface(outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    scratch, again = (
        fit_surface(
            outline,
            registration,
            config=SurfaceConfig(),
            sensors=SENSORS,
            seed=0,
            mounting=mounting,
            first=first,
        )
        for first in (None, alone)
    )
    assert again.shape == scratch.shape == TABLES[name].shape
    assert again.score == pytest.approx(scratch.score, abs=0.01)
    assert np.abs(signed_distance(again.outline, scratch.outline)).max() < 0.0002
    for key, figure in scratch.dimensions.items():
        assert figure.sigma is not None
        assert again.dimensions[key].value == pytest.approx(figure.value, abs=0.1 * figure.sigma)
        assert again.dimensions[key].sigma == pytest.approx(figure.sigma, rel=0.02)


def test_a_wrong_camera_height_is_admitted() -> None:
    """Depths half a percent off, as the floor leaves them open, stay within the stated sigmas."""
    table = TABLES["rectangle"]
    bench = replace(Bench(), scale_sigma=0.005)
    errors = []
    for seed in range(3):
        outline, registration = observe(table, bench, np.random.default_rng(seed))
        height, scale, tilt = 0.0038, 0.005, np.radians(0.1)
        covariance = np.diag([height, scale, tilt, tilt]) ** 2
        covariance[0, 1] = covariance[1, 0] = 0.95 * height * scale
        camera = TopBelief(
            covariance,
            view_tilt=0.001,
            view_lift=0.0005,
            lean=(0.0, 0.0),
            view_shift=0.0,
            is_held=False,
        )
        outline = replace(outline, camera=camera, height_sigma=height)
        surface = fit_surface(
            outline, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0
        )
        assert surface.height.sigma is not None
        assert 0.001 < surface.height.sigma < 0.0038
        for key, truth in table.dimensions.items():
            figure = surface.dimensions[key]
            assert figure.sigma is not None
            errors.append(abs(figure.value - truth) / figure.sigma)
    assert max(errors) < 3
    assert np.median(errors) < 1.96


def test_an_unseen_side_is_not_called_measured() -> None:
    """A rectangle without its far end: the length is a bound, the width still is measured."""
    table = box_table(1.2, 0.8, Pose2())
    surface = _fit(table, replace(Bench(), hidden=((-0.9, 0.9),), occluded=0.0), 1)
    assert surface.shape in ("rectangle", "parallelogram")
    assert surface.dimensions["length"].status == "unseen"
    assert surface.dimensions["width"].status == "measured"
    assert abs(surface.dimensions["width"].value - 0.8) < 0.005
    sigma = surface.dimensions["length"].sigma
    assert sigma is None or sigma > 0.01
    assert "accuracy.unseen_side" in {warning.code for warning in surface.warnings}
    assert "unseen" in {edge.status for edge in surface.edges}


def test_a_long_top_that_sags_keeps_its_length() -> None:
    """Ends that stand 2 mm above the mean level seem a centimetre farther out at a flat look."""
    table = box_table(2.5, 1.0, Pose2())
    outline, registration = observe(table, Bench(), np.random.default_rng(4))
    inside = np.mgrid[-1.24:1.25:0.02, -0.49:0.5:0.02].reshape(2, -1).T
    squared = np.sum(inside**2, axis=1)
    sag = -0.003
    views = []
    for view in outline.views:
        places = registration.map_from_base[view.index].apply(view.points)
        bulge = (squared.mean() - np.sum(places**2, axis=1)) / np.percentile(squared, 98)
        lever = view.points - view.camera_xy
        farther = (sag * bulge / view.drop)[:, None] * lever
        views.append(replace(view, points=view.points + farther))
    flat = TopBelief(
        np.diag([0.002, 0.002, 0.001, 0.001]) ** 2,
        view_tilt=0.001,
        view_lift=0.0005,
        lean=(0.0, 0.0),
        view_shift=0.0,
        is_held=False,
    )
    level, sagging = (
        fit_surface(
            replace(outline, views=each, camera=camera),
            registration,
            config=SurfaceConfig(),
            sensors=SENSORS,
            seed=0,
        ).dimensions["length"]
        for each, camera in (
            (outline.views, flat),
            (tuple(views), replace(flat, sag=(sag, 0.0003))),
        )
    )
    assert sagging.value == pytest.approx(level.value, abs=0.0015)
    assert sagging.sigma == pytest.approx(level.sigma, rel=0.05)


@pytest.mark.parametrize("name", ["rectangle", "circle", "L"])
def test_a_table_that_was_moved_half_way_is_doubted(name: str) -> None:
    """Half of the views see it 25 mm elsewhere: said, and the sigmas admit it; all alike: not."""
    table = TABLES[name]
    outline, registration = observe(table, Bench(), np.random.default_rng(2))
    step = np.array([0.02, 0.015])
    views = []
    for view in outline.views:
        shift = registration.map_from_base[view.index].rotation.T @ step
        late = view.index >= len(outline.views) // 2
        views.append(replace(view, points=view.points + shift) if late else view)
    kept, moved = (
        fit_surface(each, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
        for each in (outline, replace(outline, views=tuple(views)))
    )
    codes = [{warning.code for warning in surface.warnings} for surface in (kept, moved)]
    assert "accuracy.views_disagree" not in codes[0]
    assert "accuracy.views_disagree" in codes[1]
    for key, truth in table.dimensions.items():
        figure = moved.dimensions.get(key)
        if figure is not None and figure.sigma is not None:
            assert figure.sigma > 1.1 * (kept.dimensions[key].sigma or 0.0)
            assert abs(figure.value - truth) < 3 * figure.sigma


def test_strays_do_not_place_a_side_that_was_not_seen() -> None:
    """A few points beside the corners, 8 cm inside: the side stays where the last top was seen."""
    table = box_table(1.2, 0.8, Pose2())
    bench = replace(Bench(), hidden=((-0.9, 0.9),), occluded=0.0, free=False)
    random = np.random.default_rng(1)
    outline, registration = observe(table, bench, random)
    seen = np.mgrid[-0.59:0.6:0.02, -0.39:0.4:0.02].reshape(2, -1).T
    views = []
    for view in outline.views:
        points, normals = view.points.copy(), view.normals.copy()
        few = random.choice(np.flatnonzero(view.kind == EdgeKind.TABLE), 5, replace=False)
        across = random.choice([-1.0, 1.0], 5) * random.uniform(0.37, 0.4, 5)
        base = registration.map_from_base[view.index].inverse()
        points[few] = base.apply(np.column_stack([np.full(5, 0.52), across]))
        normals[few] = base.rotation @ [1.0, 0.0]
        views.append(replace(view, points=points, normals=normals, top=base.apply(seen)))
    surface = _fit_views(outline, registration, views)
    assert surface.shape == "rectangle"
    length = surface.dimensions["length"]
    assert (length.status, length.sigma) == ("unseen", None)
    assert 1.17 < length.value < 1.23
    assert "accuracy.votes_contradict" not in {warning.code for warning in surface.warnings}


@pytest.mark.parametrize(
    ("fraction", "length", "status"),
    [
        (0.07, 0.02, "unseen"),
        (0.20, 0.05, "unseen"),
        (0.07, 0.08, "inferred"),
        (0.03, 0.08, "unseen"),
        (1.0, 0.04, "measured"),
    ],
)
def test_points_beside_a_corner_show_no_side(fraction: float, length: float, status: str) -> None:
    """A side is inferred from six centimetres on; a short one that was seen whole is measured."""
    sight = Sight(fraction, fraction, length)
    assert own_statuses((sight,), SurfaceConfig()) == (status,)


def test_ends_that_are_nearly_half_circles_make_no_stadium() -> None:
    """A rectangle 0.6 m wide, its corners rounded at 0.28 m, keeps its straight ends of 4 cm."""
    surface = _fit(rounded(box_table(1.0, 0.6, POSE), 0.28), Bench(), 5)
    assert surface.shape == "rectangle"
    assert surface.corner_radius is not None
    assert abs(surface.corner_radius.value - 0.28) < 0.008


def test_a_half_circle_that_was_not_seen_is_not_assumed() -> None:
    """A stadium of which one end was seen is a rectangle that is open there."""
    table = stadium_table(1.6, 0.8, Pose2())
    surface = _fit(table, replace(Bench(), hidden=((-0.9, 0.9),), occluded=0.0), 1)
    assert surface.shape == "rectangle"
    assert surface.dimensions["length"].status == "unseen"
    assert surface.dimensions["width"].status == "measured"
    assert abs(surface.dimensions["width"].value - 0.8) < 0.005
    assert any(warning.code.startswith("accuracy.") for warning in surface.warnings)


def test_half_circles_tell_the_width_that_no_side_shows() -> None:
    """A stadium of which one straight side was not seen still is one, measured to 5 mm."""
    table = stadium_table(1.6, 0.8, Pose2())
    surface = _fit(table, replace(Bench(), hidden=((0.8, 2.3),), occluded=0.0), 1)
    assert surface.shape == "stadium"
    for name, truth in table.dimensions.items():
        assert surface.dimensions[name].status == "measured"
        assert abs(surface.dimensions[name].value - truth) < 0.005


def test_one_view_gives_a_result_with_a_warning() -> None:
    """A single view of a whole table is enough for its shape, and said to be little."""
    surface = _fit(TABLES["rectangle"], replace(Bench(), views=1, occluded=0.0), 4)
    assert surface.shape in ("rectangle", "parallelogram")
    assert "accuracy.few_views" in {warning.code for warning in surface.warnings}


def test_no_edge_points_are_an_error_that_says_so() -> None:
    """Nothing to fit ends in a sentence, not in an index error."""
    outline, registration = observe(TABLES["circle"], Bench(), np.random.default_rng(0))
    empty = replace(outline, views=())
    with pytest.raises(EstimationError, match="found 0 in 0 of 0 views"):
        fit_surface(empty, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)


def test_points_on_one_line_end_in_a_clear_error_or_doubts() -> None:
    """Collinear points have no area: an error, or a top that says it was not seen."""
    outline, registration = observe(
        TABLES["rectangle"], replace(Bench(), views=2), np.random.default_rng(0)
    )
    first = outline.views[0]
    kept = np.abs(first.normals[:, 0] + 1) < 0.2
    line = replace(first.only(kept), top=first.top[:0], free=first.free[:0])
    alone = replace(outline, views=(line,))
    try:
        surface = fit_surface(alone, registration, config=SurfaceConfig(), sensors=SENSORS, seed=0)
    except EstimationError as error:
        assert "edge" in str(error)
    else:
        assert surface.warnings


def test_results_repeat_bit_for_bit() -> None:
    """The same input gives the same figures."""
    first, second = (_fit(TABLES["square"], Bench(), 3) for _ in range(2))
    assert np.array_equal(first.outline, second.outline)
    assert np.array_equal(first.covariance, second.covariance)


@pytest.mark.slow
def test_shapes_are_rarely_confused_and_intervals_cover() -> None:
    """Over many draws: at most one confusion in fifty, 95 % intervals cover 90 to 100 %."""
    wrong, errors, covered = 0, [], []
    names = ("circle", "rectangle", "square", "parallelogram")
    for name in names:
        for seed in range(25):
            table = TABLES[name]
            surface = _fit(table, Bench(), 100 + seed)
            if surface.shape != table.shape:
                wrong += 1
                continue
            for key, truth in table.dimensions.items():
                figure = surface.dimensions[key]
                assert figure.sigma is not None
                covered.append(abs(figure.value - truth) < 1.96 * figure.sigma)
                if key != "angle":
                    errors.append(abs(figure.value - truth))
    assert wrong <= 2
    assert np.median(errors) < 0.001
    assert np.percentile(errors, 95) < 0.003
    assert 0.90 <= np.mean(covered) <= 1.0


STEREO = SensorsConfig(top_widening_px=1.5, top_widening_sigma_px=1.0)


def _widened(pixels: float, sigma: float) -> Mounting:
    """Return what legs tell whose silhouettes are so many pixels wider on each side."""
    return Mounting(np.zeros((4, 4)), np.zeros(4), 1.0, widening=(pixels, sigma))


@pytest.mark.parametrize(
    ("sensors", "mounting", "value", "sigma"),
    [
        (SensorsConfig(), None, 0.030, 0.0007),
        (SensorsConfig(), _widened(-0.1, 0.1), 0.0302, 0.0006),
        (SensorsConfig(), _widened(-1.0, 0.1), 0.032, 0.0014),
        (SensorsConfig(), _widened(2.0, 0.1), 0.026, 0.0025),
        (STEREO, None, 0.027, 0.0027),
        (STEREO, _widened(2.0, 0.1), 0.026, 0.0025),
    ],
)
def test_depth_that_widens_makes_the_side_face_higher(
    sensors: SensorsConfig, mounting: Mounting | None, value: float, sigma: float
) -> None:
    """What depth adds to the face, or takes from it, is undone as the legs or the kind tell it.

    Where it is much, a face may be widened otherwise than legs; where it is nothing, it may not.
    """
    outline, registration = observe(TABLES["rectangle"], Bench(), np.random.default_rng(5))
    outline = replace(outline, thickness=0.030, thickness_sigma=0.0005, thickness_per_px=0.002)
    surface = fit_surface(
        outline, registration, config=SurfaceConfig(), sensors=sensors, seed=0, mounting=mounting
    )
    assert surface.thickness is not None
    assert surface.thickness.sigma is not None
    assert surface.thickness.value == pytest.approx(value, abs=0.0003)
    assert surface.thickness.sigma == pytest.approx(sigma, abs=0.0002)
