"""Settings: edges of the top in each view."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class OutlineConfig(Section, frozen=True):
    """Edges of the top in each view."""

    tolerance_sigmas: Annotated[
        float,
        Meta(
            gt=0,
            description="standard deviations of the depth's noise; a pixel within them of the "
            "top's plane belongs to the top. Higher: the top has fewer holes where depth is "
            "noisy, and low things on it are taken for top",
        ),
    ] = 3.5
    tolerance_min: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; the smallest tolerance about the top's plane. Higher: a rough "
            "top has fewer holes, and low things on it are taken for top",
        ),
    ] = 0.006
    tolerance_max: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; the largest tolerance about the top's plane. Higher: the top has "
            "fewer holes where depth is noisy, and things on it are taken for top",
        ),
    ] = 0.02
    plane_samples: Annotated[
        int,
        Meta(
            ge=60,
            description="pixels; the most to which a view's plane is fitted. Higher: more time",
        ),
    ] = 4000
    plane_worth: Annotated[
        float,
        Meta(
            gt=0,
            description="independent points; a view's plane counts as if it were fitted to so "
            "many. Higher: the slope that the view shows weighs more, and the belief that a top "
            "is level less",
        ),
    ] = 60.0
    smoothing_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; standard deviation by which top and background are smoothed. "
            "Higher: smoother edges and rounder corners",
        ),
    ] = 1.5
    mixed_px: Annotated[
        int,
        Meta(
            ge=1,
            description="pixels; a depth is mixed if something deeper lies within this distance. "
            "Higher: more pixels at edges are left out",
        ),
    ] = 2
    mixed_jump: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; how much deeper it must lie, in addition to six sigmas of noise. "
            "Higher: fewer pixels at edges are left out",
        ),
    ] = 0.03
    face_depth: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; how far a side face may reach below the top. Higher: the face of "
            "a thicker top is found, and shelves below are taken for it",
        ),
    ] = 0.06
    thinning_px: Annotated[
        int,
        Meta(
            ge=1,
            description="pixels between two edge points along an edge. Higher: fewer points, less "
            "time",
        ),
    ] = 3
    support: Annotated[
        float,
        Meta(
            gt=0,
            description="metres of top that must be seen behind an edge point. Higher: fewer "
            "false edges, and none at narrow parts",
        ),
    ] = 0.025
    clearance_px: Annotated[
        int,
        Meta(
            ge=1,
            description="pixels; width of the window around an edge point in which nothing may "
            "stand in front. Higher: fewer edge points beside things on the table",
        ),
    ] = 9
    gap_px: Annotated[
        float,
        Meta(
            ge=0,
            description="pixels without depth that an edge point may have between top and "
            "background. Higher: more edge points, less exact ones",
        ),
    ] = 4.0
    border_px: Annotated[
        float,
        Meta(
            ge=0,
            description="pixels; width of the image's border, where edges are not used. Higher: "
            "fewer edge points",
        ),
    ] = 4.0
    face_sigma: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; error of the visible strip of side face where the thickness is "
            "unknown (sigma). Higher: near edges weigh less there",
        ),
    ] = 0.002
    face_set_back: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; a pixel that lies further behind the upright side face does not "
            "belong to it. Higher: slanted rims are taken for faces, and so are things below the "
            "top",
        ),
    ] = 0.012
    thickness_min: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; the thinnest top. Higher: thin tops get no thickness",
        ),
    ] = 0.003
    thickness_max: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; the thickest top. Higher: aprons are taken for the face of the "
            "top",
        ),
    ] = 0.09
    vote_grid: Annotated[
        float,
        Meta(
            gt=0,
            description="metres between the points that are kept, both those seen as top and "
            "those where the camera saw through the top's plane. Higher: fewer points, less time",
        ),
    ] = 0.02
    free_reach: Annotated[
        float,
        Meta(
            gt=0,
            description="metres around the top; points where the camera saw through its plane are "
            "kept within this distance. Higher: more memory",
        ),
    ] = 0.5
