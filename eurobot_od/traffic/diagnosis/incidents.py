"""Incidents: problems with their nodes, times, likely causes and remedies; and the watchers that find them.

The same thing again is the same incident. So memory grows with what can be wrong, not with the frames: of each incident
there is a number, the first and the last place, and a few more; of each rule at most `MOST` incidents.

What the watchers of a bus share is at the end: its nodes as the frames so far have shown them, and where they report.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from math import inf
from typing import Any, ClassVar, NamedTuple, TypeAlias

from eurobot_od.device.nmt import NmtState
from eurobot_od.frame import Frame
from eurobot_od.lint.findings import LEVELS, Severity
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from eurobot_od.support import texts
from eurobot_od.support.texts import one_line
from eurobot_od.traffic.entries import Raw
from eurobot_od.traffic.meaning import Decoder, Meaning

MOST = 20
"""Maximum number of incidents of one rule on one bus; further ones are merged."""

BEFORE = 5.0
"""Time by which a consequence may be seen before its cause, in s, as a lost heartbeat is noticed late."""

PLACES = 3
"""Number of places listed for an incident."""


class SeenAt(NamedTuple):
    """A place: the time in s, the log and line if there is one, and the frame."""

    time: float
    log: str = ""
    line: int = 0
    frame: Raw | None = None

    def as_data(self) -> dict[str, Any]:
        """Return the place as plain data."""
        frame = {} if self.frame is None else {"frame": self.shown}
        return {"time": self.time, "log": self.log, "line": self.line, **frame}

    @property
    def shown(self) -> str:
        """Frame in candump's format; empty for other entries."""
        return str(self.frame) if isinstance(self.frame, Frame) else ""

    def after(self, first: SeenAt | None = None) -> str:
        """Format the place; in the same log as `first`, only with its line."""
        log = self.log if first is None or first.log != self.log else "line"
        if not self.log:
            return f"{self.time:.6f} s"
        place = f"line {self.line}" if log == "line" else f"{log}:{self.line}"
        return f"{self.time:.6f} s ({place})"


NOWHERE = SeenAt(0.0)


@dataclass
class Occurrences:
    """Occurrences of an incident: their number, the last place, and the first few places."""

    number: int = 0
    last: SeenAt = NOWHERE
    places: list[SeenAt] = field(default_factory=list)

    @classmethod
    def once(cls, place: SeenAt) -> Occurrences:
        """Return a single occurrence."""
        return cls(1, place, [place])

    def add(self, place: SeenAt) -> None:
        """Add an occurrence."""
        self.number += 1
        self.last = place
        if len(self.places) < PLACES:
            self.places.append(place)

    def join(self, other: Occurrences) -> None:
        """Add later occurrences."""
        self.number += other.number
        self.last = other.last
        self.places += other.places[: PLACES - len(self.places)]


class RuleRow(NamedTuple):
    """A row of a table of rules: severity, description, likely `cause`, `remedy`, and source."""

    severity: Severity
    what: str
    cause: str
    remedy: str
    clause: str


class IncidentRule(Enum):
    """A table of rules; each member of a subclass is a `RuleRow`, with its attributes.

    Causes stand before what follows from them: incidents of equal severity are shown in this order.
    """

    def __init__(self, severity: Severity, what: str, cause: str, remedy: str, clause: str) -> None:
        self.severity, self.what, self.cause, self.remedy, self.clause = severity, what, cause, remedy, clause

    @property
    def id(self) -> str:
        """Identifier for people and programs, such as `heartbeat-lost`."""
        return self.name.lower().replace("_", "-")

    @property
    def stage(self) -> int:
        """Order of display: 0 for the bus, 1 for a robot, 2 for emergencies, 3 for files."""
        return 0

    @property
    def explained(self) -> Collection[str]:
        """Ids of the rules whose incidents follow from one of this rule at the same node."""
        return ()

    @property
    def rank(self) -> tuple[int, int, int]:
        """Position among all rules, worst first."""
        return list(Severity).index(self.severity), self.stage, list(type(self)).index(self)


FACTS = "Seen", "Also at", "Frames", "Likely", "Asked", "To do", "With it", "Source"
"""Headings of the facts about an incident."""


