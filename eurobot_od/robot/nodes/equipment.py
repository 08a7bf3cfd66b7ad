"""What a robot's core has beside the bus: a distance sensor, and what it does its tasks with."""

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
    """Looks ahead of the robot, real or not."""

    def look(self, now: float) -> Detection | None:
        """Measure what is ahead; None if nothing is."""


class Actuators(Protocol):
    """Arms, grippers, launchers: what the robot does its tasks with, real or not."""

    def begin(self, task: str) -> float:
        """Begin with a task where the robot stands; return how many seconds it takes. Raises UnknownName."""

    def finish(self, task: str) -> int:
        """Finish a task that was begun; return what it came to: points, or pieces of fruit."""


class Approach:
    """Tells what the robot drives into from what it only stands before: what is near, and comes nearer.

    A robot that turns on the spot before something, or backs away from it, need not stop.
    """

    def __init__(self) -> None:
        self._distances: deque[float | None] = deque(maxlen=READINGS)

    def meets(self, detection: Detection | None, stop_distance: float) -> bool:
        """Take in a reading; tell whether the robot drives into something that is nearer than `stop_distance` mm."""
        self._distances.append(None if detection is None else detection.distance)
        if detection is None or detection.distance > stop_distance:
            return False
        # The oldest one that saw something: over a longer time the way stands out from the noise.
        first = next(each for each in self._distances if each is not None)
        return first - detection.distance >= CLOSING


READINGS = 3
"""How many readings are looked at: one that misses something does not hide it."""

CLOSING = 12.0
"""What comes nearer by this much, mm, in these readings is being driven into; less may be the sensor's noise."""
