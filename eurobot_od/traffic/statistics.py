"""The count of what is wrong in a log: how often, and where first.

Constant memory; of each kind of damage the first entry is kept, of the others the number.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from eurobot_od.support.texts import one_line
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Defect


@dataclass
class DamageCount:
    """How often one kind of damage was met, in which log and line first, and what exactly was wrong there."""

    log: str
    line: int
    text: str
    number: int = 0


class DamageCounts:
    """Counts damage over any number of logs."""

    def __init__(self) -> None:
        self.counts: dict[Damage, DamageCount] = {}

    def add(self, log: str, line: int, defects: Iterable[Defect]) -> None:
        """Count what is wrong with the entry at a line of a log."""
        for damage, text in defects:
            count = self.counts.get(damage)
            if count is None:
                count = self.counts[damage] = DamageCount(log, line, text)
            count.number += 1

    @property
    def total(self) -> int:
        """How many defects there were."""
        return sum(count.number for count in self.counts.values())

    def report(self) -> Iterator[str]:
        """Yield one line for each kind of damage that was met, worst first."""
        for damage in Damage:
            if damage in self.counts:
                count = self.counts[damage]
                where = one_line(f"{count.log}:{count.line}: {count.text}")
                yield f"{count.number:8} x {damage.value:18} first at {where}"
