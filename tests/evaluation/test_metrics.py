"""The ruler measures what is known beforehand."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from tablemap import model as m
from tablemap.evaluation.aggregate import RunScore, summarise
from tablemap.evaluation.listing import figures_csv
from tablemap.evaluation.metrics import score
from tablemap.evaluation.score import Error, Score, ViewScore
from tablemap.evaluation.suite import Evaluation
from tablemap.evaluation.tables import score_rows
from tablemap.evaluation.truth import Truth
from tablemap.geometry import Pose2
from tests.making.models import rectangle_model


def truth_of(model: m.TableModel, **sensor: float) -> Truth:
    """Return the truth that a model is exactly right about."""
    surface = model.surface
    return Truth.read(
        {
            "surface": {
                "shape": surface.shape,
                "pose": surface.pose.fields(),
                "height": surface.height.value,
                "dimensions": {name: d.value for name, d in surface.dimensions.items()},
                "outline": surface.outline,
            },
            "legs": [
                {
                    "shape": leg.shape,
                    "x": leg.x,
                    "y": leg.y,
                    "dimensions": {name: d.value for name, d in leg.dimensions.items()},
                }
                for leg in model.legs
            ],
            "snapshots": [
                {"stamp_ns": s.stamp_ns, "map_from_base": s.map_from_base.fields()}
                for s in model.snapshots
            ],
            "sensor": sensor or None,
        }
    )


def moved(model: m.TableModel, motion: Pose2) -> m.TableModel:
    """Move everything that a model says by one motion of the map."""
    pose = motion @ Pose2(model.surface.pose.x, model.surface.pose.y, model.surface.pose.yaw)
    place = structs.replace(model.surface.pose, x=pose.x, y=pose.y, yaw=pose.yaw)
    outline = tuple((float(x), float(y)) for x, y in motion.apply(model.surface.outline))
    legs = []
    for leg in model.legs:
        x, y = motion.apply([leg.x, leg.y])
        legs.append(structs.replace(leg, x=float(x), y=float(y)))
    snapshots = []
    for snapshot in model.snapshots:
        at = snapshot.map_from_base
        p = motion @ Pose2(at.x, at.y, at.yaw)
        there = m.PlanarPose(x=p.x, y=p.y, yaw=p.yaw)
        snapshots.append(structs.replace(snapshot, map_from_base=there))
    surface = structs.replace(model.surface, pose=place, outline=outline)
    return structs.replace(model, surface=surface, legs=tuple(legs), snapshots=tuple(snapshots))


def with_surface(model: m.TableModel, **changes: object) -> m.TableModel:
    """Return a model with another surface."""
    return structs.replace(model, surface=structs.replace(model.surface, **changes))


def run_of(result: Score, method: str = "tablemap") -> RunScore:
    """Return a finished run with a score."""
    return RunScore("made", 0, method, result, None, {"surface": 1.0})


def test_a_model_that_is_the_truth_has_no_error() -> None:
    """Every figure is nought, and nothing is silent or alarming."""
    model = rectangle_model()
    result = score(model, truth_of(model))
    lengths = [*result.dimensions, result.height, *result.poses, *result.legs.places]
    assert max(abs(figure.error) for figure in lengths) < 5e-6
    assert result.outline == pytest.approx(0, abs=5e-6)
    assert result.iou == pytest.approx(1, abs=1e-5)
    assert not result.silent_failure
    assert not result.false_alarm


def test_the_localisation_s_free_offset_does_not_count() -> None:
    """The whole model elsewhere in the map is as right as before."""
    model = rectangle_model()
    result = score(moved(model, Pose2(3.0, -2.0, 0.7)), truth_of(model))
    assert max(pose.error for pose in result.poses) < 5e-6
    assert max(result.headings) < 5e-6
    assert result.outline == pytest.approx(0, abs=5e-6)
    assert max(place.error for place in result.legs.places) < 5e-6


def test_a_top_shifted_by_3_mm_is_3_mm_off() -> None:
    """The outline moves against the snapshots; the dimensions stay."""
    model = rectangle_model(yaw=0.0)
    outline = tuple((x + 0.003, y) for x, y in model.surface.outline)
    result = score(with_surface(model, outline=outline), truth_of(model))
    assert result.outline == pytest.approx(0.003, abs=1e-6)
    assert result.dimensions[0].error == pytest.approx(0, abs=5e-6)


def test_one_snapshot_3_mm_off_shows_as_such() -> None:
    """Less what the best fit of all six takes up."""
    model = rectangle_model()
    snapshots = list(model.snapshots)
    at = snapshots[2].map_from_base
    shifted = m.PlanarPose(x=at.x + 0.003, y=at.y, yaw=at.yaw)
    snapshots[2] = structs.replace(snapshots[2], map_from_base=shifted)
    result = score(structs.replace(model, snapshots=tuple(snapshots)), truth_of(model))
    assert 0.0015 < max(pose.error for pose in result.poses) < 0.003


def test_dimensions_are_signed_and_the_sensor_s_share_is_taken_off_the_excess() -> None:
    """A scale error of 2 permil explains 2.4 mm of 1.2 m, and no more."""
    model = rectangle_model(length=1.205, width=0.800)
    truth = truth_of(rectangle_model(length=1.2, width=0.8), depth_scale=1.002)
    length, width = score(model, truth).dimensions
    assert length.error == pytest.approx(0.005)
    assert length.excess == pytest.approx(0.005 - 0.002 * 1.2)
    assert width.excess == 0


def test_a_swapped_shape_is_counted_and_compared_by_its_extents() -> None:
    """An ellipse for a rectangle has no dimensions in common with it."""
    model = rectangle_model()
    swapped = with_surface(
        model,
        shape="ellipse",
        dimensions={
            "major": m.Dimension(value=1.3, sigma=0.01, status="measured"),
            "minor": m.Dimension(value=0.9, sigma=0.01, status="measured"),
        },
    )
    result = score(swapped, truth_of(model))
    figures = summarise([run_of(result)])
    assert figures["shape_accuracy"] == 0
    assert figures["shapes"] == {"rectangle": {"ellipse": 1}}
    assert result.dimensions[0].error == pytest.approx(0, abs=1e-6)


def test_a_mirrored_parallelogram_is_not_right() -> None:
    """Its sides agree, its angle is the supplement."""
    figures = {
        "length": m.Dimension(value=1.2, sigma=0.001, status="measured"),
        "width": m.Dimension(value=0.8, sigma=0.001, status="measured"),
        "angle": m.Dimension(value=np.radians(80), sigma=0.001, status="measured"),
    }
    model = with_surface(rectangle_model(), shape="parallelogram", dimensions=figures)
    mirrored = {**figures, "angle": structs.replace(figures["angle"], value=np.radians(100))}
    result = score(with_surface(model, dimensions=mirrored), truth_of(model))
    assert np.degrees(result.angle.error) == pytest.approx(20)
    assert result.dimensions[0].error == pytest.approx(0)


def test_a_rectangle_s_angle_is_right_by_its_name() -> None:
    """And a parallelogram's that should have been one is measured against a right angle."""
    model = rectangle_model()
    assert score(model, truth_of(model)).angle.error == 0
    figures = {
        **model.surface.dimensions,
        "angle": m.Dimension(value=np.radians(91), sigma=None, status="measured"),
    }
    sheared = with_surface(model, shape="parallelogram", dimensions=figures)
    assert np.degrees(score(sheared, truth_of(model)).angle.error) == pytest.approx(1)


