"""A scenario: one world, one robot and the errors of its sensors, as a TOML file describes them.

Lengths are metres, angles radians unless the name says ``_deg``; a ``*_sigma`` is the spread from
which the seed draws one value a recording.
"""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tablemap.errors import ConfigError
from tablemap.files import read_text
from tablemap.model.shapes import SQUARE, NameOf, ShapeName
from tablemap.words import known_name

SCENARIOS = Path(__file__).parent / "scenarios"
SUITES = ("report", "hard", "real_sensors")

Item = Literal["box", "book", "cylinder", "bowl"]


class ScenarioSection(BaseModel):
    """A group of settings: frozen, and closed to unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class LegsSection(ScenarioSection):
    """What carries the top. ``section`` is a leg's cross-section, ``size`` its diameter or side."""

    layout: Literal["four", "three", "pedestal", "trestle", "panels", "polygon", "none"] = "four"
    section: Annotated[str, NameOf(lambda shape: len(shape.lengths) == 1)] = SQUARE.name
    size: float = Field(default=0.05, gt=0)
    inset: float = Field(
        default=0.06, ge=0, description="from the top's corner to the leg's middle"
    )
    inset_spread: float = Field(default=0.02, ge=0)
    reflectance: float | None = Field(default=None, gt=0, le=1, description="None: as the top's")


class Table(ScenarioSection):
    """The table that is to be modelled; which sizes apply depends on ``shape``."""

    shape: ShapeName
    length: float = Field(default=0.0, ge=0)
    width: float = Field(default=0.0, ge=0)
    diameter: float = Field(default=0.0, ge=0)
    side: float = Field(default=0.0, ge=0)
    major: float = Field(default=0.0, ge=0)
    minor: float = Field(default=0.0, ge=0)
    angle_deg: float = Field(default=90.0, gt=0, lt=180)
    corner_radius: float = Field(default=0.0, ge=0)
    corners: tuple[tuple[float, float], ...] = ()
    height: float = Field(gt=0)
    thickness: float = Field(default=0.025, gt=0)
    edge: Literal["sharp", "bevelled", "rounded"] = "sharp"
    edge_size: float = Field(default=0.0, ge=0)
    apron: float = Field(default=0.0, ge=0, description="height of the frame below the top")
    apron_inset: float = Field(default=0.03, ge=0)
    cloth: float = Field(default=0.0, ge=0, description="how far a table cloth hangs down")
    reflectance: float = Field(default=0.6, gt=0, le=1)
    gloss: float = Field(default=0.0, ge=0, le=1, description="share of the top without depth")
    texture: float = Field(default=0.9, ge=0, le=1, description="what stereo can match of the top")
    colour: tuple[float, float, float] = (0.72, 0.55, 0.36)
    legs: LegsSection = LegsSection()
    pose: tuple[float, float, float] | None = Field(default=None, description="None: drawn")
    slope_sigma_deg: float = Field(default=0.0, ge=0, description="about either axis")
    sag: float = Field(default=0.0, ge=0, description="of the middle below the corners, or the rim")
    size_spread: float = Field(default=0.1, ge=0, lt=0.5)


class Clutter(ScenarioSection):
    """Things on the top.

    - ``count``: things anywhere on it
    - ``overhang``, ``flush``: things that reach over the edge, or end at it
    - ``rim``: things that stand about a centimetre inside the rim
    - ``cover``: share of the area that lies under things; things are added until it does
    """

    count: int = Field(default=0, ge=0)
    items: tuple[Item, ...] = ("box", "book", "cylinder", "bowl")
    overhang: int = Field(default=0, ge=0)
    flush: int = Field(default=0, ge=0)
    rim: int = Field(default=0, ge=0)
    cover: float = Field(default=0.0, ge=0, le=0.6)


class Surroundings(ScenarioSection):
    """The room and what else is in it."""

    room: Literal["furnished", "plain", "hall", "corridor"] = Field(
        default="furnished", description="a corridor has two walls, and no end within reach"
    )
    margin: float = Field(
        default=0.9, gt=0, description="least free space outside the robot's path"
    )
    cabinets: int = Field(default=5, ge=0)
    couches: int = Field(default=0, ge=0)
    chairs: int = Field(default=0, ge=0)
    chairs_pushed_in: bool = False
    seated: int = Field(default=0, ge=0, description="people who sit at the table")
    below: int = Field(default=0, ge=0, description="bins and boxes that stand under the top")
    neighbours: int = Field(default=0, ge=0, description="tables beside the one that is modelled")
    stools: int = Field(default=0, ge=0, description="as high as the top, pushed against it")
    against_wall: bool = False
    glass: bool = False
    people: int = Field(default=0, ge=0)
    moved: int = Field(default=0, ge=0, description="pieces of furniture moved halfway")


