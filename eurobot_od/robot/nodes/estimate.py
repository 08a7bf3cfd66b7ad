"""The drive's estimate of its own pose: dead reckoning from the wheels, corrected by navigation positions.

Rule of this file: what is not known is None, never a guess; a guess would be driven from.

Wheels are exact over a second and drift over a match, beacons are off by millimetres at any time and never drift: a
small share of every beacon position keeps the drift down and lets little of the beacons' noise through.
"""

from __future__ import annotations

from eurobot_od.robot.field import Point, Pose, normalise, turn
from eurobot_od.robot.nodes.motion import Odometry

OUTLIERS_REFUSED = 5
"""So many outliers in a row are refused; the next one is believed, as then it is the estimate that is wrong."""


class Estimate:
    """Where the drive believes the robot is.

    Navigation positions are blended in with a fixed weight; the Kalman filter that the document names (4.2.2,
    Navigation), which would weigh both sides by their deviations, is to take the place of that blend. An `assumed`
    pose is one that nothing has measured, such as the start place: the first full position takes its place.
    """

    def __init__(self, pose: Pose | None = None, *, assumed: bool = False) -> None:
        self.pose = pose
        """Place in mm and heading in degrees; None before the first pose or full position."""
        self._assumed, self._refused = assumed, 0

    def moved(self, odometry: Odometry) -> None:
        """Follow what the wheels report along an arc; without effect before the first pose."""
        if self.pose is not None:
            self.pose = self.pose.moved(*odometry)

    def corrected(self, x: float, y: float, angle: float | None, weight: float, outlier: float) -> bool:
        """Blend in a navigation position in mm and degrees; return False if it was refused.

        `weight` 0..1 is the share of the new position, `outlier` the distance in mm from which on it is refused.
        A position without a heading (`angle` None) leaves the heading as it is, and is refused as the first one:
        dead reckoning needs both. A first position, and one that overrules the estimate, are taken whole.
        """
        if self.pose is None or (self._assumed and angle is not None):
            self.pose, self._assumed = None if angle is None else Pose(x, y, normalise(angle)), False
            return angle is not None
        outlying = self.pose.distance(Point(x, y)) > outlier
        if outlying and self._refused < OUTLIERS_REFUSED:
            self._refused += 1
            return False
        self._refused = 0
        new = Pose(x, y, self.pose.angle if angle is None else angle)
        self.pose = _blend(self.pose, new, share=1.0 if outlying else weight)
        return True


def _blend(old: Pose, new: Pose, share: float) -> Pose:
    """Go the `share` of the way from one pose to another; the heading goes the shorter way round."""
    x, y = old.x + share * (new.x - old.x), old.y + share * (new.y - old.y)
    return Pose(x, y, normalise(old.angle + share * turn(old.angle, new.angle)))
