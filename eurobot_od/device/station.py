"""A node with its controller: passing frames between node and queue, and the reaction to failures of the node.

There is no bus and no thread in this module: `bus/live` and `bus/simulated` use stations. The node's `guard` is held
while the node works and until its frames are queued, so that frames are sent in the node's order.

A group of nodes may share one connection to the bus.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
from math import inf

from eurobot_od.controller import Event, Report, Reporter, Stay
from eurobot_od.device.node import Node
from eurobot_od.errors import NodeFailed
from eurobot_od.frame import Frame
from eurobot_od.od.standard import ErrorCode
from eurobot_od.support.connections import Backoff
from eurobot_od.support.texts import amount, described

NODE_LOG = logging.getLogger("eurobot_od.node")


class OnError(Enum):
    """Reaction to a node's exception, after it was stopped and an EMCY was sent."""

    END = "end"
    RESTART = "restart"


class Station:
    """A node with its own controller, to which more listeners may be added.

    `plan.soonest` is earlier than the last `next_wakeup` if the node has planned something since. An exception of the
    node is reported like a listener's, followed by the reaction `on_error`. Without `on_error`, as in a simulation, the
    exception is raised unless a frame has caused it. `failure` is the reason why the node has ended, or None;
    `last_failure` is kept after a restart, with the number of failures. With `is_logged`, each kind of failure is
    logged once, with its traceback.
    """

    def __init__(
        self,
        node: Node,
        *,
        report: Reporter | None = None,
        clock: Callable[[], float] = time.perf_counter,
        on_error: OnError | None = None,
        is_logged: bool = True,
    ) -> None:
        self.node = node
        self.plan = node.device.plan
        self.controller = node.controller(report, clock)
        self.failure: NodeFailed | None = None
        self.last_failure: NodeFailed | None = None
        self._logged = set[str]()
        self._is_logged = is_logged
        self._on_error = on_error
        self._backoff = Backoff()
        self._restarts_at: float | None = None
        """Time of the restart of a failed node; None while it runs."""
        self._identifiers = node.device.identifiers
        node.alarm = lambda text: self.controller.report(Report(Event.NODE_ALARM, node.name, text, node.now))
        # A function, because a master may change the identifiers.
        self._listener = self.controller.add_node(lambda: self._identifiers, self._received, node.name)

    def start(self, now: float) -> None:
        """Switch the node on."""
        self._do(self.node.start, now)

    def tick(self, now: float) -> None:
        """Run the node's due actions, or restart it after a failure."""
        with self.node.guard:
            restarts = self._restarts_at is not None and now >= self._restarts_at
            if restarts:
                self._restarts_at = None
            self._do(self.node.restart if restarts else self.node.tick, now)

    def requested(self, cob_id: int, now: float) -> None:
        """Pass a remote frame to the node; listeners do not receive them."""
        self._do(lambda now: self.node.requested(cob_id, now), now)

    @property
    def next_wakeup(self) -> float:
        """Time for the next `tick`, in the node's time; infinite if nothing is planned."""
        with self.node.guard:
            wakeup = self.node.next_wakeup if self._restarts_at is None else self._restarts_at
            # The caller sleeps until then, and has to be woken only by an earlier plan.
            self.plan.soonest = wakeup
            return wakeup

    def bus_error(self, code: ErrorCode, now: float) -> None:
        """Pass an error of the CAN controller to the node."""
        with self.node.guard:
            self.node.bus_error(code, now)

    def bus_lost(self, now: float) -> None:
        """Notify the node that the bus is lost."""
        with self.node.guard:
            # The SDO transfer is dropped, so its answers are not needed any more.
            self.controller.queue.withdraw(self.node.device.sdo_service.answers)
            self._do(self.node.bus_lost, now)

    def _do(self, step: Callable[[float], list[Frame]], now: float) -> None:
        """Run a step of the node, unless it has failed, and queue its frames."""
        with self.node.guard:
            if self._restarts_at is not None:
                return
            try:
                frames = step(now)
            except (Exception, SystemExit) as error:
                if self._on_error is None:
                    raise
                frames = self._fail(error, now)
            self._submit(frames, now)

    def _fail(self, error: BaseException, now: float) -> list[Frame]:
        """Stop a node after an exception, report it, and end the node or plan its restart."""
        frames = self.node.failed(error, now)  # first, because these include stop messages
        text = described(error)
        if self._is_logged and text not in self._logged:  # a restarted node may fail in the same way for hours
            self._logged.add(text)
            NODE_LOG.error("%s has failed", self.node.name, exc_info=error)
        if self._on_error is OnError.END:
            self.failure = NodeFailed(f"{self.node.name} has failed and ended: {text}")
            self.node.switched_off()
            pause, what = inf, "it has ended"  # inf: as if it waited for ever
        else:
            pause = self._backoff.pause(now)
            what = f"it is restarted in {pause:g} s"
        self._restarts_at = now + pause
        self._listener.failed += 1
        often = amount(self._listener.failed, "time")
        self.last_failure = NodeFailed(f"{self.node.name} has failed {often}, last with {text}")
        self.controller.report(Report(Event.NODE_FAILED, self.node.name, f"{text}; {what}", now, error))
        return frames

    def _received(self, frame: Frame, now: float) -> None:
        with self.node.guard:
            if self._restarts_at is not None:
                return
            try:  # `_do`, inlined for speed
                frames = self.node.receive(frame, now)
            except (Exception, SystemExit) as error:
                if self._on_error is None:
                    raise
                frames = self._fail(error, now)
            if frames:
                self._submit(frames, now)
            if self.node.device.identifiers is not self._identifiers:  # a master has changed them with this frame
                self._identifiers = self.node.device.identifiers
                self.controller.reroute(self.node.device.protocol)

    def _submit(self, frames: list[Frame], now: float) -> None:
        queue, device = self.controller.queue, self.node.device
        if frames and frames[0].cob_id == device.sdo_service.answers:
            # A client with a new request no longer waits for the earlier answer; otherwise answers would pile up.
            queue.withdraw(device.sdo_service.answers)
        for frame in frames:
            stay = device.stay(frame)
            # Stop messages are repeated, so one of a kind in the queue is enough.
            if not (stay is Stay.LASTING and frame.cob_id in device.pdos.always_sent and queue.holds(frame)):
                queue.submit(frame, now, stay)


