"""The groups of settings, one a stage. Lengths are metres, angles radians unless named ``_deg``."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class Section(BaseModel):
    """A group of settings: frozen, and closed to unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class TopicsConfig(Section):
    """Which channel and frame plays which role; empty means: found by itself."""

    depth: str = Field(default="", description="topic of the depth images")
    calibration: str = Field(default="", description="topic of the depth camera's calibration")
    colour: str = Field(default="", description="topic of the colour images")
    laser: str = Field(default="", description="topic of the base's laser scans")
    fixed_frame: str = Field(default="", description="TF frame that the model is to be in")
    odom_frame: str = Field(default="", description="TF frame of the wheel odometry")
    base_frame: str = Field(default="", description="TF frame of the robot's base")


class SnapshotsConfig(Section):
    """Where the robot stood still, and which images are kept."""

    maximum: int = Field(default=40, ge=1, description="most snapshots kept, by new view")
    images_per_stop: int = Field(default=10, ge=1, description="most images combined at a stop")
    stop_seconds: float = Field(default=0.5, gt=0, description="least time that counts as a stop")
    still_speed: float = Field(default=0.02, gt=0, description="m/s below which the base stands")
    still_turn_deg: float = Field(default=2.0, gt=0, description="deg/s below which it stands")
    jump_speed: float = Field(default=1.5, gt=0, description="m/s above which the pose jumped")
    jump_distance: float = Field(default=0.5, gt=0, description="metres, the farthest such a jump")
    jump_turn_deg: float = Field(default=180.0, gt=0, description="deg/s above which it jumped")
    least_stops: int = Field(default=3, ge=1, description="fewer: keyframes are taken instead")
    keyframe_distance: float = Field(default=0.15, gt=0, description="metres to a new view")
    keyframe_angle_deg: float = Field(default=15.0, gt=0, description="degrees to a new view")


class CalibrationConfig(Section):
    """Camera tilt and scale from the floor; the sigmas are what is believed before it is seen."""

    tilt_sigma_deg: float = Field(default=1.0, gt=0, description="camera roll and pitch")
    scale_sigma: float = Field(default=0.015, gt=0, description="depth scale")
    camera_height_sigma: float = Field(
        default=0.005, gt=0, description="metres, camera height in TF"
    )
    view_tilt_sigma_deg: float = Field(default=0.5, gt=0, description="tilt of one view, if needed")
    view_height_sigma: float = Field(default=0.02, gt=0, description="metres, likewise its height")
    view_scatter: float = Field(
        default=0.012, gt=0, description="metres between views' floors that call for a fit per view"
    )
    floor_band: float = Field(
        default=0.05, gt=0, description="metres round z = 0 to search, at the base"
    )
    floor_slope: float = Field(default=0.03, ge=0, description="more of it per metre of distance")
    least_floor_pixels: int = Field(default=3000, ge=10, description="in all views together")
    focal_sigma: float = Field(default=0.03, gt=0, description="focal length, before it is seen")
    focal_tilts: int = Field(
        default=10, ge=2, description="fewest different tilts that show a focal length"
    )
    focal_tilt_gain: float = Field(
        default=0.003, ge=0, description="recorded tilts may err by this share of themselves"
    )
    focal_significance: float = Field(
        default=4.0, gt=0, description="sigmas from which on a focal length is corrected"
    )
    plausible_focal: float = Field(default=0.1, gt=0, description="largest focal correction")
    plausible_tilt_deg: float = Field(default=2.0, gt=0)
    plausible_scale: float = Field(default=0.025, gt=0)


