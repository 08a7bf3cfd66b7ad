"""What a conformance suite is about: a device as its file describes it, and how steps name its services."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from eurobot_od.check.conformance.naming import StepName
from eurobot_od.check.conformance.writing import Data, hexadecimal, object_at, shown
from eurobot_od.device.device import Device
from eurobot_od.device.nmt import heartbeat_entry
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, data_type, in_limits, members
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, DEVICE_TYPE, EMCY, EMCY_INHIBIT_TIME
from eurobot_od.od.values import MOST_SUBS, NODE_IDS, Address, PdoDirection, base_identifier, label
from eurobot_od.sdo.wire import AbortCode, ClientCommand, initiate

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


BUSY = (AbortCode.NOT_TRANSFERRED, AbortCode.LOCAL_CONTROL, AbortCode.STATE)
"""Aborts by which a device says that it will not take a value now (CiA 301, Table 22: 0x0800002x)."""

NO_EMCY = "the file has no valid EMCY (0x1014)"

EVERY_INDEX = range(0x10000)

LONGEST_INHIBIT = 1000
"""The longest time between two EMCY for which a step waits, in 100 us."""

BOOT_TIME = "10 s"
"""How long a device may take from a reset to its boot-up, and to its first SDO answer; the standard names no time."""


def title(variable: ODVariable) -> str:
    """Write address and ParameterName as a step's name has them."""
    return label(address_of(variable), shown(variable.name))


OUTSIDE = (AbortCode.VALUE, AbortCode.TOO_LOW, AbortCode.TOO_HIGH)
"""Aborts of a device that looks at an object's limits first, whatever else is wrong with a value."""


class Tier(IntEnum):
    """What a step may cost: each tier allows what the ones before it do."""

    READING = 0
    """Nothing is written but the heartbeat time, which acts at once and is put back; no other node is addressed."""
    REVERSIBLE = 1
    """NMT commands and resets, PDO records, own values written back, refused values of communication objects."""
    DESTRUCTIVE = 2
    """All else: other values, refused values of the maker's objects, store and restore, frames to others."""

    @property
    def word(self) -> str:
        """Its name in reports, and of its option."""
        return self.name.lower()


