"""The field to scale with what stands still on it: start places, barriers, trees, and the numbers of its axes."""

from __future__ import annotations

from collections.abc import Iterator

from eurobot_od.robot.model.facts import Barrier, Facts, Field, Start
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.scene import style
from eurobot_od.support import svg
from eurobot_od.support.svg import PaperPoint

GRID_STEP = 500

MARGIN = 40
"""From the border to the numbers of an axis, and half of it from a zone's edge to its name, mm."""

NAMED = 100
"""A barrier has its whole name on it from this radius on, mm, else its number."""


def on_paper(field: Field, x: float, y: float) -> PaperPoint:
    """Return where a place of the field is drawn: y grows upwards on the field and downwards on paper."""
    # The document's origin is the lower left corner of the field, SVG's the upper left one of the sheet.
    return x, field.height - y


def ground(facts: Facts, team: TeamColour | None = None) -> str:
    """Draw the field, its origin the upper left corner; the start place of `team` is the one that is marked."""
    field, trees = facts.field, facts.field.trees
    return svg.group(
        svg.rectangle((0, 0), field.width, field.height, fill=style.SURFACE),
        *_grid(field),
        *(_start(field, colour, start, colour is team) for colour, start in field.starts.items()),
        *(svg.moved(on_paper(field, *each.point), _barrier(each)) for each in facts.barriers),
        svg.rectangle((0, 0), field.width, field.height, fill="none", stroke=style.INK, stroke_width=field.border),
        *(svg.circle(on_paper(field, *each), trees.radius, fill=style.TREE) for each in trees.places),
    )


def _grid(field: Field) -> Iterator[str]:
    """Draw lines and their numbers."""
    for x in range(0, int(field.width) + 1, GRID_STEP):
        yield svg.line((x, 0), (x, field.height), stroke=style.GRID, stroke_width=3)
        yield _small((x, field.height + MARGIN), str(x), style.PALE, "middle", "hanging")
    for y in range(0, int(field.height) + 1, GRID_STEP):
        yield svg.line((0, y), (field.width, y), stroke=style.GRID, stroke_width=3)
        yield _small((-MARGIN, field.height - y), str(y), style.PALE, "end", "middle")


def _small(place: PaperPoint, words: str, fill: str, anchor: str, baseline: str) -> str:
    return style.label(place, words, fill, style.SMALL, anchor, dominant_baseline=baseline)


def _start(field: Field, colour: TeamColour, start: Start, is_ours: bool) -> str:
    """Draw the zone that a robot starts from."""
    left, lower, right, upper = start.zone
    paint, corner = style.team_colour(colour), on_paper(field, left, upper)
    opacity, width, dashes = (0.3, 10, None) if is_ours else (0.12, 4, "20 12")
    look = {"fill": paint, "fill_opacity": opacity, "stroke": paint, "stroke_width": width, "stroke_dasharray": dashes}
    # Towards the nearer border, where larger letters do not run out of the field.
    x, anchor = (left + MARGIN / 2, "start") if left < field.width / 2 else (right - MARGIN / 2, "end")
    name = _small((x, corner[1] + MARGIN / 2), f"start {colour.name.lower()}", style.INK, anchor, "hanging")
    return svg.group(svg.rectangle(corner, right - left, upper - lower, **look), name)


def _barrier(barrier: Barrier) -> str:
    """Draw a barrier with its name."""
    radius = barrier.kind.radius
    # A small barrier has no room for its name.
    words = barrier.name if radius > NAMED else barrier.name.rpartition(" ")[2]
    # The edge is for where the letters are larger than the barrier, on a phone.
    look = {"font_weight": "bold", "stroke": svg.INK, "stroke_width": 7, "paint_order": "stroke"}
    name = svg.text((0, 13), words, fill=svg.PAPER, font_size=36, text_anchor="middle", **look)
    return svg.group(style.barrier_shape(barrier.kind, radius), name)
