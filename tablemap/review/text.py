"""The stages' results as markdown, for the viewer's text panes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from types import MappingProxyType

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.review import wording
from tablemap.review.markdown import MOST_ROWS, figure, links, metres, table, told
from tablemap.review.numbering import letter
from tablemap.stages.calibration import Calibration
from tablemap.stages.legs import Legs
from tablemap.stages.odometry import Odometry
from tablemap.stages.outline import EdgeKind, Outline
from tablemap.stages.registration import Pair, Registration, StopCheck
from tablemap.stages.segmentation import Segmentation, TableCandidate, TableRefused
from tablemap.stages.snapshots import Snapshots
from tablemap.stages.surface import Surface
from tablemap.words import counted

LEGEND = (
    "Sides are numbered; beside them lie their 95 % bands, in the middle that of the place, "
    "magnified as the summary says."
)
MENDED = (
    "Mended pixels were lost or wrong by themselves and took the depth round them; the depth image "
    "marks them."
)


def snapshots(result: Snapshots) -> str:
    """Return where the robot stood, and what became no snapshot."""
    rows = [
        (
            one.index,
            f"{one.map_from_base.x:z.2f}, {one.map_from_base.y:z.2f}",
            f"{np.degrees(one.map_from_base.yaw):z.0f}°",
            one.images,
        )
        for one in result.snapshots[:MOST_ROWS]
    ]
    aside = Counter((one.what, one.reason) for one in result.set_aside)
    return "\n".join(
        [
            f"## {counted(len(result.snapshots), 'snapshot')}",
            table(("snapshot", "x, y as localised (m)", "heading", "images"), rows),
            "",
            f"- {result.camera}",
            *[f"- {count} {what} set aside: {why}" for (what, why), count in aside.most_common(9)],
        ]
    )


def of_camera(warnings: Iterable[ProcessWarning]) -> list[ProcessWarning]:
    """Return what a recording's warnings say of the camera."""
    return [one for one in warnings if one.code.partition(".")[2] in _OF_CAMERA]


def of_motion(warnings: Iterable[ProcessWarning]) -> list[ProcessWarning]:
    """Return what a recording's warnings say of clocks, transforms and poses."""
    return [one for one in warnings if one.code.partition(".")[2] in _OF_MOTION]


_OF_CAMERA = {"calibrations_disagree", "calibration_flawed", "calibration", "depth_meaning"}
_OF_MOTION = {
    *("clock", "tf_conflict", "odometry_restart", "pose_topic", "no_pose"),
    *("localisation_gap", "laser_mounting"),
}


def calibration(result: Calibration, recorded: Iterable[ProcessWarning] = ()) -> str:
    """Return the camera's corrections, and what its ``recorded`` warnings say of it."""
    sigmas = np.sqrt(np.maximum(np.diag(result.covariance), 0.0))
    own = np.sqrt(np.mean(result.adjustment.own**2, axis=0))
    return "\n".join(
        [
            "## Camera, from the floor" + (" and the top" if result.sees_top else ""),
            *told([*of_camera(recorded), *result.warnings]),
            table(
                ("correction", "value"),
                [
                    ("roll", f"{np.degrees(result.roll):z.3f} ± {np.degrees(sigmas[0]):.3f}°"),
                    ("pitch", f"{np.degrees(result.pitch):z.3f} ± {np.degrees(sigmas[1]):.3f}°"),
                    ("depth scale", f"{result.depth_scale:.5f} ± {sigmas[2]:.5f}"),
                    ("height", f"{1000 * result.height_correction:z.1f} mm"),
                    ("depth bends", f"{100 * result.adjustment.size:.0f} % of what is usual"),
                    ("views' own tilt", f"{np.degrees(own[:2].max()):.2f}° rms"),
                    ("views' own height", f"{1000 * own[2]:.1f} mm rms"),
                    ("floor pixels", result.floor_pixels),
                    ("floor rms before", f"{1000 * result.floor_rms_before:.1f} mm"),
                    ("floor rms after", f"{1000 * result.floor_rms_after:.1f} mm"),
                ],
            ),
        ]
    )


