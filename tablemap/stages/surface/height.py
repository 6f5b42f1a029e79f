"""The height of the top: what depth says of it, and what the edges say of the depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.calibration import CAMERA_HEIGHT, TOP_DEPTH, Rival, TopBelief
from tablemap.stages.outline import Outline
from tablemap.stages.surface.candidates import Candidate
from tablemap.stages.surface.result import FittedFigure

_DOUBTED = 0.5  # weight of the usual explanation
_CAUSES = {
    CAMERA_HEIGHT: "the camera does not sit as high as TF says",
    TOP_DEPTH: "the depth of the top is off, as on a dark or glossy surface",
}


def height_of(
    outline: Outline, chosen: Candidate
) -> tuple[FittedFigure, tuple[ProcessWarning, ...]]:
    """Correct the height by the distance of the top from the camera, as the edges tell it.

    The edges are rays from all sides. Together with the poses they give the distance without any
    depth. By how much the height follows depends on what was wrong: the mean over the
    explanations (`Rival`) has the weight that the edges give to each, and its sigma says how far
    these are apart.
    """
    camera = outline.camera
    floor = 0.0 if outline.floor_step is None else outline.floor_step.sigma**2
    if camera is None:
        own = float(np.sqrt(outline.height_sigma**2 + floor))
        return FittedFigure(outline.height, own if np.isfinite(own) else None), ()
    usual = float(camera.covariance[0, 0])
    told = _told_by_edges(camera, chosen)
    explained = [_explained(rival, told) for rival in camera.rivals]
    if not explained:
        explained = [_explained(Rival("", np.zeros(2), camera.covariance[:2, :2], 0.0), told)]
    weight = np.exp([each.log_weight for each in explained])
    weight /= weight.sum()
    steps = np.array([each.step for each in explained])
    step = float(weight @ steps)
    depth = float(weight @ np.array([each.variance for each in explained]))
    depth += float(weight @ (steps - step) ** 2)
    views = max(outline.height_sigma**2 - usual, 0.0)
    sigma = float(np.sqrt(depth + views + floor))
    figure = FittedFigure(
        outline.height + step,
        sigma if np.isfinite(sigma) else None,
        budget={"noise": views, "depth": depth, "floor": floor} if np.isfinite(sigma) else None,
    )
    if told is None or weight[0] >= _DOUBTED:
        return figure, ()
    return figure, (_disagreement(camera.rivals, weight, told, sigma),)


@dataclass(frozen=True)
class _ByEdges:
    """How much farther the top is than depth says, a share, by the edges alone; its variance."""

    share: float
    variance: float


def _told_by_edges(camera: TopBelief, chosen: Candidate) -> _ByEdges | None:
    """Take the prior off the fitted distance; None if the edges say nothing of it."""
    fitted, prior = chosen.spread.scale_sigma**2, float(camera.covariance[1, 1])
    information = 1 / fitted - 1 / max(prior, 1e-12)
    if information * prior < _LEAST_INFORMATION:
        return None
    return _ByEdges(chosen.fit.nuisances.scale / (fitted * information), 1 / information)


_LEAST_INFORMATION = 0.05  # of what was believed before


@dataclass(frozen=True)
class _Explained:
    step: float
    variance: float
    log_weight: float


def _explained(rival: Rival, told: _ByEdges | None) -> _Explained:
    """Update one explanation by the edges (Kalman): step of the height, variance, weight."""
    (height, both), (_, distance) = rival.covariance
    if told is None:
        return _Explained(float(rival.shift[0]), float(height), rival.log_weight)
    total = float(distance) + told.variance
    surprise = told.share - float(rival.shift[1])
    return _Explained(
        float(rival.shift[0] + both / total * surprise),
        max(float(height - both**2 / total), 0.0),
        rival.log_weight - 0.5 * (surprise**2 / total + float(np.log(total))),
    )


def _disagreement(
    rivals: tuple[Rival, ...], weight: Floats, told: _ByEdges, sigma: float
) -> ProcessWarning:
    rare = [(float(w), _CAUSES[r.cause]) for r, w in zip(rivals, weight, strict=True) if r.cause]
    likeliest = " or ".join(f"{cause} ({100 * w:.0f} %)" for w, cause in sorted(rare, reverse=True))
    return ProcessWarning(
        "accuracy.top_distance",
        "surface",
        f"The edges put the top {100 * abs(told.share):.1f} % "
        f"{'farther from' if told.share > 0 else 'nearer to'} the camera than its depth does: "
        f"{likeliest}; the height is uncertain by {1e3 * sigma:.0f} mm; check the camera's height "
        "in TF, and its depth on this top",
    )
