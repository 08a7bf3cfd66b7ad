"""A long log on the page: an index of all of it, and its frames in a window around the shown time.

The index is built beside the page, which shows the progress. Counts, events and the last frame of each message are
those of the whole log; values are decoded only for the window.
"""

from __future__ import annotations

import asyncio
from bisect import bisect_right
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager
from functools import partial
from threading import Event, Lock
from typing import Any

from eurobot_od.errors import LocalError, look_up
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.entries import Batch, LogEntry, Raw
from eurobot_od.traffic.formats.index import Key, Keys, LogIndex, key_of
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.monitor import MonitorRow
from eurobot_od.traffic.services import SYNC_NAME, TIME_NAME
from eurobot_od.web.asking import Arguments, answered, number_of, text_of, whole_of
from eurobot_od.web.page import DIGITS, Columns, row_data

LONG = 16_000_000
"""Size in bytes from which on a page has only a window of a log: about 300 000 lines."""

BEFORE, AFTER = 5_000, 15_000
"""Least frames of a window before and after the time that is shown, where there are as many."""

TOLD = 0.02
"""Part of a log after which its diagnosis is sent again."""

EVENTLESS = (SYNC_NAME, TIME_NAME)
"""Services whose frames make no event."""


class LongLog:
    """A long log; `diagnosis` makes its diagnosis on the first request. `end` ends the work beside the page."""

    def __init__(
        self, name: str, index: LogIndex, decoder: Decoder, bitrate: int, diagnosis: Callable[[], Diagnosis]
    ) -> None:
        self.index = index
        self._decoder = decoder
        self._bitrate = bitrate
        self._columns = partial(Columns, name, decoder, bitrate)
        self._make_diagnosis = diagnosis
        self._diagnosed: dict[str, Any] = {"verdict": "Waiting for the index.", "incidents": []}
        self._wanted = Event()
        self._rows: dict[Key, MonitorRow] = {}
        self._watched: set[Key] = set()
        self._overview = self._columns(start=0.0)
        self._following = TrackingDecoder(decoder)
        self._decoders: list[tuple[int, str, Decoder]] = []
        """Which decoder a channel has from a place on."""
        self._is_ended = False
        self._trouble = ""
        self._one_reader = Lock()
        """Two that read the whole log at once would only wait for each other."""

    def data(self) -> dict[str, Any]:
        """Return the source as data for the page, before anything of it was read."""
        return self._overview.data() | {"long": True}

    # The index

    def build(self) -> None:
        """Build the index, and note the events of the whole log; raises OSError."""
        for batch in self.index.build():
            self._take(self.index.places[-1].number, batch)
            if self._is_ended:
                return

    def end(self) -> None:
        """End the work beside the page."""
        self._is_ended = True
        self._wanted.set()

    def _take(self, number: int, batch: Batch) -> None:
        """Process a batch: the first entry of each row, and all that make events."""
        counts = self.index.places[-1].counts
        start = self.index.start
        wanted = {key for key in counts if key not in self._rows or key in self._watched}
        if wanted:
            for place, (line, time, channel, raw) in enumerate(batch.entries()):
                if raw[0] in wanted:
                    self._note(number + place + 1, time - start, channel, self._follow(line, time, channel, raw))
        self._overview.look(self.index.end - start)

    def _follow(self, line: int, time: float, channel: str, raw: Raw) -> Meaning:
        before = self._following.decoder(channel)
        meaning = self._following(time, channel, raw, line)
        if (decoder := self._following.decoder(channel)) is not before:
            self._decoders.append((len(self.index.places), channel, decoder))
        return meaning

    def _note(self, number: int, now: float, channel: str, meaning: Meaning) -> None:
        raw = meaning.raw
        if raw[0] not in self._rows:
            self._rows[raw[0]] = MonitorRow(raw[0] if isinstance(raw[0], int) else None, meaning)
            if isinstance(raw[0], int) and meaning.message is None and meaning.name not in EVENTLESS:
                self._watched.add(raw[0])
        if raw[0] in self._watched:
            self._overview.note(number, now, meaning)

    # What the page asks for

    def told(self, _: Arguments) -> dict[str, Any]:
        """Return the progress of the index, and its content."""
        index = self.index
        done = self.index.is_complete
        rows = [row_data(each) for each in list(self._rows.values())]
        known: dict[str, Any] = {
            "read": index.read,
            "size": index.size,
            "frames": index.total,
            "is_complete": done,
            "trouble": self._trouble,
        }
        times = {"began": index.start if index.places else None, "end": round(index.end - index.start, DIGITS)}
        return known | times | {"rows": rows, "events": self._overview.shown()["events"]}

    def window(self, said: Arguments) -> dict[str, Any]:
        """Return the frames around a time, and the last one of each row before them."""
        index = self.index
        time = number_of(said, "time")
        if not index.places:
            return {"rows": [], "events": [], "first": 1, "from": 0.0, "to": 0.0, "counts": {}}
        middle = index.places[index.place_at(index.start + time)].number
        first, last = self._place_of(middle - BEFORE), self._place_of(middle + AFTER) + 1
        columns = self._columns(start=index.start)
        followings = self._followings(first)
        for number, (line, at, channel, raw) in [*self._last_before(first), *self._entries(first, last)]:
            columns.take(at, followings[channel](at, channel, raw, line), number)
        counts = index.counts_before(first).items()
        begin = round(index.places[first - 1].time - index.start, DIGITS) if first else 0.0
        end = round(index.places[last - 1].time - index.start, DIGITS)
        return columns.shown() | {
            "first": index.places[first].number + 1,
            "from": begin,
            "to": end,
            "counts": {key if isinstance(key, int) else key.value: count for key, count in counts},
        }

    def _place_of(self, number: int) -> int:
        """Return the place with the entry of a number, or the nearest one."""
        return max(bisect_right(self.index.places, number, key=lambda each: each.number) - 1, 0)

    def _followings(self, first: int) -> defaultdict[str, TrackingDecoder]:
        """Return the decoder of each channel from a place on."""
        found = defaultdict[str, TrackingDecoder](lambda: TrackingDecoder(self._decoder))
        found.update(
            {channel: TrackingDecoder(decoder) for place, channel, decoder in self._decoders if place <= first}
        )
        return found

    def _entries(self, first: int, last: int | None, keys: Keys | None = None) -> Iterator[tuple[int, LogEntry]]:
        """Yield the entries of some places with their numbers; with `keys`, only those."""
        for before, batch in self.index.batches(first, last, keys):
            numbers = range(before + 1, before + 1 + len(batch.heads))
            heads = batch.heads
            if keys is None:
                yield from zip(numbers, batch.entries())
                continue
            for place in [place for place, head in enumerate(heads) if key_of(head) in keys]:
                columns = batch.lines[place], batch.times[place], batch.channels[place]
                yield numbers[place], (*columns, batch.raw(place))

    def _last_before(self, first: int) -> list[tuple[int, LogEntry]]:
        """Return the last entry of each row before a place, in their order."""
        found: dict[Key, tuple[int, LogEntry]] = {}
        wanted: dict[int, set[Key]] = {}
        for key, place in self.index.last_before(first).items():
            wanted.setdefault(place, set()).add(key)
        for place, keys in wanted.items():
            found |= {
                entry[3][0]: (number, entry) for number, entry in self._entries(place, place + 1, frozenset(keys))
            }
        return sorted(found.values(), key=lambda each: each[0])

    def next_of(self, said: Arguments) -> float | None:
        """Return the time of the next entry of some `rows` after a time, `back` for the last one before it; or None."""
        names = said.get("rows")
        time = self.index.start + number_of(said, "time")
        if not isinstance(names, list):
            raise LocalError("rows is missing, or not a list")
        keys = frozenset(key for key, each in list(self._rows.items()) if each.name in names)
        here = self.index.place_at(time)
        is_back = bool(said.get("back"))
        count = len(self.index.places)
        places = range(min(here, count - 1), -1, -1) if is_back else range(here, count)
        for place in places:
            times = [entry[1] for _, entry in self._entries(place, place + 1, keys)]
            found = [each for each in times if (each < time if is_back else each > time)]
            if found:
                return round(found[-1 if is_back else 0] - self.index.start, DIGITS)
        return None

    def series(self, said: Arguments) -> dict[str, Any]:
        """Return times and values of a field between two times; with `pixels` of each the first, least, most, last."""
        row, field = text_of(said, "row"), text_of(said, "field")
        begin, end = number_of(said, "from"), number_of(said, "to")
        thinned = ThinnedSeries((end - begin) / whole_of(said, "pixels") if "pixels" in said else 0.0)
        keys = frozenset(key for key, each in list(self._rows.items()) if each.name == row)
        start = self.index.start
        places = [self.index.place_at(self.index.start + each) for each in (begin, end)]
        followings = self._followings(places[0])
        with self._one_reader:
            for _, (_, time, channel, raw) in self._entries(places[0], places[1] + 1, keys):
                meaning = followings[channel].decoder(channel).remembered(raw)
                if meaning.message is not None and field in meaning.kinds:
                    value = meaning.kinds[field].plain(getattr(meaning.message, field))
                    thinned.take(round(time - start, DIGITS), value)
                if self._is_ended:
                    break
        return thinned.data()

    def diagnosis(self, _: Arguments) -> dict[str, Any]:
        """Return the diagnosis so far, which begins with the first request."""
        self._wanted.set()
        return self._diagnosed

    def work(self) -> None:
        """Build the index, and diagnose the log once that is wanted, until `end`; errors are shown."""
        try:
            self.build()
            self._wanted.wait()
            self.diagnose()
        except OSError as error:
            self._trouble = str(error)

    def diagnose(self) -> None:
        """Diagnose the whole log; raises OSError."""
        found = self._make_diagnosis()
        told = 0
        found.begin(self.index.file.name)
        for number, (line, time, channel, raw) in self._entries(0, None):
            found.take(time, channel, raw, line)
            if self._is_ended:
                return
            if number >= told:
                told = number + int(TOLD * self.index.total) + 1
                far = f"{100 * number // self.index.total} % of the log is diagnosed. "
                data = found.as_data(time)
                self._diagnosed = data | {"verdict": far + data["verdict"]}
        found.end()
        self._diagnosed = found.as_data(0.0) | {"is_complete": True}


