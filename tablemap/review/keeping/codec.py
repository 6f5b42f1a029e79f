"""Dataclasses as JSON and NumPy arrays in one zip, an NPZ with a member ``events.json``.

Each event is a JSON object. What JSON does not have is an object with one key that begins with $:

- ``$array``: the name of the member (NPY) that has it; ``$f8`` beside it: float64 kept as float32
- ``$depth``: a depth image (rows, columns); its member has uint16 half millimetres, 0 where nothing
  was measured, each less its left neighbour (modulo 65536); without a member it was not needed
- ``$bytes``: a member with uint8
- ``$tuple``, ``$pairs`` (of a dict), ``$float`` (not finite), ``$model`` (a ``table.json``)
- ``$enum`` with ``name``, and ``$kind`` with ``fields``: classes by their names
"""

from __future__ import annotations

import hashlib
import importlib
import json
import math
import pkgutil
import zipfile
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tablemap.errors import TablemapError
from tablemap.model import TableModel

EVENTS = "events.json"
LEVEL = 1  # of the compression: 3 takes twice as long and saves 4 %
LARGE = 300  # numbers: such arrays are drawn, not written out, and float32 is enough
DEPTH_STEP = 0.0005  # metres
ROOMS = (
    "tablemap.stages",
    "tablemap.events",
    "tablemap.geometry",
    "tablemap.errors",
    "tablemap.recording.messages",
    "tablemap.recording.tf.frame_roles",
    "tablemap.review.keeping.recorded",
)
"""Where the classes of events, and of what they hold, are defined."""


class DepthImage:
    """A depth image whose pixels may follow later; ``pixels`` is float32 metres (rows, columns)."""

    def __init__(self, pixels: NDArray[np.float32]) -> None:
        self.pixels = pixels
        self.name: str | None = None


class Encoder:
    """Writes values into a zip; equal arrays are written once."""

    def __init__(self, file: zipfile.ZipFile) -> None:
        self._file = file
        self._names: dict[bytes, str] = {}
        self._depths = 0

    def value(self, one: object) -> Any:
        """Return a value as JSON has it, and write its arrays.

        Raises `TypeError` for a type that is none of the above.
        """
        if one is None or isinstance(one, (bool, str)):
            return one
        if isinstance(one, Enum):
            return {"$enum": type(one).__name__, "name": one.name}
        if isinstance(one, (int, np.integer)):
            return int(one)
        if isinstance(one, (float, np.floating)):
            return float(one) if math.isfinite(one) else {"$float": str(float(one))}
        if isinstance(one, np.bool_):
            return bool(one)
        if isinstance(one, np.ndarray):
            return self._array(one)
        if isinstance(one, (bytes, memoryview)):
            blob = np.frombuffer(one, dtype=np.uint8)
            return {"$bytes": self._write(blob, zipfile.ZIP_STORED)}
        return self._compound(one)

    def _compound(self, one: object) -> Any:
        if isinstance(one, DepthImage):
            if one.name is None:
                one.name, self._depths = f"depth{self._depths}", self._depths + 1
            return {"$depth": one.name, "shape": list(one.pixels.shape)}
        if isinstance(one, tuple):
            return {"$tuple": [self.value(each) for each in one]}
        if isinstance(one, list):
            return [self.value(each) for each in one]
        if isinstance(one, dict):
            return {"$pairs": [[self.value(k), self.value(v)] for k, v in one.items()]}
        if isinstance(one, TableModel):
            return {"$model": json.loads(one.to_json())}
        if is_dataclass(one) and not isinstance(one, type):
            held = {f.name: self.value(getattr(one, f.name)) for f in fields(one) if f.init}
            return {"$kind": type(one).__name__, "fields": held}
        raise TypeError(f"{type(one).__name__} cannot be kept")

    def depth(self, image: DepthImage) -> None:
        """Write the pixels of a depth image."""
        assert image.name is not None
        steps = np.nan_to_num(image.pixels / DEPTH_STEP, nan=0.0, posinf=0.0, neginf=0.0)
        whole = np.clip(np.rint(steps), 0, 65535).astype(np.uint16)
        left = np.diff(whole, axis=1, prepend=np.zeros((len(whole), 1), dtype=np.uint16))
        self._member(image.name, left, zipfile.ZIP_DEFLATED)

    def _array(self, one: NDArray[Any]) -> dict[str, Any]:
        if one.dtype == np.float64 and one.size > LARGE:
            name = self._write(one.astype(np.float32), zipfile.ZIP_DEFLATED)
            return {"$array": name, "$f8": True}
        return {"$array": self._write(one, zipfile.ZIP_DEFLATED)}

    def _write(self, one: NDArray[Any], packing: int) -> str:
        one = np.ascontiguousarray(one)
        kind = f"{one.dtype.str}{one.shape}".encode()
        digest = hashlib.blake2b(kind + one.tobytes(), digest_size=16).digest()
        if digest not in self._names:
            self._names[digest] = f"a{len(self._names)}"
            self._member(self._names[digest], one, packing)
        return self._names[digest]

    def _member(self, name: str, one: NDArray[Any], packing: int) -> None:
        info = zipfile.ZipInfo(f"{name}.npy")
        info.compress_type = packing
        info._compresslevel = LEVEL  # type: ignore[attr-defined]
        with self._file.open(info, "w", force_zip64=True) as stream:
            np.lib.format.write_array(stream, one, allow_pickle=False)


