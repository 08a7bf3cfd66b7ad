"""What the watchers of a bus share: its nodes as the frames so far have shown them, and where they report."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from eurobot_od.device.nmt import NmtState
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from eurobot_od.support import texts
from eurobot_od.traffic.diagnosis.incidents import IncidentRule, Occurrences, SeenAt
from eurobot_od.traffic.meaning import Decoder, Meaning

brief = partial(texts.text, digits=4)
"""Writes a time as it was measured: more digits mean nothing."""


@dataclass
class ObservedNode:
    """A node: its last NMT state, when that was `heard` first and changed last (`since`), and when it was reset.

    `shown` are settings that transfers have shown; it `is_configured` if a master has written any object. `in_force`
    returns what it has shown to have in place of its file's values.
    """

    node_id: int
    name: str
    in_force: Callable[[], Mapping[Address, int]]
    dictionary: Dictionary | None = None
    state: NmtState | None = None
    heard: bool = False
    booted: bool = False
    since: float = 0.0
    reset: float | None = None
    shown: dict[Address, bytes] = field(default_factory=dict)
    is_configured: bool = False

    def number(self, address: Address) -> int:
        """Return the number that it has at an address, as shown, or by its file; 0 without any."""
        number = self.in_force().get(address)
        return (self.dictionary.number(address) if self.dictionary and number is None else number) or 0

    @property
    def is_operational(self) -> bool:
        """Whether it says that it is OPERATIONAL, or says nothing."""
        return self.state in (None, NmtState.OPERATIONAL)


class ObservedBus:
    """One bus: its `decoder` by the mapping in force, its nodes by node-ID, and when it was heard first and last, s.

    `shown` returns what a node has shown to have, `at` gives the place of the present frame, `report` where an incident
    is counted.
    """

    def __init__(
        self,
        channel: str,
        decoder: Decoder,
        shown: Callable[[int], Mapping[Address, int]],
        at: Callable[[], SeenAt],
        report: Callable[..., Occurrences],
    ) -> None:
        self.channel, self.files, self.decoder, self.at, self.report = channel, decoder, decoder, at, report
        self.began = self.now = 0.0
        self.names = {each.node_id: each.name for each in decoder.dictionaries}
        self.nodes: dict[int, ObservedNode] = {}
        self.numbers = {name: node_id for node_id, name in self.names.items()}
        self._shown = shown
        for each in decoder.dictionaries:
            self.nodes[each.node_id] = ObservedNode(each.node_id, each.name, partial(shown, each.node_id), each)
        self.counts: dict[str, int] = defaultdict(int)
        """How many frames of each service came."""
        self.stated: list[Callable[[ObservedNode], None]] = []
        """Called with a node that has said its NMT state."""

    def node(self, node_id: int) -> ObservedNode:
        """Return a node, new if it was not known."""
        if node_id not in self.nodes:
            self.nodes[node_id] = ObservedNode(node_id, f"node {node_id}", partial(self._shown, node_id))
        return self.nodes[node_id]

    def named(self, name: str) -> ObservedNode | None:
        """Return a node by the name that a meaning has for it; None for a master without a file."""
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
        remedy: str = "",
        seen: Occurrences | None = None,
    ) -> None:
        """Report that a rule does not hold here, or where it was `seen`; `subject` tells incidents of a node apart."""
        here = self.report(rule, self.channel, who, str(subject), text, cause, remedy)
        if seen is None:
            here.add(self.at())
        else:
            here.join(seen)


class Watcher:
    """Watches some services of a bus for what breaks its rules. It has no clock: frames and times in s go in."""

    def __init__(self, bus: ObservedBus) -> None:
        self.bus = bus

    def take(self, time: float, meaning: Meaning) -> None:
        """Take in a frame that could be read."""

    def tick(self, time: float) -> None:
        """Notice what did not come until now; called several times a second."""

    def gap(self, time: float) -> None:
        """Forget what was to come: nothing was recorded for a while."""

    def end(self, time: float) -> None:
        """Report what the end of the log, or of the watch, leaves open."""
