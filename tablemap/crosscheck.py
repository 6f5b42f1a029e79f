"""Camera against laser: the top's edges show how far the one sits beside the other.

The laser places the robot, the camera sees the table. Where the camera is mounted beside where the
recorded frames have it (or the laser is), an edge of the top seen from one side and from the other
comes to lie in two places. No residual of the registration shows that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.config import CrossCheckConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.outline import EdgeKind, Outline, ViewEdges
from tablemap.registration import Registration
from tablemap.surface import Surface

_NUISANCES = 3  # depth scale, bias of near edges, bias of far edges
_SETTLES = 12


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """How far the camera sits beside where the laser and the recorded frames have it.

    ``offset`` (3,) is x, y (metres) and yaw of the camera in the base, laser taken as right; what
    is the laser's own error has the opposite sign. ``covariance`` (3, 3) is its. ``at_table`` (2,)
    is what it does to the table, forward and leftward of the base in metres, with standard
    deviations ``at_table_sigma`` (2,). All are None where the views cannot tell.
    ``pose_sigma`` (metres per axis) is what the offset leaves unknown of where the base was: which
    sensor is off is not known. ``points`` edge points of ``views`` views were compared.
    """

    offset: Floats | None
    covariance: Floats | None
    at_table: Floats | None
    at_table_sigma: Floats | None
    pose_sigma: float
    points: int
    views: int
    warnings: tuple[ProcessWarning, ...]


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edge points that lie on a side of the top: n of them, in the map as the laser places them.

    ``arm`` (n, 2) leads from the base to the point and ``ray`` (n, 2) from the camera, both in the
    map's axes; ``normal`` and ``distance`` (n,) are to the outline; ``basis`` (n, k) is how the
    outline itself may move; ``variance`` (n,) includes neighbours that err together.
    """

    arm: Floats
    ray: Floats
    normal: Floats
    distance: Floats
    basis: Floats
    variance: Floats
    is_near: Floats
    yaw: Floats
    view: Floats


def cross_check(
    outline: Outline, surface: Surface, registration: Registration, *, config: CrossCheckConfig
) -> CrossCheck:
    """Estimate the camera's offset against the laser from the edges of the top in all views.

    Robust least squares over the offset, the outline's own freedom, depth scale, edge biases and
    the poses with the registration's covariance. Without laser poses or enough views around the
    table there is no result, and no warning.
    """
    if registration.source != "laser":
        return _nothing(0, 0)
    views = [v for v in outline.views if registration.used[v.index]]
    edges = _gather(views, surface, registration, config)
    if edges is None or len(np.unique(edges.view)) < config.minimum_views:
        return _nothing(0 if edges is None else len(edges.distance), len(views))
    # Where the rim is dull, far edges end early: that looks like a camera too far back.
    far = float(np.hypot(config.bias_sigma, config.rim_set_back if outline.is_dull else 0.0))
    solved, covariance = _solve(edges, registration.covariance, far, config)
    offset, spread = solved[:3], covariance[:3, :3]
    ahead = float(np.median(np.einsum("ij,ij->i", edges.ray, _forward(edges.yaw))))
    effect = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, ahead]])
    at_table = effect @ offset
    sigma = np.sqrt(np.diag(effect @ spread @ effect.T))
    count = len(np.unique(edges.view))
    if sigma.max() > config.largest_sigma:
        return _nothing(len(edges.distance), count)
    size = float(np.hypot(*at_table))
    found = size > config.threshold and bool(
        (np.abs(at_table) > np.maximum(config.sigmas * sigma, 0.5 * config.threshold)).any()
    )
    return CrossCheck(
        offset=offset,
        covariance=spread,
        at_table=at_table,
        at_table_sigma=sigma,
        # Which of the two is off is not known: a half is the laser's, give or take a half.
        pose_sigma=0.5 * size if found else 0.0,
        points=len(edges.distance),
        views=count,
        warnings=(_warning(at_table, sigma, float(offset[2]), edges),) if found else (),
    )


def _nothing(points: int, views: int) -> CrossCheck:
    return CrossCheck(None, None, None, None, 0.0, points, views, ())


def _warning(at_table: Floats, sigma: Floats, yaw: float, edges: _Edges) -> ProcessWarning:
    forward, left = 1e3 * at_table
    message = (
        f"camera and laser disagree: seen from different sides, the table's edges ask for a camera "
        f"{abs(forward):.0f} mm further {'forward' if forward > 0 else 'back'} and "
        f"{abs(left):.0f} mm further {'left' if left > 0 else 'right'} at the table (sigmas "
        f"{1e3 * sigma[0]:.1f} and {1e3 * sigma[1]:.1f} mm), {abs(np.degrees(yaw)):.1f} degrees "
        f"of turning included. TF has the camera or the laser elsewhere than it is"
    )
    reach = float(np.median(np.linalg.norm(edges.arm, axis=1)))
    if abs(forward) > 3.0 and abs(forward) / reach < 10.0:
        message += f", or the laser's ranges are {abs(forward) / reach:.0f} permil off"
    return ProcessWarning("crosscheck.mounting", "crosscheck", message + "; calibrate them.")


