"""What a program takes: processor time, wall time and memory."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Spent:
    """Of one run of a program and its children.

    - ``processor``: seconds of all of them, those of their system calls too
    - ``wall``: seconds until the program ended
    - ``peak``: bytes of memory, at most, of the largest of them
    """

    processor: float
    wall: float
    peak: int


def spend(*command: object) -> Spent:
    """Run a program to its end, its output dropped. Raises `AssertionError` where it fails."""
    with tempfile.TemporaryFile() as said:
        began = time.monotonic()
        process = subprocess.Popen(
            [*map(str, command)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=said
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.monotonic() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        assert process.returncode == 0, said.read().decode(errors="replace")
    return Spent(usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss * 1024)


def least(*command: object, rounds: int = 3) -> Spent:
    """Return the run of a program that took the least processor time, out of a few."""
    return min((spend(*command) for _ in range(rounds)), key=lambda spent: spent.processor)


@dataclass(frozen=True)
class Moment:
    """The state of a program when it printed a line.

    - ``processor``, ``wall``: seconds since its start; the first without its children
    - ``memory``: bytes in use
    - ``threads``, ``files``: how many it has, and has open
    """

    processor: float
    wall: float
    memory: int
    threads: int
    files: int


def moments(*command: object) -> list[Moment]:
    """Run a program to its end; return its state at each line that it printed (on Linux)."""
    found = []
    with tempfile.TemporaryFile() as said:
        began = time.monotonic()
        process = subprocess.Popen(
            [*map(str, command)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said
        )
        assert process.stdout is not None
        there = Path(f"/proc/{process.pid}")
        for _ in process.stdout:
            wall = time.monotonic() - began
            # After the program's name, which may hold anything: proc_pid_stat(5).
            fields = (there / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            ticks = int(fields[11]) + int(fields[12])
            found.append(
                Moment(
                    processor=ticks / os.sysconf("SC_CLK_TCK"),
                    wall=wall,
                    memory=int(fields[21]) * os.sysconf("SC_PAGE_SIZE"),
                    threads=int(fields[17]),
                    files=len(list((there / "fd").iterdir())),
                )
            )
        code = process.wait()
        said.seek(0)
        assert code == 0, said.read().decode(errors="replace")
    return found
