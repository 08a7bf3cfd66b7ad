"""The core node: checks the nodes, configures the start, polls positions, sends the drive to places, stops it.

Theory of operation. What takes time is a flow (see `device.flow`): `check_nodes`, `configure_start`, `goto` and
`position` each begin one and return its call at once, before anything is sent. The flow takes its first step with the
next `tick`, and every further one when its answer, or the end of its wait, comes. So any number of them run at the
same time without a thread of their own: a strategy asks for the position while its goto is under way. There is one
goto and one start configuration at a time, though; a newer one ends the older by an error thrown into its flow.

Stops are not flows. The call puts the stop among the frames to send, and only then ends the goto. Its lower identifier
lets it overtake a goto that still waits in a mailbox: the drive then hears the stop first and the goto after it, and
confirms the goto. That is why a confirm after a stop is answered with the stop again, and the confirm of a start
configuration after a shutdown with the shutdown.

Calls come from any thread. Under the node's guard nothing is received and no other call begins; so what a call tests
and what it starts because of that stand under the guard together. Otherwise an Emergency Shutdown of another thread
could come between the two, and the goto would drive after it.
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import Any, ClassVar, NamedTuple, get_args

from eurobot_od.device.bound import BoundObject
from eurobot_od.device.flow import START, Ask, Call, Flow, Pause, Result, Script
from eurobot_od.device.storage import Store
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.message import Message
from eurobot_od.robot import messages
from eurobot_od.robot.nodes.identity import REVISION, Channel, DialectMismatch, revision_in
from eurobot_od.robot.nodes.node import Handlers, Objects, RobotNode
from eurobot_od.robot.values import FAULT_OUTCOME, Barriers, Direction, Obstacle, Outcome, Route, Source, TeamColour

NODE_CHECKS: tuple[tuple[str, Message, type[Message]], ...] = (
    ("drive", messages.CheckDriveRequest(), messages.CheckDriveResponse),
    ("navigation", messages.CheckNaviRequest(), messages.CheckNaviResponse),
)
"""The nodes in the order in which they are checked (2014 robot: drive first)."""

GOTO_SETTINGS = ("Goto handshake.Confirm wait", "Goto handshake.Transmissions")
STATE_SETTINGS = ("Goto handshake.State answer wait", "Goto handshake.Transmissions")
"""The settings by which the drive is sent to a place, and asked for its state and its position: how long to wait, how
often to ask."""


POLLED_POSITIONS: tuple[tuple[Message, str, Source], ...] = (
    (messages.NaviPositionRequest(), "Position polling.Navi offset", Source.INTERNAL),
    (messages.KalmanPositionRequest(), "Position polling.Kalman offset", Source.INTERNAL),
    (messages.ConfederatePositionRequest(), "Position polling.Confederate offset", Source.CONFEDERATE),
    (messages.Enemy1PositionRequest(), "Position polling.Enemy 1 offset", Source.ENEMY_1),
    (messages.Enemy2PositionRequest(), "Position polling.Enemy 2 offset", Source.ENEMY_2),
)
"""What is asked for periodically: the request, the setting with its offset, and whose position it is."""


class GotoReport(NamedTuple):
    """What became of a goto; times in seconds from its first transmission, `confirmed` None if it never was."""

    goto: messages.GotoXY
    outcome: Outcome
    confirmed: float | None
    ended: float


class Sighting(NamedTuple):
    """A position as it was received, and when, in seconds of the node's time."""

    position: messages.PositionResponse
    time: float


class _Ended(Exception):
    """Thrown into a goto's flow to end it; the flow makes its report of it."""

    def __init__(self, outcome: Outcome) -> None:
        self.outcome = outcome