@cache
def classes() -> dict[str, type]:
    """Return the classes that can be kept, by their names."""
    found: dict[str, type] = {}
    for room in ROOMS:
        package = importlib.import_module(room)
        inner = pkgutil.walk_packages(getattr(package, "__path__", ()), f"{room}.")
        for module in (package, *(importlib.import_module(one.name) for one in inner)):
            for name, one in vars(module).items():
                is_kept = isinstance(one, type) and (is_dataclass(one) or issubclass(one, Enum))
                if is_kept and one.__module__ == module.__name__:
                    found[name] = one
    return found


def decoded(file: Path) -> Iterator[Any]:
    """Yield the events of a file in their order.

    Raises `TablemapError` if it is damaged, or of a version whose results had other fields.
    """
    try:
        with zipfile.ZipFile(file) as packed:
            decoder = _FileDecoder(packed)
            for event in json.loads(packed.read(EVENTS)):
                yield decoder.value(event)
    except (OSError, zipfile.BadZipFile, KeyError, ValueError) as error:
        raise TablemapError(f"the run's results cannot be read ({error}): {file}") from error


class _FileDecoder:
    def __init__(self, file: zipfile.ZipFile) -> None:
        self._file = file
        self._there = set(file.namelist())

    def value(self, one: Any) -> Any:
        if isinstance(one, list):
            return [self.value(each) for each in one]
        if not isinstance(one, dict):
            return one
        kind = next(iter(one))
        return getattr(self, f"_{kind.removeprefix('$')}")(one)

    def _member(self, name: str) -> NDArray[Any]:
        with self._file.open(f"{name}.npy") as stream:
            return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))

    def _array(self, one: dict[str, Any]) -> NDArray[Any]:
        found = self._member(one["$array"])
        return found.astype(np.float64) if "$f8" in one else found

    def _bytes(self, one: dict[str, Any]) -> bytes:
        return self._member(one["$bytes"]).tobytes()

    def _depth(self, one: dict[str, Any]) -> NDArray[np.float32]:
        if f"{one['$depth']}.npy" not in self._there:
            return np.full(tuple(one["shape"]), np.nan, dtype=np.float32)
        whole = np.cumsum(self._member(one["$depth"]), axis=1, dtype=np.uint16)
        return np.where(whole > 0, whole * np.float32(DEPTH_STEP), np.float32(np.nan))

    def _tuple(self, one: dict[str, Any]) -> tuple[Any, ...]:
        return tuple(self.value(each) for each in one["$tuple"])

    def _pairs(self, one: dict[str, Any]) -> dict[Any, Any]:
        return {self.value(key): self.value(held) for key, held in one["$pairs"]}

    def _float(self, one: dict[str, Any]) -> float:
        return float(one["$float"])

    def _model(self, one: dict[str, Any]) -> TableModel:
        return TableModel.read(one["$model"])

    def _enum(self, one: dict[str, Any]) -> Any:
        return classes()[one["$enum"]][one["name"]]  # type: ignore[index]

    def _kind(self, one: dict[str, Any]) -> Any:
        kind = classes()[one["$kind"]]
        held = one["fields"]
        known = {f.name: f for f in fields(kind) if f.init}
        lacking = [
            name
            for name, f in known.items()
            if name not in held and f.default is MISSING and f.default_factory is MISSING
        ]
        if lacking:
            raise ValueError(f"{one['$kind']} of another version, without {', '.join(lacking)}")
        return kind(**{name: self.value(held[name]) for name in known if name in held})
