"""The names of conformance steps: clause, topic, what is looked at, tier and numbers of CiA's tool.

Rule of this file: whatever writes a name, and whatever reads it for a report, uses the same class: a report has no more
than the name.
"""

from __future__ import annotations

import re
from typing import NamedTuple

NAME = re.compile(
    r"(?P<clause>[\d.]+|0x[0-9A-F]{4}) (?P<topic>[^:]+): (?P<what>.*?)"
    r" \[(?P<tier>[a-z]+)(?:, CTT (?P<ctt>[\d., to]+))?\](?:(?: \d+/\d+)?: (?P<inside>.*))?"
)


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
        """The numbers of CiA's tool, each by itself."""
        numbers: list[str] = []
        for part in filter(None, self.ctt.split(", ")):
            first, _, last = part.partition(" to ")
            chapter, _, number = first.partition(".")
            end = last.partition(".")[2] or number
            numbers += [f"{chapter}.{each}" for each in range(int(number), int(end) + 1)]
        return tuple(numbers)