def test_a_shape_s_weight_is_that_of_its_better_fit() -> None:
    """A rectangle is there twice: with sharp corners and with rounded ones."""
    both = tuple(m.Alternative(shape="rectangle", score=weight) for weight in (0.05, 0.0))
    model = with_surface(rectangle_model(), shape="ellipse", score=0.95, alternatives=both)
    assert score(model, truth_of(model)).weights == {"ellipse": 0.95, "rectangle": 0.05}


def test_the_thickness_is_compared_where_both_know_it() -> None:
    """A top that is 4 mm too thick at a sigma of 1 mm is off, and lies outside its interval."""
    model = rectangle_model()
    truth = truth_of(model)
    slab = structs.replace(truth.surface, thickness=0.025)
    thick = with_surface(model, thickness=m.Figure(value=0.029, sigma=0.001))
    error = score(thick, structs.replace(truth, surface=slab)).thickness
    assert error is not None
    assert error.error == pytest.approx(0.004)
    assert error.covered is False
    assert score(thick, truth).thickness is None
    assert score(model, structs.replace(truth, surface=slab)).thickness is None


def test_the_place_in_the_map_keeps_the_localisation_s_offset() -> None:
    """The map's own x, y and yaw count; half a turn of a rectangle is no error."""
    model = rectangle_model()
    shifted = moved(model, Pose2(0.03, -0.02, np.pi + 0.01))
    by_name = {error.name: error for error in score(shifted, truth_of(model)).place}
    assert set(by_name) == {"place x", "place y", "place yaw"}
    assert by_name["place yaw"].error == pytest.approx(0.01)
    own, there = model.surface.pose, shifted.surface.pose
    assert by_name["place x"].error == pytest.approx(there.x - own.x)
    assert by_name["place y"].error == pytest.approx(there.y - own.y)
    assert by_name["place x"].sigma == pytest.approx(np.sqrt(there.covariance[0][0]))


