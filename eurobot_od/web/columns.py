"""A log as columns: for each message its times and the values of its fields, for the page to look up and to plot.

The page works out counts, periods and what was when; nothing is said here twice.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from eurobot_od.bus.bits import frame_bits
from eurobot_od.frame import Frame
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.monitor.traffic import MonitorRow
from eurobot_od.web.content import defects, described, event_data, values
from eurobot_od.web.panel import PageEvent, Panel, service_events

MOST_FRAMES = 300_000
"""Frames of a log that a page holds, about 20 minutes of a full bus; more would take a browser minutes to read."""

DIGITS = 5
"""Of a time in s: ten microseconds, less than the shortest frame takes."""


class _Row:
    """All frames of a message, a service or a kind of damage."""

    def __init__(self, meaning: Meaning, identifier: int | None) -> None:
        self.meaning, self.identifier = meaning, identifier
        self.times: list[float] = []
        self.values: list[list[Any]] = []
        self.texts: list[str] = []
        self.wrong: dict[int, str] = {}
        self.bits = 0

    def take(self, time: float, meaning: Meaning) -> None:
        found = values(meaning)
        if meaning.message is None:
            self.texts.append(meaning.text)
        elif self.texts:  # frames of this message that could not be read came before
            self.texts.append("")
        self.times.append(round(time, DIGITS))
        self.values.append(found or [])
        if meaning.defects:
            self.wrong[len(self.times) - 1] = defects(meaning)
        if isinstance(meaning.raw, Frame):
            self.bits += frame_bits(meaning.raw)

    def data(self) -> dict[str, Any]:
        # A frame that could not be read has no values: its places are filled up.
        width = max(map(len, self.values))
        padded = ([*each, *[None] * (width - len(each))] for each in self.values)
        return {
            "id": self.identifier,
            "name": MonitorRow(self.identifier, self.meaning).name,
            "group": self.meaning.group,
            "nodes": self.meaning.nodes,
            "times": self.times,
            "values": list(zip(*padded)),
            "texts": [""] * (len(self.times) - len(self.texts)) + self.texts if self.texts else [],
            "wrong": self.wrong,
            "bits": self.bits / len(self.times),
        }


class Columns:
    """Collects a log; times count from its first entry. `left_out` counts what is too much for a page."""

    def __init__(self, name: str, decoder: Decoder, bitrate: int, panels: Iterable[type[Panel]] = ()) -> None:
        self.name, self.bitrate, self._decoder = name, bitrate, decoder
        self.left_out = 0
        self.start: float | None = None
        self._end = 0.0
        self._taken = 0
        self._rows: dict[int | Damage, _Row] = {}
        self._panels = [panel() for panel in panels]
        self._events: dict[str, PageEvent] = {}

    def take(self, time: float, meaning: Meaning) -> None:
        """Take in an entry of the log."""
        if self._taken >= MOST_FRAMES:
            self.left_out += 1
            return
        self.start = time if self.start is None else self.start
        now, raw = time - self.start, meaning.raw
        self._taken, self._end = self._taken + 1, max(self._end, now)
        row = self._rows.get(raw[0])
        if row is None:
            row = self._rows[raw[0]] = _Row(meaning, raw.cob_id if isinstance(raw, Frame) else None)
        row.take(now, meaning)
        self.add(service_events(self._taken, now, meaning))
        if meaning.message is not None:
            for panel in self._panels:
                self.add(panel.take(now, meaning.message))

    def add(self, events: Iterable[PageEvent]) -> None:
        """Enter events, with times since the start."""
        for event in events:
            self._events[event.key] = event
            self._end = max(self._end, event.time)

    def data(self, more: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
        """Return the source as data for the page; `more` are rows of what was not on the bus."""
        return {
            "name": self.name,
            "bitrate": self.bitrate,
            "end": round(self._end, DIGITS),
            "left_out": self.left_out,
            "rows": [*(row.data() for row in self._rows.values()), *more],
            "events": [event_data(each) for each in self._events.values()],
            **described(self._decoder),
        }
