"""The Rerun Viewer as a separate program, on this machine only."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import quote

from tablemap.archive.fetching import copied_run, is_run
from tablemap.archive.folder import of_several
from tablemap.errors import ExternalToolError, TablemapError
from tablemap.paths import AnyPath, as_path
from tablemap.remote import is_remote

LOOPBACK = "127.0.0.1"
START_SECONDS = 2.0
SERVE_SECONDS = 20.0
LOAD_SECONDS = 10.0
MAGIC = b"RRF"
FOOTER = b"RRF2FOOT"
FOOTER_TAIL = 64  # bytes at the end of a complete file that contain the footer's mark


def viewer_environment() -> dict[str, str]:
    """Return our environment, with the viewer's usage statistics off, and a place for sockets."""
    return {"XDG_RUNTIME_DIR": tempfile.gettempdir(), **os.environ, "CI": "1"}


def viewer_program() -> Path:
    """Return the viewer that came with the rerun package.

    Raises `ExternalToolError` if there is none.
    """
    found = importlib.util.find_spec("rerun_cli")
    folder = Path(found.origin).parent if found and found.origin else None
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    if folder is None or not (folder / name).is_file():
        raise ExternalToolError(
            "the Rerun Viewer is not installed; install it with `pip install rerun-sdk`."
        )
    return folder / name


