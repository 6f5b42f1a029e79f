"""``results.npz``: what a run's review was drawn from."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tablemap.config import ReviewConfig
from tablemap.errors import TablemapError
from tablemap.files import whole_file
from tablemap.review.closing import Closing
from tablemap.review.keeping.codec import EVENTS, Encoder, decoded
from tablemap.review.keeping.recorded import (
    KeptRecording,
    RecordedFrames,
    RecordedStops,
    RecordedWarnings,
)
from tablemap.review.keeping.reduced import Reduction


class Keeper(Closing):
    """Writes the results and events of a run; call it with each of them.

    The file appears when it is closed, however the run ended. At level ``off`` there is none.
    Raises `TablemapError` if it cannot be written.
    """

    def __init__(self, path: Path, config: ReviewConfig) -> None:
        self._path = path
        self._reduced = Reduction(config)
        self._events: list[Any] = []
        self._held = ExitStack()
        self._file: zipfile.ZipFile | None = None
        if config.level != "off":
            part = self._held.enter_context(whole_file(path))
            self._file = self._held.enter_context(zipfile.ZipFile(part, "w"))
            self._encoder = Encoder(self._file)

    def __call__(self, event: object) -> None:
        """Keep one result or event."""
        if self._file is None:
            return
        try:
            for one in self._reduced(event):
                self._events.append(self._encoder.value(one))
            for image in self._reduced.needed(event):
                self._encoder.depth(image)
        except OSError as error:
            raise self._refused(error) from error

    def close(self) -> None:
        """Complete the file; a second call does nothing."""
        if self._file is None:
            return
        file, self._file = self._file, None
        try:
            text = json.dumps(self._events, separators=(",", ":"), allow_nan=False)
            file.writestr(EVENTS, text, zipfile.ZIP_DEFLATED)
            self._held.close()
        except FileNotFoundError:
            return  # the folder is gone: whoever completes the run says so
        except OSError as error:
            raise self._refused(error) from error

    def _refused(self, error: OSError) -> TablemapError:
        return TablemapError(
            f"the run's results cannot be written ({error.strerror}); free some space or choose "
            f"another --output: {self._path}"
        )


def replayed(file: Path) -> Iterator[object]:
    """Yield the results and events of a file as a reviewer takes them.

    Raises `TablemapError` if it cannot be read.
    """
    recording: KeptRecording | None = None
    for event in decoded(file):
        if isinstance(event, RecordedFrames):
            recording = KeptRecording(event)
            yield recording
        elif isinstance(event, RecordedStops) and recording is not None:
            recording.take_stops(event)
        elif isinstance(event, RecordedWarnings) and recording is not None:
            recording.warnings[:] = event.warnings
        else:
            yield event
