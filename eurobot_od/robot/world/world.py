"""The world around the robots: where everybody truly is, what they run into, and the points they get.

Theory of operation. The truth stays in here. Nodes see it through instruments, which have errors and reach their
robot by a `Vehicle`. A robot that is driven by nodes moves when its wheels say so, one control period at a time. The
others, on their rounds, are brought up to the present in steps of PACE whenever anybody asks for anything: the world
needs neither a thread nor a timer, and where nobody looks nothing is computed.

What bodies do to each other, and what a robot has ahead of it, is in `bodies`.

A patrol goes along its way points and back again. It stops for a robot ahead, waits for it to go, and then turns round,
as it does for anything that holds it up. A careless one does not look out, and stops only when it has driven into
somebody.
"""

from __future__ import annotations

import math
import random
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from typing import Any, Protocol

from eurobot_od.errors import look_up
from eurobot_od.robot.model.options import Errors, MatchOptions
from eurobot_od.robot.model.places import Point, Pose, is_near
from eurobot_od.robot.model.robot_file import Facts, Field, RobotShape, Task, Worth
from eurobot_od.robot.model.values import OURS, Caption, Obstacle, Score, Source, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.nodes.node import Actuators, Detection
from eurobot_od.robot.world import bodies


class EventKind(Enum):
    """The kind of an event; the value is the word that heads its line."""

    START = "start"
    CHECK = "check"
    CONFIGURE = "configure"
    POSITION = "position"
    MATCH = "match"
    GOTO = "goto"
    ARRIVED = "arrived"
    GIVEN_UP = "given up"
    TASK = "task"
    SAID = "says"
    TOUCH = "touch"
    STOP = "stop"
    EMERGENCY = "emergency"
    WARNING = "warning"
    FAILED = "failed"
    END = "end"


@dataclass(frozen=True)
class MatchEvent:
    """One line of the timeline: `time` in seconds since power-on, in words (`text`) and as `data`."""

    time: float
    kind: EventKind
    text: str
    data: dict[str, Any] = field(default_factory=dict)

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        return {"time": round(self.time, 6), "kind": self.kind.value, "text": self.text} | self.data

    def __str__(self) -> str:
        return f"{self.time:9.3f} s  {self.kind.value:<10} {self.text}"


@dataclass(frozen=True)
class Timeline:
    """Where events go; `show` is called with each as it comes. `clock` is the match's: seconds since power-on."""

    clock: Callable[[], float]
    show: Callable[[MatchEvent], None]

    def tell(self, kind: EventKind, text: str, **data: Any) -> None:
        """Add an event that happens now."""
        self.show(MatchEvent(self.clock(), kind, text, data))


# The game, as the world referees it


REACH = 40.0
REACH_ANGLE = 8.0
"""How far from its place a robot can still do a task: mm and degrees."""


class Game:
    """What has been done on the field. All chance comes from one seed, with a stream for each task."""

    def __init__(self, seed: int) -> None:
        self.scores: list[Score] = []
        self._seed = seed
        self._done: set[tuple[str, str]] = set()
        self._fruit: dict[str, int] = {}

    def points(self, robot: str) -> int:
        """Return how many points a robot has."""
        return sum(score.points for score in self.scores if score.robot == robot)

    def fall(self, task: str) -> None:
        """Note that something has fallen over, so that it cannot be turned over any more."""
        self._done.add(("", task))

    def finish(self, robot: str, task: Task, pose: Pose, now: float) -> int:
        """Judge what a robot has done at its true pose: points or fruit; 0 if it was done before or is out of reach."""
        # By the true pose, not the believed one: a robot that is wrong about its place misses.
        if not is_near(pose, task.pose, REACH, REACH_ANGLE):
            return 0
        if task.worth is Worth.HARVEST:
            return self._score(now, robot, task, self._fruit.pop(robot, 0))
        # Under "", so that whoever comes second finds it done.
        key = ("" if task.shared else robot, task.name)
        if key in self._done:
            return 0
        self._done.add(key)
        # A random stream for each task: whether the mammoth is hit must not depend on what was done before.
        chance = random.Random(f"{self._seed} {robot} {task.name}")
        came = task.points * sum(chance.random() < task.chance for _ in range(task.tries))
        if task.worth is Worth.FRUIT:
            self._fruit[robot] = self._fruit.get(robot, 0) + came
            return came
        return self._score(now, robot, task, came)

    def _score(self, now: float, robot: str, task: Task, points: int) -> int:
        if points:
            self.scores.append(Score(now, robot, task.name, points))
        return points


