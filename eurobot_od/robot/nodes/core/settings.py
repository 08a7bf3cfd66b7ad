"""What the core's parts share: its settings, its flows with their calls, and the conditions for a goto.

What takes time is a flow (see `device.timers`), and its caller gets a `Call`. Any number of flows run at the same time.
A `SingleFlow` holds the one flow of its kind.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from typing import Any, ClassVar, Generic

from eurobot_od.device.bound import period, seconds, setting
from eurobot_od.device.objects import Store
from eurobot_od.device.timers import START, Ask, Call, Flow, Result, Script
from eurobot_od.errors import StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message, MessageT
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.robot_file import Facts
from eurobot_od.robot.nodes.node import KEEP_PLACE, NODES, Actuators, Component, DistanceSensor, RobotNode

LEAVING = "the core is being switched off"


class CallingNode(RobotNode):
    """A node whose calls are flows; `is_leaving` is True once no new call may begin."""

    def __init__(self, dictionary: Dictionary, *, store: Store | None = None, facts: Facts | None = None) -> None:
        super().__init__(dictionary, store=store, facts=facts)
        self._flows: dict[Flow[Any], bool] = {}  # the running flows, and whether each is a call
        self._told: defaultdict[type[Message], list[Callable[[Any], object]]] = defaultdict(list)
        self.is_leaving = self._is_off = False

    @property
    def open_calls(self) -> int:
        """The number of calls that have not ended, without flows that the core began itself."""
        return sum(self._flows.values())

    def reset(self) -> None:
        """End all flows, as after power-on."""
        self.end_all("the core was reset")
        super().reset()
        self.is_leaving = self._is_off = False

    def switched_off(self) -> None:
        """End all calls, which no tick would end any more."""
        with self.guard:
            self.is_leaving = self._is_off = True
            self.end_all(LEAVING)

    def check_present(self) -> None:
        """Check that the node is not being switched off; raises StateError."""
        if self.is_leaving:
            raise StateError(LEAVING)

    def begin(self, script: Script[Result], *, is_called: bool = True) -> Flow[Result]:
        """Begin a flow; its first step is in the next `tick`. If not `is_called`, it is no open call."""

        def send(request: Message | Frame) -> None:
            if isinstance(request, Frame):
                self.put(request)  # an SDO request is not a message, and has no TPDO
            else:
                self.offer(request)

        def settled(call: Future[Result]) -> None:
            if call.cancelled():  # this is the caller's thread, and only the node's may close the script
                with self.guard:
                    self.soon(flow.go_on)

        flow = Flow(script, self._timers, send, self._flows.__delitem__)
        with self.guard:
            self._flows[flow] = is_called
            self.soon(flow.go_on)
            if self._is_off:  # without another tick it would wait for ever
                self.end(flow, StateError(LEAVING))
        flow.call.add_done_callback(settled)
        return flow

    def begin_ask(self, ask: Ask) -> Call[Any]:
        """Send a request and wait for the answer; the call raises NoAnswer."""

        def script() -> Script[Any]:
            yield START
            return (yield ask)

        return self.begin(script()).call

    def is_running(self, flow: Flow[Any] | None) -> bool:
        """Return whether a flow has begun and not ended."""
        return flow in self._flows

    def end(self, flow: Flow[Any] | None, error: Exception) -> None:
        """End a flow with an error, unless it has ended."""
        if flow is not None and flow in self._flows:
            flow.fail(error, self.now)

    def end_all(self, why: str) -> None:
        """End all flows."""
        while self._flows:  # a flow that ends may begin another, such as the watch after an ended goto
            self.end(next(reversed(self._flows)), StateError(why))

    # Messages

    def on(self, message: type[MessageT], function: Callable[[MessageT], object]) -> Callable[[], None]:
        """Call a function with each message of a type from now on; return a function that ends that.

        It is called on the core's thread, which waits for it, so it has to be quick. Raises StateError if the core has
        no RPDO for such a message.
        """
        self.device.pdo_service.check_received(message)
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
        # A copy: a flow that gets its answer may end. All flows get it, as two may have asked the same.
        for flow in list(self._flows):
            flow.heard(answer, self.now)


class SingleFlow(Generic[Result]):
    """The place for the one flow of its kind in a node; `is_called` tells whether it counts as an open call."""

    def __init__(self, node: CallingNode, *, is_called: bool = True) -> None:
        self._node = node
        self._is_called = is_called
        self._flow: Flow[Result] | None = None

    @property
    def call(self) -> Call[Result] | None:
        """The call of the flow that runs, None if none does."""
        return self._flow.call if self._flow is not None and self._node.is_running(self._flow) else None

    def begin(self, script: Script[Result]) -> Call[Result]:
        """Begin a flow; the one before has to have ended."""
        self._flow = self._node.begin(script, is_called=self._is_called)
        return self._flow.call

    def end(self, error: Exception) -> None:
        """End the flow with an error, unless none runs."""
        self._node.end(self._flow, error)


class Readiness:
    """The conditions for the first goto: all `nodes` checked, a start configuration confirmed.

    `checked` has the nodes that have answered in the dialect of this core, and have neither booted nor been lost since.
    `configured` tells whether the latest start configuration was confirmed, `confirms` by which messages of a team's
    own nodes. `absent` are the nodes lost in a match without which the robot goes on, each with the flow that asks for
    it. `lost` is the reason why the next goto begins with a recovery, '' if it does not.
    """

    def __init__(self, nodes: Iterable[str]) -> None:
        self.nodes = tuple(nodes)
        self.checked: set[str] = set()
        self.confirms: set[type[Message]] = set()
        self.configured = False
        self.absent: dict[str, Flow[None]] = {}
        self.lost = ""

    def missing(self) -> str:
        """Return what is missing and which call provides it, '' if nothing is."""
        unchecked = [f"the {node}" for node in self.nodes if node not in {*self.checked, *self.absent}]
        texts = [f"{' and '.join(unchecked)} must answer a check: call check_nodes()"] if unchecked else []
        texts += [] if self.configured else ["a start configuration must be confirmed: call configure_start()"]
        return "; ".join(texts)


class CoreSettings(CallingNode):
    """What the core's parts and scripts share: its settings, and the conditions for a goto.

    A setting that a master writes applies from the next question on. `COMPONENTS` are a team's own nodes that are part
    of the start, by the names of their EDS files. `configuration` is the start configuration, None before the first was
    confirmed; `readiness` has the conditions for a goto. `sensor` and `actuators` are the robot's equipment besides the
    bus, None if it has none.
    """

    readiness: Readiness
    configuration: messages.StartConfigurationSet | None
    sensor: DistanceSensor | None
    actuators: Actuators | None

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
        """The nodes lost in a match, without which the robot goes on until they answer again."""
        return tuple(sorted(self.readiness.absent))

    @property
    def parts(self) -> Mapping[str, Component]:
        """All nodes that are part of the start, in the order in which they are checked."""
        return {**NODES, **self.COMPONENTS}

    def confirming(self) -> list[tuple[str, type[Message]]]:
        """Return a team's own nodes that have to confirm the start configuration, and by which message."""
        own = ((node, part.confirm) for node, part in self.COMPONENTS.items() if node not in self.readiness.absent)
        return [(node, confirm) for node, confirm in own if confirm is not None]

    def ask_drive(self, request: Message, answer: type[Message]) -> Ask:
        """Return the question to the drive, with number and wait from the settings of the goto handshake."""
        return Ask(request, answer, self.state_answer_wait, self.transmissions)
