"""The comparison of camera and laser in Rerun."""

from __future__ import annotations

import numpy as np

from tablemap.review.markdown import told
from tablemap.review.stream import Stream
from tablemap.stages.crosscheck import CrossCheck


def log_cross_check(stream: Stream, result: CrossCheck) -> None:
    """Log the camera's offset by edges and legs."""
    stream.text("surface/crosscheck", summary(result))


def summary(result: CrossCheck) -> str:
    """Return the offset with its sigmas, or a sentence that the views do not determine it."""
    title = "## Camera against laser"
    compared = (
        f"{result.points} edge points of {result.views} views and {result.sightings} sightings of "
        "legs were compared."
    )
    if result.offset is None or result.covariance is None or result.at_table is None:
        return f"{title}\n{compared} They cannot tell whether the two disagree."
    x, y, yaw = result.offset
    sigma = np.sqrt(np.diag(result.covariance))
    return "\n".join(
        [
            title,
            f"{compared} They put the camera {1e3 * x:z.1f} mm (sigma {1e3 * sigma[0]:.1f}) "
            f"forward, {1e3 * y:z.1f} mm (sigma {1e3 * sigma[1]:.1f}) left and "
            f"{np.degrees(yaw):z.2f} degrees (sigma {np.degrees(sigma[2]):.2f}) turned from where "
            f"TF has it: at the table {1e3 * result.at_table[0]:.1f} mm forward and "
            f"{1e3 * result.at_table[1]:.1f} mm left.",
            *[
                f"By the {name} alone: {1e3 * by.at_table[0]:.1f} mm (sigma "
                f"{1e3 * by.sigma[0]:.1f}) forward and {1e3 * by.at_table[1]:.1f} mm (sigma "
                f"{1e3 * by.sigma[1]:.1f}) left at the table."
                for name, by in (("edges", result.by_edges), ("legs", result.by_legs))
                if by is not None
            ],
            *_range_scale(result),
            *(
                ["The camera was moved by this, and the top fitted again."]
                if result.is_found
                else []
            ),
            "",
            *told(result.warnings),
        ]
    )


def _range_scale(result: CrossCheck) -> list[str]:
    if result.range_scale is None or result.range_scale_sigma is None:
        return []
    longer = "long" if result.range_scale > 0 else "short"
    return [
        f"The laser's ranges are {1e3 * abs(result.range_scale):.2f} permil (sigma "
        f"{1e3 * result.range_scale_sigma:.2f}) too {longer} against the camera's."
    ]
