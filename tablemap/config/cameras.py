"""Kinds and models of depth cameras, and what is believed of the sensors with each of them."""

from __future__ import annotations

from types import MappingProxyType
from typing import Literal

DepthCamera = Literal[
    "structured_light", "time_of_flight", "stereo", "realsense", "azure_kinect", "oak", "zed"
]
"""The kinds of depth cameras, and models of them."""

_STEREO = {
    "top_widening_px": 1.5,
    "top_widening_sigma_px": 1.0,
    "edge_bias_sigma": 0.004,
}
"""What compares windows of two images fattens what is in front, by up to half of a window: two
pixels or three (Scharstein and Szeliski, "A Taxonomy and Evaluation of Dense Two-Frame Stereo
Correspondence Algorithms", IJCV 2002)."""

_TIME_OF_FLIGHT = {
    "projector_baseline": 0.0,  # light goes out and comes back on one way
    "surface_depth_sigma": 0.002,
    "near_edge_bias": 1.0,
}
"""Light that comes back by way of a wall or the floor makes each surface read too far, by
millimetres (Fuchs, "Multipath Interference Compensation in Time-of-Flight Camera Images", ICPR
2010): top and side face do not agree where they meet."""

CAMERAS = MappingProxyType[DepthCamera, dict[str, float]](
    {
        # The defaults, of a Kinect or Xtion: a baseline of about 75 mm (Khoshelham and Elberink,
        # Sensors 2012).
        "structured_light": {},
        "time_of_flight": _TIME_OF_FLIGHT,
        "stereo": _STEREO,
        # D435: 50 mm (Intel, D400 series datasheet); a D415 has 55, a D455 has 95.
        "realsense": {"projector_baseline": 0.05, **_STEREO},
        # Distances err by less than 11 mm to 3.5 m (Tolgyessy et al., Sensors 2021), which the
        # default `depth_scale_sigma` of 0.8 % covers from 1.4 m on.
        "azure_kinect": _TIME_OF_FLIGHT,
        # OAK-D: 75 mm (docs.luxonis.com); ZED and ZED 2: 120 mm (Stereolabs).
        "oak": {"projector_baseline": 0.075, **_STEREO},
        "zed": {"projector_baseline": 0.12, **_STEREO},
    }
)
"""The settings of ``sensors`` that differ from the defaults, by camera."""
