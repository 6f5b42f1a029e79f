"""Kinds and models of depth cameras, and what is believed of the sensors with each of them."""

from __future__ import annotations

from types import MappingProxyType
from typing import Literal

DepthCamera = Literal[
    "structured_light", "time_of_flight", "stereo", "realsense", "azure_kinect", "oak", "zed"
]
"""The kinds of depth cameras, and models of them."""

_STEREO = {"far_edge_bias": 1.0, "edge_bias_sigma": 0.004}
"""What compares windows of two images fattens what is in front, by millimetres."""

CAMERAS = MappingProxyType[DepthCamera, dict[str, float]](
    {
        "structured_light": {},  # the defaults
        "time_of_flight": {"projector_baseline": 0.0},
        "stereo": _STEREO,
        "realsense": {"projector_baseline": 0.05, **_STEREO},
        "azure_kinect": {"projector_baseline": 0.0},
        "oak": {"projector_baseline": 0.075, **_STEREO},
        "zed": {"projector_baseline": 0.12, **_STEREO},
    }
)
"""The settings of ``sensors`` that differ from the defaults, by camera."""
