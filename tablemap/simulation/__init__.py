"""Simulated worlds and sensors: recordings whose truth is known."""

from typing import TYPE_CHECKING

from tablemap.imports import on_demand

if TYPE_CHECKING:
    from tablemap.simulation.recorder import write
    from tablemap.simulation.scenario import Scenario
    from tablemap.simulation.scenario_files import SUITES, load_scenario, scenario_names, suite
    from tablemap.simulation.simulation import Simulation, simulate
    from tablemap.simulation.switching_off import error_names, without

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

_HOMES = dict.fromkeys(__all__, "tablemap.simulation.scenario_files") | {
    "Scenario": "tablemap.simulation.scenario",
    "error_names": "tablemap.simulation.switching_off",
    "without": "tablemap.simulation.switching_off",
    "Simulation": "tablemap.simulation.simulation",
    "simulate": "tablemap.simulation.simulation",
    "write": "tablemap.simulation.recorder",
}

__getattr__ = on_demand(__name__, _HOMES)
