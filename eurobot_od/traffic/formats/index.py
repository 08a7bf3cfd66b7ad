"""An index of a long log: where its entries are, by number and by time, so that any part of it is read by itself.

Formats of lines have places from which they can be read on; packed logs, pipes and formats of records have none.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeAlias

from eurobot_od.traffic.entries import LARGEST, Batch, Damage, Raw
from eurobot_od.traffic.formats import FORMATS, PACKED, form_of
from eurobot_od.traffic.formats.lines import LineFormat, LogPlace, placed_lines

Key: TypeAlias = int | Damage
"""What entries are counted by: the COB-ID, or the damage of what has none."""

Keys: TypeAlias = frozenset[Key]


def key_of(head: int | Raw) -> Key:
    """Return what an entry is counted by, from its head in a batch."""
    return head if isinstance(head, int) else head[0]


class IndexedPlace(NamedTuple):
    """A place: the `number` of entries before it, the latest `time` until its end, in s, and how many it has by key."""

    number: int
    time: float
    place: LogPlace
    counts: Counter[Key]


class LogIndex:
    """The index of a log; `read` of its `size` bytes are in it so far, and `total` entries.

    `start` is the time of the first entry and `end` the latest one, in s.
    """

    def __init__(self, file: Path, form: LineFormat, largest: int = LARGEST) -> None:
        self.file, self._first, self._largest = file, LogPlace.first(form), largest
        self.size, self.read, self.total = file.stat().st_size, 0, 0
        self.start = self.end = 0.0
        self.places: list[IndexedPlace] = []
        self.is_complete = False

    @classmethod
    def of(cls, file: Path, form: str | None = None, largest: int = LARGEST) -> LogIndex | None:
        """Return an empty index of a log, None for one that has no places; errors as `formats.read`, and OSError."""
        if not file.is_file():
            return None
        with file.open("rb") as log:
            is_packed = log.peek(len(PACKED)).startswith(PACKED)
            known = FORMATS[form_of(log, form)]
        found = getattr(import_module(f"eurobot_od.traffic.formats.{known.module}"), known.reader)
        return cls(file, found(), largest) if isinstance(found, type) and not is_packed else None

    def build(self) -> Iterator[Batch]:
        """Read the log from its start, and yield each batch once its place is in the index; raises OSError."""
        with self.file.open("rb") as log:
            for place, batch in placed_lines(log, self._first, self._largest):
                if not self.places:
                    self.start = self.end = batch.times[0]
                self.end = max(self.end, *batch.times)
                self.places.append(IndexedPlace(self.total, self.end, place, Counter(map(key_of, batch.heads))))
                self.total, self.read = self.total + len(batch.heads), log.tell()
                yield batch
        self.read, self.is_complete = self.size, True

    def place_at(self, time: float) -> int:
        """Return which place has the first entry that is later than a time, in s; the last one if none is."""
        return min(bisect_right(self.places, time, key=lambda each: each.time), max(len(self.places) - 1, 0))

    def batches(
        self, first: int, last: int | None = None, keys: frozenset[Key] | None = None
    ) -> Iterator[NumberedBatch]:
        """Yield the batches of some places, of all from `first` on or those before `last`; raises OSError.

        With `keys` places without any of them are skipped, unread.
        """
        with self.file.open("rb") as log:
            for each in self.places[first:last]:
                if keys is not None and keys.isdisjoint(each.counts):
                    continue
                log.seek(each.place.offset)
                yield NumberedBatch(each.number, self._batch(log, each))

    def _batch(self, log: BinaryIO, wanted: IndexedPlace) -> Batch:
        """Read the entries of one place: their bytes may come in other pieces than at first."""
        parts, missing = list[Batch](), wanted.counts.total()
        for _, batch in placed_lines(log, wanted.place, self._largest):
            parts.append(batch.part(0, missing))
            missing -= len(parts[-1].heads)
            if missing <= 0:
                break
        return Batch.joined(parts)

    def counts_before(self, place: int) -> Counter[Key]:
        """Return how many entries there are by key before a place."""
        total = Counter[Key]()
        for each in self.places[:place]:
            total.update(each.counts)
        return total

    def last_before(self, place: int) -> dict[Key, int]:
        """Return for each key the last of the places before a place that has it."""
        return {key: number for number, each in enumerate(self.places[:place]) for key in each.counts}


class NumberedBatch(NamedTuple):
    """A batch, and the `number` of entries of the log before it."""

    number: int
    batch: Batch
