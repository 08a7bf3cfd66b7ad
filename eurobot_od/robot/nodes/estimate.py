"""Positions of robots: the core's sightings of all robots, and the drive's estimate of its own pose.

The estimate combines what the wheels and the navigation report (document 4.2.2).

An unknown value is None, never a guess, as the robot would act on it. The caller has the clock.

Outliers. A position is refused if it is further off than the gate allows. It may still be right, such as after a push.
So it starts a second belief, the rival, which follows the wheels as well. The next refused position either agrees with
the rival or starts a new one; a rival that enough positions agree with replaces the estimate. Random outliers do not
agree with each other, and an accepted position ends the rival. Whatever pushes the robot may go on pushing it, so the
rival may be off by more than its wheels alone allow. As a robot needs time to get anywhere, positions in quick
succession, or one that came twice, count as one. The rival takes over when a robot could have got to its place, at the
latest after LATEST.

A navigation that repeats an old position agrees with itself as well. Measured places of a moving robot are never
exactly equal, so a position that is repeated although the wheels have moved is ignored.

Latency. For a position of known age, the odometer shows how the robot has moved since. It follows the wheels alone and
is never corrected, so that a correction does not look like a movement.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from operator import mul
from typing import NamedTuple, TypeAlias

from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point, Pose, is_near, normalise, turn
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.navigation import Fix

TOP_SPEED = 800.0
"""Maximum speed of any robot, in mm/s."""

SPREAD = 50.0
"""Maximum distance between two correct places of a standing robot, in mm."""


class Sighting(NamedTuple):
    """A received position, and when it came, in s of the node's time."""

    position: messages.PositionResponse
    time: float


class Seen(NamedTuple):
    """A place in mm where a robot was at a time in s."""

    point: Point
    time: float

    def agrees(self, earlier: Seen | None) -> bool:
        """Return whether a robot that was seen earlier can be here now."""
        if earlier is None:
            return False
        return math.dist(self.point, earlier.point) <= SPREAD + TOP_SPEED * (self.time - earlier.time)


class Track:
    """The track of a robot; `last` is where it was last seen, None before."""

    def __init__(self) -> None:
        self.last: Seen | None = None
        self._doubted: Seen | None = None

    def saw(self, sighting: Sighting) -> None:
        """Add a position."""
        x, y, *_ = sighting.position
        if x is None or y is None:
            return
        seen = Seen(Point(x, y), sighting.time)
        if self.last is None or seen.agrees(self.last) or seen.agrees(self._doubted):
            self.last = seen
            self._doubted = None
        else:
            self._doubted = seen


TOGETHER = 0.002
"""Maximum time between two answers to one request, in s; a drive's answer hardly changes meanwhile."""

SURE = 3
"""Number of differing pairs in a row: a single one may be a goto that has just begun, or a correction."""

SAME_TIME, SAME_DISTANCE, SAME_ANGLE = 100, 50.0, 10.0
"""Maximum differences between equal answers: ms, mm and degrees."""

DriveAnswer: TypeAlias = messages.GotoStateResponse | messages.KalmanPositionResponse


class SecondDriveDetector:
    """Detects a second drive: each request gets two answers at once, and they differ."""

    def __init__(self) -> None:
        self._last: dict[type[DriveAnswer], tuple[DriveAnswer, float]] = {}
        self._times = 0

    def heard(self, answer: DriveAnswer, now: float) -> str:
        """Add an answer; return two different ones once it is certain that there are two drives, otherwise ""."""
        before, then = self._last.get(type(answer), (answer, -math.inf))
        self._last[type(answer)] = answer, now
        # An answer to another request is no evidence, and two drives are reported only once.
        if now - then >= TOGETHER or self._times == SURE:
            return ""
        self._times = self._times + 1 if _differ(before, answer) else 0
        return f"{before} and {answer}" if self._times == SURE else ""


def _differ(before: DriveAnswer, answer: DriveAnswer) -> bool:
    if isinstance(before, messages.KalmanPositionResponse) and isinstance(answer, messages.KalmanPositionResponse):
        return not is_near(before[:3], answer[:3], SAME_DISTANCE, SAME_ANGLE)
    one, other = before[0], answer[0]
    if isinstance(one, int) and isinstance(other, int):
        return abs(one - other) > SAME_TIME
    return one != other  # one has a goto and the other has none


