"""The colours of a view, explained in a strip below it."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from tablemap import palette
from tablemap.palette import Colour
from tablemap.review import colours
from tablemap.review.stream import Stream
from tablemap.stages.segmentation import Label

Entries = tuple[tuple[str, Colour], ...]

WIDTH = 560.0  # pixels for which a strip is laid out in half a window
WIDE = 680.0  # and below a view that has more of it
NARROW = ("labels", "image", "flatness", "registration", "ways")
"""The strips in half a window, or less."""

LETTER, GAP, ROW = 6.6, 36.0, 24.0  # pixels
SQUARE = 5.0
ASIDE = 14.0  # pixels from a square to its word; less in a narrow pane, which shrinks the strip
LABEL_DROP = 11.0  # the viewer writes labels this far below their points

SIDES: Entries = (
    ("measured", palette.TRUSTED.on_dark),
    ("inferred", palette.CAREFUL.on_dark),
    ("not seen", palette.DISTRUSTED.on_dark),
)
EDGES: Entries = (
    ("table's edge", palette.TABLE_EDGE.on_dark),
    ("something before it", palette.IN_THE_WAY.on_dark),
    ("no depth", palette.LEFT_OUT.on_dark),
    ("bent depth", palette.BENT.on_dark),
)
DOUBTED = ("in doubt", palette.DOUBT.on_dark)
AGREEMENT: Entries = (
    ("agrees", palette.TRUSTED.on_dark),
    ("off by 10 mm", palette.CAREFUL.on_dark),
    ("20 mm or more", palette.DISTRUSTED.on_dark),
)
LABELLED: Entries = (
    *[colours.LABELS[one] for one in (Label.TOP, Label.ON_TOP, Label.OTHER_TOP)],
    *[colours.LABELS[one] for one in (Label.FLOOR, Label.FRONT, Label.BEHIND)],
)
LEGENDS: dict[str, Entries] = {
    "overview": (
        *SIDES,
        ("laser", palette.LASER.on_dark),
        ("on the top", palette.IN_THE_WAY.on_dark),
        ("robot's way", palette.REGISTERED.on_dark),
        DOUBTED,
    ),
    "views": (*LABELLED, ("laser", palette.LASER.on_dark), DOUBTED),
    "labels": LABELLED,
    "image": (*SIDES, *EDGES, DOUBTED, ("mended", palette.MENDED.on_dark)),
    "flatness": (
        ("15 mm too low", palette.INSIDE.on_dark),
        ("level", colours.LEVEL),
        ("15 mm too high", palette.OUTSIDE.on_dark),
    ),
    "odometry": (
        ("scan, odometry", palette.LASER.on_dark),
        ("KISS-ICP's map", palette.LEFT_OUT.on_dark),
        ("as localised", palette.LOCALISED.on_dark),
        ("by the wheels", palette.WHEELS.on_dark),
    ),
    "registration": (*AGREEMENT, ("dropped", palette.LEFT_OUT.on_dark), DOUBTED),
    "pair": (
        ("target", palette.TEXT.on_dark),
        ("source before ICP", palette.LOCALISED.on_dark),
        ("after", palette.TRUSTED.on_dark),
        ("after, dropped", palette.DISTRUSTED.on_dark),
    ),
    "ways": (
        ("registered where localised", palette.TRUSTED.on_dark),
        ("25 mm off", palette.CAREFUL.on_dark),
        ("50 mm", palette.DISTRUSTED.on_dark),
        ("localised", palette.LOCALISED.on_dark),
        ("odometry", palette.LASER.on_dark),
        ("wheels", palette.WHEELS.on_dark),
    ),
    "pairs": (
        ("target", palette.TEXT.on_dark),
        ("source", palette.TRUSTED.on_dark),
        ("source of a dropped pair", palette.DISTRUSTED.on_dark),
    ),
    "edges": (*SIDES, *EDGES, ("place in the map, 95 %", palette.LOCALISED.on_dark), DOUBTED),
    "residuals": (
        ("5 mm inside", palette.INSIDE.on_dark),
        ("5 mm outside", palette.OUTSIDE.on_dark),
        ("chosen shape", palette.MODEL.on_dark),
        ("other shapes", palette.LEFT_OUT.on_dark),
    ),
    "tables": (
        *SIDES,
        ("this table", palette.LEFT_OUT.on_dark),
        EDGES[0],
        ("laser", palette.LASER.on_dark),
        DOUBTED,
    ),
    "legs": (
        *SIDES,
        ("laser", palette.LASER.on_dark),
        ("set aside", palette.LEFT_OUT.on_dark),
        ("model", palette.MODEL.on_dark),
        DOUBTED,
    ),
}


def log_legends(stream: Stream) -> None:
    """Log the strips, once for the whole file; one that has the model alone has one tab."""
    is_short = stream.config.level == "off"
    for name, entries in LEGENDS.items():
        if is_short and name != "overview":
            continue
        places = _places(name)
        words = np.array([LETTER * len(text) / 2 + SQUARE + ASIDE for text, _ in entries])
        stream.rec.log(
            f"legend/{name}/colours",
            rr.Points2D(places, colors=[colour for _, colour in entries], radii=SQUARE),
            static=True,
        )
        stream.rec.log(
            f"legend/{name}/words",
            rr.Points2D(
                places + np.column_stack([words, np.full(len(words), -LABEL_DROP)]),
                labels=[text for text, _ in entries],
                colors=[palette.LABEL],
                radii=rr.Radius.ui_points(0.0),
                show_labels=True,
            ),
            static=True,
        )


def with_legend(
    view: rrb.View | rrb.Container, name: str, *, height: float, in_tabs: bool = False
) -> rrb.Vertical:
    """Return a view with its strip below it; ``height`` is the view's, in pixels."""
    if isinstance(view, rrb.View) and in_tabs:
        view.titlebar = False  # the tab has the name
    places = _places(name)
    tall = float(places[-1, 1]) + ROW / 2
    strip = rrb.Spatial2DView(
        origin=f"/legend/{name}",
        name="Legend",
        titlebar=False,
        background=palette.BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, _width(name)), y_range=(0.0, tall)),
    )
    return rrb.Vertical(view, strip, row_shares=[height, tall + 4], name=view.name)


def _width(name: str) -> float:
    return WIDTH if name in NARROW else WIDE


def _places(name: str) -> np.typing.NDArray[np.float64]:
    """Return where a strip's squares lie, (n, 2) pixels, in rows from above."""
    places, x, row = [], GAP / 2, 0
    for text, _ in LEGENDS[name]:
        wide = LETTER * len(text) + GAP
        if x + wide > _width(name) and x > GAP:
            x, row = GAP / 2, row + 1
        places.append((x, ROW * (row + 0.5)))
        x += wide
    return np.array(places)
