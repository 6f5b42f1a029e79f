"""The colours by what they mean: one meaning a colour, in the viewer, on the page and in drawings.

The viewer's spatial views and plots have a dark background of their own in either of its themes.
There all labels are white: under them the viewer lays a veil, dark in the one theme and light in
the other, and nothing else can be read on both. The page and the drawings are dark on paper. Each
meaning has one hue, in a bright tone for the viewer and a deep tone for paper.
"""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[int, int, int]

LEAST_CONTRAST = 4.5
"""Contrast of a text with its background, as WCAG 2.1 demands (level AA)."""
LEAST_VISIBLE = 3.0
"""Contrast of a point or a line with its background."""
BACKGROUND: Colour = (8, 8, 10)
"""Of the viewer's spatial views and plots."""
PAPER: Colour = (255, 255, 255)
LABEL: Colour = (255, 255, 255)
"""Of all text in the viewer's spatial views."""
VEILS: tuple[Colour, Colour] = ((43, 43, 43), (223, 223, 223))
"""What the viewer lays under a label in its dark and its light theme, half transparent."""


@dataclass(frozen=True)
class Ink:
    """One meaning: its tone on the viewer's dark background, and its tone on paper."""

    on_dark: Colour
    on_paper: Colour

    @property
    def css(self) -> str:
        """The tone on paper as CSS has it."""
        return _hex(self.on_paper)

    @property
    def tint(self) -> str:
        """A pale tone for areas on paper, as CSS."""
        red, green, blue = (round(255 - 0.2 * (255 - one)) for one in self.on_paper)
        return _hex((red, green, blue))


# How far a figure or a result can be trusted.
TRUSTED = Ink((90, 215, 120), (27, 122, 54))
"""Measured, used, agreeing."""
CAREFUL = Ink((250, 185, 60), (154, 92, 0))
"""Inferred, or agreeing by half."""
DISTRUSTED = Ink((255, 105, 100), (179, 38, 30))
"""Unseen, dropped, disagreeing."""

# What is seen.
MODEL = Ink((205, 165, 115), (138, 106, 72))
"""The table as it was modelled, and what is seen of its top."""
TABLE_EDGE = Ink((255, 240, 200), (95, 84, 40))
"""Points of the table's edge."""
IN_THE_WAY = Ink((240, 120, 195), (163, 39, 122))
"""What stands on the top or before it."""
OTHER_SURFACE = Ink((70, 205, 220), (8, 106, 120))
"""A surface that is not the table's top."""
LASER = Ink((110, 170, 250), (47, 95, 168))
"""What the laser saw, and the odometry that rests on it."""
BENT = Ink((200, 130, 95), (122, 62, 20))
"""Where the depth image bends away."""

DOUBT = Ink((185, 245, 40), (84, 106, 0))
"""What a doubt is about."""

MENDED = Ink((235, 70, 255), (130, 30, 150))
"""Single pixels of a depth image that were lost or wrong, and took the depth round them."""

# How the robot moved.
LOCALISED = Ink((235, 222, 110), (111, 98, 0))
"""As the recording has it: the localisation's poses, and the place that rests on them."""
WHEELS = Ink((150, 190, 190), (74, 106, 106))
"""By the wheels alone."""
REGISTERED = Ink((245, 245, 250), (28, 28, 32))
"""The stops and the way as registered."""

# What says nothing itself.
LEFT_OUT = Ink((150, 150, 162), (102, 102, 102))
"""Not used, without depth, or of no account here."""
TEXT = Ink((200, 200, 210), (28, 28, 32))
"""Numbers, names and axes."""

# Signed distances: white where there is none.
OUTSIDE = Ink((245, 140, 50), (179, 84, 0))
"""Beyond the outline, or too high."""
INSIDE = Ink((150, 120, 255), (84, 58, 180))
"""Within the outline, or too low."""

# Two things that are compared.
FIRST = Ink((130, 150, 255), (31, 90, 180))
SECOND = Ink((255, 150, 90), (184, 74, 18))

STATUS = {"measured": TRUSTED, "inferred": CAREFUL, "unseen": DISTRUSTED}
"""A side or a leg, by its status in the model."""
VERDICT = {"good": TRUSTED, "doubtful": CAREFUL, "failed": DISTRUSTED}


def contrast(text: Colour, background: Colour) -> float:
    """Return the contrast of two colours by WCAG 2.1, from 1 to 21."""
    darker, lighter = sorted((_luminance(text), _luminance(background)))
    return (lighter + 0.05) / (darker + 0.05)


def label_backgrounds() -> tuple[Colour, Colour]:
    """Return what lies under a label in the viewer's dark theme, and in its light one."""
    dark, light = (
        tuple(round((one + over) / 2) for one, over in zip(BACKGROUND, veil, strict=True))
        for veil in VEILS
    )
    return (dark[0], dark[1], dark[2]), (light[0], light[1], light[2])


def _luminance(colour: Colour) -> float:
    linear = [
        one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4
        for one in (channel / 255 for channel in colour)
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _hex(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
