"""All views' evidence about the outline in one set of arrays, ready for the joint fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.errors import EstimationError, ProcessWarning
from tablemap.geometry import Bools, Floats, Ints, Pose2
from tablemap.stages.calibration.levels import parabola
from tablemap.stages.outline import EdgeKind, Outline, ViewEdges
from tablemap.stages.registration import Registration
from tablemap.stages.surface.motion import CameraMotion, Mounting, camera_motion
from tablemap.stages.surface.priors import (
    common_prior,
    corrections_root,
    pose_sigma,
    skew_sigma,
    widens,
)
from tablemap.words import counted

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


@dataclass(frozen=True, eq=False)
class Evidence:
    """Edge points of all views, sorted by view, and the cells of the plane seen as top or free.

    All places are relative to ``origin``, so that angles and offsets of lines hardly correlate.

    origin: (2,), a point amid the table, in the map, metres
    in_base, normal_in_base: (N, 2), edge points and outward normals in the base of their view
    motion: derivatives of the points by errors of the camera, in the base of their view
    drop: (N,), of the camera above the top, metres
    widening: (N,), metres outward by which a point moves if depth makes the top a pixel wider
    hole: (N,), pixels of missing depth behind a point, 0 where none are known
    view: (N,), snapshot of each point
    poses: (n, 3), x, y, yaw of all snapshots
    spread: (n, 3), metres, the places of the snapshots from their middle; 0 for the yaw
    prior_root: (n * ViewCorrections.COUNT, m), maps m independent unit normals to corrections
    prior_sources: (m,), what each of these stands for, as `budget.PARTS` names it
    bulge: (N,), rise of a point with a sag of one: that of a parabola with mean 0 over the top
    top, free: (c, 2), centres of cells of ``cell`` metres
    spacing_px: typical distance between neighbouring edge points of a view, pixels
    correlation_px: least and largest length along an edge over which errors are alike, pixels
    common_mean, common_precision: the prior of `CommonNuisances`, mean (c,) and precision (c, c)
    pose_sigma: standard deviation of a view's place, metres, the median of the views
    skew_sigma: standard deviation of a bend of the drive, radians; poses from depth alone share the
        camera's systematic errors, poses by laser do not
    """

    origin: Floats
    in_base: Floats
    normal_in_base: Floats
    motion: CameraMotion
    drop: Floats
    sigma: Floats
    view: Ints
    is_near: Bools
    widening: Floats
    hole: Floats
    bulge: Floats
    poses: Floats
    spread: Floats
    prior_root: Floats
    prior_sources: tuple[str, ...]
    views: Ints
    view_slices: tuple[slice, ...]
    top: Floats
    free: Floats
    cell: float
    spacing_px: float
    correlation_px: tuple[float, float]
    points: Floats
    normals: Floats
    common_mean: Floats
    common_precision: Floats
    pose_sigma: float
    skew_sigma: float

    @property
    def is_whole(self) -> Bools:
        """Which points (N,) have no more depth missing behind them than most have."""
        most = max(_HOLE_PX, 1.5 * float(np.percentile(self.hole, 75)))
        whole: Bools = self.hole <= most
        return whole

    @cached_property
    def top_tree(self) -> cKDTree:
        """The cells that were seen as top, for searches of the nearest one."""
        from scipy.spatial import cKDTree

        return cKDTree(self.top)

    def thinned(self, most: int) -> Evidence:
        """Return this evidence with about ``most`` edge points, evenly along each contour."""
        step = max(len(self.view) // most, 1)
        kept = [np.arange(part.start, part.stop, step) for part in self.view_slices]
        ends = np.cumsum([len(part) for part in kept])
        chosen = np.concatenate(kept)
        return replace(
            self,
            in_base=self.in_base[chosen],
            normal_in_base=self.normal_in_base[chosen],
            motion=self.motion.only(chosen),
            drop=self.drop[chosen],
            sigma=self.sigma[chosen],
            view=self.view[chosen],
            is_near=self.is_near[chosen],
            widening=self.widening[chosen],
            hole=self.hole[chosen],
            bulge=self.bulge[chosen],
            view_slices=tuple(
                slice(int(e) - len(part), int(e)) for e, part in zip(ends, kept, strict=True)
            ),
            spacing_px=self.spacing_px * step,
            points=self.points[chosen],
            normals=self.normals[chosen],
        )


_HOLE_PX = 1.5  # a single missing pixel may be a mixed one that was left out


def gather(
    outline: Outline,
    registration: Registration,
    config: SurfaceConfig,
    sensors: SensorsConfig,
    mounting: Mounting | None = None,
) -> tuple[Evidence, tuple[ProcessWarning, ...]]:
    """Collect the evidence of all used views about the outline.

    Raises `EstimationError` if there are too few edge points for any shape.
    """
    warnings: list[ProcessWarning] = []
    known = [v for v in outline.views if 0 <= v.index < len(registration.map_from_base)]
    views = [v for v in known if registration.used[v.index]]
    if not views and known:
        views = known
        warnings.append(
            ProcessWarning(
                "accuracy.unchecked_poses",
                "surface",
                "No view's pose passed the registration's check; all were used as they are.",
            )
        )
    views = sorted(views, key=lambda v: v.index)
    most = max(config.points_total // max(len(views), 1), 50)
    parts = [_thinned(view, most) for view in views]
    views = [view for view, part in zip(views, parts, strict=True) if len(part)]
    parts = [part for part in parts if len(part)]
    count = sum(len(part) for part in parts)
    if count < config.minimum_points:
        raise EstimationError(
            f"expected at least {config.minimum_points} points on the table's edge, found {count} "
            f"in {len(views)} of {counted(len(outline.views), 'view')}; record views that show the "
            "top's end"
        )
    poses = np.array([pose.as_array() for pose in registration.map_from_base])
    in_base = np.concatenate([v.points[p] for v, p in zip(views, parts, strict=True)])
    normal = np.concatenate([v.normals[p] for v, p in zip(views, parts, strict=True)])
    lever = np.concatenate([v.points[p] - v.camera_xy for v, p in zip(views, parts, strict=True)])
    counts = [len(part) for part in parts]
    drop = np.repeat([view.drop for view in views], counts)
    axis = np.repeat([view.axis for view in views], counts, axis=0)
    heads = np.repeat([outline.turns.get(view.index, 0.0) for view in views], counts)
    sigma = np.concatenate([v.sigma[p] for v, p in zip(views, parts, strict=True)])
    near = np.concatenate([v.is_near[p] for v, p in zip(views, parts, strict=True)])
    widening = np.concatenate([v.widening[p] for v, p in zip(views, parts, strict=True)])
    hole = np.concatenate(
        [(v.hole / v.metres_per_px)[p] for v, p in zip(views, parts, strict=True)]
    )
    index = np.concatenate(
        [np.full(len(p), v.index, dtype=np.int64) for v, p in zip(views, parts, strict=True)]
    )
    ends = np.cumsum([len(p) for p in parts])
    slices = tuple(slice(int(e) - len(p), int(e)) for e, p in zip(ends, parts, strict=True))
    in_map = place(in_base, index, poses)
    origin = np.median(in_map, axis=0)
    poses = poses - np.array([origin[0], origin[1], 0.0])
    top, free = _vote(views, poses, config)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    mean, precision = common_prior(outline, registration, config, sensors, mounting)
    root, sources = corrections_root(views, poses, registration, outline, sensors)
    evidence = Evidence(
        origin=origin,
        in_base=in_base,
        normal_in_base=normal,
        motion=camera_motion(lever, drop, axis, heads),
        drop=drop,
        sigma=np.maximum(sigma, config.sigma_floor),
        view=index,
        is_near=near.astype(bool),
        widening=widening,
        hole=np.nan_to_num(hole),
        bulge=_bulge(place(in_base, index, poses), top),
        poses=poses,
        spread=(poses - poses.mean(axis=0)) * (1.0, 1.0, 0.0),
        prior_root=root,
        prior_sources=sources,
        views=np.array([v.index for v in views], dtype=np.int64),
        view_slices=slices,
        top=top,
        free=free,
        cell=config.cell,
        spacing_px=_spacing(views, parts),
        correlation_px=_correlation(config, sensors, mounting),
        points=place(in_base, index, poses),
        normals=turn(normal, poses[index, 2]),
        common_mean=mean,
        common_precision=precision,
        pose_sigma=pose_sigma(registration),
        skew_sigma=skew_sigma(registration, poses),
    )
    return evidence, tuple(warnings)


def _bulge(points: Floats, top: Floats) -> Floats:
    """Return the calibration's parabola (`LevelSamples.bulge`) at points (N, 2).

    It has its vertex amid the cells that were seen as top.
    """
    if len(top) < _LEAST_CELLS:
        return np.zeros(len(points))
    middle = np.median(top, axis=0)
    own, over = (np.sum((places - middle) ** 2, axis=1) for places in (points, top))
    return parabola(own, over=over, most=_FARTHEST)


_LEAST_CELLS = 20
_FARTHEST = 1.5  # squared distances of edge points from the middle, over those of nearly all cells


def _correlation(
    config: SurfaceConfig, sensors: SensorsConfig, mounting: Mounting | None
) -> tuple[float, float]:
    least, most = config.correlation_px, config.correlation_maximum_px
    if widens(mounting, sensors):
        least = max(least, sensors.widened_edge_correlation_px)
    # Which side of an edge wins within a window depends on their brightness, which is alike along
    # an edge.
    least = max(least, _WINDOWS * sensors.matching_window_px)
    return least, max(most, least)


_WINDOWS = 7.0


def turn(vectors: Floats, yaw: Floats) -> Floats:
    """Turn each of (N, 2) vectors by its own angle (N,)."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack(
        [c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1
    )