def test_legs_are_found_missed_and_invented() -> None:
    """Three found of four, and one that stands nowhere near any."""
    truth = truth_of(rectangle_model())
    model = rectangle_model(legs=3)
    stray = structs.replace(model.legs[0], x=model.surface.pose.x, y=model.surface.pose.y)
    result = score(structs.replace(model, legs=(*model.legs, stray)), truth)
    assert (result.legs.found, result.legs.missed, result.legs.invented) == (3, 1, 1)
    assert max(place.error for place in result.legs.places) < 5e-6


def test_legs_are_measured_in_the_top_s_own_frame() -> None:
    """Snapshots turned about the table by half a degree misplace no leg; a turned top does."""
    model = rectangle_model()
    truth = truth_of(model)
    place = model.surface.pose
    about = Pose2(place.x, place.y, 0.0)
    motion = about @ Pose2(0.0, 0.0, np.radians(0.5)) @ about.inverse()
    snapshots = moved(model, motion).snapshots
    result = score(structs.replace(model, snapshots=snapshots), truth)
    assert np.degrees(max(result.headings)) < 1e-3
    assert max(place.error for place in result.legs.places) < 5e-6
    turned = with_surface(model, pose=structs.replace(place, yaw=place.yaw + 0.01))
    apart = [np.hypot(leg.x - place.x, leg.y - place.y) for leg in model.legs]
    worst = max(place.error for place in score(turned, truth).legs.places)
    assert worst == pytest.approx(0.01 * max(apart), rel=0.01)


def test_coverage_is_that_of_the_sigmas() -> None:
    """Right sigmas cover 95 %; sigmas half too small cover 67 %."""
    rng = np.random.default_rng(5)
    truth = truth_of(rectangle_model(legs=0, length=2.0, width=0.5))

    def coverage(stated: float) -> float:
        runs = []
        for _ in range(400):
            length, width, height = rng.normal([2.0, 0.5, 0.743], 0.004)
            model = rectangle_model(legs=0, length=length, width=width, height=height, sigma=stated)
            runs.append(run_of(score(model, truth)))
        by = summarise(runs)["coverage_95_by"]
        return float(np.mean([by["dimensions"], by["heights"]]))

    assert coverage(0.004) == pytest.approx(0.95, abs=0.02)
    assert coverage(0.002) == pytest.approx(0.673, abs=0.04)


def test_silence_is_a_failure_only_when_nothing_admits_the_error() -> None:
    """A warning or a sigma that fits the error breaks it."""
    truth = truth_of(rectangle_model())
    wrong = rectangle_model(length=1.187 + 0.03)
    assert score(wrong, truth).silent_failure
    assert not score(rectangle_model(length=1.187 + 0.03, sigma=0.02), truth).silent_failure
    doubt = m.WarningEntry(code="accuracy.few_views", stage="surface", message="", stamp_ns=None)
    assert not score(structs.replace(wrong, warnings=(doubt,)), truth).silent_failure


def test_a_warning_about_a_right_model_is_a_false_alarm() -> None:
    """Unless a figure is more than 8 mm off."""
    truth = truth_of(rectangle_model())
    doubt = m.WarningEntry(code="accuracy.few_views", stage="surface", message="", stamp_ns=None)
    good = structs.replace(rectangle_model(), warnings=(doubt,))
    assert score(good, truth).false_alarm
    off = structs.replace(rectangle_model(length=1.187 + 0.009), warnings=(doubt,))
    assert not score(off, truth).false_alarm


def test_what_is_not_measured_is_counted_apart() -> None:
    """A bound is no error."""
    model = rectangle_model()
    bound = m.Dimension(value=2.0, sigma=None, status="unseen")
    dimensions = {**model.surface.dimensions, "length": bound}
    result = score(with_surface(model, dimensions=dimensions), truth_of(model))
    figures = summarise([run_of(result)])
    assert figures["unmeasured"] == 1
    assert figures["dimension_mm"]["worst"] == pytest.approx(0, abs=1e-6)
    assert not result.silent_failure


