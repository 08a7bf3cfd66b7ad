"""The world around the robots: where everybody truly is, what they run into, and what they get for what they do.

Theory of operation. The truth stays here; nodes see it through instruments that err (`wheels`, `beacons`, `sensor`),
which reach their robot by a `Vehicle`. A robot that is driven by nodes moves when its wheels say so, a control period
at a time. The others, on their rounds, are brought up to the present in steps of PACE whenever anybody asks for
anything: the world needs neither a thread nor a timer, and where nobody looks nothing is worked out.

Every movement is judged alike. Where it would end inside of something, what is light is pushed along, and the robot is
pushed out of everything else: it slides along what it meets at an angle and stands before what it meets head on. A
robot that is driven into yields a little. The first moment of each contact is a `Touch`, with the speeds of both
towards each other, so that it is known who drove into whom.
"""

from __future__ import annotations

import math
import random
from bisect import bisect_right
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from eurobot_od.robot.field import START_POSES, Point, Pose
from eurobot_od.robot.nodes.equipment import Detection
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.options import ENEMY_DIAMETER, MatchOptions
from eurobot_od.robot.tasks import tasks
from eurobot_od.robot.values import Source, TeamColour
from eurobot_od.robot.world.bodies import BORDER, ROBOT_RADIUS, Body, RobotBody, Weight, gap, inside, pushed_out, things
from eurobot_od.robot.world.fallen import FallenThing
from eurobot_od.robot.world.game import Game, find
from eurobot_od.robot.world.patrols import Patrol
from eurobot_od.robot.world.sight import nearest_ahead

PACE = 0.04
"""Seconds of a step of the robots on their rounds."""

LOOK_OUT = 120.0
"""How near a careful robot on its rounds lets another one come that is in its way, mm from edge to edge."""

LOOK_OUT_ANGLE = 50.0
"""How far to either side it looks, degrees."""

SHOVE = 0.3
"""Share by which a robot yields to one that drives into it."""

WEDGED = 1.0
"""A robot that would still be so deep in something, mm, after it was pushed out of everything else stays put."""

RELEASED = 5.0
"""A contact is over when they are so far apart, mm."""

PLACEMENT = 3.0
PLACEMENT_ANGLE = 0.5
"""How far from its start place a team puts the robot, standard deviations: mm and degrees."""

OURS = "ours"
NAMES = {Source.ENEMY_1: "enemy 1", Source.ENEMY_2: "enemy 2", Source.CONFEDERATE: "confederate"}
"""The robots of a match, by whom our navigation takes them for."""

RIVAL = NAMES[Source.ENEMY_1]
"""The other robot that is driven by nodes, if there are two."""

SEEN_BY = {
    OURS: {Source.INTERNAL: OURS, **NAMES},
    RIVAL: {Source.INTERNAL: RIVAL, Source.ENEMY_1: OURS, Source.ENEMY_2: "confederate", Source.CONFEDERATE: "enemy 2"},
}
"""Which robot each of the two takes for whom."""


class Touch(NamedTuple):
    """Two bodies met: when, in s, which robot moved into what, and how fast either came nearer, mm/s."""

    time: float
    robot: str
    thing: str
    speed: float
    met: float

    def is_fault_of(self, robot: str) -> bool:
        """Tell whether a robot drove into the other body, and was not rather driven into."""
        own, other = (self.speed, self.met) if robot == self.robot else (self.met, self.speed)
        return own >= max(other, AT_FAULT)

    def __str__(self) -> str:
        met = f", which came at {self.met:.0f} mm/s" if self.met >= AT_FAULT else ""
        return f"{self.robot} at {self.speed:.0f} mm/s touched {self.thing}{met}"


AT_FAULT = 20.0
"""Who comes nearer at this speed, mm/s, has not stood."""


