"""A node of the robot with calls: what takes time is a flow (see `device.flow`), and its caller gets a `Call`.

Rule of this file: it knows no message. Which flows there are, and what comes of them, the core says.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, ClassVar

from eurobot_od.device.flow import START, Ask, Call, Flow, Result, Script
from eurobot_od.device.storage import Store
from eurobot_od.errors import StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.message import Message, MessageT
from eurobot_od.robot.model.facts import Facts
from eurobot_od.robot.nodes.node import RobotNode

LEAVING = "the core is being switched off"


class CallingNode(RobotNode):
    """A node whose calls are flows; any number of them run at the same time.

    `ONE_AT_A_TIME` are the attributes with a flow of which there is one at a time, None while there is none; those of
    `NOBODYS` are the node's own, and no caller waits for them. `is_leaving` is True once nothing new may begin.
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
        """How many calls have not ended; to go on stopping, or asking for a node that is lost, is nobody's call."""
        return len(self._flows) - sum(getattr(self, name) is not None for name in self.NOBODYS)

    def reset(self) -> None:
        """Give up what is going on, as after power-on."""
        self.end_all("the core was reset")
        super().reset()
        self.is_leaving = self._is_off = False

    def switched_off(self) -> None:
        """End all calls: nobody else would."""
        with self.guard:
            self.is_leaving = self._is_off = True
            self.end_all(LEAVING)

    def check_present(self) -> None:
        """Raise StateError when the node is being switched off."""
        if self.is_leaving:
            raise StateError(LEAVING)

    def begin(self, script: Script[Result]) -> Flow[Result]:
        """Begin a flow; its first step is the next `tick`'s."""

        def send(request: Message | Frame) -> None:
            if isinstance(request, Frame):
                self.put(request)  # an SDO request: not a message, and the device has no TPDO for it
            else:
                self.offer(request)

        def settled(call: Future[Result]) -> None:
            if call.cancelled():  # this is the caller's thread, and the script may be closed on the node's only
                with self.guard:
                    self.soon(flow.drop)

        flow = Flow(script, self._timers, send, self._ended)
        with self.guard:
            self._flows.append(flow)
            self.soon(flow.start)
            if self._is_off:  # no tick will come: it would wait for ever
                self.end(flow, StateError(LEAVING))
        flow.call.add_done_callback(settled)
        return flow

    def begin_ask(self, ask: Ask) -> Call[Any]:
        """Ask, and wait for the answer; the call raises NoAnswer."""

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
        """End a flow by an error, if it has not ended."""
        if flow is not None and flow in self._flows:
            flow.fail(error, self.now)

    def end_all(self, why: str) -> None:
        """End all flows."""
        while self._flows:  # one that ends may begin another, such as the watch over a goto that is given up
            self.end(self._flows[-1], StateError(why))

    # Messages

    def on(self, message: type[MessageT], function: Callable[[MessageT], object]) -> Callable[[], None]:
        """Have a function called with each message of a type; return what ends that.

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
        """Pass a message or an SDO answer to the flow that waits for it."""
        # A copy: a flow that gets its answer may end. All of them hear it, as two may have asked the same.
        for flow in list(self._flows):
            flow.heard(answer, self.now)
