"""The shipped strategy, and the example for teams: copy it, change it, and `eurobot-od match --strategy mine.py`.

A strategy is a coroutine `play(core)`. It is called when the match begins: the nodes are checked, the start is
configured, positions come. It awaits the core's calls, and ends with the match. What stops for an obstacle is the core;
what to do then is up to the strategy. This one does what brings most for its time, drives round the other robots, puts
off what it was stopped at, and is home before the end.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterator

from eurobot_od.errors import RemoteError, StateError
from eurobot_od.robot.field import HEIGHT, START_POSES, WIDTH, Point
from eurobot_od.robot.messages import (
    ConfederatePositionResponse,
    Enemy1PositionResponse,
    Enemy2PositionResponse,
    KalmanPositionResponse,
    PositionResponse,
)
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.tasks import Task, Worth, tasks
from eurobot_od.robot.values import BARRIER_NAMES, Barriers, Outcome, Passage, barrier_number

SPEED = 80  # percent: at more, the way to a standstill is longer than the sensor's stop distance
PACE = 450.0  # mm/s on average, braking and turning included
OVERHEAD = 1.5  # s for every goto
RADIUS = 140.0  # of our own robot and, as nobody says it, of the confederate, mm
BERTH = 120.0  # mm that we keep off other robots
STALE = 2.0  # s after which a position says nothing any more
PUT_OFF = 8.0  # s until a task is tried again
PAUSE = 0.4  # s to see whether something goes away
SPARE = 3.0  # s in hand at the end
POOLS = {"pool 1": Passage.FORCED, "pool 2": Passage.FORCED}
WAYS_AROUND = 300.0  # mm from the centre of another robot


class Strategy:
    """What is still to be done, and when it may be tried again."""

    def __init__(self, core: Core) -> None:
        assert core.configuration is not None
        self.core, self.start = core, core.configuration
        self.todo = tasks(self.start.team_colour)
        self.home = START_POSES[self.start.team_colour]
        self.put_off: dict[str, float] = {}
        self.fruit = 0

    @property
    def here(self) -> Point:
        """Where we were last."""
        place = self.core.positions[KalmanPositionResponse].position
        return self.home.point if place.x is None or place.y is None else Point(place.x, place.y)

    def others(self) -> Iterator[tuple[Point, float]]:
        """Yield where the other robots are, as far as it is known, and how far our centre has to stay away."""
        radii: dict[type[PositionResponse], float] = {
            Enemy1PositionResponse: self.start.enemy_1_diameter * 5,
            Enemy2PositionResponse: self.start.enemy_2_diameter * 5,
            ConfederatePositionResponse: RADIUS,
        }
        for kind, radius in radii.items():
            seen = self.core.positions.get(kind)
            if seen and self.core.now - seen.time < STALE:
                x, y, *_ = seen.position
                if x is not None and y is not None:
                    yield Point(x, y), RADIUS + radius + BERTH

    def is_free(self, start: Point, end: Point) -> bool:
        """Tell whether no other robot is on a straight way."""
        return all(distance(centre, start, end) > berth for centre, berth in self.others())

    def seconds(self, end: Point) -> float:
        """Estimate how long it takes to drive somewhere."""
        return OVERHEAD + math.dist(self.here, end) / PACE

    def value(self, task: Task) -> float:
        """Weigh what a task brings against the time for it."""
        worth = self.fruit if task.worth is Worth.HARVEST else task.expected
        return worth / (self.seconds(Point(task.x, task.y)) + task.seconds)

    def fits(self, task: Task) -> bool:
        """Tell whether a task can be tried now: not put off, nobody there, and home again in time."""
        there = Point(task.x, task.y)
        back = OVERHEAD + math.dist(there, self.home.point) / PACE
        in_time = self.seconds(there) + task.seconds + back + SPARE < self.core.time_left
        return in_time and self.put_off.get(task.name, 0) <= self.core.now and self.is_free(there, there)

    def best(self) -> Task | None:
        """Choose the task that brings most for its time; None if there is none."""
        return max(filter(self.fits, self.todo.values()), key=self.value, default=None)

    async def drive(self, x: float, y: float, angle: float) -> bool:
        """Drive to a place, round other robots if need be; tell whether we arrived."""
        for point in (*self.way_round(Point(x, y)), Point(x, y)):
            flags = Barriers.of({barrier_number(name): POOLS.get(name, Passage.NORMAL) for name in BARRIER_NAMES})
            report = await self.core.goto(round(point.x), round(point.y), round(angle), SPEED, flags)
            if report.outcome is not Outcome.ARRIVED:
                return False
        return True

    def way_round(self, end: Point) -> Iterator[Point]:
        """Yield a way point beside a robot that is on the straight way, if there is one on the field."""
        here = self.here
        for (x, y), berth in self.others():
            if distance(Point(x, y), here, end) <= berth < math.dist((x, y), end):
                along = math.atan2(end.y - here.y, end.x - here.x)
                aside = (berth + WAYS_AROUND / 2) * math.sin(along), (berth + WAYS_AROUND / 2) * math.cos(along)
                beside = (Point(x + aside[0], y - aside[1]), Point(x - aside[0], y + aside[1]))
                free = [way for way in beside if is_roomy(way) and self.is_free(way, end)]
                yield from sorted(free, key=lambda way: math.dist(here, way) + math.dist(way, end))[:1]
                return

    async def attempt(self, task: Task) -> None:
        """Drive to a task and do it; put it off if that fails."""
        if not await self.drive(task.x, task.y, task.angle):
            self.put_off[task.name] = self.core.now + PUT_OFF
            await asyncio.sleep(PAUSE)
            return
        gain = await self.core.act(task.name)
        if task.worth is Worth.HARVEST:
            self.fruit = 0
        else:
            self.fruit += gain * (task.worth is Worth.FRUIT)
            del self.todo[task.name]


def distance(point: Point, start: Point, end: Point) -> float:
    """Tell how far a point is from a straight way, mm."""
    dx, dy = end.x - start.x, end.y - start.y
    share = ((point.x - start.x) * dx + (point.y - start.y) * dy) / (dx * dx + dy * dy or 1.0)
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, (start.x + share * dx, start.y + share * dy))


def is_roomy(point: Point) -> bool:
    """Tell whether a robot has room at a place."""
    return 200 < point.x < WIDTH - 200 and 200 < point.y < HEIGHT - 200


async def play(core: Core) -> None:
    """Play until nothing is left to do in the time, and go home."""
    strategy = Strategy(core)
    while core.time_left > 0:
        try:
            if core.shut_down:  # a node was lost, and the core has stopped everything
                await core.check_nodes()
                await core.configure_start(*strategy.start)
            elif task := strategy.best():
                await strategy.attempt(task)
            elif math.dist(strategy.here, strategy.home.point) > BERTH:
                await strategy.drive(*strategy.home)
            await asyncio.sleep(0.1)
        except (RemoteError, StateError):
            await asyncio.sleep(PAUSE)
