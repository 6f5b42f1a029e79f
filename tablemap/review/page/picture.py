"""The camera's best view of the table with the model drawn into it, as SVG."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import numpy as np
import PIL.Image
from numpy.typing import NDArray

from tablemap import palette
from tablemap.model import TableModel
from tablemap.recording.messages import CompressedImage
from tablemap.review.clouds import closed
from tablemap.review.doubted import DoubtLines
from tablemap.review.images import JPEG, as_jpeg, colour_size
from tablemap.review.projection import (
    base_in_map,
    edge_points_seen,
    in_image,
    model_lines,
    places_apart,
)
from tablemap.stages.calibration import Calibration
from tablemap.stages.outline import Outline
from tablemap.stages.segmentation import Segmentation, TableCandidate, TablesFound
from tablemap.stages.snapshots import Snapshot

WIDTH = 640  # pixels, the most
QUALITY = 80
MOST_FOUND = 6  # surfaces that are drawn where none was a table
NUMBER_SHARE = 0.06  # of the picture's height


class BestView:
    """Finds the view that shows most of the table's edge; call it with each result."""

    def __init__(self) -> None:
        self._snapshots: dict[int, Snapshot] = {}
        self._edges: dict[int, int] = {}
        self._floor_z = 0.0
        self._found: tuple[TableCandidate, ...] = ()

    @property
    def found(self) -> tuple[TableCandidate, ...]:
        """The surfaces that could have been the table."""
        return self._found

    def __call__(self, result: object) -> None:
        """Take a result of the run."""
        if isinstance(result, Calibration):
            self._snapshots = {snapshot.index: snapshot for snapshot in result.snapshots}
            self._floor_z = result.floor_z
        elif isinstance(result, Outline):
            self._edges = edge_points_seen(result)
        elif isinstance(result, (TablesFound, Segmentation)):
            self._found = result.candidates

    def svg(self, model: TableModel, doubts: Sequence[DoubtLines] = ()) -> str:
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
        return _svg(
            snapshot,
            f"The model in view {best}",
            _drawn(model, snapshot, doubts),
            "the one that shows most of the edge, with the model as its registered pose has it. "
            f"Dashed: not measured.{DOUBTS_TOLD if doubts else ''}",
        )

    def svg_of_found(self) -> str:
        """Return the view that shows most of the likeliest surfaces; nothing without any."""
        surfaces = [(k, one) for k, one in enumerate(self._found[:MOST_FOUND]) if len(one.hull)]
        drawn = {
            index: [(k, piece) for k, one in surfaces for piece in self._pieces(snapshot, one)]
            for index, snapshot in self._snapshots.items()
        }
        best = max(
            drawn, key=lambda index: sum(len(piece) for _, piece in drawn[index]), default=-1
        )
        if best < 0 or not drawn[best]:
            return ""
        snapshot = self._snapshots[best]
        colour = _css(palette.OTHER_SURFACE)
        lines = [_polyline(piece, colour, 2.5) for _, piece in drawn[best]]
        pieces: dict[int, list[NDArray[np.float32]]] = {}
        for k, piece in drawn[best]:
            pieces.setdefault(k, []).append(piece)
        size, wide = NUMBER_SHARE * snapshot.depth.shape[0], snapshot.depth.shape[1]
        lines += [
            f'<text x="{min(x, wide - size):.1f}" y="{max(y - size / 4, size):.1f}" fill="white" '
            f'stroke="black" stroke-width="{size / 5:.1f}" paint-order="stroke" '
            f'font-size="{size:.1f}">{k}</text>'
            for k, (x, y) in places_apart(pieces).items()
        ]
        return _svg(
            snapshot,
            f"The surfaces found, in view {best}",
            "".join(lines),
            "with the likeliest surfaces by their numbers, as localised.",
        )

    def _pieces(self, snapshot: Snapshot, one: TableCandidate) -> list[NDArray[np.float32]]:
        map_from_base = snapshot.map_from_base.lifted()
        map_from_base[2, 3] = self._floor_z
        line = closed(one.hull, self._floor_z + one.height)
        return in_image(snapshot, map_from_base, line, dashed=False)


def _svg(snapshot: Snapshot, title: str, drawn: str, told: str) -> str:
    """Return a view's picture with lines drawn into it, and what it is below."""
    picture, what = _picture(snapshot)
    high, wide = snapshot.depth.shape
    return (
        f'<svg viewBox="0 0 {wide} {high}" width="{min(wide, WIDTH)}" role="img">'
        f"<title>{title}</title>"
        f'<image width="{wide}" height="{high}" preserveAspectRatio="none" '
        f'href="data:image/jpeg;base64,{base64.b64encode(picture).decode()}"/>'
        f"{drawn}</svg>"
        f'<p class="muted">View {snapshot.index} ({what}), {told}</p>'
    )


def _css(ink: palette.Ink) -> str:
    """Return the tone of a meaning for pictures."""
    return "rgb({}, {}, {})".format(*ink.on_dark)


def _polyline(piece: NDArray[np.float32], colour: str, width: float) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in piece[:: _step(len(piece))])
    return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def _is_used(model: TableModel, index: int) -> bool:
    return index < len(model.snapshots) and model.snapshots[index].used


DOUBTS_TOLD = " Yellow-green: what the doubts are about."


def _drawn(model: TableModel, snapshot: Snapshot, doubts: Sequence[DoubtLines]) -> str:
    pose = base_in_map(model, snapshot)
    parts = []
    for part, status, line in model_lines(model):
        ink = palette.LEFT_OUT if part == "underside" else palette.STATUS[status]
        width = 1 if part == "underside" else 2.5
        pieces = in_image(snapshot, pose, line, dashed=status != "measured")
        parts += [_polyline(piece, _css(ink), width) for piece in pieces]
    for doubt in doubts:
        for line in doubt.lines:
            for piece in in_image(snapshot, pose, line, dashed=False):
                named = _polyline(piece, _css(palette.DOUBT), 2.5)
                parts.append(f"<g><title>{doubt.name}</title>{named}</g>")
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
