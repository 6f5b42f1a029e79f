"""What every command of the command line has."""

from __future__ import annotations

import functools
import inspect
import traceback
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.models import CommandFunctionType

_DEBUG = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]


class Commands(typer.Typer):
    """A group of commands, each of which takes ``--debug``."""

    def command(
        self, name: str | None = None, **options: Any
    ) -> Callable[[CommandFunctionType], CommandFunctionType]:
        """See `typer.Typer.command`."""
        register = super().command(name, **options)

        def registered(command: CommandFunctionType) -> CommandFunctionType:
            register(_showing_tracebacks(command))
            return command

        return registered


def _showing_tracebacks(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return the command with the option that shows where an error was raised."""

    @functools.wraps(command)
    def run(*, debug: bool, **given: Any) -> Any:
        try:
            return command(**given)
        except Exception as error:
            if debug and not isinstance(error, (typer.Exit, typer.Abort)):
                traceback.print_exc()
            raise

    # Typer reads the options off the signature.
    signature = inspect.signature(command, eval_str=True)
    debug = inspect.Parameter(
        "debug", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=_DEBUG
    )
    parameters = [*signature.parameters.values(), debug]
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return run
