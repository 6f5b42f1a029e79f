"""The command line: parse, call the library, print; a module a command.

Results go to stdout, messages for people to stderr. Heavy imports are inside of the commands.
"""

from __future__ import annotations

import signal
import sys

from tablemap.interrupts import Interrupts

__all__ = ["main"]

GRACE_SECONDS = 10.0
"""Signals that come so soon after the first count for nothing: a run is being marked."""


def main() -> None:
    """Run the command line. Signals are heard before anything else is imported."""
    interrupts = Interrupts(grace_seconds=GRACE_SECONDS)
    interrupts.listen()
    try:
        from tablemap.imports import collect_rarely

        collect_rarely()
        from tablemap.cli.app import app, run

        run(app, interrupts)
    except KeyboardInterrupt:  # before Typer takes care of them
        sys.exit(128 + (interrupts.received or [signal.SIGINT])[0])
