"""A scenario: one world, one robot and the errors of its sensors, as a TOML file describes them.

Lengths are metres, angles radians unless the name says ``_deg``; a ``*_sigma`` is the spread from
which the seed draws one value a recording.
"""

from typing import Annotated, Literal

from msgspec import Meta

from tablemap.model.documents import DocumentPart
from tablemap.model.shape_names import ShapeName, names_of
from tablemap.model.shapes import SQUARE

Item = Literal["box", "book", "cylinder", "bowl"]


class ScenarioSection(DocumentPart, frozen=True, forbid_unknown_fields=True):
    """A group of settings: frozen, and closed to unknown keys."""


class LegsSection(ScenarioSection, frozen=True, kw_only=True):
    """What carries the top. ``section`` is a leg's cross-section, ``size`` its diameter or side."""

    layout: Literal["four", "three", "pedestal", "trestle", "panels", "polygon", "none"] = "four"
    section: Annotated[str, names_of(lambda shape: len(shape.lengths) == 1)] = SQUARE.name
    size: Annotated[float, Meta(gt=0)] = 0.05
    inset: Annotated[
        float,
        Meta(ge=0, description="from the top's corner to the leg's middle"),
    ] = 0.06
    inset_spread: Annotated[float, Meta(ge=0)] = 0.02
    reflectance: Annotated[
        Annotated[float, Meta(gt=0, le=1)] | None, Meta(description="None: as the top's")
    ] = None


class Table(ScenarioSection, frozen=True, kw_only=True):
    """The table that is to be modelled; which sizes apply depends on ``shape``."""

    shape: ShapeName
    length: Annotated[float, Meta(ge=0)] = 0.0
    width: Annotated[float, Meta(ge=0)] = 0.0
    diameter: Annotated[float, Meta(ge=0)] = 0.0
    side: Annotated[float, Meta(ge=0)] = 0.0
    major: Annotated[float, Meta(ge=0)] = 0.0
    minor: Annotated[float, Meta(ge=0)] = 0.0
    angle_deg: Annotated[float, Meta(gt=0, lt=180)] = 90.0
    corner_radius: Annotated[float, Meta(ge=0)] = 0.0
    corners: tuple[tuple[float, float], ...] = ()
    height: Annotated[float, Meta(gt=0)]
    thickness: Annotated[float, Meta(gt=0)] = 0.025
    edge: Literal["sharp", "bevelled", "rounded"] = "sharp"
    edge_size: Annotated[float, Meta(ge=0)] = 0.0
    apron: Annotated[float, Meta(ge=0, description="height of the frame below the top")] = 0.0
    apron_inset: Annotated[float, Meta(ge=0)] = 0.03
    cloth: Annotated[float, Meta(ge=0, description="how far a table cloth hangs down")] = 0.0
    reflectance: Annotated[float, Meta(gt=0, le=1)] = 0.6
    gloss: Annotated[float, Meta(ge=0, le=1, description="share of the top without depth")] = 0.0
    texture: Annotated[
        float,
        Meta(ge=0, le=1, description="what stereo can match of the top"),
    ] = 0.9
    colour: tuple[float, float, float] = (0.72, 0.55, 0.36)
    legs: LegsSection = LegsSection()
    pose: Annotated[tuple[float, float, float] | None, Meta(description="None: drawn")] = None
    slope_sigma_deg: Annotated[float, Meta(ge=0, description="about either axis")] = 0.0
    sag: Annotated[
        float,
        Meta(ge=0, description="of the middle below the corners, or the rim"),
    ] = 0.0
    size_spread: Annotated[float, Meta(ge=0, lt=0.5)] = 0.1


class Clutter(ScenarioSection, frozen=True, kw_only=True):
    """Things on the top.

    - ``count``: things anywhere on it
    - ``overhang``, ``flush``: things that reach over the edge, or end at it
    - ``rim``: things that stand about a centimetre inside the rim
    - ``cover``: share of the area that lies under things; things are added until it does
    """

    count: Annotated[int, Meta(ge=0)] = 0
    items: tuple[Item, ...] = ("box", "book", "cylinder", "bowl")
    overhang: Annotated[int, Meta(ge=0)] = 0
    flush: Annotated[int, Meta(ge=0)] = 0
    rim: Annotated[int, Meta(ge=0)] = 0
    cover: Annotated[float, Meta(ge=0, le=0.6)] = 0.0


