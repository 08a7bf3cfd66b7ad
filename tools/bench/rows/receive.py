"""Frames on a live bus to listeners, compared with python-can's bare Notifier with an empty listener.

Both wait at an empty queue, receive all frames at once, and are measured until the last one is taken, so neither the
sender nor the start of the reader counts. A program that keeps up with the bus reads a frame right after it was made,
when it is still in the processor's cache: so the same thousand frames come again and again here. The cost of as many
different ones is reported next to it.
"""

from __future__ import annotations

import gc
import random
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from itertools import cycle, islice
from queue import Queue
from typing import Any

import can

from bench.measure import Claim, Contender, Figures, Quantity, Scale, Series, Way, Wrong
from bench.shared import new_bus, new_channel, protocol
from bench.traffic import maker
from eurobot_od.bus.live import Live
from eurobot_od.frame import Frame
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.model.messages import GotoXY

OTHERS = 10_000
"""Listeners on other messages."""

WAITING = 20_000
"""Frames that wait at once."""

DIFFERENT = 1000
"""How many of them differ."""

LOOK = 0.0005
"""Interval between two checks of the queue, in s."""

PATIENCE = 30.0
"""Timeout for an empty queue, in s."""


def received_gotos(number: int) -> list[can.Message]:
    """Return a number of Goto XY frames with random values, as a bus delivers them."""
    binding = protocol().binding(GotoXY)
    chance = random.Random(1)
    channel = new_channel()
    make = maker(binding)
    with new_bus(channel) as sender, new_bus(channel) as receiver:
        for _ in range(number):
            sender.send(can.Message(arbitration_id=binding.cob_id, data=make(chance), is_extended_id=False))
        return [*receiver.queue.queue]


Reader = Callable[[Any], AbstractContextManager[object]]


def emptied(reader: Reader, frames: list[can.Message]) -> Figures:
    """Return the time for one frame of a waiting reader when all frames come at once.

    The garbage collector is off: it would run for messages that wait in thousands, which no program that reads its
    queue has.
    """
    bus = new_bus(new_channel())
    with reader(bus), resting_collector():
        begin = _put_all(bus.queue, frames)
        waiting = bus.queue.queue  # looking at it takes no lock from the reader
        while waiting and time.perf_counter() - begin < PATIENCE:
            time.sleep(LOOK)
        seconds = time.perf_counter() - begin
        left = len(waiting)
    bus.shutdown()
    if left:
        raise Wrong(f"{left} of {len(frames)} frames were still waiting after {PATIENCE:g} s")
    return {Quantity.TIME: seconds / len(frames)}


@contextmanager
def resting_collector() -> Iterator[None]:
    """Switch the garbage collector off meanwhile."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _put_all(queue: Queue[Any], frames: list[can.Message]) -> float:
    """Put all frames into a queue in one piece, and return the time."""
    with queue.mutex:
        queue.queue.extend(frames)
        queue.not_empty.notify()
        return time.perf_counter()


def nothing(_: object, __: float = 0.0) -> None:
    """Take a message and do nothing."""


Register = Callable[[Gatekeeper], object]

KINDS: dict[str, Register] = {
    "queue": lambda keeper: keeper.add_queue(GotoXY),
    "node": lambda keeper: keeper.add_node(lambda: (protocol().cob_id(GotoXY),), nothing, "node"),
    "function": lambda keeper: keeper.add_function(GotoXY, nothing),
}
"""Listeners on Goto XY: a queue gets typed messages, a node frames; a function is called in a thread of its own."""


def live(register: Register, others: int, bus: Any) -> AbstractContextManager[object]:
    """Read with a gatekeeper that has a listener on Goto XY and others on other messages."""
    keeper = Gatekeeper(protocol())
    register(keeper)
    types = [binding.type for binding in protocol().bindings if binding.type is not GotoXY]
    for message_type in islice(cycle(types), others):
        keeper.add_function(message_type, nothing)
    return Live(bus, keeper)


def notifier(bus: Any) -> AbstractContextManager[object]:
    """Read with a bare Notifier."""
    return can.Notifier(bus, [nothing], timeout=0.1)


def check_messages(frames: list[can.Message]) -> None:
    """Check that queue, node and function each get all frames in their form; raises Wrong."""
    keeper = Gatekeeper(protocol())
    queue = keeper.add_queue(GotoXY)
    heard: tuple[list[GotoXY], list[Frame]] = [], []
    keeper.add_function(GotoXY, lambda message, _: heard[0].append(message))
    keeper.add_node(lambda: (protocol().cob_id(GotoXY),), lambda frame, _: heard[1].append(frame), "node")
    emptied(lambda bus: Live(bus, keeper), frames)
    right = [Frame(each.arbitration_id, bytes(each.data)) for each in frames]
    typed = [protocol().decode(*each) for each in right]
    if ([each.message for each in queue.drain()], *heard) != (typed, typed, right):
        raise Wrong("a listener did not get all messages, or others")


@contextmanager
def opened(different: int, scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield the readers; `different` is how many of the waiting frames differ."""
    frames = received_gotos(scale.of(different, 50)) * scale.of(WAITING // different, 1)
    check_messages(frames[:1000])
    readers: dict[str, Reader] = {name: partial(live, register, 1) for name, register in KINDS.items()}
    readers["others"] = partial(live, KINDS["queue"], OTHERS)
    yield {name: partial(emptied, reader, frames) for name, reader in ({"notifier": notifier} | readers).items()}


CLAIMS = (
    Claim("frame to typed message in a queue: bare Notifier", "queue", "notifier", Way.RATIO, 1.7),
    Claim("frame to a node: bare Notifier", "node", "notifier", Way.RATIO, 1.7),
    Claim("frame to a function in its own thread: bare Notifier", "function", "notifier", Way.RATIO),
    Claim(f"{OTHERS} listeners on other messages: 1", "others", "queue", Way.RATIO, 1.1),
)
BACKLOG = Claim(f"a backlog of {WAITING} different frames: bare Notifier", "queue", "notifier", Way.RATIO)
SERIES = (
    Series("receive", "frame to a listener", partial(opened, DIFFERENT), CLAIMS, often=3),
    Series("receive", "a backlog of different frames", partial(opened, WAITING), (BACKLOG,), often=3),
)
