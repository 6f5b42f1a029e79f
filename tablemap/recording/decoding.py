"""Recorded bytes -> messages, a decoder a channel: parsed by `parsing`, converted by `fields`."""

from __future__ import annotations

import struct
from contextlib import suppress

from tablemap.config import LimitsConfig
from tablemap.config.limits import MIB
from tablemap.recording.claims import ClaimError, check_message, check_points
from tablemap.recording.fields import converter
from tablemap.recording.kinds import kind_of
from tablemap.recording.messages import DecodingError, LaserScan, Message
from tablemap.recording.packing import unpacked_message
from tablemap.recording.parsing import brief, parser
from tablemap.recording.raw import Channel, RawMessage

_BEFORE_RANGES = 128  # bytes of ROS's scans: header, angles, and perhaps a few ranges

_BEFORE_PIXELS = 256  # bytes of ROS's images: header, size, encoding, and the begin of the pixels
_EVERY = 61  # bytes: of a packed image all that follow a difference differ


class Decoder:
    """Decodes the messages of one channel; everything that fails is a `DecodingError`."""

    def __init__(self, channel: Channel, limits: LimitsConfig | None = None) -> None:
        self._limits = limits or LimitsConfig()
        self._packed_bytes = self._unpacked_bytes = 0
        self._last: tuple[memoryview, memoryview] | None = None  # packed, and unpacked
        kind = kind_of(channel)
        if kind is None:
            raise DecodingError(f"has the schema {channel.schema_name!r}, which is not read")
        self.channel = channel
        self.kind = kind
        self._parse, self._peek, self._direct = parser(channel, self._limits)
        self._is_static = channel.topic.rstrip("/").endswith("tf_static")
        self._convert = converter(kind, is_static=self._is_static)
        self._may_be_packed = channel.message_encoding == "cdr"

    def decode(self, raw: RawMessage) -> Message:
        """Decode a message; a stamp of zero is replaced by the log time."""
        try:
            data = self._unpacked(raw)
            if self._direct is not None:
                # Messages that it cannot read (in another byte order) go to the general decoder.
                with suppress(struct.error, UnicodeDecodeError):
                    return self._direct(data, raw.log_time_ns, self._is_static)
            parsed = self._parse(data)
            check_points(parsed, self._limits)
            message = self._convert(parsed, raw.log_time_ns)
            check_message(message, self._limits)
        except DecodingError:
            raise
        except ClaimError as error:
            raise DecodingError(str(error)) from error
        # Parsers that are generated from a schema raise anything on bytes that do not fit it.
        except Exception as error:
            raise DecodingError(f"cannot be decoded ({brief(error)})") from error
        return message

    @property
    def begins_with_header(self) -> bool:
        """Whether messages are ROS's, with a stamp at their very beginning."""
        return self._peek is not None

    def header(self, raw: RawMessage) -> tuple[int, str]:
        """Return the header's stamp and frame, if possible without decoding the rest."""
        if self._peek is not None:
            try:
                stamp_ns, frame_id = self._peek(self._unpacked(raw))
            except ValueError as error:
                raise DecodingError(f"cannot be decoded ({brief(error)})") from error
            except (struct.error, IndexError) as error:
                raise DecodingError("is too short for its header") from error
            return stamp_ns or raw.log_time_ns, frame_id.lstrip("/")
        message = self.decode(raw)
        assert not isinstance(message, tuple)
        return message.stamp_ns, message.frame_id

    def measured(self, raw: RawMessage) -> bytes:
        """Return bytes of what a laser scan measured, without its stamp and in no certain format.

        Behind ROS's header they are the same bytes in the same place. Other encodings write the
        stamp in more or fewer bytes, or behind the ranges: their scans are decoded.
        """
        if self._peek is not None:
            return bytes(self._unpacked(raw)[_BEFORE_RANGES:])
        scan = self.decode(raw)
        return scan.ranges.tobytes() if isinstance(scan, LaserScan) else b""

    def sample(self, raw: RawMessage) -> bytes:
        """Return some bytes of what an image shows, for comparison; none without ROS's header.

        Of two images that differ, as all do that a camera takes, some of them differ.
        """
        if self._peek is None:
            return b""
        data = self._unpacked(raw)
        return b"%d " % len(data) + bytes(data[_BEFORE_PIXELS::_EVERY])

    def _unpacked(self, raw: RawMessage) -> memoryview:
        if not self._may_be_packed:
            return raw.data
        if self._last is not None and self._last[0] is raw.data:
            return self._last[1]
        data = unpacked_message(raw.data, self._limits)
        self._last = None if data is raw.data else (raw.data, data)
        self._packed_bytes += len(raw.data)
        self._unpacked_bytes += len(data)
        if self._unpacked_bytes > max(
            self._limits.unpacked_mib * MIB, self._limits.expansion * self._packed_bytes
        ):
            raise DecodingError(
                f"is one of those that unpack to too much, {self._limits.over('unpacked_mib')}"
            )
        return data
