"""Incidents: what is wrong, at whom, how often, when, why likely, and what to do.

The same thing again is the same incident. So memory grows with what can be wrong, not with the frames: of each incident
there is a number, the first and the last place, and a few more; of each rule at most `MOST` incidents.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, NamedTuple

from eurobot_od.lint.findings import LEVELS, Severity
from eurobot_od.support.texts import amount, one_line

MOST = 20
"""Most incidents of one rule on one bus; all others together are one more."""

PLACES = 3
"""How many places of an incident are named."""


class SeenAt(NamedTuple):
    """Where something was seen: the time in s, and the log and its line, if there is one."""

    time: float
    log: str = ""
    line: int = 0

    def after(self, first: SeenAt | None = None) -> str:
        """Write it; behind another place in the same log, its line alone says where."""
        log = self.log if first is None or first.log != self.log else "line"
        where = f" ({log}{' ' if log == 'line' else ':'}{self.line})" if self.log else ""
        return f"{self.time:.6f} s{where}"


NOWHERE = SeenAt(0.0)


@dataclass
class Occurrences:
    """How often something was seen, where first and last, and the first few places."""

    number: int = 0
    last: SeenAt = NOWHERE
    places: list[SeenAt] = field(default_factory=list)

    @classmethod
    def once(cls, place: SeenAt) -> Occurrences:
        """Return what was seen at one place."""
        return cls(1, place, [place])

    def add(self, place: SeenAt) -> None:
        """Count it once more."""
        self.number += 1
        self.last = place
        if len(self.places) < PLACES:
            self.places.append(place)

    def join(self, other: Occurrences) -> None:
        """Count what another has counted after this one."""
        self.number += other.number
        self.last = other.last
        self.places += other.places[: PLACES - len(self.places)]


class IncidentRule(Enum):
    """What is looked for: how bad it is, in a sentence, its likely `cause`, the `remedy`, and the `clause` or source.

    The members of a subclass are its table, the causes before what follows from them: incidents of equal severity are
    shown in this order.
    """

    def __init__(self, severity: Severity, what: str, cause: str, remedy: str, clause: str) -> None:
        self.severity, self.what, self.cause, self.remedy, self.clause = severity, what, cause, remedy, clause

    @property
    def id(self) -> str:
        """Its name for people and programs: `heartbeat-lost`."""
        return self.name.lower().replace("_", "-")

    @property
    def stage(self) -> int:
        """0 for what is wrong with the bus, 1 for what is wrong with a robot on it, 2 for what nodes say of that."""
        return 0

    @property
    def rank(self) -> tuple[int, int, int]:
        """The place among all rules, worst first."""
        return list(Severity).index(self.severity), self.stage, list(type(self)).index(self)


@dataclass(frozen=True)
class Incident:
    """A rule that does not hold: on which bus (empty if there is only one), at `who`, and what exactly."""

    rule: IncidentRule
    channel: str
    who: str
    text: str
    cause: str
    remedy: str
    seen: Occurrences = field(default_factory=Occurrences)

    @property
    def title(self) -> str:
        """Who, and what: `drive: is lost`."""
        where = f"[{self.channel}] " if self.channel else ""
        return one_line(f"{where}{self.who}: {self.text}" if self.who else f"{where}{self.text}")

    @property
    def facts(self) -> list[tuple[str, str]]:
        """What is known of it besides the title, each with its heading."""
        often = "once" if self.seen.number == 1 else f"{self.seen.number} times"
        first, *others = self.seen.places
        when = f"{often}, at {first.after()}"
        if self.seen.number > 1:
            when = f"{often}, first at {first.after()}, last at {self.seen.last.after(first)}"
        also = ", ".join(each.after(first) for each in others if each != self.seen.last)
        found = [("Seen", when), ("Also at", also)]
        found += [("Likely", self.cause), ("To do", self.remedy), ("Source", f"{self.rule.clause} [{self.rule.id}]")]
        return [(what, one_line(text)) for what, text in found if text]

    def as_data(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "rule": self.rule.id,
            "level": self.rule.severity.name.lower(),
            "channel": self.channel or None,
            "who": self.who or None,
            "text": self.text,
            "number": self.seen.number,
            "places": [each._asdict() for each in self.seen.places],
            "last": self.seen.last._asdict(),
            "cause": self.cause,
            "remedy": self.remedy,
            "clause": self.rule.clause,
        }


class Incidents:
    """All incidents of some logs, or of a bus."""

    def __init__(self) -> None:
        self._found: dict[tuple[IncidentRule, str, str, str], Incident] = {}
        self._number: dict[tuple[IncidentRule, str], int] = {}

    def at(
        self, rule: IncidentRule, channel: str, who: str, subject: str, text: str, cause: str, remedy: str
    ) -> Occurrences:
        """Return where an incident was seen; it is new if the rule has none of this node and `subject`."""
        key = rule, channel, who, subject
        if key not in self._found:
            number = self._number[key[:2]] = self._number.get(key[:2], 0) + 1
            if number > MOST:
                key, who, text = (rule, channel, "", ""), "", f"{rule.what} (others than those above)"
            if key not in self._found:
                self._found[key] = Incident(rule, channel, who, text, cause or rule.cause, remedy or rule.remedy)
        return self._found[key].seen

    def sorted(self, *others: Incidents) -> list[Incident]:
        """Return them and others, worst first; of equal ones what is more often. A single bus has no name."""
        found = [incident for each in (self, *others) for incident in each._found.values() if incident.seen.number]
        if len({each.channel for each in found}) < 2:
            found = [replace(each, channel="") for each in found]
        return sorted(found, key=lambda each: (each.rule.rank, -each.seen.number))


def verdict(incidents: Sequence[Incident], seen: str) -> str:
    """Return the answer in one line; `seen` says how much was looked at."""
    counts = {each: sum(incident.rule.severity is each for incident in incidents) for each in Severity}
    found = ", ".join(amount(number, LEVELS[each]) for each, number in counts.items() if number)
    if not found:
        return f"Nothing is wrong in {seen}"
    first = incidents[0]
    return one_line(f"{found} in {seen}. {'First look at' if len(incidents) > 1 else 'It is'} {first.title}")


def lines(incidents: Sequence[Incident]) -> Iterator[str]:
    """Yield what there is to read of incidents."""
    for each in incidents:
        yield ""
        yield f"{LEVELS[each.rule.severity].upper():<8} {each.title}"
        yield from (f"  {what:<8} {text}" for what, text in each.facts)