# A group: each node receives the frames of the others, as on a bus


MOST_AT_ONCE = 1000
"""Most frames among the nodes at one time, in case two nodes answer each other without end."""


class NodeGroup:
    """Nodes that receive frames from outside and from each other."""

    def __init__(self, nodes: Sequence[Node]) -> None:
        self.nodes = tuple(nodes)
        self._heard_by: dict[int, list[Node]] = {}
        self._identifiers: dict[Node, list[int]] = {}
        self._wakeups: dict[Node, float] = {}
        self._waiting: deque[tuple[Node | None, Frame]] = deque()
        self._now = 0.0

    @property
    def next_wakeup(self) -> float:
        """Time for the next `tick`, infinite if nothing is planned."""
        return self._now if self._waiting else min(self._wakeups.values(), default=inf)

    def start(self, now: float) -> list[Frame]:
        """Switch all nodes on."""
        for node in self.nodes:
            self._take(node, node.start(now))
        return self._settled(now)

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        """Handle a frame, which may be a remote frame, and return the frames to send."""
        self._waiting.append((None, frame))
        return self._settled(now)

    def bus_lost(self, now: float) -> None:
        """Notify the nodes that the bus is lost, and drop waiting frames."""
        self._waiting.clear()
        for node in self.nodes:
            self._take(node, node.bus_lost(now))

    def bus_back(self, now: float) -> list[Frame]:
        """Note that the bus is back, and return the frames to send."""
        for node in self.nodes:
            node.bus_error(ErrorCode.BUS_LOST, now)
            self._take(node)
        return self.tick(now)

    def tick(self, now: float) -> list[Frame]:
        """Do all due actions, and return the frames to send."""
        for node in [node for node, due in self._wakeups.items() if due <= now]:
            self._take(node, node.tick(now))
        return self._settled(now)

    def _settled(self, now: float) -> list[Frame]:
        """Deliver all waiting frames and the nodes' answers; return the frames to send."""
        self._now = now
        sent = list[Frame]()
        for _ in range(MOST_AT_ONCE):
            if not self._waiting:
                break
            sender, frame = self._waiting.popleft()
            if sender is not None:
                sent.append(frame)
            for node in tuple(self._heard_by.get(frame.cob_id, ())):
                if node is not sender:
                    answers = node.requested(frame.cob_id, now) if frame.is_remote else node.receive(frame, now)
                    self._take(node, answers)
        return sent

    def _take(self, node: Node, frames: Sequence[Frame] = ()) -> None:
        """Queue a node's frames, and update its wake-up time and identifiers."""
        self._waiting.extend((node, frame) for frame in frames)
        self._wakeups[node] = node.next_wakeup
        identifiers = node.device.identifiers
        before = self._identifiers.get(node)
        if identifiers is not before:  # the device replaces the whole list
            for each in before or ():
                self._heard_by[each].remove(node)
            for each in identifiers:
                self._heard_by.setdefault(each, []).append(node)
            self._identifiers[node] = identifiers
