"""The world around the robots: where everybody truly is, what they run into, and what they get for what they do.

Theory of operation. The truth stays here; nodes see it through instruments that err (`wheels`, `beacons`, `sensor`),
which reach their robot by a `Vehicle`. A robot that is driven by nodes moves when its wheels say so, a control period
at a time. The others, on their rounds, are brought up to the present in steps of PACE whenever anybody asks for
anything: the world needs neither a thread nor a timer, and where nobody looks nothing is worked out.

What bodies do to each other is in `contact`, what a robot has before it in `sight`, what it gets for what it did in
`game`.
"""

from __future__ import annotations

import math
import random
from bisect import bisect_right
from collections.abc import Callable
from functools import partial

from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import Source, TeamColour
from eurobot_od.robot.nodes.equipment import Detection
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.world.bodies import RobotBody, Weight, inside, nearest_ahead, standing
from eurobot_od.robot.world.contact import Contacts, FallenThing, Touch
from eurobot_od.robot.world.game import Game, find
from eurobot_od.robot.world.patrols import Patrol

PACE = 0.1
"""Seconds of a step of the robots on their rounds."""

LOOK_OUT_ANGLE = 50.0
"""How far to either side a robot on its rounds looks, degrees."""

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


class World:
    """A match's world: the true poses of all `robots` by name, the `touches` between them, and the `game`.

    `facts` are those of our robot and its match: what the options say.

    `clock` gives the time in seconds; `watchers` are called with each touch. With a `rival`, enemy 1 is driven by nodes
    as ours is, and not on its rounds.
    """

    def __init__(self, options: MatchOptions, clock: Callable[[], float], *, rival: bool = False) -> None:
        self._options, self.clock, self._now = options, clock, 0.0
        self.facts = options.facts()
        self.game = Game(options.seed)
        self.touches: list[Touch] = []
        self.watchers: list[Callable[[Touch], None]] = []
        self.things = standing(self.facts.barriers)
        self.robots: dict[str, RobotBody] = {}
        self._patrols: dict[str, Patrol] = {}
        self._contacts = Contacts(
            self.facts.field, self.things, self.robots, clock, self._tell, lambda body: self.game.fall(body.name)
        )
        if options.solid:
            self._go = self._contacts.move
        else:  # only the border holds a robot
            self._go = lambda body, wanted: body.go(inside(wanted.point, 0, self.facts.field), wanted.angle, clock())
        self._fallen = FallenThing(self._contacts)
        self._teams = {OURS: options.team, RIVAL: TeamColour(1 - options.team)}
        self._put(OURS)
        who = [Source.ENEMY_1, Source.ENEMY_2][: options.enemies] + [Source.CONFEDERATE] * options.confederates
        for source in who:
            if rival and NAMES[source] == RIVAL:
                self._put(RIVAL)
            else:
                self._send(source)

    def _stream(self, name: str) -> random.Random:
        """Return a stream of chance of its own: with one for all, one more question would change all that follows."""
        return random.Random(f"{self._options.seed} {name}")

    def _put(self, name: str) -> None:
        """Put a robot that nodes drive where its team starts."""
        start = self.facts.start(self._teams[name])
        # Ours has no robot's name in it, and keeps it so: another name would make another match of every seed.
        chance = self._stream(f"placement {name}" if name != OURS else "placement")
        spreads = (PLACEMENT, PLACEMENT, PLACEMENT_ANGLE)
        shape = self.facts.body
        body = RobotBody(name, Point(0, 0), shape.radius, Weight.ROBOT, shape=shape if shape.outline else None)
        body.place(Pose(*(exact + chance.gauss(0, by) for exact, by in zip(start, spreads))))
        body.trace.append((0.0, body.pose))
        self.robots[name] = body

    def _send(self, source: Source) -> None:
        """Send a robot on its rounds."""
        name = NAMES[source]
        patrol = Patrol.of(source, self.facts, self._options.team, self._stream(f"patrol {source.name}"))
        body = RobotBody(name, Point(0, 0), self.facts.others[source].radius, Weight.ROBOT)
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
        # As it is driven, not as it gets on: a robot that pushes against another one is at fault although it stands.
        body.speed = wanted.distance / dt if dt else 0.0
        before, there = body.pose, body.pose.moved(*wanted)
        self._go(body, there)
        if name == OURS and self._options.falling:
            self._fallen.look_at(body, self.clock())
        if body.point == there.point or not self._options.solid:
            return wanted.distance
        # Along the chord, with its sign: a robot that was pushed back has made a negative way.
        heading = math.radians(before.angle + wanted.turn / 2)
        return (body.point.x - before.x) * math.cos(heading) + (body.point.y - before.y) * math.sin(heading)

    def _tell(self, touch: Touch) -> None:
        self.touches.append(touch)
        for watcher in self.watchers:
            watcher(touch)

    # The others

    def _catch_up(self) -> None:
        """Bring the robots on their rounds up to the present."""
        # In steps of their own: what they do must not depend on how often somebody asks where they are.
        while self._now + PACE <= self.clock():
            self._now += PACE
            for name, patrol in self._patrols.items():
                body = self.robots[name]
                if nearest_ahead(body, self.robots.values(), patrol.look_out, LOOK_OUT_ANGLE):
                    body.speed, body.angle = 0.0, patrol.held_up(body.point, PACE).angle
                    continue
                before, body.speed = body.point, patrol.speed
                self._go(body, patrol.advance(before, PACE))
                # Sliding along something does not count as going on: it would rub there to the end of the match.
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
        """Return the nearest robot or fallen thing ahead of a robot; all else is lower than a sensor looks."""
        self._catch_up()
        fallen = [] if self._fallen.body is None else [self._fallen.body]
        return nearest_ahead(self.robots[name], [*self.robots.values(), *fallen], distance, angle)

    # Tasks

    def begin(self, name: str, task: str) -> float:
        """Begin with a task; return how many seconds it takes. Raises UnknownName."""
        return find(self.facts.tasks(self._teams[name]), task).seconds

    def finish(self, name: str, task: str) -> int:
        """Finish a task where the robot truly is; return what it came to."""
        self._catch_up()
        return self.game.finish(
            name, find(self.facts.tasks(self._teams[name]), task), self.robots[name].pose, self.clock()
        )


class LocalVehicle:
    """One robot of a world in this process (see `vehicle.Vehicle`)."""

    def __init__(self, world: World, name: str) -> None:
        self._world, self._name, self._seen = world, name, SEEN_BY[name]
        self.move, self.ahead = partial(world.move, name), partial(world.ahead, name)
        self.begin, self.finish = partial(world.begin, name), partial(world.finish, name)

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` seconds ago, as this robot names them."""
        return self._world.pose(self._seen[whom], age)
