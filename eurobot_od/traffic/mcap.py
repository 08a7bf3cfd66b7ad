"""Writes MCAP for Foxglove and PlotJuggler: a channel for each message, JSON with a schema.

A message has the words and numbers of `decode --json`, null for unknown. If a message draws something, such as a pose,
that goes into a channel of its own; the caller says which message draws what.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import IO, Any, NamedTuple

from mcap.writer import Writer

from eurobot_od.export.description import Drawings
from eurobot_od.frame import Frame, identifier_text
from eurobot_od.pdo.kinds import ColumnForm, Message, kinds, plain
from eurobot_od.traffic.dbc import ForeignMessage
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.entries import LogEntry
from eurobot_od.traffic.meaning import Decoder, Meaning, with_defects

NANOSECONDS = 1_000_000_000
END_OF_TIME = float(1 << 64) // NANOSECONDS
"""Upper limit of times in MCAP, in s: 64 bits of nanoseconds."""

JSON = "json"
SCHEMA = "jsonschema"
DAMAGE = "damage"

TYPES: Mapping[ColumnForm, str] = {
    **dict.fromkeys((ColumnForm.NUMBER, ColumnForm.SCALED, ColumnForm.REAL), "number"),
    **dict.fromkeys((ColumnForm.BITS, ColumnForm.WORD, ColumnForm.TEXT, ColumnForm.OCTETS), "string"),
    ColumnForm.BOOLEAN: "boolean",
}
"""JSON types of field values, as `Kind.plain` returns them."""


class Written(NamedTuple):
    """Numbers of messages and drawings written, and of damaged entries."""

    messages: int = 0
    drawings: int = 0
    damage: int = 0


def write(file: IO[bytes], entries: Iterable[LogEntry], decoder: Decoder, drawings: Drawings) -> Written:
    """Write the entries of a log; services become text, and damaged entries go to the channel `damage`."""
    writer = Writer(file)
    writer.start(library="eurobot-od")
    channels = _Channels(writer, drawings)
    counts = Counter[str]()
    latest = 0.0
    following = TrackingDecoder(decoder)
    for line, time, channel, raw in entries:
        meaning = following(time, channel, raw)
        place = {"line": line, "channel": channel}
        # An entry with a time that MCAP cannot hold is reported at the last good time.
        if 0 <= time < END_OF_TIME:
            latest = time
            made = channels.of(meaning, place, time)
        else:
            text = f"the time {time:g} s is not in 0..{END_OF_TIME:g}"
            time = latest
            made = [(DAMAGE, {"text": text, "_": place})]
        for name, content in made:
            channels.add(name, content, time, meaning)
        names = [name for name, _ in made]
        counts["messages"] += meaning.name in names and meaning.message is not None
        counts["drawings"] += sum(name.endswith(DRAWN) for name in names)
        counts["damage"] += DAMAGE in names
    writer.finish()  # type: ignore[no-untyped-call]
    return Written(**counts)


DRAWN = "/drawing"
"""Suffix of the name of a drawing's channel."""


class _Channels:
    """Channels of a file, created on first use."""

    def __init__(self, writer: Writer, drawings: Drawings) -> None:
        self._writer, self._drawings = writer, drawings
        self._ids: dict[tuple[str, type[Message] | None], int] = {}

    def of(self, meaning: Meaning, place: dict[str, Any], time: float) -> list[tuple[str, dict[str, Any]]]:
        """Return the parts that an entry becomes, each with its channel."""
        made: list[tuple[str, dict[str, Any]]] = []
        if meaning.message is not None:
            made.append((meaning.name, plain(meaning.message, meaning.kinds) | {"_": place}))
            drawing = self._drawings.get(meaning.name)
            seconds, rest = divmod(round(time * NANOSECONDS), NANOSECONDS)
            drawn = drawing.of(meaning.message, {"sec": seconds, "nsec": rest}) if drawing else None
            if drawn is not None:
                made.append((f"{meaning.name}{DRAWN}", drawn))
        elif not meaning.defects:
            said = meaning.fields if isinstance(meaning.service, ForeignMessage) else {"text": meaning.text}
            made.append((meaning.name, said | {"_": place}))
        if meaning.defects:
            made.append((DAMAGE, {"text": with_defects(meaning), "_": place}))
        return made

    def add(self, name: str, content: Mapping[str, Any], time: float, meaning: Meaning) -> None:
        """Write a part of an entry to a channel."""
        # A message that is remapped within a log has other fields, so it gets another channel.
        type_ = type(meaning.message) if name == meaning.name and meaning.message is not None else None
        key = name, type_
        if key not in self._ids:
            title, schema = self._schema(name, type_, meaning.service)
            schema_id = self._writer.register_schema(title, SCHEMA, json.dumps(schema).encode())
            known = {}
            if type_ is not None and isinstance(meaning.raw, Frame):
                known = {"cob_id": f"0x{identifier_text(meaning.raw.cob_id)}", "senders": meaning.sender}
            self._ids[key] = self._writer.register_channel(f"/{name}", JSON, schema_id, known)
        # The publish time equals the log time, as a bus has no other.
        now = round(time * NANOSECONDS)
        self._writer.add_message(self._ids[key], now, json.dumps(content, ensure_ascii=False).encode(), now)

    def _schema(self, name: str, type_: type[Message] | None, service: object) -> tuple[str, dict[str, Any]]:
        drawing = self._drawings.get(name.removesuffix(DRAWN)) if name.endswith(DRAWN) else None
        if drawing is not None:  # viewers choose the drawing by the schema's name
            return drawing.schema, {"type": "object", "title": drawing.schema, "properties": dict(drawing.properties)}
        properties: dict[str, Any] = {"text": {"type": "string"}}
        if type_ is not None:
            properties = {}
            for field, kind in kinds(type_).items():
                # A code or a value out of range may replace a number or text.
                types = dict.fromkeys([TYPES[kind.column_form], "number", "string", "null"])
                properties[field] = {"type": [*types], **_in(kind.unit)}
        elif isinstance(service, ForeignMessage):
            properties = {field: {"type": ["number", "string"], **_in(unit)} for field, unit in service.units.items()}
        return name, {"type": "object", "title": name, "properties": properties | {"_": PLACE}}


def _in(unit: str) -> dict[str, str]:
    """Return the schema entry for a unit."""
    return {"description": f"in {unit}"} if unit else {}


PLACE = {"type": "object", "properties": {"line": {"type": "integer"}, "channel": {"type": "string"}}}
