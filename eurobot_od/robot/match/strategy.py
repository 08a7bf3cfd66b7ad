"""The shipped strategy, and the example for teams: copy it, change it, and `eurobot-od match --strategy mine.py`.

A strategy is a coroutine `play(core)`. It is called when the match begins: the nodes are checked, the start is
configured, positions come. It awaits the core's calls, and is cancelled when the match ends.

This one looks ahead. It asks often where the others are, and `Forecast` says where they will be, and where the fires
may lie that they have pushed. Before each goto it rehearses the motion, and drives only where nobody will be in the
way. Of what is free it does what brings most for its time, and brings its fruit home before the end.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from eurobot_od.errors import RemoteError, StateError
from eurobot_od.robot.match.forecast import STEP, Forecast
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import Task, Worth
from eurobot_od.robot.model.values import Barriers, Outcome, Passage, Source
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.motion import Clearances, Disc, Motion, MotionLimits, find_route, with_fewer_stops

SPEED = 100  # percent
LIMITS = MotionLimits(800, 1200, 2400, 240, 720, 5, 1)  # the drive's, to rehearse a goto
PACE, OVERHEAD = 450.0, 1.0  # mm/s and s of a goto, before its way is known
WIDE, NARROW = 40.0, 17.0  # mm between us and what stands
WAITS = (0, 10, 20, 35)  # steps that we may wait for a better task
LOOK = 40  # steps of a way that have to be free
STAYS = 2.0  # s to stay with a plan at a way point where somebody is in the way
STUCK, ROUND = 4.0, 120.0  # s without moving until we look for ways round the others, and how far round, mm
FEW, SOME = 2, 4  # guesses of a fire that we keep off, and those that we keep off then
PATIENCE = 30.0  # s without moving in which distances shrink to nothing: two that give way would stand for ever
NEAR = 1500.0  # mm from the start to tasks that we do before the forecast knows which fires were pushed
SPARE = 12.0  # s in hand when we bring the fruit home
IN_THE_WAY = 0.5  # share that counts of a task where others drive: who stands there gets away late
LOOKS = 0.2  # s between two looks at the others
PAUSE = 0.25  # s until we think again
REMOVED = 0.9  # s until what has fallen over is gone


class Intention(NamedTuple):
    """A task, the way to it, and the steps to wait before that."""

    task: Task
    way: tuple[Point, ...]
    wait: int


class Strategy:
    """The tasks still to be done, the fruit that we carry, and what is expected of the others."""

    def __init__(self, core: Core) -> None:
        start = core.configuration
        assert start is not None
        self.core, self.facts = core, core.facts
        self.todo, self.home = self.facts.tasks(start.team_colour), self.facts.start(start.team_colour)
        enemies = {Source.ENEMY_1: start.enemy_1_diameter * 5.0, Source.ENEMY_2: start.enemy_2_diameter * 5.0}
        radii = {**enemies, Source.CONFEDERATE: self.facts.others[Source.CONFEDERATE].radius}
        self.others = [each for each in messages.POSITIONS if each.source in radii and start.includes(each.source)]
        self.forecast = Forecast(self.facts, {each.source: radii[each.source] for each in self.others})
        self.fruit = 0
        self.moved = core.now
        self.ways: dict[tuple[int, Pose, tuple[Point, ...], str], list[tuple[tuple[Point, ...], list[Pose]]]] = {}
        for each in self.others:
            core.on(each.response, partial(self.look, each.source))

    def look(self, who: Source, _: messages.PositionResponse) -> None:
        """Take in where another robot was seen; a fire that was pushed has fallen, and brings nothing any more."""
        if seen := self.core.last_seen(who):
            self.forecast.saw(who, seen)
        for fire in self.forecast.fires.pushed:
            self.todo.pop(fire.name, None)

    @property
    def here(self) -> Pose:
        """Where we were last."""
        x, y, angle, *_ = self.core.positions[messages.KalmanPositionResponse].position
        return self.home if x is None or y is None or angle is None else Pose(x, y, angle)

    def ways_to(self, task: Task) -> list[tuple[tuple[Point, ...], list[Pose]]]:
        """Return a wide and a narrow way to a task, as far as there are any, and our pose at each step of them.

        If we have not moved for long, something is in all of them. Then there is one round the others as well, past
        places where only few guesses have a fire.
        """
        x, y, angle = self.here
        others = self.forecast.others(ROUND) if self.core.now - self.moved > STUCK else []
        near = tuple(Point(round(each.centre.x / 90), round(each.centre.y / 90)) for each in others)
        key = self.forecast.fires.version, Pose(round(x / 15), round(y / 15), round(angle / 5)), near, task.name
        if key not in self.ways:
            found = [self.way(task.pose.point, margin, FEW) for margin in (WIDE, NARROW)]
            found += [self.way(task.pose.point, NARROW, SOME, others)] * bool(others)
            self.ways[key] = [(way, self.rehearse(way, task.pose.angle)) for way in dict.fromkeys(found) if way]
        return self.ways[key]

    def way(self, there: Point, margin: float, least: int, others: Sequence[Disc] = ()) -> tuple[Point, ...] | None:
        """Return the way points to a place past all that stands; None if there is no way.

        Fires are where `least` guesses or more have them.
        """
        here = self.here.point
        reach = self.facts.body.radius + margin
        fixed = (each for each in self.facts.barriers if not each.kind.pushed)
        pools = (Disc(each.point, reach + each.kind.radius, math.inf) for each in fixed)
        closed = (*pools, *self.forecast.fires.discs(reach, least), *others)
        discs = [each.left_from(here) for each in closed]
        clearances = Clearances.of(self.facts, self.facts.body.radius, margin)
        way = find_route(here, there, Barriers(0), clearances, discs)
        return way and with_fewer_stops((here, *way), discs, clearances)

    def flags(self, end: Point) -> Barriers:
        """Return what the drive keeps off as well: all that stands where it was, and that we do not pass closely."""
        reach = self.facts.body.radius + WIDE
        kept = []
        for each in self.facts.barriers:
            disc = Disc(each.point, reach + each.kind.radius, math.inf)
            if each not in self.forecast.fires.pushed and not disc.meets(self.here.point, end):
                kept.append(each.number)
        return Barriers.of(dict.fromkeys(kept, Passage.FORCED))

    def rehearse(self, way: Sequence[Point], angle: float) -> list[Pose]:
        """Return where we will be on a way, step by step."""
        motion = Motion(LIMITS, way, angle, SPEED)
        poses = [self.here]
        while not motion.arrived and len(poses) < 300:
            command = motion.step(poses[-1], STEP)
            poses.append(poses[-1].moved(command.speed * STEP, command.turn * STEP))
        return poses

    def is_free(self, poses: Sequence[Pose], wait: int = 0) -> bool:
        """Return whether nobody will be in our way, as far as we look ahead."""
        share = max(1.0 - (self.core.now - self.moved) / PATIENCE, 0.0)
        return self.forecast.is_free(poses[:LOOK], self.core.now, wait, share)

    def value(self, task: Task, seconds: float) -> float:
        """Return the points for each second of a task, or of it and the best one after it."""
        if task.worth is Worth.HARVEST:
            return self.fruit / seconds
        if self.forecast.passes(task.pose.point):
            return IN_THE_WAY * task.expected / seconds
        others = (each for each in self.todo.values() if each is not task and each.worth is not Worth.HARVEST)
        both = ((task.expected + e.expected) / (seconds + self.estimate(task.pose, e)) for e in others)
        return max(task.expected / seconds, *both, 0.0)

    def estimate(self, start: Pose, task: Task) -> float:
        """Return how many seconds a task takes, if nothing stands in the way."""
        return start.distance(task.pose.point) / PACE + OVERHEAD + task.seconds

    def time_after(self, task: Task) -> float:
        """Return the seconds that are needed after a task to bring the fruit home."""
        baskets = [each for each in self.todo.values() if each.worth is Worth.HARVEST]
        if task in baskets or not baskets or not (self.fruit or task.worth is Worth.FRUIT):
            return 0.0
        return min(self.estimate(task.pose, basket) for basket in baskets) + SPARE

    def best(self) -> Intention | None:
        """Return what brings most for its time, waits included; None if nothing is free."""
        best, plan = 0.0, None
        reach = NEAR if self.forecast.is_blind else math.inf
        near = (each for each in self.todo.values() if self.home.distance(each.pose.point) < reach)
        promises = {each.name: self.value(each, self.estimate(self.here, each)) for each in near}
        for name in sorted(promises, key=lambda name: promises[name], reverse=True):
            task = self.todo[name]
            if promises[name] * 1.3 <= best:
                break  # no way to the others is short enough to be better
            for way, poses in self.ways_to(task):
                for wait in WAITS:
                    seconds = (len(poses) + wait) * STEP + task.seconds
                    value = self.value(task, seconds)
                    if value <= best or seconds + self.time_after(task) > self.core.time_left:
                        break
                    if self.is_free(poses, wait):
                        best, plan = value, Intention(task, way, wait)
        return plan

    async def drive(self, way: Sequence[Point], angle: float) -> bool:
        """Drive a way, and look ahead at each way point; return whether we arrived."""
        for number, point in enumerate(way):
            rest = way[number + 1 :]
            begun = self.core.now
            while number and not self.is_free(self.rehearse(way[number:], angle)):
                if self.core.now - begun > STAYS:
                    return False
                await asyncio.sleep(PAUSE)
            # At each way point we already face the next leg, so that the next goto need not turn first.
            facing = Pose(*point, 0).bearing(rest[0]) if rest else angle
            report = await self.core.goto(round(point.x), round(point.y), round(facing) % 360, SPEED, self.flags(point))
            self.moved = self.core.now
            if report.outcome is not Outcome.ARRIVED:
                await asyncio.sleep(REMOVED if report.why == "object ahead" else PAUSE)
                return False
        return True

    async def step(self) -> None:
        """Do the next thing; do nothing for a moment if there is none."""
        if self.core.shut_down:  # a node was lost, and the core has stopped everything
            await self.core.recover()
        await self.core.position()  # others may have pushed us
        plan = self.best()
        if plan is None or plan.wait:
            await asyncio.sleep(PAUSE)
        else:
            await self.do(plan.task, plan.way)

    async def do(self, task: Task, way: Sequence[Point]) -> None:
        """Drive to a task and do it; if that fails, it stays to be done."""
        if not await self.drive(way, task.pose.angle):
            return
        gain = await self.core.act(task.name)
        self.moved = self.core.now
        if task.worth is Worth.HARVEST:
            self.fruit = 0
            return
        self.fruit += gain * (task.worth is Worth.FRUIT)
        self.todo.pop(task.name, None)

    async def watch(self) -> None:
        """Ask for the positions of the others more often than the core does by itself."""
        while True:
            for each in self.others:
                self.core.send(each.request)
            await asyncio.sleep(LOOKS)

    async def do_all(self) -> None:
        """Do one thing after the other until the match is over; what goes wrong is tried again."""
        while self.core.time_left > 0:
            try:
                await self.step()
            except (RemoteError, StateError):
                await asyncio.sleep(PAUSE)
            # A step may do nothing at all; without a pause no time would pass, and the match would hang.
            await asyncio.sleep(0.01)


async def play(core: Core) -> None:
    """Play until the match is over."""
    strategy = Strategy(core)
    watching = asyncio.ensure_future(strategy.watch())
    try:
        await strategy.do_all()
    finally:
        watching.cancel()
