"""What a conformance suite is about: a device as its file describes it, what a run may cost, what a file may lack."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TypeVar

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.step import Data, Steps
from eurobot_od.device.device import Device
from eurobot_od.device.nmt import heartbeat_entry
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, data_type, in_limits, members
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, EMCY, EMCY_INHIBIT_TIME, ERROR_REGISTER
from eurobot_od.od.values import MOST_SUBS, NODE_IDS, Address, PdoDirection, base_identifier
from eurobot_od.sdo.wire import ClientCommand, initiate

FoundT = TypeVar("FoundT")

NO_EMCY = "the file has no valid EMCY (0x1014)"
NO_DEVICE_TYPE = "the file has no device type (0x1000)"

EVERY_INDEX = range(0x10000)

LONGEST_INHIBIT = 1000
"""The longest time between two EMCY for which a step waits, in 100 us."""

BOOT_TIME = "10 s"
"""How long a device may take from a reset to its boot-up, and to its first SDO answer; the standard names no time."""


class Tier(Enum):
    """What a step may cost; the value is the word in reports, and of the option."""

    READING = "reading"
    """Nothing is written but the heartbeat time, which acts at once and is put back; no other node is addressed."""
    REVERSIBLE = "reversible"
    """NMT commands and resets, PDO records, own values written back, refused values of communication objects."""
    DESTRUCTIVE = "destructive"
    """All else: other values, refused values of the maker's objects, store and restore, frames to others."""
    MOTION = "motion"
    """Drives only: the motor gets torque, and moves."""
    OUTPUTS = "outputs"
    """I/O modules only: outputs are switched."""

    def allows(self, tier: Tier) -> bool:
        """Whether a run of this tier does the steps of another: what is more than reading is reversible as well."""
        return tier in (self, Tier.READING) or (tier is Tier.REVERSIBLE and self is not Tier.READING)


# What a file may lack


class Lacks(Exception):
    """The file lacks what some steps need; the text is the reason with which they are skipped."""


def need(found: FoundT | None, reason: str) -> FoundT:
    """Return what was found; raises Lacks with the reason if that is None, False, or empty."""
    if not found:
        raise Lacks(reason)
    return found


def has(needed: Callable[..., object], *arguments: object) -> bool:
    """Whether the file lacks nothing of what is needed."""
    try:
        needed(*arguments)
    except Lacks:
        return False
    return True


def or_skipped(name: str, steps: Callable[..., Steps], *arguments: object) -> list[Data]:
    """Make some steps, or in their place a skip of this name with the reason why they cannot be made."""
    try:
        return list(steps(*arguments))
    except Lacks as lack:
        return [step.skip(name, str(lack))]


# The device


