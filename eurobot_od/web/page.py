"""The page as one HTML file: nothing is loaded from elsewhere, and only our own scripts run in it.

Rule of this file: texts of files and buses get into the page only as JSON without any `<`; a content security policy
names the scripts and styles by their hashes.

A log has columns for each message, its times and the values of its fields, which the page looks up and plots. The page
computes counts, periods and everything else from them. Besides frames it shows events on the time line, and panels that
only some networks have.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import typing
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeAlias

from eurobot_od.bus import frame_bits
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import IDENTITY
from eurobot_od.od.values import label
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import ColumnForm, Kind, Message
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.texts import encodable
from eurobot_od.traffic.entries import Damage, Foreign, Raw
from eurobot_od.traffic.meaning import Decoder, Meaning, wrong
from eurobot_od.traffic.monitor import MonitorRow, NodesHealth
from eurobot_od.web.drives import axes_of, drive_data, machine_data
from eurobot_od.web.events import BusEvents, PageEvent


class Beside(NamedTuple):
    """What was not on the bus: events, and rows in the form of the page."""

    events: Sequence[PageEvent] = ()
    rows: Sequence[dict[str, Any]] = ()


NOTHING_BESIDE = Beside()


class Control(typing.Protocol):
    """The actions of a panel on the bus when a message is sent from the page."""

    def send_message(self, message: Message) -> None:
        """Send a message; raises BusError."""

    def is_as_in_its_file(self, node: str) -> bool:
        """Return whether a node has the revision number of its EDS; one that does not answer SDO is trusted."""


class Panel:
    """A view of the page for networks that have certain messages; one object follows one source.

    `script` and `style` are written into the page: the script calls `panel(name, make)`, see `files/page.js`. `stop` is
    the message of the button Stop, empty if that is left to NMT. `plan` is the message that carries out a plan, empty
    if there is none: Stop takes whoever sends it out of OPERATIONAL. `orders` are messages that the page leaves to the
    node that sends them, by the name of the object to be written there; without that node the page sends them itself.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    script: ClassVar[str]
    style: ClassVar[str]
    stop: ClassVar[str] = ""
    plan: ClassVar[str] = ""
    orders: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def fits(cls, protocol: Protocol) -> bool:
        """Return whether a network has the panel's messages."""
        raise NotImplementedError

    @classmethod
    def of(cls, protocol: Protocol) -> type[Panel]:  # noqa: ARG003 (for those that override it)
        """Return the panel for a network that it fits."""
        return cls

    @classmethod
    def beside(cls, log: Path) -> Beside:  # noqa: ARG003 (for those that override it)
        """Return the data stored beside a log, with times from its first frame; raises LocalError for damage."""
        return NOTHING_BESIDE

    @classmethod
    def setup(cls) -> Mapping[str, Any]:
        """Return the settings of the script."""
        return {}

    def take(self, time: float, message: Message) -> Iterable[PageEvent]:
        """Process a message and return the new or changed events."""
        raise NotImplementedError

    def objection(self, message: Message, control: Control) -> str:
        """Return why a message must not be sent from the page now, empty if it may be sent.

        It is called on another thread than `take`, and may wait for answers.
        """
        return ""


# What the page shows, as data


def picked(thing: object, *names: str) -> dict[str, Any]:
    """Return attributes of a thing as data."""
    return {name: getattr(thing, name) for name in names}


def described(decoder: Decoder) -> dict[str, Any]:
    """Return messages and nodes as data."""
    return {
        "messages": list(map(_message, decoder.protocol.bindings)),
        "nodes": list(map(_node, decoder.dictionaries)),
        "machine": machine_data() if any(map(axes_of, decoder.dictionaries)) else None,
        "groups": list(decoder.protocol.catalogue.groups),
    }


def _message(binding: Binding) -> dict[str, Any]:
    known = picked(binding, "name", "group", "senders", "receivers")
    return known | {"id": binding.cob_id, "fields": [_field(binding, f) for f in binding.kinds]}


def _node(device: Dictionary) -> dict[str, Any]:
    identity = [device.number((IDENTITY, sub)) for sub in range(1, 5)]
    known = {"name": device.name, "id": device.node_id, "file": device.file.name}
    return known | {"identity": identity, "drive": drive_data(device)}


def _field(binding: Binding, field: str) -> dict[str, Any]:
    kind = binding.kinds[field]
    limits = binding.limits.get(field)
    data: dict[str, Any] = {"name": field, "unit": kind.unit, "words": dict(kind.named_values())}
    # What is mapped in slices is a part of no object's value.
    mapped = [each for slot, each in zip(binding.layout.slots, binding.pdo.mapping) if slot.field == field]
    data |= {"object": label(mapped[0].address)} if len(mapped) == 1 else {}
    data |= {"is_text": True} if kind.column_form in TEXTS else {}
    data |= {"allowed": kind.allowed(limits)} if limits else {"unmapped": True}
    if limits and kind.numbers(limits):
        data |= {"low": kind.numbers(limits).start, "high": kind.numbers(limits).stop - 1}
    if field in binding.defaults:
        data["default"] = kind.text(binding.defaults[field])
    return data


