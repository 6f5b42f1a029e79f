"""Settings: what exports need that the model does not say."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class ExportConfig(Section):
    """What exports need that the model does not say."""

    thickness: float = Field(default=0.03, gt=0, description="of a top whose own is not known")
    padding: float = Field(default=0.0, ge=0, description="added round a keep-out area, metres")
    resolution: float = Field(default=0.02, gt=0, description="cell of a keep-out mask, metres")
    margin: float = Field(default=0.5, ge=0, description="free cells round it, metres")
    on_top_of_gap: float = Field(
        default=0.02, ge=0, description="from the top up to ED's volume on top of it, metres"
    )
    on_top_of_height: float = Field(default=0.3, gt=0, description="height of that volume, metres")
    mesh_prefix: str = Field(
        default="", description="before mesh names in URDF, as package://my_tables/"
    )
