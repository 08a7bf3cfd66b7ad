"""Where robots are, as far as is known: the core's sightings of all, and the drive's estimate of its own pose.

The estimate is made of what the wheels and the navigation report (document 4.2.2).

Rule of this file: what is not known is None, never a guess, as the robot would drive by a guess. The caller has the
clock.

Outliers. A position is refused when it is further off than the gate allows. It may still be right, as after a push, so
it starts a belief of its own, the rival, which follows the wheels as well. The next refused position either agrees with
the rival or starts a new one; a rival that is agreed with often enough takes over. Random outliers do not agree with
each other, and an accepted position ends the rival. Whatever pushes the robot may go on pushing it, so the rival may be
off by more than its wheels alone allow. And as a robot needs time to get anywhere, positions in quick succession, or
one that came twice, count as one. The rival takes over when a robot could have got to its place, at the latest after
LATEST.

A navigation that goes on reporting where it once saw the robot agrees with itself as well. Measured places are never
equal to the bit while the robot moves, so a position that is repeated although the wheels have moved says nothing.

Latency. For a position that is known to be old, the odometer tells how the robot has moved since. It follows the wheels
alone and is never corrected, so that a correction does not look like a movement.
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
"""No robot drives faster than this, mm/s."""

SPREAD = 50.0
"""Two right places of a standing robot are never further apart than this, mm."""


class Sighting(NamedTuple):
    """A received position, and when it came, in seconds of the node's time."""

    position: messages.PositionResponse
    time: float


class Seen(NamedTuple):
    """A place in mm where a robot was at a time in seconds."""

    point: Point
    time: float

    def agrees(self, earlier: Seen | None) -> bool:
        """Return whether a robot that was seen earlier can be here by now."""
        if earlier is None:
            return False
        return math.dist(self.point, earlier.point) <= SPREAD + TOP_SPEED * (self.time - earlier.time)


class Track:
    """The track of a robot; `last` is where it was last seen, None before."""

    def __init__(self) -> None:
        self.last: Seen | None = None
        self._doubted: Seen | None = None

    def saw(self, sighting: Sighting) -> None:
        """Take in a position."""
        x, y, *_ = sighting.position
        if x is None or y is None:
            return
        seen = Seen(Point(x, y), sighting.time)
        if self.last is None or seen.agrees(self.last) or seen.agrees(self._doubted):
            self.last, self._doubted = seen, None
        else:
            self._doubted = seen


TOGETHER = 0.002
"""Answers to one question come within this time, s; what a drive reports hardly changes meanwhile."""

SURE = 3
"""How often in a row they have to differ: once may be a goto that begins just then, or a correction."""

SAME_TIME, SAME_DISTANCE, SAME_ANGLE = 100, 50.0, 10.0
"""Answers that are no further apart than this are the same, ms, mm and degrees."""

DriveAnswer: TypeAlias = messages.GotoStateResponse | messages.KalmanPositionResponse


class Twins:
    """Notices a second drive: each question gets two answers, one right after the other, and they differ."""

    def __init__(self) -> None:
        self._last: dict[type[DriveAnswer], tuple[DriveAnswer, float]] = {}
        self._times = 0

    def heard(self, answer: DriveAnswer, now: float) -> str:
        """Take in an answer; return two that differ once it is certain that there are two drives, otherwise ''."""
        before, then = self._last.get(type(answer), (answer, -math.inf))
        self._last[type(answer)] = answer, now
        # An answer to another question says nothing, and two drives are reported only once.
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
    return one != other  # one has a goto and the other has none: a few milliseconds do not explain that


AGREEING, AGREEING_FIRST = 3, 2
"""How many refused positions in a row have to agree to replace a measured pose, and one that is only assumed. It is not
two for both: now and then, two that take another robot for ours agree."""

PUSHED = 60.0
"""How far the robot may have been pushed between two refused positions, standard deviation in mm."""

UNSEEN, BUMPS = 2.0, 25.0
"""When no position has come for UNSEEN seconds, a barrier or another robot may push the robot aside without a trace:
this adds a standard deviation of BUMPS mm after a metre. In matches without navigation the place was off by up to 200
mm after 40 s, eight times what the wheels alone account for. A drive that never had a position is on a bench."""

MOVED, TURNED = 30.0, 5.0
"""The wheels have moved if the odometer shows this much, mm or degrees: more than rounding and slipping."""

SOONEST, LATEST = 0.05, 1.0
"""Seconds between the first and the last of agreeing positions: SOONEST is half of the core's shortest interval between
requests, LATEST is less than two usual intervals, so that a robot that was carried away soon finds its place again."""

LONGEST_LATENCY = 2.0
"""Seconds for which the odometer is remembered; an older position counts as if it were this old."""