TEXTS = (ColumnForm.TEXT, ColumnForm.OCTETS)
"""Forms that cannot be plotted."""


def stop_message(panels: Sequence[type[Panel]]) -> str:
    """Return the message of the button Stop, empty if no panel has one."""
    return next((each.stop for each in panels if each.stop), "")


Fields: TypeAlias = Mapping[str, Kind]


def fields_of(decoder: Decoder) -> dict[int | Damage, Fields]:
    """Return the fields of each message as `described`, by COB-ID."""
    return {each.cob_id: each.kinds for each in decoder.protocol.bindings}


def values(meaning: Meaning, known: Mapping[int | Damage, Fields]) -> list[Any] | None:
    """Return a message's values for the page (numbers, words, None for unknown).

    None if it is not a message, or one whose fields are not `known`: its device maps it differently by now.
    """
    if meaning.message is None or meaning.kinds != known.get(meaning.raw[0]):
        return None
    return [kind.plain(value) for kind, value in zip(meaning.kinds.values(), meaning.message)]


def key_of(raw: Raw) -> int | str:
    """Return the key of a row on the page: the identifier, or the word for damage."""
    return raw.damage.value if isinstance(raw, Foreign) else raw.cob_id


def hex_of(meaning: Meaning) -> str:
    """Return a frame's bytes, empty for all but data frames."""
    return meaning.raw.data.hex() if isinstance(meaning.raw, Frame) and not meaning.raw.is_remote else ""


def is_foreign(meaning: Meaning) -> bool:
    """Return whether a frame is only unknown: without a file for its node it is not faulty."""
    return bool(meaning.defects) and all(each.damage is Damage.UNKNOWN_IDENTIFIER for each in meaning.defects)


def row_data(row: MonitorRow) -> dict[str, Any]:
    """Return the data of a row besides its frames."""
    known = {"key": key_of(row.meaning.raw), "id": row.identifier, "name": row.name}
    return known | {"foreign": is_foreign(row.meaning)} | picked(row.meaning, "group", "nodes")


def event_data(event: PageEvent) -> dict[str, Any]:
    """Return an event as data."""
    # With the digits of a frame's time: an event leads to its frame.
    end = None if event.end is None else round(event.end, DIGITS)
    return event._asdict() | {"time": round(event.time, DIGITS), "end": end}


# A log


MOST_FRAMES = 300_000
"""Most frames of a log on a page, about 20 minutes of a full bus; more would take a browser minutes to read."""

LOOK = 0.1
"""Time of a log between two checks for lost nodes, in s."""

DIGITS = 5
"""Decimal places of a time in seconds: ten microseconds, less than the shortest frame takes."""


class _Row:
    """All frames of one message, service or kind of damage; `numbers` are their places among all frames."""

    def __init__(self, meaning: Meaning, identifier: int | None) -> None:
        self._row = MonitorRow(identifier, meaning)
        self.times: list[float] = []
        self.numbers: list[int] = []
        self.data: list[str] = []
        self.values: list[list[Any]] = []
        self.texts: list[str] = []
        self.wrong: dict[int, str] = {}
        self.bits = 0

    def take(self, number: int, time: float, meaning: Meaning, known: Mapping[int | Damage, Fields]) -> None:
        found = values(meaning, known)
        self.numbers.append(number)
        self.data.append(hex_of(meaning))
        if found is None:
            # A row has no texts until a frame needs one.
            self.texts += [*[""] * (len(self.times) - len(self.texts)), meaning.text]
        elif self.texts:  # earlier frames of this message could not be read
            self.texts.append("")
        self.times.append(round(time, DIGITS))
        self.values.append(found or [])
        if meaning.defects:
            self.wrong[len(self.times) - 1] = wrong(meaning)
        if isinstance(meaning.raw, Frame):
            self.bits += frame_bits(meaning.raw)

    def described(self) -> dict[str, Any]:
        # A frame that could not be read has no values: its places are filled up.
        width = max(map(len, self.values))
        padded = ([*each, *[None] * (width - len(each))] for each in self.values)
        columns = {"values": list(zip(*padded)), "texts": self.texts, "bits": self.bits / len(self.times)}
        return row_data(self._row) | picked(self, "times", "numbers", "data", "wrong") | columns