AGREEING, AGREEING_FIRST = 3, 2
"""Number of refused positions in a row that must agree to replace a measured pose, and an assumed one. It is not
two for both: now and then, two that take another robot for ours agree."""

PUSHED = 60.0
"""Standard deviation of a push between two refused positions, in mm."""

UNSEEN, BUMPS = 2.0, 25.0
"""Without a position for UNSEEN s, a barrier or another robot may push the robot aside without a trace:
this adds a standard deviation of BUMPS mm per metre. In matches without navigation the place was off by up to 200
mm after 40 s, eight times what the wheels explain. A drive that never had a position is on a bench."""

MOVED, TURNED = 30.0, 5.0
"""Minimum movement in the odometer, in mm or degrees, more than rounding and slipping."""

SOONEST, LATEST = 0.05, 1.0
"""Minimum and maximum time between the first and the last of agreeing positions, in s.

SOONEST is half of the core's shortest interval between requests; LATEST is less than two usual intervals, so that a
robot that was carried away soon finds its place.
"""

LONGEST_LATENCY = 2.0
"""For this long, in s, the odometer is remembered; older positions count as this old."""


class Estimate:
    """The drive's estimate of the robot's pose; `tuning` may be replaced at any time.

    An initial `pose` is only assumed, as a drive that has booted assumes its start place: two full positions that agree
    replace it, where a measured pose takes three. `seen_at` is when a position last agreed, in s, None before.
    """

    def __init__(self, tuning: Tuning, pose: Pose | None = None) -> None:
        self.tuning = tuning
        self._belief = None if pose is None else Belief.at(pose, tuning.placement_variances, tuning.scale)
        self._assumed = True
        self._rival: Belief | None = None
        self._agreeing = 0
        self._due = 0.0
        self.seen_at: float | None = None
        self._bumped_at = -math.inf
        self._repeated: tuple[Fix, Pose] | None = None
        self._odometer = deque([(-math.inf, Pose(0.0, 0.0, 0.0))])

    @property
    def pose(self) -> Pose | None:
        """Place in mm and heading in degrees; None before the first pose or full position."""
        return self._belief and self._belief.pose

    @property
    def scale(self) -> float | None:
        """Ratio of true distances to those of the wheels; None without a pose."""
        return self._belief and self._belief.scale

    @property
    def deviations(self) -> Deviations | None:
        """Standard deviations of the pose; None without one."""
        return self._belief and self._belief.deviations

    @property
    def spread(self) -> float:
        """Standard deviation of the robot's distance from the pose, in mm; 0 without a pose."""
        return math.sqrt(self._belief.covariance[0][0] + self._belief.covariance[1][1]) if self._belief else 0.0

    def moved(self, odometry: Odometry, now: float) -> None:
        """Update the estimate by the odometry until `now`, in s."""
        self._odometer.append((now, self._odometer[-1][1].moved(*odometry)))
        # The second entry, as the longest latency is between the first two.
        while self._odometer[1][0] <= now - LONGEST_LATENCY:
            self._odometer.popleft()
        self._belief = self._belief and self._belief.moved(odometry, self.tuning)
        # The root, as the squares of random errors add up.
        if self._belief and self.seen_at is not None and now - self.seen_at > UNSEEN:
            self._belief = self._belief.loosened(BUMPS * math.sqrt(abs(odometry.distance) / METRE))
        self._rival = self._rival and self._rival.moved(odometry, self.tuning)

    def bumped(self, now: float) -> None:
        """Reduce the certainty of the place, at most once per UNSEEN s, as an obstacle may have turned the robot."""
        if self._belief is not None and now - self._bumped_at > UNSEEN:
            self._belief, self._bumped_at = self._belief.loosened(PUSHED), now

    def corrected(self, fix: Fix, now: float) -> bool:
        """Correct the estimate by a navigation position that came at `now`, in s; return whether it was accepted.

        A first position without a heading is refused, as dead reckoning needs both.
        """
        if self._is_stale(fix):
            return False
        # The movement since the last step before the measurement.
        seen = now - self.tuning.latency
        then = next((pose for moment, pose in reversed(self._odometer) if moment <= seen), self._odometer[0][1])
        travel = Travel.between(then, self._odometer[-1][1])
        belief = self._gated(self._belief, fix, travel) or self._overruled(fix, travel, now)
        if belief is None:
            return False
        self._belief = belief
        self._rival = None
        self._agreeing = 0
        self.seen_at = now
        # A place alone does not confirm the heading, whose error grows with every step.
        self._assumed = self._assumed and fix.angle is None
        return True

    def _is_stale(self, fix: Fix) -> bool:
        """Return whether a position is repeated although the wheels have moved since it first came."""
        here = self._odometer[-1][1]
        if self._repeated is None or self._repeated[0] != fix:
            self._repeated = fix, here
        _, then = self._repeated
        turned = fix.angle is not None and abs(turn(then.angle, here.angle)) > TURNED
        return turned or here.distance(then.point) > MOVED

    def _gated(self, belief: Belief | None, fix: Fix, travel: Travel) -> Belief | None:
        """Return a belief corrected by a position; None if the position is outside its gate."""
        if belief is None:
            return None
        # Corrected first, as this computes the distance anyway.
        observations = belief.compared(fix, travel, self.tuning)
        corrected, distance = belief.corrected(observations)
        return corrected if chance_up_to(distance, len(observations)) <= self.tuning.gate else None

    def _overruled(self, fix: Fix, travel: Travel, now: float) -> Belief | None:
        """Return the belief that replaces the estimate after a refused position; None to keep the estimate."""
        if self._belief is None:
            return self._begun(fix, travel)
        # Loosened, as the robot may still be pushed.
        agreed = self._gated(self._rival and self._rival.loosened(PUSHED), fix, travel)
        self._rival = agreed or self._begun(fix, travel)
        self._agreeing += 1
        if not agreed:
            # Minimum time to get there; not from an assumed place, where the robot may never have been.
            away = 0.0 if self._assumed or self._rival is None else self._rival.pose.distance(self._belief.pose.point)
            self._agreeing = 1
            self._due = now + min(max((away - PUSHED) / TOP_SPEED, SOONEST), LATEST)
        is_believed = self._agreeing >= (AGREEING_FIRST if self._assumed else AGREEING) and now >= self._due
        return self._rival if is_believed else None

    def _begun(self, fix: Fix, travel: Travel) -> Belief | None:
        """Return a belief in a position; without its heading, with that of the estimate; None without either."""
        variances = self.tuning.fix_variances
        angle = fix.angle
        if angle is None and self._belief is not None:
            # The estimate's heading is the current one, but the position is older.
            angle = self._belief.pose.angle - travel.turned
            # The position adds nothing to the certainty of the heading.
            variances = variances._replace(angle=self._belief.deviations.heading**2)
        if angle is None:
            return None
        dx, dy = travel.seen_from(angle, 1.0)
        return Belief.at(Pose(fix.x + dx, fix.y + dy, angle + travel.turned), variances, self.tuning.scale)


