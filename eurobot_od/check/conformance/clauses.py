"""The parts of a conformance suite: a device as its file describes it, and the clauses of a standard as steps.

A clause has its number, topic and tier, its needs in the file, and its steps' names. A report knows only a step's name:
`StepName` writes it for the suite and parses it for the report.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Generic, NamedTuple, TypeAlias, TypeVar

from canopen.objectdictionary import ODVariable

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.step import Data, Steps
from eurobot_od.check.format import VERSION
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
"""Maximum time between two EMCYs that a step waits for, in 100 us."""


class Tier(Enum):
    """What steps may change; the value is the word in reports, and the name of the option."""

    READING = "reading"
    """Writes only the heartbeat time, which acts at once and is restored; addresses no other node."""
    REVERSIBLE = "reversible"
    """NMT commands and resets, PDO records, own values written again, refused values of communication objects."""
    DESTRUCTIVE = "destructive"
    """Everything else: other values, refused values of manufacturer objects, store and restore, frames to others."""
    MOTION = "motion"
    """Drives only: the motor gets torque, and moves."""
    OUTPUTS = "outputs"
    """I/O modules only: outputs are switched."""

    def allows(self, tier: Tier) -> bool:
        """Return whether a run of this tier does steps of another.

        Each tier includes reading; each but reading includes reversible.
        """
        return tier in (self, Tier.READING) or (tier is Tier.REVERSIBLE and self is not Tier.READING)


# What a file may lack


class Lacks(Exception):
    """The file lacks what some steps need; the text is the reason for skipping them."""


def need(found: FoundT | None, reason: str) -> FoundT:
    """Return `found`; raises Lacks with the reason if it is None, False or empty."""
    if not found:
        raise Lacks(reason)
    return found


def has(needed: Callable[..., object], *arguments: object) -> bool:
    """Return whether a need is met."""
    try:
        needed(*arguments)
    except Lacks:
        return False
    return True


def or_skipped(name: str, steps: Callable[..., Steps], *arguments: object) -> list[Data]:
    """Return the steps, or a skip of this name with the reason if the file lacks something."""
    try:
        return list(steps(*arguments))
    except Lacks as lack:
        return [step.skip(name, str(lack))]


# The device


@dataclass(frozen=True)
class DeviceUnderTest:
    """The device under test, the `tier` of its steps, and in `only` the indices that are tested one by one."""

    dictionary: Dictionary
    tier: Tier = Tier.READING
    only: range = EVERY_INDEX

    @cached_property
    def model(self) -> Device:
        """A simulated device made from the file; the suites expect its values after power-on."""
        return Device(self.dictionary)

    @cached_property
    def pdos(self) -> list[Pdo]:
        """The PDOs with a correct description in the file, valid or not."""
        return list(self.dictionary.read_pdos(self.model.objects.value, lambda _: None))

    def of(self, direction: PdoDirection) -> list[Pdo]:
        """Return the PDOs of one direction."""
        return [each for each in self.pdos if each.direction is direction]

    def need_seen(self, pdo: Pdo) -> None:
        """Need a PDO whose frames can be recognised; raises Lacks."""
        need(pdo.valid, f"{pdo.title} is not valid by default")
        # A frame is recognised by its COB-ID, so no other PDO or service may use that.
        taken = Counter(each.cob_id for each in self.pdos if each.valid) + Counter(self.model.service_identifiers)
        need(taken[pdo.cob_id] <= 1, f"{pdo.title} shares its COB-ID 0x{pdo.cob_id:03X}")
        need(pdo.length, f"{pdo.title} maps nothing")
        mapped = {each.pdo.index for each in self.model.protocol.bindings}
        need(pdo.index in mapped, f"{pdo.title} has a mapping that does not hold")

    def seen(self, direction: PdoDirection) -> list[Pdo]:
        """Return the PDOs of one direction whose frames can be recognised."""
        return [each for each in self.of(direction) if has(self.need_seen, each)]

    @property
    def rpdo(self) -> Pdo:
        """The first valid RPDO with data that takes effect at once, otherwise the first with data.

        Raises Lacks if there is none.
        """
        # A synchronous RPDO takes effect with the next SYNC, and some devices check its length only then.
        found = min(self.seen(PdoDirection.RPDO), key=lambda each: each.is_synchronous, default=None)
        return need(found, "the file has no valid RPDO with data")

    @cached_property
    def objects(self) -> list[ODVariable]:
        """The variables of the file, in the order of their addresses."""
        chosen = (index for index in sorted(self.dictionary.members) if index in self.only)
        return [each for index in chosen for each in members(self.dictionary.objects, index)]

    @property
    def probe(self) -> Address:
        """An object to read to see whether the device answers.

        It is the error register, otherwise a number that fits one frame; never a text, which may have no value or need
        segments.
        """
        numbers = (each for each in self.objects if each.readable and 0 < data_type(each).size <= 4)
        others = (address_of(each) for each in numbers)
        return ERROR_REGISTER if self.readable(ERROR_REGISTER) is not None else next(others, ERROR_REGISTER)

    def kept(self, addresses: Iterable[Address]) -> list[tuple[ODVariable, str]]:
        """Return the objects among these that can be restored, each with the variable for its value."""
        found = filter(None, map(self.settable, addresses))
        return [(each, f"kept_{each.index:04X}_{each.subindex}") for each in found]

    def find(self, address: Address) -> ODVariable | None:
        """Return a variable, None if the file does not have it."""
        return self.dictionary.variable(address)

    def readable(self, address: Address) -> ODVariable | None:
        """Return a variable that can be read, None if it cannot."""
        found = self.find(address)
        return found if found is not None and found.readable else None

    def settable(self, address: Address) -> ODVariable | None:
        """Return a variable that can be read, written and set to its default again, None if it cannot."""
        found = self.readable(address)
        # A default outside the file's own limits could not be written again.
        usable = found is not None and found.writable and in_limits(found, self.model.objects.kept(address))
        return found if usable else None

    def number(self, address: Address) -> int:
        """Return the integer that a variable has after power-on, 0 without a value."""
        return self.model.objects.raw(address)

    @property
    def another(self) -> int:
        """A node-ID that neither the device has nor its file monitors; the tester plays this node."""
        # A monitored node would be reported as lost when the tester stops to play it.
        watched = {heartbeat_entry(self.number((CONSUMED_HEARTBEATS, sub)))[0] for sub in range(1, MOST_SUBS + 1)}
        # From the highest one down, as node-IDs are usually assigned from 1 on.
        return next(each for each in reversed(NODE_IDS) if each != self.dictionary.node_id and each not in watched)

    def may_be(self, address: Address, *values: int) -> bool:
        """Return whether an object can be written, may have all these values, and can be set to its default again."""
        found = self.settable(address)
        return found is not None and all(in_limits(found, value) for value in values)

    # Emergencies

    def need_emcy(self) -> None:
        """Need an EMCY with a COB-ID in the file, as reports take it from there; raises Lacks."""
        need(base_identifier(self.dictionary.default(EMCY)) is not None, NO_EMCY)

    def need_prompt_emcy(self) -> None:
        """Need an EMCY whose inhibit time is short enough to wait for; raises Lacks."""
        self.need_emcy()
        # An EMCY may be delayed by this time after the one before; a step that waits less would be red without a fault.
        late = f"the file's EMCY may be {LONGEST_INHIBIT // 10} ms apart and more (0x1015)"
        need(self.number(EMCY_INHIBIT_TIME) <= LONGEST_INHIBIT, late)

    # Frames of its SDO server

    def request(self, data: bytes) -> Data:
        """Return the action that sends an SDO request as a raw frame."""
        return {"send": {"raw": f"{self.model.sdo_service.requests:03X}#{data.hex().upper()}"}}

    def answer(self, digits: str) -> Data:
        """Return the pattern of an answer of the SDO server; `?` is any digit."""
        return {"raw": f"{self.model.sdo_service.answers:03X}#{digits}"}


# Steps with it


def fresh(command: str = "reset communication") -> Steps:
    """Set the communication to the values of power-on by a reset, and bring the device to PRE-OPERATIONAL."""
    yield step.nmt(command)
    # A reset may take any time: the device may still answer, and then lose a request. Only the boot-up ends it
    # (CiA 301, 7.3.2.2.2).
    yield step.booted()
    yield step.nmt("pre-operational")


def awake(device: DeviceUnderTest, name: str = "answers an SDO request") -> Data:
    """Read an object until the device answers, if only by an abort.

    If the device does not come back, this is reported once, as nothing else can be tested then.
    """
    return {
        "name": name,
        "needed": "yes",
        "poll": {**device.request(initiate(ClientCommand.UPLOAD << 5, device.probe)), "every": "100 ms"},
        "until": device.answer("?" * 16),
        "within": step.BOOT_TIME,
    }


# Clauses

NAME = re.compile(
    r"(?P<clause>[\d.]+|0x[0-9A-F]{4}) (?P<topic>[^:]+): (?P<what>.*?)"
    r" \[(?P<tier>[a-z]+)(?:, CTT (?P<ctt>[\d., ]+))?\](?:(?: \d+/\d+)?: (?P<inside>.*))?"
)


OWN_NUMBER = re.compile(r" \[CTT ([\d.]+)\]")


class StepName(NamedTuple):
    """The parts of a step's name.

    `ctt` are numbers of CiA's tool, of a skipped step also several: `2.8, 2.9`. `inside` names the step of a group.
    """

    clause: str
    topic: str
    what: str
    tier: str
    ctt: str = ""
    inside: str = ""

    @classmethod
    def of(cls, name: str) -> StepName | None:
        """Parse the name of a step; return None if it is not from a conformance suite."""
        match = NAME.fullmatch(name)
        return cls(**{key: text or "" for key, text in match.groupdict().items()}) if match else None

    def __str__(self) -> str:
        note = f"[{self.tier}, CTT {self.ctt}]" if self.ctt else f"[{self.tier}]"
        inside = f": {self.inside}" if self.inside else ""
        return f"{self.clause} {self.topic}: {self.what} {note}{inside}"

    @property
    def numbers(self) -> tuple[str, ...]:
        """Numbers of CiA's tool: at most one for a step that is done; a step of a group may have its own."""
        own = OWN_NUMBER.findall(self.inside)
        return tuple(own[-1:] or filter(None, self.ctt.split(", ")))


