"""What the drawings know of one another's results."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, Pose2
from tablemap.recording import FrameNames, Recording
from tablemap.stages.odometry import Trajectory

FEW_STOPS = 15
"""Up to this number, stops are drawn large and with their numbers."""


@dataclass
class DrawnScene:
    """Facts from earlier results that later drawings need; small, whatever the recording's length.

    - ``stamps_ns``, ``localised``: stamps and localised poses of the snapshots, by index
    - ``cameras``: poses (4, 4) in the base; tip and corners (5, 3) of the view, 1 m deep
    - ``tops``, ``clutter``: their thinned points (n, 3), x and y in the base, z in the map
    - ``floor_z``, ``height``, ``laser_height``: z in the map of floor, top and laser, metres
    - ``centre``, ``extent``, ``yaw``: the table's place (2,), size in metres and heading, if known
    - ``doubts``: the codes of the model's doubts
    - ``chosen``: the entity of the chosen shape
    - ``stages``: names and seconds, None for the running stage
    - ``tables``: scenes of the tables beside the chosen one
    - ``pairs_reach``: metres, size of the grid of aligned pairs
    - ``pair_eye``: position and target (3,) of the view of a single pair
    - ``best``: the snapshot that shows most of the table
    - ``colour_fits``: whether colour images match the depth images pixel by pixel
    - ``is_modelled``: whether the chosen table's model is there
    - ``localised_way``: the drive as localised
    - ``has_laser``: whether odometry drew scans
    - ``is_mended``: whether single bad pixels of a depth image were mended
    - ``has_labels``: whether views were labelled
    - ``flatness``: ``floor`` and ``top``, where heights over the image were drawn
    - ``told``: the current stage's text on its result
    - ``outline``: (n, 2) metres in the map, of the top as it was fitted
    - ``found``: middle (2,) and reach, metres, of the surfaces that could have been the table
    """

    names: FrameNames | None = None
    recording: Recording | None = None
    start_ns: int = 0
    stamps_ns: list[int] = field(default_factory=list)
    localised: list[Pose2] = field(default_factory=list)
    cameras: list[tuple[Floats, Floats]] = field(default_factory=list)
    tops: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    clutter: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    laser_height: float = 0.1
    floor_z: float = 0.0
    height: float = 0.0
    centre: tuple[float, float] | None = None
    extent: float = 1.0
    yaw: float = 0.0
    doubts: frozenset[str] = frozenset()
    chosen: str = ""
    localised_way: Trajectory | None = None
    is_modelled: bool = False
    has_laser: bool = False
    has_labels: bool = False
    is_mended: bool = False
    flatness: set[str] = field(default_factory=set)
    has_colour: bool = False
    colour_fits: bool = True
    best: int | None = None
    told: str = ""
    outline: Floats | None = None
    found: tuple[tuple[float, float], float] | None = None
    stages: list[tuple[str, float | None]] = field(default_factory=list)
    reached: set[str] = field(default_factory=set)
    failed: bool = False
    tables: dict[int, DrawnScene] = field(default_factory=dict)
    pairs_reach: float | None = None
    pair_eye: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None

    @property
    def recorded_warnings(self) -> tuple[ProcessWarning, ...]:
        """What was said so far of the recording itself."""
        return tuple(self.recording.warnings) if self.recording else ()

    def snapshot_at(self, stamp_ns: int) -> int:
        """Return the number of the last snapshot taken by then; before the first, the first."""
        return max(bisect.bisect_right(self.stamps_ns, stamp_ns) - 1, 0)
