"""Stops the robot after frames that the core has not asked for: commands in its name, confirms, places that jump."""

from __future__ import annotations

import math

from eurobot_od.errors import RemoteError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core.settings import CoreSettings
from eurobot_od.robot.nodes.core.stops import Stops
from eurobot_od.robot.nodes.estimate import TOP_SPEED

DOUBLED = 0.02
"""Longest time between two copies of a frame that a bus may deliver twice, in s."""

LARGEST_DEVIATIONS = 180.0
"""Largest distance in mm between two right positions because of their deviations: a drive stands if its deviation is
over 90 mm, and each of the two may be off by that much.
"""


class GotoConfirms:
    """The confirms of one goto: at most as many as the goto was sent, each `wait` s from `started`."""

    def __init__(self, started: float, wait: float, transmissions: int) -> None:
        self._started = started
        self._wait = wait
        self._transmissions = transmissions
        self._confirmed: float | None = None
        self._sent = self._heard = 0

    def is_asked_for(self, now: float) -> bool:
        """Count a confirm; return whether the goto explains it."""
        if self._confirmed is None:  # from now on the goto is not sent again
            self._sent = min(1 + int((now - self._started) / self._wait), self._transmissions)
            self._confirmed = now
            return True
        doubled, self._confirmed = now - self._confirmed <= DOUBLED, now
        self._heard += not doubled
        return self._heard < self._sent


def jumps(before: Place, after: Place, seconds: float) -> bool:
    """Return whether no robot can have driven from one place to the other in that time; False for unknown places."""
    if before[0] is None or before[1] is None or after[0] is None or after[1] is None:
        return False
    way = math.hypot(after[0] - before[0], after[1] - before[1])
    return way > TOP_SPEED * seconds + LARGEST_DEVIATIONS


class Distrust:
    """Stops the robot for frames that the core has not asked for, with one warning for each reason."""

    def __init__(self, core: CoreSettings, stops: Stops) -> None:
        self._core = core
        self._stops = stops
        self._warned: set[str] = set()

    def stop(self, why: str) -> None:
        """Stop for a frame that the core has not asked for; the next goto begins with a recovery."""
        if why not in self._warned:
            self._warned.add(why)
            self._core.alarm(why)
        readiness = self._core.readiness
        readiness.configured = readiness.configured and self._core.configuration is None
        self._stops.lose(why)

    def overheard(self, frame: Frame) -> None:
        """Process a frame that another node has sent under an identifier of the core's."""
        protocol = self._core.device.protocol
        try:
            message = protocol.decode(*frame)
        except RemoteError:  # the heartbeat of a second core, or a message that is damaged
            self.stop("another node uses the core's identifiers; switch it off")
            return
        self._commanded(message, f"somebody else sent {protocol.name(type(message))}")

    def _commanded(self, message: Message, why: str) -> None:
        if isinstance(message, messages.EmergencyShutdown):
            self._stops.stop(message, Outcome.STOPPED, why)
        elif isinstance(message, messages.StopDrive | messages.EmergencyStop) and self._stops.is_commanding:
            self._stops.stop(messages.StopDrive(), Outcome.STOPPED, why)
        elif isinstance(message, messages.GotoXY | messages.StartConfigurationSet):
            self.stop(why)
