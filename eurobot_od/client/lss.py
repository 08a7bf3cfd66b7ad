"""Layer setting services (CiA 305): find devices by identity, set and store their node-IDs and bit rates.

A service is a generator that yields requests and gets the answers, None if there was none; only `perform` has a bus.
What the standard does not allow is refused before the generator is made.

canopen's LssMaster is not used: it waits in a queue that another thread has to fill, sleeps 0.2 s after each part of an
identity, and turns every error into a number.
"""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterable, Iterator, Sequence
from typing import NamedTuple, TypeAlias, TypeVar

from eurobot_od.client.master import STORE_WAIT, Master, Procedure
from eurobot_od.errors import LocalError, NoAnswer, RemoteError
from eurobot_od.od import standard
from eurobot_od.od.identity import Identity
from eurobot_od.od.values import NODE_IDS
from eurobot_od.support import texts
from eurobot_od.support.progress import Progress, unwatched

LSS_LOG = logging.getLogger("eurobot_od.lss")

ANSWER_WAIT = 0.1
"""Timeout of an answer, in s; `find_all` waits for it about 130 times for each device."""

FIRST_BIT = 31
"""Highest bit, with which fastscan starts."""

PATIENCE = (1, 2, 4, 8)
"""Factors of the timeout for successive attempts when answers seem lost or late."""

ATTEMPTS = 3
"""Attempts for a bit that no device confirms in either value."""

VENDORS = (0xA5A5A5A5, 0x5A5A5A5A)
"""Two vendor-IDs; a device that confirms both confirms everything."""


SERIAL_NUMBER = standard.Lss.INQUIRE + len(Identity._fields) - 1
"""Asks for the last part of the identity, in which devices of one type differ."""


class LssRequest(NamedTuple):
    """A request: its command, the bytes after it, and the command of the answer (None without an answer).

    A device has `patience` times as long for its answer as for others. `to_all` waits for the answers of all devices.
    """

    command: standard.Lss | int
    rest: bytes = b""
    answer: standard.Lss | int | None = None
    patience: float = 1
    to_all: bool = False

    @property
    def data(self) -> bytes:
        """The bytes of the frame; unused ones are 0."""
        return bytes([self.command, *self.rest]).ljust(standard.LENGTH, b"\0")


Result = TypeVar("Result")
LssSteps: TypeAlias = "Generator[LssRequest, bytes | None, Result]"


# Services


def switch(state: standard.LssState) -> LssSteps[None]:
    """Switch all devices to a state; they do not answer."""
    return _sent(LssRequest(standard.Lss.SWITCH_GLOBAL, bytes([state])))


def select(identity: Identity) -> LssSteps[bool]:
    """Switch the device with an identity to configuration state; return whether there is one.

    Without an answer the device is asked again, with more time.
    """
    for patience in PATIENCE:
        yield from switch(standard.LssState.WAITING)
        if (yield from _selected(identity, patience)):
            return True
    return False


def _selected(identity: Identity, patience: float) -> LssSteps[bool]:
    # Four frames, each with a part of the identity; only the last one is answered (CiA 305).
    *first, last = [LssRequest(standard.Lss.SELECT + part, _number(value)) for part, value in enumerate(identity)]
    yield from first
    return (yield last._replace(answer=standard.Lss.SELECTED, patience=patience)) is not None


def fastscan() -> LssSteps[Identity | None]:
    """Find a device without a node-ID and switch it to configuration state; return None if there is none.

    Of several devices, it finds the one that has 0 in the first bit in which they differ. A device that then does not
    say the same identity itself is searched for again, with more time for answers. Raises RemoteError if it goes away.
    """
    yield from switch(standard.LssState.WAITING)  # fastscan is only for devices in waiting state (CiA 305)
    if not (yield from _is_anybody_there()):
        return None
    for patience in PATIENCE:
        yield from switch(standard.LssState.WAITING)
        found = yield from _Scan(patience).find_one()
        if found is not None and (yield from _is_confirmed(found)):
            return found
    raise RemoteError("the device that fastscan was about to find no longer answers")


