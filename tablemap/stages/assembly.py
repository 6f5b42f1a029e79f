"""Assembly of the stages' results into a model with its verdict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from tablemap import model as m
from tablemap.errors import ProcessWarning, is_doubt
from tablemap.geometry import Floats, Pose2, wrap_angles
from tablemap.recording import Recording
from tablemap.stages.calibration import Calibration
from tablemap.stages.crosscheck import CrossCheck
from tablemap.stages.legs import Leg, Legs
from tablemap.stages.odometry import Odometry
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration
from tablemap.stages.segmentation import Segmentation
from tablemap.stages.snapshots import Snapshot, Snapshots
from tablemap.stages.surface import FittedFigure, Surface

_CREDIBLE_SIGMAS = 1.0  # of the registration, RMS over all corrections


@dataclass(frozen=True, eq=False)
class Findings:
    """The results of all stages about one table."""

    recording: Recording
    taken: Snapshots
    calibration: Calibration
    segmentation: Segmentation
    odometry: Odometry
    registration: Registration
    outline: Outline
    surface: Surface
    cross: CrossCheck
    legs: Legs


def assemble(found: Findings) -> m.TableModel:
    """Make the `TableModel` of all stages' results, as ``table.json`` will hold it.

    Its warnings are in the order of the stages.
    """
    poses = best_poses(found.registration, found.surface)
    snapshots = tuple(_snapshot(snapshot, found, poses) for snapshot in found.taken.snapshots)
    warnings = [
        *found.recording.warnings,
        *found.taken.warnings,
        *_set_aside(found, snapshots),
        *found.calibration.warnings,
        *with_legs(found.segmentation.warnings, found.legs.legs),
        *found.odometry.warnings,
        *found.registration.warnings,
        *found.outline.warnings,
        *found.surface.warnings,
        *found.cross.warnings,
        *found.legs.warnings,
    ]
    calibration = found.calibration
    model = m.TableModel(
        frame=found.recording.names.fixed,
        floor_z=calibration.floor_z,
        surface=_surface(found.surface),
        legs=tuple(_leg(leg) for leg in found.legs.legs),
        snapshots=snapshots,
        calibration=m.CalibrationEntry(
            roll=calibration.roll,
            pitch=calibration.pitch,
            depth_scale=calibration.depth_scale,
            sigma=_three(np.sqrt(np.diag(calibration.covariance))),
        ),
        verdict=judge(warnings, surface=found.surface, registration=found.registration),
        warnings=tuple(
            m.WarningEntry(code=w.code, stage=w.stage, message=w.message, stamp_ns=w.stamp_ns)
            for w in warnings
        ),
    )
    return model.as_written()


def with_legs(warnings: Sequence[ProcessWarning], legs: Sequence[Leg]) -> Iterator[ProcessWarning]:
    """Withdraw the doubt that a surface with a closed front is a table, if it has a table's legs.

    A cloth that hangs down looks like the front of a box, but a box has no legs.
    """
    stand = sum(leg.status == "measured" for leg in legs)
    for warning in warnings:
        if warning.code == "accuracy.hardly_table" and stand >= _LEGS_OF_A_TABLE:
            message = f"Below the top only a front was seen, as of a cloth; {stand} legs carry it."
            yield ProcessWarning("segmentation.cloth", "segmentation", message)
        else:
            yield warning


_LEGS_OF_A_TABLE = 4


def _set_aside(found: Findings, snapshots: tuple[m.SnapshotPose, ...]) -> Iterator[ProcessWarning]:
    """Warn how many items of each kind were not used, and why; the review shows each one."""
    images = [(each.reason, each.stamp_ns) for each in found.taken.set_aside]
    views = [(view.reason, view.stamp_ns) for view in snapshots if view.reason is not None]
    pairs = [(pair.reason or "", None) for pair in found.registration.pairs if not pair.used]
    things = [(each.reason, None) for each in found.legs.rejected]
    for code, noun, entries in (
        ("snapshots.set_aside", "image", images),
        ("snapshots.unused", "view", views),
        ("registration.pair_dropped", "pair", pairs),
        ("legs.set_aside", "thing", things),
    ):
        if entries:
            count = f"{len(entries)} {noun}s were" if len(entries) > 1 else f"1 {noun} was"
            reasons = list(dict.fromkeys(reason for reason, _ in entries))
            more = f"; and {len(reasons) - 3} more reasons" if len(reasons) > 3 else ""
            message = f"{count} not used: {'; '.join(reasons[:3])}{more}"
            yield ProcessWarning(code, code.partition(".")[0], message, entries[0][1])


def judge(
    warnings: list[ProcessWarning], *, surface: Surface, registration: Registration
) -> m.Verdict:
    """Decide whether the model can be trusted.

    It is ``failed`` if no side of the top was measured or no view was registered, and ``doubtful``
    if any warning doubts the figures.
    """
    doubts = [w.message for w in warnings if is_doubt(w.code)]
    nothing_measured = not any(edge.status == "measured" for edge in surface.edges)
    unregistered = not any(registration.used)
    if nothing_measured or unregistered:
        why = "no side of the top was measured" if nothing_measured else "no view was registered"
        return m.Verdict(level="failed", reasons=(why, *doubts))
    return m.Verdict(level="doubtful" if doubts else "good", reasons=tuple(doubts))


def _surface(surface: Surface) -> m.TableSurface:
    rows = [_three(row) for row in surface.covariance]
    return m.TableSurface(
        shape=surface.shape,
        pose=m.SurfacePose(
            x=surface.pose.x,
            y=surface.pose.y,
            yaw=surface.pose.yaw,
            covariance=(rows[0], rows[1], rows[2]),
        ),
        height=m.Figure(
            value=surface.height.value,
            sigma=surface.height.sigma,
            budget=surface.height.budget,
        ),
        thickness=None
        if surface.thickness is None
        else m.Figure(value=surface.thickness.value, sigma=surface.thickness.sigma),
        dimensions={name: _dimension(figure) for name, figure in surface.dimensions.items()},
        corner_radius=None if surface.corner_radius is None else _dimension(surface.corner_radius),
        outline=_points(surface.outline),
        edges=tuple(
            m.Edge(
                points=_points(edge.points),
                status=cast(m.Status, edge.status),
                sigma=edge.sigma,
                seen_fraction=edge.seen_fraction,
            )
            for edge in surface.edges
        ),
        score=surface.score,
        alternatives=tuple(
            m.Alternative(shape=other.shape, score=other.score)
            for other in surface.candidates
            if other.shape != surface.shape
        ),
        beside=None if surface.beside is None else _points(surface.beside),
    )


def _points(places: Floats) -> tuple[m.Point, ...]:
    return tuple((float(x), float(y)) for x, y in places)


def _dimension(figure: FittedFigure) -> m.Dimension:
    return m.Dimension(
        value=figure.value,
        sigma=figure.sigma,
        status=cast(m.Status, figure.status),
        budget=figure.budget,
    )


def _leg(leg: Leg) -> m.TableLeg:
    return m.TableLeg(
        shape=leg.shape,
        x=leg.x,
        y=leg.y,
        yaw=leg.yaw,
        status=leg.status,
        position_sigma=leg.position_sigma,
        dimensions={name: _dimension(figure) for name, figure in leg.dimensions.items()},
    )


def best_poses(registration: Registration, surface: Surface) -> dict[int, Pose2]:
    """Return each snapshot's pose: by the laser, or without one as corrected by the fit of the top.

    With a laser, corrections by the edges would mostly add the depth's own error. Without one,
    corrections far beyond the registration's covariance compensate another error (a focal length, a
    depth scale, a bent rim). They help the shape, but do not show where the base was: then the
    registered poses stand.
    """
    registered = dict(enumerate(registration.map_from_base))
    if registration.source == "laser":
        return registered
    corrected = {i: pose for i, pose in surface.map_from_base.items() if i in registered}
    sigma = np.sqrt(np.maximum(np.diag(registration.covariance), 0.0)).reshape(-1, 3)
    steps = np.array(
        [pose.as_array() - registered[i].as_array() for i, pose in corrected.items()]
    ).reshape(-1, 3)
    steps[:, 2] = wrap_angles(steps[:, 2])
    ratios = steps / np.maximum(sigma[list(corrected)], 1e-6)
    if len(ratios) and float(np.sqrt(np.mean(ratios**2))) > _CREDIBLE_SIGMAS:
        return registered
    return {**registered, **corrected}


def _snapshot(snapshot: Snapshot, found: Findings, poses: dict[int, Pose2]) -> m.SnapshotPose:
    i, registration = snapshot.index, found.registration
    view, check = (
        found.segmentation.views[i],
        registration.checks[i] if registration.checks else None,
    )
    pose = poses[i]
    variances = np.diag(registration.covariance)[3 * i : 3 * i + 3]
    middle = np.mean([each.translation for each in registration.map_from_base], axis=0)
    stretch = registration.stretch_sigma * float(np.linalg.norm(pose.translation - middle))
    systematic = found.cross.pose_sigma**2 + stretch**2 / 2
    reason = view.reason if not view.sees_table else None
    if reason is None and not registration.used[i]:
        reason = "; ".join(check.reasons) if check and check.reasons else "it was not registered"
    return m.SnapshotPose(
        stamp_ns=snapshot.stamp_ns,
        map_from_base=m.PlanarPose(x=pose.x, y=pose.y, yaw=pose.yaw),
        sigma=m.PoseSigma(
            xy=float(np.sqrt((variances[0] + variances[1]) / 2 + systematic)),
            yaw=float(np.sqrt(variances[2])),
        ),
        used=reason is None,
        reason=reason,
    )


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, yaw = (float(value) for value in values)
    return x, y, yaw
