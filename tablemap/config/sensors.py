"""Settings: what is believed of the robot's sensors before a recording is looked at."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class SensorsConfig(Section):
    """What is believed of laser, depth camera, wheels and localisation: each fact once.

    A sigma is a standard deviation. Larger ones say that a sensor is less trusted: the table's
    dimensions then get larger sigmas, and other evidence weighs more.
    """

    laser_maximum_range_odometry: float = Field(
        default=30.0,
        gt=0,
        description="metres; longer ranges are left out of the odometry. Higher: far walls help, "
        "and ranges that the laser measures badly get in",
    )
    laser_maximum_range_registration: float = Field(
        default=25.0,
        gt=0,
        description="metres; longer ranges are left out of the stops' scans. Higher: as for the "
        "odometry",
    )
    laser_range_noise: float = Field(
        default=0.01,
        gt=0,
        description="metres; random error of one beam's range (sigma). Higher: larger range steps "
        "pass for one surface, and each scan weighs less in the fit of the legs",
    )
    laser_range_bias_sigma: float = Field(
        default=0.01,
        gt=0,
        description="metres; constant error of all ranges (sigma). Higher: the fits of stops and "
        "of legs may shift all ranges further",
    )
    laser_range_scale_sigma: float = Field(
        default=0.001,
        ge=0,
        description="share of a range; error of the laser's scale (sigma), as the surface, its "
        "legs and the stops' poses believe it. Its clock is better, its ranges bend by as much. "
        "Higher: larger sigmas of the table and its legs",
    )
    laser_range_scale_sigma_wide: float = Field(
        default=0.003,
        gt=0,
        description="share of a range; the same as the registration's systematic part and the "
        "cross-check of camera and laser believe it. Higher: the views' places are less certain, "
        "and the cross-check puts more of a disagreement down to the laser's scale",
    )
    laser_mounting_sigma: float = Field(
        default=0.003,
        gt=0,
        description="metres; error of the laser's place against the camera's, as TF has them "
        "(sigma). Higher: the views' places are less certain, and the cross-check finds a "
        "disagreement less surprising",
    )
    laser_mounting_yaw_sigma: float = Field(
        default=0.003,
        gt=0,
        description="radians; the same of its heading. Higher: the cross-check finds a turn less "
        "surprising",
    )
    laser_beam_half_width: float = Field(
        default=0.001,
        ge=0,
        description="radians; half the width of a beam's spot, which makes legs look wider. "
        "Higher: legs come out thinner",
    )
    laser_beam_half_width_sigma: float = Field(
        default=0.001,
        gt=0,
        description="radians; how far it may be off (sigma). Higher: the fit of the legs may "
        "choose the spot more freely",
    )
    drive_scale_sigma: float = Field(
        default=0.02,
        ge=0,
        description="share of a way; error of the drive's scale where wheels and depth placed the "
        "views, not the laser (sigma). Higher: the stops' distances say less about the depth's "
        "scale",
    )

    localisation_sigma: float = Field(
        default=0.10,
        gt=0,
        description="metres; error of a localised pose in the map (sigma). Higher: the stops "
        "follow odometry and scans more, and the localisation less",
    )
    localisation_sigma_deg: float = Field(
        default=4.0,
        gt=0,
        description="degrees; the same of a localised heading. Higher: as for `localisation_sigma`",
    )
    localisation_jump_speed: float = Field(
        default=1.5,
        gt=0,
        description="metres per second; a localised pose that moves faster has jumped, and the "
        "robot has not. Set it above the robot's own speed. Higher: jumps pass for motion",
    )
    localisation_jump_turn_deg_snapshots: float = Field(
        default=180.0,
        gt=0,
        description="degrees per second; the same of turning, where stops are looked for. Higher: "
        "jumps pass for motion, and end a stop",
    )
    localisation_jump_turn_deg_odometry: float = Field(
        default=150.0,
        gt=0,
        description="degrees per second; the same where the odometry starts from the "
        "localisation, without wheels. Higher: jumps pass for motion",
    )

    camera_tilt_sigma_deg: float = Field(
        default=0.4,
        gt=0,
        description="degrees; error of the camera's roll and pitch in TF (sigma). Higher: the "
        "floor may tilt the camera further",
    )
    camera_height_sigma: float = Field(
        default=0.003,
        gt=0,
        description="metres; error of the camera's height in TF (sigma). Higher: the floor says "
        "less about the depth's scale",
    )
    camera_height_sigma_off_base: float = Field(
        default=0.05,
        gt=0,
        description="metres; the same where the floor lies neither at z = 0 nor at the base's "
        "origin. Higher: as for `camera_height_sigma`",
    )
    held_camera_height_sigma: float = Field(
        default=0.03,
        gt=0,
        description="metres; error of the height of a camera held by hand, as it is tracked "
        "(sigma). Higher: as for `camera_height_sigma`",
    )
    view_pan_sigma_deg: float = Field(
        default=0.1,
        gt=0,
        description="degrees; error of the head's heading in a single view (sigma). Higher: each "
        "view's edges may turn further about their camera",
    )
    view_tilt_sigma_deg: float = Field(
        default=0.12,
        gt=0,
        description="degrees; tilt of a single view beside the common one, where the views' floors "
        "disagree (sigma). Higher: each view follows its own floor more",
    )
    view_height_sigma: float = Field(
        default=0.0005,
        gt=0,
        description="metres; the same of a single view's height. Higher: each view follows its own "
        "floor more",
    )
    calibrated_view_tilt_sigma_deg: float = Field(
        default=0.3,
        gt=0,
        description="degrees; tilt that a view keeps after the calibration (sigma). Higher: the "
        "top's plane may slope more in a view",
    )

    focal_length_sigma: float = Field(
        default=0.03,
        gt=0,
        description="share of the focal length; its error in the recorded calibration (sigma). "
        "Higher: the floor may change it further",
    )
    calibrated_focal_length_sigma: float = Field(
        default=0.01,
        ge=0,
        description="share of the focal length; the error that nothing in a drive without a laser "
        "shows (sigma). Higher: the views' places, and so the dimensions, are less certain",
    )
    camera_focal_sigma: float = Field(
        default=0.0015,
        gt=0,
        description="share of the focal length; its error where the views do not show it (sigma). "
        "Higher: larger sigmas of the dimensions",
    )
    depth_scale_sigma: float = Field(
        default=0.008,
        gt=0,
        description="share of a depth; error of the depth's scale before the floor is seen "
        "(sigma). Higher: the floor may change it further",
    )
    calibrated_depth_scale_sigma_registration: float = Field(
        default=0.0015,
        gt=0,
        description="share of a depth; the scale error that is left after the calibration (sigma), "
        "as the registration of edges believes it. Higher: edges laid on each other may change "
        "the scale further",
    )
    calibrated_depth_scale_sigma_surface: float = Field(
        default=0.005,
        gt=0,
        description="share of a depth; the same, as the surface believes it where no calibration "
        "tells. Higher: larger sigmas of the dimensions",
    )
    calibrated_depth_scale_sigma_crosscheck: float = Field(
        default=0.003,
        gt=0,
        description="share of a depth; the same, as the cross-check of camera and laser believes "
        "it. Higher: more of a disagreement is put down to the depth",
    )
    projector_baseline: float = Field(
        default=0.08,
        ge=0,
        description="metres between a depth camera's projector and its eye, or its two eyes. "
        "Higher: wider stripes without depth behind an edge pass for its shadow",
    )

    near_edge_bias: float = Field(
        default=0.25,
        gt=0,
        description="sigmas of one edge point; error that all near edges share (sigma), as the "
        "surface believes it. Higher: larger sigmas of the dimensions",
    )
    far_edge_bias: float = Field(
        default=0.4,
        gt=0,
        description="sigmas of one edge point; the same of far edges, with their mixed pixels: a "
        "quarter of a pixel. Higher: larger sigmas of the dimensions",
    )
    edge_bias_sigma: float = Field(
        default=0.002,
        gt=0,
        description="metres; error that all near edges, or all far ones, share (sigma), as the "
        "cross-check believes it. Higher: more of a disagreement is put down to it",
    )
    rim_set_back: float = Field(
        default=0.008,
        ge=0,
        description="metres by which far edges may end early at a rim that is bevelled or rounded "
        "(sigma). Higher: far edges weigh less there",
    )
    sharp_rim_set_back: float = Field(
        default=0.002,
        ge=0,
        description="metres; the same at a rim that looks sharp. Higher: far edges weigh less",
    )
    silhouette_width_sigma_px: float = Field(
        default=1.0,
        gt=0,
        description="pixels; what depth adds to a leg on each side (sigma). Higher: the width of a "
        "leg's silhouette says less in the cross-check",
    )
    silhouette_middle_sigma_px: float = Field(
        default=0.3,
        gt=0,
        description="pixels; what depth shifts a leg by (sigma). Higher: legs say less in the "
        "cross-check",
    )
    depth_silhouette_sigma: float = Field(
        default=0.006,
        gt=0,
        description="metres; error of a leg's silhouette and face in depth (sigma), where the "
        "laser does not see it. Higher: larger sigmas of such legs",
    )
