"""Places that are no files of this machine: ``s3://``, ``gs://``, ``https://``, through obstore.

A `RemotePath` answers what is asked of a `pathlib.Path` while a recording is read, and fetches the
bytes that are read alone. Access is as the environment has it: ``AWS_ACCESS_KEY_ID`` and the like,
``AWS_ENDPOINT_URL`` for another server than Amazon's, ``GOOGLE_APPLICATION_CREDENTIALS``.
"""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from tablemap.errors import ExternalToolError, TablemapError

if TYPE_CHECKING:
    from obstore.store import ObjectStore

SCHEMES = ("s3", "gs", "http", "https")

_BLOCK_BYTES = 64 * 1024  # what is fetched at least: records' heads lie close together
_MOST_AHEAD = 64  # blocks that are fetched at once where small reads go on without a gap
_RETRIES: Any = {"max_retries": 3, "retry_timeout": timedelta(seconds=30)}


class RemoteError(OSError):
    """What a server answered, or that it did not; ``strerror`` is one clause."""

    def __init__(self, url: str, error: Exception) -> None:
        # The first line says what happened; the rest is the library's own state and the answer.
        reason = str(error).partition("\n")[0].partition(": <")[0].strip().rstrip(":")
        super().__init__(0, reason or type(error).__name__, url)

    def __str__(self) -> str:
        return f"{self.strerror}: {self.filename}"


@dataclass(frozen=True)
class _Status:
    """What `RemotePath.stat` tells."""

    st_size: int
    st_mode: int = stat.S_IFREG


@dataclass(frozen=True, order=True)
class RemotePath:
    """An object, or all that begins with its name and a slash: that is a folder."""

    url: str

    def __str__(self) -> str:
        return self.url

    def __truediv__(self, name: object) -> RemotePath:
        return RemotePath(f"{self.url.rstrip('/')}/{name}")

    @property
    def name(self) -> str:
        """The last part."""
        return self._pure.name

    @property
    def stem(self) -> str:
        """The last part without its suffix."""
        return self._pure.stem

    @property
    def suffix(self) -> str:
        """What the last part ends with, from its last dot on."""
        return self._pure.suffix

    @property
    def parent(self) -> RemotePath:
        """What the last part is in."""
        return RemotePath(self.url.rstrip("/").rpartition("/")[0])

    def with_suffix(self, suffix: str) -> RemotePath:
        """Return the same with another suffix."""
        return self.parent / self._pure.with_suffix(suffix).name

    def resolve(self) -> RemotePath:
        """Return itself: it is absolute."""
        return self

    def stat(self) -> _Status:
        """Return the size. Raises `OSError`, `FileNotFoundError` where there is no such object."""
        import obstore

        with _as_os_errors(self.url):
            return _Status(int(obstore.head(*self._place)["size"]))

    def exists(self) -> bool:
        """Tell whether there is such an object or folder. Raises `OSError` where none can tell."""
        return self.is_file() or self.is_dir()

    def is_file(self) -> bool:
        """Tell whether there is such an object. Raises `OSError` where none can tell."""
        try:
            self.stat()
        except FileNotFoundError:
            return False
        return True

    def is_dir(self) -> bool:
        """Tell whether something lies below; a web server does not tell."""
        if self.url.startswith("http"):
            return False
        return next(self.iterdir(), None) is not None

    def iterdir(self) -> Iterator[RemotePath]:
        """Yield what lies right below, by name. Raises `OSError` where that cannot be told."""
        import obstore

        store, key = self._place
        with _as_os_errors(self.url):
            found = obstore.list_with_delimiter(store, prefix=key or None)
            names = sorted(PurePosixPath(each["path"]).name for each in found["objects"])
            yield from (self / name for name in names)

    def folders(self) -> list[RemotePath]:
        """Return the folders right below, by name. Raises `OSError` as `iterdir` does."""
        import obstore

        store, key = self._place
        with _as_os_errors(self.url):
            found = obstore.list_with_delimiter(store, prefix=key or None)
            return [self / PurePosixPath(each).name for each in sorted(found["common_prefixes"])]

    def open(self, mode: str = "rb") -> BinaryIO:
        """Open for reading. Raises `OSError`."""
        if mode != "rb":
            raise ValueError(f"remote objects are read in binary alone, not {mode!r}")
        return cast(BinaryIO, RangedFile(self, self.stat().st_size))

    def read_text(self, encoding: str | None = None) -> str:
        """Return all of it as text. Raises `OSError`."""
        with self.open() as file:
            return file.read().decode(encoding or "utf-8")

    def fetch(self, start: int, length: int) -> bytes:
        """Return so many bytes from a place on. Raises `OSError`."""
        import obstore

        with _as_os_errors(self.url):
            return bytes(obstore.get_range(*self._place, start=start, length=length))

    def put(self, content: Path | bytes) -> None:
        """Write the object, from a file of this machine or from bytes. Raises `OSError`."""
        import obstore

        with _as_os_errors(self.url, absent="No such bucket"):
            obstore.put(*self._place, content)

    @property
    def _pure(self) -> PurePosixPath:
        return PurePosixPath(self.url.partition("://")[2])

    @property
    def _place(self) -> tuple[ObjectStore, str]:
        scheme, _, rest = self.url.partition("://")
        host, _, key = rest.partition("/")
        return _store(f"{scheme}://{host}"), key.strip("/")


