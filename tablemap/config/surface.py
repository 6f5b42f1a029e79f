"""Settings: shapes, their fit, and the choice between them."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SurfaceConfig(Section):
    """Shapes, their fit, and the choice between them."""

    points_total: int = Field(
        default=4000,
        ge=100,
        description="edge points; the most of all views that are fitted. Higher: more time",
    )
    points_coarse: int = Field(
        default=600,
        ge=50,
        description="edge points on which starts of the fit are tried. Higher: better starts, "
        "more time",
    )
    minimum_points: int = Field(
        default=40,
        ge=12,
        description="edge points of all views; with fewer, no shape is fitted. Higher: tables "
        "that are hardly seen fail",
    )
    cell: float = Field(
        default=0.02,
        gt=0,
        description="metres; cell size of the grid of what was seen as top, or seen through. "
        "Higher: fewer cells, and contradictions are found less exactly",
    )
    cell_margin: float = Field(
        default=0.015,
        ge=0,
        description="metres; a cell contradicts a shape if it is on the wrong side of the edge by "
        "more than this. Higher: fewer contradictions",
    )
    corner_resolution: float = Field(
        default=0.01,
        gt=0,
        description="metres; the largest radius that a sharp corner may seem to have, as pixels "
        "are coarse. Higher: only rounder corners are called rounded",
    )
    symmetry_cost: float = Field(
        default=5.0,
        ge=0,
        description="units of BIC; cost of each equality that a shape gives up (equal axes, a "
        "right angle), in addition to BIC's own cost; both together are about 2 ln(0.5 m / 1 mm). "
        "Higher: more squares, circles and rectangles",
    )
    cell_cost: float = Field(
        default=1.0,
        ge=0,
        description="units of BIC; cost of one contradicting cell. Higher: shapes follow the seen "
        "top more closely",
    )
    sigma_floor: float = Field(
        default=0.0005,
        gt=0,
        description="metres; the smallest error of an edge point (sigma). Higher: larger sigmas "
        "of the dimensions",
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
        description="cosine of the angle between the normals of an edge point and of its side; "
        "below it the point is an outlier. Higher: more points are outliers",
    )
    systematic_sigmas: float = Field(
        default=1.0,
        gt=0,
        description="standard deviations; how many of them the registration's systematic error "
        "counts as, without a laser. Higher: the places of the views are more certain",
    )
    dimension_systematic: float = Field(
        default=0.0003,
        ge=0,
        description="metres; error that residuals cannot show, added to the sigma of every "
        "dimension. Higher: larger sigmas",
    )
    ransac_draws: int = Field(
        default=300,
        ge=10,
        description="draws for each kind of start. Higher: better starts, more time",
    )
    ransac_threshold: float = Field(
        default=0.03,
        gt=0,
        description="metres; an edge point this near to a start is an inlier of it. Higher: "
        "noisier edges make starts",
    )
    correlation_px: float = Field(
        default=24.0,
        gt=0,
        description="pixels; the shortest length along an edge over which edge points have the "
        "same error. Higher: larger sigmas",
    )
    correlation_maximum_px: float = Field(
        default=72.0,
        gt=0,
        description="pixels; the longest length along an edge over which edge points have the "
        "same error. Higher: larger sigmas where neighbouring residuals are alike",
    )
    line_minimum: float = Field(
        default=0.10,
        gt=0,
        description="metres; the shortest side of a polygon. Higher: simpler polygons",
    )
    measured_fraction: float = Field(
        default=0.35,
        gt=0,
        le=1,
        description="share of a side that must be seen for the side to be measured. Higher: more "
        "sides are inferred",
    )
    inferred_fraction: float = Field(
        default=0.05,
        gt=0,
        le=1,
        description="share of a side that must be seen for the side to be inferred. Higher: more "
        "sides are unseen",
    )
    held_sigma: float = Field(
        default=0.005,
        gt=0,
        description="metres; a side that is only partly seen causes no doubt where its ends have "
        "a smaller sigma. Higher: fewer verdicts doubt such sides",
    )
    ambiguous_score: float = Field(
        default=0.2,
        gt=0,
        lt=1,
        description="score; an alternative shape with a higher one causes a warning. Higher: "
        "fewer warnings of nearly equal shapes",
    )
    minimum_inliers: float = Field(
        default=0.6,
        gt=0,
        le=1,
        description="share of the edge points that must be inliers of a shape. Higher: polygons "
        "and hulls are chosen more often",
    )
    inner_depth: float = Field(
        default=0.05,
        gt=0,
        description="metres; an edge this far inside the outline is an inner edge. Higher: fewer "
        "inner edges",
    )
    inner_length: float = Field(
        default=0.2,
        gt=0,
        description="metres of inner edge that cause a doubt. Higher: fewer doubts",
    )
    inner_points: int = Field(
        default=15,
        ge=3,
        description="edge points; the fewest that an inner edge has. Higher: fewer doubts",
    )
