"""Whether the program that writes a run is still there.

A run that was killed leaves its manifest saying ``running``. The manifest names the process; where
that is on another machine, a file tells when it last showed signs of life.
"""

import os
import platform
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Self

from msgspec import Meta

from tablemap.model.documents import DocumentPart

HEARTBEAT = ".alive"
BEAT_SECONDS = 5.0
STALE_SECONDS = 600.0
"""A process of another machine that gave no sign for so long is gone. Clocks differ a little."""

LONGEST_SECONDS = 24 * 3600.0


class Writer(DocumentPart, frozen=True, kw_only=True):
    """The process that writes a run."""

    pid: Annotated[int, Meta(gt=0, lt=2**31, description="its number")]
    host: Annotated[str, Meta(description="name of the machine")]
    boot: Annotated[
        str | None,
        Meta(description="which start of the machine; null where it does not say"),
    ] = None
    began: Annotated[
        int | None,
        Meta(description="when the process began, in ticks since then; null where it is not said"),
    ] = None

    @staticmethod
    def this() -> "Writer":
        """Return this process."""
        pid = os.getpid()
        return Writer(pid=pid, host=platform.node(), boot=_boot(), began=_began(pid))

    @property
    def is_here(self) -> bool:
        """Whether it is or was a process of this machine."""
        return self.host == platform.node()


def is_alive(folder: Path, writer: Writer | None) -> bool:
    """Tell whether the process that writes a run is there.

    Where none is named, an older version wrote it: then it is for as long as a run may take.
    """
    if writer is None:
        return _changed_within(folder / "manifest.json", LONGEST_SECONDS)
    if not writer.is_here:
        return _changed_within(folder / HEARTBEAT, STALE_SECONDS)
    if writer.boot is not None and writer.boot != _boot():
        return False
    if writer.began is not None:
        return _began(writer.pid) == writer.began
    try:
        os.kill(writer.pid, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is there, and another user's
        return True
    return True


class Heart:
    """Keeps a run's heartbeat for as long as the context lasts; takes the file away at its end."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / HEARTBEAT
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="heartbeat", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(BEAT_SECONDS)
        with suppress(OSError):
            self._file.unlink(missing_ok=True)

    def _beat(self) -> None:
        while True:
            with suppress(OSError):  # a full disk or a folder that is gone is said by others
                if self._file.parent.is_dir():
                    self._file.touch()
            if self._stop.wait(BEAT_SECONDS):
                return


def _changed_within(file: Path, seconds: float) -> bool:
    try:
        return time.time() - file.stat().st_mtime < seconds
    except OSError:
        return False


def _boot() -> str | None:
    with suppress(OSError):
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    return None


def _began(pid: int) -> int | None:
    """Return when a process of this machine began; None where there is none, or it is not said.

    One that has ended and that nobody has asked for is none.
    """
    with suppress(OSError, ValueError, IndexError):
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        fields = text.rpartition(")")[2].split()  # the name before may hold anything
        return None if fields[0] in "ZX" else int(fields[19])
    return None
