"""Turns logs into lines of output, entry by entry, whatever the format of the log and of the output.

A frame has the meaning that the decoder keeps, and what only the frames before it tell: which transfer an SDO frame
belongs to, that an answer to a guarding master is not a heartbeat, and how the devices on its channel are set by then.
There is one `Following` for each log or bus.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, BinaryIO, TypeAlias

from eurobot_od.device.nmt import TOGGLE, NmtCommand, NmtState
from eurobot_od.frame import Frame, identifier_text
from eurobot_od.od.values import ERROR_CONTROL_BASE, FIRST, MANUFACTURER
from eurobot_od.pdo.catalogue import plain
from eurobot_od.pdo.in_force import InForce
from eurobot_od.support.texts import cell, one_line
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import LARGEST, REMEMBERED, Damage, Raw
from eurobot_od.traffic.filters import Wanted, Window
from eurobot_od.traffic.meaning import CANOPEN, DamageCounts, Decoder, Defect, Meaning, SdoTransfer, with_defects
from eurobot_od.traffic.services import GUARDING, HEARTBEAT, NMT, SDO, guarding_words
from eurobot_od.traffic.transfers import Transfers

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


FOLLOWED = (SDO, HEARTBEAT, GUARDING, NMT)
"""The services whose frames are understood by the ones before."""


RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)

SHOWN = range(FIRST, MANUFACTURER[0])
"""The objects of which some say what other frames mean."""

Changed: TypeAlias = Callable[[str, Decoder], None]


def is_followed(meaning: Meaning) -> bool:
    """Whether the frames before may change what a frame means."""
    return meaning.group == CANOPEN and meaning.name in FOLLOWED and not meaning.defects


class Follower:
    """Takes the frames of FOLLOWED in their order.

    `changed` is called with a channel, and with the decoder of its frames from now on, when one of them has shown that
    its sender is set otherwise than before.
    """

    def __init__(self, decoder: Decoder, changed: Changed) -> None:
        self._first, self._changed = decoder, changed
        self._decoders: dict[str, Decoder] = {}
        self._shown: dict[str, InForce] = {}
        self._transfers = Transfers()
        self._asked: set[tuple[str, int]] = set()
        self._last: dict[tuple[str, int], Meaning] = {}

    def __call__(self, time: float, channel: str, meaning: Meaning) -> Meaning:
        """Return what a frame of a log's channel means after those before it; the time is in s."""
        frame = meaning.raw
        assert isinstance(frame, Frame)
        if meaning.name == NMT:
            if not frame.is_remote and frame.data[0] in RESETS and channel in self._shown:
                self._news(channel, self._shown[channel].start(frame.data[1]))
            return meaning
        if meaning.name != SDO:
            return self._guarded(channel, frame, self._booted(channel, frame, meaning))
        end = self._decoders.get(channel, self._first).services[frame.cob_id].end
        if end is None or frame.is_remote:
            return meaning
        self._last[channel, end.channel] = meaning
        said = self._transfers.take(time, channel, end, frame.data)
        if not any(said):
            return meaning
        self._learn(channel, said.ended)
        text = f"{meaning.nodes[0]}, {said.text}" if said.text else meaning.text
        defects = (Defect(Damage.INCOMPLETE, f"{meaning.raw}: {said.lost}"),) if said.lost else ()
        return meaning._replace(text=f"{text}{said.more}", defects=defects, transfer=said.ended)

    def unfinished(self) -> Iterator[tuple[Meaning, SdoTransfer]]:
        """Yield the transfers that the end of the log cuts off, each with the meaning of its last frame."""
        for key, transfer in self._transfers.unfinished():
            yield self._last[key], transfer

    def _learn(self, channel: str, ended: SdoTransfer | None) -> None:
        """Take in what a transfer shows of a device; of a write only what the device has confirmed."""
        if ended and ended.address and ended.content is not None and ended.address[0] in SHOWN:
            if channel not in self._shown:
                self._shown[channel] = InForce(self._first.dictionaries)
            self._news(channel, self._shown[channel].show(ended.server, ended.address, ended.content))

    def _news(self, channel: str, is_news: bool) -> None:
        if is_news:
            self._decoders[channel] = self._first.as_shown(self._shown[channel])
            self._changed(channel, self._decoders[channel])

    def _booted(self, channel: str, frame: Frame, meaning: Meaning) -> Meaning:
        """Say what transfers a boot-up cuts off."""
        if frame.is_remote or frame.data[0] != NmtState.INITIALISING:
            return meaning
        if channel in self._shown:
            self._news(channel, self._shown[channel].start(frame.cob_id - ERROR_CONTROL_BASE))
        for said in self._transfers.boot(channel, frame.cob_id - ERROR_CONTROL_BASE):
            lost = (Defect(Damage.INCOMPLETE, f"{frame}: {said.lost}"),) if said.lost else ()
            meaning = meaning._replace(defects=(*meaning.defects, *lost), transfer=said.ended)
        return meaning

    def _guarded(self, channel: str, frame: Frame, meaning: Meaning) -> Meaning:
        """Name what a node answers to a remote frame: only by its toggle bit would it be told from a heartbeat."""
        key = channel, frame.cob_id
        if frame.is_remote:
            self._asked.add(key)
        elif key in self._asked or frame.data[0] & TOGGLE:
            self._asked.discard(key)
            text = f"{meaning.nodes[0]}, {guarding_words(frame.data)}"
            return meaning._replace(name=GUARDING, text=text)
        return meaning