def find_all() -> LssSteps[list[Identity]]:
    """Return all devices without a node-ID, at most 127; nothing is configured.

    All devices answer with the same identifier, so they are told apart by asking for both values of each bit. Each
    device that is found is selected, and has to say the same identity itself. While others are left, they are searched
    for again, with more time for answers. Raises RemoteError if some are left at the end: a device whose answers are
    lost must not pass for one that is not there.
    """
    yield from switch(standard.LssState.WAITING)
    found: set[Identity] = set()
    is_complete = not (yield from _is_anybody_there())
    for patience in PATIENCE:
        if is_complete or len(found) >= len(NODE_IDS):
            break
        scan = _Scan(patience)
        yield from scan.find_all()
        doubtful = scan.is_lost
        for each in scan.seen:  # if slaves keep no position, an identity may combine those of two devices
            is_confirmed = yield from _is_confirmed(each)
            doubtful = doubtful or not is_confirmed
            found |= {each} if is_confirmed else set()
        is_complete = yield from _is_complete(found, doubtful)
    yield from switch(standard.LssState.WAITING)
    if not is_complete and len(found) < len(NODE_IDS):
        others = f"besides {', '.join(map(str, sorted(found)))} " if found else ""
        what = "a device without a node-ID answers, but no identity that it confirms was found: answers are lost"
        raise RemoteError(f"{others}{what}")
    return sorted(found)


def _is_confirmed(identity: Identity) -> LssSteps[bool]:
    """Return whether a device, once selected, reports this identity."""
    if not (yield from select(identity)):
        return False
    try:
        return (yield from inquire_identity()) == identity
    except NoAnswer:
        return False


def _is_complete(found: Iterable[Identity], doubtful: bool) -> LssSteps[bool]:
    """Return whether no device but the `found` ones answers; those in configuration state do not (CiA 305).

    CANopenNode's do; of those it is known only whether the search was `doubtful`. The found devices are left in
    configuration state, so that the next search is for the others, except for those.
    """
    yield from switch(standard.LssState.WAITING)
    for each in found:
        for patience in PATIENCE[:2]:
            if (yield from _selected(each, patience)):
                break
    if not (yield from _is_anybody_there()):
        return True
    for vendor in VENDORS:
        if not (yield from _Scan().ask(vendor, 0, 0, 0)):
            return False
    yield from switch(standard.LssState.WAITING)
    return not doubtful


def _is_anybody_there() -> LssSteps[bool]:
    for patience in PATIENCE:
        if (yield from _Scan(patience).ask(0, standard.ANY_BIT, 0, 0)):
            return True
    return False


class _Scan:
    """A search by fastscan: `seen` are the identities found, `is_lost` whether answers stopped.

    LSS can say no only by silence. So a bit is 1 only where a device says so, not where none says 0. An answer that
    comes late can still be taken for one to the next question: what was seen has to be confirmed.
    """

    def __init__(self, patience: float = 1) -> None:
        self._patience = patience
        self.seen: list[Identity] = []
        self.is_lost = False

    def ask(self, number: int, bit: int, part: int, then: int) -> LssSteps[bool]:
        """Return whether a device agrees in bits 31 to `bit` of a part; those then expect the part `then`."""
        rest = _number(number) + bytes([bit, part, then])
        request = LssRequest(standard.Lss.FASTSCAN, rest, standard.Lss.IDENTIFY_SLAVE, self._patience)
        return (yield request) is not None

    def find_one(self) -> LssSteps[Identity | None]:
        """Return the identity of the first device, None if it no longer answers."""
        head: tuple[int, ...] = ()
        yield from self._position(head)
        for part in range(len(Identity._fields)):
            number = 0
            for bit in range(FIRST_BIT, -1, -1):
                _, is_other = yield from self._halves(head, number, bit, are_both_asked=False)
                if self.is_lost:
                    return None
                number |= is_other << bit
            # Confirming the whole part moves the device on to the next part (CiA 305, fastscan).
            yield from self.ask(number, 0, part, (part + 1) % len(Identity._fields))
            head = (*head, number)
        return Identity._make(head)

    def find_all(self) -> LssSteps[None]:
        """Collect all identities in `seen`, until answers stop."""
        yield from self._position(())
        yield from self._explore((), 0, FIRST_BIT + 1)

    def _explore(self, head: tuple[int, ...], number: int, bit: int) -> LssSteps[None]:
        """Collect the identities that start with `head`, and whose next part has `number` from `bit` up."""
        if bit == 0 and len(head) + 1 == len(Identity._fields):
            self.seen.append(Identity._make((*head, number)))
        elif bit == 0:
            yield from self._position((*head, number))
            yield from self._explore((*head, number), 0, FIRST_BIT + 1)
        else:
            bit -= 1
            is_first, is_other = yield from self._halves(head, number, bit, are_both_asked=True)
            if is_first:
                yield from self._explore(head, number, bit)
            # Exploring the first half has moved all devices on, so they are led back to this part.
            if is_first and is_other:
                yield from self._position(head)
            if is_other and not self.is_lost and len(self.seen) < len(NODE_IDS):
                yield from self._explore(head, number | 1 << bit, bit)

    def _halves(
        self, head: tuple[int, ...], number: int, bit: int, *, are_both_asked: bool
    ) -> LssSteps[tuple[bool, bool]]:
        """Return whether devices have 0 and 1 in a bit; after a 0, 1 is asked only if `are_both_asked`."""
        part = len(head)
        is_first = False
        is_other = False
        for _ in range(ATTEMPTS):
            is_first = yield from self.ask(number, bit, part, part)
            if are_both_asked or not is_first:
                is_other = yield from self.ask(number | 1 << bit, bit, part, part)
            if is_first or is_other:
                return is_first, is_other
            yield from self._position(head)  # a device that missed a question may expect another part
        self.is_lost = True
        return False, False

    def _position(self, head: tuple[int, ...]) -> LssSteps[None]:
        """Make devices whose identities start with `head` expect the next part."""
        for _ in range(ATTEMPTS):
            is_there = yield from self.ask(0, standard.ANY_BIT, 0, 0)
            for part, number in enumerate(head):
                is_there = is_there and (yield from self.ask(number, 0, part, part + 1))
            if is_there:
                break


