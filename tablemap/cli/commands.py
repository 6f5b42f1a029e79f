"""What every command of the command line has."""

from __future__ import annotations

import functools
import inspect
import traceback
from collections.abc import Callable
from contextvars import ContextVar
from typing import Annotated, Any

import typer
from typer.models import CommandFunctionType

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]

_before_the_command: ContextVar[bool] = ContextVar("debug", default=False)


def show_tracebacks(wanted: bool) -> None:
    """Let every command show where an error was raised, as ``tablemap --debug COMMAND`` asks."""
    _before_the_command.set(wanted)


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
            wanted = debug or _before_the_command.get()
            if wanted and not isinstance(error, (typer.Exit, typer.Abort)):
                traceback.print_exc()
            raise

    # Typer reads the options off the signature.
    signature = inspect.signature(command, eval_str=True)
    debug = inspect.Parameter(
        "debug", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Debug
    )
    parameters = [*signature.parameters.values(), debug]
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return run
