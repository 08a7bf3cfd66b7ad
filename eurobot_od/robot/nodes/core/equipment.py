"""The robot's equipment besides the bus: its distance sensor (document 4.2.2 Obstacle) and its actuators.

The sensor is read while a goto is under way, as no message reports an obstacle, and the robot stops for what it would
drive into, as the document demands. This is in the core and not in the strategy: a strategy that hangs, or was written
in a hurry, must not drive into an obstacle.
"""

from __future__ import annotations

from functools import partial

from eurobot_od.device.timers import START, Call, Pause, Script, Timer
from eurobot_od.errors import StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core.match_clock import MATCH_OVER, MatchClock
from eurobot_od.robot.nodes.core.settings import CoreSettings, SingleFlow
from eurobot_od.robot.nodes.core.stops import Stops
from eurobot_od.robot.nodes.node import Approach, Detection


class Lookout:
    """Reads the distance sensor, and stops for what the robot would drive into."""

    def __init__(self, core: CoreSettings, stops: Stops) -> None:
        self._core = core
        self._stops = stops
        self._next: Timer | None = None

    def begin(self) -> None:
        """Begin to read the sensor, for a goto that begins now."""
        self._look(Approach(), self._core.now)

    def end(self) -> None:
        """Stop reading the sensor."""
        if self._next is not None:
            self._next.cancel()

    def _look(self, approach: Approach, now: float) -> None:
        """Read the sensor again and again, until the robot would drive into something."""
        self.end()
        sensor, distance = self._core.sensor, self._core.stop_distance
        if sensor is None or not distance:
            return
        detection = sensor.look(now)
        if approach.meets(detection, distance) and detection is not None:
            why = f"{detection.obstacle.name.lower()} ahead"
            self._stops.stop(messages.EmergencyStop(detection.obstacle), Outcome.STOPPED, why)
        else:
            self._next = self._core.at(now + self._core.sensing_period, partial(self._look, approach))

    def read(self) -> Script[Detection | None]:
        """Read the sensor once; None if it sees nothing, or there is none."""
        now: float = yield START
        return None if self._core.sensor is None else self._core.sensor.look(now)


class Tasks:
    """Does one task at a time with the robot's actuators."""

    def __init__(self, core: CoreSettings, clock: MatchClock) -> None:
        self._core = core
        self._clock = clock
        self._running: SingleFlow[int] = SingleFlow(core)

    def begin(self, task: str) -> Call[int]:
        """Begin a task, and end the one before."""
        self.end("replaced by a newer task")
        return self._running.begin(self._do(task))

    def end(self, why: str) -> None:
        """End the task under way."""
        self._running.end(StateError(why))

    def _do(self, task: str) -> Script[int]:
        yield START
        actuators = self._core.actuators
        if actuators is None:
            raise StateError(f"the robot has nothing to do {task} with")
        if self._clock.is_over:
            raise StateError(MATCH_OVER)
        yield Pause(actuators.begin(task))
        return actuators.finish(task)
