"""Colours, sizes and marks of the field; each mark is drawn around its centre.

One unit is one millimetre of the field. Everything can be distinguished without colour, by shape, dashes or a label. A
colour is a CSS variable with light and dark values on the page, and light ones in a file; the robots' colours can be
distinguished by colour-blind people (tests/robot/web/test_colours.py computes it).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from eurobot_od.robot.model import messages
from eurobot_od.robot.model.robot_file import BarrierKind, BarrierShape
from eurobot_od.robot.model.values import Outcome, Passage, TeamColour
from eurobot_od.support import svg
from eurobot_od.support.svg import PaperPoint

# Colours


class Colour(NamedTuple):
    """A colour on a light background, and on a dark one."""

    light: str
    dark: str


NAMES = ("ink", "pale", "paper", "surface", "grid", "goto", "stop")
INK, PALE, PAPER, SURFACE, GRID, GOTO, STOP = (f"var(--field-{each})" for each in NAMES)
PUSHED, FIXED, TREE, TRUTH, TOUCH = "#e8762c", "#8d6e63", "#558b2f", "#12b5a0", "#d500f9"
"""Colours that are the same on both backgrounds."""


def colour_of(robot: str) -> str:
    """Return the colour of a robot by its name, for ours by its team."""
    return f"var(--robot-{robot.lower().replace(' ', '-')})"


COLOURS: Mapping[str, Colour] = {
    INK: Colour(svg.INK, "#e8eaed"),
    PALE: Colour(svg.PALE, "#a9b1ba"),
    PAPER: Colour(svg.PAPER, "#14171b"),
    SURFACE: Colour("#fbfaf4", "#20242a"),
    GRID: Colour(svg.GRID, "#3a4048"),
    GOTO: Colour("#1c2f6b", "#9fb6ff"),
    STOP: Colour(svg.RED, "#ff8a80"),
    colour_of("red"): Colour("#d32f2f", "#ff6e64"),
    colour_of("yellow"): Colour("#9a7000", "#e0a800"),
    colour_of("enemy 1"): Colour("#4a148c", "#9575ff"),
    colour_of("enemy 2"): Colour("#0288d1", "#4fc3f7"),
    colour_of("confederate"): Colour("#163b2c", "#e6fff0"),
}


def style_sheet() -> str:
    """Return the colours as CSS for the page."""
    light, dark = (
        " ".join(f"{name[4:-1]}: {each[ground]};" for name, each in COLOURS.items())
        for ground in (Colour._fields.index("light"), Colour._fields.index("dark"))
    )
    return f":root {{ {light} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"


def printed(drawing: str) -> str:
    """Return a drawing with light colours instead of variables, which not every SVG viewer knows."""
    return re.sub("|".join(map(re.escape, COLOURS)), lambda found: COLOURS[found[0]].light, drawing)


OTHERS: Mapping[type[messages.PositionResponse], tuple[str, str | None]] = {
    messages.Enemy1PositionResponse: ("enemy 1", None),
    messages.Enemy2PositionResponse: ("enemy 2", "26 12"),
    messages.ConfederatePositionResponse: ("confederate", "6 12"),
}
"""Names and dashes of the other robots."""


def team_colour(team: TeamColour | None) -> str:
    """Return the colour of our robot."""
    return INK if team is None else colour_of(team.name)


PASSAGES = {
    Passage.NORMAL: ("barrier, avoided if possible", "18 14", 8),
    Passage.FORCED: ("barrier, never crossed", None, 14),
}
"""Meaning, dashes and width of the ring around a barrier in a goto."""

RAMP = ((0x7F, 0xCD, 0xEE), (0x2F, 0x8F, 0xD0), (0x34, 0x57, 0xA6), (0x2A, 0x1F, 0x6B))
"""Colours of the time from start to end, which get darker, so that the order is visible in grey."""


def colour_at(share: float) -> str:
    """Return the colour of a moment; `share` is 0 to 1 of the match."""
    place = min(max(share, 0.0), 1.0) * (len(RAMP) - 1)
    # The end of the match is the end of the last piece.
    step = min(int(place), len(RAMP) - 2)
    mixed = (round(a + (b - a) * (place - step)) for a, b in zip(RAMP[step], RAMP[step + 1]))
    return "#" + "".join(f"{part:02x}" for part in mixed)


# Texts

TEXT, SMALL = 38, 31


def label(
    place: PaperPoint, words: str, fill: str = INK, size: float = TEXT, anchor: str = "middle", **attributes: object
) -> str:
    """Return a text, by default centred at its foot."""
    return svg.text(place, words, fill=fill, font_size=size, text_anchor=anchor, **attributes)


def halo(place: PaperPoint, words: str, fill: str = INK, anchor: str = "middle") -> str:
    """Return a small text that is readable on lines."""
    return label(
        place, words, fill, SMALL, anchor, stroke=PAPER, stroke_width=10, stroke_linejoin="round", paint_order="stroke"
    )


# Marks

MARK = 29
"""Radius of numbered discs and signs."""

RING = 60
"""Distance of the ring from a barrier."""

TYRE = 24
"""Width of a wheel."""

CORNERS = {BarrierShape.TRIANGLE: (3, -90.0), BarrierShape.SQUARE: (4, 45.0)}
"""Number of corners of a shape, and the direction of the first one, in degrees clockwise."""

CENTRE = (0.0, 0.0)


def around(radius: float, corners: int, turn: float = 0.0) -> list[PaperPoint]:
    """Return the corners of a regular polygon; `turn` in degrees, clockwise."""
    steps = (math.radians(turn + 360.0 * each / corners) for each in range(corners))
    return [(radius * math.cos(step), radius * math.sin(step)) for step in steps]


def barrier_shape(kind: BarrierKind, radius: float) -> str:
    """Return a barrier by its shape, in different colours for movable and fixed ones."""
    colour = PUSHED if kind.pushed else FIXED
    if kind.shape is BarrierShape.DISC:
        return svg.circle(CENTRE, radius, fill=colour)
    return svg.polygon(around(radius, *CORNERS[kind.shape]), fill=colour)


def ring_mark(radius: float, passage: Passage, *content: str) -> str:
    """Return the ring around a barrier that a goto avoids."""
    _, dashes, width = PASSAGES[passage]
    look = {"fill": "none", "stroke": STOP, "stroke_width": width, "stroke_dasharray": dashes}
    return svg.element("circle", *content, r=radius, **look)


def target_mark(angle: float) -> str:
    """Return the target of a goto, with a tip in the direction of the final heading."""
    return svg.group(
        svg.polygon([(68, 0), (30, -20), (30, 20)], fill=GOTO, transform=f"rotate({svg.number(-angle)})"),
        svg.circle(CENTRE, 26, fill=PAPER, stroke=GOTO, stroke_width=7),
        svg.circle(CENTRE, 8, fill=GOTO),
    )


def goto_mark(number: int, outcome: Outcome | None, *content: str) -> str:
    """Return the numbered disc of a goto, filled if it was reached."""
    disc, figure = (GOTO, PAPER) if outcome is Outcome.ARRIVED else (PAPER, GOTO)
    return _sign(svg.circle(CENTRE, MARK, fill=disc, stroke=GOTO, stroke_width=5), str(number), figure, *content)


def stop_mark(letter: str, *content: str) -> str:
    """Return the sign of a stop with its letter."""
    sign = svg.polygon(around(MARK + 6, 8, 22.5), fill=STOP, stroke=PAPER, stroke_width=5)
    return _sign(sign, letter, PAPER, *content)


def _sign(shape: str, words: str, fill: str, *content: str) -> str:
    return svg.group(*content, shape, label((0, 11), words, fill, SMALL, font_weight="bold"))


def task_mark(worth: str, *content: str) -> str:
    """Return the sign of a task with what it is worth."""
    return _sign(svg.polygon(around(MARK + 6, 4), fill=PAPER, stroke=INK, stroke_width=4), worth, INK, *content)


def touch_mark(at_fault: bool, *content: str) -> str:
    """Return the burst of a touch, filled if our robot drove into the other."""
    spikes = [corner for turn in range(0, 360, 45) for corner in (*around(30, 1, turn), *around(13, 1, turn + 22.5))]
    fill, edge = (TOUCH, PAPER) if at_fault else (PAPER, TOUCH)
    return svg.group(*content, svg.polygon(spikes, fill=fill, stroke=edge, stroke_width=4, stroke_linejoin="round"))


def robot_mark(
    radius: float, colour: str, dashes: str | None = None, outline: Iterable[PaperPoint] = (), *content: str
) -> str:
    """Return a robot by its outline, or as a disc."""
    corners = list(outline)
    look = {"fill": colour, "fill_opacity": 0.25, "stroke": colour, "stroke_width": 8, "stroke_dasharray": dashes}
    return svg.group(svg.polygon(corners, **look) if corners else svg.circle(CENTRE, radius, **look), *content)
