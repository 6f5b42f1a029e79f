"""How far the depth's scale is known: the floor's word, and that of the stops' distances.

The floor gives the scale away only as well as the camera's height in TF is right. On most robots
that is a millimetre; on some it is several. Seen from opposite stops, whose distance the laser
measured, an edge lies in two places where the scale is wrong: that tells which robot this is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from tablemap.config import SensorsConfig, SurfaceConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.outline import Outline
from tablemap.stages.surface.candidates import Candidate
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import fit_jointly, spread_of
from tablemap.stages.surface.nuisances import CommonNuisances


@dataclass(frozen=True)
class ScaleBelief:
    """The depth scale less one that the calibration left, as a share: ``value`` and ``sigma``.

    ``by_edges`` and ``by_edges_sigma`` are what edges and stops say alone; ``doubt`` is the
    posterior weight of a camera height that is wrong in TF.
    """

    value: float
    sigma: float
    by_edges: float
    by_edges_sigma: float
    doubt: float


def settle_scale(
    candidate: Candidate,
    outline: Outline,
    evidence: Evidence,
    config: SurfaceConfig,
    sensors: SensorsConfig,
) -> tuple[Candidate, ScaleBelief]:
    """Fit a candidate again at the scale that all say together, its spread widened by what is open.

    The prior is a mixture: with the weight ``sensors.camera_height_trusted`` the camera's
    height is right to a millimetre, else within what the calibration allows. An estimate moves
    little for weak evidence, and its sigma admits both.
    """
    trusting = CommonNuisances.unpack(evidence.common_sigma).scale
    wide = trusting if outline.scale is None else max(outline.scale.sigma, trusting)
    open_prior = _with_prior(evidence, 0.0, max(wide, _LOOSE * trusting))
    gates = (config.loss_sigmas,)
    fit = candidate.fit

    def again(prior: Evidence, start: Candidate) -> Candidate:
        refit = fit_jointly(
            start.fit.state,
            prior,
            config,
            gates=gates,
            iterations=8,
            anchors=fit.anchors,
            noise=fit.noise,
        )
        return replace(start, fit=refit, spread=spread_of(refit, prior, config))

    loose = again(open_prior, candidate)
    belief = believe(
        loose.fit.nuisances.scale,
        loose.spread.scale_sigma,
        under=CommonNuisances.unpack(open_prior.common_sigma).scale,
        trusting=trusting,
        wide=wide,
        trusted=sensors.camera_height_trusted,
    )
    settled = again(_with_prior(evidence, belief.value, 1e-6), loose)
    lever = loose.spread.by_scale
    covariance = settled.spread.covariance + belief.sigma**2 * np.outer(lever, lever)
    spread = replace(settled.spread, covariance=covariance, scale_sigma=belief.sigma)
    return replace(settled, spread=spread), belief


# The prior under which the edges are asked alone is at least so many times as wide as the narrow.
_LOOSE = 2.0


def _with_prior(evidence: Evidence, mean: float, sigma: float) -> Evidence:
    means = replace(CommonNuisances.unpack(evidence.common_mean), scale=mean)
    sigmas = replace(CommonNuisances.unpack(evidence.common_sigma), scale=sigma)
    return replace(evidence, common_mean=means.pack(), common_sigma=sigmas.pack())


def believe(
    mean: float,
    posterior: float,
    *,
    under: float,
    trusting: float,
    wide: float,
    trusted: float,
) -> ScaleBelief:
    """Take the prior ``under`` which a fit found ``mean`` out of its posterior, and a mixture in.

    ``trusting`` and ``wide`` are the mixture's standard deviations, if TF is right and if not;
    ``trusted`` is the weight of the first. A
    mixture has wider tails than a normal distribution of its variance: ``sigma`` is what makes the
    95 % interval right.
    """
    precision = max(posterior**-2.0 - under**-2.0, 1e-3 * under**-2.0)
    by_edges, variance = mean / (precision * posterior**2), 1 / precision
    priors = np.array([trusting, wide]) ** 2
    share = np.array([trusted, 1 - trusted])
    likelihood = np.exp(-0.5 * by_edges**2 / (priors + variance)) / np.sqrt(priors + variance)
    weight = share * likelihood
    weight = weight / weight.sum() if weight.sum() > 0 else np.array([0.0, 1.0])
    means = by_edges * priors / (priors + variance)
    variances = priors * variance / (priors + variance)
    value = float(weight @ means)
    sigma = _interval(weight, means - value, np.sqrt(variances)) / norm.ppf(0.975)
    return ScaleBelief(value, sigma, by_edges, float(np.sqrt(variance)), float(weight[1]))


def _interval(weight: Floats, offset: Floats, sigma: Floats) -> float:
    """Return the half width about 0 of the interval that holds 95 % of a mixture of normals."""

    def short(half: float) -> float:
        inside = norm.cdf((half - offset) / sigma) - norm.cdf((-half - offset) / sigma)
        return float(weight @ inside) - 0.95

    return float(brentq(short, 0.0, float(np.max(np.abs(offset) + 5 * sigma)), xtol=1e-9))


def scale_warning(
    belief: ScaleBelief, outline: Outline, config: SurfaceConfig
) -> list[ProcessWarning]:
    """Say so where edges and stops doubt the camera's height in TF."""
    if belief.doubt < config.doubted_height or outline.scale is None:
        return []
    message = (
        f"Seen from opposite stops the table's edges ask for {1 + belief.by_edges:.4f} times the "
        f"depths that the floor asks for (sigma {belief.by_edges_sigma:.4f}), and "
        f"{1 + belief.value:.4f} was taken. The camera's height in TF may be millimetres wrong, or "
        "the laser's ranges."
    )
    return [ProcessWarning("surface.depth_scale", "surface", message)]
