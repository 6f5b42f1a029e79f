"""Settings of what is read and seen: topics, snapshots, calibration, segmentation."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.sections.base import Section


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
    least_level: float = Field(
        default=0.02,
        gt=0,
        description="metres that the floor lies off z = 0, where else the scale is implausible",
    )
    level_sigma: float = Field(
        default=0.05,
        gt=0,
        description="metres, likewise where the floor is neither at z = 0 nor at the base's origin",
    )
    held_height_sigma: float = Field(
        default=0.03, gt=0, description="metres, the same of a camera held by hand, as tracked"
    )
    held_roll_deg: float = Field(
        default=2.0, gt=0, description="image roll that varies by more tells a camera held by hand"
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
