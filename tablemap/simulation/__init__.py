"""Simulated worlds and sensors: recordings whose truth is known."""

from typing import TYPE_CHECKING

from tablemap.imports import on_demand

if TYPE_CHECKING:
    from tablemap.simulation.recorder import write
    from tablemap.simulation.scenario import (
        SUITES,
        Scenario,
        error_names,
        load_scenario,
        scenario_names,
        suite,
        without,
    )
    from tablemap.simulation.simulation import Simulation, simulate

__all__ = [
    "SUITES",
    "Scenario",
    "Simulation",
    "error_names",
    "load_scenario",
    "scenario_names",
    "simulate",
    "suite",
    "without",
    "write",
]

_HOMES = dict.fromkeys(__all__, "tablemap.simulation.scenario") | {
    "Simulation": "tablemap.simulation.simulation",
    "simulate": "tablemap.simulation.simulation",
    "write": "tablemap.simulation.recorder",
}

__getattr__ = on_demand(__name__, _HOMES)
