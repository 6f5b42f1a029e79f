"""Comparison of camera and laser: it shows an error of their relative mounting.

The laser places the robot, and the camera sees the table. If the recorded frames have the camera
(or the laser) in a wrong place, an edge of the top seen from two sides lies in two places, and the
camera sees the legs elsewhere than the laser. No residual of the registration shows this.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import CrossCheckConfig, SensorsConfig
from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats
from tablemap.stages.crosscheck.change import moved_on_the_way
from tablemap.stages.crosscheck.edges import edge_rows
from tablemap.stages.crosscheck.result import CrossCheck, Estimate
from tablemap.stages.crosscheck.rows import Rows, together
from tablemap.stages.crosscheck.scale import scale_excess, wrong_scale
from tablemap.stages.crosscheck.sightings import leg_rows
from tablemap.stages.crosscheck.solve import MountingSolution, prior_sigmas, solve
from tablemap.stages.legs import Leg
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration
from tablemap.stages.snapshots import Snapshot, turned_left
from tablemap.stages.surface import Mounting, Surface

_LEAST_SIGHTINGS = 4  # fewest sightings of legs, over all views
_LARGEST_SIGMA = 0.004  # metres at the table: what is less certain, and not clear, does not count


@dataclass(frozen=True)
class _Arms:
    """Distances ahead from camera and from base to the table, metres, medians of the views."""

    ahead: float
    reach: float

    def at_table(self, solution: MountingSolution) -> tuple[Floats, Floats]:
        """Return the effect of an offset at the table, forward and leftward, and its sigmas."""
        effect = np.array([[1.0, 0.0, 0.0, -self.reach], [0.0, 1.0, self.ahead, 0.0]])
        sigma = np.sqrt(np.diag(effect @ solution.covariance @ effect.T))
        return effect @ solution.asked, sigma


def cross_check(
    outline: Outline,
    surface: Surface,
    registration: Registration,
    legs: tuple[Leg, ...] = (),
    snapshots: tuple[Snapshot, ...] = (),
    *,
    config: CrossCheckConfig,
    sensors: SensorsConfig,
) -> CrossCheck:
    """Estimate the camera's offset against the laser from edges and legs in all views.

    Without laser poses or enough views around the table there is no result and no warning. A head
    that turns gives none either, as the offset is then not constant in the base.
    """
    if registration.source != "laser" or _has_turned(snapshots):
        return _nothing(0, 0, 0)
    views = [v for v in outline.views if registration.used[v.index]]
    edges = edge_rows(views, surface, registration)
    if edges is not None and len(np.unique(edges.view)) < config.minimum_views:
        edges = None
    sighted, sightings = leg_rows(snapshots, registration, legs, surface.height.value)
    if sighted is not None and sightings < _LEAST_SIGHTINGS:
        sighted, sightings = None, 0
    parts = [rows for rows in (edges, sighted) if rows is not None]
    if not parts:
        return _nothing(0, len(views), sightings)
    rows = together(parts)
    # At a dull rim far edges end early: this looks like a camera too far back.
    set_back = sensors.rim_set_back if outline.is_dull else 0.0
    far = float(np.hypot(sensors.edge_bias_sigma, set_back))

    tilts = np.full(2, np.deg2rad(sensors.camera_tilt_sigma_deg))
    if outline.camera is not None:
        tilts = np.sqrt(np.diag(outline.camera.covariance)[2:])

    def solved(rows: Rows) -> MountingSolution:
        return solve(rows, registration.covariance, tilts, far, sensors)

    arms = _arms(rows)
    solution = solved(rows)
    told_by_edges = None if edges is None else solved(edges)
    told_by_legs = None if sighted is None else solved(sighted)
    mounting: Mounting | None = None
    beside: tuple[ProcessWarning, ...] = ()
    changed: tuple[ProcessWarning, ...] = ()
    if sighted is not None and told_by_legs is not None:
        mounting = _mounting(told_by_legs, _arms(sighted), sensors)
        beside = _beside(told_by_legs, sensors)
        changed = moved_on_the_way(sighted)
    by_edges, by_legs = (
        None if part is None else Estimate(*arms.at_table(part))
        for part in (told_by_edges, told_by_legs)
    )
    at_table, sigma = arms.at_table(solution)
    # If the two kinds of evidence disagree, both are less certain than their sigmas.
    sigma = sigma * _disagreement(by_edges, by_legs)
    points = 0 if edges is None else len(edges)
    count = len(np.unique(rows.view))
    # A camera that moved on the way fits no one offset, and its scale tells nothing then.
    changed = changed or wrong_scale(solution, sensors)
    off_scale = scale_excess(solution)
    clear = np.abs(at_table) > np.maximum(config.sigmas * sigma, 0.5 * config.threshold)
    known = clear | (sigma <= _LARGEST_SIGMA)
    if not known.any():
        return replace(
            _nothing(points, count, sightings, mounting),
            warnings=(*beside, *changed),
            scale_excess=off_scale,
        )
    size = float(np.hypot(*np.where(known, at_table, 0.0)))
    found = size > config.threshold and bool(clear.any())
    scale, scale_sigma = solution.range_scale
    told = scale_sigma < 0.5 * sensors.laser_range_scale_sigma_wide
    return CrossCheck(
        offset=solution.asked[:3] * known[[0, 1, 1]],
        covariance=solution.covariance[:3, :3],
        at_table=at_table,
        at_table_sigma=sigma,
        # It is unknown which sensor is off: half of the offset is the laser's, plus or minus half.
        pose_sigma=0.5 * size if found else 0.0,
        points=points,
        views=count,
        warnings=(
            (
                _warning(at_table, sigma, solution, arms, sightings, told),
                *_unbelieved(size, sightings, sensors),
                *changed,
            )
            if found
            else (*beside, *changed)
        ),
        range_scale=scale if told else None,
        range_scale_sigma=scale_sigma if told else None,
        by_edges=by_edges,
        by_legs=by_legs,
        excess=_excess(solution, sensors) if found else 1.0,
        sightings=sightings,
        mounting=mounting,
        scale_excess=off_scale,
    )


def _mounting(by_legs: MountingSolution, arms: _Arms, sensors: SensorsConfig) -> Mounting:
    """Take the loose prior out of what the legs say of the camera in the base."""
    posterior = np.linalg.inv(by_legs.covariance + np.diag(_LEG_SYSTEMATIC**2))
    information = posterior - np.diag(prior_sigmas(sensors) ** -2.0)
    values, vectors = np.linalg.eigh((information + information.T) / 2)
    return Mounting(
        information=vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T,
        estimate=posterior @ by_legs.asked,
        ahead=arms.ahead,
        widening=by_legs.widening,
    )


# Metres, metres, radians, share: no residual tells it.
_LEG_SYSTEMATIC = np.array([0.001, 0.001, 0.0005, 0.0])


def _has_turned(snapshots: tuple[Snapshot, ...]) -> bool:
    mounts = [snapshot.base_from_camera for snapshot in snapshots]
    return bool(mounts) and bool(turned_left(np.stack(mounts)).any())


def _nothing(
    points: int, views: int, sightings: int, mounting: Mounting | None = None
) -> CrossCheck:
    return CrossCheck(
        None, None, None, None, 0.0, points, views, (), sightings=sightings, mounting=mounting
    )


def _arms(rows: Rows) -> _Arms:
    return _Arms(
        ahead=float(np.median(np.einsum("ij,ij->i", rows.ray, rows.forward))),
        reach=float(np.median(-np.einsum("ij,ij->i", rows.stretch, rows.forward))),
    )


def _disagreement(first: Estimate | None, second: Estimate | None) -> float:
    """Return the difference of two estimates over its expected size, at least 1."""
    if first is None or second is None:
        return 1.0
    apart = (first.at_table - second.at_table) ** 2 / (first.sigma**2 + second.sigma**2)
    return max(1.0, float(np.sqrt(apart.mean())))


def _assumed(sensors: SensorsConfig) -> Floats:
    """Return what is believed of place, heading and range scale (4,), standard deviations."""
    place, heading = sensors.laser_mounting_sigma, sensors.laser_mounting_yaw_sigma
    return np.array([place, place, heading, sensors.laser_range_scale_sigma_wide])


def _excess(solution: MountingSolution, sensors: SensorsConfig) -> float:
    """Return the ratio of mounting and scale errors to their assumed sigmas (Birge's ratio)."""
    let_in = np.diag(prior_sigmas(sensors) ** -2.0)
    likelihood = np.linalg.inv(solution.covariance) - let_in
    values, vectors = np.linalg.eigh((likelihood + likelihood.T) / 2)
    # Information and mean of the evidence alone, without the loose prior.
    seen = vectors @ np.diag(np.maximum(values, 1e-12)) @ vectors.T
    mean = np.linalg.solve(seen, np.linalg.solve(solution.covariance, solution.asked))
    spread = np.linalg.inv(seen) + np.diag(_assumed(sensors) ** 2)
    return max(1.0, float(np.sqrt(mean @ np.linalg.solve(spread, mean) / len(mean))))


def _beside(by_legs: MountingSolution, sensors: SensorsConfig) -> tuple[ProcessWarning, ...]:
    """Say that the camera is clearly beside its place in TF, though little may show at the table.

    A shift to the left and a turn to the right cancel there, as late stamps on a round make them.
    """
    believed = _assumed(sensors)[:3]
    sigma = np.sqrt(np.diag(by_legs.covariance)[:3])
    clear = np.abs(by_legs.asked[:3]) > np.maximum(_BESIDE * believed, 4.0 * sigma)
    if not (clear & (sigma < believed)).any():
        return ()
    forward, left, turn = by_legs.asked[:3]
    message = (
        "camera and laser disagree on where the legs are: they agree if the camera is moved by "
        f"{1e3 * abs(forward):.0f} mm {'forward' if forward > 0 else 'back'} and "
        f"{1e3 * abs(left):.0f} mm to the {'left' if left > 0 else 'right'} of its place in TF, "
        f"and turned by {abs(np.degrees(turn)):.1f} degrees to the "
        f"{'left' if turn > 0 else 'right'}; the surface was fitted with that. Either TF has a "
        "wrong pose of one of them, or their clocks differ and the robot did not stand still."
    )
    return (ProcessWarning("crosscheck.mounting", "crosscheck", message),)


_BESIDE = 4.0  # times what is believed


def _unbelieved(size: float, sightings: int, sensors: SensorsConfig) -> tuple[ProcessWarning, ...]:
    """Doubt an offset of centimetres (``size``, metres) that edges alone show.

    Where the depth of near edges errs otherwise than that of far ones, as on a polished top that
    mirrors the room, the edges fit together as those of a camera in another place do.
    """
    if sightings or size <= _UNBELIEVED * sensors.laser_mounting_sigma:
        return ()
    message = (
        "The edges fit together only if the camera sits "
        f"{100 * size:.1f} cm beside its place in TF, and the camera saw no legs that confirm it. "
        "Either TF is wrong by so much, or the depth at the edges errs, as on a polished top that "
        "mirrors the room; lay paper or a cloth along the edges and record again."
    )
    return (ProcessWarning("accuracy.views_disagree", "crosscheck", message),)


_UNBELIEVED = 8.0  # times what is believed


def _warning(
    at_table: Floats,
    sigma: Floats,
    solution: MountingSolution,
    arms: _Arms,
    sightings: int,
    told: bool,
) -> ProcessWarning:
    forward, left = 1e3 * at_table
    seen = "edges and legs" if sightings else "edges"
    message = (
        f"camera and laser disagree: the table's {seen}, seen from different sides, fit together "
        f"if what the camera sees at the table lies {abs(forward):.0f} mm further "
        f"{'forward' if forward > 0 else 'back'} and {abs(left):.0f} mm further "
        f"{'left' if left > 0 else 'right'} (sigmas {1e3 * sigma[0]:.1f} and "
        f"{1e3 * sigma[1]:.1f} mm), with a turn of {abs(np.degrees(solution.asked[2])):.1f} "
        "degrees. TF has a wrong pose of the camera or the laser"
    )
    if told and abs(solution.asked[3]) > 2.0 * np.sqrt(solution.covariance[3, 3]):
        longer = "long" if solution.asked[3] < 0 else "short"
        message += (
            f"; besides, the laser's ranges are {1e3 * abs(solution.asked[3]):.1f} permil too "
            f"{longer} for the camera's depth"
        )
    elif abs(forward) > 3.0 and abs(forward) / arms.reach < 10.0 and not told:
        message += f", or the laser's ranges are {abs(forward) / arms.reach:.0f} permil off"
    return ProcessWarning("crosscheck.mounting", "crosscheck", message + "; calibrate them.")
