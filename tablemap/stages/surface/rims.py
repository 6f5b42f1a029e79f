"""Sides whose rim gave no depth: the top goes on, unseen, from where its depth ends."""

from __future__ import annotations

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Pose2
from tablemap.stages.outline import EdgeKind, Outline
from tablemap.stages.surface.departures import Departure
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import JointFit, corrected_poses

_LEAST_SHARE = 0.6  # of a side's near ends; where the top ends itself it is 0 to 0.15
_LEAST_ENDS = 20
_REACH = 0.015  # metres from the fitted side
_SHARP = 1.5  # times the smallest pixel on the side: ends with larger ones tell less


def hidden_rims(
    fit: JointFit, outline: Outline, evidence: Evidence, config: SurfaceConfig
) -> list[Departure]:
    """Return the sides beside which the depth is missing, with the width of what is missing.

    A chrome, black or mirroring rim gives no depth. The top then seems to end where the rim begins.
    The shadow of a sensor looks alike, but it lies on one side in the image, and never between the
    top and the side face under it: most ends towards the camera show a rim. How wide it is shows
    where the side face is turned away, as a face may give no depth either.
    """
    poses = corrected_poses(fit, evidence)
    parts = []
    for view in outline.views:
        if view.index not in evidence.views:
            continue
        view = view.only(np.isin(view.kind, (EdgeKind.TABLE, EdgeKind.MISSING)))
        pose = Pose2.from_array(poses[view.index])
        points, normals = pose.apply(view.points), pose.rotate(view.normals)
        measured = fit.shape.measure(points, normals)
        facing = np.einsum("ij,ij->i", normals, measured.normal)
        on = (np.abs(measured.distance) < _REACH) & (facing > config.normal_cosine)
        side = np.where(on, measured.side, -1)
        missing = view.kind == EdgeKind.MISSING
        parts.append((side, view.is_near, missing, view.hole, view.metres_per_px, points))
    if not parts:
        return []
    side, near, missing, hole, pixel, place = map(np.concatenate, zip(*parts, strict=True))
    rims = []
    for index, piece in enumerate(fit.shape.pieces()):
        own = side == index
        if (own & near).sum() < _LEAST_ENDS or missing[own & near].mean() < _LEAST_SHARE:
            continue
        told = own & np.isfinite(hole)
        away = told & ~near
        if away.sum() >= _LEAST_ENDS:
            told = away & (pixel < _SHARP * pixel[away].min())
        if not told.any():
            continue
        length = float(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum())
        offsets = np.full(int(told.sum()), np.median(hole[told]))
        rims.append(Departure(place[told], offsets, length, side=index))
    return rims
