"""Decoded entries as data for other programs: JSON lines and CSV.

A field is a number, nothing (unknown), or the words that a person writes.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

from eurobot_od.frame import Frame, identifier_text
from eurobot_od.pdo.message import plain
from eurobot_od.support.texts import cell
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.output import Output, WriteLine


class JsonOutput(Output):
    """One JSON object a line; fields as numbers, null (unknown), or the words that a person writes."""

    def row(self, meaning: Meaning) -> str:
        data: dict[str, Any] = _identification(meaning)
        if meaning.message is not None:
            data["fields"] = plain(meaning.message)
        elif meaning.text:
            data["text"] = meaning.text
        if meaning.defects:
            data["damage"] = [{"kind": damage.value, "text": text} for damage, text in meaning.defects]
        return _json(data)[1:]  # the writer opens the object with the place and the time

    def writer(self, log: str) -> WriteLine:
        start, quoted = f'{{"log": {_json(log)}, "line":', lru_cache(_json)
        return lambda number, time, channel, row: (
            f'{start} {number}, "time": {time:.6f}, "channel": {quoted(channel)}, {row}\n'
        )


def _identification(meaning: Meaning) -> dict[str, Any]:
    """Return identifier, data, message or service, group and nodes, as far as they are known."""
    frame = meaning.raw if isinstance(meaning.raw, Frame) else None
    known = {
        "id": frame and f"0x{identifier_text(frame.cob_id)}",
        "data": frame.data.hex().upper() if frame and not frame.is_remote else None,
        "remote": True if frame and frame.is_remote else None,
        "message": meaning.name or None,
        "protocol": meaning.group or None,
        "nodes": list(meaning.nodes) or None,
    }
    return {key: value for key, value in known.items() if value is not None}


def _json(data: Any) -> str:
    """Write data as it is for people to read, unless it has characters that a terminal might act on."""
    text = json.dumps(data, ensure_ascii=False)
    return text if text.isprintable() else json.dumps(data)


FRAME = ("id", "data", "message", "protocol")
"""What of a frame is in a column of CSV; of a remote frame the text says that it is one."""


class CsvOutput(Output):
    """Comma-separated values, one column for each of the `fields` that any message has; unknown is empty."""

    def __init__(self, fields: Iterable[str]) -> None:
        self._fields = tuple(dict.fromkeys(fields))
        self.header = ",".join(("log", "line", "timestamp", "channel", *FRAME, "text", "damage", *self._fields)) + "\n"

    def row(self, meaning: Meaning) -> str:
        known = _identification(meaning)
        fields = plain(meaning.message) if meaning.message is not None else {}
        damage = "; ".join(f"{damage.value}: {text}" for damage, text in meaning.defects)
        head = [known.get(key, "") for key in FRAME]
        return _joined([*head, meaning.text, damage, *(fields.get(field, "") for field in self._fields)])

    def writer(self, log: str) -> WriteLine:
        start, quoted = _joined([log]), lru_cache(lambda channel: _joined([channel]))
        return lambda number, time, channel, row: f"{start},{number},{time:.6f},{quoted(channel)},{row}\n"


def _joined(values: Sequence[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(map(cell, values))
    return text.getvalue()
