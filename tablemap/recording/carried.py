"""Warnings about a recording before its conversion: the copy has them as a message."""

from __future__ import annotations

import json
from typing import Any

from tablemap.errors import WARNING_CODES, ProcessWarning
from tablemap.recording.raw import Source

TOPIC, SCHEMA = "/tablemap/converted", "tablemap.Converted"

_MOST_BYTES = 2**20


def carried_warnings(source: Source) -> list[ProcessWarning]:
    """Return the warnings about the original of a converted recording; none for others."""
    channels = [id for id, channel in source.channels.items() if channel.schema_name == SCHEMA]
    found: list[ProcessWarning] = []
    for message in source.messages(channels) if channels else ():
        try:
            if len(message.data) > _MOST_BYTES:
                raise ValueError("no copy says so much")
            said: Any = json.loads(bytes(message.data))
            found += [_warning(**each) for each in said["warnings"]]
        except (ValueError, LookupError, TypeError, OverflowError, RecursionError):
            words = "The warnings from before the conversion cannot be read."
            found.append(ProcessWarning("recording.damaged", "recording", words))
    return found


def _warning(code: str, stage: str, message: str, stamp_ns: int | None) -> ProcessWarning:
    if code not in WARNING_CODES or not isinstance(message, str):
        raise ValueError(code)
    return ProcessWarning(code, str(stage), message, None if stamp_ns is None else int(stamp_ns))
