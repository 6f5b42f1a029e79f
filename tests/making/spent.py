"""What a program takes: processor time, wall time and memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
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


WATCHES = """
import json, os, subprocess, sys, time
began = time.monotonic()
process = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
status, usage = os.wait4(process.pid, 0)[1:]
wall = time.monotonic() - began
print(json.dumps([usage.ru_utime + usage.ru_stime, wall, 1024 * usage.ru_maxrss]))
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""A small program that starts another one: a process begins with the peak of who started it."""


def spend(*command: object) -> Spent:
    """Run a program to its end, its output dropped. Raises `AssertionError` where it fails."""
    watched = [sys.executable, "-c", WATCHES, *map(str, command)]
    done = subprocess.run(watched, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return Spent(*json.loads(done.stdout))


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