def rrd_tool(
    *arguments: str | Path, seconds: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run one of the viewer's tools for .rrd files, and wait for it, ``seconds`` at most.

    Raises `ExternalToolError` if there is no viewer.
    """
    return viewer_tool("rrd", *arguments, seconds=seconds)


def viewer_tool(
    *arguments: str | Path, seconds: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run one of the viewer's tools, and wait for it; see `rrd_tool`."""
    return subprocess.run(
        [str(viewer_program()), *map(str, arguments)],
        env=viewer_environment(),
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=seconds,
    )


def launch(
    *arguments: str, stdin: int | None = None, stderr: int = subprocess.DEVNULL
) -> subprocess.Popen[bytes]:
    """Start the viewer's program in its own session, silent unless a stream is asked for.

    Raises `ExternalToolError` if there is none, or it cannot be started.
    """
    command = [str(viewer_program()), *arguments]
    try:
        return subprocess.Popen(
            command,
            env=viewer_environment(),
            stdin=stdin,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            start_new_session=True,
        )
    except OSError as error:
        raise ExternalToolError(f"the Rerun Viewer cannot be started: {error}") from error


def review_file(path: AnyPath) -> Path:
    """Return the .rrd of a run folder, of a recording's last run, or the file itself.

    A recording's last run is ``latest``; if none left a model, it is the one that began last.
    Raises `TablemapError` if there is none.
    """
    path = copied_run(path) if isinstance(path, str) and is_remote(path) else as_path(path)
    if not path.is_dir():
        candidates = [path]
    else:
        candidates = [path / "run.rrd", path / "latest" / "run.rrd"]
        candidates += sorted(path.glob("*/run.rrd"), reverse=True)
    file = next((one for one in candidates if one.is_file()), None)
    if file is None:
        raise TablemapError(
            of_several(path, path) or f"expected a run folder or an .rrd, found neither: {path}"
        )
    return file


def is_review(path: AnyPath) -> bool:
    """Tell whether a path is a run, a recording's folder of runs or an .rrd, and no recording.

    Raises `TablemapError` if there is nothing of that name.
    """
    if isinstance(path, str) and is_remote(path):
        return is_run(path)
    local = as_path(path)
    if not local.exists():
        raise TablemapError(
            f"expected a run folder, an .rrd or a recording, found none of them: {path}"
        )
    if local.is_dir():
        return any(
            next(local.glob(f"{where}{file}"), None)
            for where in ("", "*/", "*/*/")
            for file in ("run.rrd", "manifest.json")
        )
    with local.open("rb") as stream:
        return local.suffix == ".rrd" or stream.read(len(MAGIC)) == MAGIC


def is_whole(file: Path) -> bool:
    """Tell whether an .rrd has its footer: a killed or running run has not written one."""
    with file.open("rb") as stream:
        stream.seek(max(file.stat().st_size - FOOTER_TAIL, 0))
        return FOOTER in stream.read()


def is_cut(file: Path) -> bool:
    """Tell whether a file begins as an .rrd and lacks its footer."""
    with file.open("rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC and not is_whole(file)


def mended(file: Path, folder: Path) -> Path:
    """Return a complete .rrd: the file itself, or a repaired copy in ``folder`` if it was cut.

    The file is not changed. Raises `ExternalToolError` if it is no .rrd, or has no readable data.
    """
    if is_whole(file):
        return file
    with file.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise ExternalToolError(f"expected an .rrd, found something else: {file}")
    copy = folder / file.name
    done = rrd_tool("optimize", file, "-o", copy)
    if done.returncode != 0 or not copy.is_file():
        raise ExternalToolError(f"nothing can be read from this file, which was cut short: {file}")
    return copy


@contextmanager
def whole(path: AnyPath) -> Iterator[Path]:
    """Give a complete .rrd of a run within the context; see `mended`."""
    with tempfile.TemporaryDirectory(prefix="tablemap-") as folder:
        yield mended(review_file(path), Path(folder))


def first_snapshot(file: Path) -> int | None:
    """Return the snapshot that an .rrd asks to be opened at; None where it asks for none.

    A blueprint cannot set the time cursor: without this a viewer opens at the last snapshot.
    """
    from rerun.chunk import RrdReader

    for chunk in RrdReader(file).stream():
        if chunk.entity_path == "/__properties/first_view":
            (number,) = chunk.to_record_batch().to_pydict()["snapshot"][0]
            return int(number)
    return None


def show_first(file: Path, port: int) -> None:
    """Move a viewer that listens at a port to the snapshot that its file asks for.

    A viewer that does not answer, or a file that asks for nothing, is left as it is.
    """
    from rerun.experimental import ViewerClient

    snapshot = first_snapshot(file)
    if snapshot is None:
        return
    with suppress(ConnectionError, TimeoutError, RuntimeError):
        client = ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
        deadline = time.monotonic() + LOAD_SECONDS
        while client.get_state().loading and time.monotonic() < deadline:
            time.sleep(0.1)
        client.set_time("snapshot", sequence=snapshot, play_state="paused")


def free_port() -> int:
    """Return a port of this machine that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def listens(port: int) -> bool:
    """Tell whether something on this machine answers at the port."""
    try:
        socket.create_connection((LOOPBACK, port), timeout=0.5).close()
    except OSError:
        return False
    return True


def stop(process: subprocess.Popen[bytes]) -> None:
    """End a program of ours, and wait until it has ended."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
    process.wait()


@contextmanager
def served(path: AnyPath) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Serve a run to web browsers of this machine; gives the URL and the server's process.

    Raises the errors of `open_viewer`.
    """
    with whole(path) as file:
        data, page = free_port(), free_port()
        ports = ["--port", str(data), "--web-viewer-port", str(page)]
        server = launch("--serve-web", "--bind", LOOPBACK, *ports, str(file))
        try:
            deadline = time.monotonic() + SERVE_SECONDS
            while not (listens(data) and listens(page)):
                if server.poll() is not None or time.monotonic() > deadline:
                    raise ExternalToolError(f"the Rerun Viewer cannot serve the file: {file}")
                time.sleep(0.05)
            source = quote(f"rerun+http://{LOOPBACK}:{data}/proxy", safe="")
            yield f"http://{LOOPBACK}:{page}?url={source}", server
        finally:
            stop(server)


def open_viewer(path: AnyPath) -> subprocess.Popen[bytes]:
    """Open a run folder's .rrd in the native viewer, and return its process.

    Raises `ExternalToolError` if the viewer is missing or ends at once (no screen, no graphics
    driver), and `TablemapError` if there is no .rrd. A file that was cut short is shown as a
    repaired copy; it stays in the system's temporary folder while the viewer may need it.
    """
    file = review_file(path)
    if not is_whole(file):
        file = mended(file, Path(tempfile.mkdtemp(prefix="tablemap-")))
    port = free_port()
    viewer = launch("--bind", LOOPBACK, "--port", str(port), str(file), stderr=subprocess.PIPE)
    try:
        _, said = viewer.communicate(timeout=START_SECONDS)
    except subprocess.TimeoutExpired:
        show_first(file, port)
        return viewer
    if viewer.returncode != 0:
        lines = [line for line in said.decode(errors="replace").splitlines() if line.strip()]
        last = lines[-1] if lines else f"exit code {viewer.returncode}"
        raise ExternalToolError(
            f"the Rerun Viewer ended at once ({last}); without a screen, --web serves it to a "
            f"browser and --still OUT.png draws a picture: {file}"
        )
    return viewer