def test_percentiles_are_of_absolute_values_and_failed_runs_are_counted() -> None:
    """Errors of -1 to -100 mm have a median of 50.5."""
    truth = truth_of(rectangle_model(legs=0))
    runs = [
        run_of(score(rectangle_model(legs=0, height=0.743 - i / 1000), truth))
        for i in range(1, 101)
    ]
    runs.append(RunScore("made", 1, "tablemap", None, "no table", {}))
    figures = summarise(runs)
    assert figures["height_mm"]["median"] == pytest.approx(50.5)
    assert figures["height_mm"]["worst"] == pytest.approx(100)
    assert (figures["runs"], figures["failed"]) == (101, 1)


def test_an_unknown_truth_leaves_the_figure_open() -> None:
    """What is null is not scored."""
    model = rectangle_model()
    truth = truth_of(model)
    surface = structs.replace(truth.surface, pose=None, outline=None, height=None)
    part = structs.replace(truth, surface=surface, legs=None, snapshots=None)
    result = score(model, part)
    assert (result.height, result.outline, result.iou, result.legs, result.poses) == (
        None,
        None,
        None,
        None,
        (),
    )


def test_the_report_s_one_word_for_quadrilaterals_counts_as_right() -> None:
    """For its own method alone."""
    model = rectangle_model()
    result = replace(score(model, truth_of(model)), shape="parallelogram")
    assert run_of(result, "report").right_shape
    assert not run_of(result).right_shape


def test_outline_distance_grows_with_the_shift() -> None:
    """A ruler without dead bands."""
    model = rectangle_model()
    truth = truth_of(model)
    distances = []
    for shift in (0.001, 0.002, 0.004):
        outline = tuple((x + shift, y) for x, y in model.surface.outline)
        distances.append(score(with_surface(model, outline=outline), truth).outline)
    assert all(b > 1.5 * a for a, b in pairwise(distances))


def seeing(model: m.TableModel, shares: list[float | None]) -> Truth:
    """Return a model's truth with the share of the top that each of its rests shows."""
    truth = truth_of(model)
    assert truth.snapshots
    snapshots = tuple(
        structs.replace(known, sees_top=share, rest=i)
        for i, (known, share) in enumerate(zip(truth.snapshots, shares, strict=True))
    )
    return structs.replace(truth, snapshots=snapshots)


@pytest.mark.parametrize(
    ("error", "sigma", "expected"),
    [
        (0.0, 0.002, 2 * 1.96 * 0.002),  # the width alone
        (-0.0039, 0.002, 2 * 1.96 * 0.002),  # still inside
        (0.005, 0.002, 2 * 1.96 * 0.002 + 40 * (0.005 - 1.96 * 0.002)),
        (-0.005, 0.002, 2 * 1.96 * 0.002 + 40 * (0.005 - 1.96 * 0.002)),
        (0.005, 0.0, 40 * 0.005),
    ],
)
def test_an_interval_scores_its_width_and_what_it_misses(
    error: float, sigma: float, expected: float
) -> None:
    """Equation 43 of Gneiting and Raftery for 95 %: each millimetre outside counts forty."""
    assert Error("length", error, sigma, 1.2, 0.0).interval_score == pytest.approx(expected)


def test_without_a_sigma_there_is_no_interval() -> None:
    """Neither width nor score are made up."""
    figure = Error("length", 0.003, None, 1.2, 0.0)
    assert (figure.interval_score, figure.interval_width, figure.covered) == (None, None, None)


def test_the_right_sigma_scores_best() -> None:
    """Of sigmas from a quarter to four times the spread, the true one has the least score."""
    errors = np.random.default_rng(3).normal(0, 0.002, 4000)
    means = {
        factor: np.mean(
            [Error("length", e, 0.002 * factor, 1.2, 0.0).interval_score for e in errors.tolist()]
        )
        for factor in (0.25, 0.5, 1.0, 2.0, 4.0)
    }
    assert min(means, key=lambda factor: means[factor]) == 1.0
    assert means[4.0] > 2 * means[1.0]


def test_scores_and_widths_are_averaged_over_dimensions_and_heights() -> None:
    """Two sides and a height of 2 mm each, one side 10 mm off."""
    model = rectangle_model(length=1.187 + 0.010, sigma=0.002)
    figures = summarise([run_of(score(model, truth_of(rectangle_model())))])
    width = 2 * 1.96 * 2.0
    missed = 40 * (10 - 1.96 * 2.0)
    assert figures["interval_width_mm"] == pytest.approx(width, abs=1e-3)
    assert figures["interval_score_mm"] == pytest.approx(width + missed / 3, abs=1e-3)
    assert figures["interval_score_by"]["dimensions_mm"] == pytest.approx(
        width + missed / 2, abs=1e-3
    )
    assert figures["interval_score_by"]["heights_mm"] == pytest.approx(width, abs=1e-3)
    assert figures["interval_width_by"]["leg_places_mm"] == pytest.approx(2 * 2.448 * 3.0, abs=1e-3)


