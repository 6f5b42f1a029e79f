"""Settings: what reading a file may cost; what claims more is left out or refused."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section

MIB = 2**20


class LimitsConfig(Section):
    """What reading a file may cost; what claims more is left out or refused, and says so.

    A few kilobytes can claim to be gigabytes. The defaults are far above what robots write.
    """

    chunk_mib: int = Field(default=256, gt=0, description="most that a chunk unpacks to, MiB")
    record_mib: int = Field(default=256, gt=0, description="largest record of a file, MiB")
    unpacked_mib: int = Field(
        default=2048, gt=0, description="most that all chunks unpack to, MiB, or the next if more"
    )
    expansion: int = Field(
        default=100, gt=0, description="most that all chunks unpack to, in sizes of the file"
    )
    channels: int = Field(default=4096, gt=0, description="most channels")
    messages: int = Field(default=100_000_000, gt=0, description="most messages of a recording")
    chunk_messages: int = Field(default=1_000_000, gt=0, description="most messages of a chunk")
    schemas: int = Field(default=64, gt=0, description="most different schemas that are read")
    schema_kib: int = Field(default=128, gt=0, description="largest schema that is read, KiB")
    schema_parts: int = Field(
        default=500, gt=0, description="most fields, constants and spelt-out elements of a schema"
    )
    schema_depth: int = Field(default=32, gt=0, description="most types within each other")
    message_parts: int = Field(
        default=1_000_000, gt=0, description="most elements of the lists of a message"
    )
    beams: int = Field(default=100_000, gt=0, description="most beams of a laser scan")
    pixels: int = Field(default=16_000_000, gt=0, description="most pixels of an image")
    frames: int = Field(default=10_000, gt=0, description="most TF frames")
    frame_depth: int = Field(default=200, gt=0, description="longest chain of TF frames")
    idle_seconds: float = Field(
        default=300.0, gt=0, description="longest time without anything that is wanted, seconds"
    )

    def over(self, name: str) -> str:
        """Return the words for what is more than a limit: ``over limits.beams = 100000``."""
        return f"over limits.{name} = {getattr(self, name)}"
