"""The world around the robots: true poses, contacts, and points.

Theory of operation. The truth stays in here. Nodes see it through instruments, which have errors and reach their robot
by a `Vehicle`. A robot that nodes drive moves when its wheels are commanded, one control period at a time. The others,
on their rounds, are moved up to the present in steps of PACE at every request. So the world needs neither a thread nor
a timer, and computes nothing without a request.

Contacts, and obstacles ahead of a robot, are in `bodies`.

A patrol goes along its way points and back again. It stops for a robot ahead, waits for it to leave, and then turns
around, as it does for any obstacle. A careless one does not look ahead, and stops only after a collision.
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
    """The kind of an event; the value is the first word of its line."""

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
    """One line of the timeline: `time` in s since power-on, a `text`, and `data`."""

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
    """Passes events to `show`; `clock` returns the match's time in s since power-on."""

    clock: Callable[[], float]
    show: Callable[[MatchEvent], None]

    def tell(self, kind: EventKind, text: str, **data: Any) -> None:
        """Add an event with the current time."""
        self.show(MatchEvent(self.clock(), kind, text, data))


# Rules of the game


REACH = 40.0
REACH_ANGLE = 8.0
"""Maximum distance from a task's pose at which it can be done, in mm and degrees."""


class Game:
    """What has been done on the field. All random numbers come from one seed, with a stream per task."""

    def __init__(self, seed: int) -> None:
        self.scores: list[Score] = []
        self._seed = seed
        self._done: set[tuple[str, str]] = set()
        self._fruit: dict[str, int] = {}

    def points(self, robot: str) -> int:
        """Return a robot's points."""
        return sum(score.points for score in self.scores if score.robot == robot)

    def fall(self, task: str) -> None:
        """Note that something has fallen over, so that its task cannot be done any more."""
        self._done.add(("", task))

    def finish(self, robot: str, task: Task, pose: Pose, now: float) -> int:
        """Return the result of a task at a robot's true pose: points or fruit.

        It is 0 if the task was done before or is out of reach.
        """
        # The true pose counts, not the robot's estimate.
        if not is_near(pose, task.pose, REACH, REACH_ANGLE):
            return 0
        if task.worth is Worth.HARVEST:
            return self._score(now, robot, task, self._fruit.pop(robot, 0))
        # A shared task has the key "", for all robots.
        key = ("" if task.shared else robot, task.name)
        if key in self._done:
            return 0
        self._done.add(key)
        # A random stream per task, so that earlier tasks do not change its result.
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


# Patrols: the other robots without nodes


STRAY = 60
"""Maximum random offset of a patrol's way points, in mm."""

PATROL_SPEEDS = (150.0, 350.0)
"""Minimum and maximum speed of patrols, in mm/s."""

CARELESS = 0.25
"""Share of the enemies that are careless."""

LOOK_OUT, BUMPED = 120.0, 1.0
"""Distance from another robot at which a careful robot stops, and a careless one, in mm from edge to edge."""

PATROL_WAIT = 1.5
"""Time that a patrol waits for an obstacle, in s."""


class Patrol:
    """A robot on its rounds; `pose` is where it wants to be, and its heading."""

    def __init__(self, points: Sequence[Point], speed: float, careless: bool = False) -> None:
        self._points = tuple(points)
        self.speed = speed
        self.careless = careless
        # Distance from another robot at which it stops, in mm from edge to edge.
        self.look_out = BUMPED if careless else LOOK_OUT
        self._leg, self._step = 1, 1
        self._waited = 0.0
        self.pose = Pose(*self._points[0], Pose(*self._points[0], 0).bearing(self._points[1]))

    def held_up(self, here: Point, dt: float) -> Pose:
        """Wait `here` for an obstacle, and turn around if that takes too long; return the wanted pose."""
        self._waited += dt
        if self._waited >= PATROL_WAIT:
            # Turn around, as two patrols could wait for each other until the end.
            self._waited, self._step = 0.0, -self._step
            self._aim_at_next()
            self.pose = Pose(*here, Pose(*here, 0).bearing(self._points[self._leg]))
        return self.pose

    def advance(self, here: Point, dt: float) -> Pose:
        """Return the wanted pose `dt` s after it was `here`; call `gone_on` if it got there."""
        target = self._points[self._leg]
        way = self.speed * dt
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
        """Return the patrol of a robot in a match with us as `team`, with random offsets of its way points."""
        rounds = facts.others[who].rounds
        points = [Point(x + chance.uniform(-STRAY, STRAY), y + chance.uniform(-STRAY, STRAY)) for x, y in rounds]
        seen = [facts.field.seen_by(team, point) for point in points]
        # Drawn even for the confederate, which is never careless, to keep the order of the random numbers.
        speed = chance.uniform(*PATROL_SPEEDS)
        careless = chance.random() < CARELESS
        return cls(seen, speed, careless and who is not Source.CONFEDERATE)


