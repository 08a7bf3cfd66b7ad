"""The equipment of a robot's core besides the bus: a distance sensor, and actuators for its tasks."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, Protocol

from eurobot_od.robot.model.values import Obstacle


class Detection(NamedTuple):
    """Something ahead: what it is, its distance in mm from edge to edge, and its bearing in degrees, left positive."""

    obstacle: Obstacle
    distance: float
    bearing: float


class DistanceSensor(Protocol):
    """A sensor that looks ahead of the robot, real or simulated."""

    def look(self, now: float) -> Detection | None:
        """Measure what is ahead; None if there is nothing."""


class Actuators(Protocol):
    """Arms, grippers, launchers for the robot's tasks, real or simulated."""

    def begin(self, task: str) -> float:
        """Begin a task where the robot stands; return how many seconds it takes. Raises UnknownName."""

    def finish(self, task: str) -> int:
        """Finish a task that was begun; return the result in points, or in pieces of fruit."""


class Approach:
    """Tells whether the robot drives into something, which is near and comes nearer, or just stands in front of it.

    A robot that turns on the spot in front of something, or backs away from it, need not stop.
    """

    def __init__(self) -> None:
        self._distances: deque[float | None] = deque(maxlen=READINGS)

    def meets(self, detection: Detection | None, stop_distance: float) -> bool:
        """Take in a reading; tell whether the robot drives into something nearer than `stop_distance` mm."""
        self._distances.append(None if detection is None else detection.distance)
        if detection is None or detection.distance > stop_distance:
            return False
        # The oldest reading that saw something: over a longer time the change stands out from the noise.
        first = next(each for each in self._distances if each is not None)
        return first - detection.distance >= CLOSING


READINGS = 3
"""Number of readings that are compared: one that misses something does not hide it."""

CLOSING = 12.0
"""The robot drives into what comes nearer by this much, mm, in these readings; less may be the sensor's noise."""