ANSWERS = "7.2.4.3.5 SDO: the device answers [reading]"
"""Name of the first step of each suite."""

DeviceT = TypeVar("DeviceT", bound=DeviceUnderTest)

StepsOf: TypeAlias = Callable[[DeviceT], Steps]
"""Makes the steps of a clause, whose names lack the clause's number; raises Lacks."""

Need: TypeAlias = Callable[[DeviceT], object]
"""Checks the file; raises Lacks if something is missing."""


def settable(address: Address, *values: int, lack: str) -> Need[DeviceUnderTest]:
    """Return a need: an object that may have these values and can be restored; `lack` is the reason for skipping."""
    return lambda device: need(device.may_be(address, *values), lack)


def _noted(data: Data) -> Data:
    """Return a step with the numbers of CiA's tool in the names of its inner steps."""
    noted: dict[str, object] = {key: value for key, value in data.items() if key != "ctt"}
    if "steps" in data:
        inside = [_noted(each) for each in data["steps"]]
        noted["steps"] = [
            {**new, "name": f"{new['name']} [CTT {old['ctt']}]"} if old.get("ctt") else new
            for new, old in zip(inside, data["steps"])
        ]
    return noted


def _numbers_inside(data: Data) -> bool:
    """Return whether an inner step has its own number of CiA's tool."""
    return any(each.get("ctt") or _numbers_inside(each) for each in data.get("steps", ()))