class Robot(ScenarioSection):
    """Where the robot drives and when it looks."""

    camera_height: float = Field(default=1.09, gt=0)
    stops: int = Field(default=8, ge=1)
    span_deg: float = Field(default=360.0, gt=0, le=360, description="less: stops on an open arc")
    clearance: float = Field(default=0.62, gt=0, description="from the table's hull to the base")
    clearance_spread: float = Field(default=0.06, ge=0)
    stop_seconds: float = Field(default=1.5, gt=0, description="in each direction of the head")
    speed: float = Field(default=0.3, gt=0)
    images_per_stop: int = Field(default=2, ge=1, description="in each direction of the head")
    pan_deg: tuple[float, ...] = Field(
        default=(0.0,), min_length=1, description="where the head looks at a stop, one by one"
    )
    pan_speed_deg: float = Field(default=60.0, gt=0, description="a second, at the fastest")
    laser: bool = True
    standing_scan_rate: float = Field(default=8.0, gt=0)
    moving_scan_rate: float = Field(default=10.0, gt=0)
    wheels: bool = True
    continuous_rate: float = Field(
        default=0.0, ge=0, description="depth images a second, moving too"
    )
    depth_transport: Literal["compressed", "raw"] = "compressed"
    colour: bool = True


class CameraSection(ScenarioSection):
    """The depth camera, by its principle, and its errors.

    - ``noise``: factor on all errors that vary from pixel to pixel
    - ``flying``, ``multipath``, ``lit_deg``: errors of time of flight; 0 switches each off
    - ``fattening_px``, ``holes``: errors of stereo; 0 switches each off
    - ``salt``, ``specks``, ``smoothing_px``: errors of any principle; 0 switches each off
    """

    principle: Literal["structured_light", "time_of_flight", "stereo"] = "structured_light"
    noise: float = Field(default=1.0, ge=0)
    scale_sigma: float = Field(default=0.003, ge=0)
    pitch_sigma_deg: float = Field(default=0.15, ge=0)
    roll_sigma_deg: float = Field(default=0.05, ge=0)
    mount_sigma: float = Field(default=0.0, ge=0, description="x and y against the recorded frame")
    mount_yaw_sigma_deg: float = Field(default=0.0, ge=0)
    mount_height_sigma: float = Field(default=0.0, ge=0)
    dropouts: bool = True
    focal_sigma: float = Field(
        default=0.0, ge=0, description="share by which the stated one is off"
    )
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    bend_percent: float = Field(
        default=0.0,
        ge=0,
        description="the most by which a multiplier that is smooth over the image puts depth off "
        "at 2 m; drawn up to a third more or less",
    )
    bend_family: Literal["drawn", "radial", "waves", "patches"] = "drawn"
    bend_growth: float = Field(
        default=1.0, ge=0, description="0: as strong at all distances; 1: as the distance"
    )
    warming_sigma: float = Field(
        default=0.0, ge=0, description="share by which depth's scale drifts over the drive"
    )
    dark_depth: float = Field(
        default=0.0, description="by which black reads farther than white, as the light is weak"
    )
    corner_nearer: float = Field(
        default=0.0, description="by which the outermost pixels of the corners read nearer"
    )
    corner_px: float = Field(default=20.0, gt=0, description="from a corner, of 640 in a row")
    flying: float = Field(
        default=0.6, ge=0, le=1, description="share of mixed pixels that are kept"
    )
    multipath: float = Field(
        default=0.3, ge=0, description="share of a bounce's light that passes for direct light"
    )
    lit_deg: float = Field(default=0.0, ge=0, lt=90, description="half of the lit cone; 0: all")
    fattening_px: float = Field(default=1.0, ge=0, le=2)
    holes: float = Field(default=1.0, ge=0, le=1, description="where there is no texture")
    salt: float = Field(default=0.0, ge=0, le=1, description="share of single pixels that are lost")
    specks: float = Field(
        default=0.0, ge=0, le=1, description="share of single pixels with any depth, .3 to 6 m"
    )
    smoothing_px: int = Field(
        default=0, ge=0, description="side of the window over which the driver averages depth"
    )
    intrinsics: tuple[float, float, float, float] | None = Field(
        default=None, description="fx, fy, cx, cy in pixels; None: the HSR's"
    )
    encoding: Literal["16UC1", "32FC1"] = Field(
        default="16UC1", description="millimetres and 0, or metres and NaN"
    )
    baseline: float = Field(default=0.075, gt=0, description="from the camera to its second eye")
    width: int = Field(default=640, ge=32)
    height: int = Field(default=480, ge=24)


