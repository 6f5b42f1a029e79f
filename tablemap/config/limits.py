"""Settings: the most that reading a file may cost."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section

MIB = 2**20


class LimitsConfig(Section):
    """The most that reading a file may cost. What needs more is left out or refused.

    A few kilobytes can claim to be gigabytes. The defaults are far above what robots write.
    """

    chunk_mib: int = Field(
        default=256,
        gt=0,
        description="MiB; the most to which one chunk may unpack. Higher: larger files are read, "
        "with more memory and time",
    )
    record_mib: int = Field(
        default=256,
        gt=0,
        description="MiB; the largest record of a file. Higher: larger files are read, with more "
        "memory and time",
    )
    unpacked_mib: int = Field(
        default=2048,
        gt=0,
        description="MiB; the most to which all chunks may unpack; `expansion` counts where it "
        "allows more. Higher: larger files are read, with more memory and time",
    )
    expansion: int = Field(
        default=100,
        gt=0,
        description="sizes of the file; the most to which all chunks may unpack; `unpacked_mib` "
        "counts where it allows more. Higher: larger files are read, with more memory and time",
    )
    channels: int = Field(
        default=4096,
        gt=0,
        description="channels; the most that a recording may have. Higher: larger files are read, "
        "with more memory and time",
    )
    messages: int = Field(
        default=100_000_000,
        gt=0,
        description="messages; the most that a recording may have. Higher: larger files are read, "
        "with more memory and time",
    )
    chunk_messages: int = Field(
        default=1_000_000,
        gt=0,
        description="messages; the most that one chunk may have. Higher: larger files are read, "
        "with more memory and time",
    )
    schemas: int = Field(
        default=64,
        gt=0,
        description="schemas; the most different ones that are read. Higher: larger files are "
        "read, with more memory and time",
    )
    schema_kib: int = Field(
        default=128,
        gt=0,
        description="KiB; the largest schema that is read. Higher: larger files are read, with "
        "more memory and time",
    )
    schema_parts: int = Field(
        default=500,
        gt=0,
        description="fields, constants and elements of arrays; the most that one schema may have. "
        "Higher: larger files are read, with more memory and time",
    )
    schema_depth: int = Field(
        default=32,
        gt=0,
        description="levels of types inside types; the most that one schema may have. Higher: "
        "larger files are read, with more memory and time",
    )
    message_parts: int = Field(
        default=500_000,
        gt=0,
        description="elements; the most that the lists of one message may have. Higher: larger "
        "files are read, with more memory and time",
    )
    beams: int = Field(
        default=100_000,
        gt=0,
        description="beams; the most that one laser scan may have. Higher: larger files are read, "
        "with more memory and time",
    )
    pixels: int = Field(
        default=16_000_000,
        gt=0,
        description="pixels; the most that one image may have. Higher: larger files are read, "
        "with more memory and time",
    )
    frames: int = Field(
        default=10_000,
        gt=0,
        description="TF frames; the most that a recording may have. Higher: larger files are "
        "read, with more memory and time",
    )
    frame_depth: int = Field(
        default=200,
        gt=0,
        description="TF frames; the longest chain from a frame to its root. Higher: larger files "
        "are read, with more memory and time",
    )
    name_bytes: int = Field(
        default=1000,
        gt=0,
        description="bytes; the longest name of a topic, a schema or a TF frame. Higher: larger "
        "files are read, with more memory and time",
    )
    idle_seconds: float = Field(
        default=300.0,
        gt=0,
        description="seconds; reading stops after so long without a message that is needed. "
        "Higher: slow disks get more time",
    )

    def over(self, name: str) -> str:
        """Return the words for what is more than a limit: ``over limits.beams = 100000``."""
        return f"over limits.{name} = {getattr(self, name)}"