def candidates(found: tuple[TableCandidate, ...]) -> str:
    """Return the candidate surfaces, and the reasons against them."""
    rows = [
        (
            f"{k}{' (chosen)' if one.chosen else ''}",
            f"{one.x:z.2f}, {one.y:z.2f}",
            f"{one.height:.3f}",
            f"{one.area:.2f}",
            len(one.views),
            f"{one.weight:.2f}",
        )
        for k, one in enumerate(found[:MOST_ROWS])
    ]
    return "\n".join(
        [
            table(("table", "x, y (m)", "height (m)", "m²", "views", "weight"), rows),
            "",
            *[
                f"- table {k} was not taken: {one.reason}"
                for k, one in enumerate(found[:MOST_ROWS])
                if one.reason and not one.chosen
            ],
        ]
    )


def segmentation(result: Segmentation, mended: Mapping[int, float] = MappingProxyType({})) -> str:
    """Return the candidate tables and the views' verdicts.

    ``mended`` are the shares of mended pixels, by view.
    """
    is_mended = any(mended.values())
    views = [
        (
            view.index,
            "yes" if view.sees_table else "no",
            view.top_pixels,
            "" if view.height is None else f"{view.height:.3f}",
            *([f"{100 * mended.get(view.index, 0.0):.1f} %"] if is_mended else []),
        )
        for view in result.views[:MOST_ROWS]
    ]
    return "\n".join(
        [
            "## Candidate tables",
            *told(result.warnings),
            f"The chosen top lies at {result.height:.3f} m as the views' planes have it. The "
            "summary has the model's height, which edges and depth scale have corrected.",
            "",
            links(
                chosen="segmentation/candidates/chosen",
                others="segmentation/candidates/others",
                labels="segmentation/labels",
                points="segmentation/points",
            ),
            "",
            candidates(result.candidates),
            "",
            table(("view", "sees it", "top pixels", "height (m)", *["mended"] * is_mended), views),
            "",
            *[f"{MENDED}\n"] * is_mended,
            *[
                f"- view {one.index}: {one.reason}"
                for one in result.views[:MOST_ROWS]
                if one.reason
            ],
        ]
    )


def refused(result: TableRefused, found: tuple[TableCandidate, ...]) -> str:
    """Return why a surface is no table, view by view, and the other candidates."""
    one = result.candidate
    numbers = [k for k, other in enumerate(found) if (other.x, other.y) == (one.x, one.y)]
    name = f"Surface {numbers[0]}" if numbers else "The surface"
    return "\n".join(
        [
            "## The surface gave no table",
            f"{name} at {one.x:z.2f}, {one.y:z.2f}, {one.height:.2f} m high; the labels are those "
            "of this surface.",
            "",
            *[
                f"- view {view.index}: {view.reason or 'shows it, but not enough of it'} "
                f"({view.top_pixels} pixels of it)"
                for view in result.views[:MOST_ROWS]
            ],
            "",
            candidates(found),
        ]
    )


def odometry(result: Odometry, recorded: Iterable[ProcessWarning] = ()) -> str:
    """Return the odometry's source and figures, and what ``recorded`` warnings say of motion."""
    spread = np.sqrt(np.diag(result.covariance_over(1.0)))
    return "\n".join(
        [
            f"## Odometry from {result.source}",
            *told([*of_motion(recorded), *result.warnings]),
            f"{result.scans_used} scans used, {result.scans_skipped} skipped. "
            f"Error over a metre: {1000 * max(spread[0], spread[1]):.1f} mm, "
            f"{np.degrees(spread[2]):.2f}°."
            + (f" The wheels bridge {len(result.gaps)} gaps." if len(result.gaps) else ""),
            "",
            "On the timeline `sensor_time` the scan moves, and with it the map that KISS-ICP had "
            "by then. The plots say how far each scan ended from where the prior had it, and the "
            "threshold (the kernel's scale) that it was registered with.",
        ]
    )


def pair_residual(result: Registration, pair: Pair) -> float:
    """Return the distance (metres) of a pair's measurement from the registered poses."""
    poses = result.map_from_base
    registered = poses[pair.target].inverse() @ poses[pair.source]
    left = registered.inverse() @ pair.target_from_source
    return float(np.hypot(left.x, left.y))


def worst_first(result: Registration) -> list[Pair]:
    """Return the dropped pairs, then the used ones, each from worst to best fit."""
    return sorted(result.pairs, key=lambda pair: (pair.used, -pair_residual(result, pair)))


def _checked(check: StopCheck) -> str:
    """Return one line: a line wraps where a table's cell is cut off."""
    named = asdict(check.statistics).items() if check.statistics is not None else ()
    figures = ", ".join(f"{name} {value:.3g}" for name, value in named if value is not None)
    said = [f"{'passed' if check.passed else 'failed'}", *check.reasons, figures]
    return f"- stop {check.index}: {'; '.join(one for one in said if one)}"


