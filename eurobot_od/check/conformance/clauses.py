"""What a conformance suite is made of: a device as its file describes it, and the clauses of a standard as steps.

A clause has its number, topic and tier, what it needs of a file, and its steps' names. A report has no more of a step
than its name: `StepName` writes it for the suite, and reads it again for the report.
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
"""The longest time between two EMCY for which a step waits, in 100 us."""


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
        """Return whether a run of this tier does the steps of another one; all but reading include reversible ones."""
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
    """Return whether the file lacks nothing of what is needed."""
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
        """Return whether an object can be written, given its default again, and may have some values meanwhile."""
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
        return {"send": {"raw": f"{self.model.sdo_service.requests:03X}#{data.hex().upper()}"}}

    def answer(self, digits: str) -> Data:
        """Return the pattern of an answer of the SDO server, `?` for any digit."""
        return {"raw": f"{self.model.sdo_service.answers:03X}#{digits}"}


# Steps with it


def fresh(command: str = "reset communication") -> Steps:
    """Give the communication the values of power-on by a reset, and wait until the device is in PRE-OPERATIONAL."""
    yield step.nmt(command)
    # A reset takes as long as the device likes: it may answer meanwhile, and then lose what it was sent. The boot-up
    # alone ends it (CiA 301, 7.3.2.2.2).
    yield step.booted()
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
        "within": step.BOOT_TIME,
    }


# Clauses

NAME = re.compile(
    r"(?P<clause>[\d.]+|0x[0-9A-F]{4}) (?P<topic>[^:]+): (?P<what>.*?)"
    r" \[(?P<tier>[a-z]+)(?:, CTT (?P<ctt>[\d., ]+))?\](?:(?: \d+/\d+)?: (?P<inside>.*))?"
)


OWN_NUMBER = re.compile(r" \[CTT ([\d.]+)\]")


class StepName(NamedTuple):
    """The parts of a name: `ctt` as it is written, of a skipped step `2.8, 2.9`; `inside` is the step of a group."""

    clause: str
    topic: str
    what: str
    tier: str
    ctt: str = ""
    inside: str = ""

    @classmethod
    def of(cls, name: str) -> StepName | None:
        """Read the name of a step; None if it is not one of a conformance suite."""
        match = NAME.fullmatch(name)
        return cls(**{key: text or "" for key, text in match.groupdict().items()}) if match else None

    def __str__(self) -> str:
        note = f"[{self.tier}, CTT {self.ctt}]" if self.ctt else f"[{self.tier}]"
        inside = f": {self.inside}" if self.inside else ""
        return f"{self.clause} {self.topic}: {self.what} {note}{inside}"

    @property
    def numbers(self) -> tuple[str, ...]:
        """The numbers of CiA's tool: of a step that is done at most one, which a step of a group may have itself."""
        own = OWN_NUMBER.findall(self.inside)
        return tuple(own[-1:] or filter(None, self.ctt.split(", ")))


ANSWERS = "7.2.4.3.5 SDO: the device answers [reading]"
"""The name of the step by which each suite begins."""

SubjectT = TypeVar("SubjectT", bound=Subject)

StepsOf: TypeAlias = Callable[[SubjectT], Steps]
"""Makes the steps of a clause, whose names do not have its number yet; raises Lacks."""

Need: TypeAlias = Callable[[SubjectT], object]
"""Raises Lacks if the file lacks something."""


def settable(address: Address, *values: int, lack: str) -> Need[Subject]:
    """Need an object that can have some values, and be put back; `lack` is the reason."""
    return lambda subject: need(subject.may_be(address, *values), lack)


def _noted(data: Data) -> Data:
    """Have the number of CiA's tool that a step inside a step asks stand in its name."""
    noted: dict[str, object] = {key: value for key, value in data.items() if key != "ctt"}
    if "steps" in data:
        noted["steps"] = [_noted({**each, "name": _with_number(each)}) for each in data["steps"]]
    return noted


