"""Each error of a scenario switched off by itself."""

from msgspec.structs import replace

from tablemap.errors import ConfigError
from tablemap.simulation.scenario import Scenario

ERRORS = {
    "table": ("slope_sigma_deg", "sag"),
    "camera": (
        "noise",
        "dropouts",
        "scale_sigma",
        "pitch_sigma_deg",
        "roll_sigma_deg",
        "mount_sigma",
        "mount_yaw_sigma_deg",
        "mount_height_sigma",
        "focal_sigma",
        "bend_percent",
        "bend_growth",
        "warming_sigma",
        "dark_depth",
        "corner_nearer",
        "flying",
        "multipath",
        "lit_deg",
        "fattening_px",
        "holes",
        "salt",
        "specks",
        "smoothing_px",
    ),
    "head": ("pan_sigma_deg", "tilt_sigma_deg"),
    "ground": ("lean_sigma_deg", "wave"),
    "laser": (
        "noise_sigma",
        "bias_sigma",
        "bias_slope_sigma",
        "scale_sigma",
        "beam_deg",
        "mount_sigma",
        "mount_yaw_sigma_deg",
        "dropout",
        "bend_sigma",
        "dark_sigma",
    ),
    "wheels": (
        "scale_sigma",
        "yaw_scale_sigma",
        "noise_per_sqrt_metre",
        "yaw_noise_deg_per_sqrt_metre",
    ),
    "localisation": ("sigma", "yaw_sigma_deg", "wander", "yaw_wander_deg"),
}
"""The settings of errors, by section: each is 0 where there is no such error."""


def error_names() -> list[str]:
    """Return all errors as `without` takes them, such as ``camera.bend_percent``."""
    return [f"{section}.{setting}" for section, settings in ERRORS.items() for setting in settings]


def without(scenario: Scenario, *errors: str) -> Scenario:
    """Return a scenario with these errors switched off; a seed draws all others as before.

    Raises `ConfigError` where there is no such error.
    """
    for error in errors:
        if error not in error_names():
            raise ConfigError(
                f"There is no error named {error!r}; there are {', '.join(error_names())}."
            )
        name, setting = error.split(".")
        section = getattr(scenario, name)
        off = replace(section, **{setting: type(getattr(section, setting))(0)})
        scenario = replace(scenario, **{name: off})
    return scenario
