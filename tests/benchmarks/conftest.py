"""Figures that benchmarks tell beside the tables of times: `make bench` prints them at its end."""

from __future__ import annotations

from collections.abc import Callable

import pytest

_told: list[str] = []


@pytest.fixture(scope="session")
def tell() -> Callable[[str], None]:
    """Take a line for the end of the output."""
    return _told.append


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the lines."""
    if _told:
        terminalreporter.section("figures")
        for line in _told:
            terminalreporter.write_line(line)
