"""Settings: pairwise ICP, pose graph and joint polish."""

from __future__ import annotations

from pydantic import Field

from tablemap.config.section import Section


class RegistrationConfig(Section):
    """Pairwise ICP, pose graph and joint polish."""

    stop_scans: int = Field(default=120, ge=1, description="most scans combined at a stop")
    gates: tuple[float, ...] = Field(
        default=(0.2, 0.1, 0.05, 0.03), min_length=1, description="correspondence gates, metres"
    )
    kernel: float = Field(default=0.01, gt=0, description="Geman-McClure scale, metres")
    partners: int = Field(default=10, ge=1, description="most stops that a stop is paired with")
    minimum_overlap: float = Field(
        default=0.3, ge=0, le=1, description="least share of a stop's points that a pair must share"
    )
    correlation: float = Field(
        default=8.0, ge=1, description="neighbouring beams that err together, as one"
    )
    depth_range: float = Field(default=3.5, gt=0, description="depth beyond is left out, metres")
    depth_points: int = Field(default=700, ge=60, description="points of a depth view that align")
    depth_gates: tuple[float, ...] = Field(
        default=(0.2, 0.12, 0.07), min_length=1, description="gates of depth pairs, metres"
    )
    depth_kernel: float = Field(
        default=0.03, gt=0, description="Geman-McClure scale of depth pairs, metres"
    )
    depth_pair_points: float = Field(
        default=20.0, gt=0, description="independent points that a depth pair is worth at most"
    )
    depth_loops: int = Field(default=6, ge=0, description="most loop pairs of a depth view")
    edge_gates: tuple[float, ...] = Field(
        default=(0.2, 0.1, 0.05, 0.03), min_length=1, description="gates of edges laid on, metres"
    )
    edge_correlation: float = Field(
        default=15.0, ge=1, description="neighbouring edge points that err together, as one"
    )
    depth_rounds: int = Field(
        default=2, ge=1, description="times that depth pairs are aligned and the graph is solved"
    )
    search_radius: float = Field(
        default=0.6, gt=0, description="reach of the correlative search, metres"
    )
    search_angle_deg: float = Field(
        default=25.0, gt=0, description="reach of the correlative search in heading"
    )