def place(in_base: Floats, view: Ints, poses: Floats) -> Floats:
    """Map (N, 2) points from the bases of their views (N,) by the poses (n, 3)."""
    return turn(in_base, poses[view, 2]) + poses[view, :2]


def _thinned(view: ViewEdges, most: int) -> Ints:
    good = (
        (view.kind == EdgeKind.TABLE)
        & np.isfinite(view.points).all(axis=1)
        & np.isfinite(view.normals).all(axis=1)
        & np.isfinite(view.sigma)
        & (view.sigma > 0)
    )
    chosen = np.flatnonzero(good)
    if len(chosen) > most:
        chosen = chosen[np.linspace(0, len(chosen) - 1, most).round().astype(np.int64)]
    return chosen


def _spacing(views: list[ViewEdges], parts: list[Ints]) -> float:
    """Return the median distance, pixels, from a point to its nearest neighbour."""
    from scipy.spatial import cKDTree

    nearest: list[Floats] = []
    for view, part in zip(views, parts, strict=True):
        pixels = view.pixels[part]
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if len(pixels) > 2:
            nearest.append(cKDTree(pixels).query(pixels, k=2)[0][:, 1])
    spacing = float(np.median(np.concatenate(nearest))) if nearest else 0.0
    return spacing if spacing > 0 else 6.0


