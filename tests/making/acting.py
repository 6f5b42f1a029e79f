"""A job that does what a recording's name says, in whatever process it runs."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

from tablemap.archive import RunFolder
from tablemap.events import StageStarted
from tablemap.inputs import AnyInput, Input
from tablemap.runs import Job
from tablemap.runs.running import Outcome


@dataclass(frozen=True)
class Acted(Job):
    """Leaves a run, none, or a dead process."""

    def __call__(self, recording: AnyInput, progress: Callable[[object], None]) -> Outcome:
        """Do what the name says."""
        progress(StageStarted("snapshots", 0))
        recording = Input.of(recording)
        if recording.stem.startswith("defect"):
            raise ValueError("of this recording")
        if recording.stem.startswith("hungry"):
            raise MemoryError
        run = RunFolder.create(
            self.output, recording, method="tablemap", tables="best", config=self.config
        )
        first = len(list(run.path.parent.iterdir())) == 1
        if recording.stem.startswith("deadly") or (recording.stem == "once" and first):
            os.kill(os.getpid(), signal.SIGKILL)
        try:
            for _ in range(1000 if recording.stem.startswith("endless") else 0):
                progress(StageStarted("registration", 1))
                time.sleep(0.1)
        except KeyboardInterrupt:
            run.finish("interrupted", error="interrupted during registration")
            raise
        run.finish("ok")
        return Outcome(recording, run, "ok", None, None)