class ThinnedSeries:
    """Samples of a field: of each `width` in s the first, the least, the most and the last one; all of them with 0."""

    def __init__(self, width: float) -> None:
        self._width = width
        self._kept = list[tuple[float, Any]]()
        self._some = list[tuple[float, Any]]()

    def take(self, time: float, value: Any) -> None:
        """Add the next sample."""
        if self._some and time >= self._some[0][0] + self._width:
            self._flush()
        self._some.append((time, value))

    def _flush(self) -> None:
        some, self._some = self._some, []
        numbers = [place for place, (_, value) in enumerate(some) if isinstance(value, (int, float))]
        ends = [least_or_most(numbers, key=lambda each: some[each][1]) for least_or_most in (min, max) if numbers]
        self._kept += [some[place] for place in sorted({0, len(some) - 1, *ends})]

    def data(self) -> dict[str, Any]:
        """Return the samples as data."""
        if self._some:
            self._flush()
        return {"times": [time for time, _ in self._kept], "values": [value for _, value in self._kept]}


class LongLogs:
    """The long logs of a page, by their places among its sources; it answers the page's requests about them."""

    def __init__(self, logs: Sequence[LongLog | None]) -> None:
        self._logs = {str(place): each for place, each in enumerate(logs) if each is not None}
        self._beside: set[asyncio.Task[None]] = set()

    @asynccontextmanager
    async def building(self) -> AsyncIterator[None]:
        """Build the indexes meanwhile."""
        for each in self._logs.values():
            self._run(each.work)
        try:
            yield
        finally:
            for each in self._logs.values():
                each.end()
            await asyncio.gather(*self._beside, return_exceptions=True)

    def _run(self, work: Callable[[], None]) -> None:
        self._beside.add(asyncio.create_task(asyncio.to_thread(work)))

    async def post(self, text: str) -> str:
        """Answer a request, both as JSON."""
        return await asyncio.to_thread(answered, text, self._do)

    def _do(self, said: Arguments) -> Any:
        log = look_up("log", str(said.get("log"))[:40], self._logs)
        return look_up("request", text_of(said, "do")[:40], REQUESTS)(log, said)


REQUESTS: Mapping[str, Callable[[LongLog, Arguments], Any]] = {
    "index": LongLog.told,
    "window": LongLog.window,
    "next": LongLog.next_of,
    "series": LongLog.series,
    "diagnosis": LongLog.diagnosis,
}
"""The page's requests."""
