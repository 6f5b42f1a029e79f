"""Settings: how exact the robot's sensors are, before a recording is read."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tablemap.config.cameras import CAMERAS, DepthCamera
from tablemap.config.section import Section


class SensorsConfig(Section):
    """How exact laser, depth camera, wheels and localisation are; each fact has one setting.

    A sigma is a standard deviation. A larger sigma trusts the sensor less: the dimensions of the
    table get larger sigmas, and the other sensors weigh more.
    """

    depth_camera: DepthCamera | Literal[""] = Field(
        default="",
        description="kind or model of the depth camera, whose values take the place of defaults; "
        "empty: by the noise and the steps of its images",
    )
    laser_maximum_range_odometry: float = Field(
        default=30.0,
        gt=0,
        description="metres; longer ranges are left out of the odometry. Higher: far walls help, "
        "and ranges that the laser measures badly are used",
    )
    laser_maximum_range_registration: float = Field(
        default=25.0,
        gt=0,
        description="metres; longer ranges are left out of the scans of the stops. Higher: far "
        "walls help, and ranges that the laser measures badly are used",
    )
    laser_range_noise: float = Field(
        default=0.01,
        gt=0,
        description="metres; random error of one range (sigma). Higher: larger steps between "
        "ranges pass for one surface, and each scan weighs less in the fit of the legs",
    )
    laser_range_bias_sigma: float = Field(
        default=0.01,
        gt=0,
        description="metres; constant error of all ranges (sigma). Higher: the fits of stops and "
        "of legs may shift all ranges further",
    )
    laser_range_bend_sigma: float = Field(
        default=0.002,
        ge=0,
        description="metres; error of the ranges that changes slowly with the beam's angle "
        "(sigma). Higher: the stops' scans may show a larger one; 0: there is none",
    )
    laser_range_scale_sigma: float = Field(
        default=0.001,
        ge=0,
        description="share of a range; error of the laser's scale (sigma), in the poses of the "
        "stops, the surface and the legs. Higher: larger sigmas of the table and its legs",
    )
    laser_range_scale_sigma_wide: float = Field(
        default=0.003,
        gt=0,
        description="share of a range; error of the laser's scale (sigma), in the registration's "
        "systematic error and in the cross-check of camera and laser. Higher: the places of the "
        "views are less certain, and the cross-check explains more of a disagreement by the "
        "laser's scale",
    )
    laser_mounting_sigma: float = Field(
        default=0.003,
        gt=0,
        description="metres; error of the laser's place relative to the camera in TF (sigma). "
        "Higher: the places of the views are less certain, and the cross-check expects larger "
        "disagreements",
    )
    laser_mounting_yaw_sigma: float = Field(
        default=0.003,
        gt=0,
        description="radians; error of the laser's heading relative to the camera in TF (sigma). "
        "Higher: the cross-check expects larger turns",
    )
    laser_beam_half_width: float = Field(
        default=0.001,
        ge=0,
        description="radians; half the width of a beam, which makes legs look wider. Higher: legs "
        "come out thinner",
    )
    laser_beam_half_width_sigma: float = Field(
        default=0.001,
        gt=0,
        description="radians; error of `laser_beam_half_width` (sigma). Higher: the fit of the "
        "legs may change the width of the beam further",
    )
    drive_scale_sigma: float = Field(
        default=0.02,
        ge=0,
        description="share of a distance driven; error of its scale where wheels and depth placed "
        "the views, without a laser (sigma). Higher: the distances between stops say less about "
        "the depth's scale",
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
        description="degrees; error of a localised heading in the map (sigma). Higher: as for "
        "`localisation_sigma`",
    )
    localisation_jump_speed: float = Field(
        default=1.5,
        gt=0,
        description="metres per second; a localised pose that moves faster has jumped. Set it "
        "above the robot's top speed. Higher: jumps pass for motion",
    )
    localisation_jump_turn_deg_snapshots: float = Field(
        default=180.0,
        gt=0,
        description="degrees per second; a localised pose that turns faster has jumped, where "
        "stops are searched. Higher: jumps pass for motion, and end a stop",
    )
    localisation_jump_turn_deg_odometry: float = Field(
        default=150.0,
        gt=0,
        description="degrees per second; a localised pose that turns faster has jumped, where the "
        "odometry starts from the localisation, without wheels. Higher: jumps pass for motion",
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
        description="metres; error of the camera's height above a floor that lies neither at z = "
        "0 nor at the origin of the base (sigma). Higher: as for `camera_height_sigma`",
    )
    held_camera_height_sigma: float = Field(
        default=0.03,
        gt=0,
        description="metres; error of the tracked height of a camera that is held by hand "
        "(sigma). Higher: as for `camera_height_sigma`",
    )
    view_pan_sigma_deg: float = Field(
        default=0.3,
        gt=0,
        description="degrees; error of the head's heading in a single view (sigma). Higher: the "
        "edges of each view may turn further about its camera",
    )
    view_tilt_sigma_deg: float = Field(
        default=0.12,
        gt=0,
        description="degrees; tilt of a single view in addition to the tilt of all views (sigma). "
        "Higher: each view follows its own floor more",
    )
    base_lean_share: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="share of the pitch of a single view that is a lean of the base, which moves "
        "the camera as well; the rest is the head's. A roll is all a lean. Higher: a pitch moves "
        "the camera further",
    )
    view_height_sigma: float = Field(
        default=0.0005,
        gt=0,
        description="metres; height of a single view in addition to the height of all views "
        "(sigma). Higher: each view follows its own floor more",
    )
    calibrated_view_tilt_sigma_deg: float = Field(
        default=0.3,
        gt=0,
        description="degrees; tilt that is left in a view after the calibration (sigma). Higher: "
        "the plane of the top may slope more in a view",
    )

    focal_length_sigma: float = Field(
        default=0.03,
        gt=0,
        description="share of the focal length; its error for a camera that is held by hand "
        "(sigma). Higher: larger sigmas of the dimensions",
    )
    calibrated_focal_length_sigma: float = Field(
        default=0.01,
        ge=0,
        description="share of the focal length; its error in a drive without a laser, which "
        "nothing there shows (sigma). Higher: the places of the views, and so the dimensions, are "
        "less certain",
    )
    camera_focal_sigma: float = Field(
        default=0.0015,
        gt=0,
        description="share of the focal length; its error in a drive with a laser (sigma). "
        "Higher: larger sigmas of the dimensions",
    )
    depth_scale_sigma: float = Field(
        default=0.008,
        gt=0,
        description="share of a depth; error of the depth's scale before the calibration (sigma). "
        "Higher: floor and top may change it further",
    )
    calibrated_depth_scale_sigma_registration: float = Field(
        default=0.0015,
        gt=0,
        description="share of a depth; error of the depth's scale after the calibration (sigma), "
        "in the registration of edges. Higher: aligned edges may change the scale further",
    )
    calibrated_depth_scale_sigma_surface: float = Field(
        default=0.005,
        gt=0,
        description="share of a depth; error of the depth's scale (sigma), in the fit of the "
        "surface where there was no calibration. Higher: larger sigmas of the dimensions",
    )
    calibrated_depth_scale_sigma_crosscheck: float = Field(
        default=0.003,
        gt=0,
        description="share of a depth; error of the depth's scale after the calibration (sigma), "
        "in the cross-check of camera and laser. Higher: the cross-check explains more of a "
        "disagreement by the depth's scale",
    )
    surface_depth_sigma: float = Field(
        default=0.0,
        ge=0,
        description="metres; error of depth that differs from surface to surface, such as that of "
        "light that came by way of a wall (sigma). Higher: larger sigma of the height, and a side "
        "face that reads nearer than the top beside it shows no round rim",
    )
    projector_baseline: float = Field(
        default=0.08,
        ge=0,
        description="metres between the projector and the eye of a depth camera, or between its "
        "two eyes. Higher: wider stripes without depth behind an edge pass for its shadow",
    )

    edge_sigma_px: float = Field(
        default=0.6,
        gt=0,
        description="pixels; error of an edge point in the image (sigma). Higher: larger sigmas "
        "of the dimensions",
    )
    near_edge_bias: float = Field(
        default=0.25,
        gt=0,
        description="sigmas of one edge point; error that all near edges share (sigma), in the "
        "fit of the surface. Higher: larger sigmas of the dimensions",
    )
    top_widening_px: float = Field(
        default=0.0,
        ge=0,
        description="pixels; by how much the image widens the top before a background, where its "
        "legs do not tell it. Higher: the top comes out smaller",
    )
    top_widening_sigma_px: float = Field(
        default=0.24,
        gt=0,
        description="pixels; error of `top_widening_px` (sigma); the default is for mixed pixels. "
        "Higher: larger sigmas of the dimensions",
    )
    widened_edge_correlation_px: float = Field(
        default=96.0,
        gt=0,
        description="pixels; the length along an edge over which edge points have the same error "
        "where the image widens the top. Higher: larger sigmas, and the edges change fewer of the "
        "camera's values",
    )
    edge_bias_sigma: float = Field(
        default=0.002,
        gt=0,
        description="metres; error that all near edges share, or all far edges (sigma), in the "
        "cross-check of camera and laser. Higher: the cross-check explains more of a disagreement "
        "by the edges",
    )
    rim_set_back: float = Field(
        default=0.008,
        ge=0,
        description="metres; how far inside the rim the far edges may end, where the rim is "
        "bevelled or rounded (sigma). Higher: far edges weigh less there",
    )
    sharp_rim_set_back: float = Field(
        default=0.002,
        ge=0,
        description="metres; how far inside the rim the far edges may end, where the rim looks "
        "sharp (sigma). Higher: far edges weigh less there",
    )
    edge_widening_sigma_px: float = Field(
        default=0.2,
        gt=0,
        description="pixels; by how much far edges of the top may be widened otherwise than the "
        "silhouettes of its legs (sigma). Higher: the legs say less of stereo's wider foreground",
    )
    silhouette_width_sigma_px: float = Field(
        default=1.0,
        gt=0,
        description="pixels; error of each side of a leg's silhouette in depth (sigma). Higher: "
        "the width of a silhouette weighs less in the cross-check",
    )
    silhouette_middle_sigma_px: float = Field(
        default=0.3,
        gt=0,
        description="pixels; error of the middle of a leg's silhouette in depth (sigma). Higher: "
        "legs weigh less in the cross-check",
    )
    depth_silhouette_sigma: float = Field(
        default=0.006,
        gt=0,
        description="metres; error of a leg's silhouette and face in depth, where the laser does "
        "not see the leg (sigma). Higher: larger sigmas of such legs",
    )

    def of_camera(self, seen: DepthCamera | None) -> tuple[SensorsConfig, dict[str, float]]:
        """Return the settings with the camera's own values, and which values these are.

        The camera is the named one, else the one that was ``seen``. A setting that differs from
        its default stays.
        """
        camera = self.depth_camera or seen
        fields = type(self).model_fields
        taken = {
            name: value
            for name, value in (CAMERAS[camera] if camera else {}).items()
            if getattr(self, name) == fields[name].default
        }
        return self.model_copy(update=taken), taken
