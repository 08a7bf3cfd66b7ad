"""The drive's motion: its route round barriers, how it follows way points, brakes, and how long it still takes.

Theory of operation. The drive calls `step` once in each control period, with the pose that it believes in, and gets the
command for the wheels until the next step. There is no clock in here, no true position and no plan: every step decides
from the present pose. So a pose that the navigation has just corrected is not a special case.

Phases. A differential drive is best at turning on the spot and at driving straight; a goto is a chain of both:

    AIM     brake to rest, then turn until the way point is straight ahead
    DRIVE   drive there, steering out small errors on the way; then AIM at the next way point, or FACE
    FACE    at the last way point, turn to the final angle; then ARRIVED

`_BEHAVIOUR` says for each phase which one follows, what the wheels do and how long it will take. DRIVE and FACE can
also go back to AIM. Steering removes only small errors: when the navigation has moved the pose sideways close to a way
point, the angle to it is large: from LOST degrees on, or if the robot has passed the way point too far off, it has
to turn on the spot again. And while it FACEs, a correction can show that it does not stand at the goal after all. Three
things keep this from becoming a dance around the goal: a movement ends well inside its tolerance (EXACTNESS), a very
near point is not steered at (STEERED), and a short distance back is driven tail first instead of turning round
(CORRECTION).

A goto that replaces another one takes over a rolling robot: it brakes first, unless its way point is straight ahead.

Profile. Straight and turning movements have the same shape: the rate rises, stays at its top, falls to rest at the
target. Each step takes the highest rate from which braking still stops in time: covering rate * dt in this step and
rate^2 / (2 * fall) while braking has to fit into what is left. Solved for the rate, that is `_stoppable`; the only
state is the rate of the step before.

Remaining time. The answer to a state request (document 2.1) is computed with the formulas of the same profile: the
present movement from its present rate, then all further turns and legs from rest. Steering and the control steps
between two phases are left out, which makes it too short by some hundredths of a second: it is within 10 % of the
truth, or 100 ms. A correction cannot be foreseen. A large one (PASSED) that comes when the robot is nearly at its goal
makes it drive the last millimetres again, which adds a second or two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum, auto
from heapq import heappop, heappush
from typing import NamedTuple, Protocol

from eurobot_od.robot.model.places import Point, Pose, turn
from eurobot_od.robot.model.robot_file import Barrier, Facts
from eurobot_od.robot.model.values import Barriers, Passage

EXACTNESS = 0.25
"""A movement ends within this share of its tolerance, so that small corrections later need no new movement."""

LOST = 30.0
"""Maximum angle of a way point off the line of travel that steering can reach, in degrees; from then on: stop and aim.
"""

IN_LINE = 4.0
"""A rolling robot need not stop to aim if its way point is within this angle, in degrees: it stays within PASSED."""

PASSED = 10.0
"""A way point that was driven to counts as passed within this distance, in mm, even the last one.

