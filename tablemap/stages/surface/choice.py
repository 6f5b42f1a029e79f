"""The choice among fitted shapes: evidence against parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from tablemap.config import SurfaceConfig
from tablemap.geometry import Bools, Floats
from tablemap.robust import mad_sigma
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import JointFit
from tablemap.stages.surface.residuals import Noise
from tablemap.stages.surface.shapes.shape import centroid

_MOST_LAGS = 40


def assumed_noise(evidence: Evidence) -> Noise:
    """Return the assumed scatter of edge points, for use before the first fit."""
    least, most = _kappa_range(evidence)
    return Noise(1.0, 1.0, float(np.sqrt(least * most)))


def estimate_noise(fit: JointFit, evidence: Evidence) -> Noise:
    """Estimate scale and correlation of the scatter from a fit's residuals.

    Kappa is the integrated autocorrelation along each view's contour (Sokal's window). It is
    limited to the range of lengths that the configuration gives in pixels.
    """
    normalised = fit.distance / evidence.sigma
    close = (fit.side >= 0) & (np.abs(normalised) < 8)
    if close.sum() < 20:
        return assumed_noise(evidence)
    near = _scatter(normalised[close & evidence.is_near])
    far = _scatter(normalised[close & ~evidence.is_near])
    centre = centroid(fit.shape.outline())
    value = np.clip(normalised / np.where(evidence.is_near, near, far), -3, 3)
    product = np.zeros(_MOST_LAGS + 1)
    count = np.zeros(_MOST_LAGS + 1)
    for part in evidence.view_slices:
        kept = np.flatnonzero(close[part]) + part.start
        offset = fit.points[kept] - centre
        kept = kept[np.argsort(np.arctan2(offset[:, 1], offset[:, 0]), kind="stable")]
        step = np.linalg.norm(np.diff(fit.points[kept], axis=0), axis=1)
        if not len(step):
            continue
        # A gap in the contour breaks the chain: later points get another number.
        chain = np.concatenate([[0], np.cumsum(step > max(0.03, 4 * float(np.median(step))))])
        for lag in range(min(_MOST_LAGS + 1, len(kept))):
            same = chain[lag:] == chain[: len(kept) - lag]
            pairs = value[kept[lag:]] * value[kept[: len(kept) - lag]]
            product[lag] += pairs[same].sum()
            count[lag] += same.sum()
    correlation = product / np.maximum(count, 1)
    correlation /= max(float(correlation[0]), 1e-9)
    kappa = 1.0
    for lag in range(1, _MOST_LAGS + 1):
        if correlation[lag] < 0.05 or count[lag] < 20:
            break
        kappa += 2 * float(correlation[lag])
    least, most = _kappa_range(evidence)
    return Noise(near, far, float(np.clip(kappa, least, most)))


def _scatter(normalised: Floats) -> float:
    """Return the scatter of residuals in units of their sigma; 1 for too few residuals."""
    if len(normalised) < 30:
        return 1.0
    return float(np.clip(mad_sigma(normalised), 0.25, 5.0))


def _kappa_range(evidence: Evidence) -> tuple[float, float]:
    shortest, longest = evidence.correlation_px
    least = max(shortest / evidence.spacing_px, 1.0)
    return least, max(longest / evidence.spacing_px, least)


@dataclass(frozen=True)
class Criterion:
    """The Bayesian information criterion of a fit, in two parts; lower is better.

    - ``misfit``: robust squared residuals divided by kappa, plus the prior cost of the nuisances
    - ``penalty``: parameters times the logarithm of the effective count, plus the cost of cells
      that contradict the outline and of each symmetry that the shape breaks
    """

    misfit: float
    penalty: float

    def cost(self, dispersion: float = 1.0) -> float:
        """Return the criterion with the misfit divided by a dispersion.

        This is QBIC (Burnham and Anderson 2002, ch. 2.5).
        """
        return self.misfit / dispersion + self.penalty


def criterion(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> Criterion:
    """Return the criterion of a fit: its misfit and the penalty for its parameters."""
    effective = max(len(fit.distance) / fit.noise.kappa, 2.0)
    return Criterion(
        misfit=fit.data_cost / fit.noise.kappa + fit.prior_cost,
        penalty=len(fit.shape.parameters) * float(np.log(effective))
        + config.cell_cost * len(contradicting_cells(fit.shape.outline(), evidence, config))
        + config.symmetry_cost * fit.shape.record.broken_symmetries,
    )


def dispersion_of(fit: JointFit) -> float:
    """Return the scatter of the closest fit's points over their sigmas, at least 1.

    If no model fits the points within their sigmas, the misfit that all models share must not
    decide between them.
    """
    return max(fit.data_cost / max(len(fit.distance), 1), 1.0)


def contradicting_cells(outline: Floats, evidence: Evidence, config: SurfaceConfig) -> Floats:
    """Return the cells (n, 2) seen as top beyond the outline, or seen through within it."""
    margin = max(config.cell_margin, 2.0 * evidence.pose_sigma)
    region = shapely.Polygon(outline)
    shapely.prepare(region)
    # Most cells of the top lie inside, most others outside: their distances do not matter.
    outside = evidence.top[~shapely.contains_xy(region, evidence.top)]
    inside = evidence.free[shapely.contains_xy(region, evidence.free)]
    wrong = np.concatenate([outside, inside])
    is_far: Bools = ~shapely.dwithin(region.exterior, shapely.points(wrong), margin)
    return wrong[is_far]


def weights(costs: list[float]) -> list[float]:
    """Return posterior weights exp(-cost / 2), normalised."""
    array = np.array(costs)
    weight = np.exp(-(array - array.min()) / 2)
    return [float(w) for w in weight / weight.sum()]
