"""Settings: primitives, their fit and their choice."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SurfaceConfig(Section):
    """Primitives, their fit and their choice."""

    points_total: int = Field(default=4000, ge=100, description="most edge points that are fitted")
    points_coarse: int = Field(
        default=600, ge=50, description="edge points that starts are tried on"
    )
    minimum_points: int = Field(default=40, ge=12, description="fewest edge points of all views")
    cell: float = Field(default=0.02, gt=0, description="metres; grid of top and free votes")
    cell_margin: float = Field(
        default=0.015, ge=0, description="metres a vote may lie beyond an edge"
    )
    corner_resolution: float = Field(
        default=0.01, gt=0, description="radius that pixels make of a sharp corner, at most"
    )
    symmetry_cost: float = Field(
        default=5.0,
        ge=0,
        description="of equal axes or a right angle given up: what BIC lacks of 2 ln(half a metre "
        "over a millimetre), or of a right angle over a tenth of a degree",
    )
    cell_cost: float = Field(default=1.0, ge=0, description="what one contradicting cell costs")
    sigma_floor: float = Field(default=0.0005, gt=0, description="metres; least edge point sigma")
    loss_sigmas: float = Field(default=4.0, gt=0, description="scale of the robust loss")
    normal_cosine: float = Field(default=0.8, gt=0, lt=1, description="point's normal to shape's")
    doubted_height: float = Field(
        default=0.9, gt=0, le=1, description="posterior of a wrong one from which on it is said"
    )
    systematic_sigmas: float = Field(
        default=1.0, gt=0, description="standard deviations in the registration's systematic part"
    )
    dimension_systematic: float = Field(
        default=0.0003, ge=0, description="metres; what no residual can tell, added to every sigma"
    )
    ransac_draws: int = Field(default=300, ge=10, description="draws of each generator of starts")
    ransac_threshold: float = Field(default=0.03, gt=0, description="metres; generators' inliers")
    correlation_px: float = Field(
        default=24.0, gt=0, description="least length over which edge points err together"
    )
    correlation_maximum_px: float = Field(
        default=72.0, gt=0, description="greatest length over which edge points err together"
    )
    line_minimum: float = Field(default=0.10, gt=0, description="metres; shortest polygon side")
    measured_fraction: float = Field(
        default=0.35, gt=0, le=1, description="of a side seen, for it to count as measured"
    )
    inferred_fraction: float = Field(
        default=0.05, gt=0, le=1, description="of a side seen, for it to count as inferred"
    )
    held_sigma: float = Field(
        default=0.005,
        gt=0,
        description="metres: a side seen in part is no doubt where its ends are known so well",
    )
    ambiguous_score: float = Field(
        default=0.2, gt=0, lt=1, description="weight of an alternative that is a near tie"
    )
    minimum_inliers: float = Field(
        default=0.6, gt=0, le=1, description="of the edge points, for a primitive to stand"
    )
    inner_depth: float = Field(
        default=0.05, gt=0, description="metres inside the outline from which on an edge is inner"
    )
    inner_length: float = Field(
        default=0.2, gt=0, description="metres of an inner edge that make a doubt"
    )
    inner_points: int = Field(default=15, ge=3, description="least edge points of an inner edge")
