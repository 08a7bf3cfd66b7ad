"""The forms of output: text for a person, JSON lines and CSV for other programs.

A line has two parts. The `row` depends only on the frame, and is made once for each distinct frame; place and time
before it are new in every line.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import Any, TypeAlias

from eurobot_od.frame import Frame, identifier_text
from eurobot_od.pdo.message import plain
from eurobot_od.support.texts import cell, one_line
from eurobot_od.traffic.meaning import Meaning, SdoTransfer, with_defects

NAME_WIDTH = 29
"""Width of the column with the messages' names; a longer name pushes its fields to the right."""

LINE = "%s%13.6f  %s  %s\n"
"""Name of the log, time, channel, row. An f-string would take half as long again for the time."""

WriteLine: TypeAlias = Callable[[int, float, str, Any], str]
"""Makes a line, with its end, from an entry's line number, its time in s, its channel, and the row of its frame."""


class Output:
    """A form of output, with a `header` before the first line."""

    header = ""

    def row(self, meaning: Meaning) -> Any:
        """Write what depends on the frame alone; None for no line."""
        raise NotImplementedError

    def writer(self, log: str) -> WriteLine:
        """Return the function that writes the lines of a log with this name."""
        raise NotImplementedError

    def cut(self, transfer: SdoTransfer) -> None:
        """Take in an SDO transfer that the end of a log cuts off."""

    def footer(self) -> str:
        """Return what comes after the lines of a log."""
        return ""


class TextOutput(Output):
    """Aligned columns for a person: time in s, channel, message, fields with units; `!` before what is wrong.

    With `several` logs each line starts with the name of its log, as grep does it.
    """

    def __init__(self, several: bool = False) -> None:
        self._several = several

    def row(self, meaning: Meaning) -> str:
        name, text = meaning.name, meaning.text
        if meaning.defects:
            name, text = name or "?", with_defects(meaning)
        return one_line(f"{name.ljust(NAME_WIDTH)} {text}" if text else name)

    def writer(self, log: str) -> WriteLine:
        start, shown = one_line(f"{log}:") if self._several else "", lru_cache(one_line)
        return lambda _, time, channel, row: LINE % (start, time, shown(channel), row)


# Data: a field is a number, nothing (unknown), or the words that a person writes


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
