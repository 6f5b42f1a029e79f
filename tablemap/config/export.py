"""Settings: what exports need and the model does not say."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class ExportConfig(Section):
    """What exports need and the model does not say."""

    thickness: float = Field(
        default=0.03,
        gt=0,
        description="metres; thickness of a top where it was not measured. Higher: less room "
        "under the table",
    )
    padding: float = Field(
        default=0.0,
        ge=0,
        description="metres that are added around a keep-out area. Higher: robots keep further "
        "away",
    )
    resolution: float = Field(
        default=0.02,
        gt=0,
        description="metres; cell of a keep-out mask. Higher: a coarser and smaller mask",
    )
    margin: float = Field(
        default=0.5,
        ge=0,
        description="metres of free cells around the area of a keep-out mask. Higher: a larger "
        "mask",
    )
    on_top_of_gap: float = Field(
        default=0.02,
        ge=0,
        description="metres between the top and the volume above it in which ED looks for things. "
        "Higher: flat things on the table are not found",
    )
    on_top_of_height: float = Field(
        default=0.3,
        gt=0,
        description="metres; height of this volume. Higher: taller things count as on the table",
    )
    mesh_prefix: str = Field(
        default="",
        description="text before the names of meshes in URDF, such as package://my_tables/",
    )