class Estimate:
    """Where the drive believes the robot is; `tuning` may be exchanged at any time.

    A `pose` to begin with is only assumed, as a drive that has booted believes in its start place wherever it stands:
    two full positions that agree replace it, where a measured pose takes three. `seen_at` is when a position last
    agreed, in s, None before.
    """

    def __init__(self, tuning: Tuning, pose: Pose | None = None) -> None:
        self.tuning = tuning
        self._belief = None if pose is None else Belief.at(pose, tuning.placement_variances, tuning.scale)
        self._assumed = True
        self._rival: Belief | None = None
        self._agreeing, self._due = 0, 0.0
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
        """The factor between true distances and those that the wheels report; None without a pose."""
        return self._belief and self._belief.scale

    @property
    def deviations(self) -> Deviations | None:
        """The standard deviations of the pose; None without one."""
        return self._belief and self._belief.deviations

    @property
    def spread(self) -> float:
        """How far from the pose the robot may be: standard deviation of the distance, mm; 0 without a pose."""
        return math.sqrt(self._belief.covariance[0][0] + self._belief.covariance[1][1]) if self._belief else 0.0

    def moved(self, odometry: Odometry, now: float) -> None:
        """Follow what the wheels report until `now`, in seconds; without a pose there is nothing to follow."""
        self._odometer.append((now, self._odometer[-1][1].moved(*odometry)))
        # The second entry, not the first: the longest latency lies between the two.
        while self._odometer[1][0] <= now - LONGEST_LATENCY:
            self._odometer.popleft()
        self._belief = self._belief and self._belief.moved(odometry, self.tuning)
        # The root, as random errors add up by their squares.
        if self._belief and self.seen_at is not None and now - self.seen_at > UNSEEN:
            self._belief = self._belief.loosened(BUMPS * math.sqrt(abs(odometry.distance) / METRE))
        self._rival = self._rival and self._rival.moved(odometry, self.tuning)

    def bumped(self, now: float) -> None:
        """Trust the place less, once in a while: the robot ran into something, which may have turned it aside."""
        if self._belief is not None and now - self._bumped_at > UNSEEN:
            self._belief, self._bumped_at = self._belief.loosened(PUSHED), now

    def corrected(self, fix: Fix, now: float) -> bool:
        """Correct the estimate by a navigation position that came at `now`, in seconds; return False if it is refused.

        A first position without a heading is refused: dead reckoning needs both.
        """
        if self._is_stale(fix):
            return False
        # How the robot has moved since the position was measured, from the last step before that.
        seen = now - self.tuning.latency
        then = next((pose for moment, pose in reversed(self._odometer) if moment <= seen), self._odometer[0][1])
        travel = Travel.between(then, self._odometer[-1][1])
        belief = self._gated(self._belief, fix, travel) or self._overruled(fix, travel, now)
        if belief is None:
            return False
        self._belief, self._rival, self._agreeing, self.seen_at = belief, None, 0, now
        # A place alone does not confirm the heading, and a wrong heading leads further astray with every step.
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
        """Return a belief corrected by a position; None if the position lies outside its gate."""
        if belief is None:
            return None
        # Corrected first, judged later: the correction computes the distance anyway, and a refused belief is dropped.
        observations = belief.compared(fix, travel, self.tuning)
        corrected, distance = belief.corrected(observations)
        return corrected if chance_up_to(distance, len(observations)) <= self.tuning.gate else None

    def _overruled(self, fix: Fix, travel: Travel, now: float) -> Belief | None:
        """Return the belief that replaces the estimate when it refuses a position; None to keep the estimate."""
        if self._belief is None:
            return self._begun(fix, travel)
        # Loosened before it is compared: whatever has pushed the robot may still be pushing it.
        agreed = self._gated(self._rival and self._rival.loosened(PUSHED), fix, travel)
        self._rival = agreed or self._begun(fix, travel)
        self._agreeing += 1
        if not agreed:
            # No robot can have got there sooner. An assumed place does not count: nobody has driven from there.
            away = 0.0 if self._assumed or self._rival is None else self._rival.pose.distance(self._belief.pose.point)
            self._agreeing, self._due = 1, now + min(max((away - PUSHED) / TOP_SPEED, SOONEST), LATEST)
        is_believed = self._agreeing >= (AGREEING_FIRST if self._assumed else AGREEING) and now >= self._due
        return self._rival if is_believed else None

    def _begun(self, fix: Fix, travel: Travel) -> Belief | None:
        """Return a belief in a position; without a heading in it, that of the estimate, or else an unknown one."""
        variances, angle = self.tuning.fix_variances, fix.angle
        if angle is None and self._belief is not None:
            # The estimate's heading is the present one, but the position is older.
            angle = self._belief.pose.angle - travel.turned
            # No better known than in the estimate: the position adds nothing to the heading.
            variances = variances._replace(angle=self._belief.deviations.heading**2)
        if angle is None:
            return None
        dx, dy = travel.seen_from(angle, 1.0)
        return Belief.at(Pose(fix.x + dx, fix.y + dy, angle + travel.turned), variances, self.tuning.scale)


ROUNDING = 1 / 12
"""Variance of rounding a message to whole millimetres and degrees."""