class Columns:
    """Collects a log, or a part of it, whose times count from `start`, or else from its first entry.

    `left_out` counts the entries that are too many for a page.
    """

    def __init__(
        self,
        name: str,
        decoder: Decoder,
        bitrate: int,
        panels: Iterable[type[Panel]] = (),
        start: float | None = None,
    ) -> None:
        self.name = name
        self.bitrate = bitrate
        self._decoder = decoder
        self._known = fields_of(decoder)
        self.left_out = 0
        self.start = start
        self._end = 0.0
        self._taken = 0
        self._rows: dict[int | Damage, _Row] = {}
        self._panels = [panel() for panel in panels]
        self._events: dict[str, PageEvent] = {}
        self._watch = BusEvents(decoder)
        self._health = NodesHealth(decoder.dictionaries)
        self._looked = 0.0

    def take(self, time: float, meaning: Meaning, number: int | None = None) -> None:
        """Add an entry of the log, the next one or that of a `number`."""
        if self._taken >= MOST_FRAMES:
            self.left_out += 1
            return
        self.start = time if self.start is None else self.start
        now = time - self.start
        raw = meaning.raw
        self._taken = self._taken + 1
        self._end = max(self._end, now)
        number = number or self._taken
        row = self._rows.get(raw[0])
        if row is None:
            row = self._rows[raw[0]] = _Row(meaning, raw.cob_id if isinstance(raw, Frame) else None)
        row.take(number, now, meaning, self._known)
        self.note(number, now, meaning)
        if meaning.message is not None:
            for panel in self._panels:
                self.add(panel.take(now, meaning.message))

    def note(self, number: int, now: float, meaning: Meaning) -> None:
        """Process the nodes and events of an entry, `now` seconds after the start."""
        self._health.take(now, meaning)
        if now - self._looked >= LOOK:
            self.look(now)
        self.add(self._watch.take(number, now, meaning))

    def look(self, now: float) -> None:
        """Process the nodes that are lost or back."""
        self._looked = now
        self.add(self._watch.look(now, self._health.nodes))

    def add(self, events: Iterable[PageEvent]) -> None:
        """Add events, whose times count from the start."""
        for event in events:
            self._events[event.key] = event
            self._end = max(self._end, event.time)

    def shown(self, more: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
        """Return rows and events as data; `more` are rows of what was not on the bus."""
        rows = [*(row.described() for row in self._rows.values()), *more]
        return {"rows": rows, "events": list(map(event_data, list(self._events.values())))}

    def data(self, more: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
        """Return the source as data for the page."""
        times = {"began": self.start, "end": round(self._end, DIGITS)}
        return picked(self, "name", "bitrate", "left_out") | times | self.shown(more) | described(self._decoder)


# The file


FILES = Path(__file__).with_name("files")
STYLES = ("uplot.css", "page.css", "files.css")
SCRIPTS = (  # in this order: each uses the ones before it
    *(
        "uplot.js",
        "dom.js",
        "longlog.js",
        "store.js",
        "messages.js",
        "trace.js",
        "plots.js",
        "nodes.js",
        "objects.js",
        "send.js",
    ),
    *("settings.js", "checks.js", "layouts.js"),
    *("editor.js", "mapping.js", "filetree.js", "fileform.js", "files.js"),
    *("events.js", "drive.js", "page.js"),
)

START_SCRIPTS = ("dom.js", "start.js")

PART = re.compile(r"\{\{(\w+)\}\}")
"""A place in `page.html` to be filled in."""

POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">')
"""The element of a page with its content security policy."""

NOTHING = "default-src 'none'; base-uri 'none'; form-action 'none'"
"""The policy of a page in which nothing may be loaded or run."""


def page(
    title: str,
    sources: Sequence[Mapping[str, Any]],
    panels: Sequence[type[Panel]] = (),
    scripts: Sequence[str] = SCRIPTS,
    **settings: object,
) -> str:
    """Return the page that shows some sources; `settings` are for its scripts."""
    styles = [*(_read(FILES / name) for name in STYLES), *(panel.style for panel in panels)]
    texts = [*(_read(FILES / name) for name in scripts), *(panel.script for panel in panels)]
    shown = [picked(each, "name", "title", "stop", "plan") | {"setup": each.setup()} for each in panels]
    content = {"title": title, "sources": sources, "panels": shown, **settings}
    # By hashes: with 'unsafe-inline', any text that slipped into the page could run as well.
    allowed = f"script-src {_hashes(texts)}; style-src {_hashes(styles)}; img-src data: blob:; connect-src 'self'"
    parts = {
        "policy": f"{NOTHING}; {allowed}",
        "title": escape(title),
        "styles": "\n".join(f"<style>{each}</style>" for each in styles),
        "scripts": "\n".join(f"<script>{each}</script>" for each in texts),
        # Without `<`, no text from a file or a bus can end the script element that it is in.
        "content": json.dumps(content, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c"),
    }
    # In one pass: a content with `{{title}}` in it stays as it is.
    return encodable(PART.sub(lambda found: parts[found[1]], _read(FILES / "page.html")))


def policy_of(text: str) -> str:
    """Return a page's own content security policy, for the server to send with it."""
    found = POLICY.search(text)
    return found[1] if found else NOTHING


def _read(file: Path) -> str:
    return file.read_text(encoding="utf-8")


def _hashes(texts: Iterable[str]) -> str:
    digests = (base64.b64encode(hashlib.sha256(each.encode()).digest()).decode() for each in texts)
    return " ".join(f"'sha256-{each}'" for each in digests)