# Patrols: the other robots when nobody plays them


STRAY = 60
"""How far a patrol's way points may move with the seed, mm."""

PATROL_SPEEDS = (150.0, 350.0)
"""Speeds of the slowest and the fastest patrol, mm/s."""

CARELESS = 0.25
"""Share of the enemies that do not look out."""

LOOK_OUT, BUMPED = 120.0, 1.0
"""How near a careful robot and a careless one let another robot come that is in their way, mm from edge to edge."""

PATROL_WAIT = 1.5
"""Seconds that a patrol waits for something in its way."""


class Patrol:
    """A robot on its rounds; `pose` is where it wants to be, and where it looks."""

    def __init__(self, points: Sequence[Point], speed: float, careless: bool = False) -> None:
        self._points, self.speed, self.careless = tuple(points), speed, careless
        # How near it lets a robot come that is in its way, mm from edge to edge.
        self.look_out = BUMPED if careless else LOOK_OUT
        self._leg, self._step = 1, 1
        self._waited = 0.0
        self.pose = Pose(*self._points[0], Pose(*self._points[0], 0).bearing(self._points[1]))

    def held_up(self, here: Point, dt: float) -> Pose:
        """Wait `here` for what is in the way, and turn round if that takes too long; return the pose it wants."""
        self._waited += dt
        if self._waited >= PATROL_WAIT:
            # It turns round rather than wait on: two that wait for each other would stand there until the end.
            self._waited, self._step = 0.0, -self._step
            self._aim_at_next()
            self.pose = Pose(*here, Pose(*here, 0).bearing(self._points[self._leg]))
        return self.pose

    def advance(self, here: Point, dt: float) -> Pose:
        """Return where it wants to be `dt` seconds after it was `here`; call `gone_on` if it got there."""
        target, way = self._points[self._leg], self.speed * dt
        if math.dist(here, target) <= way:
            self._aim_at_next()
            target = self._points[self._leg]
        self.pose = Pose(*here, Pose(*here, 0).bearing(target)).moved(way, 0)
        return self.pose

    def gone_on(self) -> None:
        """Note that nothing is in the way any more."""
        self._waited = 0.0

    def _aim_at_next(self) -> None:
        self._leg = (self._leg + self._step) % len(self._points)

    @classmethod
    def of(cls, who: Source, facts: Facts, team: TeamColour, chance: random.Random) -> Patrol:
        """Make the rounds of a robot in our match as `team`; chance moves the way points a little."""
        rounds = facts.others[who].rounds
        points = [Point(x + chance.uniform(-STRAY, STRAY), y + chance.uniform(-STRAY, STRAY)) for x, y in rounds]
        seen = [facts.field.seen_by(team, point) for point in points]
        # Drawn even for the confederate, who is never careless, so that the order of the random numbers stays the same.
        speed, careless = chance.uniform(*PATROL_SPEEDS), chance.random() < CARELESS
        return cls(seen, speed, careless and who is not Source.CONFEDERATE)


# The world


PACE = 0.1
"""Seconds in a step of the robots on their rounds."""

LOOK_OUT_ANGLE = 50.0
"""How far to either side a robot on its rounds looks, degrees."""

PLACEMENT = 3.0
PLACEMENT_ANGLE = 0.5
"""How far from its start place a team puts the robot, standard deviations: mm and degrees."""

NAMES = {Source.ENEMY_1: "enemy 1", Source.ENEMY_2: "enemy 2", Source.CONFEDERATE: "confederate"}
"""The names of a match's robots, by whom our navigation takes them for."""

RIVAL = NAMES[Source.ENEMY_1]
"""The other robot that is driven by nodes, if there are two."""

SEEN_BY = {
    OURS: {Source.INTERNAL: OURS, **NAMES},
    RIVAL: {Source.INTERNAL: RIVAL, Source.ENEMY_1: OURS, Source.ENEMY_2: "confederate", Source.CONFEDERATE: "enemy 2"},
}
"""For each of the two, the robots that it takes for whom."""


