"""The final primitives of the accepted legs: one joint fit, and one size for similar legs."""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from tablemap.config import SensorsConfig
from tablemap.geometry import Floats, wrap_angles
from tablemap.model.shapes import CIRCLE, RECTANGLE, SQUARE, ShapeRecord
from tablemap.robust import reduced_chi_square
from tablemap.stages.legs.candidates import LegCandidate
from tablemap.stages.legs.evidence import LegEvidence
from tablemap.stages.legs.fit import Fit, Priors, criterion, fit_shapes
from tablemap.stages.legs.layout import Frame
from tablemap.stages.legs.primitives import described, has_yaw, sizes_of
from tablemap.stages.legs.result import Leg, SeenBy
from tablemap.stages.legs.scans import Scans
from tablemap.stages.registration import Registration
from tablemap.stages.surface import FittedFigure

_YAW_SIGMA = np.radians(2.0)
_SIZE_SYSTEMATIC = 0.0003  # metres: error of a leg's size that no residual shows
# Common pose error of all scans of one drive: the odometry was bent to the stops at its ends.
_DRIVE_POSITION_SIGMA = 0.006  # metres
_DRIVE_YAW_SIGMA = 0.003  # radians
_POSE_FLOOR = 0.0001  # metres added to a stop's sigma, so that its covariance has an inverse
_ELONGATED = 1.25
_RARE = 6.0
_TELLING = 30  # fewest residuals from which a spread is measured
_LEAST = 0.2  # of an assumed sigma: equal residuals must not make it zero
_THIN, _PANEL = 0.1, 0.35  # metres: a panel is thinner and longer
_LONG = 3.0  # times the larger side of a usual leg: a panel is longer than that, too
LARGEST_SIGMA = 0.025
"""A thing whose place is less sure than this is no measured leg, metres."""


@dataclass(frozen=True, eq=False)
class Refined:
    """The legs that the laser measured, and what all of them share.

    - ``legs``: those whose place is known
    - ``unsure``: the candidates whose place is not, with their reason
    - ``beam_half_width``, ``range_bias``: radians and metres, of the laser; None without legs
    """

    legs: list[Leg]
    unsure: list[LegCandidate]
    beam_half_width: float | None
    range_bias: float | None


def refine(
    accepted: list[LegCandidate],
    scans: Scans | None,
    registration: Registration,
    frame: Frame,
    *,
    sensors: SensorsConfig,
) -> Refined:
    """Fit the legs together.

    Legs whose own sizes agree get one shape and one size, as legs of a table are made alike. One
    whose place stays unsure is none.
    """
    if scans is None or not accepted:
        return Refined([], [], None, None)
    covariance = _pose_covariance(scans, registration)
    information = np.linalg.inv(covariance).astype(np.float64)
    fitted: list[list[Leg]] = []
    beam = bias = None
    groups = _alike(accepted)
    for group in groups:
        evidence = [c.evidence for c in group if c.evidence is not None]
        rough = _best(group, evidence, (group[0].kind,), information, frame, sensors)
        evidence = _weighted(evidence, rough, scans)
        fit = _best(group, evidence, tuple(group[0].fits), information, frame, sensors)
        fitted.append(
            [
                measured_leg(
                    fit,
                    i,
                    points=candidate.points,
                    views=seen.stops,
                    systematic=_systematic(candidate, registration, frame, sensors),
                    size_systematic=_SIZE_SYSTEMATIC,
                    seen_by="laser",
                )
                for i, (candidate, seen) in enumerate(zip(group, evidence, strict=True))
            ]
        )
        if beam is None:
            beam, bias = fit.beam_half_width, fit.range_bias
    legs: list[Leg] = []
    unsure: list[LegCandidate] = []
    # Those that are alike come first: the first leg is the pattern of one that is inferred.
    usual = max(range(len(groups)), key=lambda k: len(groups[k]))
    order = sorted(range(len(groups)), key=lambda k: k != usual)
    members = [candidate for k in order for candidate in groups[k]]
    # A column in the middle differs by design; so do two that are alike and seen from all sides.
    by_design: set[Leg] = set()
    for candidates, fits in zip(groups, fitted, strict=True):
        whole = len(fits) > 1 and all(_is_seen_all_round(each) for each in candidates)
        middle = [frame.is_central(np.array([leg.x, leg.y])) for leg in fits]
        by_design |= {
            leg for leg, is_column in zip(fits, middle, strict=True) if whole or is_column
        }
    placed = seen_in_part([fitted[k] for k in order], by_design)
    for candidate, leg in zip(members, placed, strict=True):
        sigma = leg.position_sigma
        if sigma is not None and sigma <= LARGEST_SIGMA:
            legs.append(leg)
            continue
        size = " by ".join(f"{100 * side:.0f} cm" for side in _sizes(leg))
        known = "not known" if sigma is None else f"known to {100 * sigma:.0f} cm only"
        reason = f"{size}, unlike the other legs: its place is {known}"
        unsure.append(replace(candidate, reason=reason, is_open=True))
    return Refined(legs, unsure, beam, bias)


