"""Clauses of a standard as steps: each with its number, topic and tier, what it needs of a file, and its step's names.

A report has no more of a step than its name: `StepName` writes it for the suite, and reads it again for the report.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Generic, NamedTuple, TypeAlias, TypeVar

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.step import Data, Steps
from eurobot_od.check.conformance.subject import EVERY_INDEX, Subject, Tier, fresh, need, or_skipped
from eurobot_od.check.format import VERSION
from eurobot_od.od.values import Address

NAME = re.compile(
    r"(?P<clause>[\d.]+|0x[0-9A-F]{4}) (?P<topic>[^:]+): (?P<what>.*?)"
    r" \[(?P<tier>[a-z]+)(?:, CTT (?P<ctt>[\d., to]+))?\](?:(?: \d+/\d+)?: (?P<inside>.*))?"
)


OWN_NUMBERS = re.compile(r" \[CTT (?P<ctt>[\d., to]+)\]$")


class StepName(NamedTuple):
    """The parts of a name: `ctt` as it is written, `2.8, 2.9` or `7.1 to 7.6`; `inside` is the step of a group."""

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
        """The numbers of CiA's tool, each by itself; a step of a group may have its own."""
        numbers: list[str] = []
        own = OWN_NUMBERS.search(self.inside)
        for part in filter(None, (own["ctt"] if own else self.ctt).split(", ")):
            first, _, last = part.partition(" to ")
            chapter, _, number = first.partition(".")
            end = last.partition(".")[2] or number
            numbers += [f"{chapter}.{each}" for each in range(int(number), int(end) + 1)]
        return tuple(numbers)


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
    """Have the numbers of CiA's tool that steps inside a step ask stand in their names."""
    noted: dict[str, object] = {key: value for key, value in data.items() if key != "ctt"}
    if "steps" in data:
        noted["steps"] = [_noted({**each, "name": _with_numbers(each)}) for each in data["steps"]]
    return noted


def _with_numbers(data: Data) -> str:
    return f"{data['name']} [CTT {data['ctt']}]" if "ctt" in data else str(data["name"])


@dataclass(frozen=True)
class Clause(Generic[SubjectT]):
    """A clause: its number or the object that it is about, its topic, and what makes its steps from what a file says.

    `ctt` are the numbers that the same tests have in CiA's conformance test tool, `only` the indices that it looks at.
    If the file lacks one of its `needs` a skip called `name` takes the place of its steps.
    """

    number: str
    topic: str
    steps: StepsOf[SubjectT]
    tier: Tier = Tier.READING
    ctt: str = ""
    name: str = ""
    needs: Sequence[Need[SubjectT]] = ()
    only: range = EVERY_INDEX

    def named(self, subject: SubjectT) -> Iterator[Data]:
        """Give the steps, each with a name that begins with the clause and ends with tier and CTT number."""
        left_out = [step.skip("not done", f"only with --{self.tier.value}")]
        allowed = subject.tier.allows(self.tier)
        for each in or_skipped(self.name, self._made, subject) if allowed else left_out:
            name = StepName(self.number, self.topic, each["name"], self.tier.value, each.get("ctt", self.ctt))
            yield {**_noted(each), "name": str(name)}

    def _made(self, subject: SubjectT) -> Steps:
        for needed in self.needs:
            needed(subject)
        # A subject of its own only where it has to be: each builds its model of the device anew.
        yield from self.steps(subject if self.only == EVERY_INDEX else replace(subject, only=self.only))


class Chapter(list[Clause[SubjectT]]):
    """A suite: its word, what it is about, and its clauses in the order of its file.

    Groups of steps that leave traces in the communication begin and end with a reset of it if it is `fresh`, and put
    back what the objects that they `change` had.
    """

    def __init__(
        self, word: str, about: str, *, standard: int = 301, fresh: bool = False, change: Sequence[Address] = ()
    ) -> None:
        super().__init__()
        self.word, self.about, self._fresh, self._change = word, f"CiA {standard}, {about}", fresh, change

    def clause(
        self,
        number: str,
        topic: str,
        tier: Tier = Tier.READING,
        ctt: str = "",
        *,
        group: str = "",
        name: str = "",
        needs: Sequence[Need[SubjectT]] = (),
        only: range = EVERY_INDEX,
    ) -> Callable[[StepsOf[SubjectT]], StepsOf[SubjectT]]:
        """Enter a function as a clause; one that is entered twice has first the lower one.

        Its steps are a `group` of this name, which the skip has as well; or each stands for itself, and `name` is only
        the skip's.
        """

        def enter(steps: StepsOf[SubjectT]) -> StepsOf[SubjectT]:
            made = self._grouped(group, steps) if group else steps
            self.append(Clause(number, topic, made, tier, ctt, group or name, needs, only))
            return steps

        return enter

    def _grouped(self, name: str, steps: StepsOf[SubjectT]) -> StepsOf[SubjectT]:
        return lambda subject: [self.group(subject, name, steps(subject))]

    def group(self, subject: SubjectT, name: str, steps: Steps) -> Data:
        """Return a group of this chapter."""
        kept = subject.kept(self._change)
        before = [*fresh(), *(step.save(*each) for each in kept)] if self._fresh else ()
        # Not by the reset alone: one that takes what it should refuse may keep it.
        after = [*step.undoing(*fresh()), *(step.put_back(*each) for each in kept)] if self._fresh else ()
        return step.group(name, *before, *steps, *after)

    def suite(self, subject: SubjectT, tag: str, before: Sequence[Data], after: Sequence[Data]) -> Data:
        """Return the suite of a device, with what is done before and after the clauses."""
        steps = (each for clause in self for each in clause.named(subject))
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