class World:
    """The world of a match: the true poses of all `robots` by name, the `touches` between them, and the `game`.

    `facts` are those of our robot and its match, by default what the options say. `clock` gives the time in seconds;
    `watchers` are called with each touch. With a `rival`, enemy 1 is driven by nodes as ours is, and is not on its
    rounds.
    """

    def __init__(
        self, options: MatchOptions, clock: Callable[[], float], *, rival: bool = False, facts: Facts | None = None
    ) -> None:
        self._options, self.clock, self._now = options, clock, 0.0
        self.facts = options.facts() if facts is None else facts
        self.game = Game(options.seed)
        self.touches: list[bodies.Touch] = []
        self.captions: list[Caption] = []
        self.watchers: list[Callable[[bodies.Touch], None]] = []
        self.things = bodies.standing(self.facts.barriers)
        self.robots: dict[str, bodies.RobotBody] = {}
        self._patrols: dict[str, Patrol] = {}
        self._contacts = bodies.Contacts(
            self.facts.field, self.things, self.robots, clock, self._tell, lambda body: self.game.fall(body.name)
        )
        if options.solid:
            self._go = self._contacts.move
        else:  # only the border holds a robot
            self._go = lambda body, wanted: body.go(
                Pose(*bodies.inside(wanted, 0, self.facts.field), wanted.angle), clock()
            )
        self._fallen = bodies.FallenThing(self._contacts)
        self._teams = {OURS: options.team, RIVAL: options.team.other}
        self._start(OURS)
        who = [Source.ENEMY_1, Source.ENEMY_2][: options.enemies] + [Source.CONFEDERATE] * options.confederates
        for source in who:
            if rival and NAMES[source] == RIVAL:
                self._start(RIVAL)
            else:
                self._send(source)

    def _stream(self, name: str) -> random.Random:
        """Return a random stream of its own: with one for all, one more question would change all that follows."""
        return random.Random(f"{self._options.seed} {name}")

    def _start(self, name: str) -> None:
        """Put a robot that is driven by nodes where its team starts."""
        start = self.facts.start(self._teams[name])
        # Our stream has no robot's name in it, and must stay so: with another name, every seed would be another match.
        chance = self._stream(f"placement {name}" if name != OURS else "placement")
        spreads, shape = (PLACEMENT, PLACEMENT, PLACEMENT_ANGLE), self.facts.body
        pose = Pose(*(exact + chance.gauss(0, by) for exact, by in zip(start, spreads)))
        self._put(name, pose, shape.radius, shape if shape.outline else None)

    def _send(self, source: Source) -> None:
        """Send a robot on its rounds."""
        name = NAMES[source]
        patrol = Patrol.of(source, self.facts, self._options.team, self._stream(f"patrol {source.name}"))
        self._put(name, patrol.pose, self.facts.others[source].radius)
        self._patrols[name] = patrol

    def _put(self, name: str, pose: Pose, radius: float, shape: RobotShape | None = None) -> None:
        body = bodies.RobotBody(name, pose.point, radius, bodies.Weight.ROBOT, shape, pose.angle)
        body.trace.append((0.0, pose))
        self.robots[name] = body

    @property
    def robot(self) -> Pose:
        """The true pose of our robot."""
        return self.robots[OURS].pose

    @property
    def path(self) -> list[tuple[float, Pose]]:
        """The true poses of our robot, with their times."""
        return self.robots[OURS].trace

    def vehicle(self, name: str = OURS) -> LocalVehicle:
        """Return the vehicle by which a robot's instruments reach the world."""
        return LocalVehicle(self, name)

    # Movements

    def move(self, name: str, wanted: Odometry, dt: float) -> float:
        """Move a robot along an arc as far as nothing is in the way; return the distance, mm."""
        self._catch_up()
        body = self.robots[name]
        # The speed of its wheels, not of its progress: a robot that pushes against another one is at fault although it
        # stands.
        body.speed = wanted.distance / dt if dt else 0.0
        before = body.pose
        there = before.moved(*wanted)
        self._go(body, there)
        if name == OURS and self._options.falling:
            self._fallen.look_at(body, self.clock())
        if body.point == there[:2] or not self._options.solid:
            return wanted.distance
        # Along the chord, with its sign: for a robot that was pushed back, the distance is negative.
        heading = math.radians(before.angle + wanted.turn / 2)
        return (body.point.x - before.x) * math.cos(heading) + (body.point.y - before.y) * math.sin(heading)

    def _tell(self, touch: bodies.Touch) -> None:
        self.touches.append(touch)
        for watcher in self.watchers:
            watcher(touch)

    # The others

    def _catch_up(self) -> None:
        """Bring the robots on their rounds up to the present."""
        # In steps of their own: what they do must not depend on how often anybody asks where they are.
        while self._now + PACE <= self.clock():
            self._now += PACE
            for name, patrol in self._patrols.items():
                body = self.robots[name]
                if bodies.nearest_ahead(body, self.robots.values(), patrol.look_out, LOOK_OUT_ANGLE):
                    body.speed, body.angle = 0.0, patrol.held_up(body.point, PACE).angle
                    continue
                before, body.speed = body.point, patrol.speed
                self._go(body, patrol.advance(before, PACE))
                # Sliding along something does not count as progress: the robot would rub there until the end of the
                # match.
                if math.dist(before, body.point) < 0.2 * patrol.speed * PACE:
                    body.angle = patrol.held_up(body.point, PACE).angle
                else:
                    patrol.gone_on()

    # What can be seen

    def pose(self, name: str, age: float) -> Pose | None:
        """Return where a robot was `age` seconds ago, None for one that is not there."""
        self._catch_up()
        body = self.robots.get(name)
        if body is None:
            return None
        if not age:
            return body.pose
        # The trace is ordered by time and has thousands of steps, so it is bisected.
        after = bisect_right(body.trace, self.clock() - age, key=lambda moment: moment[0])
        return body.trace[max(after - 1, 0)][1]

    def ahead(self, name: str, distance: float, angle: float) -> Detection | None:
        """Return the nearest robot or fallen thing ahead of a robot; everything else is too low for a sensor."""
        self._catch_up()
        fallen = [] if self._fallen.body is None else [self._fallen.body]
        return bodies.nearest_ahead(self.robots[name], [*self.robots.values(), *fallen], distance, angle)

    # Tasks

    def begin(self, name: str, task: str) -> float:
        """Begin a task; return how many seconds it takes. Raises UnknownName."""
        return self._task(name, task).seconds

    def finish(self, name: str, task: str) -> int:
        """Finish a task where the robot truly is; return its result. Raises UnknownName."""
        self._catch_up()
        return self.game.finish(name, self._task(name, task), self.robots[name].pose, self.clock())

    def _task(self, name: str, task: str) -> Task:
        return look_up("task", task, self.facts.tasks(self._teams[name]))


