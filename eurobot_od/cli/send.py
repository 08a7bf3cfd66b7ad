"""The command `send`: one message or frame goes out on a CAN bus, and perhaps an answer is waited for.

Rule of this file: the whole command line is checked against the EDS files before a bus is opened.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Annotated

from eurobot_od.bus.live import Driver, FrameReader
from eurobot_od.cli import ExitStatus
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BusOptions, Seconds
from eurobot_od.cli.signature import Option
from eurobot_od.errors import BusError, LocalError, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.pdo.binding import parse
from eurobot_od.pdo.kinds import Message, describe
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    import can

FRAME_MARK = "#"
"""Stands in a frame in candump's notation, and in no name of a message."""

PATIENCE = 1.0
"""Seconds that the driver has to take a frame."""


def send(
    message: str,
    fields: Annotated[Sequence[str], Option(metavar="FIELD=VALUE")] = (),
    *,
    expect: Annotated[str | None, Option(metavar="MESSAGE")] = None,
    within: Seconds = 1.0,
    devices: Devices,
    bus: BusOptions,
) -> ExitStatus:
    """Send one message or frame on a CAN bus, and wait for an answer with --expect.

    Exit status 1 if the expected answer does not come in time.

    message: a message by its name, such as 'Goto XY', or a frame: 185#0102
    fields: such as x=1500 barriers=fire-1:forced
    expect: wait for this message and print it; 185#01: with data beginning like this
    within: how long to wait for it (default: 1 s)

    $ send motor.RPDO1 target_speed=100 --eds 5=motor.eds -i socketcan -c can0
    """
    are_frames = all(FRAME_MARK in each for each in (message, expect or FRAME_MARK))
    # What decodes them needs no file, and a frame can be sent without.
    protocol = devices.decoder().protocol if are_frames else devices.protocol()
    frame, words = question(protocol, message, fields)
    expected = expectation(protocol, expect) if expect else None
    # Printed once it is sent; before that the line would be false if the bus does not take the frame.
    sent = one_line(f"sent      {frame}  {words}".rstrip())
    driver = bus.open()
    if expect is None or expected is None:
        with driver:
            transmit(driver, frame)
        print(sent)
        return ExitStatus.FINE
    answer = exchange(driver, frame, expected, within)
    print(sent)
    if answer is None:
        print(f"expected  {expect}: nothing came within {within * 1000:g} ms")
        return ExitStatus.FOUND
    came, took = answer
    # A message expected by its name must be whole: a frame too short for it is an error.
    words = meaning(protocol, came) if FRAME_MARK in expect else _words(protocol, protocol.decode(*came))
    print(one_line("  ".join(filter(None, (f"received  {came}", words, f"after {took * 1000:.1f} ms")))))
    return ExitStatus.FINE


def question(protocol: Protocol, text: str, fields: Sequence[str]) -> tuple[Frame, str]:
    """Return the frame to send, of a message or in candump's notation, and what it means; raises as `parse`."""
    if FRAME_MARK not in text:
        message = parse(protocol.binding(text), fields)
        return protocol.encode(message), _words(protocol, message)
    if fields:
        raise LocalError(f"the frame {text} has no fields: {', '.join(fields)}")
    frame = Frame.parse(text)
    return frame, meaning(protocol, frame)


def expectation(protocol: Protocol, text: str) -> Frame:
    """Return the identifier, and the beginning of the data, of what is waited for; raises UnknownName, LocalError."""
    return Frame.parse(text) if FRAME_MARK in text else Frame(protocol.binding(text).cob_id)


def meaning(protocol: Protocol, frame: Frame) -> str:
    """Say which message a frame is, `` if it is not one."""
    try:
        return _words(protocol, protocol.decode(*frame))
    except RemoteError:  # a raw frame may be anything, or too short for the message of its identifier
        return ""


def _words(protocol: Protocol, message: Message) -> str:
    binding = protocol.binding(type(message))
    return f"{binding.name}  {describe(message, binding.kinds)}".rstrip()


def transmit(bus: can.BusABC, frame: Frame) -> None:
    """Give a frame to the driver; raises BusError."""
    if not Driver(bus).send(frame, PATIENCE):
        raise BusError("the bus did not take the frame")


def exchange(bus: can.BusABC, question: Frame, expected: Frame, within: float) -> tuple[Frame, float] | None:
    """Send a frame and wait for one with the COB-ID of another, whose data begin as that one's.

    Return it and the seconds it took, None if it takes longer.

    Raises BusError.
    """
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