ROUNDING = 1 / 12
"""Variance of rounding to whole millimetres and degrees in messages."""

LOWEST_SCALE, HIGHEST_SCALE = 0.5, 2.0
"""Limits of the scale of the wheels, whatever the settings are."""

METRE, FULL_TURN = 1000.0, 360.0
RADIAN = math.radians(1.0)
"""One degree in radians."""

Row: TypeAlias = tuple[float, float, float, float]
"""One number per part of the state: x in mm, y in mm, heading in degrees, scale."""

Covariance: TypeAlias = tuple[Row, Row, Row, Row]

NOTHING: Row = (0.0, 0.0, 0.0, 0.0)


class Variances(NamedTuple):
    """Variances of a pose with independent errors: mm2 for x and y, square degrees for the heading."""

    place: float
    angle: float


class Deviations(NamedTuple):
    """Standard deviations of an estimate: x and y in mm, heading in degrees.

    `worst` is that of the place in mm, in the direction where it is largest.
    """

    x: float
    y: float
    heading: float
    worst: float


class Tuning(NamedTuple):
    """Expected errors as standard deviations: the drive's settings `Estimate`.

    Navigation positions are off by `navigation` mm in x and y and by `navigation_angle` degrees, and are `latency` s
    old. A correct one is refused with a probability of 1 - `gate`. The robot is put at its start place to within
    `placement` mm and `placement_angle` degrees. Distances of the wheels are off by a constant share `scale`, and
    randomly by `distance` mm per metre; the heading by `drift` degrees per metre and by `turning` degrees per full
    turn. Random errors grow with the root of the distance.
    """

    navigation: float
    navigation_angle: float
    latency: float
    gate: float
    placement: float
    placement_angle: float
    scale: float
    distance: float
    drift: float
    turning: float

    @property
    def fix_variances(self) -> Variances:
        """Variances of a navigation position."""
        return Variances(self.navigation**2 + ROUNDING, self.navigation_angle**2 + ROUNDING)

    @property
    def placement_variances(self) -> Variances:
        """Variances of the start place."""
        return Variances(self.placement**2, self.placement_angle**2)


