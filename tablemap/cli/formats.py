"""Formats of exports, for the help."""

from __future__ import annotations

from typing import Any

from tablemap.cli.commands import Command


class ListsFormats(Command):
    """A command whose help ends with the list of formats."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:  # click's own, or typer's copy
        """Write each format's name and description."""
        from tablemap.export import all_formats

        with formatter.section("Formats"):
            formatter.write_dl([(each.name, each.description) for each in all_formats().values()])
