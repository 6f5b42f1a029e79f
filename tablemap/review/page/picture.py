"""The camera's best view of the table with the model drawn into it, as SVG."""

from __future__ import annotations

import base64
import io

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from tablemap import palette
from tablemap.geometry import Pose2
from tablemap.model import TableModel
from tablemap.recording.messages import CompressedImage
from tablemap.review.images import JPEG, as_jpeg, colour_size
from tablemap.review.projection import edge_points_seen, in_image, model_lines
from tablemap.stages.calibration import Calibration
from tablemap.stages.outline import Outline
from tablemap.stages.snapshots import Snapshot

WIDTH = 640  # pixels, the most
QUALITY = 80


class BestView:
    """Finds the view that shows most of the table's edge; call it with each result."""

    def __init__(self) -> None:
        self._snapshots: dict[int, Snapshot] = {}
        self._edges: dict[int, int] = {}

    def __call__(self, result: object) -> None:
        """Take a result of the run."""
        if isinstance(result, Calibration):
            self._snapshots = {snapshot.index: snapshot for snapshot in result.snapshots}
        elif isinstance(result, Outline):
            self._edges = edge_points_seen(result)

    def svg(self, model: TableModel) -> str:
        """Return the picture; nothing where no used view shows the table's edge."""
        seen = {
            index: much
            for index, much in self._edges.items()
            if much and index in self._snapshots and _is_used(model, index)
        }
        if not seen:
            return ""
        best = max(seen, key=lambda index: seen[index])
        snapshot = self._snapshots[best]
        picture, what = _picture(snapshot)
        high, wide = snapshot.depth.shape
        return (
            f'<svg viewBox="0 0 {wide} {high}" width="{min(wide, WIDTH)}" role="img">'
            f"<title>The model in view {best}</title>"
            f'<image width="{wide}" height="{high}" preserveAspectRatio="none" '
            f'href="data:image/jpeg;base64,{base64.b64encode(picture).decode()}"/>'
            f"{_drawn(model, snapshot)}</svg>"
            f'<p class="muted">View {best} ({what}), the one that shows most of the edge, with the '
            "model as its registered pose has it. Dashed: not measured.</p>"
        )


def _is_used(model: TableModel, index: int) -> bool:
    return index < len(model.snapshots) and model.snapshots[index].used


def _drawn(model: TableModel, snapshot: Snapshot) -> str:
    base = model.snapshots[snapshot.index].map_from_base
    map_from_base = Pose2(base.x, base.y, base.yaw).lifted()
    map_from_base[2, 3] = model.floor_z
    parts = []
    for part, status, line in model_lines(model):
        ink = palette.LEFT_OUT if part == "underside" else palette.STATUS[status]
        colour = "rgb({}, {}, {})".format(*ink.on_dark)
        width = 1 if part == "underside" else 2.5
        for piece in in_image(snapshot, map_from_base, line, dashed=status != "measured"):
            points = " ".join(f"{x:.1f},{y:.1f}" for x, y in piece[:: _step(len(piece))])
            parts.append(
                f'<polyline points="{points}" fill="none" stroke="{colour}" '
                f'stroke-width="{width}"/>'
            )
    return "".join(parts)


def _step(count: int) -> int:
    """Return which points of a line suffice, its ends among them."""
    return next((step for step in (8, 4, 2) if (count - 1) % step == 0), 1)


def _picture(snapshot: Snapshot) -> tuple[bytes, str]:
    """Return a JPEG of the view: its colour image where that fits, else its depth in grey."""
    colour, shape = snapshot.colour_message, snapshot.depth.shape
    if colour is not None and colour.frame_id == snapshot.depth_message.frame_id:
        found = bytes(colour.data) if isinstance(colour, CompressedImage) else as_jpeg(colour)
        if colour_size(colour) == shape[::-1] and found is not None and found.startswith(JPEG):
            return found, "colour"
    return _grey(snapshot.depth), "depth: near bright, far dark"


def _grey(depth: NDArray[np.float32]) -> bytes:
    seen = depth[np.isfinite(depth)]
    near, far = np.percentile(seen, [2, 98]) if len(seen) else (0.0, 1.0)
    share = np.clip((depth - near) / max(far - near, 1e-6), 0.0, 1.0)
    pixels = np.nan_to_num(230.0 - 170.0 * share, nan=0.0).astype(np.uint8)
    buffer = io.BytesIO()
    PIL.Image.fromarray(pixels).save(buffer, format="JPEG", quality=QUALITY)
    return buffer.getvalue()
