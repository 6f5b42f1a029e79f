"""Settings: shapes, their fit, and the choice between them."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class SurfaceConfig(Section, frozen=True):
    """Shapes, their fit, and the choice between them."""

    points_total: Annotated[
        int,
        Meta(
            ge=100,
            description="edge points; the most of all views that are fitted. Higher: more time",
        ),
    ] = 4000
    points_coarse: Annotated[
        int,
        Meta(
            ge=50,
            description="edge points on which starts of the fit are tried. Higher: better starts, "
            "more time",
        ),
    ] = 600
    minimum_points: Annotated[
        int,
        Meta(
            ge=12,
            description="edge points of all views; with fewer, no shape is fitted. Higher: tables "
            "that are hardly seen fail",
        ),
    ] = 40
    cell: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; cell size of the grid of what was seen as top, or seen through. "
            "Higher: fewer cells, and contradictions are found less exactly",
        ),
    ] = 0.02
    cell_margin: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; a cell contradicts a shape if it is on the wrong side of the "
            "edge by more than this. Higher: fewer contradictions",
        ),
    ] = 0.015
    corner_resolution: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; the largest radius that a sharp corner may seem to have, as "
            "pixels are coarse. Higher: only rounder corners are called rounded",
        ),
    ] = 0.01
    symmetry_cost: Annotated[
        float,
        Meta(
            ge=0,
            description="units of BIC; cost of each equality that a shape gives up (equal axes, a "
            "right angle), in addition to BIC's own cost; both together are about 2 ln(0.5 m / 1 "
            "mm). Higher: more squares, circles and rectangles",
        ),
    ] = 5.0
    cell_cost: Annotated[
        float,
        Meta(
            ge=0,
            description="units of BIC; cost of one contradicting cell. Higher: shapes follow the "
            "seen top more closely",
        ),
    ] = 1.0
    sigma_floor: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; the smallest error of an edge point (sigma). Higher: larger "
            "sigmas of the dimensions",
        ),
    ] = 0.0005
    loss_sigmas: Annotated[
        float,
        Meta(
            gt=0,
            description="standard deviations; scale of the robust loss. Higher: outliers pull more",
        ),
    ] = 4.0
    normal_cosine: Annotated[
        float,
        Meta(
            gt=0,
            lt=1,
            description="cosine of the angle between the normals of an edge point and of its "
            "side; below it the point is an outlier. Higher: more points are outliers",
        ),
    ] = 0.8
    systematic_sigmas: Annotated[
        float,
        Meta(
            gt=0,
            description="standard deviations; how many of them the registration's systematic "
            "error counts as, without a laser. Higher: the places of the views are more certain",
        ),
    ] = 1.0
    dimension_systematic: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; error that residuals cannot show, added to the sigma of every "
            "dimension. Higher: larger sigmas",
        ),
    ] = 0.0003
    ransac_draws: Annotated[
        int,
        Meta(
            ge=10,
            description="draws for each kind of start. Higher: better starts, more time",
        ),
    ] = 300
    ransac_threshold: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; an edge point this near to a start is an inlier of it. Higher: "
            "noisier edges make starts",
        ),
    ] = 0.03
    correlation_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; the shortest length along an edge over which edge points have "
            "the same error. Higher: larger sigmas",
        ),
    ] = 24.0
    correlation_maximum_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; the longest length along an edge over which edge points have the "
            "same error. Higher: larger sigmas where neighbouring residuals are alike",
        ),
    ] = 72.0
    line_minimum: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; the shortest side of a polygon. Higher: simpler polygons",
        ),
    ] = 0.10
    measured_fraction: Annotated[
        float,
        Meta(
            gt=0,
            le=1,
            description="share of a side that must be seen for the side to be measured. Higher: "
            "more sides are inferred",
        ),
    ] = 0.35
    inferred_fraction: Annotated[
        float,
        Meta(
            gt=0,
            le=1,
            description="share of a side that must be seen for the side to be inferred. Higher: "
            "more sides are unseen",
        ),
    ] = 0.05
    held_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; a side that is only partly seen causes no doubt where its ends "
            "have a smaller sigma. Higher: fewer verdicts doubt such sides",
        ),
    ] = 0.005
    ambiguous_score: Annotated[
        float,
        Meta(
            gt=0,
            lt=1,
            description="score; an alternative shape with a higher one causes a warning. Higher: "
            "fewer warnings of nearly equal shapes",
        ),
    ] = 0.2
    minimum_inliers: Annotated[
        float,
        Meta(
            gt=0,
            le=1,
            description="share of the edge points that must be inliers of a shape. Higher: "
            "polygons and hulls are chosen more often",
        ),
    ] = 0.6
    inner_depth: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; an edge this far inside the outline is an inner edge. Higher: "
            "fewer inner edges",
        ),
    ] = 0.05
    inner_length: Annotated[
        float,
        Meta(
            gt=0,
            description="metres of inner edge that cause a doubt. Higher: fewer doubts",
        ),
    ] = 0.2
    inner_points: Annotated[
        int,
        Meta(
            ge=3,
            description="edge points; the fewest that an inner edge has. Higher: fewer doubts",
        ),
    ] = 15
