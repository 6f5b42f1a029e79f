"""``tablemap runs``: the archive of run folders."""

from __future__ import annotations

from typing import ClassVar

from tablemap.cli.commands import Commands, OnDemand


class EveryRunsCommand(OnDemand):
    """Every command on run folders."""

    homes: ClassVar = {
        name: f"tablemap.cli.runs.{module}"
        for module, names in {
            "listing": ("list",),
            "looking": ("show", "compare", "verify"),
            "changing": ("reprocess", "redraw", "prune"),
            "moving": ("pack", "unpack", "serve"),
        }.items()
        for name in names
    }


commands = Commands(name="runs", cls=EveryRunsCommand, no_args_is_help=True)


@commands.callback()
def runs() -> None:
    """List, compare, check, repeat, remove, move and serve runs."""
