"""Stops the robot until it is seen to stand, and ends its goto (document 2.1, 4.2.2 Obstacle and Emergency mushroom).

The robot stands whenever no core commands it. A goto needs no stop only if it arrived, was replaced, or was ended by
the drive itself. If anything else ends it (no answer, a cancelled call, a lost node), Stop Drive is sent. A stop is
sent at once, ends the goto, and is repeated by a flow of its own until the robot is seen to stand; if it is not,
Emergency Shutdown is sent until it is. Only a goto or a start configuration ends that watch: a goto when it is really
sent, and a configuration that fails resumes it.

A stop has a lower identifier, so it overtakes a goto that still waits in a mailbox: the drive then receives the stop
first and the goto after it. And a drive that was away may begin a goto that ended long ago. That is why a confirm, or
the state of a goto under way, is answered with a stop when there is no goto any more.
"""

from __future__ import annotations

from math import inf

from eurobot_od.device.timers import Call, Script, shielded
from eurobot_od.errors import StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.values import Outcome, RobotError
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.flows import GotoReport, Standstill
from eurobot_od.robot.nodes.core.settings import CoreSettings, SingleFlow


class GotoEnded(Exception):
    """Thrown into a goto's flow to end it; the flow turns it into its report."""

    def __init__(self, outcome: Outcome, why: str = "") -> None:
        self.end = flows.End(outcome, why)


class Stops:
    """The stops of a core, and the `goto` that is under way.

    `latest` is the stop for a drive that moves without a goto; None if it was never sent anywhere. `shut_down` tells
    whether it is an Emergency Shutdown, and `is_shutdown_ours` whether this core has sent that.
    """

    def __init__(self, core: CoreSettings) -> None:
        self._core = core
        self.goto: SingleFlow[GotoReport] = SingleFlow(core)
        self.latest: messages.StopMessage | None = None
        self.shut_down = self.is_shutdown_ours = False
        self._watch: SingleFlow[Standstill] = SingleFlow(core)
        self._endless_watch: SingleFlow[Standstill] = SingleFlow(core, is_called=False)

    @property
    def is_commanding(self) -> bool:
        """Whether a goto is under way."""
        return self.goto.call is not None

    def stop(self, stop: messages.StopMessage, outcome: Outcome = Outcome.STOPPED, why: str = "") -> Call[Standstill]:
        """Send a stop, end the goto that is under way, and watch until the robot stands."""
        with self._core.guard:
            call = self.halt(stop)
            self.goto.end(GotoEnded(outcome, why))
            return call

    def halt(self, stop: messages.StopMessage) -> Call[Standstill]:
        """Send a stop, and watch until the robot stands."""
        with self._core.guard:
            # Offered, not sent: even if the stop may not leave now, the watch over it must begin.
            self._core.offer(stop)
            self.shut_down = self.shut_down or isinstance(stop, messages.EmergencyShutdown)
            # After a shutdown nothing less is repeated: a drive that has missed it would not hold its safe state.
            self.latest = messages.EmergencyShutdown() if self.shut_down else stop
            self.is_shutdown_ours = self.shut_down
            call = self._watch.call
            if call is None:
                self._endless_watch.end(StateError("watched anew"))
                call = self._watch.begin(self._see_standing(self._core.standstill_wait))
            return shielded(call)  # cancelling the call does not end the stop

    def lose(self, why: str) -> None:
        """Begin the next goto with a recovery, and stop a drive that was ever sent anywhere."""
        self._core.readiness.lost = why
        if self.latest is not None:
            self.stop(messages.StopDrive(), Outcome.LOST, why)

    def stop_late_goto(self) -> None:
        """Stop again if the drive carries out a goto that has ended, because the stop overtook it or it came late."""
        if not self.is_commanding and self.latest is not None:
            self.halt(self.latest)

    def recall(self, shut_down: bool) -> None:
        """Restore from the drive that a core before this one sent it somewhere, or shut it down."""
        self.shut_down = shut_down
        self.latest = messages.EmergencyShutdown() if shut_down else messages.StopDrive()

    # The watch

    def _see_standing(self, patience: float = inf) -> Script[Standstill]:
        """Repeat the latest stop until the robot is seen to stand, or for `patience` seconds."""
        standstill = yield from flows.until_standing(
            # `is None`, as a message without data is false.
            self._core,
            lambda: messages.StopDrive() if self.latest is None else self.latest,
            patience,
        )
        if standstill is None:
            error = flows.NotStanding(patience)
            self._core.alarm(str(error))
            # From here on it is an emergency: Emergency Shutdown until it stands, and no goto before a recovery.
            self._core.raise_error(RobotError.NOT_STANDING, Standstill)
            self.shut_down = True
            self._keep_stopping()
            self.goto.end(error)  # one that waits for lost nodes
            raise error
        self._core.clear_error(Standstill)
        return standstill

    def _keep_stopping(self) -> None:
        """Send Emergency Shutdown until the robot is seen to stand, however long that takes."""
        self.latest = messages.EmergencyShutdown()
        self._core.offer(self.latest)
        if self._endless_watch.call is None:
            self._endless_watch.begin(self._see_standing())

    def goto_begins(self) -> None:
        """End the watch over a stop because of a goto that is sent now."""
        self._watch.end(StateError("a new goto came before the robot was seen to stand"))

    def configuration_begins(self) -> bool:
        """End the watch over a stop because of a new start configuration; return whether there was one."""
        watched = self._watch.call is not None
        self._watch.end(StateError("a new start configuration came before the robot was seen to stand"))
        self._endless_watch.end(StateError("a new start configuration"))
        return watched

    def configuration_failed(self, watched: bool) -> None:
        """Resume the watch that the start configuration has ended: the robot still has to stop."""
        if self.shut_down:
            self._keep_stopping()
        elif watched:
            self.halt(messages.StopDrive())

    def configured(self) -> None:
        """End the safe state, so that a late goto is answered with a plain stop again."""
        self.shut_down = False
        self.latest = None if self.latest is None else messages.StopDrive()
        self._core.clear_error(Standstill)