def _gather(
    views: list[ViewEdges], surface: Surface, registration: Registration, config: CrossCheckConfig
) -> _Edges | None:
    """Lay the edge points on the outline and keep those that belong to a side of it."""
    parts = []
    for view in views:
        pose = registration.map_from_base[view.index]
        good = np.flatnonzero(
            (view.kind == EdgeKind.TABLE)
            & np.isfinite(view.points).all(axis=1)
            & np.isfinite(view.sigma)
            & (view.sigma > 0)
        )
        kept = good[:: max(1, len(good) // config.points)]
        if len(kept) < config.minimum_points:
            continue
        worth = config.correlation * len(kept) / len(good)
        turn = pose.rotation
        arm, ray = view.points[kept] @ turn.T, (view.points[kept] - view.camera_xy) @ turn.T
        places, normals = arm + pose.translation, view.normals[kept] @ turn.T
        same = np.ones(len(kept))
        side = _against(places, normals, surface, config.reach)
        parts.append(
            (
                arm,
                ray,
                *side,
                view.sigma[kept] ** 2 * max(worth, 1.0),
                view.is_near[kept].astype(np.float64),
                same * pose.yaw,
                same * view.index,
            )
        )
    if not parts:
        return None
    arm, ray, normal, distance, basis, variance, near, yaw, index = (
        np.concatenate(columns) for columns in zip(*parts, strict=True)
    )
    on = np.isfinite(distance)
    if on.sum() < config.minimum_points:
        return None
    moved = np.abs(basis[on]).sum(axis=0) > 0
    return _Edges(
        arm[on],
        ray[on],
        normal[on],
        distance[on],
        basis[on][:, moved],
        variance[on],
        near[on],
        yaw[on],
        index[on],
    )


def _against(
    places: Floats, normals: Floats, surface: Surface, reach: float
) -> tuple[Floats, Floats, Floats]:
    """Return outline normals (n, 2), distances (n,) and the outline's freedom (n, k) at points.

    A straight side may shift and turn; a curved one shifts, grows and turns elliptic. The distance
    is NaN for what no side within ``reach`` fits.
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
    fits = (normals @ outward.T > 0.8) & (np.abs(across) < reach) & (beyond < 0.02)
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


def _forward(yaw: Floats) -> Floats:
    return np.column_stack([np.cos(yaw), np.sin(yaw)])


def _solve(
    edges: _Edges, pose_covariance: Floats, far_bias_sigma: float, config: CrossCheckConfig
) -> tuple[Floats, Floats]:
    """Return all unknowns and their covariance, the offset's three first."""
    forward = _forward(edges.yaw)
    left = np.column_stack([-forward[:, 1], forward[:, 0]])
    normal = edges.normal

    def turned(arm: Floats) -> Floats:
        return np.asarray(normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1])

    shared = np.column_stack(
        [
            np.einsum("ij,ij->i", normal, forward),
            np.einsum("ij,ij->i", normal, left),
            turned(edges.ray),
            np.einsum("ij,ij->i", normal, edges.ray),
            -edges.is_near,
            edges.is_near - 1.0,
            -edges.basis,
        ]
    )
    present = np.unique(edges.view).astype(np.int64)
    slot = np.searchsorted(present, edges.view)
    own = np.zeros((len(slot), 3 * len(present)))
    rows = np.arange(len(slot))
    own[rows, 3 * slot], own[rows, 3 * slot + 1] = normal[:, 0], normal[:, 1]
    own[rows, 3 * slot + 2] = turned(edges.arm)
    design = np.column_stack([shared, own])

    freedom = edges.basis.shape[1]
    sigma = [config.offset_sigma, config.offset_sigma, config.yaw_sigma]
    sigma += [config.scale_sigma, config.bias_sigma, far_bias_sigma, *[0.05] * freedom]
    prior = np.diag([*np.asarray(sigma, dtype=np.float64) ** -2.0, *[0.0] * own.shape[1]])
    at = (3 * present[:, None] + np.arange(3)).ravel()
    poses = pose_covariance[np.ix_(at, at)] + np.diag(np.tile([1e-8, 1e-8, 1e-8], len(present)))
    prior[3 + _NUISANCES + freedom :, 3 + _NUISANCES + freedom :] = np.linalg.inv(poses)

    state = np.zeros(design.shape[1])
    variance, scatter = edges.variance, 1.0
    information = prior
    for _ in range(_SETTLES):
        residual = edges.distance + design @ state
        squared = residual**2 / variance
        # The median of a chi-square with one degree of freedom is 0.455.
        scatter = max(1.0, float(np.median(squared)) / 0.455)
        weight = 1.0 / (variance * scatter * (1.0 + squared / (9.0 * scatter)) ** 2)
        information = prior + (design.T * weight) @ design
        gradient = design.T @ (weight * edges.distance)
        following = -np.linalg.solve(information, gradient)
        settled = float(np.abs(following - state)[:2].max()) < 1e-6
        state = following
        if settled:
            break
    return state, np.linalg.inv(information)
