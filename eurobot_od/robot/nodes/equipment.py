"""What a robot's core has beside the bus: a distance sensor, and what it does its tasks with."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from eurobot_od.robot.values import Obstacle


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

    PERIODS = 2
    """So many readings ago the distance has to have been larger."""

    CLOSING = 8.0
    """By so many mm at least: more than a sensor's noise."""

    def __init__(self) -> None:
        self._distances: list[float] = []

    def meets(self, detection: Detection | None, stop_distance: float) -> bool:
        """Take in a reading; tell whether the robot drives into something that is nearer than `stop_distance` mm."""
        if detection is None:
            self._distances.clear()
            return False
        self._distances = [*self._distances[-self.PERIODS :], detection.distance]
        closing = len(self._distances) > self.PERIODS and self._distances[0] - self._distances[-1] >= self.CLOSING
        return closing and detection.distance <= stop_distance
