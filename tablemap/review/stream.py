"""The open .rrd: timelines, frames, and a bounded queue before the disk."""

from __future__ import annotations

import ctypes
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from tablemap import palette
from tablemap.config import ReviewConfig
from tablemap.errors import TablemapError
from tablemap.geometry import Floats, Ints
from tablemap.recording import Recording
from tablemap.review.scene import DrawnScene
from tablemap.review.schema import SCHEMA, described

APPLICATION = "tablemap"
FLUSH_SECONDS = 1.0
STUCK_SECONDS = 20.0
"""A file that has not grown for so long, with rows waiting, grows no more."""

LEAST_FREE_BYTES = 64 * 1024
HEAVY = (rr.Points3D, rr.EncodedDepthImage, rr.EncodedImage, rr.SegmentationImage)
HEAVY_BETWEEN_FLUSHES = 10
_abandoned: list[rr.RecordingStream] = []
"""Streams whose files could not be completed; see `Stream`."""


def _of_names(texts: Sequence[str], *, shown: bool) -> dict[str, Any]:
    return {
        "labels": texts,
        "colors": [palette.LABEL],
        "radii": rr.Radius.ui_points(0.0),
        "show_labels": shown,
    }


def sensor_times(stamps_ns: Sequence[int] | Ints) -> rr.TimeColumn:
    """Return stamps as times of the recording's clock."""
    stamps = np.asarray(stamps_ns, dtype=np.int64).astype("datetime64[ns]")
    return rr.TimeColumn("sensor_time", timestamp=stamps)


