"""An extended Kalman filter of a robot's pose, from its wheels and from navigation positions (document 4.2.2).

There is no clock in here, and nothing changes: a movement or a measurement makes a new belief from an old one.

Theory of operation. The state is x, y in mm, the heading in degrees, and the wheels' scale: the factor between true
distances and those that they report. A report of the wheels moves the state along an arc and adds to its covariance; a
navigation position is a measurement of x, y and, if it is known, the heading. Measured values have independent errors,
so they are taken in one after the other, which is the same as all at once and needs no inverse matrix. The deviation of
each, in relation to what was expected, adds up to the square of the Mahalanobis distance of the whole position.

A position that is known to be old is compared with where the robot was by this same belief: the caller says how the
robot has moved since, and the comparison accounts for how that depends on heading and scale.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from operator import mul
from typing import NamedTuple, TypeAlias

from eurobot_od.robot.model.places import Pose, normalise, turn
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.navigation import Fix

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
