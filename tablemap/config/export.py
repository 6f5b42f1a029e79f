"""Settings: what exports need and the model does not say."""

from typing import Annotated

from msgspec import Meta

from tablemap.config.section import Section


class ExportConfig(Section, frozen=True):
    """What exports need and the model does not say."""

    thickness: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; thickness of a top where it was not measured. Higher: less room "
            "under the table",
        ),
    ] = 0.03
    padding: Annotated[
        float,
        Meta(
            ge=0,
            description="metres that are added around a keep-out area. Higher: robots keep "
            "further away",
        ),
    ] = 0.0
    resolution: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; cell of a keep-out mask. Higher: a coarser and smaller mask",
        ),
    ] = 0.02
    margin: Annotated[
        float,
        Meta(
            ge=0,
            description="metres of free cells around the area of a keep-out mask. Higher: a "
            "larger mask",
        ),
    ] = 0.5
    on_top_of_gap: Annotated[
        float,
        Meta(
            ge=0,
            description="metres between the top and the volume above it in which ED looks for "
            "things. Higher: flat things on the table are not found",
        ),
    ] = 0.02
    on_top_of_height: Annotated[
        float,
        Meta(
            gt=0,
            description="metres; height of this volume. Higher: taller things count as on the "
            "table",
        ),
    ] = 0.3
    mesh_prefix: Annotated[
        str,
        Meta(
            description="text before the names of meshes in URDF, such as package://my_tables/",
        ),
    ] = ""