class LocalVehicle:
    """One robot of a world in this process (see `Vehicle`)."""

    def __init__(self, world: World, name: str) -> None:
        self._world, self._name, self._seen = world, name, SEEN_BY[name]
        self.move, self.ahead = partial(world.move, name), partial(world.ahead, name)
        self.begin, self.finish = partial(world.begin, name), partial(world.finish, name)

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` seconds ago, by this robot's name for it."""
        return self._world.pose(self._seen[whom], age)


# The instruments of a simulated robot, which measure the world with their errors: wheels, beacons, distance sensor.
#
# A `Vehicle` tells only the truth. The instruments add the errors themselves, so that these are the same whether the
# world is in this process or in another one.


class Vehicle(Actuators, Protocol):
    """One robot in the world; its actuators are those of the world."""

    def move(self, wanted: Odometry, dt: float) -> float | None:
        """Drive along an arc for `dt` seconds, as far as nothing is in the way; return the distance, mm.

        None if nothing moves, because the world cannot be reached.
        """

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` seconds ago; None for one that is not there. INTERNAL is this robot."""

    def ahead(self, distance: float, angle: float) -> Detection | None:
        """Return the nearest thing or robot ahead, within `distance` mm and `angle` degrees to either side."""


# Wheels


BLOCKED = 0.5
"""Wheels are blocked if they make less than this share of their distance: the encoders then slip on."""


class SimulatedWheels:
    """The chassis of a drive (see `nodes.motion.Chassis`), on a vehicle in the world.

    The wheels roll a little more or less than they count: by a share that stays the same for a match, and at random. If
    something blocks the robot they stall, and count what it still moved, and a share of what it did not.
    """

    def __init__(self, vehicle: Vehicle, errors: Errors, chance: random.Random) -> None:
        self._vehicle, self._errors, self._chance = vehicle, errors, chance
        # Drawn once, as tyres and track do not change in a match; the drive's filter learns the first of the two.
        self._scale, self._bias = chance.gauss(1, errors.wheel_scale), chance.gauss(1, errors.wheel_turn)

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        """Obey `command` for `dt` seconds and report what the wheels counted."""
        told = Odometry(command.speed * dt, command.turn * dt)
        wanted = self._rolled(told)
        moved = self._vehicle.move(wanted, dt)
        # Without a world the wheels do not turn, so that the drive gives up its goto as blocked.
        if moved is None:
            return Odometry(0.0, 0.0)
        if not wanted.distance or abs(moved) >= BLOCKED * abs(wanted.distance):
            return told
        share = moved / wanted.distance
        return Odometry(told.distance * (share + self._errors.wheel_slip * (1 - share)), told.turn)

    def _rolled(self, told: Odometry) -> Odometry:
        """Return how the wheels really roll when they are commanded a step."""
        metres, quarters = abs(told.distance) / 1000, abs(told.turn) / 90
        distance, turn = told.distance * self._scale, told.turn * self._bias
        if metres:
            distance += self._chance.gauss(0, self._errors.wheel_noise * math.sqrt(metres))
        # Random errors grow with the root of the distance: they are the sum of many small ones.
        if metres or quarters:
            turn += self._chance.gauss(0, self._errors.heading_noise * math.sqrt(metres + quarters))
        return Odometry(distance, turn)


# Beacons


class SimulatedBeacons:
    """The beacons of a navigation (see `nodes.navigation.Beacons`), which see the robots of the world.

    They are noisy, late, sometimes blind and sometimes wrong. All chance comes from one seed, with a stream for each
    robot that is asked for: with one stream for all, one more question would change all later answers. `deviations`
    gives their standard deviations, mm and degrees. Only our own heading can be measured.
    """

    def __init__(
        self, vehicle: Vehicle, field: Field, errors: Errors, deviations: Callable[[], tuple[float, float]], seed: str
    ) -> None:
        self._vehicle, self._field, self._errors, self._deviations = vehicle, field, errors, deviations
        self._chance = {source: random.Random(f"{seed} {source.name}") for source in Source}

    def locate(self, whom: Source, _now: float) -> Fix | None:
        """Measure a robot's place; None if it is not seen."""
        errors, chance = self._errors, self._chance[whom]
        seen = whom
        if chance.random() < errors.beacon_swaps:  # another robot is taken for this one
            others = [each for each in Source if each is not whom and self._vehicle.pose(each) is not None]
            seen = chance.choice(others) if others else whom
        pose = self._vehicle.pose(seen, errors.beacon_latency)
        if pose is None or chance.random() < errors.beacon_dropouts:
            return None
        if chance.random() < errors.beacon_outliers:
            field = self._field
            pose = Pose(chance.uniform(0, field.width), chance.uniform(0, field.height), chance.uniform(0, 360))
        place, angle = self._deviations()
        x, y = pose.x + chance.gauss(0, place), pose.y + chance.gauss(0, place)
        return Fix(x, y, pose.angle + chance.gauss(0, angle) if whom is Source.INTERNAL else None)


