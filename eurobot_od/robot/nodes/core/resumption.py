"""Continues after a loss: in the next goto, by `recover()`, or after the core's own NMT reset.

A node that was lost may have forgotten everything. So the next goto begins with its recovery: checks, a configuration
if the drive has forgotten its own, and a comparison of the drive's place with the last one seen.
"""

from __future__ import annotations

from eurobot_od.device.timers import START, Call, Pause, Script
from eurobot_od.errors import StateError
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Place
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.losses import Losses
from eurobot_od.robot.nodes.core.match_clock import MatchClock
from eurobot_od.robot.nodes.core.positions import Positions
from eurobot_od.robot.nodes.core.settings import CoreSettings, SingleFlow
from eurobot_od.robot.nodes.core.startup import Startup
from eurobot_od.robot.nodes.core.stops import Stops


class Resumption:
    """Continues after a loss; `is_recalling` tells whether the drive is being asked after an NMT reset.

    `is_unanswered` tells whether it was asked and has not answered at all: then each goto asks it again.
    """

    def __init__(
        self,
        core: CoreSettings,
        stops: Stops,
        clock: MatchClock,
        losses: Losses,
        positions: Positions,
        startup: Startup,
    ) -> None:
        self._core = core
        self._stops = stops
        self._clock = clock
        self._losses = losses
        self._positions = positions
        self._startup = startup
        self._recalling: SingleFlow[None] = SingleFlow(core, is_called=False)
        self.is_unanswered = False

    @property
    def is_recalling(self) -> bool:
        """Whether the drive is being asked what it remembers, after an NMT reset."""
        return self._recalling.call is not None

    @property
    def is_due(self) -> bool:
        """Whether the nodes have to be checked and configured again before the next goto."""
        return bool(self._core.readiness.lost) and self._core.configuration is not None

    def begin_recall(self) -> None:
        """Begin to ask the drive what it remembers of the start and of the match."""
        self.is_unanswered = True
        self._recalling.begin(self._recall())

    def end_recall(self) -> None:
        """End that question: a start configuration replaces what the drive remembers."""
        self.is_unanswered = False
        self._recalling.end(StateError("replaced by a newer start configuration"))

    def begin(self) -> Call[messages.KalmanPositionResponse]:
        """Begin to recover everything (see `Core.recover`)."""
        self._startup.running.end(StateError("replaced by a recovery"))
        return self._startup.running.begin(self._recover_all(self._startup.end_watch()))

    def before_goto(self) -> Script[None]:
        """Check the nodes again after one was lost, and make sure that the drive knows its place."""
        configuration = self._core.configuration
        if not self.is_due or configuration is None:
            return
        self._positions.is_astray = self._startup.is_recovering = True
        try:
            yield from self._recover_nodes(configuration)
        finally:
            self._startup.is_recovering = False
        self._core.readiness.lost = ""
        yield from self._find_place(configuration, self._positions.place)
        if self._losses.is_in_match:
            self._clock.tell_drive()  # a drive that has booted has forgotten it

    def _recover_nodes(self, configuration: messages.StartConfigurationSet) -> Script[None]:
        core = self._core
        yield from flows.check_nodes(core, core.without)
        here = yield from flows.drive_position(core)
        # Once configured, a drive assumes its start place until the navigation reports another: one that still knows
        # its place is not configured, or told to keep it.
        if here.x is None:
            yield from self._startup.configure(configuration)
        elif not core.readiness.configured:
            yield from flows.keep_place(core)
            yield from self._startup.configure(configuration)
        else:
            yield from flows.tell_others(core, configuration)

    def _find_place(
        self, configuration: messages.StartConfigurationSet, there: Place | None
    ) -> Script[messages.KalmanPositionResponse]:
        positions = self._positions
        start = self._core.facts.start(configuration.team_colour)
        displacement = 0.0 if positions.has_jumped else float(self._core.displacement)
        try:
            here = yield from flows.find_place(self._core, there, start, displacement)
        except flows.PlaceLost:
            self._core.readiness.lost = flows.LOST_PLACE  # so that the next goto tries again
            raise
        positions.is_astray = positions.has_jumped = False
        return here

    def _recover_all(self, watched: bool) -> Script[messages.KalmanPositionResponse]:
        yield from self.until_recalled()
        if self._core.configuration is None:
            yield from self._recall()
        configuration = self._core.configuration
        if configuration is None:
            raise StateError(flows.NOTHING_TO_GO_BACK_TO)
        # Kept, although the configuration forgets it: the robot has not been moved to its start.
        there = self._positions.place
        yield from self._startup.configure_all(configuration, watched, in_place=True)
        self._positions.place = there
        self._positions.is_astray = True
        return (yield from self._find_place(configuration, there))

    def until_recalled(self) -> Script[None]:
        """Wait for the questions that follow an NMT reset."""
        yield START
        while self.is_recalling:
            yield Pause(self._core.state_request_period)

    def _recall(self) -> Script[None]:
        """Restore what the drive remembers of the start and of the match; the next goto begins with a recovery."""
        memory = yield from flows.recall(self._core)
        self.is_unanswered = False
        if memory is None:
            return
        self._core.configuration, self._positions.place = memory.configuration, memory.place
        self._core.readiness.lost = "the core has begun again"
        self._stops.recall(memory.shut_down)
        if memory.time_left is not None:
            self._losses.heard_navigation()
            self._clock.recall(memory.time_left)
            if not self._clock.is_over:
                yield from self._losses.ask_navigation()  # a match goes on without one