A leg to a nearer point would follow the noise of the beacons for a second or two. With legs from 5 mm on, a quarter of
the reported remaining times were wrong by more than 10 % and 100 ms (beacons off by 5 mm); from 10 mm on, 4 %.
"""

CORRECTION = 50.0
"""A leg shorter than this, in mm, is a correction, driven forward or backward, whichever needs less turning."""

STEERED = 20.0
"""Minimum distance of a way point for steering, in mm; the bearing of a nearer one changes faster than a robot turns.
"""


# Wheels


class WheelCommand(NamedTuple):
    """A command to the wheels until the next step: mm/s, negative backward; deg/s, counter-clockwise positive."""

    speed: float
    turn: float


AT_REST = WheelCommand(0.0, 0.0)

FOLLOWED = 0.1
"""Wheels that move less than this share of their command are blocked."""


SHORT = 0.6
"""Wheels that move less than this share of their command are hindered."""


class Odometry(NamedTuple):
    """What the wheels report of a step: mm driven, negative backward; degrees turned, counter-clockwise positive."""

    distance: float
    turn: float

    def follows(self, command: WheelCommand, dt: float) -> bool:
        """Return whether the wheels moved at least a little as commanded for `dt` s."""
        driven = abs(self.distance) >= FOLLOWED * abs(command.speed) * dt > 0.0
        turned = abs(self.turn) >= FOLLOWED * abs(command.turn) * dt > 0.0
        return driven or turned or command == AT_REST

    def falls_short(self, command: WheelCommand, dt: float) -> bool:
        """Return whether the wheels drove much less than commanded for `dt` s."""
        return abs(self.distance) < SHORT * abs(command.speed) * dt


class Chassis(Protocol):
    """The wheels, real or simulated."""

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        """Execute `command` for `dt` s and return what the wheels measured."""


class IdealChassis:
    """Wheels that do exactly what is commanded; the default without hardware."""

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        """Return the commanded movement as the measured one."""
        return Odometry(command.speed * dt, command.turn * dt)


# Movements, straight or turning


class Profile(NamedTuple):
    """A trapezoidal movement: its `top` rate, the rise and fall of the rate, and the tolerance at its end.

    Units are those of the axis: mm, mm/s and mm/s2, or degrees, deg/s and deg/s2.
    """

    top: float
    rise: float
    fall: float
    tolerance: float

    def next_rate(self, rate: float, left: float, dt: float) -> float:
        """Return the rate for the next `dt` s that covers `left` soonest and without overshoot."""
        wanted = math.copysign(min(self.top, self._stoppable(abs(left), dt)), left)
        speeding_up = rate * wanted >= 0 and abs(wanted) > abs(rate)
        # A rate of the wrong sign falls with the deceleration of braking.
        return _towards(rate, wanted, (self.rise if speeding_up else self.fall) * dt)

    def _stoppable(self, left: float, dt: float) -> float:
        """Return the highest rate for a step of `dt` after which braking still stops within `left`."""
        # The positive root of rate * dt + rate^2 / (2 * fall) = left, see the profile above.
        return self.fall * (math.sqrt(dt * dt + 2 * left / self.fall) - dt)

    def slower(self, rate: float, dt: float) -> float:
        """Return the rate after `dt` s of braking."""
        return _towards(rate, 0.0, self.fall * dt)

    def over(self, rate: float, left: float, dt: float) -> bool:
        """Return whether the movement may end now: near enough, and slow enough to stop within a step."""
        return abs(left) <= self.tolerance * EXACTNESS and abs(rate) <= self.fall * dt

    def seconds(self, left: float, rate: float = 0.0) -> float:
        """Return the time to cover `left` and stop, starting at `rate`; infinite if the top rate is 0."""
        ahead, rate = abs(left), math.copysign(rate, rate * left)
        # v^2 = 2 a s: whether braking from this rate ends in time.
        in_time = rate > 0 and rate * rate <= 2 * self.fall * ahead
        kept = min(rate, self.top) if in_time else 0.0  # too fast, or in the wrong direction: brake first
        slowing = (rate * abs(rate) - kept * kept) / (2 * self.fall)
        return abs(rate - kept) / self.fall + self._seconds_ahead(abs(ahead - slowing), kept)

    def _seconds_ahead(self, left: float, rate: float) -> float:
        """Return the time to cover `left` from a `rate` that is below the top and can stop in time."""
        if not left:
            return 0.0
        if not self.top:
            return math.inf
        # The rate at which rise and fall together cover what is left, at most the top.
        peak = min(math.sqrt(self.fall * (2 * self.rise * left + rate * rate) / (self.rise + self.fall)), self.top)
        ramps = (peak * peak - rate * rate) / (2 * self.rise) + peak * peak / (2 * self.fall)
        return (peak - rate) / self.rise + peak / self.fall + (left - ramps) / peak


def _towards(rate: float, wanted: float, change: float) -> float:
    """Return `rate` moved towards `wanted` by at most `change`."""
    return rate + min(max(wanted - rate, -change), change)


class MotionLimits(NamedTuple):
    """The robot's abilities and required tolerances; all values are positive.

    `maximum_speed` is in mm/s, `acceleration` and `braking` in mm/s2, `turn_rate` in deg/s, `turn_acceleration` in
    deg/s2, `position_tolerance` in mm, `angle_tolerance` in degrees (document Table 1: 5 mm and 1 degree).
    """

    maximum_speed: float
    acceleration: float
    braking: float
    turn_rate: float
    turn_acceleration: float
    position_tolerance: float
    angle_tolerance: float

    def straight(self, share: float = 1.0) -> Profile:
        """Return the profile of driving at a `share` of the maximum speed, 0 to 1."""
        return Profile(self.maximum_speed * share, self.acceleration, self.braking, self.position_tolerance)

    @property
    def deviation(self) -> float:
        """Maximum distance of the robot from its straight legs, in mm, besides errors of its position."""
        return max(self.position_tolerance, PASSED)

    def standing(self, pose: Pose, rolling: WheelCommand) -> Pose:
        """Return where a rolling robot comes to rest if it brakes now."""
        return pose.moved(rolling.speed * abs(rolling.speed) / (2 * self.braking), 0.0)

    def turning(self, share: float = 1.0) -> Profile:
        """Return the profile of turning at a `share` of the turn rate, 0 to 1."""
        return Profile(self.turn_rate * share, self.turn_acceleration, self.turn_acceleration, self.angle_tolerance)


# A goto


class Phase(Enum):
    """The phases of a motion."""

    AIM = auto()
    DRIVE = auto()
    FACE = auto()
    ARRIVED = auto()


class View(NamedTuple):
    """A way point as seen from the robot in its direction of travel.

    `sense` is 1 forward, -1 backward; `distance` is in mm; `error` is the turn in degrees until the way point is
    straight ahead.
    """

    sense: int
    distance: float
    error: float

    @property
    def ahead(self) -> float:
        """Distance of the way point along the line of travel, in mm; negative if it is behind."""
        return self.distance * math.cos(math.radians(self.error))

    @property
    def aside(self) -> float:
        """Distance of the way point from the line of travel, in mm."""
        return self.distance * abs(math.sin(math.radians(self.error)))

    @property
    def steer(self) -> float:
        """The turn that puts the way point on the line of travel, ahead or behind, in degrees in [-90, 90)."""
        return (self.error + 90.0) % 180.0 - 90.0 if self.distance > STEERED else 0.0


class Motion:
    """One goto: aim at a way point, drive there, aim at the next one, and finally turn to the final angle.

    `way_points` are in mm without the start, and the last one is the goal; `final_angle` is in degrees. `speed_percent`
    is 0 to 100 of the limits' speed and turn rate; 0 does not move. `backward` drives backward. `rolling` is the last
    command to the wheels, so that a new goto can take over a moving robot. The pose may be corrected at any time: the
    robot aims and drives again if steering is not enough.
    """

    def __init__(
        self,
        limits: MotionLimits,
        way_points: Sequence[Point],
        final_angle: float,
        speed_percent: float,
        backward: bool = False,
        rolling: WheelCommand = AT_REST,
    ) -> None:
        share = speed_percent / 100.0
        self._straight = limits.straight(share)
        self._turning = limits.turning(share)
        self._deviation = limits.deviation
        self._points = tuple(way_points)
        self._final_angle = final_angle
        self._backward = backward
        self._phase = Phase.AIM
        self.command = rolling

    @property
    def arrived(self) -> bool:
        """Whether the robot is at rest at the goal, within the tolerances."""
        return self._phase is Phase.ARRIVED

    def step(self, pose: Pose, dt: float) -> WheelCommand:
        """Return the command to the wheels for the next `dt` s, by the estimated pose."""
        # First the phase, then the command, or the wheels would follow the old phase for one more control period.
        self._phase = _BEHAVIOUR[self._phase].following(self, pose, dt)
        self.command = _BEHAVIOUR[self._phase].command(self, pose, dt)
        return self.command

    def remaining(self, pose: Pose) -> float:
        """Return the estimated time until arrival without disturbances, in s: 0 if arrived, infinite at speed 0."""
        return _BEHAVIOUR[self._phase].seconds(self, pose)

    # Geometry

    def _look(self, pose: Pose, point: Point) -> View:
        distance = pose.distance(point)
        error = turn(pose.angle, pose.bearing(point))
        # Turning around for a few millimetres would take longer than driving backward.
        tail_first = abs(error) > 90.0 if distance < CORRECTION else self._backward
        return View(-1, distance, turn(180.0, error)) if tail_first else View(1, distance, error)

    def _view(self, pose: Pose) -> View:
        return self._look(pose, self._points[0])

    def _reach(self, point: Point) -> float:
        """Return the minimum distance of a way point for a leg to it, in mm."""
        # The goal has to be reached exactly, other way points only passed.
        return self._straight.tolerance if point == self._points[-1] else self._deviation

    def _in_line(self, view: View) -> bool:
        """Return whether a rolling robot may keep rolling."""
        return self.command.speed != 0.0 and abs(view.error) <= IN_LINE

    def _final_turn(self, pose: Pose) -> float:
        return turn(pose.angle, self._final_angle)

    # Next phase

    def _after_aim(self, pose: Pose, dt: float) -> Phase:
        view = self._view(pose)
        # A rolling robot with the right heading need not stop to aim, or each new goto would cost a stop.
        if self.command.speed:
            return Phase.DRIVE if self._in_line(view) else Phase.AIM
        if view.distance <= self._reach(self._points[0]):
            return self._reached()
        return Phase.DRIVE if self._turning.over(self.command.turn, view.error, dt) else Phase.AIM

    def _after_drive(self, pose: Pose, dt: float) -> Phase:
        view = self._view(pose)
        # Only the deviation to the side, as the rest ahead will be driven.
        missed = view.aside > self._deviation
        if self._straight.over(self.command.speed, view.ahead, dt):
            return Phase.AIM if missed else self._reached()
        return Phase.AIM if missed and abs(view.steer) > LOST else Phase.DRIVE

    def _after_face(self, pose: Pose, dt: float) -> Phase:
        # The pose was corrected during the turn, so the robot has to drive to the goal again.
        if self._view(pose).distance > self._deviation:
            return Phase.AIM
        # The remaining speed of a correction is braked first, as both wheels must stand.
        faced = self._turning.over(self.command.turn, self._final_turn(pose), dt)
        return Phase.ARRIVED if faced and not self.command.speed else Phase.FACE

    def _reached(self) -> Phase:
        """Go on to the next way point; the last one stays, for corrections during the final turn."""
        if len(self._points) == 1:
            return Phase.FACE
        self._points = self._points[1:]
        return Phase.AIM

    # Wheel commands

    def _pivot(self, left: float, dt: float) -> WheelCommand:
        """Stop first, then turn on the spot."""
        # Turning while rolling is an arc, off the leg that avoids the barriers.
        if speed := self._straight.slower(self.command.speed, dt):
            return WheelCommand(speed, self._turning.slower(self.command.turn, dt))
        return WheelCommand(0.0, self._turning.next_rate(self.command.turn, left, dt))

    def _drive(self, pose: Pose, dt: float) -> WheelCommand:
        # Profiles have only one direction, so the sign of the speed is inverted for driving backward.
        view = self._view(pose)
        speed = self._straight.next_rate(view.sense * self.command.speed, view.ahead, dt)
        return WheelCommand(view.sense * speed, self._turning.next_rate(self.command.turn, view.steer, dt))

    # Remaining time

    def _seconds_to_aim(self, pose: Pose) -> float:
        if self._in_line(self._view(pose)):
            return self._seconds_to_drive(pose)
        speed, rate = self.command
        stopping = abs(speed) / self._straight.fall  # s; the distance until then is half of speed * stopping
        return stopping + self._seconds_along(self._points, pose.moved(speed * stopping / 2, 0.0), rate)

    def _seconds_to_drive(self, pose: Pose) -> float:
        view = self._view(pose)
        there = Pose(*self._points[0], pose.angle + view.steer)
        driving = self._straight.seconds(view.ahead, view.sense * self.command.speed)
        return driving + self._seconds_along(self._points[1:], there)

    def _seconds_along(self, points: Sequence[Point], pose: Pose, rate: float = 0.0) -> float:
        """Return the time for legs from a `pose` where the robot stands, turning at `rate`, and for the final turn."""
        total = 0.0
        for point in points:
            view = self._look(pose, point)
            if view.distance > self._reach(point):
                total += self._seconds_to_turn(view.error, rate) + self._straight.seconds(view.distance)
                pose, rate = Pose(*point, pose.angle + view.error), 0.0
        return total + self._seconds_to_turn(self._final_turn(pose), rate)

    def _seconds_to_turn(self, left: float, rate: float) -> float:
        """Return the time of a turn that begins at `rate`.

        A robot that turns away, and cannot stop before it faces the opposite direction, keeps turning, as this is the
        shorter way then.
        """
        # The square of the rate when it faces the opposite direction.
        squared = rate * rate - 2 * self._turning.fall * (180.0 - abs(left))
        if rate * left >= 0.0 or squared <= 0.0:
            return self._turning.seconds(left, rate)
        opposite = math.sqrt(squared)
        return (abs(rate) - opposite) / self._turning.fall + self._turning.seconds(180.0, opposite)


class Behaviour(NamedTuple):
    """A phase: the next phase, the command to the wheels, and the time until arrival in s."""

    following: Callable[[Motion, Pose, float], Phase]
    command: Callable[[Motion, Pose, float], WheelCommand]
    seconds: Callable[[Motion, Pose], float]


_BEHAVIOUR = {
    Phase.AIM: Behaviour(
        Motion._after_aim, lambda motion, pose, dt: motion._pivot(motion._view(pose).error, dt), Motion._seconds_to_aim
    ),
    Phase.DRIVE: Behaviour(Motion._after_drive, Motion._drive, Motion._seconds_to_drive),
    Phase.FACE: Behaviour(
        Motion._after_face,
        lambda motion, pose, dt: motion._pivot(motion._final_turn(pose), dt),
        lambda motion, pose: motion._seconds_along((), pose, motion.command.turn),
    ),
    Phase.ARRIVED: Behaviour(lambda *_: Phase.ARRIVED, lambda *_: AT_REST, lambda *_: 0.0),
}


# A stop


class Braking:
    """The defined braking after a stop (document 2.1): from the last command to rest, straight on."""

    def __init__(self, limits: MotionLimits, rolling: WheelCommand) -> None:
        self._straight = limits.straight()
        self._turning = limits.turning()
        self.command = rolling

    def step(self, _pose: Pose, dt: float) -> WheelCommand:
        """Return the command to the wheels for the next `dt` s; the pose does not matter."""
        speed, rate = self._straight.slower(self.command.speed, dt), self._turning.slower(self.command.turn, dt)
        self.command = WheelCommand(speed, rate)
        return self.command


TOLLS = {Passage.NORMAL: 100_000.0, Passage.FORCED: math.inf}
"""Cost of crossing a barrier, in mm: more than the longest detour for a normal one, infinite for a forced one."""

CORNERS = 8
"""Number of corners of the polygon around a disc; with 8, flat sides face neighbours, so that narrow gaps stay open."""

SLACK = 1.0
"""Distance of the polygon from its disc, in mm, so that a leg along its side misses the disc."""

NEARLY_PARALLEL = 0.2
"""Sine of the angle below which two legs are not continued until they meet: that may be far away."""

ROUNDING = 1e-6
"""Minimum depth of a point inside a disc, in mm."""


class Clearances(NamedTuple):
    """Minimum distances of the robot's centre, in mm: from barriers' centres, by kind, and from the field's edge.

    `facts` are those of the field. `edge` is for way points; a goal may be as near as `border`, where the robot just
    fits.
    """

    facts: Facts
    kinds: Mapping[str, float]
    edge: float
    border: float = 0.0

    @classmethod
    def of(cls, facts: Facts, radius: float, margin: float) -> Clearances:
        """Return the clearances for the robot's radius and a margin for its errors, in mm."""
        reach = radius + margin
        return cls(facts, {each.kind.name: reach + each.kind.radius for each in facts.barriers}, reach, radius)

    def around(self, barrier: Barrier) -> float:
        """Return the radius of the disc to avoid around a barrier, in mm."""
        return self.kinds[barrier.kind.name]