class Following:
    """Decodes the entries of a log or of a bus in their order."""

    def __init__(self, decoder: Decoder) -> None:
        # Most frames on a bus are requests and confirms without data: their meaning is kept.
        self._decode = lru_cache(REMEMBERED)(decoder)
        self._decode_now: dict[str, Callable[[Raw], Meaning]] = {}
        self._follow = Follower(decoder, self._change)

    def _change(self, channel: str, decoder: Decoder) -> None:
        self._decode_now[channel] = lru_cache(REMEMBERED)(decoder)

    def __call__(self, time: float, channel: str, raw: Raw) -> Meaning:
        """Return what an entry means; the time is in s, the channel that of a log."""
        meaning = self._decode_now.get(channel, self._decode)(raw)
        return self._follow(time, channel, meaning) if is_followed(meaning) else meaning


EVERYTHING = Window()

Known: TypeAlias = tuple[Any, tuple[Defect, ...], Meaning | None]
"""What is known of a frame without those before it: its row, its defects, its meaning if that may change."""


class Decoding:
    """What is asked for: the `output`, the entries `wanted` (None: all), their times; `damage` counts what is wrong."""

    def __init__(
        self, decoder: Decoder, output: Output, wanted: Wanted | None = None, window: Window = EVERYTHING
    ) -> None:
        self.damage = DamageCounts()
        self._output, self._wanted, self._window = output, wanted, window
        self._decoder, self._known = decoder, self._remembering(decoder)

    def _row(self, meaning: Meaning) -> Any:
        return self._output.row(meaning) if self._wanted is None or self._wanted(meaning) else None

    def _remembering(self, decoder: Decoder) -> Callable[[Raw], Known]:
        row = self._row

        # Most frames on a bus are requests and confirms without data: what is made from them is kept.
        @lru_cache(REMEMBERED)
        def known(raw: Raw) -> Known:
            meaning = decoder(raw)
            return row(meaning), meaning.defects, meaning if is_followed(meaning) else None

        return known

    def lines(self, file: BinaryIO, log: str, form: str | None = None, largest: int = LARGEST) -> Iterator[str]:
        """Yield the lines of output for an open log named `log`; errors as `formats.entries`.

        What is wrong in the log is counted, whether it is wanted or not.
        """
        known, shown_time, write = self._known, self._window.clock(), self._output.writer(log)
        now: dict[str, Callable[[Raw], Known]] = {}
        follow = Follower(self._decoder, lambda channel, decoder: now.update({channel: self._remembering(decoder)}))
        known_now = now.get
        for number, time, channel, raw in formats.entries(file, form, largest):
            row, defects, followed = known_now(channel, known)(raw)
            if followed and (said := follow(time, channel, followed)) is not followed:
                row, defects = self._row(said), said.defects
            if defects:
                self.damage.add(log, number, defects)
            shown = shown_time(time)
            if row is not None and shown is not None:
                yield write(number, shown, channel, row)
        for last, transfer in follow.unfinished():
            if self._row(last) is not None:
                self._output.cut(transfer)
        if footer := self._output.footer():
            yield footer
