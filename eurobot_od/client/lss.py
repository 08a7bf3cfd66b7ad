"""Layer setting services: find devices by their identity, give them node-ID and bit rate, have them store it (CiA 305).

A service is a generator that yields requests and gets the answers, None if there was none; only `perform` has a bus.
What the standard does not allow is refused before the generator is made.

canopen's LssMaster is not used: it waits in a queue that another thread has to fill, sleeps 0.2 s after each part of an
identity, and turns every error into a number.
"""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterator
from typing import NamedTuple, TypeAlias, TypeVar

from eurobot_od.client.master import STORE_WAIT, Master, Procedure
from eurobot_od.errors import LocalError, NoAnswer, RemoteError
from eurobot_od.od import standard
from eurobot_od.od.identity import Identity
from eurobot_od.od.values import NODE_IDS
from eurobot_od.support.progress import Progress, unwatched

LSS_LOG = logging.getLogger("eurobot_od.lss")

ANSWER_WAIT = 0.1
"""Seconds that a device has for an answer; `find_all` waits for this long about 130 times for each device."""

FIRST_BIT = 31
"""Fastscan starts with the highest bit."""


class LssRequest(NamedTuple):
    """A request: its command, the bytes after it, and the command of the answer (None: there is no answer)."""

    command: standard.Lss | int
    rest: bytes = b""
    answer: standard.Lss | None = None

    @property
    def data(self) -> bytes:
        """The bytes of the frame; unused ones are 0."""
        return bytes([self.command, *self.rest]).ljust(standard.LENGTH, b"\0")


Result = TypeVar("Result")
LssSteps: TypeAlias = "Generator[LssRequest, bytes | None, Result]"


# Services


def switch(state: standard.LssState) -> LssSteps[None]:
    """Put all devices into a state; they do not answer."""
    return _sent(LssRequest(standard.Lss.SWITCH_GLOBAL, bytes([state])))


def select(identity: Identity) -> LssSteps[bool]:
    """Put the device with an identity into configuration state; return whether there is one."""
    yield from switch(standard.LssState.WAITING)
    # Four frames with one part of the identity in each; only the last one is answered, by the device that agrees with
    # all of them (CiA 305).
    *first, last = [LssRequest(standard.Lss.SELECT + part, _number(value)) for part, value in enumerate(identity)]
    yield from first
    return (yield last._replace(answer=standard.Lss.SELECTED)) is not None


def fastscan() -> LssSteps[Identity | None]:
    """Find a device without a node-ID and put it into configuration state; None if there is none.

    Of several devices, it finds the one that has 0 in the first bit in which they differ. Raises RemoteError if it goes
    away.
    """
    if not (yield from _scanned(0, standard.ANY_BIT, 0, 0)):
        return None
    found: list[int] = []
    for part in range(len(Identity._fields)):
        number = 0
        # From the highest bit down, each question halves what is left. LSS can say no only by silence, so a 0 that
        # nobody confirms is a 1.
        for bit in range(FIRST_BIT, -1, -1):
            if not (yield from _scanned(number, bit, part, part)):
                number |= 1 << bit
        # Asked once more with the whole part, which makes the device go on to the next part (CiA 305, LSS fastscan).
        if not (yield from _scanned(number, 0, part, (part + 1) % len(Identity._fields))):
            raise RemoteError("the device that fastscan was about to find no longer answers")
        found.append(number)
    return Identity(*found)


def find_all() -> LssSteps[list[Identity]]:
    """Return all devices without a node-ID, at most as many as there are node-IDs; nothing is configured.

    All devices answer with the same identifier, so they are told apart by asking for both values of each bit. They stay
    in waiting state: in configuration state they must not answer (CiA 305), but CANopenNode's then say yes to
    everything.
    """
    yield from switch(standard.LssState.WAITING)
    seen: list[Identity] = []
    if (yield from _positioned(())):
        yield from _explore((), 0, FIRST_BIT + 1, seen)
    found = []
    for each in seen:  # where slaves keep no position, one may be made of parts of two devices
        if (yield from select(each)):
            found.append(each)
    yield from switch(standard.LssState.WAITING)
    return found


