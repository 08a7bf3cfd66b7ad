"""Colours, sizes and the marks of the picture.

Rule of this file: one unit is one millimetre of the field. Everything can be distinguished in print without colour:
by shape, dashes or a label.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import Outcome, Passage, TeamColour
from eurobot_od.support import svg
from eurobot_od.support.svg import GREEN, INK, PAPER, RED, PaperPoint

MOST_TICKS = 60
"""The most times that are marked: one far timestamp in a log is no reason to draw for ever."""

TEXT, SMALL = 38, 31

SURFACE, PUSHED, FIXED, STOP, GOTO, TRUTH = "#fbfaf4", "#e8762c", "#8d6e63", RED, "#1c2f6b", "#12b5a0"
TREE, TOUCH = "#558b2f", "#d500f9"
TEAM = {TeamColour.RED: "#d32f2f", TeamColour.YELLOW: "#f2b705"}

OTHERS: Mapping[type[messages.PositionResponse], tuple[str, str, str | None]] = {
    messages.Enemy1PositionResponse: ("enemy 1", "#8e24aa", None),
    messages.Enemy2PositionResponse: ("enemy 2", "#ad5a00", "26 12"),
    messages.ConfederatePositionResponse: ("confederate", GREEN, "6 12"),
}
"""Name, colour and dashes of the other robots."""


def colour_of(team: TeamColour | None) -> str:
    """Return the colour of our robot."""
    return INK if team is None else TEAM[team]


PASSAGES = {Passage.NORMAL: ("barrier, normal", "18 14", 8), Passage.FORCED: ("barrier, forced", None, 14)}
"""Name, dashes and width of the ring around a barrier that a goto asked for."""

OUTCOMES: Mapping[Outcome | None, str] = {
    Outcome.ARRIVED: GREEN,
    **dict.fromkeys((Outcome.STOPPED, Outcome.BLOCKED, Outcome.NOT_POSSIBLE), STOP),
    **dict.fromkeys((Outcome.REPLACED, None), "#78909c"),
}
"""Colours of gotos by how they ended; None is still under way."""

RAMP = ((0x7F, 0xCD, 0xEE), (0x2F, 0x8F, 0xD0), (0x34, 0x57, 0xA6), (0x2A, 0x1F, 0x6B))
"""Colours of the time from start to end; they get darker, so that the order is seen in grey as well."""


def ticks(tick: int, end: float) -> range:
    """Return the times up to the end that are marked: every `tick` seconds, more seldom where that were too many."""
    step = tick * max(math.ceil(end / tick / MOST_TICKS), 1)
    return range(step, int(end) + 1, step)


def colour_at(share: float) -> str:
    """Return the colour of a moment, `share` 0..1 of the match."""
    place = min(max(share, 0.0), 1.0) * (len(RAMP) - 1)
    # At the very end of the match the last colour is the far end of the last piece.
    step = min(int(place), len(RAMP) - 2)
    mixed = (round(a + (b - a) * (place - step)) for a, b in zip(RAMP[step], RAMP[step + 1]))
    return "#" + "".join(f"{part:02x}" for part in mixed)


# Marks

TYRE = 24
"""How wide a wheel is drawn, mm."""

MARK = 29
"""Radius of the numbered discs and signs."""


def around(centre: PaperPoint, radius: float, corners: int, turn: float = 0.0) -> list[PaperPoint]:
    """Return the corners of a regular figure; `turn` in degrees, clockwise as one looks at it."""
    steps = (math.radians(turn + 360.0 * each / corners) for each in range(corners))
    return [(centre[0] + radius * math.cos(step), centre[1] + radius * math.sin(step)) for step in steps]


def target_mark(centre: PaperPoint, angles: Iterable[float] = ()) -> str:
    """Draw the place that a goto leads to, with a tip for each angle that the robot is to turn to."""
    tips, (x, y), foot, tip = [], centre, 30, 68
    for angle in angles:
        # Angles count counter-clockwise, and y grows downwards on paper: hence the minus.
        cos, sin = math.cos(math.radians(angle)), -math.sin(math.radians(angle))
        sides = [(x + foot * cos + side * sin, y + foot * sin - side * cos) for side in (20, -20)]
        tips.append(svg.polygon([(x + tip * cos, y + tip * sin), *sides], fill=GOTO))
    return svg.group(
        *tips,
        svg.circle(centre, 26, fill=PAPER, stroke=GOTO, stroke_width=7),
        svg.circle(centre, 8, fill=GOTO),
    )


def goto_mark(centre: PaperPoint, number: int, outcome: Outcome | None, *content: str) -> str:
    """Draw a goto as a disc with its number, filled if it was reached."""
    disc, figure = (GOTO, PAPER) if outcome is Outcome.ARRIVED else (PAPER, GOTO)
    return svg.group(
        *content,
        svg.circle(centre, MARK, fill=disc, stroke=GOTO, stroke_width=5),
        label((centre[0], centre[1] + 11), str(number), fill=figure, size=SMALL, font_weight="bold"),
    )


def stop_mark(centre: PaperPoint, letter: str, *content: str) -> str:
    """Draw a stop as a road sign with its letter."""
    return svg.group(
        *content,
        svg.polygon(around(centre, MARK + 6, 8, 22.5), fill=STOP, stroke=PAPER, stroke_width=5),
        label((centre[0], centre[1] + 11), letter, fill=PAPER, size=SMALL, font_weight="bold"),
    )


def touch_mark(centre: PaperPoint, at_fault: bool, *content: str) -> str:
    """Draw a touch as a burst, filled if our robot drove into the other."""
    spikes = [
        corner
        for turn in range(0, 360, 45)
        for corner in (*around(centre, 30, 1, turn), *around(centre, 13, 1, turn + 22.5))
    ]
    fill, edge = (TOUCH, PAPER) if at_fault else (PAPER, TOUCH)
    return svg.group(*content, svg.polygon(spikes, fill=fill, stroke=edge, stroke_width=4, stroke_linejoin="round"))


def robot_mark(
    centre: PaperPoint, radius: float, angle: float | None, colour: str, outline: Iterable[PaperPoint] = ()
) -> str:
    """Draw a robot by its outline, or as a disc, with a line to its front."""
    look = {"fill": colour, "fill_opacity": 0.25, "stroke": colour, "stroke_width": 8}
    corners = list(outline)
    disc = svg.polygon(corners, **look) if corners else svg.circle(centre, radius, **look)
    if angle is None:
        return svg.group(disc)
    direction = math.radians(angle)
    front = centre[0] + radius * math.cos(direction), centre[1] - radius * math.sin(direction)
    return svg.group(disc, svg.line(centre, front, stroke=colour, stroke_width=12))


def label(
    place: PaperPoint, words: str, fill: str = INK, size: float = TEXT, anchor: str = "middle", **attributes: object
) -> str:
    """Write a text, by default centred at its foot."""
    return svg.text(place, words, fill=fill, font_size=size, text_anchor=anchor, **attributes)


def halo(place: PaperPoint, words: str, fill: str = INK, anchor: str = "middle") -> str:
    """Write a small text that stays readable upon lines."""
    return label(
        place, words, fill, SMALL, anchor, stroke=PAPER, stroke_width=10, stroke_linejoin="round", paint_order="stroke"
    )
