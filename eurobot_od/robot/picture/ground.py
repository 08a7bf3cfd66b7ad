"""The field to scale with what stands still on it: start places, barriers and the rings to avoid them, trees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eurobot_od.robot.model.facts import Barrier, BarrierKind, BarrierShape, Facts, Field, Start
from eurobot_od.robot.model.values import Passage, TeamColour
from eurobot_od.robot.picture import style
from eurobot_od.support import svg
from eurobot_od.support.svg import PaperPoint

GRID_STEP = 500

NAMED = 100
"""A barrier has its whole name on it from this radius on, mm, else its number."""

CORNERS = {BarrierShape.TRIANGLE: (3, -90.0), BarrierShape.SQUARE: (4, 45.0)}
"""Corners of a shape, and the direction of the first one, degrees clockwise."""

RING = 60
"""Distance of the ring around a barrier, mm."""


class Sheet:
    """The paper that a field is drawn on: one unit is one millimetre, its origin the field's upper left corner."""

    def __init__(self, field: Field) -> None:
        self.width, self.height = field.width, field.height

    def place(self, x: float, y: float) -> PaperPoint:
        """Return where a place of the field is drawn: y grows upwards on the field and downwards on paper."""
        # The document's origin is the lower left corner of the field, SVG's the upper left one of the sheet.
        return x, self.height - y

    def grid(self) -> Iterator[str]:
        """Draw lines and their numbers."""
        place, width, height = self.place, self.width, self.height
        for x in range(0, int(width) + 1, GRID_STEP):
            yield svg.line(place(x, 0), place(x, height), stroke=svg.GRID, stroke_width=3)
            yield style.label((x, height + 18), str(x), fill=svg.PALE, size=style.SMALL, dominant_baseline="hanging")
        for y in range(0, int(height) + 1, GRID_STEP):
            yield svg.line(place(0, y), place(width, y), stroke=svg.GRID, stroke_width=3)
            yield style.label((-24, height - y + 11), str(y), fill=svg.PALE, size=style.SMALL, anchor="end")

    def start(self, colour: TeamColour, start: Start, ours: bool) -> str:
        """Draw the zone that a robot starts from."""
        left, lower, right, upper = start.zone
        corner = self.place(left, upper)
        square = svg.rectangle(
            corner,
            right - left,
            upper - lower,
            fill=style.TEAM[colour],
            fill_opacity=0.3 if ours else 0.12,
            stroke=style.TEAM[colour],
            stroke_width=10 if ours else 4,
            stroke_dasharray=None if ours else "20 12",
        )
        name = style.label(
            (corner[0] + (right - left) / 2, corner[1] + 46), f"start {colour.name.lower()}", size=style.SMALL
        )
        return svg.group(square, name)

    def barrier(self, barrier: Barrier, passage: Passage) -> str:
        """Draw a barrier with its name, and with a ring if a goto avoids it."""
        centre, radius = self.place(barrier.x, barrier.y), barrier.kind.radius
        ring = [] if passage is Passage.FREE else [passage_ring(centre, radius + RING, passage)]
        # A small barrier has no room for its name.
        words = barrier.name if radius > NAMED else barrier.name.rpartition(" ")[2]
        name = style.label((centre[0], centre[1] + 13), words, fill=svg.PAPER, size=36, font_weight="bold")
        return svg.group(*ring, barrier_shape(barrier.kind, centre, radius), name)


def ground(facts: Facts, team: TeamColour | None, passages: Mapping[int, Passage]) -> str:
    """Draw the field; the start place of `team` is the one that is marked, barriers are ringed by their passage."""
    field, sheet = facts.field, Sheet(facts.field)
    return svg.group(
        svg.rectangle((0, 0), field.width, field.height, fill=style.SURFACE),
        *sheet.grid(),
        *(sheet.start(colour, start, colour is team) for colour, start in field.starts.items()),
        *(sheet.barrier(each, passages.get(each.number, Passage.FREE)) for each in facts.barriers),
        svg.rectangle((0, 0), field.width, field.height, fill="none", stroke=svg.INK, stroke_width=field.border),
        *(svg.circle(sheet.place(*each), field.trees.radius, fill=style.TREE) for each in field.trees.places),
    )


def barrier_shape(kind: BarrierKind, centre: PaperPoint, radius: float) -> str:
    """Draw a barrier by its shape; what can be pushed along has another colour than what stays."""
    colour = style.PUSHED if kind.pushed else style.FIXED
    if kind.shape is BarrierShape.DISC:
        return svg.circle(centre, radius, fill=colour)
    return svg.polygon(style.around(centre, radius, *CORNERS[kind.shape]), fill=colour)


def passage_ring(centre: PaperPoint, radius: float, passage: Passage) -> str:
    """Draw the ring around a barrier that a goto asked to avoid."""
    _, dashes, width = style.PASSAGES[passage]
    return svg.circle(centre, radius, fill="none", stroke=style.STOP, stroke_width=width, stroke_dasharray=dashes)
