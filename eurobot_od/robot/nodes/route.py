"""The drive's route round barriers: from a start and a goal to the way points of a shortest route.

A barrier is a disc that a straight leg either misses or pays a toll for, so that one search for the cheapest route
serves free, normal and forced barriers alike. The shortest route round discs touches them along arcs. The robot drives
straight legs, so each disc becomes a polygon around it whose corners are the candidates for way points; with eight
discs of eight corners the graph of all legs is small enough to be searched for every goto.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from heapq import heappop, heappush
from typing import NamedTuple

from eurobot_od.robot.model.facts import Barrier, Facts
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import Barriers, Passage

TOLLS = {
    Passage.NORMAL: 100_000.0,
    Passage.FORCED: math.inf,
}
"""The toll of crossing a barrier, mm: more than the longest detour for a normal one, infinite for a forced one."""

CORNERS = 8
"""Corners of the polygon around a disc; with 8 its flat sides face its neighbours, so that narrow gaps stay open."""

SLACK = 1.0
"""Distance of the polygon from its disc, mm, so that a leg along its side misses the disc."""

ROUNDING = 1e-6
"""Depth in mm from which a point in a disc counts as inside."""


class Clearances(NamedTuple):
    """How far the robot's centre stays away, mm: from barriers' centres, by kind, and from the field's edge.

    `facts` are those of the field. `edge` is for way points; a goal may be as near as `border`, where the robot just
    fits.
    """

    facts: Facts
    kinds: Mapping[str, float]
    edge: float
    border: float = 0.0

    @classmethod
    def of(cls, facts: Facts, radius: float, margin: float) -> Clearances:
        """Compute them from the robot's radius and a margin for its errors, mm."""
        reach = radius + margin
        return cls(facts, {each.kind.name: reach + each.kind.radius for each in facts.barriers}, reach, radius)

    def around(self, barrier: Barrier) -> float:
        """Tell the radius of the disc to avoid around a barrier, mm."""
        return self.kinds[barrier.kind.name]


class Disc(NamedTuple):
    """A place to stay out of, mm, and the toll of a leg through it, mm."""

    centre: Point
    radius: float
    toll: float

    def contains(self, point: Point) -> bool:
        """Tell whether `point` is inside; on the edge is outside."""
        return math.dist(self.centre, point) < self.radius - ROUNDING

    def meets(self, start: Point, end: Point) -> bool:
        """Tell whether any point of the straight leg from `start` to `end` is inside."""
        (start_x, start_y), (end_x, end_y), (x, y), reach = start, end, self.centre, self.radius
        # Most legs pass far away on one side; a match asks this some hundred thousand times.
        if (start_x < x - reach and end_x < x - reach) or (start_x > x + reach and end_x > x + reach):
            return False
        if (start_y < y - reach and end_y < y - reach) or (start_y > y + reach and end_y > y + reach):
            return False
        dx, dy = end_x - start_x, end_y - start_y
        along = (x - start_x) * dx + (y - start_y) * dy
        share = min(max(along / (dx * dx + dy * dy or 1.0), 0.0), 1.0)
        return math.hypot(start_x + share * dx - x, start_y + share * dy - y) < self.radius - ROUNDING

    def left_from(self, start: Point) -> Disc:
        """Shrink the disc to the distance of a `start` inside it: the robot may leave it, but not get any nearer."""
        return self._replace(radius=min(self.radius, math.dist(self.centre, start)))

    def corners(self) -> Iterator[Point]:
        """Yield the corners of the regular polygon around the disc."""
        half = math.pi / CORNERS
        # The sides, not the corners, touch the disc.
        reach = (self.radius + SLACK) / math.cos(half)
        for number in range(CORNERS):
            angle = (2 * number + 1) * half
            yield Point(self.centre.x + reach * math.cos(angle), self.centre.y + reach * math.sin(angle))


def find_route(
    start: Point, goal: Point, barriers: Barriers, clearances: Clearances, others: Iterable[Disc] = ()
) -> tuple[Point, ...] | None:
    """Find the way points of a shortest route: without `start`, ending with `goal`; None if there is no route.

    Normal barriers are avoided if there is a way round, otherwise as few as possible are crossed; forced ones are never
    crossed (document 2.1, footnote 2). A goal inside a normal disc makes that disc free, one inside a forced disc is
    out of reach. A start inside a disc may leave it. Way points keep clear of the field's edge. The goal may be nearer
    to it, but one where the robot does not fit is out of reach; the start may be anywhere. `others` are more places to
    stay out of, such as those of other robots.
    """
    field = clearances.facts.field
    discs = [
        Disc(barrier.point, clearances.around(barrier), TOLLS[passage])
        for barrier, passage in clearances.facts.flagged(barriers)
    ]
    discs += others
    forced = any(disc.toll == math.inf for disc in discs if disc.contains(goal))
    if forced or not field.contains(goal, clearances.border):
        return None
    # A normal disc that contains the goal has to be entered in any case, so it does not count.
    avoided = [disc.left_from(start) for disc in discs if not disc.contains(goal)]
    if not any(disc.meets(start, goal) for disc in avoided):
        return (goal,)
    closed = [disc for disc in avoided if disc.toll == math.inf]
    corners = [
        corner
        for disc in avoided
        for corner in disc.corners()
        if field.contains(corner, clearances.edge) and not any(each.contains(corner) for each in closed)
    ]
    return _cheapest(start, goal, corners, avoided)


def _cheapest(start: Point, goal: Point, corners: list[Point], discs: list[Disc]) -> tuple[Point, ...] | None:
    """Search the visibility graph: Dijkstra, with the straight distance to the goal as the part still to come."""
    # Most legs are never looked at again: a leg's tolls are computed when it is the next one on a cheapest route.
    frontier: list[tuple[float, float, tuple[Point, ...], bool]] = [(0.0, 0.0, (start,), True)]
    settled: set[Point] = set()
    while frontier:
        estimate, cost, way, has_paid = heappop(frontier)
        here = way[-1]
        if here in settled:
            continue
        if not has_paid and (toll := sum(disc.toll for disc in discs if disc.meets(way[-2], here))):
            # Back into the queue with its toll: a detour may be cheaper now.
            if toll < math.inf:
                heappush(frontier, (estimate + toll, cost + toll, way, True))
            continue
        if here == goal:
            # A robot that stands at its goal has no leg to drive, but still needs a place to turn at.
            return way[1:] or (goal,)
        settled.add(here)
        for point in {goal, *corners} - settled:
            further = cost + math.dist(here, point)
            heappush(frontier, (further + math.dist(point, goal), further, (*way, point), False))
    return None