def _explore(head: tuple[int, ...], number: int, bit: int, seen: list[Identity]) -> LssSteps[None]:
    """Note the devices whose identities start with `head` and whose next part has the bits of `number` from `bit` up.

    There is at least one.
    """
    part = len(head)
    if bit == 0 and part + 1 == len(Identity._fields):
        seen.append(Identity._make((*head, number)))
    elif bit == 0:
        yield from _positioned((*head, number))
        yield from _explore((*head, number), 0, FIRST_BIT + 1, seen)
    else:
        bit -= 1
        other = number | 1 << bit
        is_first = yield from _scanned(number, bit, part, part)
        # If nobody is in the first half there must be somebody in the other half, without asking.
        is_other = not is_first or (yield from _scanned(other, bit, part, part))
        if is_first:
            yield from _explore(head, number, bit, seen)
        # Exploring the first half has moved everybody on: the devices of the other half are led to this part again.
        if is_first and is_other:
            yield from _positioned(head)
        if is_other and len(seen) < len(NODE_IDS):
            yield from _explore(head, other, bit, seen)


def _positioned(head: tuple[int, ...]) -> LssSteps[bool]:
    """Have devices whose identities start with `head` expect its next part; return whether any device is there."""
    is_there = yield from _scanned(0, standard.ANY_BIT, 0, 0)
    for part, number in enumerate(head):
        yield from _scanned(number, 0, part, part + 1)
    return is_there


def inquire_node_id() -> LssSteps[int]:
    """Return the node-ID of the device that is being configured, 255 if it has none; raises NoAnswer."""
    return (yield from _asked(LssRequest(standard.Lss.INQUIRE_NODE_ID, answer=standard.Lss.INQUIRE_NODE_ID)))[1]


def configure_node_id(node_id: int) -> LssSteps[None]:
    """Give the device a node-ID, 255 for none. Raises LocalError, RemoteError if it refuses, NoAnswer."""
    if node_id not in (*NODE_IDS, standard.UNCONFIGURED):
        raise LocalError(f"node-ID {node_id} is not in 1..127 (255 for none)")
    return _configured(standard.Lss.CONFIGURE_NODE_ID, bytes([node_id]))


def configure_bit_rate(kbit: int) -> LssSteps[None]:
    """Give the device a bit rate in kbit/s; raises as `configure_node_id`."""
    if kbit not in standard.BIT_RATES:
        raise LocalError(f"{kbit} kbit/s is not in CiA 305's table: {', '.join(map(str, standard.BIT_RATES))}")
    return _configured(standard.Lss.CONFIGURE_BIT_TIMING, bytes([0, standard.BIT_RATES[kbit]]))


def activate_bit_rate(delay: float) -> LssSteps[None]:
    """Have the devices being configured change their bit rate in `delay` seconds; they do not answer.

    They are then silent for as long again (CiA 305: switch delay). Raises LocalError.
    """
    milliseconds = round(delay * 1000)
    if not 0 <= milliseconds <= 0xFFFF:
        raise LocalError(f"the delay {delay} s is not in 0..65.535 s")
    return _sent(LssRequest(standard.Lss.ACTIVATE_BIT_TIMING, milliseconds.to_bytes(2, "little")))


def store() -> LssSteps[None]:
    """Have the device store node-ID and bit rate; raises RemoteError if it refuses, NoAnswer."""
    return _configured(standard.Lss.STORE, b"")


