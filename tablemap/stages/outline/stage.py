"""Find the edges of the top in every view and place them on its plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import OutlineConfig, SensorsConfig
from tablemap.errors import EstimationError, ProcessWarning
from tablemap.stages.calibration import Calibration
from tablemap.stages.outline.contour import Contour, place_on_plane, trace
from tablemap.stages.outline.occupancy import Occupancy, classify, occupancy
from tablemap.stages.outline.plane import ViewPlane, fit_plane, joint_height
from tablemap.stages.outline.result import EdgeKind, Outline, ViewEdges
from tablemap.stages.outline.shadows import find_shadow
from tablemap.stages.outline.thickness import FaceEnds, face_ends, joint_rim, joint_thickness
from tablemap.stages.outline.votes import vote
from tablemap.stages.segmentation import Segmentation, ViewSegmentation
from tablemap.stages.snapshots import Snapshot
from tablemap.words import counted


@dataclass(frozen=True, eq=False)
class _TracedView:
    """One view whose contour is traced but not yet placed on the plane."""

    snapshot: Snapshot
    plane: ViewPlane
    seen: Occupancy
    contour: Contour


def find_edges(
    snapshots: tuple[Snapshot, ...],
    segmentation: Segmentation,
    *,
    config: OutlineConfig,
    sensors: SensorsConfig,
    calibration: Calibration | None = None,
) -> Outline:
    """Find sub-pixel edge points of the top in every used view, with the cause of each.

    ``snapshots`` are the calibrated ones. The covariance of ``calibration``, if given, adds to the
    height's sigma. The edges stay in each view's base frame: they need no registration.

    Raises `EstimationError` if no view shows enough of the top, or if something higher runs along
    its whole rim.
    """
    by_index = {snapshot.index: snapshot for snapshot in snapshots}
    used = [view for view in segmentation.views if view.sees_table and view.index in by_index]
    warnings: list[ProcessWarning] = []

    own: dict[int, ViewPlane] = {}
    for view in used:
        plane = fit_plane(by_index[view.index], view, config=config, sensors=sensors)
        if plane is None:
            warnings.append(_set_aside(by_index[view.index], "shows too little of the top"))
        else:
            own[view.index] = plane
    if not own:
        raise EstimationError(
            f"no edges of the table top: none of {counted(len(used), 'view')} of it shows enough "
            "of the top; record it from nearer, or with the camera tilted further down"
        )
    height, height_sigma, scatter = joint_height(
        own, segmentation.height, segmentation.height_sigma
    )
    camera = None
    if calibration is not None:
        camera = calibration.top_belief(height, sensors.surface_depth_sigma)
    # The calibration takes a part of what a top was raised for a lift of the camera.
    unlifted = own
    if calibration is not None and camera is not None and not camera.is_held:
        lifts = calibration.lifts
        unlifted = {i: replace(plane, height=plane.height - lifts[i]) for i, plane in own.items()}
    *_, apart = joint_height(unlifted, segmentation.height, segmentation.height_sigma)
    if len(own) > 2 and apart > _UNLIKE:
        warnings.append(_at_other_heights(unlifted, apart))
        height_sigma = float(np.hypot(height_sigma, apart))
    # Many views that saw the top at another height were left out.
    height_sigma = float(np.hypot(height_sigma, segmentation.height_apart))

    lift = 0.0 if camera is None else camera.view_lift
    if camera is not None:
        height_sigma = float(np.sqrt(height_sigma**2 + camera.covariance[0, 0]))
    seen = []
    for view in used:
        if view.index not in own:
            continue
        plane = _shrunk(own[view.index], height, scatter)
        classes = classify(
            by_index[view.index],
            view.labels,
            plane,
            config=config,
            widens=sensors.top_widening_px > 0,
        )
        if classes is not None:
            seen.append((by_index[view.index], plane, classes))
    shadow = find_shadow([classes.gaps for *_, classes in seen], sensors.projector_baseline)
    traced: list[_TracedView] = []
    for snapshot, plane, classes in seen:
        occupied = occupancy(classes, shadow, config=config)
        contour = trace(occupied, snapshot, config=config)
        traced.append(_TracedView(snapshot, plane, occupied, contour))

    faces = _faces(traced, height, config, sensors)
    rounding, lowered = _rounding_sigma(traced)
    face_depth = float(np.hypot(sensors.surface_depth_sigma, lowered))
    thickness = joint_thickness(faces, face_depth, config=config)
    blur = _crease_blur(traced, sensors)
    apart = float(np.sqrt(sensors.surface_depth_sigma**2 + rounding**2 + blur**2))
    rim = None if thickness is None else joint_rim(faces, apart)
    labels = {view.index: view.labels for view in used}
    views: list[ViewEdges] = []
    for item in traced:
        placed = place_on_plane(
            item.seen,
            item.contour,
            item.snapshot,
            plane=item.plane,
            level=height,
            thickness=None if thickness is None else thickness.value,
            rim=0.0 if rim is None or rim[0] < 3 * rim[1] else rim[0],
            config=config,
            edge_sigma_px=sensors.edge_sigma_px,
        )
        top, free = vote(item.seen, item.snapshot, labels[item.snapshot.index], config=config)
        edges = ViewEdges(
            index=item.snapshot.index,
            points=placed.points,
            normals=placed.normals,
            sigma=placed.sigma,
            kind=item.contour.kind,
            is_near=placed.is_near,
            widening=placed.widening,
            hole=placed.hole,
            metres_per_px=placed.metres_per_px,
            pixels=item.contour.place + np.array(item.seen.origin[::-1], dtype=np.float64),
            camera_xy=item.snapshot.base_from_camera[:2, 3].copy(),
            drop=item.plane.drop(item.snapshot.base_from_camera),
            axis=item.snapshot.base_from_camera[:3, 2].copy(),
            top=top,
            free=free,
            scale_sigma=float(np.hypot(scatter, lift))
            / item.plane.drop(item.snapshot.base_from_camera),
        )
        views.append(edges)
        if not np.any(edges.kind == EdgeKind.TABLE):
            warnings.append(_set_aside(item.snapshot, "shows no edge of the top"))
    _check_rim(views)
    return Outline(
        views=tuple(views),
        height=height,
        height_sigma=height_sigma,
        height_by_view={index: plane.height for index, plane in unlifted.items()},
        thickness=None if thickness is None else thickness.value,
        thickness_sigma=None if thickness is None else thickness.sigma,
        thickness_per_px=0.0 if thickness is None else thickness.per_px,
        warnings=tuple(warnings),
        rim=None if rim is None else rim[0],
        rim_sigma=None if rim is None else rim[1],
        camera=camera,
        turns=_turns(calibration, used),
    )


def _rounding_sigma(traced: list[_TracedView]) -> tuple[float, float]:
    """Return the errors of a face's depth and height by the steps between depth values, metres.

    A face has one or two depth values, so that its rounding does not average out as a top's does.
    """
    sigmas = [(0.0, 0.0)]
    for item in traced:
        top = item.seen.top
        if not top.any():
            continue
        middle = float(np.median(item.seen.depth[top]))
        step = item.snapshot.noise.step(middle)
        sigma = step / np.sqrt(12) if step > _COARSE_STEP * middle else 0.0
        sigmas.append((sigma, -sigma * float(np.median(item.seen.fall[top]))))
    rounding, lowered = np.median(sigmas[1:] or sigmas, axis=0).tolist()
    return rounding, lowered


def _crease_blur(traced: list[_TracedView], sensors: SensorsConfig) -> float:
    """Return by how much a matching window may move the crease of top and side face, metres.

    It rounds a sharp crease over its width, which looks like a rounded rim.
    """
    spans = [0.0]
    for item in traced:
        if item.seen.top.any():
            fall = float(np.median(item.seen.fall[item.seen.top]))
            spans.append(item.seen.offset / fall**2 / item.snapshot.camera.fy)
    pixel = float(np.median(spans[1:] or spans))
    return sensors.window_edge_share * sensors.matching_window_px * pixel


_COARSE_STEP = 0.006  # of the distance; a disparity's steps are finer, and images are averaged


def _check_rim(views: Sequence[ViewEdges]) -> None:
    """Raise `EstimationError` for a top that ends at something higher nearly all round."""
    kinds = np.concatenate([np.empty(0, dtype=np.uint8), *(view.kind for view in views)])
    ends = kinds[kinds != EdgeKind.BORDER]
    if not len(ends):
        return
    hidden = float(np.mean(ends == EdgeKind.OCCLUDED))
    if hidden > _RIMMED and float(np.mean(ends == EdgeKind.TABLE)) < _OPEN:
        raise EstimationError(
            f"no edges of the table top: in {counted(len(views), 'view')} it ends at something "
            f"higher along {100 * hidden:.0f} % of its edge; a raised rim, as of a tray table, is "
            "not known as part of a top; if things stand along the edge, clear it and record again"
        )


_RIMMED, _OPEN = 0.6, 0.02  # shares of the seen top's ends


def _turns(calibration: Calibration | None, used: Sequence[ViewSegmentation]) -> dict[int, float]:
    if calibration is None:
        return {}
    turned = zip(calibration.snapshots, calibration.turns, strict=True)
    indices = {view.index for view in used}
    return {shot.index: float(turn) for shot, turn in turned if shot.index in indices}


def _set_aside(snapshot: Snapshot, what: str) -> ProcessWarning:
    return ProcessWarning(
        "outline.view_without_edges",
        "outline",
        f"view {snapshot.index} {what}; it gives no edges",
        snapshot.stamp_ns,
    )


_UNLIKE = 0.0035  # metres; a top that slopes by half a degree makes 2 mm


def _at_other_heights(planes: dict[int, ViewPlane], scatter: float) -> ProcessWarning:
    heights = sorted((plane.height, index) for index, plane in planes.items())
    (low, lowest), (high, highest) = heights[0], heights[-1]
    return ProcessWarning(
        "accuracy.height_scatter",
        "outline",
        f"The top's height differs by {1e3 * scatter:.0f} mm from view to view, though the floor "
        f"was fitted: {low:.3f} m in view {lowest}, {high:.3f} m in view {highest}; the table may "
        "have been raised, or pressed on, during the drive",
    )


def _shrunk(plane: ViewPlane, height: float, scatter: float) -> ViewPlane:
    """Return the view's plane at its own height, combined with the joint height by their sigmas.

    A view's own height corrects its own error of camera height or scale. With depth steps of
    centimetres the joint height is better.
    """
    own, joint = plane.height_sigma**-2, max(scatter, 5e-4) ** -2
    return ViewPlane(
        height=(own * plane.height + joint * height) / (own + joint),
        height_sigma=(own + joint) ** -0.5,
        slope=plane.slope,
        centre=plane.centre,
        noise=plane.noise,
        shared=plane.shared,
    )


def _faces(
    traced: list[_TracedView], level: float, config: OutlineConfig, sensors: SensorsConfig
) -> list[FaceEnds]:
    """Return the lower ends of the side face at the near edges of each view."""
    ends = []
    for item in traced:
        placed = place_on_plane(
            item.seen,
            item.contour,
            item.snapshot,
            plane=item.plane,
            level=level,
            config=config,
            edge_sigma_px=sensors.edge_sigma_px,
        )
        ends.append(
            face_ends(
                item.seen,
                item.contour,
                placed,
                item.snapshot,
                noise=item.plane.noise,
                config=config,
            )
        )
    return ends
