"""Which corners of a fitted shape seem to be cut off, and by how much."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tablemap.config import SurfaceConfig
from tablemap.geometry import Floats, wrap_angles
from tablemap.stages.surface.choice import estimate_noise
from tablemap.stages.surface.evidence import Evidence
from tablemap.stages.surface.joint import JointFit
from tablemap.stages.surface.residuals import Noise, robust
from tablemap.stages.surface.shapes.chamfered import Chamfered
from tablemap.stages.surface.shapes.rounded import Rounded
from tablemap.stages.surface.shapes.shape import unit
from tablemap.stages.surface.shapes.straight import Sided

_SIZES = 0.015 * 1.15 ** np.arange(20)  # metres, of the cuts that are tried
_ABOUT = 0.08  # metres past the largest cut: these points of both sides count too
_FAR = 2.0  # metres along both sides
_TURNS = np.deg2rad(40.0), np.deg2rad(140.0)  # of the outline at a corner that may be cut
_GAIN = 4.0  # of all corners, in units of the criterion: with less there is no reason to fit cuts
_LEAST_LOSS = 2.0  # by a cut at a corner that is sharp
_CLEAR_GAIN = 3.0  # at one corner; at sharp ones it is 1.1 at most, by a cut of 2 cm 3.6 and more
_ARCS = np.linspace(1.2, 2.0, 9)  # times a cut: where an arc begins that takes off about as much
_CHORDS = 8  # of an arc


def chamfered(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> list[Chamfered]:
    """Return a start with the corners cut where that explains the points there better, if any.

    The distances of all views' points tell a cut from a sharp corner and from an arc, though their
    normals do not. A corner that tells little is cut as the others are.
    """
    if not isinstance(fit.shape, Sided):
        return []
    noise = estimate_noise(fit, evidence)
    gains = np.full((len(fit.shape.corners), len(_SIZES)), -np.inf)
    for corner in _corners(fit, fit.shape, noise, evidence):
        sharp = corner.cost(corner.cut(1e-6), config)
        for i, size in enumerate(_SIZES[corner.room - _ABOUT / 2 > _SIZES]):
            gains[corner.number, i] = sharp - corner.cost(corner.cut(size), config)
    size = int(np.maximum(gains, 0.0).sum(axis=0).argmax())
    if np.maximum(gains[:, size], 0.0).sum() < _GAIN:
        return []
    start = np.append(fit.shape.parameters, _SIZES[size])
    return [Chamfered(start, fit.shape, gains[:, size] > -_LEAST_LOSS)]


def blunt_corners(
    fit: JointFit, evidence: Evidence, config: SurfaceConfig
) -> list[tuple[Floats, float]]:
    """Return the corners (2,) of a fit that are no corners, and how far inside the edge passes.

    A cut or an arc at one corner alone explains the points there clearly better, though too few
    points tell it to choose another shape.
    """
    shape = fit.shape
    if not isinstance(shape, Sided) or isinstance(shape, Rounded | Chamfered):
        return []
    found = []
    for corner in _corners(fit, shape, fit.noise, evidence):
        sharp = corner.cost(corner.cut(1e-6), config)
        sizes = _SIZES[corner.room - _ABOUT / 2 > _SIZES]
        outlines = [make(size) for size in sizes for make in (corner.cut, corner.arc)]
        costs = [corner.cost(outline, config) for outline in outlines]
        if costs and sharp - min(costs) > _CLEAR_GAIN:
            best = outlines[int(np.argmin(costs))]
            inside = min(float(_away(np.zeros((1, 2)), *ends)[0]) for ends in pairwise(best))
            found.append((shape.corners[corner.number], inside))
    return found


def seems_round(fit: JointFit, evidence: Evidence, config: SurfaceConfig) -> bool:
    """Tell whether arcs explain the points at the cut corners of a fit better than the cuts do."""
    shape = fit.shape
    if not isinstance(shape, Chamfered):
        return False
    corners = _corners(fit, shape.sharp, fit.noise, evidence)
    own = [corner for corner in corners if shape.is_cut[corner.number]]
    cut = sum(corner.cost(corner.cut(shape.cut), config) for corner in own)
    arcs = [sum(each.cost(each.arc(k * shape.cut), config) for each in own) for k in _ARCS]
    return min(arcs) < cut


@dataclass(frozen=True, eq=False)
class _Corner:
    """A corner that points outward, and the edge points about it.

    - ``number``: of the corner in its shape
    - ``before``, ``after``: (2,), unit vectors from the corner along both sides
    - ``turn``: radians, of the outline
    - ``room``: metres, half of the shorter side
    - ``points``, ``sigma``: (n, 2) relative to the corner, and (n,), metres
    - ``kappa``: as of `Noise`
    """

    number: int
    before: Floats
    after: Floats
    turn: float
    room: float
    points: Floats
    sigma: Floats
    kappa: float

    def cut(self, size: float) -> Floats:
        """Return the outline (4, 2) with the corner cut off."""
        along, on = self.before, self.after
        return np.array([_FAR * along, size * along, size * on, _FAR * on])

    def arc(self, reach: float) -> Floats:
        """Return the outline (n, 2) with an arc that begins ``reach`` metres from the corner."""
        radius = reach / np.tan(self.turn / 2)
        centre = (self.before + self.after) * reach / (2 * np.sin(self.turn / 2) ** 2)
        first = reach * self.before - centre
        angles = np.arctan2(first[1], first[0]) + np.linspace(0.0, self.turn, _CHORDS + 1)
        ends = _FAR * self.before[None], _FAR * self.after[None]
        return np.concatenate([ends[0], centre + radius * unit(angles), ends[1]])

    def cost(self, outline: Floats, config: SurfaceConfig) -> float:
        """Return the misfit of the points against an outline, in units of the criterion."""
        off = np.min([_away(self.points, *ends) for ends in pairwise(outline)], axis=0)
        return float(robust(np.square(off / self.sigma), config.loss_sigmas).sum()) / self.kappa


def _corners(fit: JointFit, shape: Sided, noise: Noise, evidence: Evidence) -> Iterator[_Corner]:
    """Yield the corners of a shape that may be cut."""
    corners, sigma = shape.corners, noise.sigma(evidence)
    arms = np.stack([np.roll(corners, by, axis=0) - corners for by in (1, -1)])
    length = np.maximum(np.linalg.norm(arms, axis=2), 1e-9)
    along = arms / length[..., None]
    ahead, onward = np.arctan2(*(-along[0]).T[::-1]), np.arctan2(*along[1].T[::-1])
    turns, rooms = wrap_angles(onward - ahead), length.min(axis=0) / 2
    for number, (corner, turn, room) in enumerate(zip(corners, turns, rooms, strict=True)):
        if _TURNS[0] < turn < _TURNS[1]:
            points = fit.points - corner
            at = np.linalg.norm(points, axis=1) < min(_SIZES[-1] + _ABOUT, room)
            yield _Corner(
                number=number,
                before=along[0, number],
                after=along[1, number],
                turn=float(turn),
                room=float(room),
                points=points[at],
                sigma=sigma[at],
                kappa=noise.kappa,
            )


def _away(points: Floats, start: Floats, end: Floats) -> Floats:
    """Return the distances (n,) of points (n, 2) from a segment."""
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
    away: Floats = np.linalg.norm(points - start - share[:, None] * along, axis=1)
    return away