# Distance sensor


class Sensor:
    """The distance sensor of a core (see `nodes.node.DistanceSensor`), on a vehicle in the world.

    It has a range, is slightly off, misses things, and sees things that are not there. It sees robots and what has
    fallen over; barriers, trees and the border are too low for it.
    """

    def __init__(self, vehicle: Vehicle, errors: Errors, chance: random.Random) -> None:
        self._vehicle, self._errors, self._chance = vehicle, errors, chance

    def look(self, _now: float) -> Detection | None:
        """Measure what is ahead; None if nothing is seen."""
        errors, chance = self._errors, self._chance
        seen = self._vehicle.ahead(errors.sensor_range, errors.sensor_angle)
        # Even if something is there: the false echo hides it.
        if chance.random() < errors.sensor_false:
            return Detection(Obstacle.OBJECT, chance.uniform(0, errors.sensor_range), 0.0)
        if seen is None or chance.random() < errors.sensor_missed:
            return None
        return seen._replace(distance=max(seen.distance + chance.gauss(0, errors.sensor_noise), 0.0))


# All of them


def assemble(nodes: Sequence[Node], options: MatchOptions, clock: Callable[[], float]) -> World:
    """Make the world of a match around some of our robot's nodes, with the facts that they have, and return it."""
    facts = (each.facts for each in nodes if isinstance(each, Core | Drive | Navigation))
    world = World(options, clock, facts=next(facts, None))
    equip(nodes, world.vehicle(), options.errors, str(options.seed))
    return world


def equip(nodes: Iterable[Node], vehicle: Vehicle, errors: Errors, seed: str) -> None:
    """Give some of a robot's nodes their instruments on its vehicle; `seed` is that of the errors."""
    for node in nodes:
        # A random stream for each instrument: one more look by the sensor must not change how the wheels roll.
        if isinstance(node, Drive):
            node.chassis = SimulatedWheels(vehicle, errors, random.Random(f"{seed} wheels"))
        if isinstance(node, Navigation):
            node.beacons = SimulatedBeacons(vehicle, node.facts.field, errors, node.deviations, seed)
        if isinstance(node, Core):
            node.sensor, node.actuators = Sensor(vehicle, errors, random.Random(f"{seed} sensor")), vehicle
