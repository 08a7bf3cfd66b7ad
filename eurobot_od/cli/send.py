"""`send` sends one message or frame on a CAN bus, and may wait for an answer; or sends a list of them.

The command line is checked against the EDS files before the bus is opened.
"""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from itertools import takewhile
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Annotated

from eurobot_od.bus.live import FrameReader, transmit
from eurobot_od.cli import ExitStatus
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BusOptions, Wait
from eurobot_od.cli.signature import Option, bus_named
from eurobot_od.errors import BusError, LocalError, RemoteError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message, describe, plain_name
from eurobot_od.pdo.protocol import FRAME_MARK, Protocol, frame_to_send
from eurobot_od.support.texts import amount, one_line

if TYPE_CHECKING:
    import can

LISTS = (".yaml", ".yml")


def send(
    message: str,
    fields: Annotated[Sequence[str], Option(metavar="FIELD=VALUE")] = (),
    *,
    expect: Annotated[str | None, Option(metavar="MESSAGE")] = None,
    within: Wait = 1.0,
    devices: Devices,
    bus: BusOptions,
) -> ExitStatus:
    """Send one message or frame on a CAN bus, and wait for an answer with --expect; or a list of them.

    Exit status 1 if the expected answer does not come in time. A list goes on until nothing of it is left, or Ctrl-C.

    message: a message by its name, such as 'Goto XY', or a frame: 185#0102, 705#R1; or a list's file (YAML)
    fields: such as x=1500 barriers=fire-1:forced
    expect: wait for this message and print it; 185#01: with data beginning like this
    within: how long to wait for it (default: 1 s)

    $ send motor.RPDO1 target_speed=100 --eds 5=motor.eds -i socketcan -c can0
    $ send sequences/warm-up.yaml --eds 5=motor.eds -i socketcan -c can0
    """
    if message.endswith(LISTS):
        if fields or expect:
            raise LocalError(f"{message} is a list: it takes no fields, and no --expect")
        from eurobot_od.cli.send_list import send_list  # here, as one frame needs neither YAML nor a master

        print(f"{amount(send_list(message, devices.decoder().protocol, bus), 'frame')} sent")
        return ExitStatus.FINE
    if fields and all(re.fullmatch(r"(?:0x)?[0-9A-Fa-f]+", each) for each in (message, *fields)):
        data = "".join(each.removeprefix("0x") for each in fields)
        raise LocalError(f"a frame is one word: write send {message.removeprefix('0x')}#{data}")
    if bus_there := bus_named(message):
        raise LocalError(f"{bus_there}; write send {' '.join(fields)} first")
    if re.fullmatch(r"(?:0x)?[0-9A-Fa-f]{3}", message) and not devices.are_known:
        raise LocalError(f"a frame is ID#DATA: write send {message.removeprefix('0x')}#, or with data after the #")
    are_frames = all(FRAME_MARK in each for each in (message, expect or FRAME_MARK))
    # Frames can be sent without files.
    protocol = devices.decoder().protocol if are_frames else devices.protocol()
    name = " ".join((message, *takewhile(lambda each: "=" not in each, fields)))
    if name != message and plain_name(name) in map(plain_name, protocol.names()):
        raise LocalError(f"a name with spaces needs quotes: send '{name}'")
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
    frame, message = frame_to_send(protocol, text, fields)
    return frame, meaning(protocol, frame) if message is None else _words(protocol, message)


def expectation(protocol: Protocol, text: str) -> Frame:
    """Return the COB-ID and the first bytes of the expected frame; raises UnknownName, LocalError."""
    frame = Frame.parse(text) if FRAME_MARK in text else Frame(protocol.binding(text).cob_id)
    if frame.is_remote:
        raise LocalError(f"--expect {text}: a remote frame is no answer")
    return frame


def meaning(protocol: Protocol, frame: Frame) -> str:
    """Return the meaning of a frame as text, empty if it is no message."""
    if frame.is_remote:
        return "asks for it"
    try:
        return _words(protocol, protocol.decode(*frame))
    except RemoteError:  # a raw frame may be no message, or too short for it
        return ""


def _words(protocol: Protocol, message: Message) -> str:
    binding = protocol.binding(type(message))
    return f"{binding.name}  {describe(message, binding.kinds)}".rstrip()


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