class Travel(NamedTuple):
    """A movement of the robot: mm `ahead` and to the `left` in its first direction, and degrees `turned`."""

    ahead: float
    left: float
    turned: float

    @classmethod
    def between(cls, start: Pose, end: Pose) -> Travel:
        """Return the movement from one pose to another."""
        cos, sin = _direction(start.angle)
        dx, dy = end.x - start.x, end.y - start.y
        return cls(cos * dx + sin * dy, cos * dy - sin * dx, turn(start.angle, end.angle))

    def seen_from(self, angle: float, scale: float) -> tuple[float, float]:
        """Return the movement in x and y, in mm, of a robot whose first heading was `angle`."""
        cos, sin = _direction(angle)
        return scale * (cos * self.ahead - sin * self.left), scale * (sin * self.ahead + cos * self.left)


def _direction(angle: float) -> tuple[float, float]:
    return math.cos(angle * RADIAN), math.sin(angle * RADIAN)


class Observation(NamedTuple):
    """A measured value: its dependence on the state, its difference from the expected value, and its variance."""

    row: Row
    innovation: float
    variance: float


class Belief(NamedTuple):
    """The filter's state, `pose` and `scale`, and its covariance."""

    pose: Pose
    scale: float
    covariance: Covariance

    @classmethod
    def at(cls, pose: Pose, variances: Variances, scale: float) -> Belief:
        """Return a belief in a pose, and in wheels with the standard deviation `scale` of their distances."""
        place, angle = variances
        # Without correlations, as the place where the robot is put does not depend on its heading.
        x, y = (place, 0.0, 0.0, 0.0), (0.0, place, 0.0, 0.0)
        covariance = (x, y, (0.0, 0.0, angle, 0.0), (0.0, 0.0, 0.0, scale**2))
        return cls(pose._replace(angle=normalise(pose.angle)), 1.0, covariance)

    @property
    def deviations(self) -> Deviations:
        """The standard deviations of the pose."""
        (xx, xy, *_), (_, yy, *_), (_, _, hh, _), _ = self.covariance
        worst = (xx + yy) / 2 + math.hypot((xx - yy) / 2, xy)  # the greater eigenvalue
        return Deviations(*(math.sqrt(max(each, 0.0)) for each in (xx, yy, hh, worst)))  # 0 may be rounded to less

    def moved(self, odometry: Odometry, tuning: Tuning) -> Belief:
        """Return the belief after a movement along an arc."""
        distance, turned = odometry
        pose = self.pose.moved(self.scale * distance, turned)
        metres, turns = abs(distance) / METRE, abs(turned) / FULL_TURN
        along = tuning.distance**2 * metres
        heading = tuning.drift**2 * metres + tuning.turning**2 * turns
        dx, dy = pose.x - self.pose.x, pose.y - self.pose.y
        return Belief(pose, self.scale, _carried(self.covariance, dx, dy, self.scale, along, heading))

    def loosened(self, deviation: float) -> Belief:
        """Return the belief with a less certain place, by a standard deviation in mm."""
        (xx, *x), (yx, yy, *y), heading, scale = self.covariance
        variance = deviation**2
        return self._replace(covariance=(_row((xx + variance, *x)), _row((yx, yy + variance, *y)), heading, scale))

    def corrected(self, observations: Sequence[Observation]) -> tuple[Belief, float]:
        """Return the belief corrected by measured values, and the square of their Mahalanobis distance."""
        covariance = self.covariance
        change = NOTHING
        distance = 0.0
        for row, innovation, variance in observations:
            across = tuple(_dot(each, row) for each in covariance)
            # Without what earlier values have corrected.
            expected, left = _dot(row, across) + variance, innovation - _dot(row, change)
            gain = tuple(each / expected for each in across)
            change = _row(old + share * left for old, share in zip(change, gain))
            covariance = _joseph(covariance, row, gain, variance)
            distance += left * left / expected
        dx, dy, turned, stretched = change
        x, y, angle = self.pose
        scale = min(max(self.scale + stretched, LOWEST_SCALE), HIGHEST_SCALE)
        return Belief(Pose(x + dx, y + dy, normalise(angle + turned)), scale, covariance), distance

    def compared(self, fix: Fix, travel: Travel, tuning: Tuning) -> list[Observation]:
        """Return the observations of a navigation position, compared with this belief before `travel`."""
        place, angle = tuning.fix_variances
        before = self.pose.angle - travel.turned
        dx, dy = travel.seen_from(before, self.scale)
        x = Observation((1.0, 0.0, dy * RADIAN, -dx / self.scale), fix.x + dx - self.pose.x, place)
        y = Observation((0.0, 1.0, -dx * RADIAN, -dy / self.scale), fix.y + dy - self.pose.y, place)
        if fix.angle is None:
            return [x, y]
        # The shorter way: headings of 359 and 1 degree are 2 apart, not 358.
        return [x, y, Observation((0.0, 0.0, 1.0, 0.0), turn(before, fix.angle), angle)]


