"""Settings: legs from laser and depth."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class LegsConfig(Section):
    """Legs from laser and depth."""

    margin: float = Field(default=0.35, ge=0, description="m beyond the outline looked at")
    beyond: float = Field(default=0.10, ge=0, description="m beyond the outline a leg may stand")
    stop_scans: int = Field(default=60, ge=1, description="most scans combined a stop")
    moving_scans: int = Field(default=200, ge=0, description="most scans of the drives kept")
    moving_step: float = Field(default=0.04, gt=0, description="m between scans of a drive")
    farthest_scan: float = Field(default=4.0, gt=0, description="m from the table's middle")
    size_systematic: float = Field(
        default=0.0003, ge=0, description="m, of a leg's size, that no residual can tell"
    )
    stop_position_sigma: float = Field(default=0.003, gt=0, description="m, held poses")
    moving_position_sigma: float = Field(default=0.003, gt=0, description="m, scan by scan")
    moving_yaw_sigma: float = Field(default=0.001, gt=0, description="rad, scan by scan")
    drive_position_sigma: float = Field(default=0.006, gt=0, description="m, shared by a drive")
    drive_yaw_sigma: float = Field(default=0.003, gt=0, description="rad, shared by a drive")
    pose_floor: float = Field(default=0.0001, gt=0, description="m added to a stop's sigma")
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
    laser_symmetry: float = Field(default=0.03, gt=0, description="m, partners seen by the laser")
    symmetry_sigma: float = Field(default=0.01, gt=0, description="m, of an inferred leg")
    depth_margin: float = Field(default=0.03, ge=0, description="m beyond the outline, by depth")
    depth_points: int = Field(default=6, ge=1, description="least pixels of a layer or a face")
    depth_symmetry: float = Field(default=0.05, gt=0, description="m, partners seen by depth")
    largest_depth_leg: float = Field(default=0.2, gt=0, description="m across, by depth alone")
