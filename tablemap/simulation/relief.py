"""Floors that wave, and tops that are neither level nor flat."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from tablemap.geometry import Floats, Pose2
from tablemap.model.shapes import shape_named
from tablemap.simulation.meshes import Mesh, MeshPart, refined
from tablemap.simulation.scenario import Ground, Table
from tablemap.simulation.seeds import Generators, clipped_normal
from tablemap.simulation.shapes import Top

_WAVES = 8
_CELL = 0.12  # metres between the vertices of a wavy floor
_REACH = 7.0  # metres from the table: farther away the floor is flat
_FACET = 0.08  # metres: a sagging top's triangles; their error is a tenth of a millimetre


@dataclass(frozen=True, eq=False)
class Waves:
    """A floor's heights in the map: a sum of cosines, 0 in the mean.

    vectors: (k, 2) radians a metre
    amplitudes: (k,) metres
    phases: (k,) radians
    """

    vectors: Floats
    amplitudes: Floats
    phases: Floats

    def heights(self, places: Floats) -> Floats:
        """Return the heights (n,) at places (n, 2)."""
        return np.asarray(np.cos(places @ self.vectors.T + self.phases) @ self.amplitudes)

    def truth(self) -> dict[str, object]:
        """Return the truth file's entry."""
        return {
            "rms": float(np.sqrt(np.sum(self.amplitudes**2) / 2)),
            "vectors": self.vectors.tolist(),
            "amplitudes": self.amplitudes.tolist(),
            "phases": self.phases.tolist(),
        }


def draw_waves(ground: Ground, generator: Generators) -> Waves | None:
    """Draw a floor; None where it is flat."""
    rng = generator("floor")
    if not ground.wave:
        return None
    bearings = rng.uniform(0, 2 * np.pi, _WAVES)
    lengths = ground.wave_length * rng.uniform(0.7, 1.4, _WAVES)
    vectors = np.column_stack([np.cos(bearings), np.sin(bearings)]) * (2 * np.pi / lengths)[:, None]
    amplitudes = rng.uniform(0.5, 1.5, _WAVES)
    # A single cosine from trough to crest is 2 sqrt(2) times its root mean square.
    amplitudes *= ground.wave / 2 / np.sqrt(np.sum(amplitudes**2))
    return Waves(vectors, amplitudes, rng.uniform(0, 2 * np.pi, _WAVES))


def wavy_floor(waves: Waves, low: Floats, high: Floats, frame: Pose2) -> Mesh:
    """Return a floor from ``low`` (2,) to ``high`` (2,) in a frame that lies at the table.

    It waves near the table and is flat further away, where a corridor may lead.
    """
    lines = []
    for start, end in zip(low, high, strict=True):
        inner = np.arange(max(start, -_REACH), min(end, _REACH), _CELL)
        lines.append(np.unique(np.concatenate([[start], inner, [end]])))
    x, y = np.meshgrid(*lines, indexing="ij")
    local = np.column_stack([x.ravel(), y.ravel()])
    places = frame.apply(local)
    near = np.abs(local).max(axis=1) < _REACH
    vertices = np.column_stack([places, waves.heights(places) * near])
    rows, columns = x.shape
    i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    ahead, beside = i + columns, i + 1
    triangles = np.concatenate(
        [np.column_stack([i, ahead, ahead + 1]), np.column_stack([i, ahead + 1, beside])]
    )
    return Mesh(vertices, triangles.astype(np.uint32))


@dataclass(frozen=True, eq=False)
class Relief:
    """Deviation of a top from its level plane, in the table's frame; its mean over the area is 0.

    slope: (2,) rise a metre along x and y
    sag: metres by which the middle hangs below the corners, or below the rim of a round top
    reach: (2,) half extents along x and y
    round_top: whether the rim is held all round
    mean: of the sag alone over the area, metres
    """

    slope: Floats
    sag: float
    reach: Floats
    round_top: bool
    mean: float

    def rises(self, places: Floats) -> Floats:
        """Return how much higher than its mean height the top is at places (n, 2)."""
        squared = np.sum((places / self.reach) ** 2, axis=1) / (1 if self.round_top else 2)
        hanging = self.sag * np.maximum(1 - squared, 0.0)
        return np.asarray(places @ self.slope - hanging - self.mean)

    def shaped(self, parts: list[MeshPart], top: Top) -> list[MeshPart]:
        """Return the parts of the table and the things on it, moved up and down with the top.

        Parts that carry the top keep their feet on the floor.
        """
        shaped = []
        for part in parts:
            mesh = refined(part.mesh, _FACET) if self.sag else part.mesh
            vertices = mesh.vertices.copy()
            share = np.clip(vertices[:, 2] / top.height, 0.0, 1.0)
            vertices[:, 2] += share * self.rises(vertices[:, :2])
            shaped.append(part.of(Mesh(vertices, mesh.triangles)))
        return shaped

    def truth(self, map_from_table: Pose2) -> dict[str, object]:
        """Return the truth file's entry; the slope is the rise a metre along the map's axes."""
        x, y = map_from_table.rotate(self.slope).tolist()
        return {
            "height_is": "mean over the top's area, above z = 0",
            "slope": {"x": x, "y": y},
            "sag": self.sag,
        }


def draw_relief(table: Table, top: Top, generator: Generators) -> Relief | None:
    """Draw a top's slope and sag; None where it is level and flat."""
    unit = clipped_normal(generator("relief"), 2)
    if not (table.slope_sigma_deg or table.sag):
        return None
    reach = np.abs(top.outline).max(axis=0)
    slope = np.tan(np.deg2rad(table.slope_sigma_deg) * unit)
    hanging = Relief(slope, table.sag, reach, shape_named(top.shape).is_elliptic, 0.0)
    grid = np.stack(np.meshgrid(*(np.linspace(-r, r, 201) for r in reach)), axis=-1).reshape(-1, 2)
    # A slope about the middle of the area has mean zero.
    rises = hanging.rises(grid[shapely.contains_xy(top.polygon, grid)])
    return replace(hanging, mean=float(rises.mean()))
