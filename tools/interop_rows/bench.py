"""Our shipped nodes on an in-process bus of their own, in real time, for other programs to talk to."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import count

import can
import canopen

from eurobot_od.bus.live import Live
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import ROLES

PATIENCE = 5.0
"""Longest wait for an answer, in seconds."""

DRIVE = 2
"""Node-ID of the drive."""

SHORT_GOTO = (0x008, bytes(3))
"""A Goto XY that ends within its mapping: the drive answers it with EMCY 0x8210 (CiA 301, Table 26)."""

_numbers = count()


def new_channel() -> str:
    """Return the name of a new in-process bus, without a space, which a candump log could not have."""
    return f"interop{next(_numbers)}"


def open_bus(channel: str) -> can.BusABC:
    """Open an in-process bus."""
    return can.Bus(interface="virtual", channel=channel)


@contextmanager
def robot(*roles: str) -> Iterator[str]:
    """Run our nodes on a new bus; yields its channel."""
    channel = new_channel()
    with ExitStack() as stack:
        for role in roles:
            stack.enter_context(live(role, open_bus(channel)))
        yield channel


def live(role: str, bus: can.BusABC) -> Live:
    """Return one of our nodes, ready to run on a bus."""
    return Live.node(bus, ROLES[role](dialects.load(role, dialects.DEFAULT)))


class PatientNetwork(canopen.Network):
    """canopen's network, whose SDO clients have more time than their 0.3 s."""

    NOTIFIER_CYCLE = 0.01

    def __setitem__(self, node_id: int, node: canopen.RemoteNode | canopen.LocalNode) -> None:
        """Add a node."""
        if isinstance(node, canopen.RemoteNode):
            node.sdo.RESPONSE_TIMEOUT = PATIENCE
        super().__setitem__(node_id, node)


@contextmanager
def stock_network(bus: can.BusABC) -> Iterator[canopen.Network]:
    """Connect canopen's network to a bus."""
    network = PatientNetwork(bus)
    network.connect()
    try:
        yield network
    finally:
        network.disconnect()


class Heard:
    """Collects things that come; `heard(thing)` may be called from any thread."""

    def __init__(self) -> None:
        self.things: list[object] = []
        self._changed = threading.Condition()

    def __call__(self, thing: object) -> None:
        with self._changed:
            self.things.append(thing)
            self._changed.notify_all()

    def wait_for(self, wanted: object) -> bool:
        """Wait until a thing has come, and return whether it came in time."""
        with self._changed:
            return self._changed.wait_for(lambda: wanted in self.things, PATIENCE)


def collect(bus: can.BusABC, done: Callable[[can.Message], bool]) -> list[can.Message]:
    """Return the frames on a bus up to the one that is `done`, or until PATIENCE is over."""
    messages: list[can.Message] = []
    end = time.monotonic() + PATIENCE
    while (left := end - time.monotonic()) > 0 and not (messages and done(messages[-1])):
        message = bus.recv(left)
        messages += [message] if message else []
    return messages
