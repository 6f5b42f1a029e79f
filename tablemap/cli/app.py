"""The application: it turns an error into one sentence and an exit code."""

from __future__ import annotations

import errno
import shutil
import sys
from typing import Annotated, ClassVar

import typer

from tablemap.cli.commands import Commands, Debug, OnDemand, show_tracebacks
from tablemap.cli.printing import complain, say
from tablemap.errors import ConfigError, TablemapError
from tablemap.imports import (
    hide_pandas,
    without_pydantic_plugins,
    without_scipy_notes,
)
from tablemap.interrupts import Interrupts
from tablemap.version import __version__


class EveryCommand(OnDemand):
    """Every command of the program."""

    homes: ClassVar = {
        name: f"tablemap.cli.{name}"
        for name in (
            *("process", "info", "convert", "view", "export", "simulate"),
            *("evaluate", "config", "schema", "runs"),
        )
    }


app = Commands(
    name="tablemap",
    cls=EveryCommand,
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={
        "help_option_names": ["-h", "--help"],
        "max_content_width": shutil.get_terminal_size().columns,
    },
)


def run(commands: Commands, interrupts: Interrupts) -> None:
    """Run the command line; turn an error into one sentence and an exit code."""
    hide_pandas()
    without_pydantic_plugins()
    without_scipy_notes()
    try:
        commands()
    except SystemExit as end:
        told = interrupts.received
        # A run that a signal broke off ends with 1, as any that is not complete.
        sys.exit(128 + told[0] if told and end.code in (1, 130) else end.code)
    except Exception as error:
        if interrupts.received:  # compiled code made another error of it
            sys.exit(128 + interrupts.received[0])
        complain(_sentence(error))
        sys.exit(2 if isinstance(error, ConfigError) else 1)


def _sentence(error: Exception) -> str:
    if isinstance(error, TablemapError):
        return str(error)
    if isinstance(error, MemoryError):
        return "the memory does not suffice; free some, or lower the settings of [limits]."
    if isinstance(error, OSError) and error.strerror:  # the disk's word, met outside a run
        next_step = _NEXT_STEPS.get(error.errno or 0, "")
        said = f"{error.strerror}; {next_step}" if next_step else error.strerror
        return f"{said}{f': {error.filename}' if error.filename else '.'}"
    return (
        f"this is a defect of tablemap: {type(error).__name__}: {error}; "
        "run again with --debug and report what it prints."
    )


_NEXT_STEPS = {
    errno.ENOSPC: "free some space, or write to another place",
    errno.EDQUOT: "free some of your quota, or write to another place",
    errno.EROFS: "write to another place",
}


def _print_version(wanted: bool) -> None:
    if wanted:
        say(f"tablemap {__version__}")
        raise typer.Exit


@app.callback()
def tablemap(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
    debug: Debug = False,
) -> None:
    """Turn a robot's recording of a table into a model of the table."""
    show_tracebacks(debug)