def chosen(identity: Identity | None, alone: bool = False) -> LssSteps[Identity | None]:
    """Put one device into configuration state; return its identity, None if it is the only one on the bus.

    It is the only one (`alone`), the one with an `identity`, or else the first without a node-ID. Raises RemoteError if
    there is none.
    """
    if alone:
        yield from switch(standard.LssState.CONFIGURATION)
        return None
    if identity:
        found = identity if (yield from select(identity)) else None
        missing = f"no device has the identity {identity}"
    else:
        yield from switch(standard.LssState.WAITING)  # fastscan is only for devices in waiting state (CiA 305)
        found, missing = (yield from fastscan()), "no device without a node-ID answers"
    if found is None:
        raise RemoteError(missing)
    return found


def assigned(node_id: int, identity: Identity | None, bit_rate: int | None, stores: bool) -> LssSteps[Identity | None]:
    """Give the `chosen` device a node-ID and, unless None, a bit rate in kbit/s; have it store them if it `stores`."""
    services = [configure_node_id(node_id)]
    services += [] if bit_rate is None else [configure_bit_rate(bit_rate)]
    device = yield from chosen(identity)
    for each in services:
        yield from each
    if stores:
        yield from store()
    return device


def _sent(request: LssRequest) -> LssSteps[None]:
    yield request


def _scanned(number: int, bit: int, part: int, then: int) -> LssSteps[bool]:
    """Ask who agrees in bits 31 to `bit` of a part of the identity; those expect the part `then` next."""
    rest = _number(number) + bytes([bit, part, then])
    return (yield LssRequest(standard.Lss.FASTSCAN, rest, standard.Lss.IDENTIFY_SLAVE)) is not None


def _configured(command: standard.Lss, rest: bytes) -> LssSteps[None]:
    answer = yield from _asked(LssRequest(command, rest, command))
    error, own = answer[1], answer[2]
    if error:
        raise RemoteError(f"the device refuses to {_words(command)}: {standard.refusal_words(command, error, own)}")


def _asked(request: LssRequest) -> LssSteps[bytes]:
    answer = yield request
    if answer is None:
        raise NoAnswer(f"LSS {_words(request.command)}", "answer", 1, _wait(request, ANSWER_WAIT))
    return answer


def _words(command: int) -> str:
    known = command in set(standard.Lss)
    return standard.Lss(command).name.lower().replace("_", " ") if known else f"0x{command:02X}"


def _number(value: int) -> bytes:
    return value.to_bytes(4, "little")


# The bus


@Procedure
async def perform(
    master: Master, steps: LssSteps[Result], wait: float = ANSWER_WAIT, progress: Progress = unwatched
) -> Result:
    """Carry out a service; a device has `wait` seconds for each answer, more to store. Raises its errors and BusError.

    `progress` is called with the number of requests so far.
    """
    answers: list[bytes] = []
    master.listeners[standard.ANSWERS] = answers.append
    answer, number = None, 0
    try:
        while True:
            request, number = steps.send(answer), number + 1
            progress(number, None)
            answer = await _exchange(master, request, answers, wait)
    except StopIteration as end:
        result: Result = end.value
        return result
    finally:
        del master.listeners[standard.ANSWERS]


async def _exchange(master: Master, request: LssRequest, answers: list[bytes], wait: float) -> bytes | None:
    master.drain()  # a late answer to the request before is not an answer to this one
    answers.clear()
    LSS_LOG.debug("%s: %s", _words(request.command), request.data.hex(" "))
    master.send(standard.REQUESTS, request.data)
    if request.answer is None:
        return None
    await master.pump.steps(_wait(request, wait), lambda: any(_fitting(answers, request)))
    answer = next(_fitting(answers, request), None)
    LSS_LOG.debug("answer: %s", answer.hex(" ") if answer else "none")
    return answer


def _fitting(answers: list[bytes], request: LssRequest) -> Iterator[bytes]:
    return (each for each in answers if len(each) == standard.LENGTH and each[0] == request.answer)


def _wait(request: LssRequest, wait: float) -> float:
    return STORE_WAIT if request.command is standard.Lss.STORE else wait
