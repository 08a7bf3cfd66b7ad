"""How the robot plays: start up the nodes, drive from place to place, stop for whatever is in the way.

Rule of this file: a team's program and nothing else. It awaits the core's calls, looks at the distance sensor, and
knows neither bus nor clock, so that the same coroutine runs in simulated and in real time.
"""

from __future__ import annotations

import asyncio
from itertools import cycle
from math import inf

from eurobot_od.errors import LocalError, NoAnswer, RemoteError, StateError
from eurobot_od.robot.field import Point
from eurobot_od.robot.match.tasks import TASKS, Task
from eurobot_od.robot.match.timeline import EventKind, Timeline
from eurobot_od.robot.messages import KalmanPositionResponse
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.goto import GotoReport
from eurobot_od.robot.options import ENEMY_DIAMETER, MatchOptions
from eurobot_od.robot.values import Outcome
from eurobot_od.robot.world import World

SENSE_PERIOD = 0.05
"""How often the distance sensor is read, s."""

WAIT = 1.2
"""How long the robot waits for something in its way to go, s."""

KNOWN_WHY = (Outcome.STOPPED.value, Outcome.REPLACED.value)
"""Ways for a goto to end of which the timeline has told the reason already."""

FIRST_POSITION = 5.0
"""Seconds until the first position should have come: the polling's start delay, and several periods."""

SETTLED = 1.0
"""After a stop the robot stands still within this time, s."""


def _count(number: int, one: str, several: str = "") -> str:
    """Write a number with its noun: `no enemies`, `1 enemy`, `2 enemies`."""
    return f"{number or 'no'} {one if number == 1 else several or one + 's'}"


