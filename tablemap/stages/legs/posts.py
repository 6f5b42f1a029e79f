"""Legs from the depth camera: all legs without a laser, else those that no scan could reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tablemap.config import SensorsConfig
from tablemap.geometry import Floats
from tablemap.model.shapes import CIRCLE, SQUARE
from tablemap.stages.legs.candidates import UNDER_ANOTHER, LegCandidate
from tablemap.stages.legs.clusters import persistence
from tablemap.stages.legs.depth import Post
from tablemap.stages.legs.ends import UpperEnd
from tablemap.stages.legs.evidence import STOP_POSITION_SIGMA
from tablemap.stages.legs.fit import Fit, Priors, criterion, fit_alone
from tablemap.stages.legs.layout import Frame, symmetric_sets
from tablemap.stages.legs.result import Leg, RejectedCluster
from tablemap.stages.legs.scans import Scans
from tablemap.stages.legs.shapes import measured_leg

DEPTH_SYMMETRY = 0.05
"""Legs that depth placed are partners if nearer than this to each other's mirror image, metres."""
_WIDER = 1.5  # times a silhouette's error, that of a size between two silhouettes


@dataclass(frozen=True, eq=False)
class _Fitted:
    post: Post
    fit: Fit
    place: Floats


def accept_posts(
    posts: list[Post],
    legs: list[Leg],
    candidates: list[LegCandidate],
    scans: Scans | None,
    end_of: Callable[[Floats, float], UpperEnd],
    frame: Frame,
    *,
    sensors: SensorsConfig,
) -> tuple[list[Leg], list[RejectedCluster]]:
    """Return the posts that are new legs, and the rejected ones with their reasons.

    ``end_of`` returns what the views saw of the upper end of a thing at a place, of a radius.
    """
    taken = [np.array([leg.x, leg.y]) for leg in legs]
    taken += [candidate.place for candidate in candidates if not candidate.is_open]
    fitted: list[_Fitted] = []
    refused: list[RejectedCluster] = []
    for post in posts:
        if any(np.linalg.norm(post.centre - place) < 0.06 + 0.5 * post.size for place in taken):
            continue
        if post.reason is not None:
            refused.append(_refused(post, post.reason))
            continue
        fit = _fitted(post, frame, sensors)
        place = fit.parameters[0, :2]
        if np.linalg.norm(place - post.centre) > 0.5 * post.size + 0.04:
            refused.append(_refused(post, "its views do not agree on a place"))
            continue
        if scans is not None:
            seen = persistence(scans, place, 0.5 * float(fit.parameters[0, 2]))
            if seen.passed >= max(1, seen.hit + seen.lost):
                refused.append(_refused(post, "the laser saw free space at its foot"))
                continue
        end = end_of(place, 0.5 * float(fit.parameters[0, 2]))
        if end.is_below:
            refused.append(_refused(post, f"does not reach the top: {end}"))
            continue
        fitted.append(_Fitted(post, fit, place))
    fitted, doubles = _without_doubles(fitted)
    refused += doubles
    places = np.array([f.place for f in fitted] + [[leg.x, leg.y] for leg in legs]).reshape(-1, 2)
    sets = symmetric_sets(frame, places, DEPTH_SYMMETRY)
    partners = {i for members, _ in sets for i in members}
    silhouette = sensors.depth_silhouette_sigma
    found = []
    for i, one in enumerate(fitted):
        corner, central = frame.near_corner(one.place), frame.is_central(one.place)
        if frame.is_beside(one.place):
            refused.append(_refused(one.post, UNDER_ANOTHER))
        elif frame.inset(one.place) < -0.03:
            refused.append(_refused(one.post, "stands beyond the top"))
        elif one.post.views < 2 and i not in partners:
            refused.append(_refused(one.post, "depth saw it from one view alone"))
        elif central or (corner and i in partners):
            found.append(
                measured_leg(
                    one.fit,
                    0,
                    points=one.post.points[:, :2],
                    views=one.post.views,
                    systematic=silhouette,
                    # A depth camera makes all silhouettes wider: this error does not average out.
                    size_systematic=_WIDER * silhouette,
                    seen_by="depth",
                )
            )
        elif not corner:
            refused.append(_refused(one.post, "depth alone saw it, off corners and middle"))
        else:
            refused.append(_refused(one.post, "depth alone saw it, and it has no mirror image"))
    return found, refused


def _without_doubles(fitted: list[_Fitted]) -> tuple[list[_Fitted], list[RejectedCluster]]:
    """Reject posts that overlap a post with more evidence: they are pieces of the same thing."""
    kept: list[_Fitted] = []
    refused: list[RejectedCluster] = []
    for one in sorted(fitted, key=lambda f: len(f.post.evidence.sigma), reverse=True):
        reach = [0.5 * (_size(one) + _size(other)) + 0.01 for other in kept]
        apart = [np.linalg.norm(one.place - other.place) for other in kept]
        if any(a < r for a, r in zip(apart, reach, strict=True)):
            refused.append(_refused(one.post, "a fragment of the post beside it"))
        else:
            kept.append(one)
    return kept, refused


def _size(one: _Fitted) -> float:
    return float(one.fit.parameters[0, 2])


def _refused(post: Post, reason: str) -> RejectedCluster:
    return RejectedCluster(float(post.centre[0]), float(post.centre[1]), post.points, reason)


def _fitted(post: Post, frame: Frame, sensors: SensorsConfig) -> Fit:
    priors = Priors(None, (0.0, 1e-6), (0.0, sensors.depth_silhouette_sigma))
    evidence = replace(post.evidence, sigma=np.hypot(post.evidence.sigma, STOP_POSITION_SIGMA))
    yaw = frame.surface.pose.yaw
    fits = [
        fit_alone(kind, evidence, post.centre, post.size, yaw, priors=priors)
        for kind in (CIRCLE, SQUARE)
    ]
    return min(fits, key=criterion)
