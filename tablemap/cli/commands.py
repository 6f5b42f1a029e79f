"""What every command of the command line has."""

from __future__ import annotations

import functools
import inspect
import traceback
from collections.abc import Callable
from contextvars import ContextVar
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, ClassVar

import typer
from typer.core import TyperCommand, TyperGroup
from typer.models import CommandFunctionType

from tablemap.remote import SCHEMES

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]

_before_the_command: ContextVar[bool] = ContextVar("debug", default=False)


def show_tracebacks(wanted: bool) -> None:
    """Let every command show where an error was raised, as ``tablemap --debug COMMAND`` asks."""
    _before_the_command.set(wanted)


class Command(TyperCommand):
    """A command whose usage has what it needs without braces: shells expand them."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return what stands after the command's name, such as ``[OPTIONS] RECORDING...``."""
        return [piece.strip("{}") for piece in super().collect_usage_pieces(ctx)]


class Commands(typer.Typer):
    """A group of commands, each of which takes ``--debug``, and no servers where it takes paths."""

    def __init__(self, **options: Any) -> None:
        plain = {"add_completion": False, "rich_markup_mode": None}
        super().__init__(**{**plain, **options})

    def command(
        self, name: str | None = None, **options: Any
    ) -> Callable[[CommandFunctionType], CommandFunctionType]:
        """See `typer.Typer.command`."""
        register = super().command(name, **{"cls": Command, **options})

        def registered(command: CommandFunctionType) -> CommandFunctionType:
            register(_showing_tracebacks(_on_this_machine(command)))
            return command

        return registered


class OnDemand(TyperGroup):
    """A group whose commands are imported when they are asked for.

    ``homes`` has the module of each command, in the order of the help. A module's ``commands`` has
    the command of that name, or is the group of that name.
    """

    homes: ClassVar[dict[str, str]]

    def list_commands(self, ctx: Any) -> list[str]:
        """See `typer.core.TyperGroup.list_commands`."""
        return list(self.homes)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """See `typer.core.TyperGroup.get_command`."""
        return _imported(self.homes[cmd_name], cmd_name) if cmd_name in self.homes else None


@functools.cache
def _imported(home: str, name: str) -> Any:
    found = typer.main.get_command(import_module(home).commands)
    return found.commands.get(name, found) if isinstance(found, TyperGroup) else found


def _on_this_machine(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return the command, which refuses places on a server where it takes paths.

    A path has lost one slash of ``s3://``; it would be read or made as a folder of that name.
    """

    @functools.wraps(command)
    def run(**given: Any) -> Any:
        values = [each for one in given.values() for each in (one if _is_list(one) else [one])]
        for path in values:
            scheme, colon, rest = str(path).partition(":/")
            if isinstance(path, Path) and colon and scheme in SCHEMES:
                raise typer.BadParameter(
                    f"expected a path of this machine, found {scheme}://{rest.lstrip('/')}; copy "
                    "what is there to this machine, or what is written here to the server, as with "
                    "aws s3 sync."
                )
        return command(**given)

    run.__signature__ = inspect.signature(command, eval_str=True)  # type: ignore[attr-defined]
    return run


def _is_list(given: object) -> bool:
    return isinstance(given, (list, tuple))


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
    # Its annotations are evaluated. Typer would evaluate the command's own three times more.
    run.__annotations__ = {}
    return run