class SegmentationConfig(Section):
    """Floor, table top, what stands on it, the rest."""

    lowest: float = Field(default=0.3, gt=0, description="metres, the lowest table top")
    highest: float = Field(default=1.2, gt=0, description="metres, the highest table top")
    surface_tilt_deg: float = Field(default=30.0, gt=0, lt=90, description="still horizontal")
    least_area: float = Field(default=0.03, gt=0, description="m2 of a surface in one view")
    full_area: float = Field(
        default=0.15, gt=0, description="m2 in one view that count as seen well"
    )
    small_area: float = Field(default=0.15, gt=0, description="m2 below which it is hardly a table")
    high: float = Field(default=1.0, gt=0, description="metres above which it is hardly a table")
    gaze: float = Field(default=0.8, gt=0, description="metres beside the optical axis, as a scale")
    patch_tolerance: float = Field(
        default=0.015, gt=0, description="metres round a surface's height"
    )
    merge_height: float = Field(default=0.04, gt=0, description="metres between views of a surface")
    merge_overlap: float = Field(default=0.15, gt=0, lt=1, description="share of the smaller view")
    merge_gap: float = Field(default=0.1, gt=0, description="metres between ends seen apart")
    most_candidates: int = Field(default=12, ge=1)
    near_distance: float = Field(default=1.0, gt=0, description="metres from --near to a table")
    tie: float = Field(
        default=0.7, gt=0, le=1, description="share of the best weight that is a tie"
    )
    tolerance_least: float = Field(default=0.006, gt=0, description="metres round the top's plane")
    tolerance_most: float = Field(default=0.035, gt=0, description="metres round the top's plane")
    tolerance_sigmas: float = Field(default=3.0, gt=0, description="of a pixel's own noise")
    view_height_gate: float = Field(default=0.025, gt=0, description="metres from the joint height")
    view_tilt_sigma_deg: float = Field(default=0.3, gt=0, description="of the top in one view")
    reach: float = Field(default=0.35, gt=0, description="metres by which a view's pose may be off")
    least_top_share: float = Field(
        default=0.003, gt=0, description="of the image, to see the table"
    )


class OdometryConfig(Section):
    """KISS-ICP over the laser scans."""

    voxel_size: float = Field(default=0.075, gt=0, description="KISS-ICP's map voxel, metres")
    threshold: float = Field(
        default=0.02, gt=0, description="KISS-ICP's kernel scale with wheel odometry, metres"
    )
    threshold_without_wheels: float = Field(
        default=0.05, gt=0, description="the same where the prior is the localisation, metres"
    )
    maximum_range: float = Field(default=30.0, gt=0, description="beams longer are left out")
    moved: float = Field(
        default=0.02, gt=0, description="motion that makes a scan worth it, metres"
    )
    turned_deg: float = Field(default=1.0, gt=0, description="turn that makes a scan worth it")
    standing_every: int = Field(default=8, ge=1, description="one scan in so many while standing")
    maximum_speed: float = Field(
        default=1.5, gt=0, description="faster localised motion is a jump, metres per second"
    )
    maximum_turn_deg: float = Field(
        default=150.0, gt=0, description="faster localised turning is a jump, degrees per second"
    )
    maximum_correction: float = Field(
        default=0.15,
        gt=0,
        description="a scan moved further from its prior keeps the prior, metres",
    )
    event_points: int = Field(default=360, ge=1, description="most points of a recorded scan")


class RegistrationConfig(Section):
    """Pairwise ICP, pose graph and joint polish."""

    maximum_range: float = Field(default=25.0, gt=0, description="laser beams longer are left out")
    stop_scans: int = Field(default=120, ge=1, description="most scans combined at a stop")
    gates: tuple[float, ...] = Field(
        default=(0.2, 0.1, 0.05, 0.03), min_length=1, description="correspondence gates, metres"
    )
    kernel: float = Field(default=0.01, gt=0, description="Geman-McClure scale, metres")
    partners: int = Field(default=10, ge=1, description="most stops that a stop is paired with")
    minimum_overlap: float = Field(
        default=0.3, ge=0, le=1, description="least share of a stop's points that a pair must share"
    )
    range_bias_sigma: float = Field(
        default=0.01, gt=0, description="prior of the laser's common range bias, metres"
    )
    range_scale_sigma: float = Field(
        default=0.003, ge=0, description="laser range scale that residuals cannot see"
    )
    mounting_sigma: float = Field(
        default=0.003, ge=0, description="laser mounting that residuals cannot see, metres"
    )
    correlation: float = Field(
        default=8.0, ge=1, description="neighbouring beams that err together, as one"
    )
    localisation_sigma: float = Field(
        default=0.10, gt=0, description="how well a localised pose is believed, metres"
    )
    localisation_sigma_deg: float = Field(
        default=4.0, gt=0, description="how well a localised heading is believed"
    )
    depth_range: float = Field(default=3.5, gt=0, description="depth beyond is left out, metres")
    depth_points: int = Field(default=700, ge=60, description="points of a depth view that align")
    depth_gates: tuple[float, ...] = Field(
        default=(0.2, 0.12, 0.07), min_length=1, description="gates of depth pairs, metres"
    )
    depth_kernel: float = Field(
        default=0.03, gt=0, description="Geman-McClure scale of depth pairs, metres"
    )
    depth_pair_points: float = Field(
        default=20.0, gt=0, description="independent points that a depth pair is worth at most"
    )
    depth_loops: int = Field(default=6, ge=0, description="most loop pairs of a depth view")
    depth_scale_sigma: float = Field(
        default=0.0015,
        gt=0,
        description="prior of the depth's common scale where edges are laid on",
    )
    depth_focal_sigma: float = Field(
        default=0.01, ge=0, description="focal length error: a scale of the path that nothing shows"
    )
    depth_largest_step: float = Field(
        default=0.25, gt=0, description="edges that move a view further are not believed, metres"
    )
    edge_correlation: float = Field(
        default=15.0, ge=1, description="neighbouring edge points that err together, as one"
    )
    depth_rounds: int = Field(
        default=2, ge=1, description="times that depth pairs are aligned and the graph is solved"
    )
    search_radius: float = Field(
        default=0.6, gt=0, description="reach of the correlative search, metres"
    )
    search_angle_deg: float = Field(
        default=25.0, gt=0, description="reach of the correlative search in heading"
    )


