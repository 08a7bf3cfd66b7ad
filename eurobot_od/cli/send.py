"""Send one message on a CAN bus, and wait for an answer if asked to.

Rule of this file: the whole command line is checked against the EDS files before a bus is opened.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from eurobot_od import durations
from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.errors import BusError, FieldError, LocalError, UnknownName

if TYPE_CHECKING:
    import can

    from eurobot_od.frame import Frame
    from eurobot_od.pdo.binding import Binding
    from eurobot_od.pdo.message import Message
    from eurobot_od.pdo.protocol import Protocol

PATIENCE = 1.0
"""Seconds that the driver has to take a frame."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("message", help="a message by its name, such as 'Goto XY'")
    parser.add_argument("fields", nargs="*", metavar="FIELD=VALUE", help="such as x=1500 barriers=fire-1:forced")
    parser.add_argument("--expect", metavar="MESSAGE", help="wait for this message and print it")
    parser.add_argument("--within", default="1 s", metavar="TIME", help="how long to wait for it (default: 1 s)")
    shared.add_network(parser)
    shared.add_bus(parser)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Send the message; 1 if the expected answer does not come in time."""
    within = durations.seconds(arguments.within)
    protocol = shared.protocol(arguments)
    message = parse(protocol.binding(arguments.message), arguments.fields)
    frame = protocol.encode(message)
    expected = protocol.binding(arguments.expect) if arguments.expect else None
    bus = shared.open_bus(arguments)
    print(f"sent      {frame}  {_words(protocol, message)}")
    if expected is None:
        with bus:
            transmit(bus, frame)
        return ExitStatus.FINE
    answer = exchange(bus, frame, expected.cob_id, within)
    if answer is None:
        print(f"expected  {expected.name}: nothing came within {within * 1000:g} ms")
        return ExitStatus.FOUND
    came, took = answer
    print(f"received  {came}  {_words(protocol, expected.decode(came.data))}  after {took * 1000:.1f} ms")
    return ExitStatus.FINE


def parse(binding: Binding, fields: Sequence[str]) -> Message:
    """Return the message of `name=value` words; raises UnknownName, FieldError, LocalError."""
    values: dict[str, Any] = {}
    for field, value in (_value(binding, text) for text in fields):
        if field in values:
            raise LocalError(f"{binding.name}: {field} given twice")
        values[field] = value
    missing = [field for field in binding.kinds if field not in values and field not in binding.defaults]
    if missing:
        raise LocalError(f"{binding.name}: {', '.join(missing)} missing")
    return binding.message(**values)


def _value(binding: Binding, text: str) -> tuple[str, Any]:
    field, given, value = text.partition("=")
    if field not in binding.kinds:
        raise UnknownName(f"field of {binding.name}", field, binding.kinds)
    kind = binding.kinds[field]
    try:
        return field, kind.parse(value)
    except (ValueError, KeyError):
        limits = binding.limits.get(field)
        allowed = kind.allowed(limits) if limits else "nothing, as the loaded EDS does not map it"
        raise FieldError(binding.name, field, value if given else text, allowed) from None


def _words(protocol: Protocol, message: Message) -> str:
    from eurobot_od.pdo.message import describe

    return f"{protocol.name(type(message))}  {describe(message)}".rstrip()


def transmit(bus: can.BusABC, frame: Frame) -> None:
    """Give a frame to the driver; raises BusError."""
    from eurobot_od.live import Driver

    if not Driver(bus).send(frame, PATIENCE):
        raise BusError("the bus did not take the frame")


def exchange(bus: can.BusABC, question: Frame, cob_id: int, within: float) -> tuple[Frame, float] | None:
    """Send a frame and wait for one with a COB-ID; return it and the seconds it took, None if it takes longer.

    Raises BusError.
    """
    from eurobot_od.live import Watch

    came: SimpleQueue[tuple[float, Frame] | BusError] = SimpleQueue()

    def seen(now: float, frame: Frame) -> None:
        if frame.cob_id == cob_id:
            came.put((now, frame))

    with Watch(bus, seen, time.perf_counter, failed=came.put):  # it listens before the question is out
        started = time.perf_counter()
        transmit(bus, question)
        try:
            answer = came.get(timeout=within)
        except Empty:
            return None
    if isinstance(answer, BusError):
        raise answer
    arrived, frame = answer
    return frame, arrived - started
