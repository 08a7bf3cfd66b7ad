"""Draws one goto of a match for beginners, with few lines and a legend."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import dist
from typing import Any

from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import OURS, Outcome
from eurobot_od.robot.scene import style
from eurobot_od.robot.scene.recording import PathPoint, RecordedGoto, Recording, at
from eurobot_od.robot.scene.scene import Explained, Look, ground, looks, on_paper, things
from eurobot_od.support import svg

SIZE = (3300, 2850)
"""Width and height: the field with its numbers, the sentence above it and the legend below."""

CORNER = (200, 190)
"""Upper left corner of the field."""

WORDS, ROW, COLUMN = 60, 110, 1560
"""Size of texts, distance of the legend's rows, distance of its columns."""

LINE, OTHERS = 26, 5
"""Width of this goto's path, and of the rest of the path."""


def longest(gotos: Sequence[RecordedGoto], path: Sequence[PathPoint]) -> RecordedGoto | None:
    """Return the reached goto with the longest straight distance; None if none was reached."""
    begins = {each: at([*path], each.sent) for each in gotos if each.outcome is Outcome.ARRIVED}
    distances = {
        goto: dist((begin.x, begin.y), (goto.message.x, goto.message.y)) for goto, begin in begins.items() if begin
    }
    return max(distances, key=distances.__getitem__, default=None)


def picture(recording: Recording, facts: Facts, goto: RecordedGoto) -> str:
    """Return an SVG of a reached goto: the field, a sentence, and a legend."""
    end = goto.ended or recording.end
    asked = goto.message
    words = f"Goto {goto.number}: to x {asked.x} mm, y {asked.y} mm, {asked.angle} deg, with {asked.speed} % speed"
    after = f"; arrived after {end - goto.sent:.1f} s"
    legend = [
        svg.moved((CORNER[0] + n % 2 * COLUMN, CORNER[1] + facts.field.height + 200 + n // 2 * ROW), _row(each))
        for n, each in enumerate(_legend(facts, goto))
    ]
    return svg.element(
        "svg",
        svg.rectangle((0, 0), *SIZE, fill=svg.PAPER),
        style.label((CORNER[0], 110), words + after, svg.INK, WORDS, "start", font_weight="bold"),
        style.printed(svg.moved(CORNER, ground(facts, recording.team), *_drawn(recording, facts, goto, end))),
        style.printed(svg.group(*legend)),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {SIZE[0]} {SIZE[1]}",
        font_family=svg.FONT,
    )


def _drawn(recording: Recording, facts: Facts, goto: RecordedGoto, end: float) -> Iterator[str]:
    field = facts.field
    asked = goto.message
    robots = {each.message: each for each in looks(facts, recording.configuration)}
    for barrier, passage in facts.flagged(asked.barriers):
        ring = style.ring_mark(barrier.kind.radius + style.RING, passage)
        yield svg.moved(on_paper(field, *barrier.point), ring)
    rest = [on_paper(field, each.x, each.y) for each in recording.path]
    yield svg.polyline(rest, fill="none", stroke=svg.PALE, stroke_width=OTHERS, stroke_opacity=0.5)
    way = [each for each in recording.path if goto.sent <= each.time <= end]
    yield svg.polyline(
        [on_paper(field, each.x, each.y) for each in way],
        fill="none",
        stroke=style.GOTO,
        stroke_width=LINE,
        stroke_linejoin="round",
    )
    for kind, path in recording.paths.items():
        look = robots[kind.__name__]
        begin = at(path, goto.sent)
        place = at(path, end)
        if look.trail and place is not None:
            yield from _robot(facts, look, place)
        if look.name == OURS and begin is not None:
            start = on_paper(field, begin.x, begin.y)
            yield svg.circle(start, LINE, fill=style.PAPER, stroke=style.GOTO, stroke_width=LINE / 2)
    target = style.target_mark(asked.angle)
    yield svg.moved(on_paper(field, asked.x, asked.y), svg.group(target, transform="scale(1.5)"))


def _robot(facts: Facts, look: Look, place: PathPoint) -> Iterator[str]:
    """Yield the drawing of a robot with its name."""
    x, y = on_paper(facts.field, place.x, place.y)
    yield look.at((x, y), place.angle)
    name = "our robot" if look.name == OURS else look.name
    edge: dict[str, Any] = {"stroke": style.PAPER, "stroke_width": 12, "paint_order": "stroke"}
    yield style.label((x, y + look.radius + WORDS), name, look.colour, WORDS * 0.8, **edge)


def _legend(facts: Facts, goto: RecordedGoto) -> Iterator[Explained]:
    """Yield the marks of the picture with their meanings; of barriers only those that this goto has."""
    way = svg.line((-60, 0), (60, 0), stroke=style.GOTO, stroke_width=LINE)
    start = svg.circle((-60, 0), LINE, fill=style.PAPER, stroke=style.GOTO, stroke_width=LINE / 2)
    yield Explained("where it began, and the way", svg.group(way, start))
    yield Explained("place and angle that were asked for", style.target_mark(0))
    for passage in sorted({passage for _, passage in facts.flagged(goto.message.barriers)}):
        yield Explained(style.PASSAGES[passage][0], style.ring_mark(40, passage))
    for words, drawing in things(facts):
        yield Explained(words, svg.group(drawing, transform="scale(1.4)"))
    yield Explained("the rest of the match", svg.line((-60, 0), (60, 0), stroke=svg.PALE, stroke_width=OTHERS))


def _row(explained: Explained) -> str:
    words = style.label((110, 20), explained.words, size=WORDS, anchor="start")
    return svg.group(svg.moved((0, 0), explained.drawing), words)