class Chapter(list["tuple[Clause[DeviceT], StepsOf[DeviceT]]"], Generic[DeviceT]):
    """A suite: its tag, its topic, and its clauses in the order of their file, each with what makes its steps.

    If it is `fresh`, its groups begin and end with a reset of the communication, and restore the objects that they
    `change`.
    """

    def __init__(
        self, word: str, about: str, *, standard: int = 301, fresh: bool = False, change: Sequence[Address] = ()
    ) -> None:
        super().__init__()
        self.word = word
        self.about = f"CiA {standard}, {about}"
        self._fresh = fresh
        self._change = change

    def group(self, device: DeviceT, name: str, steps: Steps) -> Data:
        """Return a group of this chapter."""
        kept = device.kept(self._change)
        before = [*fresh(), *(step.save(*each) for each in kept)] if self._fresh else ()
        # Also written back after the reset, as a faulty device may keep a value that it should refuse.
        after = [*step.undoing(*fresh()), *(step.put_back(*each) for each in kept)] if self._fresh else ()
        return step.group(name, *before, *steps, *after)

    def suite(self, device: DeviceT, tag: str, before: Sequence[Data], after: Sequence[Data]) -> Data:
        """Return the suite of a device; `before` is its setup, `after` its teardown."""
        steps = (each for clause, made in self for each in clause.named(device, made))
        return {
            "spec": VERSION,
            "name": self.about,
            "node": device.dictionary.name,
            "tags": [tag, self.word],
            "setup": before,
            # Equal skips become one step.
            "steps": [
                *{each["name"] if "skip" in each else number: each for number, each in enumerate(steps)}.values()
            ],
            **({"teardown": after} if after else {}),
        }