@dataclass(frozen=True)
class Incident:
    """A violation of a rule on a bus (empty if there is only one), by the node `who`.

    What has the same cause `follows` from it. The node was `asked` for objects, which it answered, or not.
    """

    rule: IncidentRule
    channel: str
    who: str
    text: str
    cause: str
    seen: Occurrences = field(default_factory=Occurrences)
    follows: tuple[Incident, ...] = ()
    asked: tuple[str, ...] = ()

    def explains(self, other: Incident) -> bool:
        """Return whether another incident follows from this one."""
        if self.channel != other.channel or other.rule.id not in self.rule.explained:
            return False
        is_of_it = not self.who or other.who == self.who or f"missed: {self.who}," in other.text
        return is_of_it and other.seen.last.time >= self.seen.places[0].time - BEFORE

    @property
    def title(self) -> str:
        """Node and text, such as `drive: is lost`."""
        where = f"[{self.channel}] " if self.channel else ""
        return one_line(f"{where}{self.who}: {self.text}" if self.who else f"{where}{self.text}")

    @property
    def facts(self) -> list[tuple[str, str]]:
        """Facts besides the title, each with its heading."""
        often = "once" if self.seen.number == 1 else f"{self.seen.number} times"
        first, *others = self.seen.places
        when = f"{often}, at {first.after()}"
        if self.seen.number > 1:
            when = f"{often}, first at {first.after()}, last at {self.seen.last.after(first)}"
        also = ", ".join(each.after(first) for each in others if each != self.seen.last)
        places = dict.fromkeys([*self.seen.places, self.seen.last])
        frames = ", ".join(f"{each.shown} at {each.time:.6f} s" for each in places if each.shown)
        with_it = "; ".join(each.title for each in self.follows)
        said = "; ".join(self.asked)
        source = f"{self.rule.clause} [{self.rule.id}]"
        found = when, also, frames, self.cause, said, self.rule.remedy, with_it, source
        return [(what, one_line(text)) for what, text in zip(FACTS, found) if text]

    def as_data(self) -> dict[str, Any]:
        """Return the incident as plain data."""
        return {
            "rule": self.rule.id,
            "level": self.rule.severity.name.lower(),
            "channel": self.channel or None,
            "who": self.who or None,
            "text": self.text,
            "number": self.seen.number,
            "places": [each.as_data() for each in self.seen.places],
            "last": self.seen.last.as_data(),
            "cause": self.cause,
            "remedy": self.rule.remedy,
            "clause": self.rule.clause,
            "asked": list(self.asked),
            "follows": [each.as_data() for each in self.follows],
        }


class Incidents:
    """All incidents of some logs or a bus."""

    def __init__(self) -> None:
        self._found: dict[tuple[IncidentRule, str, str, str], Incident] = {}
        self._number: dict[tuple[IncidentRule, str], int] = {}

    def at(self, rule: IncidentRule, channel: str, who: str, subject: str, text: str, cause: str = "") -> Occurrences:
        """Return the occurrences of an incident, which is created for a new rule, node or `subject`."""
        key = rule, channel, who, subject
        found = self._found.get(key)
        if found is None:
            number = self._number[key[:2]] = self._number.get(key[:2], 0) + 1
            if number > MOST:
                key = (rule, channel, "", "")
                who = ""
                text = f"{rule.what} (others than those above)"
            found = self._found.setdefault(key, Incident(rule, channel, who, text, cause or rule.cause))
        return found.seen

    def sorted(self, *others: Incidents) -> list[Incident]:
        """Return the incidents, worst and most frequent first, each with its consequences.

        A single bus has no name.
        """
        found = [incident for each in (self, *others) for incident in each._found.values() if incident.seen.number]
        if len({each.channel for each in found}) < 2:
            found = [replace(each, channel="") for each in found]
        return list(_grouped(sorted(found, key=lambda each: (each.rule.rank, -each.seen.number))))


def _grouped(found: Sequence[Incident]) -> Iterator[Incident]:
    """Yield incidents with the ones that follow from them."""
    left = list(found)
    while left:
        first, *left = left
        follows = [each for each in left if first.explains(each)]
        left = [each for each in left if each not in follows]
        yield replace(first, follows=tuple(follows)) if follows else first


def lines(incidents: Sequence[Incident]) -> Iterator[str]:
    """Yield incidents as lines of text."""
    for each in incidents:
        yield ""
        yield f"{LEVELS[each.rule.severity].upper():<8} {each.title}"
        yield from (f"  {what:<8} {text}" for what, text in each.facts)


# What the watchers of a bus share

Take: TypeAlias = Callable[[float, Meaning], None]
"""Processes a frame, given its time in s and its meaning."""

brief = partial(texts.text, digits=4)
"""Formats a measured time with four digits."""