class RangedFile(io.RawIOBase):
    """A remote object as a file: the blocks that are read are fetched, each once.

    What was fetched lies in a temporary file without a name, for recordings are read several times.
    """

    def __init__(self, path: RemotePath, size: int) -> None:
        self._path, self._size = path, size
        self._at = 0
        self._end_of_last = -1
        self._ahead = 1
        self._has = bytearray(-(-size // _BLOCK_BYTES))
        import tempfile

        self._fetched = tempfile.TemporaryFile(prefix="tablemap-")  # noqa: SIM115 - as this file

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def seekable(self) -> bool:
        """Tell that it can be read from any place on."""
        return True

    def tell(self) -> int:
        """Return from where on is read next."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = max(0, base + offset)
        return self._at

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes. Raises `OSError`."""
        left = max(0, self._size - self._at)
        length = left if size is None or size < 0 else min(size, left)
        if length:
            self._fetch(self._at, length)
        self._fetched.seek(self._at)
        data = self._fetched.read(length)
        self._at = self._end_of_last = self._at + len(data)
        return data

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer with the next bytes. Raises `OSError`."""
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def close(self) -> None:
        """Let go of what was fetched."""
        self._fetched.close()
        super().close()

    def _fetch(self, start: int, length: int) -> None:
        """Fetch the blocks of a range that are not there yet, each run of them at once."""
        first, last = start // _BLOCK_BYTES, (start + length - 1) // _BLOCK_BYTES + 1
        begin = self._has.find(0, first, last)
        if begin < 0:
            return
        follows = start == self._end_of_last
        self._ahead = min(2 * self._ahead, _MOST_AHEAD) if follows else 1
        while begin >= 0:
            end = self._has.find(1, begin, last)
            if end < 0:  # small reads that go on without a gap read a whole file
                end = min(max(last, begin + self._ahead), len(self._has))
            offset = begin * _BLOCK_BYTES
            data = self._path.fetch(offset, min(end * _BLOCK_BYTES, self._size) - offset)
            self._fetched.seek(offset)
            self._fetched.write(data)
            self._has[begin:end] = bytes([1]) * (end - begin)
            begin = self._has.find(0, end, last)


def is_remote(place: object) -> bool:
    """Tell whether a text names a place that is no file of this machine."""
    return isinstance(place, RemotePath) or (
        isinstance(place, str) and place.partition("://")[0] in SCHEMES and "://" in place
    )


def place_at(text: str) -> Path:
    """Return what reads a place: a path, or a `RemotePath`, which answers as one does.

    Raises `ExternalToolError` where obstore is not installed, and `TablemapError` where the URL
    names nothing.
    """
    if not is_remote(text):
        return Path(text)
    scheme, _, named = text.partition("://")
    if not named.strip("/"):
        raise TablemapError(f"expected a place such as {scheme}://BUCKET/lap.mcap, found {text!r}.")
    try:
        import obstore  # noqa: F401
    except ImportError as error:
        raise ExternalToolError(
            f"places as {scheme}:// need obstore, which is not installed: pip install obstore"
        ) from error
    return cast(Path, RemotePath(text))


@lru_cache(maxsize=32)
def _store(url: str) -> ObjectStore:
    from obstore.store import from_url

    options: Any = {"client_options": {"timeout": "60s", "connect_timeout": "10s"}}
    if "http://" in (url[:7], os.environ.get("AWS_ENDPOINT_URL", "")[:7]):
        options["client_options"]["allow_http"] = True
    return from_url(url, retry_config=_RETRIES, **options)


class _as_os_errors:  # noqa: N801 - reads as what it does
    """Turns what obstore raises into `OSError`."""

    def __init__(self, url: str, *, absent: str = "No such file") -> None:
        self._url, self._absent = url, absent

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, FileNotFoundError) and not isinstance(error, RemoteError):
            raise FileNotFoundError(2, self._absent, self._url) from error
        from obstore.exceptions import BaseError

        if isinstance(error, BaseError):
            raise RemoteError(self._url, error) from error
