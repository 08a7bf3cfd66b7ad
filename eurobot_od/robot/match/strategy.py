"""The shipped strategy, and the example for teams: copy it, change it, and `eurobot-od match --strategy mine.py`.

A strategy is a coroutine `play(core)`. It is called when the match begins: the nodes are checked, the start is
configured, positions come. It awaits the core's calls, and is cancelled when the match ends. The core stops for an
obstacle; what to do then is up to the strategy. This one does what brings most for its time, and is home before the
end.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterable, Iterator
from itertools import pairwise

from eurobot_od.errors import RemoteError, StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import Facts, Task, Worth
from eurobot_od.robot.model.values import Barriers, Outcome, Passage, Source
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.motion import Clearances, Disc, find_route

SPEED = 80  # percent: at more, the stopping distance is longer than the sensor's
PACE = 400.0  # mm/s on average, including braking and turning
OVERHEAD = 1.5  # s for every goto
MARGIN = 40.0  # mm between us and a barrier
BERTH = 200.0  # mm between us and another robot: from nearer, the sensor would stop us
BEND = 300.0  # mm more where we go round a barrier, as the drive may pass it on the other side
STALE = 2.0  # s after which a position says nothing any more
PUT_OFF = 6.0  # s until a task is tried again
PAUSE = 0.5  # s to come to rest, and to see whether something goes away
CLOSE = 40.0  # mm: a robot this near has driven into us, or is about to
RETREAT = 120.0  # mm straight away from a robot that is close, before anything else
PATIENCE = 6  # pauses in which a robot that is close may go first
SPARE = 8.0  # s in hand at the end

PASSAGES = {True: Passage.NORMAL, False: Passage.FORCED}  # for what can be pushed along, and what cannot


class Strategy:
    """The tasks still to be done, and when each may be tried again."""

    def __init__(self, core: Core) -> None:
        assert core.configuration is not None
        self.core, self.start, self.facts = core, core.configuration, core.facts
        self.todo, self.home = self.facts.tasks(self.start.team_colour), self.facts.start(self.start.team_colour)
        self.clearances = Clearances.of(self.facts, self.facts.body.radius, MARGIN)
        self.flags = flags(self.facts)
        self.put_off: dict[str, float] = {}
        self.fruit = 0

    @property
    def here(self) -> Point:
        """Where we were last."""
        place = self.core.positions[messages.KalmanPositionResponse].position
        return self.home.point if place.x is None or place.y is None else Point(place.x, place.y)

    def others(self, berth: float = BERTH) -> Iterator[Disc]:
        """Yield the places of other robots, as far as they are known, to stay out of."""
        confederate = self.facts.others[Source.CONFEDERATE].radius
        radii = (self.start.enemy_1_diameter * 5.0, self.start.enemy_2_diameter * 5.0, confederate)
        for robot, radius in zip((Source.ENEMY_1, Source.ENEMY_2, Source.CONFEDERATE), radii):
            seen = self.core.last_seen(robot)
            if seen and self.core.now - seen.time < STALE:
                yield Disc(seen.point, self.facts.body.radius + radius + berth, math.inf)

    def next_point(self, there: Point) -> Point | None:
        """Return the farthest point on the route that the drive can be sent to; it knows of barriers, not of robots."""
        # If a robot is already nearer than its berth, it may be left, but not approached.
        here, others = self.here, [disc.left_from(self.here) for disc in self.others()]
        # Backwards from the goal: the drive plans its own route, so the farthest free point costs the fewest stops.
        for point in reversed(self.way(here, there, others)):
            legs = [*pairwise((here, *self.way(here, point)))]
            bend = BEND if len(legs) > 1 else 0.0
            if not any(disc._replace(radius=disc.radius + bend).meets(*leg) for leg in legs for disc in others):
                return point
        return None

    def way(self, here: Point, there: Point, others: Iterable[Disc] = ()) -> tuple[Point, ...]:
        """Return the way points from one place to another; none if there is no route."""
        return find_route(here, there, self.flags, self.clearances, others) or ()

    def value(self, task: Task) -> float:
        """Weigh what a task brings against the time it takes."""
        # The basket is worth only what the robot is carrying now.
        worth = self.fruit if task.worth is Worth.HARVEST else task.expected
        return worth / (seconds(self.here, task.pose.point) + task.seconds)

    def is_possible(self, task: Task) -> bool:
        """Tell whether a task can be tried now: not put off, with time to get home, and nobody there."""
        there = task.pose.point
        takes = seconds(self.here, there) + task.seconds + seconds(there, self.home.point) + SPARE
        is_due = self.put_off.get(task.name, 0.0) <= self.core.now
        return is_due and takes < self.core.time_left and not any(disc.contains(there) for disc in self.others())

    def best(self) -> Task | None:
        """Return the task that brings most for its time; None if none brings anything."""
        best = max(filter(self.is_possible, self.todo.values()), key=self.value, default=None)
        return best if best and self.value(best) else None

    async def give_way(self) -> None:
        """Stand while a robot is close, but not for ever."""
        for _ in range(PATIENCE):
            seen = await self.core.obstacle()
            if (seen and seen.distance < CLOSE) or any(disc.contains(self.here) for disc in self.others(CLOSE)):
                await asyncio.sleep(PAUSE)

    async def retreat(self) -> None:
        """Draw back from a robot that is close: pushed wheels do not know well enough where we are to pass it."""
        for disc in self.others(CLOSE):
            away = Pose(*self.here, Pose(*disc.centre, 0).bearing(self.here)).moved(RETREAT, 0)
            if disc.contains(self.here) and self.way(self.here, away.point) == (away.point,):
                await self.core.goto(round(away.x), round(away.y), round(away.angle) % 360, SPEED, self.flags)

    async def drive(self, there: Pose) -> bool:
        """Drive to a place, round other robots if need be; return whether we arrived."""
        await self.give_way()
        await self.retreat()
        while (point := self.next_point(there.point)) is not None:
            # At each stop the robot already faces its next leg, so the next goto need not turn first.
            angle = there.angle if point == there.point else Pose(*point, 0).bearing(there.point)
            report = await self.core.goto(round(point.x), round(point.y), round(angle) % 360, SPEED, self.flags)
            if point == there.point or report.outcome is not Outcome.ARRIVED:
                return report.outcome is Outcome.ARRIVED
        return False

    async def attempt(self, task: Task) -> None:
        """Drive to a task and do it; put it off if that fails."""
        if not await self.drive(task.pose):
            # If it were tried again at once, it would meet the same robot at the same place: do another task first.
            self.put_off[task.name] = self.core.now + PUT_OFF
            await asyncio.sleep(PAUSE)
            return
        gain = await self.core.act(task.name)
        if task.worth is Worth.HARVEST:
            self.fruit = 0
            return
        self.fruit += gain * (task.worth is Worth.FRUIT)
        del self.todo[task.name]

    async def step(self) -> None:
        """Do the next thing; do nothing for a moment if there is none."""
        if self.core.shut_down:  # a node was lost, and the core has stopped everything
            await self.core.recover()
        elif (task := self.best()) is not None:
            await self.attempt(task)
        elif math.dist(self.here, self.home.point) <= MARGIN or not await self.drive(self.home):
            await asyncio.sleep(PAUSE)


def flags(facts: Facts) -> Barriers:
    """Keep off what cannot be pushed, and go round the rest if there is a way."""
    return Barriers.of({each.number: PASSAGES[each.kind.pushed] for each in facts.barriers})


def seconds(start: Point, end: Point) -> float:
    """Estimate how long it takes to drive from one place to another."""
    return OVERHEAD + math.dist(start, end) / PACE


async def play(core: Core) -> None:
    """Play until the match is over; what goes wrong is tried again."""
    strategy = Strategy(core)
    # A lost node, or a stop that was not confirmed, is not a reason to give up the rest of the match.
    while core.time_left > 0:
        try:
            await strategy.step()
        except (RemoteError, StateError):
            await asyncio.sleep(PAUSE)
        # A step may do nothing at all; without a pause no time would pass, and the match would hang.
        await asyncio.sleep(0.05)
