"""Settings: edges of the top in each view."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class OutlineConfig(Section):
    """Edges of the top in each view."""

    tolerance_sigmas: float = Field(
        default=3.5, gt=0, description="a depth within so many sigmas of the plane passes for top"
    )
    tolerance_min: float = Field(default=0.006, gt=0, description="least such tolerance, metres")
    tolerance_max: float = Field(default=0.02, gt=0, description="largest such tolerance, metres")
    plane_samples: int = Field(default=4000, ge=60, description="pixels for a view's plane")
    plane_worth: float = Field(
        default=60.0, gt=0, description="independent points that a view's plane is worth"
    )
    smoothing_px: float = Field(
        default=1.5, gt=0, description="sigma of the smoothing of top and below"
    )
    mixed_px: int = Field(
        default=2, ge=1, description="mixed pixels have something deeper within this reach"
    )
    mixed_jump: float = Field(
        default=0.03, gt=0, description="how much deeper, beyond six sigmas of noise, metres"
    )
    face_depth: float = Field(
        default=0.06, gt=0, description="a side face reaches this far below the top, metres"
    )
    thinning_px: int = Field(default=3, ge=1, description="one edge point in so many pixels")
    support: float = Field(
        default=0.025, gt=0, description="top that must be seen behind an edge point, metres"
    )
    clearance_px: int = Field(
        default=9, ge=1, description="window about an edge point that holds nothing in front"
    )
    gap_px: float = Field(
        default=4.0, ge=0, description="unknown pixels that an edge point may bridge"
    )
    border_px: float = Field(default=4.0, ge=0, description="the image's border is this wide")
    edge_sigma_px: float = Field(
        default=0.6, gt=0, description="sigma of an edge point in the image"
    )
    face_sigma: float = Field(
        default=0.002, ge=0, description="of the strip of side face where no thickness is known"
    )
    face_set_back: float = Field(
        default=0.012, gt=0, description="what lies this far behind a side face is none, metres"
    )
    thickness_min: float = Field(default=0.003, gt=0, description="thinnest top, metres")
    thickness_max: float = Field(default=0.09, gt=0, description="thickest top, metres")
    vote_grid: float = Field(
        default=0.02, gt=0, description="spacing of points seen as top or seen through, metres"
    )
    free_reach: float = Field(
        default=0.5, gt=0, description="how far round the top what was seen through is kept, metres"
    )