class World:
    """A match's world: the true poses of all `robots` by name, the `touches` between them, and the `game`.

    `clock` gives the time in seconds; `watchers` are called with each touch. With a `rival`, enemy 1 is driven by nodes
    as ours is, and not on its rounds.
    """

    def __init__(self, options: MatchOptions, clock: Callable[[], float], *, rival: bool = False) -> None:
        self._options, self.clock, self._now = options, clock, 0.0
        self.game = Game(options.seed)
        self.touches: list[Touch] = []
        self.watchers: list[Callable[[Touch], None]] = []
        self.things = things()
        self.robots: dict[str, RobotBody] = {}
        self._patrols: dict[str, Patrol] = {}
        self._fallen = FallenThing()
        self._teams = {OURS: options.team, RIVAL: TeamColour(1 - options.team)}
        self._put(OURS, START_POSES[options.team], ROBOT_RADIUS)
        who = [Source.ENEMY_1, Source.ENEMY_2][: options.enemies] + [Source.CONFEDERATE] * options.confederates
        for source in who:
            if rival and NAMES[source] == RIVAL:
                self._put(RIVAL, START_POSES[self._teams[RIVAL]], ROBOT_RADIUS)
            else:
                self._send(source)

    def _stream(self, name: str) -> random.Random:
        """Return a stream of chance of its own: with one for all, one more question would change all that follows."""
        return random.Random(f"{self._options.seed} {name}")

    def _put(self, name: str, start: Pose, radius: float) -> None:
        chance = self._stream(f"placement {name}" if name != OURS else "placement")
        spreads = (PLACEMENT, PLACEMENT, PLACEMENT_ANGLE)
        body = RobotBody(name, Point(0, 0), radius, Weight.ROBOT)
        body.place(Pose(*(exact + chance.gauss(0, by) for exact, by in zip(start, spreads))))
        body.trace.append((0.0, body.pose))
        self.robots[name] = body

    def _send(self, source: Source) -> None:
        """Send a robot on its rounds."""
        name = NAMES[source]
        patrol = Patrol.of(source, self._options.team, self._stream(f"patrol {source.name}"))
        radius = ROBOT_RADIUS if source is Source.CONFEDERATE else ENEMY_DIAMETER * 5.0
        body = RobotBody(name, Point(0, 0), radius, Weight.ROBOT)
        body.place(patrol.pose)
        body.trace.append((0.0, body.pose))
        self.robots[name], self._patrols[name] = body, patrol

    @property
    def driven(self) -> list[str]:
        """The names of the robots that nodes drive."""
        return [name for name in self.robots if name not in self._patrols]

    @property
    def robot(self) -> Pose:
        """The true pose of our robot."""
        return self.robots[OURS].pose

    @property
    def path(self) -> list[tuple[float, Pose]]:
        """The true poses of our robot, with their times."""
        return self.robots[OURS].trace

    def vehicle(self, name: str = OURS) -> LocalVehicle:
        """Return what the instruments of a robot reach the world by."""
        return LocalVehicle(self, name)

    # Movements

    def move(self, name: str, wanted: Odometry, dt: float) -> float:
        """Move a robot along an arc as far as nothing is in the way; return how far it came, mm."""
        self._catch_up()
        body = self.robots[name]
        body.speed = wanted.distance / dt if dt else 0.0
        before, there = body.pose, body.pose.moved(*wanted)
        self._go(body, there)
        if name == OURS and self._options.falling:
            self._fallen.look_at(body, self.clock())
        if body.point == there.point:
            return wanted.distance
        heading = math.radians(before.angle + wanted.turn / 2)
        return (body.point.x - before.x) * math.cos(heading) + (body.point.y - before.y) * math.sin(heading)

    def _go(self, body: RobotBody, wanted: Pose) -> None:
        """Move a robot to a pose, or as near as it comes."""
        body.place(Pose(*self._clear(body, wanted.point), wanted.angle))
        body.trace.append((self.clock(), body.pose))
        if body.touching:
            self._release(body)

    def _clear(self, body: RobotBody, wanted: Point) -> Point:
        """Return the nearest place to the wanted one where a robot is in nothing else; push what can be pushed."""
        point = inside(wanted, body.radius)
        if point != wanted:
            self._touch(body, BORDER, 0.0)
        others = self._others(body)
        met = [each for each in others if gap(point, body.radius, each) < 0]
        for each in met:
            point = self._meet(body, point, each)
        heavy = [each for each in others if each.weight is not Weight.LIGHT] if met else []
        if any(gap(point, body.radius, each) < -WEDGED for each in heavy):
            return body.point
        return inside(point, body.radius)

    def _others(self, body: Body) -> list[Body]:
        """Return what a robot can meet: all bodies but itself."""
        everything: list[Body] = [*self.things, *self._lying, *self.robots.values()]
        return [each for each in everything if each is not body]

    def _meet(self, body: RobotBody, point: Point, other: Body) -> Point:
        """Have a robot meet a body at a place; return where the robot is then."""
        met = other.approach(body) if isinstance(other, RobotBody) else 0.0
        self._touch(body, other.name, met)
        if isinstance(other, RobotBody):
            self._shove(other, body, point)
        if other.weight is Weight.LIGHT:
            other.point = inside(pushed_out(other.point, other.radius, Body("", point, body.radius, Weight.ROBOT)), 0)
            self.game.fall(other.name)
            return point
        return pushed_out(point, body.radius, other)

    def _shove(self, other: RobotBody, body: RobotBody, point: Point) -> None:
        """Have a robot yield a little to one that drives into it; its wheels do not notice."""
        free = pushed_out(other.point, other.radius, Body("", point, body.radius, Weight.ROBOT))
        x, y = (old + SHOVE * (new - old) for old, new in zip(other.point, free))
        fixed = [each for each in self.things if each.weight is Weight.FIXED]
        if all(gap(Point(x, y), other.radius, each) >= 0 for each in fixed):
            other.point = inside(Point(x, y), other.radius)
            other.trace.append((self.clock(), other.pose))

    def _touch(self, body: RobotBody, thing: str, met: float) -> None:
        if thing in body.touching:
            return
        body.touching.add(thing)
        other = self.robots.get(thing)
        speed = abs(body.speed) if other is None else body.approach(other)
        self._tell(Touch(self.clock(), body.name, thing, speed, met))
        if other is not None:
            other.touching.add(body.name)

    def _tell(self, touch: Touch) -> None:
        self.touches.append(touch)
        for watcher in self.watchers:
            watcher(touch)

    def _release(self, body: RobotBody) -> None:
        """Forget the contacts that are over."""
        near = {each.name for each in self._others(body) if gap(body.point, body.radius, each) < RELEASED}
        if inside(body.point, body.radius + RELEASED) != body.point:
            near.add(BORDER)
        body.touching &= near

    # The others

    def _catch_up(self) -> None:
        """Bring the robots on their rounds up to the present."""
        while self._now + PACE <= self.clock():
            self._now += PACE
            for name, patrol in self._patrols.items():
                self._step(self.robots[name], patrol)

    def _step(self, body: RobotBody, patrol: Patrol) -> None:
        if not patrol.careless and nearest_ahead(body, self.robots.values(), LOOK_OUT, LOOK_OUT_ANGLE):
            body.speed = 0.0
            patrol.held_up(PACE)
            return
        before, wanted = body.point, patrol.advance(body.point, PACE)
        body.speed = patrol.speed
        self._go(body, wanted)
        if math.dist(before, body.point) < 0.2 * patrol.speed * PACE:
            patrol.held_up(PACE)

    # What can be seen

    def pose(self, name: str, age: float) -> Pose | None:
        """Return where a robot was `age` seconds ago, None for one that is not there."""
        self._catch_up()
        body = self.robots.get(name)
        if body is None:
            return None
        if not age:
            return body.pose
        after = bisect_right(body.trace, self.clock() - age, key=lambda moment: moment[0])
        return body.trace[max(after - 1, 0)][1]

    def ahead(self, name: str, distance: float, angle: float) -> Detection | None:
        """Return the nearest robot or fallen thing ahead of a robot; all else is lower than a sensor looks."""
        self._catch_up()
        return nearest_ahead(self.robots[name], [*self.robots.values(), *self._lying], distance, angle)

    @property
    def _lying(self) -> list[Body]:
        return [] if self._fallen.body is None else [self._fallen.body]

    # Tasks

    def begin(self, name: str, task: str) -> float:
        """Begin with a task; return how many seconds it takes. Raises UnknownName."""
        return find(tasks(self._teams[name]), task).seconds

    def finish(self, name: str, task: str) -> int:
        """Finish a task where the robot truly is; return what it came to."""
        self._catch_up()
        return self.game.finish(name, find(tasks(self._teams[name]), task), self.robots[name].pose, self.clock())


class LocalVehicle:
    """One robot of a world in this process (see `vehicle.Vehicle`)."""

    def __init__(self, world: World, name: str) -> None:
        self._world, self._name, self._seen = world, name, SEEN_BY[name]
        self.move, self.ahead = partial(world.move, name), partial(world.ahead, name)
        self.begin, self.finish = partial(world.begin, name), partial(world.finish, name)

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` seconds ago, as this robot names them."""
        return self._world.pose(self._seen[whom], age)
