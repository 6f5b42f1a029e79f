"""The command: as a shell runs it, or in this process, which spares its imports."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
from pathlib import Path
from unittest import mock

from tablemap.interrupts import SIGNALS

TABLEMAP = [sys.executable, "-c", "from tablemap.cli import main; main()"]
WIDTH = {"COLUMNS": "100"}
PLAIN = {**WIDTH, "NO_COLOR": "1"}


LISTS_IMPORTS = """
import atexit, pathlib, sys
listing = pathlib.Path(sys.argv.pop(1))
atexit.register(lambda: listing.write_text("\\n".join(m for m in sys.modules if sys.modules[m])))
"""


def tablemap(
    *arguments: object, cwd: Path | None = None, colours: bool = False, imports: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run the command and wait for it; with ``colours`` it is free to print them.

    The names of all modules that it imported go to the file ``imports``, a line each.
    """
    command = list(TABLEMAP)
    if imports is not None:
        command[-1] = LISTS_IMPORTS + command[-1]
        command.append(str(imports))
    return subprocess.run(
        [*command, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env={**os.environ, **(WIDTH if colours else PLAIN)},
        timeout=300,
    )


def tablemap_here(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Do what the command does in this process, its exit code and both outputs included."""
    from tablemap.cli import main

    out, err, code = io.StringIO(), io.StringIO(), None
    heard = {each: signal.getsignal(each) for each in SIGNALS}
    with (
        mock.patch.object(sys, "argv", ["tablemap", *map(str, arguments)]),
        mock.patch.dict(os.environ, PLAIN),
        contextlib.chdir(cwd or Path.cwd()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code
        finally:
            for each, handler in heard.items():
                signal.signal(each, handler)
    assert code is None or isinstance(code, int), code
    return subprocess.CompletedProcess(sys.argv, code or 0, out.getvalue(), err.getvalue())