class Surroundings(ScenarioSection, frozen=True, kw_only=True):
    """The room and what else is in it."""

    room: Annotated[
        Literal["furnished", "plain", "hall", "corridor"],
        Meta(description="a corridor has two walls, and no end within reach"),
    ] = "furnished"
    margin: Annotated[
        float,
        Meta(gt=0, description="least free space outside the robot's path"),
    ] = 0.9
    cabinets: Annotated[int, Meta(ge=0)] = 5
    couches: Annotated[int, Meta(ge=0)] = 0
    chairs: Annotated[int, Meta(ge=0)] = 0
    chairs_pushed_in: bool = False
    seated: Annotated[int, Meta(ge=0, description="people who sit at the table")] = 0
    below: Annotated[int, Meta(ge=0, description="bins and boxes that stand under the top")] = 0
    neighbours: Annotated[int, Meta(ge=0, description="tables beside the one that is modelled")] = 0
    stools: Annotated[int, Meta(ge=0, description="as high as the top, pushed against it")] = 0
    against_wall: bool = False
    glass: bool = False
    people: Annotated[int, Meta(ge=0)] = 0
    moved: Annotated[int, Meta(ge=0, description="pieces of furniture moved halfway")] = 0


class Robot(ScenarioSection, frozen=True, kw_only=True):
    """Where the robot drives and when it looks."""

    camera_height: Annotated[float, Meta(gt=0)] = 1.09
    stops: Annotated[int, Meta(ge=1)] = 8
    span_deg: Annotated[float, Meta(gt=0, le=360, description="less: stops on an open arc")] = 360.0
    clearance: Annotated[float, Meta(gt=0, description="from the table's hull to the base")] = 0.62
    clearance_spread: Annotated[float, Meta(ge=0)] = 0.06
    stop_seconds: Annotated[float, Meta(gt=0, description="in each direction of the head")] = 1.5
    speed: Annotated[float, Meta(gt=0)] = 0.3
    images_per_stop: Annotated[int, Meta(ge=1, description="in each direction of the head")] = 2
    pan_deg: Annotated[
        tuple[float, ...],
        Meta(min_length=1, description="where the head looks at a stop, one by one"),
    ] = (0.0,)
    pan_speed_deg: Annotated[float, Meta(gt=0, description="a second, at the fastest")] = 60.0
    laser: bool = True
    standing_scan_rate: Annotated[float, Meta(gt=0)] = 8.0
    moving_scan_rate: Annotated[float, Meta(gt=0)] = 10.0
    wheels: bool = True
    continuous_rate: Annotated[
        float,
        Meta(ge=0, description="depth images a second, moving too"),
    ] = 0.0
    depth_transport: Literal["compressed", "raw"] = "compressed"
    colour: bool = True


class CameraSection(ScenarioSection, frozen=True, kw_only=True):
    """The depth camera, by its principle, and its errors.

    - ``noise``: factor on all errors that vary from pixel to pixel
    - ``flying``, ``multipath``, ``lit_deg``: errors of time of flight; 0 switches each off
    - ``fattening_px``, ``holes``: errors of stereo; 0 switches each off
    - ``salt``, ``specks``, ``smoothing_px``: errors of any principle; 0 switches each off
    """

    principle: Literal["structured_light", "time_of_flight", "stereo"] = "structured_light"
    noise: Annotated[float, Meta(ge=0)] = 1.0
    scale_sigma: Annotated[float, Meta(ge=0)] = 0.003
    pitch_sigma_deg: Annotated[float, Meta(ge=0)] = 0.15
    roll_sigma_deg: Annotated[float, Meta(ge=0)] = 0.05
    mount_sigma: Annotated[
        float,
        Meta(ge=0, description="x and y against the recorded frame"),
    ] = 0.0
    mount_yaw_sigma_deg: Annotated[float, Meta(ge=0)] = 0.0
    mount_height_sigma: Annotated[float, Meta(ge=0)] = 0.0
    dropouts: bool = True
    focal_sigma: Annotated[
        float,
        Meta(ge=0, description="share by which the stated one is off"),
    ] = 0.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    bend_percent: Annotated[
        float,
        Meta(
            ge=0,
            description="the most by which a multiplier that is smooth over the image puts depth "
            "off at 2 m; drawn up to a third more or less",
        ),
    ] = 0.0
    bend_family: Literal["drawn", "radial", "waves", "patches"] = "drawn"
    bend_growth: Annotated[
        float,
        Meta(ge=0, description="0: as strong at all distances; 1: as the distance"),
    ] = 1.0
    warming_sigma: Annotated[
        float,
        Meta(ge=0, description="share by which depth's scale drifts over the drive"),
    ] = 0.0
    dark_depth: Annotated[
        float,
        Meta(description="by which black reads farther than white, as the light is weak"),
    ] = 0.0
    corner_nearer: Annotated[
        float,
        Meta(description="by which the outermost pixels of the corners read nearer"),
    ] = 0.0
    corner_px: Annotated[float, Meta(gt=0, description="from a corner, of 640 in a row")] = 20.0
    flying: Annotated[
        float,
        Meta(ge=0, le=1, description="share of mixed pixels that are kept"),
    ] = 0.6
    multipath: Annotated[
        float,
        Meta(ge=0, description="share of a bounce's light that passes for direct light"),
    ] = 0.3
    lit_deg: Annotated[float, Meta(ge=0, lt=90, description="half of the lit cone; 0: all")] = 0.0
    fattening_px: Annotated[float, Meta(ge=0, le=2)] = 1.0
    holes: Annotated[float, Meta(ge=0, le=1, description="where there is no texture")] = 1.0
    salt: Annotated[
        float,
        Meta(ge=0, le=1, description="share of single pixels that are lost"),
    ] = 0.0
    specks: Annotated[
        float,
        Meta(ge=0, le=1, description="share of single pixels with any depth, .3 to 6 m"),
    ] = 0.0
    smoothing_px: Annotated[
        int,
        Meta(ge=0, description="side of the window over which the driver averages depth"),
    ] = 0
    intrinsics: Annotated[
        tuple[float, float, float, float] | None,
        Meta(description="fx, fy, cx, cy in pixels; None: the HSR's"),
    ] = None
    encoding: Annotated[
        Literal["16UC1", "32FC1"],
        Meta(description="millimetres and 0, or metres and NaN"),
    ] = "16UC1"
    baseline: Annotated[float, Meta(gt=0, description="from the camera to its second eye")] = 0.075
    width: Annotated[int, Meta(ge=32)] = 640
    height: Annotated[int, Meta(ge=24)] = 480