class Disc(NamedTuple):
    """A place to avoid, in mm, and the cost of a leg through it, in mm."""

    centre: Point
    radius: float
    toll: float

    def contains(self, point: Point) -> bool:
        """Return whether a point is inside; on the edge is outside."""
        return math.dist(self.centre, point) < self.radius - ROUNDING

    def meets(self, start: Point, end: Point) -> bool:
        """Return whether any point of the straight leg from `start` to `end` is inside."""
        (start_x, start_y) = start
        (end_x, end_y) = end
        (x, y) = self.centre
        reach = self.radius
        # Most legs pass far away; a match calls this some hundred thousand times.
        if (start_x < x - reach and end_x < x - reach) or (start_x > x + reach and end_x > x + reach):
            return False
        if (start_y < y - reach and end_y < y - reach) or (start_y > y + reach and end_y > y + reach):
            return False
        dx, dy = end_x - start_x, end_y - start_y
        along = (x - start_x) * dx + (y - start_y) * dy
        share = min(max(along / (dx * dx + dy * dy or 1.0), 0.0), 1.0)
        return math.hypot(start_x + share * dx - x, start_y + share * dy - y) < self.radius - ROUNDING

    def left_from(self, start: Point) -> Disc:
        """Return the disc, shrunk to the distance of a `start` inside it.

        The robot may leave it, but not enter it deeper.
        """
        return self._replace(radius=min(self.radius, math.dist(self.centre, start)))

    def corners(self) -> Iterator[Point]:
        """Yield the corners of the regular polygon around the disc."""
        half = math.pi / CORNERS
        # The sides touch the disc, not the corners.
        reach = (self.radius + SLACK) / math.cos(half)
        for number in range(CORNERS):
            angle = (2 * number + 1) * half
            yield Point(self.centre.x + reach * math.cos(angle), self.centre.y + reach * math.sin(angle))


