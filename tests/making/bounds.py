"""What is said of a recording, here and by programs with little memory and time."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

from tablemap.config import LimitsConfig
from tablemap.errors import TablemapError
from tablemap.recording import inspect, open_recording

MEMORY = 2**30
SECONDS = 10
INFO = "from tablemap.cli import main; main()"
READ = """
import sys
from pathlib import Path
from tablemap.errors import TablemapError
from tablemap.recording import open_recording
try:
    with open_recording(Path(sys.argv[1])) as recording:
        print(sum(1 for _ in recording.depth_frames()), sum(1 for _ in recording.scans()))
        print(*(warning.message for warning in recording.warnings), sep="\\n")
except TablemapError as error:
    print(error)
"""


def said(path: Path, limits: LimitsConfig) -> str:
    """Return all that is said of a recording by `inspect` and when it is read."""
    words: list[str] = []
    try:
        found = inspect(path, limits=limits)
        words += [*found.missing, *(each.message for each in found.warnings)]
        words += [topic.problem or "" for topic in found.topics]
    except TablemapError as error:
        words.append(str(error))
    try:
        with open_recording(path, limits=limits) as recording:
            list(recording.depth_frames())
            list(recording.scans())
            words += [each.message for each in recording.warnings]
    except TablemapError as error:
        words.append(str(error))
    return "\n".join(words)


def limited() -> None:
    """Give a program a gigabyte and ten seconds."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))


def check_bounded(path: Path) -> None:
    """Fail where `info` or the library takes more than that, or says no sentence of a recording."""
    for code, arguments in ((INFO, ["info", path]), (READ, [path])):
        done = subprocess.run(
            [sys.executable, "-c", code, *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=limited,
            timeout=300,
        )
        assert done.returncode in (0, 1), (done.returncode, done.stderr[-500:])
        assert "Traceback" not in done.stderr, done.stderr[-500:]
        assert "defect" not in done.stderr
        assert len(done.stdout) + len(done.stderr) < 300_000