def _vote(views: list[ViewEdges], poses: Floats, config: SurfaceConfig) -> tuple[Floats, Floats]:
    """Let each view vote once per cell; return the centres of top cells and of free cells."""
    keys: dict[str, list[Ints]] = {"top": [], "free": []}
    for view in views:
        pose = Pose2.from_array(poses[view.index])
        for name, points in (("top", view.top), ("free", view.free)):
            here = pose.apply(points[np.isfinite(points).all(axis=1)])
            here = here[np.abs(here).max(axis=1, initial=0.0) < _EXTENT]
            cells = np.floor((here + _EXTENT) / config.cell).astype(np.int64)
            keys[name].append(np.unique(cells[:, 0] * _STRIDE + cells[:, 1]))
    none = np.empty(0, dtype=np.int64)
    top, free = np.concatenate([none, *keys["top"]]), np.concatenate([none, *keys["free"]])
    cells, inverse = np.unique(np.concatenate([top, free]), return_inverse=True)
    for_top = np.bincount(inverse[: len(top)], minlength=len(cells))
    for_free = np.bincount(inverse[len(top) :], minlength=len(cells))
    place = np.column_stack([cells // _STRIDE, cells % _STRIDE])
    centres = (place + 0.5) * config.cell - _EXTENT
    return centres[for_top > for_free], centres[for_free > for_top]


# Votes farther than this from the table's middle say nothing about it, metres.
_EXTENT = 6.0
_STRIDE = 1 << 20