# The world


PACE = 0.1
"""Duration of a step of the patrols, in s."""

LOOK_OUT_ANGLE = 50.0
"""Angle to either side in which a patrol looks for robots, in degrees."""

PLACEMENT = 3.0
PLACEMENT_ANGLE = 0.5
"""Standard deviations of a robot's placement at the start, in mm and degrees."""

NAMES = {Source.ENEMY_1: "enemy 1", Source.ENEMY_2: "enemy 2", Source.CONFEDERATE: "confederate"}
"""Names of the other robots in a match, by our navigation's source."""

RIVAL = NAMES[Source.ENEMY_1]
"""The other robot with nodes, if there are two."""

SEEN_BY = {
    OURS: {Source.INTERNAL: OURS, **NAMES},
    RIVAL: {Source.INTERNAL: RIVAL, Source.ENEMY_1: OURS, Source.ENEMY_2: "confederate", Source.CONFEDERATE: "enemy 2"},
}
"""For each of the two robots with nodes, the robots by its navigation's source."""


class World:
    """The world of a match: the true poses of all `robots` by name, the `touches` between them, and the `game`.

    `facts` are those of our robot and its match, by default those of the options. `clock` returns the time in s;
    `watchers` are called with each touch. With a `rival`, enemy 1 has nodes, too, instead of its rounds.
    """

    def __init__(
        self, options: MatchOptions, clock: Callable[[], float], *, rival: bool = False, facts: Facts | None = None
    ) -> None:
        self._options = options
        self.clock = clock
        self._now = 0.0
        self._moment = 0.0  # of the movement that is being computed: others' may lie before the present
        self.facts = options.facts() if facts is None else facts
        self.game = Game(options.seed)
        self.touches: list[bodies.Touch] = []
        self.captions: list[Caption] = []
        self.watchers: list[Callable[[bodies.Touch], None]] = []
        self.things = bodies.standing(self.facts.barriers)
        self.robots: dict[str, bodies.RobotBody] = {}
        self._patrols: dict[str, Patrol] = {}
        self._contacts = bodies.Contacts(
            self.facts.field,
            self.things,
            self.robots,
            lambda: self._moment,
            self._tell,
            lambda body: self.game.fall(body.name),
        )
        if options.solid:
            self._go = self._contacts.move
        else:  # only the border holds a robot
            self._go = self._move_in_field
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
        """Return a separate random stream, so that additional draws elsewhere do not change it."""
        return random.Random(f"{self._options.seed} {name}")

    def _start(self, name: str) -> None:
        """Put a robot with nodes at its team's start."""
        start = self.facts.start(self._teams[name])
        # The name of our stream must not change, or every seed would be another match.
        chance = self._stream(f"placement {name}" if name != OURS else "placement")
        spreads = (PLACEMENT, PLACEMENT, PLACEMENT_ANGLE)
        shape = self.facts.body
        pose = Pose(*(exact + chance.gauss(0, by) for exact, by in zip(start, spreads)))
        self._put(name, pose, shape.radius, shape if shape.outline else None)

    def _send(self, source: Source) -> None:
        """Put a robot on its rounds."""
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
        """Return the vehicle of a robot for its instruments."""
        return LocalVehicle(self, name)

    # Movements

    def move(self, name: str, wanted: Odometry, dt: float) -> float:
        """Move a robot along an arc until something is in the way; return the distance in mm."""
        self._catch_up()
        body = self.robots[name]
        # The speed of its wheels, as a robot that pushes without moving is at fault, too.
        body.speed = wanted.distance / dt if dt else 0.0
        before = body.pose
        there = before.moved(*wanted)
        self._moment = self.clock()
        self._go(body, there)
        if name == OURS and self._options.falling:
            self._fallen.look_at(body, self.clock())
        if body.point == there[:2] or not self._options.solid:
            return wanted.distance
        # Along the chord; negative for a robot that was pushed back.
        heading = math.radians(before.angle + wanted.turn / 2)
        return (body.point.x - before.x) * math.cos(heading) + (body.point.y - before.y) * math.sin(heading)

    def _move_in_field(self, body: bodies.RobotBody, wanted: Pose) -> None:
        place = bodies.inside(wanted, 0, self.facts.field)
        body.go(Pose(*place, wanted.angle), self._moment)

    def _tell(self, touch: bodies.Touch) -> None:
        self.touches.append(touch)
        for watcher in self.watchers:
            watcher(touch)

    # The others

    def _catch_up(self) -> None:
        """Move the patrols up to the present."""
        # In fixed steps, so that the number of requests does not matter.
        while self._now + PACE <= self.clock():
            self._now += PACE
            self._moment = self._now
            for name, patrol in self._patrols.items():
                body = self.robots[name]
                if bodies.nearest_ahead(body, self.robots.values(), patrol.look_out, LOOK_OUT_ANGLE):
                    body.speed = 0.0
                    body.angle = patrol.held_up(body.point, PACE).angle
                    continue
                before = body.point
                body.speed = patrol.speed
                self._go(body, patrol.advance(before, PACE))
                # Sliding along something is no progress, or the robot would do so until the end of the match.
                if math.dist(before, body.point) < 0.2 * patrol.speed * PACE:
                    body.angle = patrol.held_up(body.point, PACE).angle
                else:
                    patrol.gone_on()

    # Sight

    def pose(self, name: str, age: float) -> Pose | None:
        """Return where a robot was `age` s ago, None if it does not exist."""
        self._catch_up()
        body = self.robots.get(name)
        if body is None:
            return None
        if not age:
            return body.pose
        # The trace has thousands of steps, in the order of time.
        after = bisect_right(body.trace, self.clock() - age, key=lambda moment: moment[0])
        return body.trace[max(after - 1, 0)][1]

    def ahead(self, name: str, distance: float, angle: float) -> Detection | None:
        """Return the nearest robot or fallen thing ahead of a robot; everything else is too low for a sensor."""
        self._catch_up()
        fallen = [] if self._fallen.body is None else [self._fallen.body]
        return bodies.nearest_ahead(self.robots[name], [*self.robots.values(), *fallen], distance, angle)

    # Tasks

    def begin(self, name: str, task: str) -> float:
        """Begin a task; return its duration in s. Raises UnknownName."""
        return self._task(name, task).seconds

    def finish(self, name: str, task: str) -> int:
        """Finish a task at the robot's true pose; return its result. Raises UnknownName."""
        self._catch_up()
        return self.game.finish(name, self._task(name, task), self.robots[name].pose, self.clock())

    def _task(self, name: str, task: str) -> Task:
        return look_up("task", task, self.facts.tasks(self._teams[name]))


