"""The common part of the robot's nodes, which speak the messages of Table 5 of the document.

Besides: nodes with calls, the core's settings and equipment, and what follows the core's commands.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import Future
from enum import Enum, IntEnum
from typing import Any, ClassVar, NamedTuple, Protocol, TypeAlias

from eurobot_od.controller import Reporter
from eurobot_od.device.bound import Application, BoundObject, period, seconds, setting
from eurobot_od.device.node import Node
from eurobot_od.device.objects import Store, out_of_limits
from eurobot_od.device.timers import START, Ask, Call, Flow, Result, Script
from eurobot_od.errors import Cause, DictionaryError, Refused, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import Range, limits
from eurobot_od.od.values import Address, Value
from eurobot_od.pdo.kinds import Message, MessageT
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.model import messages, robot_file
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.model.values import Obstacle, RobotError


class Detection(NamedTuple):
    """Something ahead: what it is, its distance in mm from edge to edge, and its bearing in degrees, left positive."""

    obstacle: Obstacle
    distance: float
    bearing: float


class DistanceSensor(Protocol):
    """A sensor that looks ahead of the robot, real or simulated."""

    def look(self, now: float) -> Detection | None:
        """Measure what is ahead; None if there is nothing."""


class Actuators(Protocol):
    """Arms, grippers, launchers for the robot's tasks, real or simulated."""

    def begin(self, task: str) -> float:
        """Begin a task where the robot stands; return how many seconds it takes. Raises UnknownName."""

    def finish(self, task: str) -> int:
        """Finish a task that was begun; return the result in points, or in pieces of fruit."""


class Approach:
    """Tells whether the robot drives into something, which is near and comes nearer, or just stands in front of it.

    A robot that turns on the spot in front of something, or backs away from it, need not stop.
    """

    def __init__(self) -> None:
        self._distances: deque[float | None] = deque(maxlen=READINGS)

    def meets(self, detection: Detection | None, stop_distance: float) -> bool:
        """Take in a reading; tell whether the robot drives into something nearer than `stop_distance` mm."""
        self._distances.append(None if detection is None else detection.distance)
        if detection is None or detection.distance > stop_distance:
            return False
        # The oldest reading that saw something: over a longer time the change stands out from the noise.
        first = next(each for each in self._distances if each is not None)
        return first - detection.distance >= CLOSING


READINGS = 3
"""Number of readings that are compared: one that misses something does not hide it."""

CLOSING = 12.0
"""The robot drives into what comes nearer by this much, mm, in these readings; less may be the sensor's noise."""


Handlers: TypeAlias = Mapping[type[Message], Callable[[Any, Any], "Message | None"]]
"""The handler of each message: a function of the node and the message that returns the answer, or None."""

Objects: TypeAlias = Mapping[str, BoundObject]
"""What a node's objects are bound to, by their ParameterNames."""


class Loss(Enum):
    """What the core does when a team's own node is lost in a match; `await core.loss()` tells the strategy."""

    STOP = "stop"
    """The goto ends as LOST; the next one begins with the node's check, and is not sent without its answer."""
    GO_ON = "go on"
    """The robot goes on without it. Meanwhile it is asked for; once it answers, it is configured and there again."""


class Component(NamedTuple):
    """A team's own node as a part of the start (document 5.1: a component that deviates blocks the system).

    It has to answer `check` with `answer`; if there is no such message, it has to answer by SDO. In either case its
    fingerprints of the messages are compared with the core's. It answers the start configuration with `confirm`, or is
    not asked to, None.
    """

    check: Message | None = None
    answer: type[Message] | None = None
    confirm: type[Message] | None = None
    loss: Loss = Loss.STOP


NODES: Mapping[str, Component] = {
    "drive": Component(messages.CheckDriveRequest(), messages.CheckDriveResponse),
    "navigation": Component(messages.CheckNaviRequest(), messages.CheckNaviResponse, loss=Loss.GO_ON),
}
"""The two nodes that every core has beside it, in the order in which they are checked (2014 robot: drive first)."""


