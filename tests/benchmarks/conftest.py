"""`make bench` prints a table of figures at its end, as the README has it."""

from __future__ import annotations

import compileall
import os
import platform
from pathlib import Path

import pytest

import tablemap
from tests.making.figures import Figures

# Programs are measured as they are installed: with compiled modules.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
compileall.compile_dir(Path(tablemap.__file__).parent, quiet=1)

_figures = Figures()


@pytest.fixture(scope="session")
def figures() -> Figures:
    """The table that is printed at the end."""
    return _figures


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the table, and which machine this is."""
    if not _figures.rows:
        return
    names = [
        line.partition(":")[2].strip()
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        if line.startswith("model name")
    ]
    machine = names[0] if names else platform.processor()
    terminalreporter.section("for the README")
    terminalreporter.write_line(
        f"Processor time, reviews included, on {os.cpu_count()} cores ({machine}); `make bench` "
        "prints this table:\n"
    )
    for line in _figures.markdown():
        terminalreporter.write_line(line)