class Player:
    """A match being played by `core` in `world`; what happens goes into `timeline`.

    Raises LocalError for an emergency that is not within the match.
    """

    def __init__(self, core: Core, world: World, options: MatchOptions, timeline: Timeline) -> None:
        self.core, self.world, self.options, self.timeline, self.clock = core, world, options, timeline, timeline.clock
        self.errors: list[float] = []
        """Distance between estimated and true place at each arrival, mm."""
        self._duration = options.duration or float(core.setting("Match.Match duration"))
        if options.emergency_at is not None and options.emergency_at >= self._duration:
            text = f"an emergency at {options.emergency_at:g} s is not within the match of {self._duration:g} s"
            raise LocalError(text)
        self._end = 0.0
        self._mushroom: float | None = None
        self._stopped = False
        self._why: str | None = None

    async def play(self) -> None:
        """Play the match from the node checks to its end; raises NoAnswer if a node does not answer."""
        await self._check()
        await self._configure()
        await self._first_position()
        await self._drive_until_end()

    # Startup (document 5.1)

    async def _check(self) -> None:
        took = await self.core.check_nodes()
        answers = ", ".join(f"{node} answered after {seconds * 1000:.1f} ms" for node, seconds in took.items())
        self.timeline.tell(EventKind.CHECK, answers, seconds=took)

    async def _configure(self) -> None:
        options = self.options
        diameters = [ENEMY_DIAMETER if number < options.enemies else 0 for number in range(2)]
        took = await self.core.configure_start(options.team, options.enemies, options.confederates, *diameters)
        others = f"{_count(options.enemies, 'enemy', 'enemies')}, {_count(options.confederates, 'confederate')}"
        what = f"{options.team.name.lower()}, {others}"
        self.timeline.tell(EventKind.CONFIGURE, f"{what}: confirmed after {took * 1000:.1f} ms", seconds=took)

    async def _first_position(self) -> None:
        """Wait until position polling has brought the robot's place, or else ask for it; raises NoAnswer."""
        patience = self.clock() + FIRST_POSITION
        while KalmanPositionResponse not in self.core.positions:
            await asyncio.sleep(SENSE_PERIOD)
            if self.clock() > patience:
                await self.core.position()
        seen = self.core.positions[KalmanPositionResponse].position
        self.timeline.tell(EventKind.POSITION, f"({seen.x}, {seen.y}) {seen.angle} deg", position=seen[:3])

    # Match (document 5.2)

    async def _drive_until_end(self) -> None:
        start = self.clock()
        self._end = start + self._duration
        if self.options.emergency_at is not None:
            self._mushroom = start + self.options.emergency_at
        self.timeline.tell(EventKind.MATCH, f"{self._duration:g} s begin", duration=self._duration)
        self.core.start_match(self._duration)
        await self._drive()
        await self._stand_still()

    async def _drive(self) -> None:
        for task in cycle(TASKS):
            await self._attempt(task.seen_by(self.options.team))
            if self._until_mushroom() <= 0:
                self._hit_mushroom()
            if self._stopped or self.core.match_over:
                break

    async def _attempt(self, task: Task) -> None:
        """Drive to a place; if that fails, wait a moment, and get the robot going again if it was shut down."""
        begin = self.clock()
        try:
            report = await self._drive_to(task)
            if report.outcome is Outcome.ARRIVED:
                await self._tell_arrival(report)
                return
            outcome, seconds = report.outcome.value, report.ended
            why = self._why if report.outcome is Outcome.STOPPED and not report.why else report.why
        except (RemoteError, StateError) as error:
            outcome, why, seconds = "failed", str(error), self.clock() - begin
        if self.core.match_over:
            self._tell_match_over()
        told = f"{outcome} after {seconds:.2f} s" + f": {why}" * (outcome not in KNOWN_WHY)
        self.timeline.tell(EventKind.GIVEN_UP, told, outcome=outcome, why=why or None, seconds=seconds)
        await asyncio.sleep(max(min(WAIT, self._end - self.clock(), self._until_mushroom()), 0))
        await self._start_anew()

    async def _start_anew(self) -> None:
        """Go on after a shutdown that nobody but the core has wanted: as soon as the nodes answer, or never."""
        while self.core.shut_down and not self._stopped and not self.core.match_over:
            try:
                await self._check()
                await self._configure()
            except NoAnswer:
                await asyncio.sleep(WAIT)

    async def _drive_to(self, task: Task) -> GotoReport:
        self.timeline.tell(EventKind.GOTO, str(task), goto=task._asdict() | {"barriers": str(task.flags())})
        arriving = asyncio.wrap_future(self.core.goto(task.x, task.y, task.angle, task.speed, task.flags()))
        while not arriving.done():  # nobody tells when something comes into sight: the sensor has to be read
            await asyncio.wait([arriving], timeout=max(min(SENSE_PERIOD, self._until_mushroom()), 0))
            if not arriving.done():
                self._look()
        return arriving.result()

    def _until_mushroom(self) -> float:
        """Tell the seconds until the mushroom is hit, infinite if it will not be."""
        return inf if self._mushroom is None else self._mushroom - self.clock()

    def _look(self) -> None:
        """Stop if the mushroom is hit or if something is in the way."""
        now = self.clock()
        if self._until_mushroom() <= 0:
            self._hit_mushroom()
            return
        self.world.drop_thing(now)
        if (obstacle := self.world.obstacle(now)) is not None:
            self._why = f"{obstacle.name.lower()} ahead"
            self.core.emergency_stop(obstacle)
            self.timeline.tell(EventKind.STOP, f"emergency stop: {self._why}", obstacle=obstacle.name)

    def _hit_mushroom(self) -> None:
        self._mushroom, self._stopped, self._why = None, True, "the mushroom was hit"
        self.core.emergency_shutdown()
        self.timeline.tell(EventKind.EMERGENCY, f"emergency shutdown: {self._why}")

    def _tell_match_over(self) -> None:
        self._stopped = True
        self.timeline.tell(EventKind.STOP, "stop drive: the match is over")

    async def _tell_arrival(self, report: GotoReport) -> None:
        error = await self._position_error()
        self.errors.append(error)
        goto, confirmed, seconds = report.goto, report.confirmed, report.ended
        details = f"confirmed after {(confirmed or 0) * 1000:.1f} ms, position error {error:.0f} mm"
        off = {"error": round(error, 1), "distance": round(self.world.robot.distance(Point(goto.x, goto.y)), 1)}
        text = f"after {seconds:.2f} s ({details})"
        self.timeline.tell(EventKind.ARRIVED, text, seconds=seconds, confirmed=confirmed, **off)

    async def _position_error(self) -> float:
        position = await self.core.position()
        if position.x is None or position.y is None:
            return float("nan")
        return self.world.robot.distance(Point(position.x, position.y))

    async def _stand_still(self) -> None:
        """Let the robot come to rest, wait for the end of the match, and tell whether anything moved meanwhile."""
        told = self.core.match_over and self._stopped
        await asyncio.sleep(SETTLED)
        rest = self.world.robot
        await asyncio.sleep(max(self._end + SENSE_PERIOD - self.clock(), 0))
        if not told:
            self._tell_match_over()
        moved = self.world.robot.distance(rest.point)
        text = f"the robot stands at ({rest.x:.0f}, {rest.y:.0f}); since it stopped it moved {moved:.0f} mm"
        self.timeline.tell(EventKind.END, text, x=round(rest.x, 1), y=round(rest.y, 1), moved=round(moved, 3))