class RobotNode(Node):
    """A node of the robot; `facts` are those of the robot and its match, by default from the file beside the EDS.

    `FACTS` has the settings that are such facts: they replace the EDS's defaults, but not a stored value, or one in a
    DCF. Raises DictionaryError for one outside the setting's limits.
    """

    CATALOGUE = messages.CATALOGUE
    FACTS: ClassVar[Mapping[str, Callable[[Facts], int]]] = {}

    def __init__(self, dictionary: Dictionary, *, store: Store | None = None, facts: Facts | None = None) -> None:
        self.facts = robot_file.read(robot_file.file_for(dictionary.file)) if facts is None else facts
        self._coordinates: dict[str, tuple[Range, Range]] = {}
        super().__init__(dictionary, store=store)

    def controller(self, report: Reporter | None, clock: Callable[[], float]) -> Gatekeeper:
        """Return a gatekeeper of the sizes in the node's Transmit settings, or else of those of 2014."""
        try:
            sizes: dict[str, Any] = {
                "table_size": self.setting("Transmit.Listener table size"),
                "mailboxes": self.setting("Transmit.Mailboxes"),
                "mailbox_wait": self.setting("Transmit.Mailbox wait") / 1000,
            }
        except DictionaryError:
            sizes = {}
        return Gatekeeper(self.device.protocol, report=report, clock=clock, **sizes)

    def coordinates(self, record: str) -> tuple[Range, Range]:
        """Return the limits of x and y that the EDS gives a record such as `Kalman position`, mm."""
        if record not in self._coordinates:
            dictionary = self.device.dictionary
            found = (dictionary.variable(dictionary.address(f"{record}.{side} position")) for side in "XY")
            x, y = (range_ for each in found if each and (range_ := limits(each)))
            self._coordinates[record] = x, y
        return self._coordinates[record]

    def _application(self, dictionary: Dictionary) -> Application:
        """Return what the application gives the objects, including the facts in the robot's file."""
        given: dict[Address, Value] = {}
        for name, fact in self.FACTS.items():
            address, value = dictionary.address(name), fact(self.facts)
            variable = dictionary.variable(address)
            # Only a DCF has a ParameterValue: somebody has configured this very device, which takes precedence.
            if variable is None or variable.value is not None:
                continue
            if out_of_limits(variable, value):
                what = f"{name} = {value}, as the robot's file says, is not in {variable.min}..{variable.max}"
                raise DictionaryError(dictionary.file, address[0], what)
            given[address] = value
        return super()._application(dictionary)._replace(given=given)

    def check_configuration(self, configuration: messages.StartConfigurationSet) -> None:
        """Raise Refused if a start configuration contradicts itself, and report it by EMCY until a good one comes."""
        wrong = configuration.contradiction()
        if wrong is not None:
            # Refused as a whole: nobody knows which of two contradictory fields is wrong.
            self.raise_error(RobotError.CONFIGURATION_REFUSED, messages.StartConfigurationSet)
            raise Refused(Cause.VALUES, str(wrong))
        self.clear_error(messages.StartConfigurationSet)

    def doubt(self, message: Message) -> int | None:
        """Return the error code for a message that cannot be believed, such as a position of another robot."""
        code, source = super().doubt(message), messages.SOURCES.get(type(message))
        if code is None and source is not None and getattr(message, "source", None) is not source:
            return RobotError.WRONG_SOURCE
        return code


KEEP_PLACE = "Place.Keep place"
"""The object by which the core has the drive keep its place in the next start configuration."""


class KeepPlace(IntEnum):
    """What the object `KEEP_PLACE` says of the next start configuration, and of that one only."""

    BY_MATCH = 0
    """The drive begins at its start place, unless a match is under way in which it has had a goto."""
    KEEP = 1
    START_OVER = 2
    """The drive begins at its start place: the robot has been put there, even if a match is under way."""


START_STATE = "Start state.State"
"""The object by which the drive says whether it has a start configuration, for a core that has begun again."""


class StartState(IntEnum):
    """The values of the object `START_STATE`."""

    UNCONFIGURED = 0
    CONFIGURED = 1
    SHUT_DOWN = 2
    """Configured or not, the drive holds its safe state."""


PLACE_AGE = "Start state.Place age"
"""The object by which the drive says when a navigation position last agreed with its place, ms ago."""


def age(then: float | None, now: float) -> int:
    """Return the value of the object `PLACE_AGE`; `then` is None if it never was."""
    return UNKNOWN if then is None else min(round((now - then) * 1000), UNKNOWN - 1)


TIME_LEFT, NO_MATCH = "Match clock.Time left", 0xFFFF_FFFF
"""The object with the time to the end of the match, ms; its value while no match was started."""


def milliseconds_until(end: float | None, now: float) -> int:
    """Return the value of the object `TIME_LEFT`; `end` is that of the match, None without one."""
    return NO_MATCH if end is None else max(round((end - now) * 1000), 0)


DEVIATION, UNKNOWN = "Arrival deviation.Deviation", 0xFFFF
"""The object by which the drive says how well it knows its place, mm; its value while the place is unknown."""