LOWEST_SCALE, HIGHEST_SCALE = 0.5, 2.0
"""The wheels are never assumed to be further off than this, whatever the settings say."""

METRE, FULL_TURN = 1000.0, 360.0
RADIAN = math.radians(1.0)
"""A degree, in radians."""

Row: TypeAlias = tuple[float, float, float, float]
"""One number for each part of the state: x in mm, y in mm, heading in degrees, scale."""

Covariance: TypeAlias = tuple[Row, Row, Row, Row]

NOTHING: Row = (0.0, 0.0, 0.0, 0.0)


class Variances(NamedTuple):
    """Variances of a pose whose parts have independent errors: mm2 for x and y, square degrees for the heading."""

    place: float
    angle: float


class Deviations(NamedTuple):
    """Standard deviations of an estimate: x and y in mm, heading in degrees.

    `worst` is that of the place in mm, in the direction in which it is known worst.
    """

    x: float
    y: float
    heading: float
    worst: float


class Tuning(NamedTuple):
    """The errors that are expected, as standard deviations: the drive's settings `Estimate`.

    Navigation positions are off by `navigation` mm in x and y and by `navigation_angle` degrees, and they are `latency`
    seconds old. A right one is refused with a probability of 1 - `gate`. The robot is put down at its start place to
    within `placement` mm and `placement_angle` degrees. Distances that the wheels report are off by a constant share
    `scale`, and at random by `distance` mm after a metre; the heading by `drift` degrees after a metre and by `turning`
    degrees after a full turn. Random errors grow with the root of the distance.
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
        """Variances of the place where the robot is put down."""
        return Variances(self.placement**2, self.placement_angle**2)


class Travel(NamedTuple):
    """How the robot has moved: mm `ahead` and to the left, as it looked at first, and degrees `turned` since."""

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
        """Return the movement in x and y, mm, of a robot that first looked to `angle`."""
        cos, sin = _direction(angle)
        return scale * (cos * self.ahead - sin * self.left), scale * (sin * self.ahead + cos * self.left)


def _direction(angle: float) -> tuple[float, float]:
    return math.cos(angle * RADIAN), math.sin(angle * RADIAN)


class Observation(NamedTuple):
    """A measured value: how it depends on the state, how far it is from the expected value, and its variance."""

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
        """Return a belief in a pose, and in wheels whose distances are true with the standard deviation `scale`."""
        place, angle = variances
        # Without correlations: where the robot is put down says nothing about how it is turned.
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
        """Follow what the wheels report along an arc."""
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
        """Take in measured values; return the new belief, and the square of their Mahalanobis distance."""
        covariance, change, distance = self.covariance, NOTHING, 0.0
        for row, innovation, variance in observations:
            across = tuple(_dot(each, row) for each in covariance)
            # What earlier values have corrected is no longer off.
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
        """Compare a navigation position with where the robot was before `travel`, by this belief."""
        place, angle = tuning.fix_variances
        before = self.pose.angle - travel.turned
        dx, dy = travel.seen_from(before, self.scale)
        x = Observation((1.0, 0.0, dy * RADIAN, -dx / self.scale), fix.x + dx - self.pose.x, place)
        y = Observation((0.0, 1.0, -dx * RADIAN, -dy / self.scale), fix.y + dy - self.pose.y, place)
        if fix.angle is None:
            return [x, y]
        # The shorter way round: headings of 359 and 1 degree are 2 apart, not 358.
        return [x, y, Observation((0.0, 0.0, 1.0, 0.0), turn(before, fix.angle), angle)]


def _carried(covariance: Covariance, dx: float, dy: float, scale: float, along: float, heading: float) -> Covariance:
    """Return the covariance after moving by `dx`, `dy`, which adds variances along the path and to the heading."""
    # The Jacobian differs from 1 only in how x and y depend on heading and scale, so its products are written out: this
    # runs in every control step.
    (xx, xy, xh, xs), (_, yy, yh, ys), (_, _, hh, hs), (_, _, _, ss) = covariance
    x_h, x_s, y_h, y_s = -dy * RADIAN, dx / scale, dx * RADIAN, dy / scale
    new_xh, new_xs = xh + x_h * hh + x_s * hs, xs + x_h * hs + x_s * ss
    new_yh, new_ys = yh + y_h * hh + y_s * hs, ys + y_h * hs + y_s * ss
    way = dx * dx + dy * dy
    # Errors of the distance lie along the path; sideways errors come from the heading.
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
    # Joseph's form, (1 - kh) P (1 - kh)' + k r k': unlike the short form it stays positive, however it is rounded.
    kept = [_row(float(i == j) - gain[i] * row[j] for j in range(4)) for i in range(4)]
    half = [[_dot(each, column) for column in covariance] for each in kept]  # symmetric: its rows are its columns
    new = [[_dot(half[i], kept[j]) + variance * gain[i] * gain[j] for j in range(4)] for i in range(4)]
    # Only the upper half is used: rounding must not make it asymmetric.
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