class LocalVehicle:
    """One robot of a world in this process (see `Vehicle`)."""

    def __init__(self, world: World, name: str) -> None:
        self._world = world
        self._name = name
        self._seen = SEEN_BY[name]
        self.move, self.ahead = partial(world.move, name), partial(world.ahead, name)
        self.begin, self.finish = partial(world.begin, name), partial(world.finish, name)

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` s ago, by this robot's source for it."""
        return self._world.pose(self._seen[whom], age)


# The instruments of a simulated robot, which measure the world with errors: wheels, beacons, distance sensor.
#
# A `Vehicle` returns the truth. The instruments add the errors, so that these are the same for a world in this process
# and in another one.


class Vehicle(Actuators, Protocol):
    """One robot in the world, with the world's actuators."""

    def move(self, wanted: Odometry, dt: float) -> float | None:
        """Drive along an arc for `dt` s, until something is in the way; return the distance in mm.

        Returns None if the world cannot be reached.
        """

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` s ago; None if it does not exist. INTERNAL is this robot."""

    def ahead(self, distance: float, angle: float) -> Detection | None:
        """Return the nearest obstacle ahead, within `distance` mm and `angle` degrees to either side."""


# Wheels


BLOCKED = 0.5
"""Wheels are blocked if they move less than this share of their distance; the encoders count some slip."""


class SimulatedWheels:
    """The chassis of a drive (see `nodes.motion.Chassis`), on a vehicle in the world.

    The wheels roll a little more or less than they count: by a constant share in a match, and randomly. If the robot is
    blocked they stall, and count the rest of its movement, and a share of what is missing.
    """

    def __init__(self, vehicle: Vehicle, errors: Errors, chance: random.Random) -> None:
        self._vehicle = vehicle
        self._errors = errors
        self._chance = chance
        # Drawn once, as tyres and track do not change in a match; the drive's filter estimates the first one.
        self._scale, self._bias = chance.gauss(1, errors.wheel_scale), chance.gauss(1, errors.wheel_turn)

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        """Execute `command` for `dt` s and return what the wheels counted."""
        told = Odometry(command.speed * dt, command.turn * dt)
        wanted = self._rolled(told)
        moved = self._vehicle.move(wanted, dt)
        # Without a world the wheels do not turn, so the drive ends its goto as blocked.
        if moved is None:
            return Odometry(0.0, 0.0)
        if not wanted.distance or abs(moved) >= BLOCKED * abs(wanted.distance):
            return told
        share = moved / wanted.distance
        return Odometry(told.distance * (share + self._errors.wheel_slip * (1 - share)), told.turn)

    def _rolled(self, told: Odometry) -> Odometry:
        """Return how the wheels really roll in a commanded step."""
        metres, quarters = abs(told.distance) / 1000, abs(told.turn) / 90
        distance, turn = told.distance * self._scale, told.turn * self._bias
        if metres:
            distance += self._chance.gauss(0, self._errors.wheel_noise * math.sqrt(metres))
        # The sum of many small random errors grows with the root of the distance.
        if metres or quarters:
            turn += self._chance.gauss(0, self._errors.heading_noise * math.sqrt(metres + quarters))
        return Odometry(distance, turn)


# Beacons


class SimulatedBeacons:
    """The beacons of a navigation (see `nodes.navigation.Beacons`), which see the robots of the world.

    They are noisy, late, sometimes blind and sometimes wrong. All random numbers come from one seed, with a stream per
    robot, so that additional requests for one do not change the others. `deviations` returns their standard deviations,
    in mm and degrees. They measure only our own heading.
    """

    def __init__(
        self, vehicle: Vehicle, field: Field, errors: Errors, deviations: Callable[[], tuple[float, float]], seed: str
    ) -> None:
        self._vehicle = vehicle
        self._field = field
        self._errors = errors
        self._deviations = deviations
        self._chance = {source: random.Random(f"{seed} {source.name}") for source in Source}

    def locate(self, whom: Source, _now: float) -> Fix | None:
        """Return the measured place of a robot; None if it is not seen."""
        errors = self._errors
        chance = self._chance[whom]
        seen = whom
        if chance.random() < errors.beacon_swaps:  # the beacons see another robot instead
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

    It has a range, noise, misses and false echoes. It sees robots and fallen things; barriers, trees and the border are
    too low for it.
    """

    def __init__(self, vehicle: Vehicle, errors: Errors, chance: random.Random) -> None:
        self._vehicle = vehicle
        self._errors = errors
        self._chance = chance

    def look(self, _now: float) -> Detection | None:
        """Return what is ahead; None if nothing is seen."""
        errors = self._errors
        chance = self._chance
        seen = self._vehicle.ahead(errors.sensor_range, errors.sensor_angle)
        # A false echo hides a real obstacle.
        if chance.random() < errors.sensor_false:
            return Detection(Obstacle.OBJECT, chance.uniform(0, errors.sensor_range), 0.0)
        if seen is None or chance.random() < errors.sensor_missed:
            return None
        return seen._replace(distance=max(seen.distance + chance.gauss(0, errors.sensor_noise), 0.0))


# All of them


def assemble(nodes: Sequence[Node], options: MatchOptions, clock: Callable[[], float]) -> World:
    """Make the world of a match around some of our robot's nodes, with their facts, and return it."""
    facts = (each.facts for each in nodes if isinstance(each, Core | Drive | Navigation))
    world = World(options, clock, facts=next(facts, None))
    equip(nodes, world.vehicle(), options.errors, str(options.seed))
    return world


def equip(nodes: Iterable[Node], vehicle: Vehicle, errors: Errors, seed: str) -> None:
    """Connect a robot's nodes to their instruments on its vehicle; `seed` is that of the errors."""
    for node in nodes:
        # A random stream per instrument, so that they do not depend on each other.
        if isinstance(node, Drive):
            node.chassis = SimulatedWheels(vehicle, errors, random.Random(f"{seed} wheels"))
        if isinstance(node, Navigation):
            node.beacons = SimulatedBeacons(vehicle, node.facts.field, errors, node.deviations, seed)
        if isinstance(node, Core):
            node.sensor = Sensor(vehicle, errors, random.Random(f"{seed} sensor"))
            node.actuators = vehicle
