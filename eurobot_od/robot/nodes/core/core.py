"""The core node: checks the nodes, configures the start, polls positions, sends the drive to places, stops it.

Theory of operation. Each task that takes time is a flow (see `device.timers`): `check_nodes`, `configure_start`,
`goto`, `position` and the stops each begin one and return its call at once. The flow takes its first step in the next
`tick`, and each further one when its answer comes or its wait ends. So any number of flows run at the same time without
threads of their own: a strategy may ask for the position while its goto is under way. There is only one goto, one start
configuration and one watched stop at a time, though; a newer one ends the older one with an error thrown into its flow.

Calls come from any thread. Under the node's guard no frame is received and no other call begins, so a test and its
consequence must be under the guard together. Otherwise an Emergency Shutdown from another thread could come in between,
and the goto would drive after it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from eurobot_od.device.bound import Application, BoundObject
from eurobot_od.device.objects import Store
from eurobot_od.device.timers import START, Ask, Call, Script
from eurobot_od.errors import NoAnswer, StateError, UnknownName
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message, MessageT
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import Barriers, Direction, Obstacle, Outcome, Route, Source, TeamColour
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.distrust import Distrust
from eurobot_od.robot.nodes.core.equipment import Lookout, Tasks
from eurobot_od.robot.nodes.core.flows import GotoReport, Standstill
from eurobot_od.robot.nodes.core.gotos import Gotos, Orders
from eurobot_od.robot.nodes.core.losses import Losses
from eurobot_od.robot.nodes.core.match_clock import MATCH_OVER, MatchClock
from eurobot_od.robot.nodes.core.positions import Positions
from eurobot_od.robot.nodes.core.resumption import Resumption
from eurobot_od.robot.nodes.core.settings import LEAVING, CoreSettings, Readiness
from eurobot_od.robot.nodes.core.startup import Startup
from eurobot_od.robot.nodes.core.stops import Stops
from eurobot_od.robot.nodes.estimate import Seen, Sighting
from eurobot_od.robot.nodes.node import (
    DEVIATION,
    PLACE_AGE,
    START_STATE,
    TIME_LEFT,
    UNKNOWN,
    Actuators,
    Detection,
    DistanceSensor,
    Handlers,
    Objects,
    StartState,
    age,
    milliseconds_until,
)
from eurobot_od.support.texts import one_line

CALLS: Mapping[type[Message], str] = {
    messages.GotoXY: "goto",
    messages.StartConfigurationSet: "configure_start",
    messages.StopDrive: "stop",
    messages.EmergencyStop: "emergency_stop",
    messages.EmergencyShutdown: "emergency_shutdown",
}
"""The messages that only a call may send, because it watches their results."""

ANSWER_WAIT = 0.5
"""Default wait for the answer to a message of a team's own, in seconds."""


