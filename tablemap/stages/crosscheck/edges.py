"""The top's edges: each view's edge points compared with the outline from all views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tablemap.geometry import Floats
from tablemap.stages.crosscheck.rows import Rows, bias_row, stacked
from tablemap.stages.outline import EdgeKind, ViewEdges
from tablemap.stages.registration import Registration
from tablemap.stages.surface import Surface, camera_motion

_FACING = 0.8  # cosine between a point's normal and its side's
_BEYOND = 0.02  # metres past a side's end
_REACH = 0.06  # metres: a point farther from every side belongs to none
_LEAST_POINTS = 20  # edge points that a view must show
_MOST_POINTS = 150  # edge points of a view: further ones add nothing new
_CORRELATED = 8.0  # neighbouring edge points share pixels and err together: they count as one


def edge_rows(views: list[ViewEdges], surface: Surface, registration: Registration) -> Rows | None:
    """Compare the edge points with the outline; keep those that belong to one of its sides.

    Returns None if there are too few. The outline itself has unknowns: a straight side may shift
    and turn; a curve may shift, grow and become elliptic.
    """
    if not surface.edges:
        return None
    parts = []
    middle = surface.pose.translation
    for view in views:
        pose = registration.map_from_base[view.index]
        good = np.flatnonzero(
            (view.kind == EdgeKind.TABLE)
            & np.isfinite(view.points).all(axis=1)
            & np.isfinite(view.sigma)
            & (view.sigma > 0)
        )
        kept = good[:: max(1, len(good) // _MOST_POINTS)]
        if len(kept) < _LEAST_POINTS:
            continue
        worth = _CORRELATED * len(kept) / len(good)
        turn = pose.rotation
        arm, ray = view.points[kept] @ turn.T, (view.points[kept] - view.camera_xy) @ turn.T
        places, normals = arm + pose.translation, view.normals[kept] @ turn.T
        normal, distance, basis = _against(places, normals, surface)
        near = view.is_near[kept].astype(np.float64)
        same = np.ones(len(kept))
        motion = camera_motion(
            view.points[kept] - view.camera_xy,
            view.drop * same,
            np.tile(view.axis, (len(kept), 1)),
            0.0 * same,
        )
        tilts = [np.einsum("ij,ij->i", normal, by @ turn.T) for by in (motion.roll, motion.pitch)]
        parts.append(
            Rows(
                arm=arm,
                ray=ray,
                normal=normal,
                distance=distance,
                variance=view.sigma[kept] ** 2 * max(worth, 1.0),
                # A wrong laser scale stretches the lap; the outline's own unknowns follow.
                stretch=np.tile(pose.translation - middle, (len(kept), 1)),
                tilt=np.column_stack(tilts),
                bias=bias_row("near edges", -near) + bias_row("far edges", near - 1.0),
                basis=-basis,
                yaw=same * pose.yaw,
                view=same * view.index,
                is_leg=0.0 * same,
            )
        )
    if not parts:
        return None
    rows = stacked(parts)
    rows = rows.only(np.isfinite(rows.distance))
    if len(rows) < _LEAST_POINTS:
        return None
    moved = np.abs(rows.basis).sum(axis=0) > 0
    return replace(rows, basis=rows.basis[:, moved])


def _against(places: Floats, normals: Floats, surface: Surface) -> tuple[Floats, Floats, Floats]:
    """Return the outline's normals (n, 2), distances (n,) and derivatives (n, k) at the points.

    The derivatives are those of the distance by the outline's unknowns. The distance is NaN for a
    point without a fitting side within `_REACH`.
    """
    pieces = [edge.points for edge in surface.edges]
    starts = np.concatenate([piece[:-1] for piece in pieces])
    ends = np.concatenate([piece[1:] for piece in pieces])
    owner = np.repeat(np.arange(len(pieces)), [len(piece) - 1 for piece in pieces])
    along = ends - starts
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    along = along / length[:, None]
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    offset = places[:, None] - starts[None]
    across = np.einsum("nsk,sk->ns", offset, outward)
    run = np.einsum("nsk,sk->ns", offset, along)
    beyond = np.maximum(np.maximum(-run, run - length), 0.0)
    fits = (normals @ outward.T > _FACING) & (np.abs(across) < _REACH) & (beyond < _BEYOND)
    cost = np.where(fits, np.hypot(across, beyond), np.inf)
    best = np.argmin(cost, axis=1)
    rows = np.arange(len(places))
    distance = np.where(np.isfinite(cost[rows, best]), across[rows, best], np.nan)
    normal = outward[best]
    heading = np.arctan2(normal[:, 1], normal[:, 0])
    basis = np.zeros((len(places), 5 * len(pieces)))
    for k, piece in enumerate(pieces):
        own = owner[best] == k
        if len(piece) == 2:
            basis[own, 5 * k] = 1.0
            basis[own, 5 * k + 1] = run[rows, best][own] - 0.5 * length[best][own]
        else:
            waves = [np.ones(int(own.sum()))]
            waves += [wave(m * heading[own]) for m in (1, 2) for wave in (np.cos, np.sin)]
            basis[own, 5 * k : 5 * k + 5] = np.column_stack(waves)
    return normal, distance, basis
