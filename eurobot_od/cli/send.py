"""`send` sends one message or frame on a CAN bus, and may wait for an answer.

The command line is checked against the EDS files before the bus is opened.
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
"""Separator of a frame in candump's notation; no message's name contains it."""

PATIENCE = 1.0
"""Maximum time for the driver to accept a frame, in s."""


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
    # Frames can be sent without files.
    protocol = devices.decoder().protocol if are_frames else devices.protocol()
    frame, words = question(protocol, message, fields)
    expected = expectation(protocol, expect) if expect else None
    # Printed after sending, as the bus may not accept the frame.
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
    # For a message expected by name, a frame that is too short is an error.
    words = meaning(protocol, came) if FRAME_MARK in expect else _words(protocol, protocol.decode(*came))
    print(one_line("  ".join(filter(None, (f"received  {came}", words, f"after {took * 1000:.1f} ms")))))
    return ExitStatus.FINE


def question(protocol: Protocol, text: str, fields: Sequence[str]) -> tuple[Frame, str]:
    """Return the frame to send, from a message's name or candump's notation, and its meaning; raises as `parse`."""
    if FRAME_MARK not in text:
        message = parse(protocol.binding(text), fields)
        return protocol.encode(message), _words(protocol, message)
    if fields:
        raise LocalError(f"the frame {text} has no fields: {', '.join(fields)}")
    frame = Frame.parse(text)
    return frame, meaning(protocol, frame)


def expectation(protocol: Protocol, text: str) -> Frame:
    """Return the COB-ID and the first bytes of the expected frame; raises UnknownName, LocalError."""
    return Frame.parse(text) if FRAME_MARK in text else Frame(protocol.binding(text).cob_id)


def meaning(protocol: Protocol, frame: Frame) -> str:
    """Return the meaning of a frame as text, empty if it is no message."""
    try:
        return _words(protocol, protocol.decode(*frame))
    except RemoteError:  # a raw frame may be no message, or too short for it
        return ""


def _words(protocol: Protocol, message: Message) -> str:
    binding = protocol.binding(type(message))
    return f"{binding.name}  {describe(message, binding.kinds)}".rstrip()


def transmit(bus: can.BusABC, frame: Frame) -> None:
    """Send a frame; raises BusError."""
    if not Driver(bus).send(frame, PATIENCE):
        raise BusError("the bus did not take the frame")


def exchange(bus: can.BusABC, question: Frame, expected: Frame, within: float) -> tuple[Frame, float] | None:
    """Send a frame and wait for one with the COB-ID of `expected`, whose data begin like its data.

    Return it with the time it took, in s; None if it does not come in time. Raises BusError.
    """
    came: SimpleQueue[tuple[float, Frame] | BusError] = SimpleQueue()

    def seen(now: float, frame: Frame) -> None:
        if frame.cob_id == expected.cob_id and frame.data.startswith(expected.data):
            came.put((now, frame))

    # Start to listen before sending, as the answer may come at once. `perf_counter`, as `monotonic` has steps of 16 ms
    # on Windows.
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
