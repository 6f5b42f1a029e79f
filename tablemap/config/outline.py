"""Settings: edges of the top in each view."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class OutlineConfig(Section):
    """Edges of the top in each view."""

    tolerance_sigmas: float = Field(
        default=3.5,
        gt=0,
        description="standard deviations of the depth's noise; a pixel within them of the top's "
        "plane belongs to the top. Higher: the top has fewer holes where depth is noisy, and low "
        "things on it are taken for top",
    )
    tolerance_min: float = Field(
        default=0.006,
        gt=0,
        description="metres; the smallest tolerance about the top's plane. Higher: a rough top "
        "has fewer holes, and low things on it are taken for top",
    )
    tolerance_max: float = Field(
        default=0.02,
        gt=0,
        description="metres; the largest tolerance about the top's plane. Higher: the top has "
        "fewer holes where depth is noisy, and things on it are taken for top",
    )
    plane_samples: int = Field(
        default=4000,
        ge=60,
        description="pixels; the most to which a view's plane is fitted. Higher: more time",
    )
    plane_worth: float = Field(
        default=60.0,
        gt=0,
        description="independent points; a view's plane counts as if it were fitted to so many. "
        "Higher: the slope that the view shows weighs more, and the belief that a top is level "
        "less",
    )
    smoothing_px: float = Field(
        default=1.5,
        gt=0,
        description="pixels; standard deviation by which top and background are smoothed. Higher: "
        "smoother edges and rounder corners",
    )
    mixed_px: int = Field(
        default=2,
        ge=1,
        description="pixels; a depth is mixed if something deeper lies within this distance. "
        "Higher: more pixels at edges are left out",
    )
    mixed_jump: float = Field(
        default=0.03,
        gt=0,
        description="metres; how much deeper it must lie, in addition to six sigmas of noise. "
        "Higher: fewer pixels at edges are left out",
    )
    face_depth: float = Field(
        default=0.06,
        gt=0,
        description="metres; how far a side face may reach below the top. Higher: the face of a "
        "thicker top is found, and shelves below are taken for it",
    )
    thinning_px: int = Field(
        default=3,
        ge=1,
        description="pixels between two edge points along an edge. Higher: fewer points, less time",
    )
    support: float = Field(
        default=0.025,
        gt=0,
        description="metres of top that must be seen behind an edge point. Higher: fewer false "
        "edges, and none at narrow parts",
    )
    clearance_px: int = Field(
        default=9,
        ge=1,
        description="pixels; width of the window around an edge point in which nothing may stand "
        "in front. Higher: fewer edge points beside things on the table",
    )
    gap_px: float = Field(
        default=4.0,
        ge=0,
        description="pixels without depth that an edge point may have between top and background. "
        "Higher: more edge points, less exact ones",
    )
    border_px: float = Field(
        default=4.0,
        ge=0,
        description="pixels; width of the image's border, where edges are not used. Higher: fewer "
        "edge points",
    )
    face_sigma: float = Field(
        default=0.002,
        ge=0,
        description="metres; error of the visible strip of side face where the thickness is "
        "unknown (sigma). Higher: near edges weigh less there",
    )
    face_set_back: float = Field(
        default=0.012,
        gt=0,
        description="metres; a pixel that lies further behind the upright side face does not "
        "belong to it. Higher: slanted rims are taken for faces, and so are things below the top",
    )
    thickness_min: float = Field(
        default=0.003,
        gt=0,
        description="metres; the thinnest top. Higher: thin tops get no thickness",
    )
    thickness_max: float = Field(
        default=0.09,
        gt=0,
        description="metres; the thickest top. Higher: aprons are taken for the face of the top",
    )
    vote_grid: float = Field(
        default=0.02,
        gt=0,
        description="metres between the points that are kept, both those seen as top and those "
        "where the camera saw through the top's plane. Higher: fewer points, less time",
    )
    free_reach: float = Field(
        default=0.5,
        gt=0,
        description="metres around the top; points where the camera saw through its plane are "
        "kept within this distance. Higher: more memory",
    )
