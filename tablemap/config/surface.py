"""Settings: primitives, their fit and their choice."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SurfaceConfig(Section):
    """Primitives, their fit and their choice."""

    points_total: int = Field(
        default=4000,
        ge=100,
        description="edge points; most of all views that are fitted. Higher: more time",
    )
    points_coarse: int = Field(
        default=600,
        ge=50,
        description="edge points that starts are tried on. Higher: better starts, more time",
    )
    minimum_points: int = Field(
        default=40,
        ge=12,
        description="edge points of all views; with fewer there is no shape. Higher: tables "
        "that are hardly seen fail",
    )
    cell: float = Field(
        default=0.02,
        gt=0,
        description="metres; cell of the grid of what was seen as top or seen through. "
        "Higher: fewer cells, coarser contradictions",
    )
    cell_margin: float = Field(
        default=0.015,
        ge=0,
        description="metres; a cell contradicts a shape from so far beyond its edge on. "
        "Higher: fewer contradictions",
    )
    corner_resolution: float = Field(
        default=0.01,
        gt=0,
        description="metres; largest radius that pixels make of a sharp corner. Higher: only "
        "rounder corners are called rounded",
    )
    symmetry_cost: float = Field(
        default=5.0,
        ge=0,
        description="units of BIC; cost of equal axes or of a right angle given up: what BIC "
        "lacks of 2 ln(half a metre over a millimetre), or of a right angle over "
        "a tenth of a degree. Higher: more squares, circles and rectangles",
    )
    cell_cost: float = Field(
        default=1.0,
        ge=0,
        description="units of BIC; cost of one contradicting cell. Higher: shapes keep closer "
        "to what was seen as top",
    )
    sigma_floor: float = Field(
        default=0.0005,
        gt=0,
        description="metres; least error of an edge point (sigma). Higher: larger sigmas of "
        "the dimensions",
    )
    loss_sigmas: float = Field(
        default=4.0,
        gt=0,
        description="standard deviations; scale of the robust loss. Higher: outliers pull more",
    )
    normal_cosine: float = Field(
        default=0.8,
        gt=0,
        lt=1,
        description="cosine between the normals of an edge point and of its side. Higher: "
        "more points are outliers",
    )
    systematic_sigmas: float = Field(
        default=1.0,
        gt=0,
        description="standard deviations that the registration's systematic part stands for. "
        "Higher: it weighs less",
    )
    dimension_systematic: float = Field(
        default=0.0003,
        ge=0,
        description="metres; what no residual can tell, added to the sigma of every "
        "dimension. Higher: larger sigmas",
    )
    ransac_draws: int = Field(
        default=300,
        ge=10,
        description="draws of each generator of starts. Higher: better starts, more time",
    )
    ransac_threshold: float = Field(
        default=0.03,
        gt=0,
        description="metres; an edge point so near to a start is its inlier. Higher: noisier "
        "edges make starts",
    )
    correlation_px: float = Field(
        default=24.0,
        gt=0,
        description="pixels; least length along an edge over which its points err together. "
        "Higher: larger sigmas",
    )
    correlation_maximum_px: float = Field(
        default=72.0,
        gt=0,
        description="pixels; greatest such length. Higher: larger sigmas where residuals hang "
        "together",
    )
    line_minimum: float = Field(
        default=0.10,
        gt=0,
        description="metres; shortest side of a polygon. Higher: simpler polygons",
    )
    measured_fraction: float = Field(
        default=0.35,
        gt=0,
        le=1,
        description="share of a side that must be seen, for it to count as measured. Higher: "
        "more sides are inferred",
    )
    inferred_fraction: float = Field(
        default=0.05,
        gt=0,
        le=1,
        description="share of a side that must be seen, for it to count as inferred. Higher: "
        "more sides are unseen",
    )
    held_sigma: float = Field(
        default=0.005,
        gt=0,
        description="metres; a side seen in part is no doubt where its ends are known better "
        "(sigma). Higher: fewer verdicts doubt such sides",
    )
    ambiguous_score: float = Field(
        default=0.2,
        gt=0,
        lt=1,
        description="weight of an alternative that makes a near tie. Higher: fewer warnings "
        "of near ties",
    )
    minimum_inliers: float = Field(
        default=0.6,
        gt=0,
        le=1,
        description="share of the edge points that must be inliers, for a primitive to stand. "
        "Higher: polygons and hulls take over sooner",
    )
    inner_depth: float = Field(
        default=0.05,
        gt=0,
        description="metres inside the outline from which on an edge is an inner one. Higher: "
        "fewer inner edges",
    )
    inner_length: float = Field(
        default=0.2,
        gt=0,
        description="metres of an inner edge that make a doubt. Higher: fewer doubts",
    )
    inner_points: int = Field(
        default=15,
        ge=3,
        description="edge points; least of an inner edge. Higher: fewer doubts",
    )
