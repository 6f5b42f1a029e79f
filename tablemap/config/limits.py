"""Settings: what reading a file may cost; what claims more is left out or refused."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section

MIB = 2**20


class LimitsConfig(Section):
    """What reading a file may cost; what claims more is left out or refused, and says so.

    A few kilobytes can claim to be gigabytes. The defaults are far above what robots write.
    """

    chunk_mib: int = Field(
        default=256,
        gt=0,
        description="MiB; most that one chunk unpacks to. Higher: larger files are read, with "
        "more memory and time",
    )
    record_mib: int = Field(
        default=256,
        gt=0,
        description="MiB; largest record of a file. Higher: larger files are read, with more "
        "memory and time",
    )
    unpacked_mib: int = Field(
        default=2048,
        gt=0,
        description="MiB; most that all chunks unpack to (`expansion` times the file, if that "
        "is more). Higher: larger files are read, with more memory and time",
    )
    expansion: int = Field(
        default=100,
        gt=0,
        description="sizes of the file; most that all chunks unpack to (`unpacked_mib`, if "
        "that is more). Higher: larger files are read, with more memory and time",
    )
    channels: int = Field(
        default=4096,
        gt=0,
        description="channels; most of a recording. Higher: larger files are read, with more "
        "memory and time",
    )
    messages: int = Field(
        default=100_000_000,
        gt=0,
        description="messages; most of a recording. Higher: larger files are read, with more "
        "memory and time",
    )
    chunk_messages: int = Field(
        default=1_000_000,
        gt=0,
        description="messages; most of one chunk. Higher: larger files are read, with more "
        "memory and time",
    )
    schemas: int = Field(
        default=64,
        gt=0,
        description="schemas; most different ones that are read. Higher: larger files are "
        "read, with more memory and time",
    )
    schema_kib: int = Field(
        default=128,
        gt=0,
        description="KiB; largest schema that is read. Higher: larger files are read, with "
        "more memory and time",
    )
    schema_parts: int = Field(
        default=500,
        gt=0,
        description="fields, constants and spelt-out elements; most of one schema. Higher: "
        "larger files are read, with more memory and time",
    )
    schema_depth: int = Field(
        default=32,
        gt=0,
        description="types within each other; most of one schema. Higher: larger files are "
        "read, with more memory and time",
    )
    message_parts: int = Field(
        default=500_000,
        gt=0,
        description="elements; most of the lists of one message. Higher: larger files are "
        "read, with more memory and time",
    )
    beams: int = Field(
        default=100_000,
        gt=0,
        description="beams; most of one laser scan. Higher: larger files are read, with more "
        "memory and time",
    )
    pixels: int = Field(
        default=16_000_000,
        gt=0,
        description="pixels; most of one image. Higher: larger files are read, with more "
        "memory and time",
    )
    frames: int = Field(
        default=10_000,
        gt=0,
        description="TF frames; most of a recording. Higher: larger files are read, with more "
        "memory and time",
    )
    frame_depth: int = Field(
        default=200,
        gt=0,
        description="TF frames; longest chain of them. Higher: larger files are read, with "
        "more memory and time",
    )
    name_bytes: int = Field(
        default=1000,
        gt=0,
        description="bytes; longest name of a topic, a schema or a TF frame. Higher: larger "
        "files are read, with more memory and time",
    )
    idle_seconds: float = Field(
        default=300.0,
        gt=0,
        description="seconds of reading without anything that is wanted. Higher: slow disks "
        "are waited for longer",
    )

    def over(self, name: str) -> str:
        """Return the words for what is more than a limit: ``over limits.beams = 100000``."""
        return f"over limits.{name} = {getattr(self, name)}"
