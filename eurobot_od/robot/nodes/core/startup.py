"""Sets the start configuration (document 2.3, 5.1).

The confirm of a start configuration after an Emergency Shutdown is answered with the shutdown: it belongs to an older
configuration, and has ended the safe state.
"""

from __future__ import annotations

from typing import Any

from eurobot_od.device.timers import START, Call, Script
from eurobot_od.errors import StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.distrust import Distrust
from eurobot_od.robot.nodes.core.losses import Losses
from eurobot_od.robot.nodes.core.positions import Positions
from eurobot_od.robot.nodes.core.settings import CoreSettings, SingleFlow
from eurobot_od.robot.nodes.core.stops import Stops
from eurobot_od.robot.nodes.node import KEEP_PLACE, KeepPlace


class Startup:
    """Sets the start configuration, one at a time: `running` is the flow that sets or recovers it.

    `is_recovering` tells whether a goto that waits for lost nodes sets it meanwhile. `tells_deviation` is whether the
    drive may report how well it knows its place: it did when it was last asked, or has not been asked since.
    """

    def __init__(
        self, core: CoreSettings, stops: Stops, losses: Losses, positions: Positions, distrust: Distrust
    ) -> None:
        self._core = core
        self._stops = stops
        self._losses = losses
        self._positions = positions
        self._distrust = distrust
        self.running: SingleFlow[Any] = SingleFlow(core)
        self.is_recovering = False
        self.tells_deviation = True
        self._asked_until = 0.0

    def begin(self, configuration: messages.StartConfigurationSet, in_place: bool = False) -> Call[float]:
        """Begin to configure the start, and stop a goto under way.

        The robot is at its start place, or `in_place`: where the drive knows that it is.
        """
        # The older one first: when it fails, its stop goes on.
        self.running.end(StateError("replaced by a newer start configuration"))
        if self._stops.is_commanding:
            self._stops.stop(messages.StopDrive(), Outcome.STOPPED, "a new start configuration")
        return self.running.begin(self.configure_all(configuration, self.end_watch(), in_place))

    def end_watch(self) -> bool:
        """End the watch over a stop because of a new configuration; return whether there was one."""
        watched = self._stops.configuration_begins()
        self._positions.sightings.clear()
        return watched

    def configure_all(
        self, configuration: messages.StartConfigurationSet, watched: bool, in_place: bool = False
    ) -> Script[float]:
        """Configure the start, `in_place`: where the drive knows that it is.

        If that fails, a stop that was `watched` until then is watched again.
        """
        try:
            if in_place:
                yield from flows.keep_place(self._core)
            elif self._losses.is_in_match or "drive" in self._core.readiness.checked:
                # The caller has put the robot at its start place; in a match the drive would keep its own.
                yield from flows.tell_drive(self._core, KEEP_PLACE, KeepPlace.START_OVER, 1)
            seconds = yield from self.configure(configuration)
        except BaseException:  # nothing has changed
            self._stops.configuration_failed(watched)
            raise
        # A caller who configures the start has put the robot at its start place, wherever it was seen before.
        positions = self._positions
        positions.place = None
        positions.is_astray = False
        positions.has_jumped = in_place and positions.has_jumped
        return seconds

    def configure(self, configuration: messages.StartConfigurationSet) -> Script[float]:
        """Set a start configuration until it is confirmed and all nodes are checked; return how many seconds it took.

        Positions are asked for from then on.
        """
        core = self._core
        readiness = self._core.readiness
        asked: float = yield START
        before = readiness.lost
        readiness.lost = ""  # a node that is lost from here on may not have received it
        try:
            confirmed = yield from flows.configure(core, configuration)
        except BaseException:
            readiness.lost = readiness.lost or before
            raise
        finally:  # confirms may come late, and two nodes confirm
            self._asked_until = core.now + core.configuration_wait * core.configuration_transmissions
        core.configuration = configuration
        self.tells_deviation = True
        self._stops.configured()
        self._positions.ask_from(confirmed + core.polling_start_delay, configuration)
        return confirmed - asked

    def confirmed(self) -> messages.EmergencyShutdown | None:
        """Process a confirm; return the message that answers it, if the core has not asked for it."""
        is_running = self.running.call is not None
        if self._stops.shut_down and not is_running and self._stops.is_shutdown_ours:
            # A start configuration from before a shutdown, confirmed after it, has ended the safe state.
            return messages.EmergencyShutdown()
        is_asked = is_running or self.is_recovering or self._core.now <= self._asked_until
        if self._core.configuration is not None and not is_asked:
            self._stops.shut_down = False  # the one before this core began
            self._distrust.stop("somebody else has configured the start")
        return None
