"""What the other robots will do, and where the fires are that they have pushed, as far as their tracks tell.

A robot that comes again by a place where it was, in the same direction, is expected to go on as it did then; any other
one straight on. Nobody sees the fires, which are too low for the sensor: they are pushed in the guesses as the robots
push them. Where a robot hits a fire head-on, a few millimetres decide to which side it slips. So there are several
guesses, each from sightings that are off by a little, and a strategy keeps off all of them.

All times are in steps of STEP.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from itertools import cycle, islice

from eurobot_od.robot.model.places import Point, Pose, turn
from eurobot_od.robot.model.robot_file import Barrier, Facts
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.estimate import Seen
from eurobot_od.robot.nodes.motion import Disc

STEP = 0.1  # time between two places of a track or a forecast, in s
HORIZON = 90  # number of steps of a forecast
TREND = 6  # number of steps in which a robot shows where it is going
LAP = 30  # minimum number of steps in a lap
SAME = 60.0  # maximum distance of two places that count as the same, mm
BEFORE = 30  # number of steps for which the others may have driven before they were first seen
BLIND = 24.0  # time after which tracks are used although not every robot has driven a lap, in s of the core's time
GUESSES, NOISE = 24, 6.0
"""Number of guesses of where a fire is, and the standard deviation of the sightings that they go by, mm."""

SHALLOW = 10.0  # less than this deep in a fire the robot may only have been seen too near, mm: the fire is not pushed
MOVED = 15.0  # minimum distance that a guess moves before ways are planned anew, mm
GROUP, UNSURE = 90.0, 35.0  # guesses as near as this are one place to keep off, with a margin, mm
AHEAD, BESIDE, CONE = 285.0, 50.0, 42.0
"""Distances to a robot ahead (the sensor would stop us) and to one beside us, mm; half the cone ahead, degrees."""

GROWTH = 1.0  # distance to keep more for each step that a forecast looks ahead, mm
NEAR = 150.0  # a robot that is nearer than this may also stand, because of us, mm
LANE = 200.0  # a place is on a robot's way if the robot has driven by it at less than this distance, mm


class Course:
    """The track of another robot, a place for each step, and its forecast."""

    def __init__(self, radius: float) -> None:
        self.radius = radius
        self.track: list[Point] = []
        self.has_lap = False
        self._time = 0.0
        self._ahead: list[Point] = []

    def saw(self, seen: Seen) -> int:
        """Add where it was seen, and the way to there; return how many steps that took.

        If it cannot have driven there, the place before was a wrong one, and the track begins anew.
        """
        if not self.track or not seen.agrees(Seen(self.track[-1], self._time)):
            self.track = [seen.point]
            self._time = seen.time
        (x, y) = self.track[-1]
        steps = round((seen.time - self._time) / STEP)
        if steps > 0:
            dx, dy = (seen.point.x - x) / steps, (seen.point.y - y) / steps
            self.track += [Point(x + dx * step, y + dy * step) for step in range(1, steps + 1)]
            self._time += steps * STEP
            self._ahead = [*islice(self._forecast(), HORIZON)]
        return steps

    def ahead(self, now: float, wait: int) -> list[Point]:
        """Return where it will be, step by step, beginning `wait` steps from now."""
        return self._ahead[max(round((now - self._time) / STEP), 0) + wait :]

    def _forecast(self) -> Iterator[Point]:
        for place in range(len(self.track) - LAP, TREND, -1):
            if math.dist(self.track[place], self.track[-1]) < SAME and self._is_same_way(place):
                self.has_lap = True
                return cycle(self.track[place + 1 :])
        (x, y), (dx, dy) = self.track[-1], self._trend(-1)
        return (Point(x + dx * step, y + dy * step) for step in range(1, HORIZON + 1))

    def _trend(self, place: int) -> Point:
        (x, y) = self.track[place]
        before = self.track[max(place - TREND, -len(self.track))]
        return Point((x - before.x) / TREND, (y - before.y) / TREND)

    def _is_same_way(self, place: int) -> bool:
        (a, b), (c, d) = self._trend(place), self._trend(-1)
        return a * c + b * d > 0.8 * math.hypot(a, b) * math.hypot(c, d) > 0

    def at(self, step: int) -> Point:
        """Return where it was at a step; before it was first seen it was where it was a lap later, or straight back."""
        if step >= 0 or len(self.track) <= LAP + TREND:
            return self.track[min(max(step, 0), len(self.track) - 1)]
        (x, y), then = self.track[0], self.track[TREND]

        def off(lap: int) -> float:
            return math.dist(self.track[lap], (x, y)) + math.dist(self.track[lap + TREND], then)

        lap = min(range(LAP, len(self.track) - TREND), key=off)
        if off(lap) < SAME:
            return self.track[max(lap + step, 0)]
        return Point(x + (then.x - x) / TREND * step, y + (then.y - y) / TREND * step)

    def passes(self, place: Point) -> bool:
        """Return whether it has lately driven by a place."""
        return any(math.dist(point, place) < LANE for point in self.track[-200::3])


class Fires:
    """Where the fires may be; `pushed` are those that have been pushed, `version` counts up when one has moved."""

    def __init__(self, facts: Facts) -> None:
        self._field = facts.field
        self._chance = random.Random(1)
        self._guesses = {each: [each.point] * GUESSES for each in facts.barriers if each.kind.pushed}
        self._planned = dict(self._guesses)
        self._robots: dict[Source, list[Point]] = {}
        self.pushed: set[Barrier] = set()
        self.version = 0

    def meet(self, who: Source, place: Point, steps: int, radius: float) -> None:
        """Push the fires in the way of a robot that drives to a place in some steps."""
        noise = self._chance.gauss
        now = [Point(place.x + noise(0, NOISE), place.y + noise(0, NOISE)) for _ in range(GUESSES)]
        before = self._robots.get(who, now)
        self._robots[who] = now
        for fire, guesses in self._guesses.items():
            reach = radius + fire.kind.radius
            if all(math.dist(guess, place) > 2 * reach for guess in guesses):
                continue
            moved = [self._pushed(*each, steps, reach) for each in zip(guesses, before, now)]
            if moved != guesses:
                self._move(fire, moved)

    def _move(self, fire: Barrier, guesses: list[Point]) -> None:
        self.pushed.add(fire)
        self._guesses[fire] = guesses
        if max(map(math.dist, guesses, self._planned[fire])) > MOVED:
            self._planned[fire] = guesses
            self.version += 1

    def _pushed(self, fire: Point, start: Point, end: Point, steps: int, reach: float) -> Point:
        """Return where a fire is after a robot has driven from one place to another."""
        for step in range(1, steps + 1):
            x = start.x + (end.x - start.x) * step / steps
            y = start.y + (end.y - start.y) * step / steps
            apart = math.dist(fire, (x, y))
            if apart < reach - SHALLOW:
                share = reach / max(apart, 1.0)
                along, across = x + (fire.x - x) * share, y + (fire.y - y) * share
                fire = Point(min(max(along, 0.0), self._field.width), min(max(across, 0.0), self._field.height))
        return fire

    def discs(self, reach: float, least: int = 1) -> Iterator[Disc]:
        """Yield the places that a robot has to keep off, with `least` guesses or more.

        `reach` is from the robot's centre to the edge of a fire.
        """
        for fire, guesses in self._guesses.items():
            left = guesses
            while left:
                group = [guess for guess in left if math.dist(guess, left[0]) < GROUP]
                left = [guess for guess in left if guess not in group]
                if len(group) < least:
                    continue
                middle = Point(*(sum(each) / len(group) for each in zip(*group)))
                spread = max(math.dist(middle, guess) for guess in group) + UNSURE * (fire in self.pushed)
                yield Disc(middle, reach + fire.kind.radius + spread, math.inf)


class Forecast:
    """The courses of the other robots, by who they are, and the fires that they push; `radii` are theirs.

    It `is_blind`, and takes all fires for untouched, until each robot has driven a lap or BLIND is over.
    """

    def __init__(self, facts: Facts, radii: dict[Source, float]) -> None:
        self.fires = Fires(facts)
        self._radius = facts.body.radius
        self._courses = {who: Course(radius) for who, radius in radii.items()}
        self.is_blind = True

    def saw(self, who: Source, seen: Seen) -> None:
        """Take in where a robot was seen."""
        course = self._courses[who]
        steps = course.saw(seen)
        if not self.is_blind:
            self.fires.meet(who, seen.point, steps, course.radius)
        elif seen.time > BLIND or all(each.has_lap for each in self._courses.values()):
            self.is_blind = False
            self._push_from_the_start()

    def _push_from_the_start(self) -> None:
        """Push the fires as all robots have done since they began, of which nobody saw the first seconds."""
        known = {who: course for who, course in self._courses.items() if course.track}
        for step in range(-BEFORE, max(len(each.track) for each in known.values()), 2):
            for who, course in known.items():
                self.fires.meet(who, course.at(step), 2, course.radius)

    def others(self, margin: float) -> list[Disc]:
        """Return the places where the others are, to keep off by a margin, mm."""
        seen = (each for each in self._courses.values() if each.track)
        return [Disc(each.track[-1], self._radius + each.radius + margin, math.inf) for each in seen]

    def passes(self, place: Point) -> bool:
        """Return whether a robot has lately driven by a place."""
        return any(each.passes(place) for each in self._courses.values())

    def is_free(self, poses: Sequence[Pose], now: float, wait: int = 0, share: float = 1.0) -> bool:
        """Return whether nobody will be in the way of poses, a step apart, `wait` steps from now.

        `share` is how much of the distances has to be kept.
        """
        return not any(
            _meets(poses, future, self._radius + course.radius, share)
            for course in self._courses.values()
            if course.track
            for future in self._futures(course, poses[0], now, wait)
        )

    def _futures(self, course: Course, here: Pose, now: float, wait: int) -> Iterator[Sequence[Point]]:
        yield course.ahead(now, wait)
        if here.distance(course.track[-1]) - self._radius - course.radius < NEAR:
            yield course.track[-1:] * HORIZON


def _meets(poses: Sequence[Pose], others: Sequence[Point], radii: float, share: float) -> bool:
    """Return whether we drive too near to another robot, which is `others` step by step; `radii` are those of both."""
    last = math.inf
    for step, (pose, other) in enumerate(zip(poses, others)):
        apart = pose.distance(other)
        comes_nearer = apart < last - 1.0
        last = apart
        if not step or not comes_nearer or poses[step - 1].distance(pose.point) < 2.0:
            continue  # who goes away, or stands, meets nobody
        half = math.degrees(math.asin(min(radii / 2 / max(apart, 1.0), 1.0)))
        is_ahead = abs(turn(pose.angle, pose.bearing(other))) - half < CONE
        if apart - radii < ((AHEAD if is_ahead else BESIDE) + GROWTH * step) * share:
            return True
    return False