class Core(CoreSettings):
    """The core node (document 2.1 to 2.3, 4.2.2, 5).

    `observe` is called with each goto and each task, and its call, when it begins; `at_match_end` when a match is over
    and a stop has been sent; each of `told` with each text of the strategy.

    Args:
        dictionary: the core's EDS
        sensor: the robot's distance sensor, None without one
        actuators: what the robot does tasks with, None without them
        store: keeps the settings over a restart
        facts: the robot and its match; default: the file beside the EDS
    """

    def __init__(
        self,
        dictionary: Dictionary,
        sensor: DistanceSensor | None = None,
        actuators: Actuators | None = None,
        *,
        store: Store | None = None,
        facts: Facts | None = None,
    ) -> None:
        super().__init__(dictionary, store=store, facts=facts)
        self.sensor = sensor
        self.actuators = actuators
        self.observe: Callable[[messages.GotoXY | str, Call[Any]], None] = lambda _what, _call: None
        self.at_match_end: Callable[[], object] = lambda: None
        self.told: list[Callable[[str], object]] = []
        self._has_begun = False
        self._forget()
        for _, confirm in self.confirming():
            self.on(confirm, lambda heard: self.readiness.confirms.add(type(heard)))

    def _forget(self) -> None:
        self.configuration = None
        self.readiness = Readiness(self.parts)
        self._stops = stops = Stops(self)
        self._clock = clock = MatchClock(self, self._match_ended)
        self._distrust = distrust = Distrust(self, stops)
        self._losses = losses = Losses(self, stops, clock)
        self._positions = positions = Positions(self, stops, losses, distrust)
        self._startup = startup = Startup(self, stops, losses, positions, distrust)
        self._resumption = Resumption(self, stops, clock, losses, positions, startup)
        self._lookout = Lookout(self, stops)
        self._tasks = Tasks(self, clock)
        self._gotos = Gotos(self, stops, clock, startup, self._resumption, self._lookout, distrust)
        self._orders = Orders(self, clock, startup, self._resumption, self.goto)

    def reset(self) -> None:
        """End all calls and forget everything, as after power-on; a goto under way is stopped.

        After an NMT reset the drive is asked for what it remembers of the match; the next goto begins with a recovery.
        """
        driving = self.is_commanding
        super().reset()
        self._forget()
        if driving:
            self._stops.halt(messages.StopDrive())
        if self._has_begun:  # by NMT and not by power-on: no strategy is going to start this core up
            self._resumption.begin_recall()
        self._has_begun = True

    @property
    def is_commanding(self) -> bool:
        """Whether a goto of this core is under way."""
        return self._stops.is_commanding

    @property
    def positions(self) -> dict[type[messages.PositionResponse], Sighting]:
        """The last sightings by response type."""
        return self._positions.sightings

    @property
    def shut_down(self) -> bool:
        """Whether an Emergency Shutdown came after the last start configuration."""
        return self._stops.shut_down

    @property
    def match_over(self) -> bool:
        """Whether a match has ended and no other one was started."""
        return self._clock.is_over

    @property
    def time_left(self) -> float:
        """The time in s until the core ends the match, infinite if there is none."""
        return self._clock.time_left

    def last_seen(self, whom: Source) -> Seen | None:
        """Return where a robot was last seen; None if it never was.

        Unlike `positions` it leaves out unknown places, and those that the robot cannot have driven to (see
        `sightings`). Raises UnknownName for what is no Source.
        """
        if not isinstance(whom, Source):
            raise UnknownName("robot", whom, [f"Source.{each.name}" for each in Source])
        return self._positions.tracks[whom].last

    # Calls

    def check_nodes(self) -> Call[dict[str, float]]:
        """Check the drive, then the navigation; the result is the seconds that each took to answer (document 2.3).

        NoAnswer names the node check that nobody answered: the start is then blocked (document 5.1). NodeMismatch
        names a node that does not read frames as the core does. A team's own nodes come after the two.
        """
        return self.begin(flows.check_nodes(self)).call

    def configure_start(
        self,
        team_colour: TeamColour,
        enemies: int = 0,
        confederates: int = 0,
        enemy_1_diameter: int = 0,
        enemy_2_diameter: int = 0,
    ) -> Call[float]:
        """Set the start configuration (document 2.3).

        The confirms of drive and navigation have the same identifier: one of them is enough, and both nodes are then
        checked once more. The drive starts over from the team's start place, so a goto under way is stopped. Position
        polling starts after the `Start delay` setting.

        Args:
            team_colour: our team
            enemies: number of enemies, 0 to 2
            confederates: number of confederates, 0 or 1
            enemy_1_diameter: in cm, 0 to 50; 0 if it is not there
            enemy_2_diameter: in cm, 0 to 50; 0 if it is not there

        Returns:
            The time until its confirm, in s.

        Raises:
            FieldError: a value is out of range; nothing was sent
            NoAnswer: no node confirms it, or one does not answer its check
            StateError: a newer start configuration or an Emergency Shutdown came before the confirm, or the core is
                being switched off
        """
        configuration = messages.StartConfigurationSet(
            team_colour, enemies, confederates, enemy_1_diameter, enemy_2_diameter
        )
        with self.guard:
            self.check_present()
            self.device.pdo_service.transmit(configuration)  # raises for a wrong one, and sends nothing yet
            if wrong := configuration.contradiction():
                raise wrong
            self._resumption.end_recall()
            return self._startup.begin(configuration)

    def recall(self) -> Call[flows.Memory | None]:
        """Ask the drive what it remembers of a match; None if it was not configured since it booted, or has no SDO.

        A core that has begun again asks this before it configures anything. Raises NoAnswer.
        """
        with self.guard:
            self.check_present()
            return self.begin(flows.recall(self)).call

    def recover(self) -> Call[messages.KalmanPositionResponse]:
        """Recover after an Emergency Shutdown, or after a restart of this core; return where the robot is.

        A core that remembers nothing asks the drive for the start configuration, the place and the match clock. Then
        the nodes are checked and configured. A drive that knows its place is told to keep it (object 0x210A); any other
        one begins at its start place, until the navigation has seen it twice. The match ends at its time.

        Raises the errors of `check_nodes` and `configure_start`; StateError if neither core nor drive remember a start
        configuration, or if the drive is not where it was last seen and the navigation does not see it there.
        """
        with self.guard:
            self.check_present()
            return self._resumption.begin()

    def goto(
        self,
        x: int,
        y: int,
        angle: int,
        speed: int,
        barriers: Barriers = Barriers(0),  # noqa: B008 (immutable)
        direction: Direction = Direction.FORWARD,
        route: Route = Route.PLANNED,
        timeout: float | None = None,
    ) -> Call[GotoReport]:
        """Send the drive to a place, and wait for the end (document 2.1).

        A goto that is under way ends as REPLACED. The drive is stopped unless the goto arrived, was replaced, or was
        ended by the drive; also if the call is cancelled. If a node has been lost since the last goto, the drive is
        stopped, and both nodes are checked and configured again first. That takes until they answer, at most all
        attempts of the checks and the configuration.

        Args:
            x: place in mm
            y: place in mm
            angle: heading in degrees, 0 to 359
            speed: in percent of the maximum speed
            barriers: what the robot must not or should not cross
            direction: forward or backward (2014 robot)
            route: planned round the barriers, or direct (2014 robot)
            timeout: maximum time from the first transmission on, in s, after which it ends as TIMED_OUT; None: the
                setting `Time-out`

        Raises:
            FieldError: a value is out of range; nothing was sent
            StateError: the nodes are not checked, no start configuration is confirmed, after an Emergency Shutdown,
                after the match, when the core is being switched off, and if the drive has lost its place
            NoAnswer: the drive does not confirm or report its state, or a lost node does not answer its check
            NotStanding: the robot does not stand before lost nodes are configured
        """
        goto = messages.GotoXY(x, y, angle, speed, barriers, direction, route)
        with self.guard:
            self.check_present()
            self.device.pdo_service.transmit(goto)  # raises for a wrong one, and sends nothing yet
            is_late = self.match_over
            call = self._gotos.begin(goto, timeout)
        if not is_late:
            self.observe(goto, call)
        return call

    def position(self) -> Call[messages.KalmanPositionResponse]:
        """Ask the drive for the filtered position of our robot (document 4.2.2 Position); raises NoAnswer."""
        return self.begin_ask(self.ask_drive(messages.KalmanPositionRequest(), messages.KalmanPositionResponse))

    def loss(self) -> Call[str]:
        """Wait for the loss of a team's own node, or its reboot; the result is the node's name (see `COMPONENTS`)."""
        with self.guard:
            self.check_present()
            return self.begin(self._losses.await_loss()).call

    def obstacle(self) -> Call[Detection | None]:
        """Read the distance sensor: what it sees ahead; None if it sees nothing, or there is no sensor."""
        return self.begin(self._lookout.read()).call

    def act(self, task: str) -> Call[int]:
        """Do a task where the robot stands; the result is in points, or in pieces of fruit.

        Raises StateError without actuators for it, and if a newer task, an Emergency Shutdown or the end of the match
        comes before it is done; UnknownName.
        """
        with self.guard:
            self.check_present()
            call = self._tasks.begin(task)
        self.observe(task, call)
        return call

    def stop(self) -> Call[Standstill]:
        """Brake and end the goto (document 2.1).

        The stop is sent now, whether or not the call is awaited. The result comes once the robot is seen to stand;
        NotStanding if that takes longer than the setting `Standstill wait`: then Emergency Shutdown is sent until it
        does. StateError if a goto or a start configuration comes before. Several stops in a row are watched as one.
        """
        return self._stops.stop(messages.StopDrive())

    def emergency_stop(self, obstacle: Obstacle) -> Call[Standstill]:
        """Brake because of an obstacle (document 4.2.2 Obstacle); result and errors are those of `stop`."""
        return self._stops.stop(messages.EmergencyStop(obstacle))

    def emergency_shutdown(self) -> Call[Standstill]:
        """Bring all nodes into their safe state (document 4.2.2 Emergency mushroom); see `stop`."""
        with self.guard:  # a confirm between the two would end the safe state again
            why = "emergency shutdown before the start configuration was confirmed"
            self._startup.running.end(StateError(why))
            self._tasks.end("emergency shutdown")
            return self._stops.stop(messages.EmergencyShutdown())

    def send(self, message: Message) -> None:
        """Send a message of the robot's table, such as a team's own, without waiting.

        Raises StateError if the core has no TPDO for it, if it is a message that a call sends and watches, such as a
        goto, or if the core is being switched off; FieldError.
        """
        with self.guard:
            self._check_free(message)
            super().send(message)

    def say(self, words: object) -> None:
        """Show a text to the spectators: a line of the match's timeline, and a caption on its field.

        It is not sent on the bus.
        """
        for each in self.told:
            each(one_line(str(words)))

    def ask(self, request: Message, answer: type[MessageT], timeout: float = ANSWER_WAIT) -> Call[MessageT]:
        """Send a message, and wait for one that answers it.

        Args:
            request: the message
            answer: class of the answer
            timeout: maximum time for the answer, in s

        Raises:
            NoAnswer: no answer came in time
            StateError: the core has no RPDO for the answer; also the errors of `send`
        """
        with self.guard:
            self._check_free(request)
            self.device.pdo_service.transmit(request)  # raises for a wrong one, and sends nothing yet
            self.device.pdo_service.check_received(answer)
            return self.begin_ask(Ask(request, answer, timeout, 1))

    def hear(
        self, message: type[MessageT], where: Callable[[MessageT], object] | None = None, timeout: float = ANSWER_WAIT
    ) -> Call[MessageT]:
        """Wait for the next message of a type; nothing is sent.

        Args:
            message: the message's class
            where: returns whether a message is the wanted one; default: any is
            timeout: maximum time for the message, in s

        Raises:
            NoAnswer: no such message came in time
            StateError: the core has no RPDO for such a message; also the errors of `where`
        """
        with self.guard:
            self.device.pdo_service.check_received(message)
            return self.begin(self._hear(message, where, timeout)).call

    def _hear(
        self, message: type[MessageT], where: Callable[[MessageT], object] | None, timeout: float
    ) -> Script[MessageT]:
        yield START
        end = self.now + timeout
        try:
            while True:
                heard: MessageT = yield Ask(None, message, max(end - self.now, 0.0), 1)
                if where is None or where(heard):
                    return heard
        except NoAnswer:  # which has only the time left after the last message
            raise NoAnswer(
                "", message.__name__ if where is None else f"{message.__name__} as wanted", 1, timeout
            ) from None

    def start_match(self, duration: float | None = None) -> None:
        """Start the match: after `duration` seconds the drive is stopped, and gotos are no longer sent.

        None takes the setting `Match duration`.
        """
        seconds = self.match_duration if duration is None else duration
        with self.guard:
            self._losses.heard_navigation()
            self._clock.start(seconds)

    def leave(self) -> Call[Standstill] | None:
        """Stop the drive before the node is switched off, if it was ever sent anywhere; see `stop`.

        From now on gotos and start configurations are refused: they would end the watch over the stop.
        """
        with self.guard:
            self.is_leaving = True
            self._startup.running.end(StateError(LEAVING))
            return None if self._stops.latest is None else self.stop()

    def _check_free(self, message: Message) -> None:
        """Check that a message is not left to a call of its own, which watches the result; raises StateError."""
        self.check_present()
        if call := CALLS.get(type(message)):
            raise StateError(f"{type(message).__name__} is sent by core.{call}(), which watches its result")

    # Events

    def heartbeat_lost(self, node_id: int) -> None:
        """Stop the drive if its heartbeat is missing, or that of the navigation before the match."""
        self._losses.silent(node_id)

    def booted(self, node_id: int) -> None:
        """Configure a node that has booted before the next goto; a drive that has booted has lost its goto."""
        self._losses.booted(node_id)

    def halted(self) -> None:
        """Stop the drive when a master takes the node out of OPERATIONAL: it cannot ask for its state any more."""
        if self.is_commanding:
            self._stops.stop(messages.StopDrive(), Outcome.STOPPED, "the core was taken out of OPERATIONAL")

    def cut_off(self) -> None:
        """Stop the drive as soon as the bus is back; the next goto begins with a recovery."""
        self._stops.lose("the bus was lost")

    def _match_ended(self) -> None:
        self._losses.match_ended()
        self._tasks.end(MATCH_OVER)
        self._stops.stop(messages.StopDrive(), Outcome.STOPPED, MATCH_OVER)
        self.at_match_end()

    def _application(self, dictionary: Dictionary) -> Application:
        """Return the application's functions for the objects.

        The core also watches for frames that others send in its name.
        """
        return super()._application(dictionary)._replace(overheard=lambda frame: self._distrust.overheard(frame))

    def _told_position(self, position: messages.PositionResponse) -> None:
        self._positions.heard(position)

    def _told_state(self, state: messages.GotoStateResponse) -> None:
        self._positions.heard_state(state)
        if flows.is_driving(state):
            self._stops.stop_late_goto()

    def _start_state(self) -> StartState:
        if self.shut_down:
            return StartState.SHUT_DOWN
        return StartState.UNCONFIGURED if self.configuration is None else StartState.CONFIGURED

    FACTS: ClassVar[Mapping[str, Callable[[Facts], int]]] = {"Match.Match duration": lambda facts: facts.duration}
    OBJECTS: ClassVar[Objects] = {
        "Goto XY": BoundObject(write=messages.GotoXY),
        "Start configuration": BoundObject(write=messages.StartConfigurationSet),
        "Goto state": BoundObject(write=messages.GotoStateResponse),
        **{each.record: BoundObject(write=each.response) for each in messages.POSITIONS},
    }
    MEASURED: ClassVar[Mapping[str, Callable[[Any], int]]] = {
        DEVIATION: lambda core: UNKNOWN if core._gotos.deviation is None else core._gotos.deviation,
        TIME_LEFT: lambda core: milliseconds_until(core._clock.end, core.now),
        START_STATE: lambda core: core._start_state(),
        PLACE_AGE: lambda core: age(core._positions.seen_at, core.now),
    }
    HANDLERS: ClassVar[Handlers] = {
        messages.GotoXY: lambda core, goto: core._orders.goto(goto, core.shut_down),
        messages.StartConfigurationSet: lambda core, configuration: core._orders.start(configuration),
        messages.GotoConfirm: lambda core, _: core._gotos.confirmed(),
        messages.GotoStateResponse: _told_state,
        messages.StartConfigurationConfirm: lambda core, _: core._startup.confirmed(),
        **dict.fromkeys((each.response for each in messages.POSITIONS), _told_position),
    }
