"""The field to scale with what stands still on it: start places, barriers and the rings to avoid them, trees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from eurobot_od import svg
from eurobot_od.robot.field import BARRIERS, HEIGHT, RADII, START_POSES, WIDTH, Barrier, BarrierKind
from eurobot_od.robot.picture import style
from eurobot_od.robot.tasks import TREE_RADIUS, TREES
from eurobot_od.robot.values import Passage, TeamColour
from eurobot_od.svg import PaperPoint

GRID_STEP = 500
START_SIZE = 400
"""Edge of the square that marks a start place; its middle is where the robot starts."""

RING = 60
"""Distance of the ring around a barrier, mm."""


def place(x: float, y: float) -> PaperPoint:
    """Return where a place of the field is drawn: y grows upwards on the field and downwards on paper."""
    return x, HEIGHT - y


def ground(team: TeamColour | None, passages: Mapping[int, Passage]) -> str:
    """Draw the field; the start place of `team` is the one that is marked, barriers are ringed by their passage."""
    return svg.group(
        svg.rectangle((0, 0), WIDTH, HEIGHT, fill=style.SURFACE),
        *_grid(),
        *(_start(colour, colour is team) for colour in START_POSES),
        *(_barrier(each, passages.get(each.number, Passage.FREE)) for each in BARRIERS),
        svg.rectangle((0, 0), WIDTH, HEIGHT, fill="none", stroke=style.INK, stroke_width=10),
        *(svg.circle(place(*each), TREE_RADIUS, fill=style.TREE) for each in TREES),
    )


def _grid() -> Iterator[str]:
    for x in range(0, int(WIDTH) + 1, GRID_STEP):
        yield svg.line(place(x, 0), place(x, HEIGHT), stroke=style.GRID, stroke_width=3)
        yield style.label((x, HEIGHT + 48), str(x), fill=style.PALE, size=style.SMALL)
    for y in range(0, int(HEIGHT) + 1, GRID_STEP):
        yield svg.line(place(0, y), place(WIDTH, y), stroke=style.GRID, stroke_width=3)
        yield style.label((-24, HEIGHT - y + 11), str(y), fill=style.PALE, size=style.SMALL, anchor="end")


def _start(colour: TeamColour, ours: bool) -> str:
    pose = START_POSES[colour]
    corner = place(pose.x - START_SIZE / 2, pose.y + START_SIZE / 2)
    square = svg.rectangle(
        corner,
        START_SIZE,
        START_SIZE,
        fill=style.TEAM[colour],
        fill_opacity=0.3 if ours else 0.12,
        stroke=style.TEAM[colour],
        stroke_width=10 if ours else 4,
        stroke_dasharray=None if ours else "20 12",
    )
    name = style.label((corner[0] + START_SIZE / 2, corner[1] + 46), f"start {colour.name.lower()}", size=style.SMALL)
    return svg.group(square, name)


def _barrier(barrier: Barrier, passage: Passage) -> str:
    centre, radius = place(barrier.x, barrier.y), RADII[barrier.kind]
    ring = [] if passage is Passage.FREE else [passage_ring(centre, radius + RING, passage)]
    words = barrier.name if barrier.kind is BarrierKind.POOL else barrier.name[-1]
    name = style.label((centre[0], centre[1] + 13), words, fill=style.PAPER, size=36, font_weight="bold")
    return svg.group(*ring, barrier_shape(barrier.kind, centre, radius), name)


def barrier_shape(kind: BarrierKind, centre: PaperPoint, radius: float) -> str:
    """Draw a fire as a triangle, a fire pool as a disc."""
    if kind is BarrierKind.FIRE:
        return svg.polygon(style.around(centre, radius, 3, -90), fill=style.FIRE)
    return svg.circle(centre, radius, fill=style.POOL)


def passage_ring(centre: PaperPoint, radius: float, passage: Passage) -> str:
    """Draw the ring around a barrier that a goto asked to avoid."""
    _, dashes, width = style.PASSAGES[passage]
    return svg.circle(centre, radius, fill="none", stroke=style.STOP, stroke_width=width, stroke_dasharray=dashes)
