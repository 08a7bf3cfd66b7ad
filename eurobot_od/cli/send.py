"""Send one message or frame on a CAN bus, and wait for an answer with --expect.

Rule of this file: the whole command line is checked against the EDS files before a bus is opened.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.errors import BusError, LocalError, RemoteError
from eurobot_od.support import durations
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    import can

    from eurobot_od.frame import Frame
    from eurobot_od.pdo.message import Message
    from eurobot_od.pdo.protocol import Protocol

FRAME_MARK = "#"
"""Stands in a frame in candump's notation, and in no name of a message."""

PATIENCE = 1.0
"""Seconds that the driver has to take a frame."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("message", help="a message by its name, such as 'Goto XY', or a frame: 185#0102")
    parser.add_argument("fields", nargs="*", metavar="FIELD=VALUE", help="such as x=1500 barriers=fire-1:forced")
    parser.add_argument(
        "--expect",
        metavar="MESSAGE",
        help="wait for this message and print it; 185#01: with data beginning like this",
    )
    parser.add_argument("--within", default="1 s", metavar="TIME", help="how long to wait for it (default: 1 s)")
    shared.add_network(parser)
    shared.add_bus(parser)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Send the message or frame; 1 if the expected answer does not come in time."""
    within = durations.seconds(arguments.within)  # all of the line is read before anything goes out
    devices, expect = shared.Devices.of(arguments), arguments.expect
    are_frames = all(FRAME_MARK in each for each in (arguments.message, expect or FRAME_MARK))
    # What decodes them needs no file, and a frame can be sent without.
    protocol = devices.decoder().protocol if are_frames else devices.protocol()
    frame, words = question(protocol, arguments.message, arguments.fields)
    expected = expectation(protocol, arguments.expect) if arguments.expect else None
    # Printed once it is sent; before that the line would be false if the bus does not take the frame.
    sent = one_line(f"sent      {frame}  {words}".rstrip())
    bus = shared.open_bus(arguments)
    if expected is None:
        with bus:
            transmit(bus, frame)
        print(sent)
        return ExitStatus.FINE
    answer = exchange(bus, frame, expected, within)
    print(sent)
    if answer is None:
        print(f"expected  {arguments.expect}: nothing came within {within * 1000:g} ms")
        return ExitStatus.FOUND
    came, took = answer
    # A message expected by its name must be whole: a frame too short for it is an error.
    words = meaning(protocol, came) if FRAME_MARK in arguments.expect else _words(protocol, protocol.decode(*came))
    print(one_line("  ".join(filter(None, (f"received  {came}", words, f"after {took * 1000:.1f} ms")))))
    return ExitStatus.FINE


def question(protocol: Protocol, text: str, fields: Sequence[str]) -> tuple[Frame, str]:
    """Return the frame to send, of a message or in candump's notation, and what it means; raises as `parse`."""
    from eurobot_od.frame import Frame
    from eurobot_od.pdo.binding import parse

    if FRAME_MARK not in text:
        message = parse(protocol.binding(text), fields)
        return protocol.encode(message), _words(protocol, message)
    if fields:
        raise LocalError(f"the frame {text} has no fields: {', '.join(fields)}")
    frame = Frame.parse(text)
    return frame, meaning(protocol, frame)


def expectation(protocol: Protocol, text: str) -> Frame:
    """Return the identifier, and the beginning of the data, of what is waited for; raises UnknownName, LocalError."""
    from eurobot_od.frame import Frame

    return Frame.parse(text) if FRAME_MARK in text else Frame(protocol.binding(text).cob_id)


def meaning(protocol: Protocol, frame: Frame) -> str:
    """Say which message a frame is, `` if it is not one."""
    try:
        return _words(protocol, protocol.decode(*frame))
    except RemoteError:  # a raw frame may be anything, or too short for the message of its identifier
        return ""


def _words(protocol: Protocol, message: Message) -> str:
    from eurobot_od.pdo.message import describe

    return f"{protocol.name(type(message))}  {describe(message)}".rstrip()


def transmit(bus: can.BusABC, frame: Frame) -> None:
    """Give a frame to the driver; raises BusError."""
    from eurobot_od.bus.live import Driver

    if not Driver(bus).send(frame, PATIENCE):
        raise BusError("the bus did not take the frame")


def exchange(bus: can.BusABC, question: Frame, expected: Frame, within: float) -> tuple[Frame, float] | None:
    """Send a frame and wait for one with the COB-ID of another, whose data begin as that one's.

    Return it and the seconds it took, None if it takes longer.

    Raises BusError.
    """
    from eurobot_od.bus.live import FrameReader

    came: SimpleQueue[tuple[float, Frame] | BusError] = SimpleQueue()

    def seen(now: float, frame: Frame) -> None:
        if frame.cob_id == expected.cob_id and frame.data.startswith(expected.data):
            came.put((now, frame))

    # It listens before the question is out: an answer can come sooner than the next line is run. By the finest clock:
    # on Windows `monotonic` steps by 16 ms.
    with FrameReader(bus, seen, time.perf_counter, failed=came.put):
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