def _with_number(data: Data) -> str:
    return f"{data['name']} [CTT {data['ctt']}]" if data.get("ctt") else str(data["name"])


def _numbers_inside(data: Data) -> bool:
    """Return whether steps inside a step say themselves what they ask of CiA's tool."""
    return any(each.get("ctt") or _numbers_inside(each) for each in data.get("steps", ()))


class Chapter(list["tuple[Clause[SubjectT], StepsOf[SubjectT]]"], Generic[SubjectT]):
    """A suite: its word, what it is about, and its clauses in the order of its file, with what makes their steps.

    Groups of steps that leave traces in the communication begin and end with a reset of it if it is `fresh`, and put
    back what the objects that they `change` had.
    """

    def __init__(
        self, word: str, about: str, *, standard: int = 301, fresh: bool = False, change: Sequence[Address] = ()
    ) -> None:
        super().__init__()
        self.word, self.about, self._fresh, self._change = word, f"CiA {standard}, {about}", fresh, change

    def group(self, subject: SubjectT, name: str, steps: Steps) -> Data:
        """Return a group of this chapter."""
        kept = subject.kept(self._change)
        before = [*fresh(), *(step.save(*each) for each in kept)] if self._fresh else ()
        # Not by the reset alone: one that takes what it should refuse may keep it.
        after = [*step.undoing(*fresh()), *(step.put_back(*each) for each in kept)] if self._fresh else ()
        return step.group(name, *before, *steps, *after)

    def suite(self, subject: SubjectT, tag: str, before: Sequence[Data], after: Sequence[Data]) -> Data:
        """Return the suite of a device, with what is done before and after the clauses."""
        steps = (each for clause, made in self for each in clause.named(subject, made))
        return {
            "spec": VERSION,
            "name": self.about,
            "node": subject.dictionary.name,
            "tags": [tag, self.word],
            "setup": before,
            # Clauses that say the same of themselves are left out with one line.
            "steps": [
                *{each["name"] if "skip" in each else number: each for number, each in enumerate(steps)}.values()
            ],
            **({"teardown": after} if after else {}),
        }


@dataclass(frozen=True)
class Clause(Generic[SubjectT]):
    """A clause: its number or the object that it is about, and its topic; it decorates what makes its steps.

    A function that is decorated twice has first the lower one. `ctt` are the numbers that the same tests have in CiA's
    conformance test tool, `only` the indices that it looks at. The steps are a `group` of this name, or each stands for
    itself. If the file lacks one of its `needs` a skip called like the group, or `name`, takes the place of its steps.
    """

    chapter: Chapter[SubjectT]
    number: str
    topic: str
    tier: Tier = Tier.READING
    ctt: str = ""
    _: KW_ONLY
    group: str = ""
    name: str = ""
    needs: Sequence[Need[SubjectT]] = ()
    only: range = EVERY_INDEX

    def __call__(self, steps: StepsOf[SubjectT]) -> StepsOf[SubjectT]:
        """Enter a function in the chapter."""
        self.chapter.append((self, steps))
        return steps

    def named(self, subject: SubjectT, steps: StepsOf[SubjectT]) -> Iterator[Data]:
        """Yield the steps, each with a name that begins with the clause and ends with tier and CTT number."""
        left_out = [step.skip("not done", f"only with --{self.tier.value}")]
        allowed = subject.tier.allows(self.tier)
        for each in or_skipped(self.group or self.name, self._made, subject, steps) if allowed else left_out:
            asked = "" if _numbers_inside(each) else each.get("ctt", self.ctt)
            name = StepName(self.number, self.topic, each["name"], self.tier.value, asked)
            yield {**_noted(each), "name": str(name)}

    def _made(self, subject: SubjectT, steps: StepsOf[SubjectT]) -> Steps:
        for needed in self.needs:
            needed(subject)
        # A subject of its own only where it has to be: each builds its model of the device anew.
        seen = subject if self.only == EVERY_INDEX else replace(subject, only=self.only)
        yield from [self.chapter.group(seen, self.group, steps(seen))] if self.group else steps(seen)