@dataclass(frozen=True)
class Subject:
    """The device under test, up to which `tier` it may be asked, and `only` which indices are looked at one by one.

    `restore` are the sub-indices of 0x1011 behind which there is something of the maker's, and which may be written.
    """

    dictionary: Dictionary
    tier: Tier = Tier.READING
    only: range = EVERY_INDEX
    restore: tuple[int, ...] = ()

    @property
    def node_id(self) -> int:
        """The node-ID."""
        return self.dictionary.node_id

    @cached_property
    def model(self) -> Device:
        """A device that is its file: what it has after power-on is what the suites expect."""
        return Device(self.dictionary)

    @cached_property
    def pdos(self) -> list[Pdo]:
        """The PDOs that the file describes well, valid or not."""
        return list(self.dictionary.read_pdos(self.model.objects.value, lambda _: None))

    def why_not_seen(self, pdo: Pdo) -> str:
        """Say why a PDO's frames cannot be distinguished from others, or never come; empty if they can be looked at."""
        # Counted over all PDOs and services: by its identifier alone nobody could say whose frame it was that came.
        taken = Counter(each.cob_id for each in self.pdos if each.valid) + Counter(self.model.service_identifiers)
        mapped = {each.pdo.index for each in self.model.protocol.bindings}
        reasons = {
            "is not valid by default": not pdo.valid,
            f"shares its COB-ID 0x{pdo.cob_id:03X}": taken[pdo.cob_id] > 1,
            "maps nothing": not pdo.length,
            "has a mapping that does not hold": pdo.index not in mapped,
        }
        found = next((reason for reason, holds in reasons.items() if holds), "")
        return found and f"{pdo.title} {found}"

    @property
    def rpdo(self) -> Pdo | None:
        """The first valid RPDO with data that takes effect at once, else the first at all; None without one."""
        rpdos = (each for each in self.pdos if each.direction is PdoDirection.RPDO)
        seen = (each for each in rpdos if not self.why_not_seen(each))
        # One that waits for SYNC takes effect only with the next one, and some devices look at its length only then.
        return min(seen, key=lambda each: each.is_synchronous, default=None)

    @cached_property
    def objects(self) -> list[ODVariable]:
        """The variables of the file, by address."""
        chosen = (index for index in sorted(self.dictionary.members) if index in self.only)
        return [each for index in chosen for each in members(self.dictionary.objects, index)]

    @property
    def probe(self) -> Address:
        """An object to ask for, to see whether the device answers: the device type, else the first that is readable."""
        readable = (address_of(each) for each in self.objects if each.readable)
        return DEVICE_TYPE if self.find(DEVICE_TYPE) is not None else next(readable, DEVICE_TYPE)

    def find(self, address: Address) -> ODVariable | None:
        """Return a variable, None if the file does not have it."""
        return self.dictionary.variable(address)

    def settable(self, address: Address) -> ODVariable | None:
        """Return a variable that can be read, written, and given its default again; None if there is none."""
        found = self.find(address)
        # A default outside the file's own limits could not be given back.
        usable = (
            found is not None
            and found.readable
            and found.writable
            and in_limits(found, self.model.objects.kept(address))
        )
        return found if usable else None

    def number(self, address: Address) -> int:
        """Return the number that a variable has after power-on, 0 without one."""
        return self.model.objects.raw(address)

    @property
    def another(self) -> int:
        """A node-ID that neither the device has nor its file watches: the tester plays that node."""
        # One that the device watches would be reported as lost when the tester stops playing it.
        watched = {heartbeat_entry(self.number((CONSUMED_HEARTBEATS, sub)))[0] for sub in range(1, MOST_SUBS + 1)}
        # From above: makers and teams count their devices from 1, so that a high number is most likely nobody's.
        return next(each for each in reversed(NODE_IDS) if each != self.node_id and each not in watched)

    def may_be(self, address: Address, value: int) -> bool:
        """Whether an object can be written, given its default again, and may have a value meanwhile."""
        found = self.settable(address)
        return found is not None and in_limits(found, value)

    # Emergencies

    @property
    def has_emcy(self) -> bool:
        """Whether the file gives EMCY an identifier: reports find it only there."""
        return base_identifier(self.dictionary.default(EMCY)) is not None

    @property
    def why_no_emcy(self) -> str:
        """Say why no EMCY can be waited for; nothing if one can."""
        if not self.has_emcy:
            return NO_EMCY
        # The EMCY may come as late as that after the one before, and a step that waits less would be red for nothing.
        late = self.number(EMCY_INHIBIT_TIME) > LONGEST_INHIBIT
        return f"the file's EMCY may be {LONGEST_INHIBIT // 10} ms apart and more (0x1015)" if late else ""

    # Frames of its SDO server

    def request(self, data: bytes) -> Data:
        """Return the step that sends an SDO request as it is."""
        return {"send": {"raw": f"{self.model.sdo_requests:03X}#{data.hex().upper()}"}}

    def answer(self, digits: str) -> Data:
        """Return the pattern of an answer of the SDO server, `?` for any digit."""
        return {"raw": f"{self.model.sdo_answers:03X}#{digits}"}


StepsOf: TypeAlias = "Callable[[Subject], Iterable[Data]]"
"""Makes the steps of a clause; their names do not have its number yet."""


class Clause(NamedTuple):
    """A clause of CiA 301, its topic, and what makes its steps from what a file says.

    `ctt` are the numbers that the same tests have in CiA's conformance test tool, `only` the indices that it looks at.
    """

    number: str
    topic: str
    steps: StepsOf
    tier: Tier = Tier.READING
    ctt: str = ""
    only: range = EVERY_INDEX

    def named(self, subject: Subject) -> Iterator[Data]:
        """Give the steps, each with a name that begins with the clause and ends with tier and CTT number."""
        # A subject of its own only where it has to be: each builds its model of the device anew.
        looked_at = subject if self.only == EVERY_INDEX else replace(subject, only=self.only)
        left_out = [skip("not done", f"only with --{self.tier.word}")]
        for step in self.steps(looked_at) if self.tier <= subject.tier else left_out:
            name = StepName(self.number, self.topic, step["name"], self.tier.word, self.ctt)
            yield {**step, "name": str(name)}