@dataclass(frozen=True)
class Clause(Generic[DeviceT]):
    """A clause, used as a decorator of the function that makes its steps: its number, or its object, and its topic.

    Of two decorators of a function, the lower one comes first. `ctt` are the numbers of these tests in CiA's
    conformance test tool, `only` the indices that are tested. The steps become one `group` of this name, or stay
    single. If the file lacks one of the `needs`, a skip with the name of the group, or `name`, replaces the steps.
    """

    chapter: Chapter[DeviceT]
    number: str
    topic: str
    tier: Tier = Tier.READING
    ctt: str = ""
    _: KW_ONLY
    group: str = ""
    name: str = ""
    needs: Sequence[Need[DeviceT]] = ()
    only: range = EVERY_INDEX

    def __call__(self, steps: StepsOf[DeviceT]) -> StepsOf[DeviceT]:
        """Add a function to the chapter."""
        self.chapter.append((self, steps))
        return steps

    def named(self, device: DeviceT, steps: StepsOf[DeviceT]) -> Iterator[Data]:
        """Yield the steps, with names that begin with the clause and end with tier and CTT number."""
        if device.tier.allows(self.tier):
            made = or_skipped(self.group or self.name, self._made, device, steps)
        else:
            made = [step.skip("not done", f"only with --{self.tier.value}")]
        for each in made:
            asked = "" if _numbers_inside(each) else each.get("ctt", self.ctt)
            name = StepName(self.number, self.topic, each["name"], self.tier.value, asked)
            yield {**_noted(each), "name": str(name)}

    def _made(self, device: DeviceT, steps: StepsOf[DeviceT]) -> Steps:
        for needed in self.needs:
            needed(device)
        # A new DeviceUnderTest only if needed, as each builds its own model.
        seen = device if self.only == EVERY_INDEX else replace(device, only=self.only)
        yield from [self.chapter.group(seen, self.group, steps(seen))] if self.group else steps(seen)