def inquire_identity() -> LssSteps[Identity]:
    """Return the identity of the device that is being configured; raises NoAnswer."""
    numbers = list[int]()
    for part, name in enumerate(standard.LSS_IDENTITY):
        command = standard.Lss.INQUIRE + part
        answer = None
        for patience in PATIENCE:
            answer = yield LssRequest(command, answer=command, patience=patience)
            if answer is not None:
                break
        else:
            raise NoAnswer(f"LSS inquire {name}", "answer", len(PATIENCE), PATIENCE[-1] * ANSWER_WAIT)
        numbers.append(int.from_bytes(answer[1:5], "little"))
    return Identity._make(numbers)


def inquire_node_id() -> LssSteps[int]:
    """Return the node-ID of the device being configured, 255 if it has none; raises NoAnswer."""
    return (yield from _asked(LssRequest(standard.Lss.INQUIRE_NODE_ID, answer=standard.Lss.INQUIRE_NODE_ID)))[1]


def configure_node_id(node_id: int) -> LssSteps[None]:
    """Set the node-ID of the device, 255 for none. Raises LocalError, RemoteError if it refuses, NoAnswer."""
    if node_id not in (*NODE_IDS, standard.UNCONFIGURED):
        raise LocalError(f"node-ID {node_id} is not in 1..127 (255 for none)")
    return _configured(standard.Lss.CONFIGURE_NODE_ID, bytes([node_id]))


def configure_bit_rate(kbit: int) -> LssSteps[None]:
    """Set the bit rate of the device in kbit/s; raises as `configure_node_id`."""
    if kbit not in standard.BIT_RATES:
        raise LocalError(f"{kbit} kbit/s is not in CiA 305's table: {', '.join(map(str, standard.BIT_RATES))}")
    return _configured(standard.Lss.CONFIGURE_BIT_TIMING, bytes([0, standard.BIT_RATES[kbit]]))


def activate_bit_rate(delay: float) -> LssSteps[None]:
    """Make the devices being configured change their bit rate after `delay` seconds; they do not answer.

    They are then silent for as long again (CiA 305: switch delay). Raises LocalError.
    """
    milliseconds = round(delay * 1000)
    if not 0 <= milliseconds <= 0xFFFF:
        raise LocalError(f"the delay {delay} s is not in 0..65.535 s")
    return _sent(LssRequest(standard.Lss.ACTIVATE_BIT_TIMING, milliseconds.to_bytes(2, "little")))


def store() -> LssSteps[None]:
    """Make the device store node-ID and bit rate; raises RemoteError if it refuses, NoAnswer."""
    return _configured(standard.Lss.STORE, b"")


