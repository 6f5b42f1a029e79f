"""Settings: how exact the robot's sensors are, before a recording is read."""

from typing import Annotated, Literal, Self

from msgspec import Meta
from msgspec.structs import replace

from tablemap.config.cameras import CAMERAS, DepthCamera
from tablemap.config.section import Section
from tablemap.structs import fields_of


class SensorsConfig(Section, frozen=True):
    """How exact laser, depth camera, wheels and localisation are; each fact has one setting.

    A sigma is a standard deviation. A larger sigma trusts the sensor less: the dimensions of the
    table get larger sigmas, and the other sensors weigh more.
    """

    depth_camera: Annotated[
        DepthCamera | Literal[""],
        Meta(
            description="kind or model of the depth camera, whose values take the place of "
            "defaults; empty: by the noise and the steps of its images",
        ),
    ] = ""
    laser_maximum_range_odometry: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; longer ranges are left out of the odometry. Higher: far walls "
            "help, and ranges that the laser measures badly are used",
        ),
    ] = 30.0
    laser_maximum_range_registration: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; longer ranges are left out of the scans of the stops. Higher: "
            "far walls help, and ranges that the laser measures badly are used",
        ),
    ] = 25.0
    laser_range_noise: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; random error of one range (sigma). Higher: larger steps between "
            "ranges pass for one surface, and each scan weighs less in the fit of the legs",
        ),
    ] = 0.01
    laser_range_bias_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; constant error of all ranges (sigma). Higher: the fits of stops "
            "and of legs may shift all ranges further",
        ),
    ] = 0.01
    laser_range_bend_sigma: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; error of the ranges that changes slowly with the beam's angle "
            "(sigma). Higher: the stops' scans may show a larger one; 0: there is none",
        ),
    ] = 0.002
    laser_range_scale_sigma: Annotated[
        float,
        Meta(
            ge=0,
            description="share of a range; error of the laser's scale (sigma), in the poses of "
            "the stops, the surface and the legs. Higher: larger sigmas of the table and its legs",
        ),
    ] = 0.001
    laser_range_scale_sigma_wide: Annotated[
        float,
        Meta(
            gt=0,
            description="share of a range; error of the laser's scale (sigma), in the "
            "registration's systematic error and in the cross-check of camera and laser. Higher: "
            "the places of the views are less certain, and the cross-check explains more of a "
            "disagreement by the laser's scale",
        ),
    ] = 0.003
    laser_mounting_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; error of the laser's place relative to the camera in TF (sigma). "
            "Higher: the places of the views are less certain, and the cross-check expects larger "
            "disagreements",
        ),
    ] = 0.003
    laser_mounting_yaw_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="radians; error of the laser's heading relative to the camera in TF "
            "(sigma). Higher: the cross-check expects larger turns",
        ),
    ] = 0.003
    laser_beam_half_width: Annotated[
        float,
        Meta(
            ge=0,
            description="radians; half the width of a beam, which makes legs look wider. Higher: "
            "legs come out thinner",
        ),
    ] = 0.001
    laser_beam_half_width_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="radians; error of `laser_beam_half_width` (sigma). Higher: the fit of "
            "the legs may change the width of the beam further",
        ),
    ] = 0.001
    drive_scale_sigma: Annotated[
        float,
        Meta(
            ge=0,
            description="share of a distance driven; error of its scale where wheels and depth "
            "placed the views, without a laser (sigma). Higher: the distances between stops say "
            "less about the depth's scale",
        ),
    ] = 0.02

    localisation_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; error of a localised pose in the map (sigma). Higher: the stops "
            "follow odometry and scans more, and the localisation less",
        ),
    ] = 0.10
    localisation_sigma_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; error of a localised heading in the map (sigma). Higher: as for "
            "`localisation_sigma`",
        ),
    ] = 4.0
    localisation_jump_speed: Annotated[
        float,
        Meta(
            gt=0,
            description="metres per second; a localised pose that moves faster has jumped. Set it "
            "above the robot's top speed. Higher: jumps pass for motion",
        ),
    ] = 1.5
    localisation_jump_turn_deg_snapshots: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees per second; a localised pose that turns faster has jumped, where "
            "stops are searched. Higher: jumps pass for motion, and end a stop",
        ),
    ] = 180.0
    localisation_jump_turn_deg_odometry: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees per second; a localised pose that turns faster has jumped, where "
            "the odometry starts from the localisation, without wheels. Higher: jumps pass for "
            "motion",
        ),
    ] = 150.0

    camera_tilt_sigma_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; error of the camera's roll and pitch in TF (sigma). Higher: the "
            "floor may tilt the camera further",
        ),
    ] = 0.4
    camera_height_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; error of the camera's height in TF (sigma). Higher: the floor "
            "says less about the depth's scale",
        ),
    ] = 0.003
    camera_height_sigma_off_base: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; error of the camera's height above a floor that lies neither at "
            "z = 0 nor at the origin of the base (sigma). Higher: as for `camera_height_sigma`",
        ),
    ] = 0.05
    held_camera_height_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; error of the tracked height of a camera that is held by hand "
            "(sigma). Higher: as for `camera_height_sigma`",
        ),
    ] = 0.03
    view_pan_sigma_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; error of the head's heading in a single view (sigma). Higher: "
            "the edges of each view may turn further about its camera",
        ),
    ] = 0.3
    view_tilt_sigma_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; tilt of a single view in addition to the tilt of all views "
            "(sigma). Higher: each view follows its own floor more",
        ),
    ] = 0.12
    base_lean_share: Annotated[
        float,
        Meta(
            ge=0,
            le=1,
            description="share of the pitch of a single view that is a lean of the base, which "
            "moves the camera as well; the rest is the head's. A roll is all a lean. Higher: a "
            "pitch moves the camera further",
        ),
    ] = 0.5
    view_height_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; height of a single view in addition to the height of all views "
            "(sigma). Higher: each view follows its own floor more",
        ),
    ] = 0.0005
    calibrated_view_tilt_sigma_deg: Annotated[
        float,
        Meta(
            gt=0,
            description="degrees; tilt that is left in a view after the calibration (sigma). "
            "Higher: the plane of the top may slope more in a view",
        ),
    ] = 0.3

    focal_length_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="share of the focal length; its error for a camera that is held by hand "
            "(sigma). Higher: larger sigmas of the dimensions",
        ),
    ] = 0.03
    calibrated_focal_length_sigma: Annotated[
        float,
        Meta(
            ge=0,
            description="share of the focal length; its error in a drive without a laser, which "
            "nothing there shows (sigma). Higher: the places of the views, and so the dimensions, "
            "are less certain",
        ),
    ] = 0.01
    camera_focal_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="share of the focal length; its error in a drive with a laser (sigma). "
            "Higher: larger sigmas of the dimensions",
        ),
    ] = 0.0015
    depth_scale_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="share of a depth; error of the depth's scale before the calibration "
            "(sigma). Higher: floor and top may change it further",
        ),
    ] = 0.008
    calibrated_depth_scale_sigma_registration: Annotated[
        float,
        Meta(
            gt=0,
            description="share of a depth; error of the depth's scale after the calibration "
            "(sigma), in the registration of edges. Higher: aligned edges may change the scale "
            "further",
        ),
    ] = 0.0015
    calibrated_depth_scale_sigma_surface: Annotated[
        float,
        Meta(
            gt=0,
            description="share of a depth; error of the depth's scale (sigma), in the fit of the "
            "surface where there was no calibration. Higher: larger sigmas of the dimensions",
        ),
    ] = 0.005
    calibrated_depth_scale_sigma_crosscheck: Annotated[
        float,
        Meta(
            gt=0,
            description="share of a depth; error of the depth's scale after the calibration "
            "(sigma), in the cross-check of camera and laser. Higher: the cross-check explains "
            "more of a disagreement by the depth's scale",
        ),
    ] = 0.003
    surface_depth_sigma: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; error of depth that differs from surface to surface, such as "
            "that of light that came by way of a wall (sigma). Higher: larger sigma of the "
            "height, and a side face that reads nearer than the top beside it shows no round rim",
        ),
    ] = 0.0
    projector_baseline: Annotated[
        float,
        Meta(
            ge=0,
            description="metres between the projector and the eye of a depth camera, or between "
            "its two eyes. Higher: wider stripes without depth behind an edge pass for its shadow",
        ),
    ] = 0.08

    edge_sigma_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; error of an edge point in the image (sigma). Higher: larger "
            "sigmas of the dimensions",
        ),
    ] = 0.6
    near_edge_bias: Annotated[
        float,
        Meta(
            gt=0,
            description="sigmas of one edge point; error that all near edges share (sigma), in "
            "the fit of the surface. Higher: larger sigmas of the dimensions",
        ),
    ] = 0.25
    top_widening_px: Annotated[
        float,
        Meta(
            ge=0,
            description="pixels; by how much the image widens the top before a background, where "
            "its legs do not tell it. Higher: the top comes out smaller",
        ),
    ] = 0.0
    top_widening_sigma_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; error of `top_widening_px` (sigma); the default is for mixed "
            "pixels. Higher: larger sigmas of the dimensions",
        ),
    ] = 0.24
    widened_edge_correlation_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; the length along an edge over which edge points have the same "
            "error where the image widens the top. Higher: larger sigmas, and the edges change "
            "fewer of the camera's values",
        ),
    ] = 96.0
    matching_window_px: Annotated[
        float,
        Meta(
            ge=0,
            description="pixels; width of the window in which the depth camera compares its "
            "images; 0: as the noise of its images shows it. Higher: larger sigmas of the "
            "dimensions and of the thickness",
        ),
    ] = 0.0
    window_edge_share: Annotated[
        float,
        Meta(
            ge=0,
            description="share of the matching window; error that all near edges share, or all "
            "far edges (sigma). Higher: larger sigmas of the dimensions",
        ),
    ] = 0.07
    window_face_share: Annotated[
        float,
        Meta(
            ge=0,
            description="share of the matching window; by how much depth widens the lower end of "
            "the side face, plus or minus as much (sigma). Higher: the top comes out thinner, with "
            "a larger sigma",
        ),
    ] = 0.1
    edge_bias_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; error that all near edges share, or all far edges (sigma), in "
            "the cross-check of camera and laser. Higher: the cross-check explains more of a "
            "disagreement by the edges",
        ),
    ] = 0.002
    rim_set_back: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; how far inside the rim the far edges may end, where the rim is "
            "bevelled or rounded (sigma). Higher: far edges weigh less there",
        ),
    ] = 0.008
    sharp_rim_set_back: Annotated[
        float,
        Meta(
            ge=0,
            description="metres; how far inside the rim the far edges may end, where the rim "
            "looks sharp (sigma). Higher: far edges weigh less there",
        ),
    ] = 0.002
    edge_widening_sigma_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; by how much far edges of the top may be widened otherwise than "
            "the silhouettes of its legs (sigma). Higher: the legs say less of stereo's wider "
            "foreground",
        ),
    ] = 0.2
    silhouette_width_sigma_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; error of each side of a leg's silhouette in depth (sigma). "
            "Higher: the width of a silhouette weighs less in the cross-check",
        ),
    ] = 1.0
    silhouette_middle_sigma_px: Annotated[
        float,
        Meta(
            gt=0,
            description="pixels; error of the middle of a leg's silhouette in depth (sigma). "
            "Higher: legs weigh less in the cross-check",
        ),
    ] = 0.3
    depth_silhouette_sigma: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; error of a leg's silhouette and face in depth, where the laser "
            "does not see the leg (sigma). Higher: larger sigmas of such legs",
        ),
    ] = 0.006

    def of_camera(self, seen: DepthCamera | None) -> tuple[Self, dict[str, float]]:
        """Return the settings with the camera's own values, and which values these are.

        The camera is the named one, else the one that was ``seen``. A setting that differs from
        its default stays.
        """
        camera = self.depth_camera or seen
        known = fields_of(type(self))
        taken = {
            name: value
            for name, value in (CAMERAS[camera] if camera else {}).items()
            if getattr(self, name) == known[name].default
        }
        return replace(self, **taken), taken

    def of_window(self, seen: float) -> Self:
        """Return the settings with the errors of edges that a matching window of pixels makes.

        The window is the one that is set, else the one that was ``seen``, pixels; without one the
        settings stay.
        """
        window = self.matching_window_px or seen
        error = self.window_edge_share * window
        return replace(
            self,
            matching_window_px=window,
            near_edge_bias=max(self.near_edge_bias, error / self.edge_sigma_px),
            top_widening_sigma_px=max(self.top_widening_sigma_px, error),
            edge_widening_sigma_px=max(self.edge_widening_sigma_px, error / 2),
            edge_bias_sigma=max(self.edge_bias_sigma, error * _METRES_PER_PX),
            sharp_rim_set_back=max(self.sharp_rim_set_back, error * _METRES_PER_PX),
        )


_METRES_PER_PX = 0.004  # that an edge pixel spans on the top, at the distance of a stop