def find_route(
    start: Point, goal: Point, barriers: Barriers, clearances: Clearances, others: Iterable[Disc] = ()
) -> tuple[Point, ...] | None:
    """Return the way points of a shortest route, without `start`, ending with `goal`; None if there is no route.

    Normal barriers are avoided if there is a way around, otherwise as few as possible are crossed; forced ones are
    never crossed (document 2.1, footnote 2). A normal disc that contains the goal is free; a goal inside a forced disc
    is unreachable. A start inside a disc may leave it. Way points keep clear of the field's edge. The goal may be
    nearer to it, but is unreachable where the robot does not fit; the start may be anywhere. `others` are further
    places to avoid, such as those of other robots.
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
    # A normal disc that contains the goal has to be entered anyway.
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
    # Closed discs first, as most legs that are not free meet one.
    return _cheapest(start, goal, corners, sorted(avoided, key=lambda disc: -disc.toll))


def _toll(start: Point, end: Point, discs: Iterable[Disc]) -> float:
    """Return the cost of the straight leg from `start` to `end`, in mm; infinite if it meets a closed disc."""
    toll = 0.0
    for disc in discs:
        if disc.meets(start, end):
            toll += disc.toll
            if toll == math.inf:
                break
    return toll


def _cheapest(start: Point, goal: Point, corners: list[Point], discs: list[Disc]) -> tuple[Point, ...] | None:
    """Return the cheapest route in the visibility graph: Dijkstra, with the straight distance to the goal added."""
    # Most legs are never used, so a leg's tolls are computed only when it is next on a cheapest route.
    frontier: list[tuple[float, float, tuple[Point, ...], bool]] = [(0.0, 0.0, (start,), True)]
    # For each point that is not settled yet.
    to_goal = {point: math.dist(point, goal) for point in (start, goal, *corners)}
    while frontier:
        estimate, cost, way, has_paid = heappop(frontier)
        here = way[-1]
        if here not in to_goal:
            continue
        if not has_paid and (toll := _toll(way[-2], here, discs)):
            # Queued again with its toll, as a detour may be cheaper.
            if toll < math.inf:
                heappush(frontier, (estimate + toll, cost + toll, way, True))
            continue
        if here == goal:
            # A robot at its goal has no leg to drive, but needs a place to turn.
            return way[1:] or (goal,)
        del to_goal[here]
        for point, left in to_goal.items():
            further = cost + math.dist(here, point)
            heappush(frontier, (further + left, further, (*way, point), False))
    return None


def with_fewer_stops(way: Sequence[Point], discs: Sequence[Disc], clearances: Clearances) -> tuple[Point, ...]:
    """Return a route, given with its start, without it, and with one way point for two where that is free.

    The robot stops at each way point. Round a corner it needs only the one where the legs before and after it meet.
    """
    points = list(way)
    for at in reversed(range(len(points) - 3)):
        before, one, other, after = points[at : at + 4]
        meeting = _crossing(before, one, after, other)
        if meeting is None or not clearances.facts.field.contains(meeting, clearances.edge):
            continue
        if not any(disc.meets(each, meeting) for disc in discs for each in (one, other)):
            points[at + 1 : at + 3] = [meeting]
    return tuple(points[1:])


def _crossing(start: Point, through: Point, end: Point, back: Point) -> Point | None:
    """Return where a leg meets one that is followed back from its end, both beyond their second points; None if not."""
    (ux, uy), (vx, vy) = (through.x - start.x, through.y - start.y), (back.x - end.x, back.y - end.y)
    x, y, across = end.x - start.x, end.y - start.y, ux * vy - uy * vx
    if abs(across) < NEARLY_PARALLEL * math.hypot(ux, uy) * math.hypot(vx, vy):
        return None
    along, along_back = (x * vy - y * vx) / across, (x * uy - y * ux) / across
    return Point(start.x + along * ux, start.y + along * uy) if along > 1 and along_back > 1 else None
