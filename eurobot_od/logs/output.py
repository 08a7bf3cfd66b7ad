"""Decoded entries as text, as JSON lines and as CSV.

Rule of this file: what does not depend on time and place in the log (`row`) is written once for each distinct frame;
`line` only puts the rest before it.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator, Sequence
from enum import IntEnum
from functools import lru_cache
from typing import Any, TypeAlias

from eurobot_od.frame import Frame
from eurobot_od.logs.filters import Wanted, Window
from eurobot_od.logs.meaning import Finding, Meaning
from eurobot_od.logs.raw import Entries, Raw, Understand
from eurobot_od.logs.tally import Tally
from eurobot_od.messages import TYPES, kinds
from eurobot_od.values import Barriers

NAME_WIDTH = max(len(each.__name__) for each in TYPES) + 2
"""Width of the column with the messages' names: longer than the type names by their spaces."""


class Output:
    """A form of output: `header` before the first line, `row` of a meaning, `line` of an entry."""

    header = ""

    def row(self, meaning: Meaning) -> str:
        """Write what depends on the frame alone."""
        raise NotImplementedError

    def line(self, log: str, number: int, time: float, channel: str, row: str) -> str:
        """Write an entry, with the end of its line."""
        raise NotImplementedError


class Text(Output):
    """Aligned columns for a person: time in s, channel, message, fields with units; `!` before what is wrong."""

    def row(self, meaning: Meaning) -> str:
        if not meaning.findings:
            return self.plain_row(meaning.name, meaning.text)
        wrong = "; ".join(f"{damage.value}: {text}" for damage, text in meaning.findings)
        fields = f"{meaning.text}  " if meaning.message is not None else ""
        return self.plain_row(meaning.name or "?", f"{fields}! {wrong}")

    def plain_row(self, name: str, text: str) -> str:
        """Write a message's name and, in a column of their own, its fields."""
        return f"{name.ljust(NAME_WIDTH)} {text}" if text else name

    def line(self, log: str, number: int, time: float, channel: str, row: str) -> str:
        return f"{time:13.6f}  {channel}  {row}\n"


class TextOfSeveral(Text):
    """Text with the name of the log before each line, as grep does."""

    def line(self, log: str, number: int, time: float, channel: str, row: str) -> str:
        return f"{log}:{super().line(log, number, time, channel, row)}"


class JsonLines(Output):
    """One JSON object a line; fields as numbers, null (unknown), or the words that a person writes."""

    def row(self, meaning: Meaning) -> str:
        data: dict[str, Any] = _identification(meaning)
        if meaning.message is not None:
            data["fields"] = _fields(meaning)
        elif meaning.text:
            data["text"] = meaning.text
        if meaning.findings:
            data["damage"] = [{"kind": damage.value, "text": text} for damage, text in meaning.findings]
        return json.dumps(data, ensure_ascii=False)[1:]

    def line(self, log: str, number: int, time: float, channel: str, row: str) -> str:
        return f'{{"log": {_quoted(log)}, "line": {number}, "time": {time:.6f}, "channel": {_quoted(channel)}, {row}\n'


def _identification(meaning: Meaning) -> dict[str, Any]:
    """Return identifier, data, message or service, group and nodes, as far as they are known."""
    frame = meaning.raw if isinstance(meaning.raw, Frame) else None
    known = {
        "id": frame and f"0x{frame.cob_id:03X}",
        "data": frame and frame.data.hex().upper(),
        "message": meaning.name or None,
        "protocol": meaning.group or None,
        "nodes": list(meaning.nodes) or None,
    }
    return {key: value for key, value in known.items() if value is not None}


def _fields(meaning: Meaning) -> dict[str, Any]:
    assert meaning.message is not None
    written = kinds(type(meaning.message))
    return {
        field: written[field].text(value) if isinstance(value, (IntEnum, Barriers)) else value
        for field, value in meaning.message._asdict().items()
    }


@lru_cache
def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


FIELDS = tuple(dict.fromkeys(field for each in TYPES for field in kinds(each)))
"""The columns for fields: each field of any message once."""


PLACE = ("log", "line", "timestamp", "channel")
FRAME = ("id", "data", "message", "protocol")


class Csv(Output):
    """Comma-separated values, one column for every field of any message; unknown is empty."""

    header = ",".join((*PLACE, *FRAME, "text", "damage", *FIELDS)) + "\n"

    def row(self, meaning: Meaning) -> str:
        known = _identification(meaning)
        fields = _fields(meaning) if meaning.message is not None else {}
        damage = "; ".join(f"{damage.value}: {text}" for damage, text in meaning.findings)
        head = [known.get(key, "") for key in FRAME]
        return _joined([*head, meaning.text, damage, *(fields.get(field, "") for field in FIELDS)])

    def line(self, log: str, number: int, time: float, channel: str, row: str) -> str:
        return f"{_joined((log,))},{number},{time:.6f},{_joined((channel,))},{row}\n"


def _joined(values: Sequence[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(values)
    return text.getvalue()


# Entries to lines


Shown: TypeAlias = "tuple[str | None, tuple[Finding, ...]]"
"""What became of a frame: its row, None if it is not wanted, and what is wrong with it."""


def showing(decode: Callable[[Raw], Meaning], wanted: Wanted | None, output: Output) -> Understand[Shown]:
    """Return what a log reader is to make of each frame; `wanted` is None if every frame is."""

    def show(raw: Raw) -> Shown:
        meaning = decode(raw)
        return output.row(meaning) if wanted is None or wanted(meaning) else None, meaning.findings

    return show


def written(entries: Entries[Shown], log: str, output: Output, tally: Tally, window: Window) -> Iterator[str]:
    """Yield the lines of a log's wanted entries; what is wrong is counted, wanted or not."""
    write, clock = output.line, window.clock()
    for number, time, channel, (row, findings) in entries:
        if findings:
            tally.add(log, number, findings)
        shown = time if clock is None else clock(time)
        if row is not None and shown is not None:
            yield write(log, number, shown, channel, row)