def seen_in_part(groups: list[list[Leg]], by_design: AbstractSet[Leg] = frozenset()) -> list[Leg]:
    """Widen the places of legs that differ in size from at least two that are alike.

    Legs of a table are made alike: one that differs was probably seen in part, as beside a wall.
    Then its middle may be off by half of what was not seen. A panel is not made like the legs, nor
    are those that differ ``by_design``. The legs come out in their order.
    """
    usual = max(groups, key=len)
    if len(usual) < 2:
        return [leg for group in groups for leg in group]
    legs: list[Leg] = []
    for group in groups:
        for leg in group:
            hidden = max(abs(end(_sizes(leg)) - end(_sizes(usual[0]))) for end in (min, max))
            own = leg.position_sigma
            other = leg in by_design or _is_panel(leg, usual[0])
            if group is not usual and own is not None and not other:
                leg = replace(leg, position_sigma=float(np.hypot(own, hidden / 2)))
            legs.append(leg)
    return legs


def _is_seen_all_round(candidate: LegCandidate) -> bool:
    """Tell whether no quarter of a thing's silhouettes is missing, as of one beside a wall."""
    if candidate.evidence is None or not len(candidate.evidence.normal):
        return False
    x, y = candidate.evidence.normal.T
    sides = np.sort(np.arctan2(y, x))
    gaps = np.diff(np.append(sides, sides[0] + 2 * np.pi))
    return bool(gaps.max() < np.pi / 2)


def _is_panel(leg: Leg, usual: Leg) -> bool:
    """Tell whether a leg is a panel: thin, long, and far longer than the usual legs."""
    short, long = min(_sizes(leg)), max(_sizes(leg))
    return short < _THIN and long > max(_PANEL, _LONG * max(short, *_sizes(usual)))


def _sizes(leg: Leg) -> list[float]:
    return [figure.value for figure in leg.dimensions.values()]


def _pose_covariance(scans: Scans, registration: Registration) -> Floats:
    """Return (3G, 3G) of the groups' poses: the registration's for stops, loose ones for drives."""
    drive = np.diag(np.square([_DRIVE_POSITION_SIGMA] * 2 + [_DRIVE_YAW_SIGMA]))
    covariance: Floats = block_diag(*[drive] * len(scans.group_stops))
    stops = np.flatnonzero(scans.group_stops >= 0)
    ours = (3 * stops[:, None] + np.arange(3)).ravel()
    theirs = (3 * scans.group_stops[stops][:, None] + np.arange(3)).ravel()
    known = registration.covariance[np.ix_(theirs, theirs)]
    if np.isfinite(known).all():
        covariance[np.ix_(ours, ours)] = 0.5 * (known + known.T)
    # The relative covariance has no inverse, as the mean pose is fixed.
    floor = np.tile([_POSE_FLOOR**2] * 2 + [(0.3 * _POSE_FLOOR) ** 2], len(stops))
    covariance[ours, ours] += floor
    return covariance


def _alike(accepted: list[LegCandidate]) -> list[list[LegCandidate]]:
    """Group candidates whose own sizes agree."""
    groups: list[list[LegCandidate]] = []
    for candidate in sorted(accepted, key=lambda c: -len(c.evidence.sigma) if c.evidence else 0):
        size, sigma = _diameter(candidate)
        for group in groups:
            other, other_sigma = _diameter(group[0])
            allowed = 3.0 * np.hypot(sigma, other_sigma) + 0.002 + 0.05 * size
            same = group[0].cluster.slender == candidate.cluster.slender
            if same and abs(size - other) < allowed:
                group.append(candidate)
                break
        else:
            groups.append([candidate])
    return groups


def _diameter(candidate: LegCandidate) -> tuple[float, float]:
    kind = CIRCLE if CIRCLE in candidate.fits else RECTANGLE
    fit = candidate.fits[kind]
    return float(fit.parameters[0, 2]), float(np.sqrt(fit.covariance[0, 2, 2]))


def _weighted(evidence: list[LegEvidence], fit: Fit, scans: Scans) -> list[LegEvidence]:
    """Return the evidence with sigmas scaled to the residuals, separately for stops and drives.

    The sigma of a tangent was assumed, from the beams' spacing, their spot and the interpolation of
    the drive. Hundreds of residuals measure it better. Depths that the shape cannot explain have no
    residual, so that all depths get one common factor.
    """
    moving = scans.group_stops < 0
    factor = np.ones((2, 2))
    for row, drives in enumerate((False, True)):
        tangents = np.concatenate(
            [m[0][moving[e.group] == drives] for e, m in zip(evidence, fit.misfits, strict=True)]
        )
        if len(tangents) >= _TELLING:
            factor[row, 0] = _robust_scale(tangents)
    depths = np.concatenate([depth for _, depth in fit.misfits])
    if len(depths) >= _TELLING:
        factor[:, 1] = _robust_scale(depths)
    return [
        replace(
            e,
            sigma=e.sigma * factor[moving[e.group].astype(np.int64), 0],
            hit_sigma=e.hit_sigma * factor[moving[e.hit_group].astype(np.int64), 1],
        )
        for e in evidence
    ]