class OutlineConfig(Section):
    """Edges of the top in each view."""

    tolerance_sigmas: float = Field(
        default=3.5, gt=0, description="a depth within so many sigmas of the plane passes for top"
    )
    tolerance_min: float = Field(default=0.006, gt=0, description="least such tolerance, metres")
    tolerance_max: float = Field(default=0.02, gt=0, description="largest such tolerance, metres")
    slope_prior_deg: float = Field(
        default=0.3, gt=0, description="tilt that a calibrated camera may leave on a level top"
    )
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
    baseline: float = Field(
        default=0.08, ge=0, description="between projector and camera: widest shadow, metres"
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
    scale_sigma: float = Field(
        default=0.001, gt=0, description="prior of the depth scale left by the floor calibration"
    )
    far_bias: float = Field(
        default=0.45,
        description="of a point's sigma: how far out far edges lie, drawn by their mixed pixels",
    )
    edge_bias_sigma: float = Field(
        default=0.25, gt=0, description="of a point's sigma: what near, or far, edges share unknown"
    )
    rim_set_back: float = Field(
        default=0.008, ge=0, description="metres by which far edges may end early at a dull rim"
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
    ambiguous_score: float = Field(
        default=0.2, gt=0, lt=1, description="weight of an alternative that is a near tie"
    )
    minimum_inliers: float = Field(
        default=0.6, gt=0, le=1, description="of the edge points, for a primitive to stand"
    )


class CrossCheckConfig(Section):
    """Camera against laser, by the edges of the top."""

    threshold: float = Field(
        default=0.005, gt=0, description="an offset at the table from here on is a warning, metres"
    )
    sigmas: float = Field(default=3.0, gt=0, description="standard deviations that it must exceed")
    largest_sigma: float = Field(
        default=0.004, gt=0, description="less certain than this, nothing is said, metres"
    )
    minimum_views: int = Field(default=4, ge=3, description="views that must show edges")
    minimum_points: int = Field(default=20, ge=5, description="edge points of a view")
    points: int = Field(default=150, ge=20, description="most edge points of a view")
    correlation: float = Field(
        default=8.0, ge=1, description="neighbouring edge points that err together, as one"
    )
    reach: float = Field(default=0.06, gt=0, description="edges farther off are no side's, metres")
    offset_sigma: float = Field(default=0.02, gt=0, description="prior of the offset, metres")
    yaw_sigma: float = Field(default=0.01, gt=0, description="prior of the turn, radians")
    scale_sigma: float = Field(default=0.003, gt=0, description="prior of the depth scale left")
    bias_sigma: float = Field(default=0.002, gt=0, description="shared by near, or far, edges, m")
    rim_set_back: float = Field(
        default=0.008, ge=0, description="metres by which far edges may end early at a dull rim"
    )


class LegsConfig(Section):
    """Legs from laser and depth."""

    margin: float = Field(default=0.35, ge=0, description="m beyond the outline looked at")
    beyond: float = Field(default=0.10, ge=0, description="m beyond the outline a leg may stand")
    stop_scans: int = Field(default=60, ge=1, description="most scans combined a stop")
    moving_scans: int = Field(default=200, ge=0, description="most scans of the drives kept")
    moving_step: float = Field(default=0.04, gt=0, description="m between scans of a drive")
    farthest_scan: float = Field(default=4.0, gt=0, description="m from the table's middle")
    range_noise: float = Field(default=0.01, gt=0, description="m, of one beam")
    range_bias_sigma: float = Field(default=0.01, gt=0, description="m, shared by all beams")
    range_scale_sigma: float = Field(default=0.002, ge=0, description="m a metre of range")
    beam_half_width: float = Field(default=0.001, ge=0, description="rad, expected of the spot")
    beam_half_width_sigma: float = Field(default=0.001, gt=0, description="rad")
    stop_position_sigma: float = Field(default=0.003, gt=0, description="m, held poses")
    moving_position_sigma: float = Field(default=0.003, gt=0, description="m, scan by scan")
    moving_yaw_sigma: float = Field(default=0.001, gt=0, description="rad, scan by scan")
    drive_position_sigma: float = Field(default=0.006, gt=0, description="m, shared by a drive")
    drive_yaw_sigma: float = Field(default=0.003, gt=0, description="rad, shared by a drive")
    pose_floor: float = Field(default=0.0007, gt=0, description="m added to a stop's sigma")
    own_tangents: int = Field(default=120, ge=8, description="tangents of a leg's first fit")
    smallest_leg: float = Field(default=0.006, gt=0, description="m across")
    largest_leg: float = Field(default=0.14, gt=0, description="m across")
    largest_slender: float = Field(default=0.2, gt=0, description="m across, one silhouette")
    largest_pedestal: float = Field(default=0.65, gt=0, description="m across, in the middle")
    persistence: float = Field(default=0.7, ge=0, le=1, description="share of views that hit")
    seat_height: float = Field(default=0.52, gt=0, description="m, above a chair's seat")
    wall_length: float = Field(default=0.35, gt=0, description="m of straight line in one scan")
    wall_beyond: float = Field(default=0.08, ge=0, description="m beyond the top it leads on")
    wall_distance: float = Field(default=0.03, gt=0, description="m off the line and still wall")
    symmetry_sigma: float = Field(default=0.01, gt=0, description="m, of an inferred leg")
    depth_margin: float = Field(default=0.03, ge=0, description="m beyond the outline, by depth")
    depth_points: int = Field(default=6, ge=1, description="least pixels of a layer or a face")
    depth_sigma: float = Field(default=0.006, gt=0, description="m, of a depth silhouette")
    depth_symmetry: float = Field(default=0.05, gt=0, description="m, partners seen by depth")
    largest_depth_leg: float = Field(default=0.2, gt=0, description="m across, by depth alone")


class ReviewConfig(Section):
    """What the .rrd carries."""

    level: Literal["standard", "full", "off"] = Field(
        default="standard",
        description="standard: the snapshots' images and thinned clouds; full: every image and "
        "scan; off: the summary and the model alone",
    )
    voxel: float = Field(default=0.015, gt=0, description="cell of thinned clouds, metres")
    scan_seconds: float = Field(
        default=0.5,
        ge=0,
        description="sensor time between two odometry scans that are shown, seconds",
    )
    poses: int = Field(default=500, ge=2, description="most recorded poses in the frame tree")
    plotted_pairs: int = Field(
        default=100, ge=0, description="most pairs whose ICP iterations are plotted"
    )


class ExportConfig(Section):
    """What exports need that the model does not say."""

    thickness: float = Field(default=0.03, gt=0, description="of a top whose own is not known")
    padding: float = Field(default=0.0, ge=0, description="added round a keep-out area, metres")
    resolution: float = Field(default=0.02, gt=0, description="cell of a keep-out mask, metres")
    margin: float = Field(default=0.5, ge=0, description="free cells round it, metres")
    on_top_of_gap: float = Field(
        default=0.02, ge=0, description="from the top up to ED's volume on top of it, metres"
    )
    on_top_of_height: float = Field(default=0.3, gt=0, description="height of that volume, metres")
    mesh_prefix: str = Field(
        default="", description="before mesh names in URDF, as package://my_tables/"
    )


class ReportConfig(Section):
    """The bachelor report's method, kept as a baseline: its parameters, as it states them."""

    voxel: float = Field(default=0.01, gt=0, description="cell of every cloud")
    floor: float = Field(default=0.1, ge=0, description="what lies lower is dropped at once")
    cluster_tolerance: float = Field(default=0.03, gt=0, description="gap between clusters")
    cluster_minimum: int = Field(default=300, ge=3, description="cells of the smallest cluster")
    plane_threshold: float = Field(default=0.03, gt=0, description="RANSAC of the top's plane")
    cut: Literal["below", "above_and_below", "nothing"] = Field(
        default="below", description="what goes, seen from the plane, before the clouds are joined"
    )
    cut_margin: float = Field(default=0.01, ge=0, description="below the plane, still kept")
    icp_distance: float = Field(
        default=1.0, ge=0, description="maximum correspondence distance; 0 leaves ICP out"
    )
    alpha: float = Field(default=0.1, gt=0, description="radius of the concave hull")
    threshold: float = Field(default=0.03, gt=0, description="RANSAC of circle and lines")
    minimum_score: float = Field(default=0.5, ge=0, le=1, description="below it the hull stands")
