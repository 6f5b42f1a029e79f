"""Settings: the most that reading a file may cost."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section

MIB = 2**20


class LimitsConfig(Section, frozen=True):
    """The most that reading a file may cost. What needs more is left out or refused.

    A few kilobytes can claim to be gigabytes. The defaults are far above what robots write.
    """

    chunk_mib: Annotated[
        int,
        Meta(
            gt=0,
            description="MiB; the most to which one chunk may unpack. Higher: larger files are "
            "read, with more memory and time",
        ),
    ] = 256
    record_mib: Annotated[
        int,
        Meta(
            gt=0,
            description="MiB; the largest record of a file. Higher: larger files are read, with "
            "more memory and time",
        ),
    ] = 256
    unpacked_mib: Annotated[
        int,
        Meta(
            gt=0,
            description="MiB; the most to which all chunks may unpack; `expansion` counts where "
            "it allows more. Higher: larger files are read, with more memory and time",
        ),
    ] = 2048
    expansion: Annotated[
        int,
        Meta(
            gt=0,
            description="sizes of the file; the most to which all chunks may unpack; "
            "`unpacked_mib` counts where it allows more. Higher: larger files are read, with more "
            "memory and time",
        ),
    ] = 100
    channels: Annotated[
        int,
        Meta(
            gt=0,
            description="channels; the most that a recording may have. Higher: larger files are "
            "read, with more memory and time",
        ),
    ] = 4096
    messages: Annotated[
        int,
        Meta(
            gt=0,
            description="messages; the most that a recording may have. Higher: larger files are "
            "read, with more memory and time",
        ),
    ] = 100_000_000
    chunk_messages: Annotated[
        int,
        Meta(
            gt=0,
            description="messages; the most that one chunk may have. Higher: larger files are "
            "read, with more memory and time",
        ),
    ] = 1_000_000
    schemas: Annotated[
        int,
        Meta(
            gt=0,
            description="schemas; the most different ones that are read. Higher: larger files are "
            "read, with more memory and time",
        ),
    ] = 64
    schema_kib: Annotated[
        int,
        Meta(
            gt=0,
            description="KiB; the largest schema that is read. Higher: larger files are read, "
            "with more memory and time",
        ),
    ] = 128
    schema_parts: Annotated[
        int,
        Meta(
            gt=0,
            description="fields, constants and elements of arrays; the most that one schema may "
            "have. Higher: larger files are read, with more memory and time",
        ),
    ] = 500
    schema_depth: Annotated[
        int,
        Meta(
            gt=0,
            description="levels of types inside types; the most that one schema may have. Higher: "
            "larger files are read, with more memory and time",
        ),
    ] = 32
    message_parts: Annotated[
        int,
        Meta(
            gt=0,
            description="elements; the most that the lists of one message may have. Higher: "
            "larger files are read, with more memory and time",
        ),
    ] = 500_000
    beams: Annotated[
        int,
        Meta(
            gt=0,
            description="beams; the most that one laser scan may have. Higher: larger files are "
            "read, with more memory and time",
        ),
    ] = 100_000
    pixels: Annotated[
        int,
        Meta(
            gt=0,
            description="pixels; the most that one image may have. Higher: larger files are read, "
            "with more memory and time",
        ),
    ] = 16_000_000
    frames: Annotated[
        int,
        Meta(
            gt=0,
            description="TF frames; the most that a recording may have. Higher: larger files are "
            "read, with more memory and time",
        ),
    ] = 10_000
    frame_depth: Annotated[
        int,
        Meta(
            gt=0,
            description="TF frames; the longest chain from a frame to its root. Higher: larger "
            "files are read, with more memory and time",
        ),
    ] = 200
    name_bytes: Annotated[
        int,
        Meta(
            gt=0,
            description="bytes; the longest name of a topic, a schema or a TF frame. Higher: "
            "larger files are read, with more memory and time",
        ),
    ] = 1000
    idle_seconds: Annotated[
        float,
        Meta(
            gt=0,
            description="seconds; reading stops after so long without a message that is needed. "
            "Higher: slow disks get more time",
        ),
    ] = 300.0

    def over(self, name: str) -> str:
        """Return the words for what is more than a limit: ``over limits.beams = 100000``."""
        return f"over limits.{name} = {getattr(self, name)}"
