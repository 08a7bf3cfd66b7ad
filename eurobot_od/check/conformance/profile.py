"""What the suites by device profiles have in common: clauses, and what their steps cost.

Rule of this file: a step that may not be done is not made; the report says which option it needs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Generic, Protocol, TypeAlias, TypeVar

from eurobot_od.check.conformance.naming import StepName
from eurobot_od.check.conformance.subject import skip
from eurobot_od.check.conformance.writing import Data


class Needs(Enum):
    """What a step costs: its word is that of its option."""

    READING = "reading"
    REVERSIBLE = "reversible"
    MOTION = "motion"
    OUTPUTS = "outputs"


def allowed_steps(reversible: bool, acting: Needs | None) -> frozenset[Needs]:
    """Return which steps may be done: reading always, and with those that act also the reversible ones."""
    writing = {Needs.REVERSIBLE} if reversible or acting else set()
    return frozenset({Needs.READING, *writing, *({acting} if acting else ())})


class TestedDevice(Protocol):
    """A device under test."""

    @property
    def allowed(self) -> frozenset[Needs]:
        """Which steps may be done."""


TestedT = TypeVar("TestedT", bound=TestedDevice)
StepsOf: TypeAlias = Callable[[TestedT], Iterator[Data]]


@dataclass(frozen=True)
class ProfileClause(Generic[TestedT]):
    """A clause of a profile, by its number or the object that it is about; its topic, its steps, and what they need."""

    number: str
    topic: str
    steps: StepsOf[TestedT]
    needs: Needs

    def named(self, tested: TestedT) -> Iterator[Data]:
        """Give the steps with their names."""
        not_done = [skip("not done", f"only with --{self.needs.value}")]
        for step in self.steps(tested) if self.needs in tested.allowed else not_done:
            yield {**step, "name": str(StepName(self.number, self.topic, step["name"], self.needs.value))}


class ProfileClauses(list[ProfileClause[TestedT]]):
    """The clauses of a profile, in the order of their file."""

    def clause(self, number: str, topic: str, needs: Needs) -> Callable[[StepsOf[TestedT]], StepsOf[TestedT]]:
        """Enter a function as a clause."""

        def enter(steps: StepsOf[TestedT]) -> StepsOf[TestedT]:
            self.append(ProfileClause(number, topic, steps, needs))
            return steps

        return enter

    def named(self, tested: TestedT) -> Iterator[Data]:
        """Give the steps of all clauses with their names."""
        for clause in self:
            yield from clause.named(tested)