class Stream:
    """An .rrd that is being written: every row gets its frame and its place on the timelines."""

    def __init__(
        self, path: Path, *, run_id: str, recording_name: str, config: ReviewConfig
    ) -> None:
        self.path = path
        self.config = config
        self.scene = DrawnScene()
        self.stage = 0
        self._below = ""
        self._frames: dict[str, str] = {}
        self._heavy = 0
        self._open = True
        self._lost = False
        self.rec = rr.RecordingStream(APPLICATION, recording_id=run_id)
        self.rec.set_log_time_enabled(False)
        self.rec.set_log_tick_enabled(False)
        try:
            self.rec.save(path)
        except Exception as error:
            raise TablemapError(f"the review file cannot be opened ({error}): {path}") from error
        self.rec.send_recording_name(recording_name)
        self.rec.send_property(
            "review", rr.AnyValues(schema=SCHEMA, level=config.level, entities=described())
        )
        self.rec.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self.flush()
        if not path.is_file():
            raise TablemapError(
                f"the review file was not made; is RERUN=off set in the environment? {path}"
            )

    def say_first_view(self) -> None:
        """Write into the file which snapshot a viewer is to begin with, where there is a best."""
        if self.scene.best is not None:
            self.rec.send_property("first_view", rr.AnyValues(snapshot=self.scene.best))

    def open_recording(self, recording: Recording) -> None:
        """Take frames and times of the recording to which the next rows belong."""
        scene = self.scene
        scene.recording, scene.names = recording, recording.names
        scene.start_ns = recording.start_ns

    @property
    def map_frame(self) -> str:
        """The recording's fixed frame."""
        return self.scene.names.fixed if self.scene.names else "map"

    def at(self, stamp_ns: int, *, snapshot: int | None = None) -> None:
        """Let the next rows belong to a sensor time, and to a snapshot if one is named."""
        self.rec.reset_time()
        self.rec.set_time("stage", sequence=self.stage)
        self.rec.set_time("sensor_time", timestamp=np.datetime64(stamp_ns, "ns"))
        if snapshot is not None:
            self.rec.set_time("snapshot", sequence=snapshot)

    def at_stop(self, stamp_ns: int, snapshot: int) -> None:
        """Let the next rows say which stop is the current one: on its timelines, not by stage."""
        self.at(stamp_ns, snapshot=snapshot)
        self.rec.disable_timeline("stage")

    def at_iteration(self, step: int) -> None:
        """Let the next rows belong only to a step of ICP."""
        self.rec.reset_time()
        self.rec.set_time("iteration", sequence=step)

    def at_stage(self) -> None:
        """Let the next rows belong only to the current stage."""
        self.rec.reset_time()
        self.rec.set_time("stage", sequence=self.stage)

    def hold(self) -> None:
        """Let the next rows hold for the whole recording, from the current stage on."""
        if self.scene.start_ns:
            self.at(self.scene.start_ns, snapshot=0)
        else:  # the recording's clock is unknown before it is open
            self.at_stage()
            self.rec.set_time("snapshot", sequence=0)
        self.rec.set_time("iteration", sequence=0)

    def hold_in_drive(self) -> None:
        """Let the next rows hold for the whole recording, but not on the timeline of stages."""
        self.hold()
        self.rec.disable_timeline("stage")

    @contextmanager
    def within(self, path: str, scene: DrawnScene) -> Iterator[None]:
        """Put rows logged in this context below an entity, and use another scene for them."""
        outer = self._below, self.scene
        self._below, self.scene = f"{path}/", scene
        try:
            yield
        finally:
            self._below, self.scene = outer

    def log(self, path: str, *what: rr.AsComponents, frame: str | None = None) -> None:
        """Log something in space, in a named frame (the fixed one if none is named)."""
        named, entity = frame or self.map_frame, self._below + path
        if self._frames.get(entity) != named:
            self.rec.log(entity, rr.CoordinateFrame(named), static=True)
            self._frames[entity] = named
        self.log_flat(path, *what)

    def names(
        self,
        path: str,
        places: npt.ArrayLike,
        texts: Sequence[str],
        *,
        shown: bool = True,
        frame: str | None = None,
        leaders: Sequence[Floats] | None = None,
    ) -> None:
        """Log texts at places (n, 3): an entity of its own, as all labels have one colour.

        What they name has the same texts as labels that show on hovering. ``leaders`` are lines
        (2, 3) from what is named to texts that stand aside, in place of earlier ones.
        """
        self.log(
            path, rr.Points3D(np.asarray(places), **_of_names(texts, shown=shown)), frame=frame
        )
        if leaders is not None:
            self.log(
                f"{path}/leaders",
                rr.LineStrips3D(
                    np.array(leaders if shown else []).reshape(-1, 2, 3),
                    colors=[palette.TEXT.on_dark],
                    radii=rr.Radius.ui_points(0.5),
                ),
                frame=frame,
            )

    def flat_names(self, path: str, places: npt.ArrayLike, texts: Sequence[str]) -> None:
        """Log texts at places (n, 2) of a plot."""
        self.log_flat(path, rr.Points2D(np.asarray(places), **_of_names(texts, shown=True)))

    def log_flat(self, path: str, *what: rr.AsComponents) -> None:
        """Log something without a place in space: text, plots, images."""
        for one in what:
            self.rec.log(self._below + path, one)
            if isinstance(one, HEAVY):
                self._heavy += 1
        if self._heavy >= HEAVY_BETWEEN_FLUSHES:
            self.flush()

    def say(self, message: str, *, level: str = "INFO") -> None:
        """Log a line of text.

        Each level has an entity of its own: of lines at one time the viewer mixes up the levels.
        """
        self.log_flat(f"log/{level.lower()}", rr.TextLog(message, level=level))

    def text(self, path: str, markdown: str) -> None:
        """Log a page of markdown; one about a stage's result is kept for the stage's summary."""
        if not self._below and path != "summary" and self._is_of_the_stage(path):
            self.scene.told = markdown
        markdown = markdown.replace("recording://", f"recording://{self._below}")
        self.log_flat(path, rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN))

    def _is_of_the_stage(self, path: str) -> bool:
        """Tell whether a page is about the running stage, and not about an earlier one again."""
        room, _, page = path.partition("/")
        running = [name for name, seconds in self.scene.stages if seconds is None]
        return not running or (room, page) == (running[-1], "summary") or page == running[-1]

    def transform(self, path: str, parent: str, child: str, pose: Floats) -> None:
        """Log the (4, 4) pose ``parent_from_child`` as a named relation."""
        self.rec.log(
            path,
            rr.Transform3D(
                translation=pose[:3, 3],
                mat3x3=pose[:3, :3],
                parent_frame=parent,
                child_frame=child,
            ),
        )

    def transforms(
        self, path: str, parent: str, child: str, times: rr.TimeColumn, poses: Floats
    ) -> None:
        """Log (n, 4, 4) poses ``parent_from_child`` over the n times in one go."""
        columns = rr.Transform3D.columns(
            translation=poses[:, :3, 3],
            mat3x3=poses[:, :3, :3],
            parent_frame=[parent] * len(poses),
            child_frame=[child] * len(poses),
        )
        self.rec.send_columns(path, indexes=[times], columns=columns)

    def series(self, path: str, colour: palette.Colour) -> None:
        """Give the line of a plot its colour, for the whole file."""
        self.rec.log(self._below + path, rr.SeriesLines(colors=[colour], widths=[2.0]), static=True)

    def plot(self, path: str, times: rr.TimeColumn, values: Floats, colour: palette.Colour) -> None:
        """Log n numbers over the n times in one go, as a line of that colour."""
        self.series(path, colour)
        columns = rr.Scalars.columns(scalars=np.asarray(values, dtype=np.float64))
        self.rec.send_columns(path, indexes=[times], columns=columns)

    def plots(
        self,
        path: str,
        times: rr.TimeColumn,
        values: Floats,
        *,
        colours: Sequence[palette.Colour],
        names: Sequence[str],
    ) -> None:
        """Log (n, m) numbers over the n times as m lines, each with its colour and name.

        A line has no point where its number is NaN.
        """
        lines = rr.SeriesLines(colors=colours, widths=[2.0] * len(names), names=names)
        self.rec.log(self._below + path, lines, static=True)
        self.rec.send_columns(path, indexes=[times], columns=rr.Scalars.columns(scalars=values))

    def show(self, layout: rrb.Blueprint) -> None:
        """Send a layout, which takes the place of earlier ones.

        Rerun's own method leaves a stream in memory for each layout, with two threads: that stream
        and its rows hold each other. Here it is disconnected, and so let go.
        """
        if not self._open:
            return
        rows = rr.RecordingStream._from_native(
            rerun_bindings.new_blueprint(
                application_id=APPLICATION, make_default=False, make_thread_default=False
            )
        )
        rows.set_time("blueprint", sequence=0)
        layout._log_to_stream(rows)
        storage = rows.memory_recording().storage
        rerun_bindings.send_blueprint(storage, True, True, recording=self.rec.to_native())
        rows.disconnect()

    def flush(self) -> None:
        """Wait until all rows are on the disk.

        Raises `TablemapError` if they cannot be written. The queue before the disk is unbounded and
        reports no errors itself, so this waits.
        """
        self._heavy = 0
        if self._lost:
            raise TablemapError(f"the review file cannot be written any more: {self.path}")
        size, grew = self._size(), time.monotonic()
        while True:
            asked = time.monotonic()
            try:
                self.rec.flush(timeout_sec=FLUSH_SECONDS)
                return
            except Exception as error:
                # A slow disk goes on writing. A thread that has met a full one answers no more, or
                # at once that it has ended.
                now = self._size()
                has_ended = time.monotonic() - asked < FLUSH_SECONDS / 2
                if now > size and not has_ended:
                    size, grew = now, time.monotonic()
                elif has_ended or self._is_full() or time.monotonic() - grew > STUCK_SECONDS:
                    self._abandon()
                    why = "the disk is full" if self._is_full() else error
                    raise TablemapError(
                        f"the review file cannot be written ({why}); free some space or choose "
                        f"another --output: {self.path}"
                    ) from error

    def _size(self) -> int:
        try:
            return self.path.stat().st_size
        except OSError:
            return -1

    def _is_full(self) -> bool:
        try:
            return shutil.disk_usage(self.path.parent).free < LEAST_FREE_BYTES
        except OSError:
            return True  # the folder is gone

    def _abandon(self) -> None:
        """Give up a file that takes no more rows.

        Rerun would wait for its rows for ever: at a disconnect, at the deletion of the stream and
        at the end of the program. This method avoids all three.
        """
        self._lost, self._open = True, False
        rr.unregister_shutdown()
        _abandoned.append(self.rec)
        for held in (_abandoned, self.rec, self.rec.inner):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))

    def close(self) -> None:
        """Write the remaining rows and the footer; a second call does nothing.

        Raises `TablemapError` if the last rows cannot be written.
        """
        if not self._open:
            return
        self.flush()
        self._open = False
        self.rec.disconnect()
        # Rerun keeps a stream that is gone, with two threads, until it is told to look.
        del self.rec
        rerun_bindings.flush_and_cleanup_orphaned_recordings()
