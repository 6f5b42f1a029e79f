"""Laps through made-up rooms that are registered, with the wheels as their odometry."""

from __future__ import annotations

from dataclasses import replace

from tablemap.config import OdometryConfig, RegistrationConfig, SensorsConfig
from tablemap.errors import EstimationError
from tablemap.events import Record, ignore
from tablemap.stages.odometry import Odometry, estimate_odometry
from tablemap.stages.outline import Outline
from tablemap.stages.registration import Registration, register
from tests.making.rooms import Drive, room

SENSORS = SensorsConfig()


def no_edges() -> Outline:
    """Fail as `find_edges` does where no view shows the top."""
    raise EstimationError("no edges of the table top")


def estimated(drive: Drive, record: Record = ignore) -> Odometry:
    """Run odometry over a drive."""
    return estimate_odometry(
        drive.recording(),
        drive.snapshots(),
        config=OdometryConfig(),
        sensors=SENSORS,
        record=record,
    )


def carried(drive: Drive) -> Odometry:
    """Return the wheels as odometry: its own tests are elsewhere."""
    return estimated(replace(drive, laser=False))


def run(
    drive: Drive, odometry: Odometry, config: RegistrationConfig | None = None
) -> tuple[Registration, list[object]]:
    """Register a drive's stops and return the result with the events."""
    events: list[object] = []
    result = register(
        drive.recording(),
        drive.snapshots(),
        odometry,
        edges=no_edges,
        config=config or RegistrationConfig(),
        sensors=SENSORS,
        record=events.append,
    )
    return result, events


def small(seed: int, **changes: object) -> Drive:
    """A lap of six short stops at the laser's reduced rate."""
    return Drive(room(seed), seed=seed, stops=6, standing_s=1.0, rate_hz=12, **changes)  # type: ignore[arg-type]