class Readiness:
    """What has to be there before the first goto: all `nodes` checked, a start configuration confirmed.

    `checked` has the nodes that have answered in the dialect of this core, and have neither booted nor been lost since.
    `configured` tells whether the latest start configuration was confirmed, `confirms` by which messages of a team's.
    """

    def __init__(self, nodes: Iterable[str]) -> None:
        self.nodes = tuple(nodes)
        self.checked: set[str] = set()
        self.confirms: set[type[Message]] = set()
        self.configured = False

    def missing(self, without: Collection[str]) -> str:
        """Say what is missing and what to call, '' if nothing is; nodes to do `without` need no check."""
        unchecked = [f"the {node}" for node in self.nodes if node not in {*self.checked, *without}]
        texts = [f"{' and '.join(unchecked)} must answer a check: call check_nodes()"] if unchecked else []
        texts += [] if self.configured else ["a start configuration must be confirmed: call configure_start()"]
        return "; ".join(texts)


class CoreSettings(RobotNode):
    """The settings of the core, for its scripts; what a master writes counts from the next question on.

    `COMPONENTS` are a team's own nodes that are part of the start, by the names of their EDS files. `readiness` says
    what a goto still needs.
    """

    readiness: Readiness
    _absent: dict[str, Flow[None]]

    COMPONENTS: ClassVar[Mapping[str, Component]] = {}

    check_wait = seconds("Node check.Check wait")
    check_attempts = setting("Node check.Check attempts")
    identity_wait = seconds("Node check.Identity wait")
    trusts_without_sdo = setting("Node check.Nodes without SDO")
    configuration_wait = seconds("Configuration handshake.Configuration confirm wait")
    configuration_transmissions = setting("Configuration handshake.Configuration transmissions")
    confirm_wait = seconds("Goto handshake.Confirm wait")
    transmissions = setting("Goto handshake.Transmissions")
    first_state_request = seconds("Goto handshake.First state request")
    state_request_period = period("Goto handshake.State request period")
    state_answer_wait = seconds("Goto handshake.State answer wait")
    goto_timeout = setting("Goto handshake.Time-out")  # s
    lost_after = setting("Goto handshake.Lost after")
    arrival_distance = setting("Arrival.Position tolerance")  # mm
    arrival_angle = setting("Arrival.Angle tolerance")
    polling_period = period("Position polling.Polling period")
    polling_start_delay = seconds("Position polling.Start delay")
    match_duration = setting("Match.Match duration")  # s
    stop_distance = setting("Obstacle.Stop distance")  # mm
    sensing_period = period("Obstacle.Sensing period")
    stop_period = period("Standstill.Stop period")
    standstill_wait = seconds("Standstill.Standstill wait")
    standstill_distance = setting("Standstill.Standstill distance")  # mm
    standstill_turn = setting("Standstill.Standstill turn")
    displacement = setting("Recovery.Displacement")  # mm
    keeps_place = setting(KEEP_PLACE)

    @property
    def without(self) -> tuple[str, ...]:
        """The nodes that are lost in a match, and that the robot does without until they answer again."""
        return tuple(sorted(self._absent))

    @property
    def parts(self) -> Mapping[str, Component]:
        """All nodes that are part of the start, in the order in which they are checked."""
        return {**NODES, **self.COMPONENTS}

    def confirming(self) -> list[tuple[str, type[Message]]]:
        """Return a team's own nodes that have to confirm the start configuration, and by which message."""
        own = ((node, part.confirm) for node, part in self.COMPONENTS.items() if node not in self._absent)
        return [(node, confirm) for node, confirm in own if confirm is not None]

    def ask_drive(self, request: Message, answer: type[Message]) -> Ask:
        """Ask the drive as often, and wait as long, as the settings of the goto handshake say."""
        return Ask(request, answer, self.state_answer_wait, self.transmissions)


class FollowingNode(RobotNode):
    """A node that the core commands.

    `configuration` is the start configuration, None before the first. `safe` is True after an Emergency Shutdown until
    a new start configuration or an NMT reset.
    """

    configuration: messages.StartConfigurationSet | None = None
    safe = False

    def reset(self) -> None:
        """Forget the start configuration, as after power-on."""
        super().reset()
        self.configuration, self.safe = None, False

    def configure(self, configuration: messages.StartConfigurationSet) -> Message:
        """Take over a start configuration (document 2.3); raises Refused for a contradictory one."""
        self.check_configuration(configuration)
        self.configuration, self.safe = configuration, False
        self.clear_error(messages.EmergencyShutdown)
        return messages.StartConfigurationConfirm()

    def shut_down(self, _: messages.EmergencyShutdown) -> None:
        """Hold the safe state (document 4.2.2 Emergency mushroom)."""
        self.safe = True
        self.raise_error(RobotError.EMERGENCY_SHUTDOWN, messages.EmergencyShutdown)

    COMMANDS: ClassVar[Handlers] = {
        messages.StartConfigurationSet: lambda node, configuration: node.configure(configuration),
        messages.EmergencyShutdown: lambda node, shutdown: node.shut_down(shutdown),
    }