def chosen(identity: Identity | None, alone: bool = False) -> LssSteps[Identity | None]:
    """Switch one device to configuration state; return its identity, or None if it is the only one.

    It is the only one (`alone`), the one with an `identity`, or else the first without a node-ID. Raises RemoteError if
    there is none, or if another one answers besides the only one.
    """
    if alone:
        yield from switch(standard.LssState.CONFIGURATION)
        yield LssRequest(SERIAL_NUMBER, answer=SERIAL_NUMBER, to_all=True)
        return None
    if identity:
        found = identity if (yield from select(identity)) else None
        missing = f"no device has the identity {identity}"
    else:
        found = yield from fastscan()
        missing = "no device without a node-ID answers; one that has a node-ID is reached by its identity"
    if found is None:
        raise RemoteError(missing)
    return found


def assigned(node_id: int, identity: Identity | None, bit_rate: int | None, stores: bool) -> LssSteps[Identity | None]:
    """Assign a node-ID and, unless None, a bit rate in kbit/s to the `chosen` device; store them if `stores`."""
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


# A device and its settings


class LssChange(NamedTuple):
    """A service that changes a setting, and the text of its result."""

    steps: LssSteps[None]
    done: str


def settings(
    node_id: int | None = None, bit_rate: int | None = None, store: bool = False, activate: float | None = None
) -> list[LssChange]:
    """Return the services that set what is not None: bit rate in kbit/s, its delay in s; raises LocalError."""
    found = []
    if node_id is not None:
        found.append(LssChange(configure_node_id(node_id), standard.node_id_words(node_id)))
    if bit_rate is not None:
        found.append(LssChange(configure_bit_rate(bit_rate), f"{bit_rate} kbit/s"))
    if store:
        found.append(LssChange(_configured(standard.Lss.STORE, b""), "stored"))
    if activate is not None:
        found.append(LssChange(activate_bit_rate(activate), f"bit rate changes in {texts.text(activate)}"))
    return found


def inquire(identity: Identity | None, alone: bool) -> LssSteps[str]:
    """Return the node-ID of a device as text; the device is selected as by `chosen`."""
    device = yield from chosen(identity, alone)
    node_id = yield from inquire_node_id()
    return f"{device or ONLY}  {standard.node_id_words(node_id)}"


def set_up(identity: Identity | None, alone: bool, wanted: Sequence[LssChange]) -> LssSteps[str]:
    """Configure a device, selected as by `chosen`; return what was done, and whether it was one of several, as text."""
    device = yield from chosen(identity, alone)
    others = ""
    if device and not identity:  # asked before it gets its bit rate, with which the bus may change
        is_last = yield from _is_complete([device], doubtful=False)
        others = "" if is_last else "; another device has no node-ID: --identity tells which one is meant"
        yield from select(device)
    for each in wanted:
        yield from each.steps
    return f"{device or ONLY}  {', '.join(each.done for each in wanted)}{others}"


ONLY = "the only device"
"""Name of a device whose identity was not asked."""


# The bus


@Procedure
async def perform(
    master: Master, steps: LssSteps[Result], wait: float = ANSWER_WAIT, progress: Progress = unwatched
) -> Result:
    """Perform a service, with `wait` seconds for each answer, more to store. Raises its errors and BusError.

    `progress` is called with the number of requests so far.
    """
    answers: list[bytes] = []
    master.listeners[standard.ANSWERS] = answers.append
    answer, number = None, 0
    try:
        while True:
            request = steps.send(answer)
            number = number + 1
            progress(number, None)
            answer = await _exchange(master, request, answers, wait)
    except StopIteration as end:
        result: Result = end.value
        return result
    finally:
        del master.listeners[standard.ANSWERS]


async def _exchange(master: Master, request: LssRequest, answers: list[bytes], wait: float) -> bytes | None:
    master.drain()  # discards a late answer to the request before
    answers.clear()
    LSS_LOG.debug("%s: %s", _words(request.command), request.data.hex(" "))
    master.send(standard.REQUESTS, request.data)
    if request.answer is None:
        return None
    await master.pump.steps(_wait(request, wait), lambda: not request.to_all and any(_fitting(answers, request)))
    fitting = [*_fitting(answers, request)]
    if request.to_all and len(fitting) > 1:
        raise RemoteError(f"{len(fitting)} devices answer, so none is alone on the bus: --identity selects one")
    answer = fitting[0] if fitting else None
    LSS_LOG.debug("answer: %s", answer.hex(" ") if answer else "none")
    return answer


def _fitting(answers: list[bytes], request: LssRequest) -> Iterator[bytes]:
    return (each for each in answers if len(each) == standard.LENGTH and each[0] == request.answer)


def _wait(request: LssRequest, wait: float) -> float:
    return STORE_WAIT if request.command is standard.Lss.STORE else wait * request.patience
