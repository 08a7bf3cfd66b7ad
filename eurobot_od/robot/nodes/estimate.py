"""The drive's estimate of its own pose, from what its wheels and the navigation report (document 4.2.2).

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

from eurobot_od.robot.model.places import Pose, turn
from eurobot_od.robot.nodes.kalman import METRE, Belief, Deviations, Travel, Tuning, chance_up_to
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.nodes.sightings import TOP_SPEED

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
    two full positions that agree replace it, where a measured pose takes three.
    """

    def __init__(self, tuning: Tuning, pose: Pose | None = None) -> None:
        self.tuning = tuning
        self._belief = None if pose is None else Belief.at(pose, tuning.placement_variances, tuning.scale)
        self._assumed = True
        self._rival: Belief | None = None
        self._agreeing, self._due = 0, 0.0
        self._seen_at: float | None = None
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
        if self._belief and self._seen_at is not None and now - self._seen_at > UNSEEN:
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
        self._belief, self._rival, self._agreeing, self._seen_at = belief, None, 0, now
        # A place alone does not confirm the heading, and a wrong heading leads further astray with every step.
        self._assumed = self._assumed and fix.angle is None
        return True

    def _is_stale(self, fix: Fix) -> bool:
        """Tell whether a position is repeated although the wheels have moved since it first came."""
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