def _carried(covariance: Covariance, dx: float, dy: float, scale: float, along: float, heading: float) -> Covariance:
    """Return the covariance after moving by `dx`, `dy`, which adds variances along the path and to the heading."""
    # The Jacobian differs from 1 only where x and y depend on heading and scale. Its products are written out, as this
    # runs in every control step.
    (xx, xy, xh, xs), (_, yy, yh, ys), (_, _, hh, hs), (_, _, _, ss) = covariance
    x_h, x_s, y_h, y_s = -dy * RADIAN, dx / scale, dx * RADIAN, dy / scale
    new_xh, new_xs = xh + x_h * hh + x_s * hs, xs + x_h * hs + x_s * ss
    new_yh, new_ys = yh + y_h * hh + y_s * hs, ys + y_h * hs + y_s * ss
    way = dx * dx + dy * dy
    # Errors of the distance are along the path; sideways errors come from the heading.
    noise = along / way if way else 0.0
    xx += x_h * (xh + new_xh) + x_s * (xs + new_xs) + noise * dx * dx
    xy += x_h * yh + x_s * ys + y_h * new_xh + y_s * new_xs + noise * dx * dy
    yy += y_h * (yh + new_yh) + y_s * (ys + new_ys) + noise * dy * dy
    return (
        (xx, xy, new_xh, new_xs),
        (xy, yy, new_yh, new_ys),
        (new_xh, new_yh, hh + heading, hs),
        (new_xs, new_ys, hs, ss),
    )


def _joseph(covariance: Covariance, row: Row, gain: Sequence[float], variance: float) -> Covariance:
    """Return the covariance after a measured value."""
    # Joseph's form, (1 - kh) P (1 - kh)' + k r k', stays positive in spite of rounding.
    kept = [_row(float(i == j) - gain[i] * row[j] for j in range(4)) for i in range(4)]
    half = [[_dot(each, column) for column in covariance] for each in kept]  # symmetric: its rows are its columns
    new = [[_dot(half[i], kept[j]) + variance * gain[i] * gain[j] for j in range(4)] for i in range(4)]
    # Only the upper half is used, so that rounding cannot make it asymmetric.
    x, y, heading, scale = (_row(new[min(i, j)][max(i, j)] for j in range(4)) for i in range(4))
    return x, y, heading, scale


def _dot(first: Sequence[float], second: Sequence[float]) -> float:
    return math.fsum(map(mul, first, second))


def _row(values: Iterable[float]) -> Row:
    x, y, heading, scale = values
    return x, y, heading, scale


def chance_up_to(distance: float, values: int) -> float:
    """Return the probability that the squared Mahalanobis distance of 2 or 3 values is at most this: chi-square."""
    # The chi-square distribution has a closed form for 2 and for 3 degrees of freedom.
    if values == 2:
        return -math.expm1(-distance / 2)
    return math.erf(math.sqrt(distance / 2)) - math.sqrt(2 * distance / math.pi) * math.exp(-distance / 2)