class Head(ScenarioSection, frozen=True, kw_only=True):
    """Errors of the head's joints. Each rest of the head draws its encoders' errors anew."""

    pan_sigma_deg: Annotated[float, Meta(ge=0)] = 0.0
    tilt_sigma_deg: Annotated[float, Meta(ge=0)] = 0.0
    pan_play_deg: Annotated[
        float,
        Meta(ge=0, description="between the two ends of the gear's play, taken in turn"),
    ] = 0.0


class Ground(ScenarioSection, frozen=True, kw_only=True):
    """An uneven floor. That the base leans on it is a setting of its own."""

    lean_sigma_deg: Annotated[float, Meta(ge=0, description="roll and pitch at each stop")] = 0.0
    wave: Annotated[float, Meta(ge=0, description="from trough to crest")] = 0.0
    wave_length: Annotated[float, Meta(gt=0)] = 1.5


class Laser(ScenarioSection, frozen=True, kw_only=True):
    """Errors of the laser scanner."""

    noise_sigma: Annotated[float, Meta(ge=0)] = 0.01
    bias_sigma: Annotated[float, Meta(ge=0)] = 0.003
    bias_slope_sigma: Annotated[float, Meta(ge=0, description="metres a metre, to 3 m")] = 0.0005
    scale_sigma: Annotated[float, Meta(ge=0)] = 0.0005
    beam_deg: Annotated[float, Meta(ge=0, description="full width of a beam; 0: a line")] = 0.2
    turn_seconds: Annotated[float, Meta(gt=0, description="of the mirror")] = 1 / 30
    says_times: Annotated[bool, Meta(description="else its time_increment is zero")] = True
    mount_sigma: Annotated[float, Meta(ge=0)] = 0.0
    mount_yaw_sigma_deg: Annotated[float, Meta(ge=0)] = 0.0
    dropout: Annotated[float, Meta(ge=0, lt=1)] = 0.002
    bend_sigma: Annotated[
        float,
        Meta(ge=0, description="of ranges that err smoothly with the beam's angle"),
    ] = 0.0
    dark_sigma: Annotated[
        float,
        Meta(ge=0, description="by which black reads further than white"),
    ] = 0.0


class Wheels(ScenarioSection, frozen=True, kw_only=True):
    """Errors of the wheel odometry."""

    scale_sigma: Annotated[float, Meta(ge=0)] = 0.008
    yaw_scale_sigma: Annotated[float, Meta(ge=0)] = 0.006
    noise_per_sqrt_metre: Annotated[float, Meta(ge=0)] = 0.003
    yaw_noise_deg_per_sqrt_metre: Annotated[float, Meta(ge=0)] = 0.15


class Localisation(ScenarioSection, frozen=True, kw_only=True):
    """Errors of the pose in the map: a jump on the way to each stop, and a slow wander."""

    sigma: Annotated[float, Meta(ge=0)] = 0.06
    yaw_sigma_deg: Annotated[float, Meta(ge=0)] = 2.5
    wander: Annotated[float, Meta(ge=0)] = 0.004
    yaw_wander_deg: Annotated[float, Meta(ge=0)] = 0.1


class Scenario(ScenarioSection, frozen=True, kw_only=True):
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