def make(kind: type[Node], dictionary: Dictionary, store: Store | None, facts: Facts | None) -> Node:
    """Make a node of any class; one of the robot's gets the facts."""
    if issubclass(kind, RobotNode):
        return kind(dictionary, store=store, facts=facts)
    return kind(dictionary, store=store)


# A node with calls: what takes time is a flow (see `device.timers`), and its caller gets a `Call`


LEAVING = "the core is being switched off"


class CallingNode(RobotNode):
    """A node whose calls are flows; any number of them run at the same time.

    `ONE_AT_A_TIME` are the attributes for flows of which there is at most one at a time, None while there is none.
    Those in `NOBODYS` are the node's own, and nobody awaits them. `is_leaving` is True once nothing new may begin.
    """

    ONE_AT_A_TIME: ClassVar[tuple[str, ...]] = ()
    NOBODYS: ClassVar[tuple[str, ...]] = ()

    def __init__(self, dictionary: Dictionary, *, store: Store | None = None, facts: Facts | None = None) -> None:
        super().__init__(dictionary, store=store, facts=facts)
        self._flows: list[Flow[Any]] = []
        self._told: defaultdict[type[Message], list[Callable[[Any], object]]] = defaultdict(list)
        self.is_leaving = self._is_off = False

    @property
    def open_calls(self) -> int:
        """The number of calls that have not ended, without the flows that nobody has called for."""
        return len(self._flows) - sum(getattr(self, name) is not None for name in self.NOBODYS)

    def reset(self) -> None:
        """Give up whatever is going on, as after power-on."""
        self.end_all("the core was reset")
        super().reset()
        self.is_leaving = self._is_off = False

    def switched_off(self) -> None:
        """End all calls, as nobody else would."""
        with self.guard:
            self.is_leaving = self._is_off = True
            self.end_all(LEAVING)

    def check_present(self) -> None:
        """Raise StateError if the node is being switched off."""
        if self.is_leaving:
            raise StateError(LEAVING)

    def begin(self, script: Script[Result]) -> Flow[Result]:
        """Begin a flow; its first step is in the next `tick`."""

        def send(request: Message | Frame) -> None:
            if isinstance(request, Frame):
                self.put(request)  # an SDO request is not a message, and has no TPDO
            else:
                self.offer(request)

        def settled(call: Future[Result]) -> None:
            if call.cancelled():  # this is the caller's thread, and only the node's may close the script
                with self.guard:
                    self.soon(flow.go_on)

        flow = Flow(script, self._timers, send, self._ended)
        with self.guard:
            self._flows.append(flow)
            self.soon(flow.go_on)
            if self._is_off:  # no tick will come: it would wait for ever
                self.end(flow, StateError(LEAVING))
        flow.call.add_done_callback(settled)
        return flow

    def begin_ask(self, ask: Ask) -> Call[Any]:
        """Send a request and wait for the answer; the call raises NoAnswer."""

        def script() -> Script[Any]:
            yield START
            return (yield ask)

        return self.begin(script()).call

    def _ended(self, flow: Flow[Any]) -> None:
        self._flows.remove(flow)
        for name in self.ONE_AT_A_TIME:
            if getattr(self, name) is flow:
                setattr(self, name, None)

    def end(self, flow: Flow[Any] | None, error: Exception) -> None:
        """End a flow with an error, unless it has ended."""
        if flow is not None and flow in self._flows:
            flow.fail(error, self.now)

    def end_all(self, why: str) -> None:
        """End all flows."""
        while self._flows:  # one that ends may begin another, such as the watch over a goto that is given up
            self.end(self._flows[-1], StateError(why))

    # Messages

    def on(self, message: type[MessageT], function: Callable[[MessageT], object]) -> Callable[[], None]:
        """Have a function called with each message of a type; return a function that ends that.

        It is called on the core's thread, which waits for it, so it has to be quick. Raises StateError if the core has
        no RPDO for such a message.
        """
        self.device.check_received(message)
        self._told[message].append(function)
        return lambda: self._told[message].remove(function)

    def _act(self, message: Message) -> None:
        super()._act(message)
        self.answered(message)
        # A copy: a function may end its own registration.
        for function in tuple(self._told.get(type(message), ())):
            function(message)

    def answered(self, answer: Message | Frame) -> None:
        """Pass a message or an SDO answer to the flows that wait for it."""
        # A copy: a flow that gets its answer may end. All of them hear it, as two may have asked the same.
        for flow in list(self._flows):
            flow.heard(answer, self.now)
