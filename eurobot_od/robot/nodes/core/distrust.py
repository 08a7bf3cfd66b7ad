"""Stops the robot after frames that the core has not asked for: commands in its name, confirms, places that jump."""

from __future__ import annotations

from eurobot_od.errors import RemoteError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core.settings import CoreSettings
from eurobot_od.robot.nodes.core.stops import Stops


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