def registration(result: Registration) -> str:
    """Return the checks of the stops and the pairs, the dropped and the worst first."""
    checks = sorted(result.checks, key=lambda one: one.passed)[:MOST_ROWS]
    ordered = worst_first(result)
    pairs = [
        (
            f"{one.source} to {one.target}",
            one.kind,
            f"{1000 * pair_residual(result, one):.1f}",
            *(
                ("", "", "")  # the way between two stops is no alignment of clouds
                if one.kind == "odometry"
                else (f"{one.fitness:.2f}", f"{1000 * one.rmse:.1f}", one.inliers)
            ),
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
            *told(result.warnings),
            f"{sum(result.used)} of {counted(len(result.used), 'stop')} registered; systematic "
            f"sigma {1000 * result.systematic:.1f} mm. Pairs: {said or 'none'}. Lines, and the "
            "dots of the matrix, show how well the registered poses agree with the pairs; grey: "
            "dropped. The matrix has the stops on its diagonal, each with the mean of its pairs. "
            "*Off by* is how far the registered poses lie from what "
            "the pair measured, *rmse* how far the points of its two clouds lie from each other.",
            "",
            links(
                worst="registration/graph_worst",
                pairs_of_the_stop="registration/graph_at_stop",
                all_pairs="registration/graph_in_map",
                stops="registration/stops",
            ),
            "",
            table(("pair", "kind", "off by mm", "fitness", "rmse mm", "inliers", "result"), pairs),
            "",
            *[
                f"- {one.source} to {one.target} was dropped: {one.reason}"
                for one in ordered[:MOST_ROWS]
                if not one.used
            ],
            "",
            *[_checked(one) for one in checks],
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
            "## Edges by view",
            *told(result.warnings),
            f"They lie in the plane at {result.height:.3f} m: before the fit, which corrects it. "
            f"Thickness {thickness}. {LEGEND}",
            "",
            links(edges="outline/edges", seen_as_top="outline/top"),
            "",
            table(header, rows),
        ]
    )


def surface(result: Surface) -> str:
    """Return the candidates by score, and the sides by status."""
    names = wording.candidate_names(result.candidates)
    named = zip(names, result.candidates, strict=True)
    candidates = [
        (
            name + (" (chosen)" if name == names[0] else ""),
            f"{one.score:.3f}",
            f"{one.cost:.1f}",
            f"{100 * one.inlier_fraction:.0f} %",
            ", ".join(
                f"{key} {figure(key, size.value, None)}" for key, size in one.dimensions.items()
            ),
        )
        for name, one in sorted(named, key=lambda each: -each[1].score)
    ]
    sides = [
        (
            k,
            one.status,
            wording.seen(one.seen_fraction),
            wording.spread(one.sigma),
        )
        for k, one in enumerate(result.edges[:MOST_ROWS])
    ]
    return "\n".join(
        [
            f"## {result.shape.capitalize()}",
            *told(result.warnings),
            wording.residuals(result.residuals),
            "",
            links(
                chosen="surface/chosen",
                residuals="surface/residuals",
                candidates="surface/candidates",
            ),
            "",
            table(("shape", "weight", "cost", "inliers", "dimensions"), candidates),
            "",
            table(("side", "status", "seen", "sigma"), sides),
            "",
            LEGEND,
        ]
    )


def legs(result: Legs) -> str:
    """Return the legs and the rejected clusters."""
    columns = ("leg", "x, y (m)", "sigma", "size", "status", "stops and drives")
    found = [
        (
            f"{k} {one.shape}",
            f"{one.x:z.3f}, {one.y:z.3f}",
            wording.spread(one.position_sigma),
            wording.sizes(one.dimensions),
            one.status,
            one.views,
        )
        for k, one in enumerate(result.legs, start=1)
    ]
    rejected = [
        f"- {letter(k)}: at {one.x:z.2f}, {one.y:z.2f} ({len(one.points)} points): {one.reason}"
        for k, one in enumerate(result.rejected[:MOST_ROWS])
    ]
    return "\n".join(
        [
            f"## {counted(len(result.legs), 'leg')}",
            *told(result.warnings),
            *[f"{links(legs='legs/names', points='legs/evidence')}\n" for _ in found[:1]],
            table(columns, found) if found else "",
            "",
            f"## {counted(len(result.rejected), 'cluster')} set aside",
            *rejected,
        ]
    )
