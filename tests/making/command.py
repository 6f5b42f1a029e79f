"""The command as a shell runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

TABLEMAP = [sys.executable, "-c", "from tablemap.cli import main; main()"]


def tablemap(
    *arguments: object, cwd: Path | None = None, colours: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run the command and wait for it; with ``colours`` it is free to print them."""
    quiet = {} if colours else {"NO_COLOR": "1"}
    return subprocess.run(
        [*TABLEMAP, *(str(argument) for argument in arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env={**os.environ, "COLUMNS": "100", **quiet},
        timeout=300,
    )