def test_views_count_where_they_truly_see_the_top() -> None:
    """Five of six see it; of those one was not used, and that the sixth was used is no merit."""
    model = rectangle_model()
    snapshots = list(model.snapshots)
    snapshots[1] = structs.replace(snapshots[1], used=False, reason="no surface")
    model = structs.replace(model, snapshots=tuple(snapshots))
    result = score(model, seeing(model, [0.9, 0.8, 0.1, 0.3, 1.0, 0.02]))
    assert result.views == ViewScore(5, 4)
    figures = summarise([run_of(result), run_of(result)])
    assert figures["views"] == {"seeing": 10, "used": 8, "share": 0.8}
    assert score(model, truth_of(model)).views is None


def test_a_view_that_the_model_does_not_list_is_lost_too() -> None:
    """And two images of one rest are one view."""
    model = rectangle_model()
    truth = seeing(model, [0.9] * 6)
    assert truth.snapshots
    again = structs.replace(truth.snapshots[0], stamp_ns=truth.snapshots[0].stamp_ns + 10**8)
    truth = structs.replace(truth, snapshots=(*truth.snapshots, again))
    cut = structs.replace(model, snapshots=model.snapshots[2:])
    assert score(model, truth).views == ViewScore(6, 6)
    assert score(cut, truth).views == ViewScore(6, 4)


def test_all_suites_have_figures_of_their_own() -> None:
    """A scenario of two suites counts in both; one suite alone is its own overall."""
    model = rectangle_model()
    result = score(model, truth_of(model))
    runs = tuple(
        RunScore(name, 0, "tablemap", result, None, {"surface": 1.0})
        for name in ("circle", "desk", "stool", "bent_rectangle")
    )
    figures: Any = Evaluation("all", (0,), runs).figures()
    suites = figures["methods"]["tablemap"]["suites"]
    assert {name: group["runs"] for name, group in suites.items()} == {
        "report": 2,
        "hard": 2,
        "real_sensors": 1,
    }
    assert all("coverage_95" in group for group in suites.values())
    names = [row[0] for row in score_rows(figures)]
    assert names[5:] == ["**report**", "**hard**", "**real_sensors**", "**overall**"]
    alone: Any = Evaluation("report", (0,), runs[:2]).figures()
    assert [row[0] for row in score_rows(alone)][3:] == ["**overall**"]


def test_tables_show_score_width_and_views() -> None:
    """A column each, a dash where nothing is known."""
    model = rectangle_model(legs=0)
    with_views = run_of(score(model, seeing(model, [0.5] * 6)))
    failed = RunScore("lost", 0, "tablemap", None, "no table", {})
    figures: Any = Evaluation("made", (0,), (with_views, failed)).figures()
    header, made, lost, _ = score_rows(figures)
    columns = [header.index(name) for name in ("interval score mm", "interval width mm")]
    assert [made[i] for i in columns] == ["7.8", "7.8"]
    assert made[header.index("views used")] == "6/6"
    assert [lost[i] for i in (*columns, header.index("views used"))] == ["-", "-", "-"]


def test_every_figure_is_a_line_of_csv() -> None:
    """With its truth, error, sigma, and what the interval is worth."""
    model = rectangle_model(legs=1, length=1.187 + 0.010)
    bound = m.Dimension(value=0.9, sigma=None, status="unseen")
    model = with_surface(model, dimensions={**model.surface.dimensions, "width": bound})
    failed = RunScore("lost", 1, "tablemap", None, "no table", {})
    runs = [run_of(score(model, truth_of(rectangle_model(legs=1)))), failed]
    rows = list(csv.DictReader(io.StringIO(figures_csv(runs))))
    assert [row["figure"] for row in rows] == [
        "length",
        "width",
        "angle",
        "height",
        "place x",
        "place y",
        "place yaw",
        "leg 0 place",
        "leg 0 size",
    ]
    length, width = rows[:2]
    assert (length["scenario"], length["seed"], length["method"]) == ("made", "0", "tablemap")
    assert float(length["truth"]) == pytest.approx(1.187)
    assert float(length["error"]) == pytest.approx(0.010)
    assert float(length["interval_width"]) == pytest.approx(2 * 1.96 * 0.002, abs=1e-6)
    assert length["covered"] == "false"
    assert (width["status"], width["sigma"], width["covered"]) == ("unseen", "", "")