class Chapter(list[Clause]):
    """A suite: its word, what it is about, and its clauses in the order of its file; those of a table are given."""

    def __init__(self, word: str, about: str, clauses: Iterable[Clause] = ()) -> None:
        super().__init__(clauses)
        self.word, self.about = word, about

    def clause(
        self, number: str, topic: str, tier: Tier = Tier.READING, ctt: str = "", only: range = EVERY_INDEX
    ) -> Callable[[StepsOf], StepsOf]:
        """Enter a function as a clause; one that is entered twice has first the lower one."""

        def enter(steps: StepsOf) -> StepsOf:
            self.append(Clause(number, topic, steps, tier, ctt, only))
            return steps

        return enter


# Steps


def skip(name: str, reason: str) -> Data:
    """Skip what a file does not have."""
    return {"name": name, "skip": reason}


def group(name: str, *steps: Data) -> Data:
    """Return steps that belong together."""
    return {"name": name, "steps": list(steps)}


def read(name: str, address: Address, **more: object) -> Data:
    """Read an object."""
    return {"name": name, "sdo": {"read": object_at(address), **more}}


def write(name: str, address: Address, **more: object) -> Data:
    """Write an object."""
    return {"name": name, "sdo": {"write": object_at(address), **more}}


def codes(*aborts: AbortCode) -> list[str]:
    """Write abort codes."""
    return [hexadecimal(each, 8) for each in aborts]


PRESENT = "{present}"
"""The value kept: of an integer the number, of anything else the bytes, every one of which has to come back."""


def save(variable: ODVariable, kept: str = "present") -> Data:
    """Keep an object's present value; one that has none now cannot be looked at."""
    as_bytes = {} if data_type(variable).is_integer else {"data": "any"}
    none_now = codes(AbortCode.NO_DATA)
    return read("its present value", address_of(variable), **as_bytes, save=kept, optional=none_now)


def put_back(variable: ODVariable, kept: str = "present", **more: object) -> Data:
    """Give an object the value kept."""
    key = "value" if data_type(variable).is_integer else "data"
    return write("put back", address_of(variable), **{key: f"{{{kept}}}"}, **more)


def unchanged(variable: ODVariable, name: str = "nothing has changed", **more: object) -> Data:
    """See that an object has the value kept."""
    key = "expect" if data_type(variable).is_integer else "data"
    return read(name, address_of(variable), **{key: PRESENT}, **more)


def nmt(command: str) -> Data:
    """Send an NMT command."""
    return {"name": f"NMT {command}", "nmt": command}


def heartbeat(state: str, within: str) -> Data:
    """Wait for a heartbeat, or the boot-up."""
    return {
        "name": "boot-up" if state == "boot-up" else f"heartbeat says {state}",
        "heartbeat": state,
        "within": within,
    }


def wait(time: str) -> Data:
    """Let time pass, and look at nothing that came meanwhile."""
    return {"name": f"wait {time}", "wait": time}


def expect(name: str, pattern: object, within: str) -> Data:
    """Wait for a frame."""
    return {"name": name, "expect": pattern, "within": within}


def never(name: str, pattern: object, span: str) -> Data:
    """See that a frame does not come."""
    return {"name": name, "never": pattern, "for": span}


def sent(name: str, cob_id: int, data: bytes = b"") -> Data:
    """Send a frame as it is."""
    return {"name": name, "send": {"raw": f"{cob_id:03X}#{data.hex().upper()}"}}


def remote(cob_id: int, length: int = 1) -> Data:
    """Send a remote frame, with the length of what it asks for in bytes."""
    return {"name": f"remote frame 0x{cob_id:03X}", "send": {"raw": f"{cob_id:03X}#R{length}"}}


def emcy(name: str, code: int) -> Data:
    """Wait for an EMCY."""
    return {"name": name, "emcy": hexadecimal(code), "within": "2 s"}


def fresh(subject: Subject) -> Iterator[Data]:
    """Give the communication the values of power-on, and wait until the device is in PRE-OPERATIONAL."""
    yield nmt("reset communication")
    # A reset takes as long as the device likes, and what is sent meanwhile is lost.
    yield awake(subject)
    yield nmt("pre-operational")


def awake(subject: Subject, name: str = "answers an SDO request") -> Data:
    """Ask for an object until it is answered, if only by an abort: the device is up after a reset.

    A device that does not come back is reported once: nothing else can be asked then.
    """
    return {
        "name": name,
        "needed": "yes",
        "poll": {**subject.request(initiate(ClientCommand.UPLOAD << 5, subject.probe)), "every": "100 ms"},
        "until": subject.answer("?" * 16),
        "within": BOOT_TIME,
    }
