"""Sides and corners without depth: the top goes on, unseen, from where its depth ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Bools, Floats, Ints, Pose2
from tablemap.stages.outline import EdgeKind, Outline
from tablemap.stages.surface.departures import Departure
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import JointFit, corrected_poses
from tablemap.stages.surface.shapes.rounded import Rounded
from tablemap.stages.surface.shapes.shape import signed_distance

_LEAST_SHARE = 0.6  # of a side's near ends; where the top ends itself it is 0 to 0.15
_LEAST_ENDS = 20
_REACH = 0.015  # metres from the fitted side
_SHARP = 1.5  # times the smallest pixel on the side: ends with larger ones tell less


@dataclass(frozen=True, eq=False)
class _RimEnds:
    """Ends of the top at a lower surface or at missing depth, in all views.

    - ``places``, ``normals``: (n, 2), relative to the origin
    - ``missing``, ``is_near``: (n,), whether depth is missing there; whether the side face is
      towards the camera
    - ``hole``, ``metres_per_px``: (n,), see `ViewEdges`
    - ``view``: (n,), the snapshot
    """

    places: Floats
    normals: Floats
    missing: Bools
    is_near: Bools
    hole: Floats
    metres_per_px: Floats
    view: Ints


def _ends(fit: JointFit, outline: Outline, evidence: Evidence) -> _RimEnds | None:
    poses = corrected_poses(fit, evidence)
    parts = []
    for view in outline.views:
        if view.index not in evidence.views:
            continue
        view = view.only(np.isin(view.kind, (EdgeKind.TABLE, EdgeKind.MISSING)))
        pose = Pose2.from_array(poses[view.index])
        parts.append(
            (
                pose.apply(view.points),
                pose.rotate(view.normals),
                view.kind == EdgeKind.MISSING,
                view.is_near,
                view.hole,
                view.metres_per_px,
                np.full(len(view.kind), view.index),
            )
        )
    return _RimEnds(*map(np.concatenate, zip(*parts, strict=True))) if parts else None


def hidden_rims(
    fit: JointFit, outline: Outline, evidence: Evidence, config: SurfaceConfig
) -> list[Departure]:
    """Return the sides beside which the depth is missing, with the width of what is missing.

    A chrome, black or mirroring rim gives no depth. The top then seems to end where the rim begins.
    The shadow of a sensor looks alike, but it lies on one side in the image, and never between the
    top and the side face under it: most ends towards the camera show a rim. How wide it is shows
    where the side face is turned away, as a face may give no depth either.
    """
    ends = _ends(fit, outline, evidence)
    if ends is None:
        return []
    measured = fit.shape.measure(ends.places, ends.normals)
    facing = np.einsum("ij,ij->i", ends.normals, measured.normal)
    on = (np.abs(measured.distance) < _REACH) & (facing > config.normal_cosine)
    side = np.where(on, measured.side, -1)
    rims = []
    for index, piece in enumerate(fit.shape.pieces()):
        own = side == index
        near = own & ends.is_near
        if near.sum() < _LEAST_ENDS or ends.missing[near].mean() < _LEAST_SHARE:
            continue
        told = own & np.isfinite(ends.hole)
        away = told & ~ends.is_near
        if away.sum() >= _LEAST_ENDS:
            pixel = ends.metres_per_px
            told = away & (pixel < _SHARP * pixel[away].min())
        if not told.any():
            continue
        length = float(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum())
        offsets = np.full(int(told.sum()), np.median(ends.hole[told]))
        rims.append(Departure(ends.places[told], offsets, length, side=index))
    return rims


def hidden_corners(fit: JointFit, outline: Outline, evidence: Evidence) -> list[Departure]:
    """Return the arcs of a rounded shape at corners without depth, with how far a sharp one lies.

    Where the depth of a corner is missing, the top seems to be rounded, for the edge of the hole
    cuts the corner off. Around a hole many ends of the top are at missing depth, in several views,
    with the lower surface behind it; at a corner that was seen, they are the shadow of one view.
    """
    if not isinstance(fit.shape, Rounded) or (ends := _ends(fit, outline, evidence)) is None:
        return []
    corners, pieces = fit.shape.corners, fit.shape.pieces()
    within = signed_distance(ends.places, corners) < _REACH
    found = []
    for number, corner in enumerate(corners):
        side = 2 * ((number - 1) % len(corners)) + 1
        arc = pieces[side]
        reach = np.linalg.norm(arc - corner, axis=1)
        own = within & (np.linalg.norm(ends.places - corner, axis=1) < _ABOUT * reach[0])
        hole = own & ends.missing & np.isfinite(ends.hole)
        _, counts = np.unique(ends.view[hole], return_counts=True)
        if (counts >= 2).sum() >= _LEAST_VIEWS and hole.sum() >= _LEAST_HOLES * own.sum():
            length = float(np.linalg.norm(np.diff(arc, axis=0), axis=1).sum())
            found.append(Departure(arc, np.full(len(arc), reach.min()), length, side=side))
    return found


_ABOUT = 1.2  # times the way from a corner to where its arc begins
_LEAST_VIEWS = 3
_LEAST_HOLES = 0.12  # of the ends at a corner; at one that was seen it is 0 to 0.05
