"""Settings: what exports need that the model does not say."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class ExportConfig(Section):
    """What exports need that the model does not say."""

    thickness: float = Field(
        default=0.03,
        gt=0,
        description="metres; thickness of a top whose own is not known. Higher: less room under it",
    )
    padding: float = Field(
        default=0.0,
        ge=0,
        description="metres added round a keep-out area. Higher: robots keep further off",
    )
    resolution: float = Field(
        default=0.02,
        gt=0,
        description="metres; cell of a keep-out mask. Higher: a coarser and smaller mask",
    )
    margin: float = Field(
        default=0.5,
        ge=0,
        description="metres of free cells round a keep-out mask's area. Higher: a larger mask",
    )
    on_top_of_gap: float = Field(
        default=0.02,
        ge=0,
        description="metres from the top up to ED's volume on top of it. Higher: flat things on "
        "the table are left out",
    )
    on_top_of_height: float = Field(
        default=0.3,
        gt=0,
        description="metres; height of that volume. Higher: taller things count as on the table",
    )
    mesh_prefix: str = Field(
        default="",
        description="text before mesh names in URDF, as package://my_tables/",
    )
