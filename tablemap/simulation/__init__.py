"""Simulated worlds and sensors: recordings whose truth is known."""

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
