"""``tablemap simulate``: a recording of a simulated table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from tablemap.cli import completing
from tablemap.cli.commands import Commands
from tablemap.cli.options import Json
from tablemap.cli.printing import aligned, say

commands = Commands()


@commands.command()
def simulate(
    scenario: Annotated[
        str,
        typer.Argument(
            help="Name of a scenario, or a TOML file.",
            metavar="SCENARIO",
            autocompletion=completing.scenarios,
        ),
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The MCAP to write.", metavar="FILE")
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Draws sizes, places, noise.", metavar="N")
    ] = 0,
    nominal: Annotated[
        bool, typer.Option("--nominal", help="Keep the scenario's sizes; draw the rest.")
    ] = False,
    profile: Annotated[
        Literal["ros1", "ros2"],
        typer.Option("--profile", help="Messages of ROS 1 or ROS 2.", case_sensitive=False),
    ] = "ros1",
    listing: Annotated[bool, typer.Option("--list", help="List the scenarios instead.")] = False,
    as_json: Json = False,
) -> None:
    """Write a recording of a simulated table, and NAME.truth.json beside it."""
    if listing:
        from tablemap.simulation import load_scenario, scenario_names

        known = [load_scenario(name) for name in scenario_names()]
        if as_json:
            keys = ("name", "description", "suites")
            listed = [{key: getattr(each, key) for key in keys} for each in known]
            say(json.dumps(listed, indent=1))
        else:
            say(aligned((each.name, each.description) for each in known))
        return
    if not scenario or output is None:
        raise typer.BadParameter("give a SCENARIO and --output FILE, or --list.")
    from tablemap.simulation import load_scenario, write
    from tablemap.simulation import simulate as simulate_scenario

    world = simulate_scenario(load_scenario(scenario), seed=seed, nominal=nominal)
    write(world, output, profile=profile)
    truth = output.with_name(f"{output.stem}.truth.json")
    document = {"recording": str(output), "truth": str(truth)}
    say(json.dumps(document) if as_json else output)
