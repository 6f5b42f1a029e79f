"""Worlds and sensors, simulated: recordings whose truth is known."""

from tablemap.simulation.recorder import write
from tablemap.simulation.scenario import SUITES, Scenario, load_scenario, scenario_names, suite
from tablemap.simulation.simulation import Simulation, simulate

__all__ = [
    "SUITES",
    "Scenario",
    "Simulation",
    "load_scenario",
    "scenario_names",
    "simulate",
    "suite",
    "write",
]