def _robust_scale(misfit: Floats) -> float:
    return max(float(np.sqrt(reduced_chi_square(misfit**2))), _LEAST)


def _best(
    group: list[LegCandidate],
    evidence: list[LegEvidence],
    kinds: tuple[ShapeRecord, ...],
    information: Floats,
    frame: Frame,
    sensors: SensorsConfig,
) -> Fit:
    """Fit all ``kinds`` to a group of similar legs and take the one with the best criterion."""
    fits = []
    for kind in kinds:
        start = np.stack([c.fits[kind].parameters[0] for c in group])
        if kind is RECTANGLE:
            start = _ordered(start)
        sigma = np.array([np.sqrt(c.fits[kind].covariance[0, -1, -1]) for c in group])
        yaw = None
        if has_yaw(kind) and not frame.record.is_round:
            axis = frame.surface.pose.yaw
            off = np.abs(wrap_angles(start[:, -1] - axis, np.pi / 2))
            if (off < 3.0 * np.hypot(sigma, _YAW_SIGMA)).all():
                yaw = (axis, _YAW_SIGMA)
                if kind is SQUARE:
                    start[:, -1] = axis
        priors = Priors(
            information,
            (sensors.laser_beam_half_width, sensors.laser_beam_half_width_sigma),
            (0.0, sensors.laser_range_bias_sigma),
            yaw,
        )
        middle = start.copy()
        sizes = sizes_of(kind)
        middle[:, sizes] = np.median(start[:, sizes], axis=0)
        fits.append(fit_shapes(kind, evidence, middle, priors=priors, tied=True))
    return min(fits, key=_doubted)


def _doubted(fit: Fit) -> float:
    """Return the criterion, with a penalty for nearly square rectangles: such legs are rare."""
    if fit.kind is not RECTANGLE:
        return criterion(fit)
    long, short = np.max(fit.parameters[0, 2:4]), np.min(fit.parameters[0, 2:4])
    return criterion(fit) + (_RARE if long < _ELONGATED * short else 0.0)


def _ordered(values: Floats) -> Floats:
    """Return (K, 5) rectangles with the length first.

    If this is not clear, length and width follow the directions of the first leg's sides.
    """
    ordered = values.copy()
    swapped = values[:, [0, 1, 3, 2, 4]] + [0, 0, 0, 0, np.pi / 2]
    clear = np.max(values[:, 2:4], axis=1) > _ELONGATED * np.min(values[:, 2:4], axis=1)
    ordered[values[:, 3] > values[:, 2]] = swapped[values[:, 3] > values[:, 2]]
    quarter = np.round((ordered[:, 4] - ordered[0, 4]) / (np.pi / 2)).astype(np.int64) % 2 == 1
    unclear = quarter & ~clear
    ordered[unclear] = ordered[unclear][:, [0, 1, 3, 2, 4]] - [0, 0, 0, 0, np.pi / 2]
    return ordered


def _systematic(
    candidate: LegCandidate, registration: Registration, frame: Frame, sensors: SensorsConfig
) -> float:
    """Return the systematic error of a leg's place against the table, metres.

    If scans placed the stops, a wrong mount of the laser cancels, as the same scans see the legs.
    Then only a wrong range scale is left: it stretches the legs about the table's middle. Poses
    from elsewhere add their whole systematic error.
    """
    if registration.source != "laser":
        return registration.systematic
    middle = frame.surface.pose.translation
    return sensors.laser_range_scale_sigma * float(np.linalg.norm(candidate.place - middle))


def measured_leg(
    fit: Fit,
    row: int,
    *,
    points: Floats,
    views: int,
    systematic: float,
    size_systematic: float,
    seen_by: SeenBy,
) -> Leg:
    """Return the leg that row ``row`` of a fit describes.

    ``points`` (n, 2) are its evidence in the map, ``views`` the stops and drives that saw it.
    ``systematic`` and ``size_systematic`` (metres) are what no residual shows of place and size.
    """
    values = fit.parameters[row]
    sigma = np.sqrt(np.maximum(np.diag(fit.covariance[row]), 0.0))
    place = float(np.sqrt(0.5 * (sigma[0] ** 2 + sigma[1] ** 2) + systematic**2))
    shape, yaw, sides = described(fit.kind, values)
    return Leg(
        shape=shape,
        x=float(values[0]),
        y=float(values[1]),
        yaw=yaw,
        status="measured",
        position_sigma=place,
        dimensions={
            name: FittedFigure(float(values[i]), float(np.hypot(sigma[i], size_systematic)))
            for name, i in sides.items()
        },
        points=points,
        views=views,
        seen_by=seen_by,
        scale_sigma=systematic if seen_by == "laser" else 0.0,
    )
