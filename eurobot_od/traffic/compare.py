"""Compares two logs that should be the same: frames that differ, are missing or are late.

Theory of operation: the frames of each identifier are two rows that are walked side by side. Frames that agree in time
and values, within the tolerances, are a pair. Where two do not, there are three explanations: they are a pair anyway
(one is late, or its values have changed), or the first log has frames that the second lacks, up to the time of the
other's next one, or the second has. The explanation after which most of the next frames agree is taken; in doubt, that
they are a pair. So one frame that is missing among a hundred equal ones is one difference, not a hundred late frames.

Times count from the logs' common beginning, which is found from the frames that are in both.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from functools import lru_cache
from itertools import islice, starmap
from operator import attrgetter
from statistics import median_low
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.frame import Frame, identifier_text
from eurobot_od.traffic.entries import REMEMBERED, Raw, Timed
from eurobot_od.traffic.meaning import Decoder, Meaning, with_defects


class ComparedEntry(NamedTuple):
    """An entry: its time in s and content, its channel if there are several, and its decoder."""

    time: float
    raw: Raw
    channel: str = ""
    decode: Callable[[Raw], Meaning] | None = None


Entry: TypeAlias = Timed | tuple[float, Raw, str] | ComparedEntry

AHEAD = 8
"""Number of following frames that decide between explanations."""

ALIGNED_BY = 100
"""Number of distinct frames whose first times give the offset between the clocks."""

TIME = 0.001
"""Default tolerance of times, in s."""


class DifferenceKind(Enum):
    """Kinds of differences, with their words in reports."""

    MISSING = "missing"
    EXTRA = "extra"
    LATE = "late"
    EARLY = "early"
    CHANGED = "changed"


class Difference(NamedTuple):
    """A difference: `time` in s from the common beginning, the message's `name`, and a description.

    The time is that of the frame in the first log; of one that is extra, that in the second. `channel` is empty where
    there is one bus.
    """

    time: float
    kind: DifferenceKind
    name: str
    text: str
    channel: str = ""


class Tolerances(NamedTuple):
    """Tolerances of times, in s, and of field values by the names of message and field."""

    time: float = TIME
    fields: Mapping[tuple[str, str], float] = MappingProxyType({})

    def allow(self, field: tuple[str, str], modulus: int | None, old: Any, new: Any) -> bool:
        """Return whether two values of a field count as equal."""
        if old == new or not isinstance(old, (int, float)) or not isinstance(new, (int, float)):
            return bool(old == new)
        apart = abs(old - new)
        tolerance = self.fields.get(field, 0.0)
        # 359 and 1 degree are 2 apart
        return min(apart, abs(modulus - apart)) <= tolerance if modulus else apart <= tolerance


def compare(
    first: Sequence[Entry], second: Sequence[Entry], decode: Decoder, tolerances: Tolerances
) -> list[Difference]:
    """Return the differences of the second log from the first, in order of time."""
    comparison = _Comparison(lru_cache(REMEMBERED)(decode), tolerances)
    rows = _by_identifier(first, 0.0)
    others = _by_identifier(second, _apart(first, second))
    begin = min((row[0].time for row in (*rows.values(), *others.values())), default=0.0)
    found = [
        difference._replace(time=round(difference.time - begin, 6), channel=key[1])
        for key in rows.keys() | others.keys()
        for difference in comparison.differences(rows.get(key, []), others.get(key, []))
    ]
    return sorted(found, key=lambda each: (each.time, each.name, each.kind.value))


_time = attrgetter("time")


def _by_identifier(entries: Iterable[Entry], apart: float) -> dict[tuple[Any, ...], list[ComparedEntry]]:
    """Return the entries by identifier or damage, and channel; `apart` is the lead of their clock in s."""
    rows: dict[tuple[Any, ...], list[ComparedEntry]] = {}
    for seen in starmap(ComparedEntry, entries):
        rows.setdefault((seen.raw[0], seen.channel), []).append(seen._replace(time=seen.time - apart))
    return rows


def _apart(first: Sequence[Entry], second: Sequence[Entry]) -> float:
    """Return the lead of the second log's clock over the first one's, in s."""
    begins, others = _first_times(first), _first_times(second)
    common = islice((others[raw] - time for raw, time in begins.items() if raw in others), ALIGNED_BY)
    differences = list(common)
    # A frame missing at the beginning of one log does not move the median.
    return median_low(differences) if differences else 0.0


def _first_times(entries: Iterable[Entry]) -> dict[tuple[Any, ...], float]:
    found: dict[tuple[Any, ...], float] = {}
    for time, raw, *where in entries:
        found.setdefault((raw, *where[:1]), time)
    return found


class _Comparison:
    """Compares the frames of one identifier."""

    def __init__(self, decode: Callable[[Raw], Meaning], tolerances: Tolerances) -> None:
        self._decode, self._tolerances = decode, tolerances

    def _meaning(self, seen: ComparedEntry) -> Meaning:
        return (seen.decode or self._decode)(seen.raw)

    def differences(self, first: Sequence[ComparedEntry], second: Sequence[ComparedEntry]) -> Iterator[Difference]:
        """Walk through two rows of frames and yield the differences."""
        one = other = 0
        while one < len(first) and other < len(second):
            step = (1, 1)
            if not self._agree(first[one], second[other]):
                step = self._explanation(first, second, one, other)
                yield from self._explained(first[one : one + step[0]], second[other : other + step[1]])
            one, other = one + step[0], other + step[1]
        yield from self._explained(first[one:], []) if one < len(first) else self._explained([], second[other:])

    def _explanation(
        self, first: Sequence[ComparedEntry], second: Sequence[ComparedEntry], one: int, other: int
    ) -> tuple[int, int]:
        """Return how many frames to advance in each row: a pair, or frames that only one row has."""
        slack = self._tolerances.time
        up_to = bisect_left(first, second[other].time - slack, one, key=_time) - one
        other_up_to = bisect_left(second, first[one].time - slack, other, key=_time) - other
        steps = ((1, 1), (1, 0), (0, 1), (max(up_to, 1), 0), (0, max(other_up_to, 1)))

        def agreeing(step: tuple[int, int]) -> int:
            """Count the next frames that agree after a step."""
            place, other_place = one + step[0], other + step[1]
            return sum(map(self._agree, first[place : place + AHEAD], second[other_place : other_place + AHEAD]))

        # `max` returns the first of equals, which is a pair.
        return max(steps, key=agreeing)

    def _explained(self, ones: Sequence[ComparedEntry], others: Sequence[ComparedEntry]) -> Iterator[Difference]:
        if not (ones and others):
            yield from (self._alone(DifferenceKind.MISSING, seen) for seen in ones)
            yield from (self._alone(DifferenceKind.EXTRA, seen) for seen in others)
            return
        one, other = ones[0], others[0]
        late = other.time - one.time
        name = self._name(one)
        if not self._is_in_time(one, other):
            kind = DifferenceKind.LATE if late > 0 else DifferenceKind.EARLY
            yield Difference(one.time, kind, name, f"by {abs(late) * 1000:.3f} ms")
        if changes := self._changes(one, other):
            yield Difference(one.time, DifferenceKind.CHANGED, name, ", ".join(changes))

    def _agree(self, one: ComparedEntry, other: ComparedEntry) -> bool:
        return self._is_in_time(one, other) and not self._changes(one, other)

    def _is_in_time(self, one: ComparedEntry, other: ComparedEntry) -> bool:
        return abs(other.time - one.time) <= self._tolerances.time + 1e-9  # times are decimals of a microsecond

    def _alone(self, kind: DifferenceKind, seen: ComparedEntry) -> Difference:
        return Difference(seen.time, kind, self._name(seen), with_defects(self._meaning(seen)))

    def _name(self, seen: ComparedEntry) -> str:
        """Return the name of a frame: its message, its identifier, or its damage."""
        raw = seen.raw
        identifier = f"0x{identifier_text(raw.cob_id)}" if isinstance(raw, Frame) else raw.damage.value
        return self._meaning(seen).name or identifier

    # Values

    def _changes(self, one: ComparedEntry, other: ComparedEntry) -> list[str]:
        """Return the changed values as text."""
        if one.raw == other.raw:
            return []
        was, now = self._meaning(one), self._meaning(other)
        if was.message is None or now.message is None or was.message._fields != now.message._fields:
            return [f"{was.text or one.raw} -> {now.text or other.raw}"]
        fields = was.kinds.items()
        return [
            f"{field} = {kind.text(old)} -> {kind.text(new)}"
            for (field, kind), old, new in zip(fields, was.message, now.message)
            if not self._tolerances.allow((was.name, field), kind.modulus, old, new)
        ]