class Head(ScenarioSection):
    """Errors of the head's joints. Each rest of the head draws its encoders' errors anew."""

    pan_sigma_deg: float = Field(default=0.0, ge=0)
    tilt_sigma_deg: float = Field(default=0.0, ge=0)
    pan_play_deg: float = Field(
        default=0.0, ge=0, description="between the two ends of the gear's play, taken in turn"
    )


class Ground(ScenarioSection):
    """An uneven floor. That the base leans on it is a setting of its own."""

    lean_sigma_deg: float = Field(default=0.0, ge=0, description="roll and pitch at each stop")
    wave: float = Field(default=0.0, ge=0, description="from trough to crest")
    wave_length: float = Field(default=1.5, gt=0)


class Laser(ScenarioSection):
    """Errors of the laser scanner."""

    noise_sigma: float = Field(default=0.01, ge=0)
    bias_sigma: float = Field(default=0.003, ge=0)
    bias_slope_sigma: float = Field(default=0.0005, ge=0, description="metres a metre, to 3 m")
    scale_sigma: float = Field(default=0.0005, ge=0)
    beam_deg: float = Field(default=0.2, ge=0, description="full width of a beam; 0: a line")
    turn_seconds: float = Field(default=1 / 30, gt=0, description="of the mirror")
    says_times: bool = Field(default=True, description="else its time_increment is zero")
    mount_sigma: float = Field(default=0.0, ge=0)
    mount_yaw_sigma_deg: float = Field(default=0.0, ge=0)
    dropout: float = Field(default=0.002, ge=0, lt=1)
    bend_sigma: float = Field(
        default=0.0, ge=0, description="of ranges that err smoothly with the beam's angle"
    )
    dark_sigma: float = Field(
        default=0.0, ge=0, description="by which black reads further than white"
    )


class Wheels(ScenarioSection):
    """Errors of the wheel odometry."""

    scale_sigma: float = Field(default=0.008, ge=0)
    yaw_scale_sigma: float = Field(default=0.006, ge=0)
    noise_per_sqrt_metre: float = Field(default=0.003, ge=0)
    yaw_noise_deg_per_sqrt_metre: float = Field(default=0.15, ge=0)


class Localisation(ScenarioSection):
    """Errors of the pose in the map: a jump on the way to each stop, and a slow wander."""

    sigma: float = Field(default=0.06, ge=0)
    yaw_sigma_deg: float = Field(default=2.5, ge=0)
    wander: float = Field(default=0.004, ge=0)
    yaw_wander_deg: float = Field(default=0.1, ge=0)


class Scenario(ScenarioSection):
    """One world, one robot and its errors. ``name`` is the file's stem."""

    name: str
    description: str
    suites: tuple[str, ...] = ()
    table: Table
    clutter: Clutter = Clutter()
    surroundings: Surroundings = Surroundings()
    robot: Robot = Robot()
    camera: CameraSection = CameraSection()
    head: Head = Head()
    ground: Ground = Ground()
    laser: Laser = Laser()
    wheels: Wheels = Wheels()
    localisation: Localisation = Localisation()


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
        off = section.model_copy(update={setting: type(getattr(section, setting))(0)})
        scenario = scenario.model_copy(update={name: off})
    return scenario


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the package, sorted."""
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Read a scenario by its name, in any case, or from a TOML file.

    Raises `ConfigError` where there is none of that name, or it has unknown or impossible settings.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = SCENARIOS / f"{known_name(str(name_or_path), scenario_names())}.toml"
        if not path.is_file():
            near = difflib.get_close_matches(str(name_or_path), scenario_names(), n=1, cutoff=0.0)
            raise ConfigError(
                f"there is no scenario {str(name_or_path)!r}; the nearest is {near[0]!r}, and "
                "`tablemap simulate --list` shows those that there are. A file's name must end "
                "in .toml."
            )
    try:
        settings = tomllib.loads(read_text(path))
        return Scenario.model_validate({"name": path.stem, **settings})
    except OSError as error:
        raise ConfigError(f"The scenario cannot be read ({error.strerror}): {path}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ConfigError(
            f"The scenario's {where}: {first['msg']}; correct it in {path}"
        ) from error
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"The scenario is no valid TOML ({error}): {path}") from error


def suite(name: str) -> list[str]:
    """Return the names of the scenarios of a suite, one of `SUITES` or ``all``, each once.

    Raises `ConfigError` where no scenario belongs to it.
    """
    if name == "all":
        return list(dict.fromkeys(each for name in SUITES for each in suite(name)))
    members = [each for each in scenario_names() if name in load_scenario(each).suites]
    if not members:
        raise ConfigError(
            f"There is no suite named {name!r}; there are {', '.join(SUITES)} and all."
        )
    return members