@dataclass(frozen=True)
class Subject:
    """The device under test, up to which `tier` it may be asked, and `only` which indices are looked at one by one."""

    dictionary: Dictionary
    tier: Tier = Tier.READING
    only: range = EVERY_INDEX

    @cached_property
    def model(self) -> Device:
        """A device that is its file: what it has after power-on is what the suites expect."""
        return Device(self.dictionary)

    @cached_property
    def pdos(self) -> list[Pdo]:
        """The PDOs that the file describes well, valid or not."""
        return list(self.dictionary.read_pdos(self.model.objects.value, lambda _: None))

    def of(self, direction: PdoDirection) -> list[Pdo]:
        """Return the PDOs of a direction."""
        return [each for each in self.pdos if each.direction is direction]

    def need_seen(self, pdo: Pdo) -> None:
        """Need a PDO whose frames come, and can be distinguished from others; raises Lacks."""
        need(pdo.valid, f"{pdo.title} is not valid by default")
        # Counted over all PDOs and services: by its identifier alone nobody could say whose frame it was that came.
        taken = Counter(each.cob_id for each in self.pdos if each.valid) + Counter(self.model.service_identifiers)
        need(taken[pdo.cob_id] <= 1, f"{pdo.title} shares its COB-ID 0x{pdo.cob_id:03X}")
        need(pdo.length, f"{pdo.title} maps nothing")
        mapped = {each.pdo.index for each in self.model.protocol.bindings}
        need(pdo.index in mapped, f"{pdo.title} has a mapping that does not hold")

    def seen(self, direction: PdoDirection) -> list[Pdo]:
        """Return the PDOs of a direction whose frames can be looked at."""
        return [each for each in self.of(direction) if has(self.need_seen, each)]

    @property
    def rpdo(self) -> Pdo:
        """The first valid RPDO with data that takes effect at once, else the first at all; raises Lacks without one."""
        # One that waits for SYNC takes effect only with the next one, and some devices look at its length only then.
        found = min(self.seen(PdoDirection.RPDO), key=lambda each: each.is_synchronous, default=None)
        return need(found, "the file has no valid RPDO with data")

    @cached_property
    def objects(self) -> list[ODVariable]:
        """The variables of the file, by address."""
        chosen = (index for index in sorted(self.dictionary.members) if index in self.only)
        return [each for index in chosen for each in members(self.dictionary.objects, index)]

    @property
    def probe(self) -> Address:
        """An object to ask for, to see whether the device answers: its error register, else a number that fits a frame.

        Never a text, which may have no value, or need segments.
        """
        numbers = (each for each in self.objects if each.readable and 0 < data_type(each).size <= 4)
        others = (address_of(each) for each in numbers)
        return ERROR_REGISTER if self.readable(ERROR_REGISTER) is not None else next(others, ERROR_REGISTER)

    def kept(self, addresses: Iterable[Address]) -> list[tuple[ODVariable, str]]:
        """Return those of some objects that can be put back, each with the name of what keeps its value."""
        found = filter(None, map(self.settable, addresses))
        return [(each, f"kept_{each.index:04X}_{each.subindex}") for each in found]

    def find(self, address: Address) -> ODVariable | None:
        """Return a variable, None if the file does not have it."""
        return self.dictionary.variable(address)

    def readable(self, address: Address) -> ODVariable | None:
        """Return a variable that can be read; None if there is none."""
        found = self.find(address)
        return found if found is not None and found.readable else None

    def settable(self, address: Address) -> ODVariable | None:
        """Return a variable that can be read, written, and given its default again; None if there is none."""
        found = self.readable(address)
        # A default outside the file's own limits could not be given back.
        usable = found is not None and found.writable and in_limits(found, self.model.objects.kept(address))
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
        return next(each for each in reversed(NODE_IDS) if each != self.dictionary.node_id and each not in watched)

    def may_be(self, address: Address, *values: int) -> bool:
        """Whether an object can be written, given its default again, and may have some values meanwhile."""
        found = self.settable(address)
        return found is not None and all(in_limits(found, value) for value in values)

    # Emergencies

    def need_emcy(self) -> None:
        """Need an EMCY with an identifier in the file: reports find it only there; raises Lacks."""
        need(base_identifier(self.dictionary.default(EMCY)) is not None, NO_EMCY)

    def need_prompt_emcy(self) -> None:
        """Need an EMCY that can be waited for; raises Lacks."""
        self.need_emcy()
        # The EMCY may come as late as that after the one before, and a step that waits less would be red for nothing.
        late = f"the file's EMCY may be {LONGEST_INHIBIT // 10} ms apart and more (0x1015)"
        need(self.number(EMCY_INHIBIT_TIME) <= LONGEST_INHIBIT, late)

    # Frames of its SDO server

    def request(self, data: bytes) -> Data:
        """Return the step that sends an SDO request as it is."""
        return {"send": {"raw": f"{self.model.sdo_requests:03X}#{data.hex().upper()}"}}

    def answer(self, digits: str) -> Data:
        """Return the pattern of an answer of the SDO server, `?` for any digit."""
        return {"raw": f"{self.model.sdo_answers:03X}#{digits}"}


# Steps with it


def fresh(command: str = "reset communication") -> Steps:
    """Give the communication the values of power-on by a reset, and wait until the device is in PRE-OPERATIONAL."""
    yield step.nmt(command)
    # A reset takes as long as the device likes: it may answer meanwhile, and then lose what it was sent. The boot-up
    # alone ends it (CiA 301, 7.3.2.2.2).
    yield step.booted(BOOT_TIME)
    yield step.nmt("pre-operational")


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
