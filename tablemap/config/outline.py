"""Settings: edges of the top in each view."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class OutlineConfig(Section):
    """Edges of the top in each view."""

    tolerance_sigmas: float = Field(
        default=3.5,
        gt=0,
        description="standard deviations of a depth's noise within which it passes for the "
        "top. Higher: noisier depth makes a whole top, and low things on it "
        "vanish",
    )
    tolerance_min: float = Field(
        default=0.006,
        gt=0,
        description="metres; the least such tolerance. Higher: a rough top is whole, and low "
        "things on it vanish",
    )
    tolerance_max: float = Field(
        default=0.02,
        gt=0,
        description="metres; the largest such tolerance. Higher: noisier depth makes a whole "
        "top, and things on it vanish",
    )
    plane_samples: int = Field(
        default=4000,
        ge=60,
        description="pixels; most that a view's plane is fitted to. Higher: more time",
    )
    plane_worth: float = Field(
        default=60.0,
        gt=0,
        description="independent points that a view's plane is worth. Higher: the view's own "
        "slope counts more against a level top",
    )
    smoothing_px: float = Field(
        default=1.5,
        gt=0,
        description="pixels; standard deviation of the smoothing of top and background. "
        "Higher: smoother edges and rounder corners",
    )
    mixed_px: int = Field(
        default=2,
        ge=1,
        description="pixels round a depth in which something deeper makes it a mixed one. "
        "Higher: more pixels at edges are left out",
    )
    mixed_jump: float = Field(
        default=0.03,
        gt=0,
        description="metres that this must be deeper, beyond six sigmas of noise. Higher: "
        "fewer pixels at edges are left out",
    )
    face_depth: float = Field(
        default=0.06,
        gt=0,
        description="metres below the top that a side face reaches. Higher: thicker tops show "
        "their face, and shelves below pass for it",
    )
    thinning_px: int = Field(
        default=3,
        ge=1,
        description="pixels along an edge from one edge point to the next. Higher: fewer "
        "points, less time",
    )
    support: float = Field(
        default=0.025,
        gt=0,
        description="metres of top that must be seen behind an edge point. Higher: fewer "
        "false edges, and none of narrow parts",
    )
    clearance_px: int = Field(
        default=9,
        ge=1,
        description="pixels; window round an edge point that holds nothing in front. Higher: "
        "fewer edge points beside things on the table",
    )
    gap_px: float = Field(
        default=4.0,
        ge=0,
        description="pixels without depth that an edge point may bridge. Higher: more edge "
        "points, less exact ones",
    )
    border_px: float = Field(
        default=4.0,
        ge=0,
        description="pixels; width of the image's border, where no edge is one. Higher: fewer "
        "edge points",
    )
    edge_sigma_px: float = Field(
        default=0.6,
        gt=0,
        description="pixels; error of an edge point in the image (sigma). Higher: larger "
        "sigmas of the dimensions",
    )
    face_sigma: float = Field(
        default=0.002,
        ge=0,
        description="metres; error of the strip of side face where no thickness is known "
        "(sigma). Higher: near edges weigh less there",
    )
    face_set_back: float = Field(
        default=0.012,
        gt=0,
        description="metres; what lies further behind an upright side face is no part of it. "
        "Higher: slanted rims pass for faces, and things below the top too",
    )
    thickness_min: float = Field(
        default=0.003,
        gt=0,
        description="metres; the thinnest top. Higher: thin tops get no thickness",
    )
    thickness_max: float = Field(
        default=0.09,
        gt=0,
        description="metres; the thickest top. Higher: aprons pass for the top's face",
    )
    vote_grid: float = Field(
        default=0.02,
        gt=0,
        description="metres between the points that are kept as seen top or seen through. "
        "Higher: fewer points, less time",
    )
    free_reach: float = Field(
        default=0.5,
        gt=0,
        description="metres round the top within which what was seen through is kept. Higher: "
        "more memory",
    )