class Core(RobotNode):
    """The core node (document 2.1 to 2.3, 4.2.2, 5).

    `positions` are the last sightings by response type; `configuration` the start configuration, None before the
    first was confirmed; `shut_down` is True after an Emergency Shutdown until a new start configuration.
    """

    def __init__(self, dictionary: Dictionary, *, store: Store | None = None) -> None:
        super().__init__(dictionary, store=store)
        self._flows: list[Flow[Any]] = []
        self._forget()

    def _forget(self) -> None:
        self.configuration: messages.StartConfigurationSet | None = None
        self.positions: dict[type[messages.PositionResponse], Sighting] = {}
        self.shut_down = False
        self._driving: Flow[GotoReport] | None = None
        self._configuring: Flow[float] | None = None
        self._stopped: messages.StopMessage | None = None
        self._polling = 0

    def reset(self) -> None:
        """Give up what is going on and forget everything, as after power-on."""
        for flow in list(self._flows):  # a copy: a flow that ends takes itself off the list
            flow.fail(StateError("the core was reset"), self.now)
        super().reset()
        self._forget()

    # Calls

    def check_nodes(self) -> Call[dict[str, float]]:
        """Check drive, then navigation; the result is the seconds each took to answer (document 2.3).

        NoAnswer names the node check that nobody answered: the start is blocked then (document 5.1). DialectMismatch
        names a node that is loaded from the EDS of another dialect.
        """
        return self._begin(self._check_nodes()).call

    def configure_start(
        self,
        team_colour: TeamColour,
        enemies: int = 0,
        confederates: int = 0,
        enemy_1_diameter: int = 0,
        enemy_2_diameter: int = 0,
    ) -> Call[float]:
        """Set the start configuration; the result is the seconds until its confirm (document 2.3).

        Diameters in cm, 0..50, and 0 for an enemy that is not there. The confirms of drive and navigation have one
        identifier: one of them is enough. Position polling starts after the `Start delay` setting. Raises FieldError,
        NoAnswer; StateError if a newer start configuration or an Emergency Shutdown comes before the confirm.
        """
        configuration = messages.StartConfigurationSet(
            team_colour, enemies, confederates, enemy_1_diameter, enemy_2_diameter
        )
        with self.guard:
            self.device.transmit(configuration)  # raises what is wrong with it, and sends nothing yet
            if wrong := configuration.contradiction():
                raise wrong
            self._end(self._configuring, StateError("replaced by a newer start configuration"))
            self._configuring = self._begin(self._configure(configuration))
            return self._configuring.call

    def goto(
        self,
        x: int,
        y: int,
        angle: int,
        speed: int,
        barriers: Barriers = Barriers(0),  # noqa: B008 (immutable)
        direction: Direction = Direction.FORWARD,
        route: Route = Route.PLANNED,
    ) -> Call[GotoReport]:
        """Send the drive to x, y (mm) and angle (degrees) at `speed` percent, and wait for its end (document 2.1).

        A goto that is under way ends as REPLACED. Raises FieldError before anything is sent, StateError after an
        Emergency Shutdown, NoAnswer if the drive does not confirm or does not say its state.
        """
        goto = messages.GotoXY(x, y, angle, speed, barriers, direction, route)
        with self.guard:
            self.device.transmit(goto)  # raises what is wrong with it, and sends nothing yet
            if self.shut_down:
                raise StateError("no goto after an emergency shutdown: configure the start first")
            self._end(self._driving, _Ended(Outcome.REPLACED))
            self._driving, self._stopped = self._begin(self._goto(goto)), None
            return self._driving.call

    def position(self) -> Call[messages.KalmanPositionResponse]:
        """Ask the drive for the filtered position of our robot (document 4.2.2 Position); raises NoAnswer."""
        return self._begin(self._position()).call

    def stop(self) -> None:
        """Brake and forget the goto (document 2.1)."""
        self._stop(messages.StopDrive())

    def emergency_stop(self, obstacle: Obstacle) -> None:
        """Brake because of an obstacle (document 4.2.2 Obstacle)."""
        self._stop(messages.EmergencyStop(obstacle))

    def emergency_shutdown(self) -> None:
        """Bring all nodes into their safe state (document 4.2.2 Emergency mushroom)."""
        with self.guard:  # a confirm between the two would end the safe state again
            self._stop(messages.EmergencyShutdown())
            why = "emergency shutdown before the start configuration was confirmed"
            self._end(self._configuring, StateError(why))

    def _begin(self, script: Script[Result]) -> Flow[Result]:
        flow = Flow(script, self._timers, self._put, self._ended)
        with self.guard:
            self._flows.append(flow)
            self.soon(flow.start)
        return flow

    def _put(self, request: Message | Frame) -> None:
        if isinstance(request, Frame):
            self.put(request)  # an SDO request: not a message, and the device has no TPDO for it
        else:
            self.offer(request)

    def _ended(self, flow: Flow[Any]) -> None:
        self._flows.remove(flow)
        if flow is self._driving:
            self._driving = None
        if flow is self._configuring:
            self._configuring = None

    def _stop(self, stop: messages.StopMessage) -> None:
        with self.guard:
            self.send(stop)
            self._stopped = stop
            self.shut_down = self.shut_down or isinstance(stop, messages.EmergencyShutdown)
            self._end(self._driving, _Ended(Outcome.STOPPED))

    def _end(self, flow: Flow[Any] | None, error: Exception) -> None:
        if flow is not None:
            flow.fail(error, self.now)

    # Flows

    def _asking(self, request: Message, answer: type[Message], wait: str, attempts: str) -> Ask:
        """Ask by two settings, read when they are needed: what a master wrote holds from the next question on."""
        return Ask(request, answer, self.seconds(wait), self.setting(attempts))

    def _check_nodes(self) -> Script[dict[str, float]]:
        took = {}
        yield START
        for node, request, answer in NODE_CHECKS:
            asked = self.now
            yield self._asking(request, answer, "Node check.Check wait", "Node check.Check attempts")
            took[node] = self.now - asked
        for node in took:
            yield from self._compare(node)
        return took

    def _compare(self, node: str) -> Script[None]:
        """Make sure that a node speaks our dialect, if it can be asked."""
        channel = Channel.to(node, self.device)
        if channel is None:
            return
        with suppress(NoAnswer):  # the 2014 robot's own nodes know no SDO
            answer = yield Ask(channel.ask(), channel.answer, self.seconds("Node check.Identity wait"), 1)
            theirs, ours = revision_in(answer), self.device.number(REVISION)
            if theirs is not None and theirs != ours:
                raise DialectMismatch(node, channel.node_id, theirs, ours)

    def _configure(self, configuration: messages.StartConfigurationSet) -> Script[float]:
        asked: float = yield START
        yield self._asking(
            configuration,
            messages.StartConfigurationConfirm,
            "Configuration handshake.Configuration confirm wait",
            "Configuration handshake.Configuration transmissions",
        )
        self.configuration, self.shut_down = configuration, False
        self._start_polling(configuration, self.now + self.seconds("Position polling.Start delay"))
        return self.now - asked

    def _goto(self, goto: messages.GotoXY) -> Script[GotoReport]:
        started, confirmed = self.now, None
        try:
            started = yield START
            yield self._asking(goto, messages.GotoConfirm, *GOTO_SETTINGS)
            confirmed = self.now - started
            outcome = yield from self._until_ended()
        except _Ended as end:
            outcome = end.outcome
        return GotoReport(goto, outcome, confirmed, self.now - started)

    def _until_ended(self) -> Script[Outcome]:
        """Poll the drive's state until the goto has ended (document 2.1 State Request)."""
        yield Pause(self.seconds("Goto handshake.First state request"))
        while True:
            state = yield self._asking(messages.GotoStateRequest(), messages.GotoStateResponse, *STATE_SETTINGS)
            if state.time == 0:
                return Outcome.ARRIVED
            if state.time in FAULT_OUTCOME:
                return FAULT_OUTCOME[state.time]
            yield Pause(self.seconds("Goto handshake.State request period"))

    def _position(self) -> Script[messages.KalmanPositionResponse]:
        yield START
        answer: messages.KalmanPositionResponse = yield self._asking(
            messages.KalmanPositionRequest(), messages.KalmanPositionResponse, *STATE_SETTINGS
        )
        return answer

    # Position polling

    def _start_polling(self, configuration: messages.StartConfigurationSet, start: float) -> None:
        """Ask for positions from `start` on; each request keeps to its own times, however late the node runs."""
        self._polling += 1  # the requests of an earlier series end by themselves
        for request, offset, whom in POLLED_POSITIONS:
            if configuration.includes(whom):
                self.at(start + self.seconds(offset), partial(self._poll, request, self._polling))

    def _poll(self, request: Message, series: int, due: float) -> None:
        if series == self._polling:
            self.offer(request)
            again = due + self.seconds("Position polling.Polling period")
            self.at(again, partial(self._poll, request, series))

    # Messages

    def _act(self, message: Message) -> None:
        super()._act(message)
        self.answered(message)

    def answered(self, answer: Message | Frame) -> None:
        """Pass a message or an SDO answer to the flow that waits for it."""
        for flow in list(self._flows):
            flow.heard(answer, self.now)

    def _confirmed(self, _: messages.GotoConfirm) -> Message | None:
        """Stop again if a goto is confirmed after the stop: the more urgent stop can overtake it on the bus."""
        return self._stopped

    def _configured(self, _: messages.StartConfigurationConfirm) -> Message | None:
        """Shut down again if a start configuration from before the shutdown is confirmed after it."""
        return messages.EmergencyShutdown() if self.shut_down and self._configuring is None else None

    def heartbeat_lost(self, node_id: int) -> None:
        """Stop the drive: a robot with a silent node does not go on."""
        with suppress(StateError):  # a master has taken the TPDO away
            self._stop(messages.StopDrive())

    def _saw(self, position: messages.PositionResponse) -> None:
        self.positions[type(position)] = Sighting(position, self.now)

    OBJECTS: ClassVar[Objects] = {
        "Goto state": BoundObject(write=messages.GotoStateResponse),
        "Navi position": BoundObject(write=messages.NaviPositionResponse),
        "Kalman position": BoundObject(write=messages.KalmanPositionResponse),
        "Enemy 1 position": BoundObject(write=messages.Enemy1PositionResponse),
        "Enemy 2 position": BoundObject(write=messages.Enemy2PositionResponse),
        "Confederate position": BoundObject(write=messages.ConfederatePositionResponse),
    }
    HANDLERS: ClassVar[Handlers] = {
        messages.GotoConfirm: _confirmed,
        messages.StartConfigurationConfirm: _configured,
        **dict.fromkeys(get_args(messages.PositionResponse), _saw),
    }