@dataclass
class ObservedNode:
    """A node: its last NMT state, whether it was `heard`, and when it was changed and reset.

    It `is_device` once it has sent more than a heartbeat, which a program sends as well.

    It has booted, or was reset, `boots` times. It has said at a time in s whom it `missed`. `shown` are settings that
    transfers have shown; it `is_configured` if a master has written any object. `in_force` returns what it has shown
    to have in place of its file's values.
    """

    node_id: int
    name: str
    in_force: Callable[[], Mapping[Address, int]]
    dictionary: Dictionary | None = None
    state: NmtState | None = None
    heard: bool = False
    is_device: bool = False
    is_lost: bool = False
    booted: bool = False
    boots: int = 0
    since: float = 0.0
    reset: float | None = None
    shown: dict[Address, bytes] = field(default_factory=dict)
    is_configured: bool = False
    missed: tuple[float, str] | None = None

    def number(self, address: Address) -> int:
        """Return the number at an address, as shown or from the file; 0 without any."""
        number = self.in_force().get(address)
        return (self.dictionary.number(address) if self.dictionary and number is None else number) or 0

    @property
    def is_operational(self) -> bool:
        """Whether its state is OPERATIONAL or unknown."""
        return self.state in (None, NmtState.OPERATIONAL)


class ObservedBus:
    """A bus: its present `decoder`, its nodes by node-ID, and the times of the first and last frame.

    The last NMT command was `commanded` at a time in s. `listeners` are who takes the frames of a PDO, by identifier;
    they are asked for again once they are cleared.

    `shown` returns what a node has shown to have, `report` where an incident is counted. `frame` is what came now, None
    for what is noticed without one.
    """

    def __init__(
        self,
        channel: str,
        decoder: Decoder,
        shown: Callable[[int], Mapping[Address, int]],
        at: Callable[[], tuple[float, str, int]],
        report: Callable[..., Occurrences],
    ) -> None:
        self.channel = channel
        self.files = decoder
        self.decoder = decoder
        self.report = report
        self._place = at
        self.frame: Raw | None = None
        self.began = self.now = 0.0
        self.commanded = -inf
        self.own_question: tuple[int, Address] | None = None
        """Node and object of this program's own last question."""
        self.numbers = {each.name: each.node_id for each in decoder.dictionaries}
        self._shown = shown
        self.nodes = {
            each.node_id: ObservedNode(each.node_id, each.name, partial(shown, each.node_id), each)
            for each in decoder.dictionaries
        }
        self.listeners: dict[int, tuple[Take, ...]] = {}
        self.counts: dict[str, int] = defaultdict(int)
        """Numbers of frames by service."""
        self.stated: list[Callable[[ObservedNode], None]] = []
        """Functions called with a node that has reported its NMT state."""

    def at(self) -> SeenAt:
        """Return the place of the present frame."""
        return SeenAt(*self._place(), self.frame)

    def node(self, node_id: int) -> ObservedNode:
        """Return a node, created if it is new."""
        if node_id not in self.nodes:
            self.nodes[node_id] = ObservedNode(node_id, f"node {node_id}", partial(self._shown, node_id))
        return self.nodes[node_id]

    def named(self, name: str) -> ObservedNode | None:
        """Return a node by its name in meanings; None for a master without a file."""
        number = self.numbers.get(name)
        if number is None and name.startswith("node ") and name[5:].isdecimal():
            number = int(name[5:])
        return None if number is None else self.node(number)

    def found(
        self,
        rule: IncidentRule,
        who: str,
        text: str,
        subject: Any = "",
        *,
        cause: str = "",
        seen: Occurrences | None = None,
    ) -> None:
        """Report a violation of a rule, here or where it was `seen`; `subject` separates incidents of a node."""
        here = self.report(rule, self.channel, who, str(subject), text, cause)
        if seen:
            here.join(seen)
        else:
            here.add(self.at())


class Watcher:
    """Base class of watchers, each for some frames of a bus; without a clock, as frames bring their times.

    It says what it listens to, as most frames matter to few watchers: `SERVICES` are the services whose frames `take`
    is given, and for each PDO, or frame of other traffic, `listener` says who takes it.
    """

    SERVICES: ClassVar[Collection[str]] = ()

    def __init__(self, bus: ObservedBus) -> None:
        self.bus = bus

    def take(self, time: float, meaning: Meaning) -> None:
        """Process a frame of one of the SERVICES."""

    def listener(self, cob_id: int, meaning: Meaning) -> Take | None:
        """Return the function for the frames of a PDO, None to ignore them; `meaning` is of the first frame.

        Asked once for an identifier, and again when something else has come into force.
        """
        return None

    def tick(self, time: float) -> None:
        """Report frames missing until now; called several times a second."""

    def gap(self, time: float) -> None:
        """Forget what was expected, after a gap in the log."""

    def end(self, time: float) -> None:
        """Report what is unresolved at the end of the log or watch."""
