"""Defaults < TOML file < ``--set section.key=value``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tablemap.config.tree import Config, setting_names
from tablemap.errors import ConfigError
from tablemap.files import read_text
from tablemap.paths import AnyPath, as_path
from tablemap.words import known_name

RENAMED = {
    "calibration.camera_height_sigma": "sensors.camera_height_sigma",
    "calibration.focal_sigma": "sensors.focal_length_sigma",
    "calibration.held_height_sigma": "sensors.held_camera_height_sigma",
    "calibration.level_sigma": "sensors.camera_height_sigma_off_base",
    "calibration.scale_sigma": "sensors.depth_scale_sigma",
    "calibration.tilt_sigma_deg": "sensors.camera_tilt_sigma_deg",
    "calibration.view_height_sigma": "sensors.view_height_sigma",
    "calibration.view_tilt_sigma_deg": "sensors.view_tilt_sigma_deg",
    "crosscheck.bias_sigma": "sensors.edge_bias_sigma",
    "crosscheck.correlation": "stages/crosscheck/edges.py:_CORRELATED",
    "crosscheck.largest_sigma": "stages/crosscheck/stage.py:_LARGEST_SIGMA",
    "crosscheck.minimum_points": "stages/crosscheck/edges.py:_LEAST_POINTS",
    "crosscheck.minimum_rows": "stages/crosscheck/sightings.py:_LEAST_ROWS",
    "crosscheck.minimum_sightings": "stages/crosscheck/stage.py:_LEAST_SIGHTINGS",
    "crosscheck.mounting_sigma": "sensors.laser_mounting_sigma",
    "crosscheck.mounting_yaw_sigma": "sensors.laser_mounting_yaw_sigma",
    "crosscheck.offset_sigma": "stages/crosscheck/solve.py:_OFFSET_SIGMA",
    "crosscheck.points": "stages/crosscheck/edges.py:_MOST_POINTS",
    "crosscheck.range_scale_sigma": "sensors.laser_range_scale_sigma_wide",
    "crosscheck.reach": "stages/crosscheck/edges.py:_REACH",
    "crosscheck.rim_set_back": "sensors.rim_set_back",
    "crosscheck.scale_sigma": "sensors.calibrated_depth_scale_sigma_crosscheck",
    "crosscheck.silhouette_middle_px": "sensors.silhouette_middle_sigma_px",
    "crosscheck.silhouette_width_px": "sensors.silhouette_width_sigma_px",
    "crosscheck.yaw_sigma": "stages/crosscheck/solve.py:_YAW_SIGMA",
    "legs.beam_half_width": "sensors.laser_beam_half_width",
    "legs.beam_half_width_sigma": "sensors.laser_beam_half_width_sigma",
    "legs.depth_margin": "stages/legs/depth.py:_MARGIN",
    "legs.depth_points": "stages/legs/depth.py:_LEAST_PIXELS",
    "legs.depth_sigma": "sensors.depth_silhouette_sigma",
    "legs.depth_symmetry": "stages/legs/posts.py:DEPTH_SYMMETRY",
    "legs.drive_position_sigma": "stages/legs/shapes.py:_DRIVE_POSITION_SIGMA",
    "legs.drive_yaw_sigma": "stages/legs/shapes.py:_DRIVE_YAW_SIGMA",
    "legs.farthest_scan": "stages/legs/scans.py:_FARTHEST",
    "legs.laser_symmetry": "stages/legs/missing.py:_LASER_SYMMETRY",
    "legs.margin": "stages/legs/silhouettes.py:_MARGIN",
    "legs.moving_position_sigma": "stages/legs/evidence.py:_MOVING_POSITION_SIGMA",
    "legs.moving_step": "stages/legs/scans.py:_MOVING_STEP",
    "legs.moving_yaw_sigma": "stages/legs/evidence.py:_MOVING_YAW_SIGMA",
    "legs.own_tangents": "stages/legs/candidates.py:_OWN_TANGENTS",
    "legs.pose_floor": "stages/legs/shapes.py:_POSE_FLOOR",
    "legs.range_bias_sigma": "sensors.laser_range_bias_sigma",
    "legs.range_noise": "sensors.laser_range_noise",
    "legs.range_scale_sigma": "sensors.laser_range_scale_sigma",
    "legs.size_systematic": "stages/legs/shapes.py:_SIZE_SYSTEMATIC",
    "legs.stop_position_sigma": "stages/legs/evidence.py:STOP_POSITION_SIGMA",
    "legs.symmetry_sigma": "stages/legs/missing.py:_SYMMETRY_SIGMA",
    "legs.wall_beyond": "stages/legs/silhouettes.py:_WALL_BEYOND",
    "legs.wall_distance": "stages/legs/silhouettes.py:WALL_DISTANCE",
    "legs.wall_length": "stages/legs/silhouettes.py:_WALL_LENGTH",
    "odometry.event_maps": "stages/odometry/placing.py:EVENT_MAPS",
    "odometry.event_points": "stages/odometry/placing.py:EVENT_POINTS",
    "odometry.gap_moves": "stages/odometry/bridging.py:_GAP_STEPS",
    "odometry.maximum_range": "sensors.laser_maximum_range_odometry",
    "odometry.maximum_speed": "sensors.localisation_jump_speed",
    "odometry.maximum_turn_deg": "sensors.localisation_jump_turn_deg_odometry",
    "odometry.standing_every": "stages/odometry/choosing.py:chosen_scans",
    "outline.edge_sigma_px": "sensors.edge_sigma_px",
    "outline.baseline": "sensors.projector_baseline",
    "outline.slope_prior_deg": "sensors.calibrated_view_tilt_sigma_deg",
    "registration.correlation": "stages/registration/laser/laser.py:_CORRELATED_BEAMS",
    "registration.depth_focal_sigma": "sensors.calibrated_focal_length_sigma",
    "registration.depth_gates": "stages/registration/depth/depth.py:PAIR_GATES",
    "registration.depth_kernel": "stages/registration/pairs.py:_DEPTH_KERNEL",
    "registration.depth_loops": "stages/registration/depth/depth.py:_MOST_LOOPS",
    "registration.depth_pair_points": "stages/registration/pairs.py:_DEPTH_PAIR_POINTS",
    "registration.depth_rounds": "stages/registration/depth/depth.py:_ROUNDS",
    "registration.depth_scale_sigma": "sensors.calibrated_depth_scale_sigma_registration",
    "registration.edge_correlation": "stages/registration/depth/edges.py:_CORRELATED_POINTS",
    "registration.edge_gates": "registration.gates",
    "registration.localisation_sigma": "sensors.localisation_sigma",
    "registration.localisation_sigma_deg": "sensors.localisation_sigma_deg",
    "registration.maximum_range": "sensors.laser_maximum_range_registration",
    "registration.mounting_sigma": "sensors.laser_mounting_sigma",
    "registration.range_bias_sigma": "sensors.laser_range_bias_sigma",
    "registration.range_scale_sigma": "sensors.laser_range_scale_sigma_wide",
    "registration.stretch_sigma": "sensors.laser_range_scale_sigma",
    "report.alpha": "baseline/method.py:ALPHA",
    "report.cluster_minimum": "baseline/method.py:CLUSTER_MINIMUM",
    "report.cluster_tolerance": "baseline/method.py:CLUSTER_TOLERANCE",
    "report.cut_margin": "baseline/method.py:CUT_MARGIN",
    "report.floor": "baseline/method.py:FLOOR",
    "report.minimum_score": "baseline/method.py:LEAST_SCORE",
    "report.plane_threshold": "baseline/method.py:PLANE_THRESHOLD",
    "report.threshold": "baseline/method.py:THRESHOLD",
    "report.voxel": "baseline/method.py:VOXEL",
    "review.aligned_points": "review/pairs.py:MOST_POINTS",
    "review.poses": "review/sensors.py:MOST_POSES",
    "segmentation.full_area": "stages/segmentation/candidates.py:_FULL_AREA",
    "segmentation.gaze": "stages/segmentation/candidates.py:_GAZE",
    "segmentation.least_area": "stages/segmentation/surfaces.py:_LEAST_AREA",
    "segmentation.merge_gap": "stages/segmentation/groups.py:_MERGE_GAP",
    "segmentation.merge_height": "stages/segmentation/surfaces.py:MERGE_HEIGHT",
    "segmentation.merge_overlap": "stages/segmentation/groups.py:_MERGE_OVERLAP",
    "segmentation.most_candidates": "stages/segmentation/candidates.py:_MOST_CANDIDATES",
    "segmentation.patch_tolerance": "stages/segmentation/surfaces.py:_TOLERANCE",
    "segmentation.surface_tilt_deg": "stages/segmentation/views.py:LEAST_UPWARD",
    "segmentation.tie": "stages/segmentation/candidates.py:TIE",
    "segmentation.tolerance_least": "stages/segmentation/labelling.py:_LEAST_TOLERANCE",
    "segmentation.tolerance_most": "stages/segmentation/labelling.py:_MOST_TOLERANCE",
    "segmentation.tolerance_sigmas": "stages/segmentation/views.py:_TOLERANCE_SIGMAS",
    "segmentation.view_height_gate": "stages/segmentation/height.py:_GATE",
    "segmentation.view_tilt_sigma_deg": "sensors.calibrated_view_tilt_sigma_deg",
    "snapshots.jump_distance": "stages/snapshots/stops.py:_LONGEST_JUMP",
    "snapshots.jump_speed": "sensors.localisation_jump_speed",
    "snapshots.jump_turn_deg": "sensors.localisation_jump_turn_deg_snapshots",
    "snapshots.least_stops": "stages/snapshots/stage.py:_LEAST_STOPS",
    "surface.drive_scale_sigma": "sensors.drive_scale_sigma",
    "surface.edge_set_back": "sensors.sharp_rim_set_back",
    "surface.edge_bias_sigma": "sensors.near_edge_bias",
    "sensors.far_edge_bias": "sensors.top_widening_sigma_px",
    "surface.far_bias": "sensors.top_widening_sigma_px",
    "surface.far_bias_sigma": "sensors.top_widening_sigma_px",
    "surface.laser_scale_sigma": "sensors.laser_range_scale_sigma",
    "surface.near_bias_sigma": "sensors.near_edge_bias",
    "surface.rim_set_back": "sensors.rim_set_back",
    "surface.scale_sigma": "sensors.calibrated_depth_scale_sigma_surface",
}
"""Old settings, each with its new name, or with the file and name of the constant it became."""

_NO_FOCAL_FIT = (
    "the floor no longer corrects the focal length; sensors.camera_focal_sigma says how far it may "
    "be off"
)
_NO_MIXTURE = "the camera's height in TF has one sigma for every robot, sensors.camera_height_sigma"
REMOVED = {
    "calibration.focal_significance": _NO_FOCAL_FIT,
    "calibration.focal_tilt_gain": _NO_FOCAL_FIT,
    "calibration.focal_tilts": _NO_FOCAL_FIT,
    "calibration.plausible_focal": _NO_FOCAL_FIT,
    "calibration.view_scatter": "every view has a tilt and a height of its own now; "
    "sensors.view_tilt_sigma_deg and sensors.view_height_sigma say how large they may be",
    "registration.depth_largest_step": "nothing replaces it",
    "sensors.camera_height_trusted": _NO_MIXTURE,
    "sensors.camera_tilt_gain_sigma": _NO_FOCAL_FIT,
    "surface.doubted_height": _NO_MIXTURE,
    "surface.trusted_height": _NO_MIXTURE,
}
"""Old settings without a new name, each with what to use instead."""


def load_config(file: AnyPath | None = None, *, overrides: Sequence[str] = ()) -> Config:
    """Merge defaults, a TOML ``file`` and ``section.key=value`` ``overrides`` into one tree.

    A value is read as TOML and, where that fails, as text: ``topics.depth=/camera/depth`` needs no
    quotes. The case of an override's name does not count. Raises `ConfigError` for a value out of
    its range, and for an unknown name; the message has the new name, or the nearest one.
    """
    tree: dict[str, Any] = {}
    if file is not None:
        import tomllib  # here: the defaults need none

        try:
            tree = tomllib.loads(read_text(as_path(file)))
        except OSError as error:
            raise ConfigError(f"the config cannot be read ({error.strerror}): {file}") from error
        except (ValueError, RecursionError) as error:
            raise ConfigError(f"the config is not valid TOML ({error}): {file}") from error
        old = [name for name in (*RENAMED, *REMOVED) if _is_in(tree, name)]
        if old:
            raise ConfigError(
                f"{_fate(old[0])} (old names in the file: {len(old)}); copy your "
                f"changes into the output of `tablemap config`: {file}"
            )
    for setting in overrides:
        name, separator, text = setting.partition("=")
        if not separator or not name.strip():
            raise ConfigError(f"expected --set section.key=value, found {setting!r}.")
        name = known_name(name.strip(), (*setting_names(), *RENAMED, *REMOVED))
        if name in RENAMED or name in REMOVED:
            raise ConfigError(f"{_fate(name)}.")
        *sections, key = name.split(".")
        branch = tree
        for section in sections:
            branch = branch.setdefault(section, {})
            if not isinstance(branch, dict):
                raise ConfigError(f"{section!r} in {name!r} is a value, not a section.")
        branch[key] = _parse_value(text.strip())
    return Config.read(tree)


def _parse_value(text: str) -> object:
    import tomllib

    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def _is_in(tree: Mapping[str, Any], name: str) -> bool:
    section, _, key = name.partition(".")
    branch = tree.get(section)
    return isinstance(branch, Mapping) and key in branch


def _fate(old: str) -> str:
    if old in REMOVED:
        return f"{old} is gone: {REMOVED[old]}"
    file, is_constant, name = RENAMED[old].partition(":")
    if is_constant:
        return f"{old} is a constant now: {name} in tablemap/{file}"
    return f"{old} is now {RENAMED[old]}"
