"""Turns logs into lines of output, batch by batch, whatever the format of the log and of the output.

A frame has the meaning that the decoder keeps, and what only the frames before it tell: which transfer an SDO frame
belongs to, that an answer to a guarding master is not a heartbeat, and how the devices on its channel are set by then.
There is one `Following` for each log or bus.
"""

from __future__ import annotations

import csv
import io
import json
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache, lru_cache, partial
from math import isfinite
from typing import Any, BinaryIO, NamedTuple, TypeAlias

from eurobot_od.device.nmt import RESETS, TOGGLE, NmtState
from eurobot_od.frame import Frame, RemoteFrame, identifier_text
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.profiles import AREA
from eurobot_od.od.standard import ANSWERS
from eurobot_od.od.values import ERROR_CONTROL_BASE, FIRST, MANUFACTURER, NODE_IDS, Address
from eurobot_od.pdo import in_force
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.in_force import InForce
from eurobot_od.pdo.kinds import plain, units, worded
from eurobot_od.sdo.wire import Initiate
from eurobot_od.support.texts import cell, one_line
from eurobot_od.traffic import formats
from eurobot_od.traffic.dbc import ForeignMessage
from eurobot_od.traffic.entries import LARGEST, REMEMBERED, Batch, Damage, Foreign, Raw
from eurobot_od.traffic.filters import Wanted, Window
from eurobot_od.traffic.meaning import (
    CANOPEN,
    OUTSIDE,
    DamageCounts,
    Decoder,
    Defect,
    Meaning,
    SdoTransfer,
    texts_writer,
    with_defects,
    words_of,
    wrong,
)
from eurobot_od.traffic.services import FOLLOWED, GUARDING, LSS, NMT, SDO, WRITE, SdoEnd, guarding_words
from eurobot_od.traffic.transfers import ONE_WAY, LssConfiguration, Said, Transfers

NAME_WIDTH = 29
"""Width of the column with the messages' names; a longer name pushes its fields to the right."""

WIDTH = 13
"""Width of the column with the times."""

Clock: TypeAlias = Callable[[float], "float | None"]
"""From an entry's time to the time shown, in s, None for one not wanted."""

Rows: TypeAlias = Callable[[Sequence[bytes]], Sequence[Any]]
"""Makes the rows of frames of one message from their data; None for one that has to be decoded by itself."""

Write: TypeAlias = Callable[[Batch, Sequence[Any], Clock], str]
"""Makes the lines of a batch from its rows, with their ends; an entry without a row has none."""

WriteLine: TypeAlias = Callable[[int, float, str, Any], str]
"""Makes a line, with its end, from an entry's line number, its time in s, its channel, and the row of its frame."""


class Output:
    """A form of output, with a `header` before the first line."""

    header = ""

    def row(self, meaning: Meaning) -> Any:
        """Write what depends on the frame alone; None for no line."""
        raise NotImplementedError

    def rows_of(self, binding: Binding) -> Rows | None:
        """Return what writes the rows of a message's frames; None if they are decoded one by one."""
        return None

    def line_writer(self, log: str) -> WriteLine:
        """Return the function that writes a line of a log with this name."""
        raise NotImplementedError

    def writer(self, log: str) -> Write:
        """Return the function that writes the lines of a log with this name."""
        line = self.line_writer(log)

        def write(batch: Batch, rows: Sequence[Any], clock: Clock) -> str:
            shown = map(clock, batch.times)
            entries = zip(batch.lines, shown, batch.channels, rows)
            return "".join([line(*each) for each in entries if each[1] is not None and each[3] is not None])  # type: ignore[arg-type]

        return write

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
        name, text = meaning.name or ("?" if meaning.defects else ""), with_defects(meaning)
        return one_line(f"{name.ljust(NAME_WIDTH)} {text}" if text else name)

    def rows_of(self, binding: Binding) -> Rows:
        head, length = f"{binding.name.ljust(NAME_WIDTH)} ", binding.layout.length
        writer = cache(partial(texts_writer, binding))  # compiled for the first of them: a device may be mapped anew
        alone, head = [one_line(binding.name)], one_line(head)

        def rows(data: Sequence[bytes]) -> Sequence[str | None]:
            if set(map(len, data)) != {length}:
                return [rows([each])[0] if len(each) == length else None for each in data]
            if not binding.limits:
                return alone * len(data)
            written = writer()(head, words_of(binding, data))
            return [None if OUTSIDE in each else each for each in written] if OUTSIDE in "".join(written) else written

        return rows

    def line_writer(self, log: str) -> WriteLine:
        start, shown = one_line(f"{log}:") if self._several else "", lru_cache(one_line)
        return lambda _, time, channel, row: f"{start}{time:{WIDTH}.6f}  {shown(channel)}  {row}\n"

    def writer(self, log: str) -> Write:
        write, start = super().writer(log), one_line(f"{log}:") if self._several else ""

        def at_once(batch: Batch, rows: Sequence[str | None], clock: Clock) -> str:
            if clock is not float or batch.stamps is None or not batch.is_of_one_channel or None in rows:
                return write(batch, rows, clock)
            gap = f"  {one_line(batch.channels[0])}  "
            (width, *others), head = set(map(len, batch.stamps)), start
            stamps = [f"{stamp:>{WIDTH}}" for stamp in batch.stamps] if others else batch.stamps
            head += " " * (0 if others else WIDTH - width)
            return "".join([f"{head}{stamp}{gap}{row}\n" for stamp, row in zip(stamps, rows)])

        return at_once


# Data: a field is a number, nothing (unknown), or the words that a person writes

DIGITS = {"index": 4, "code": 4, "register": 2, "abort": 8}
"""Fields of services that people write as hexadecimal numbers, and how many digits they have."""

SERVICE_FIELDS = (
    *("node", "direction", "index", "subindex", "value", "content", "size", "how", "seconds", "abort", "abort_name"),
    *("code", "register", "words", "info", "state", "command"),
)
"""The fields of all services."""


def _fields(meaning: Meaning) -> dict[str, Any]:
    """Return the fields of a frame, numbers and the texts that a person writes."""
    if meaning.message is not None:
        return plain(meaning.message)
    if meaning.group != CANOPEN:
        return meaning.fields
    return {name: _plain(name, value) for name, value in meaning.fields.items()}


def _plain(name: str, value: Any) -> Any:
    """Return a field of a service as a number or as the text that a person writes."""
    if name in DIGITS:
        return f"0x{value:0{DIGITS[name]}X}"
    if isinstance(value, bytes):
        return value.hex().upper()
    if isinstance(value, float) and isfinite(value):  # JSON has no other numbers
        return round(value, 6) if name == "seconds" else value
    return value if isinstance(value, (int, str)) else str(value)


def _units(meaning: Meaning) -> dict[str, str]:
    """Return the units of a frame's fields, of those that have one."""
    if meaning.message is not None:
        return dict(units(type(meaning.message)))
    if isinstance(meaning.service, ForeignMessage):
        return {name: unit for name, unit in meaning.service.units.items() if unit}
    return {}


class JsonOutput(Output):
    """One JSON object a line; fields as numbers, null (unknown), or the words that a person writes, and their units."""

    def row(self, meaning: Meaning) -> str:
        data: dict[str, Any] = _identification(meaning)
        if meaning.message is None and meaning.text:
            data["text"] = meaning.text
        if meaning.message is not None or meaning.fields:
            data["fields"] = _fields(meaning)
        if own := _units(meaning):
            data["units"] = own
        if meaning.message is not None and (said := worded(meaning.message)):
            data["words"] = said
        if meaning.defects:
            data["damage"] = [{"kind": each.damage.value, "text": each.text} for each in meaning.defects]
        return _json(data)[1:]  # the writer opens the object with the place and the time

    def line_writer(self, log: str) -> WriteLine:
        start, quoted = f'{{"log": {_json(log)}, "line":', lru_cache(_json)
        return lambda number, time, channel, row: (
            f'{start} {number}, "time": {time:.6f}, {_dated(time)}"channel": {quoted(channel)}, {row}\n'
        )


OF_DATES = 1e8
"""Times from here on, in s, count from 1970: no log lasts three years."""


def _date(time: float) -> str:
    """Return the date of a time in ISO 8601; empty for a log that has none."""
    return datetime.fromtimestamp(time, UTC).isoformat(timespec="microseconds") if time >= OF_DATES else ""


def _dated(time: float) -> str:
    return f'"datetime": "{_date(time)}", ' if time >= OF_DATES else ""


def _identification(meaning: Meaning) -> dict[str, Any]:
    """Return identifier, data, message or service, group and nodes, as far as they are known."""
    raw = meaning.raw
    cob_id, data = (raw.frame or (None, b"")) if isinstance(raw, Foreign) else raw
    is_remote, is_fd = isinstance(raw, RemoteFrame), isinstance(raw, Foreign) and cob_id is not None
    known = {
        "id": None if cob_id is None else f"0x{identifier_text(cob_id)}",
        "data": None if cob_id is None or is_remote else data.hex().upper(),
        "remote": is_remote or None,
        "fd": is_fd or None,
        "brs": raw.has_bit_rate_switch if isinstance(raw, Foreign) else None,
        "message": meaning.name or None,
        "protocol": meaning.group or None,
        "nodes": list(meaning.nodes) or None,
    }
    return {key: value for key, value in known.items() if value is not None}


def _json(data: Any) -> str:
    """Write data as it is for people to read, unless it has characters that a terminal might act on."""
    text = json.dumps(data, ensure_ascii=False)
    return text if text.isprintable() else json.dumps(data)


UNITS = "units"
"""The last column of CSV."""

FRAME = ("id", "data", "fd", "brs", "message", "protocol")
"""What of a frame is in a column of CSV; of a remote frame the text says that it is one."""


class CsvOutput(Output):
    """Comma-separated values, a column for each of the `fields` that any message or service has; unknown is empty.

    The column `units` has those of a message's fields: `x=mm angle=deg`.
    """

    def __init__(self, fields: Iterable[str]) -> None:
        self._fields = tuple(dict.fromkeys((*fields, *SERVICE_FIELDS)))
        names = "log", "line", "timestamp", "datetime", "channel", *FRAME, "text", "damage", *self._fields, UNITS
        self.header = f"{','.join(names)}\n"

    def row(self, meaning: Meaning) -> str:
        known, fields = _identification(meaning), _fields(meaning)
        head = [known.get(key, "") for key in FRAME]
        own = {"value": fields["unit"]} if "unit" in fields else _units(meaning)
        said = [fields.get(field, "") for field in self._fields]
        return _joined([*head, meaning.text, wrong(meaning), *said, " ".join(f"{k}={v}" for k, v in own.items())])

    def line_writer(self, log: str) -> WriteLine:
        start, quoted = _joined([log]), lru_cache(lambda channel: _joined([channel]))
        return lambda number, time, channel, row: f"{start},{number},{time:.6f},{_date(time)},{quoted(channel)},{row}\n"


def _joined(values: Sequence[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(map(cell, values))
    return text.getvalue()


HEARTBEATS = range(ERROR_CONTROL_BASE + NODE_IDS[0], ERROR_CONTROL_BASE + NODE_IDS[-1] + 1)
"""COB-IDs of heartbeats (CiA 301, 7.3.3)."""

RUNNING = frozenset(bytes([state]) for state in NmtState if state is not NmtState.INITIALISING)
"""Data of heartbeats that change nothing."""

SHOWN = range(FIRST, MANUFACTURER[0])
"""The objects of which some say what other frames mean."""

SHOWING = frozenset((*SHOWN, *AREA))
"""These, and the objects by which a device without a file shows its profile."""


def is_followed(meaning: Meaning) -> bool:
    """Return whether the frames before may change what a frame means."""
    return meaning.group == CANOPEN and meaning.name in FOLLOWED and not meaning.defects


def _writes_setting(end: SdoEnd, data: bytes) -> bool:
    """Return whether a frame asks for, or confirms, the write of an object that says what other frames mean."""
    if data[2] >> 4 != SHOWN.start >> 12:  # nearly all others, known by one byte
        return False
    command = end.command(data)
    is_write = command is not None and command.names_object and command.direction == WRITE
    return is_write and in_force.is_followed(Initiate.of(data).address)


Candidates: TypeAlias = Callable[[Decoder, int], Iterable["tuple[int, float, int, Raw]"]]
"""Yields place, time in s, line and frame of what a decoder follows, of all entries of a channel behind a place."""


class DecoderSpan(NamedTuple):
    """Consecutive entries of a channel with one `decoder`: those behind place `after` up to `last`; None for the rest.

    `followed` has time and meaning of those that are understood by the ones before them, by their places.
    """

    decoder: Decoder
    after: int
    last: int | None
    followed: Mapping[int, tuple[float, Meaning]]


class Following:
    """Decodes the entries of a log or of a bus in their order.

    A frame may show that its sender is set otherwise than before: the `decoder` of its channel is another one then.
    `is_guarded` says whether a master has asked for a node's state.
    """

    def __init__(self, decoder: Decoder) -> None:
        self._first, self._decoders = decoder, dict[str, Decoder]()
        self._shown: dict[str, InForce] = {}
        self._transfers = Transfers()
        self._asked: set[tuple[str, int]] = set()
        self.is_guarded = False
        self._last: dict[tuple[str, int], Meaning] = {}
        self._request_lines: dict[tuple[str, int], int] = {}
        self._ways = defaultdict[str, set[bool]](set)
        self._settings = set[str]()
        self._heard = defaultdict[str, set[int]](set)
        self._lss = defaultdict[str, LssConfiguration](LssConfiguration)

    def decoder(self, channel: str) -> Decoder:
        """Return the decoder for what the devices on a channel have in force now."""
        return self._decoders.get(channel, self._first)

    def at(self, time: float, channel: str, raw: Raw) -> Callable[[Raw], Meaning]:
        """Take in an entry, and return what decodes it: for one that may never be decoded."""
        decoder = self.decoder(channel)
        if raw[0] in decoder.followed:
            self(time, channel, raw)
        return decoder.remembered

    def __call__(self, time: float, channel: str, raw: Raw, line: int = 0) -> Meaning:
        """Return what an entry means; the time is in s, channel and line are those of a log."""
        meaning = self._decoders.get(channel, self._first).remembered(raw)
        return self._follow(time, channel, meaning, line) if is_followed(meaning) else meaning

    def spans(self, channel: str, candidates: Candidates) -> Iterator[DecoderSpan]:
        """Yield the spans of a channel's entries between which something else comes into force."""
        after = -1
        while True:
            decoder, followed, last = self.decoder(channel), dict[int, tuple[float, Meaning]](), None
            for place, time, line, raw in candidates(decoder, after):
                followed[place] = time, self(time, channel, raw, line)
                if self.decoder(channel) is not decoder:
                    last = place
                    break
            yield DecoderSpan(decoder, after, last, followed)
            if last is None:
                return
            after = last

    def shown(self, channel: str, node_id: int) -> Mapping[Address, int]:
        """Return what a device has shown that it has by now."""
        return self._shown[channel].shown(node_id) if channel in self._shown else {}

    def _in_force(self, channel: str) -> InForce:
        if channel not in self._shown:
            self._shown[channel] = InForce(self._first.dictionaries, self._first.learned, self._first.describe)
        return self._shown[channel]

    def _follow(self, time: float, channel: str, meaning: Meaning, line: int) -> Meaning:
        """Return what a frame of a log's channel means after those before it; the time is in s."""
        frame = meaning.raw
        assert isinstance(frame, Frame)
        if meaning.name == NMT:
            if not frame.is_remote and frame.data[0] in RESETS:
                self._news(channel, self._in_force(channel).start(frame.data[1]))
            return meaning
        if meaning.name == LSS:
            if not frame.is_remote:
                self._lss[channel].take(frame.cob_id == ANSWERS, frame.data)
            return meaning
        if meaning.name != SDO:
            return self._guarded(channel, frame, self._booted(channel, frame, meaning))
        end = self.decoder(channel).services[frame.cob_id].end
        if end is None or frame.is_remote:
            return meaning
        return self._of_sdo(time, channel, meaning, end, line)

    def _of_sdo(self, time: float, channel: str, meaning: Meaning, end: SdoEnd, line: int) -> Meaning:
        """Return what a frame means in its SDO transfer, and take in what that shows."""
        assert isinstance(meaning.raw, Frame)
        key = channel, end.channel
        self._last[key] = meaning
        self._ways[channel].add(end.is_answer)
        is_setting = _writes_setting(end, meaning.raw.data)
        if is_setting:
            self._settings.add(channel)
        said = self._transfers.take(time, channel, end, meaning.raw.data)
        if end.is_answer:
            self._heard[channel].add(end.server)
            self._confirm(channel, end.server, said, (self._request_lines.get(key) or line) if line else time)
        else:
            self._request_lines[key] = line
            self._leave(channel, said.ended)
            if is_setting:
                self._news(channel, self._in_force(channel).ask(end.server, Initiate.of(meaning.raw.data).address))
        if not any(said):
            return meaning
        text = f"{meaning.nodes[0]}, {said.text}" if said.text else meaning.text
        defects = (Defect(Damage.INCOMPLETE, f"{meaning.raw}: {said.lost}"),) if said.lost else ()
        # The segments of a block look like any other command.
        if said.text and not said.ended:
            meaning = meaning._replace(service=None)
        return meaning._replace(text=f"{text}{said.more}", defects=defects, transfer=said.ended)

    def _leave(self, channel: str, ended: SdoTransfer | None) -> None:
        """Take in that a client has given up a transfer: the device may have taken what was written, or not."""
        if ended and ended.end and ended.address and not ended.is_upload and ended.address[0] in SHOWN:
            self._news(channel, self._in_force(channel).forget(ended.end.server, ended.address))

    def _confirm(self, channel: str, server: int, said: Said, place: int | float) -> None:
        """Take in what an answer shows: of a write, asked for at a line or a time in s, only what is confirmed."""
        unseen, ended = set[Address](), said.ended
        if ended and ended.address and ended.aborted is not None:
            self._news(channel, self._in_force(channel).refuse(server, ended.address))
        is_confirmed = ended and ended.is_whole and ended.aborted is None and ended.end and ended.address
        if said.unseen and said.unseen[0] in SHOWN:
            unseen.add(said.unseen)
        if ended and is_confirmed and ended.content is None and not ended.is_upload:
            unseen.add(ended.address)  # type: ignore[arg-type]
        for address in unseen:
            self._news(channel, self._in_force(channel).forget(server, address))
        if ended and is_confirmed and ended.address and ended.content is not None and ended.address[0] in SHOWING:
            where = f"by SDO at line {place}" if isinstance(place, int) else f"by SDO at {place:.6f} s"
            written = "" if ended.is_upload else where
            self._news(channel, self._in_force(channel).show(server, ended.address, ended.content, written))

    def unfinished(self) -> Iterator[tuple[str, Meaning, SdoTransfer]]:
        """Yield the transfers that the end of the log cuts off, with channel and the last frame's meaning."""
        for key, transfer in self._transfers.unfinished():
            yield key[0], self._last[key], transfer

    def notes(self) -> Iterator[str]:
        """Yield what a log cannot tell, as it has settings of devices and only one direction of SDO."""
        ways = (self._ways[each] for each in self._settings)
        yield from dict.fromkeys(ONE_WAY[way] for each in ways if len(each) == 1 for way in each)

    def _news(self, channel: str, is_news: bool) -> None:
        if is_news:
            self._decoders[channel] = self.decoder(channel).as_shown(self._shown[channel])

    def _booted(self, channel: str, frame: Frame, meaning: Meaning) -> Meaning:
        """Say what transfers a boot-up cuts off."""
        if frame.is_remote or frame.data[0] != NmtState.INITIALISING:
            return meaning
        node_id = frame.cob_id - ERROR_CONTROL_BASE
        self._news(channel, self._in_force(channel).start(node_id))
        if device := self._renumbered(channel, node_id):
            self._news(channel, True)
            meaning = meaning._replace(text=f"{meaning.text}; by LSS it is {device.name}, read by {device.file}")
        for said in self._transfers.boot(channel, node_id):
            lost = (Defect(Damage.INCOMPLETE, f"{frame}: {said.lost}"),) if said.lost else ()
            meaning = meaning._replace(defects=(*meaning.defects, *lost), transfer=said.ended)
        return meaning

    def _renumbered(self, channel: str, node_id: int) -> Dictionary | None:
        """Return the description of a device that starts with a node-ID by LSS; None for any other."""
        taken, heard = self._lss[channel].taken, self._heard[channel] - {node_id}
        self._heard[channel].add(node_id)
        if node_id not in taken:
            return None
        identity, shown = taken.pop(node_id), self._in_force(channel)
        return shown.renumber_only(heard, node_id) if identity is None else shown.renumber(identity, node_id)

    def _guarded(self, channel: str, frame: Frame, meaning: Meaning) -> Meaning:
        """Name what a node answers to a remote frame: only by its toggle bit would it be told from a heartbeat."""
        key = channel, frame.cob_id
        if frame.is_remote:
            self._asked.add(key)
            self.is_guarded = True
        elif key in self._asked or frame.data[0] & TOGGLE:
            self._asked.discard(key)
            text = f"{meaning.nodes[0]}, {guarding_words(frame.data)}"
            return meaning._replace(name=GUARDING, text=text)
        return meaning


EVERYTHING = Window()

Known: TypeAlias = tuple[Any, tuple[Defect, ...]]
"""What is known of a frame: its row and its defects."""


class InUse:
    """How the frames of a channel are decoded now: `known` one by one, `at_once` those of one identifier together."""

    def __init__(self, decoder: Decoder, output: Output, wanted: Wanted | None) -> None:
        # Most frames on a bus are requests and confirms without data: what is made from them is kept.
        @lru_cache(REMEMBERED)
        def known(raw: Raw) -> Known:
            meaning = decoder.remembered(raw)
            row = output.row(meaning) if wanted is None or wanted(meaning) else None
            return row, meaning.defects

        self.known, self.decoder, self._wanted = known, decoder, wanted
        bindings = decoder.protocol.bindings if wanted is None else ()
        self._bindings = {each.cob_id: each for each in bindings if each.is_whole}
        self._rows_of, self._made = output.rows_of, dict[int, Rows | None]()
        # Heartbeats are nearly all alike: those that are followed are decoded once more.
        self._alone = decoder.followed.difference(HEARTBEATS)

    def at_once(self, head: int | Raw) -> Rows | None:
        """Return what writes the frames of an identifier; None if they are decoded one by one."""
        if not isinstance(head, int):
            return None
        if head not in self._made:
            binding = self._bindings.get(head)
            self._made[head] = self._rows_of(binding) if binding else self._by_data(head)
        return self._made[head]

    def _by_data(self, cob_id: int) -> Rows | None:
        """Return what writes the frames of an identifier that is no message's, of which many have the same data."""
        if self._wanted is not None or cob_id in self._alone:
            return None

        @lru_cache(REMEMBERED)
        def row(data: bytes) -> Any:
            row, defects = self.known(Frame(cob_id, data))
            return None if defects else row

        return lambda data: [*map(row, data)]


class Decoding:
    """What is asked for: the `output`, the entries `wanted` (None: all), their times; `damage` counts what is wrong."""

    def __init__(
        self, decoder: Decoder, output: Output, wanted: Wanted | None = None, window: Window = EVERYTHING
    ) -> None:
        self.damage = DamageCounts()
        self.output, self.wanted, self._window = output, wanted, window
        self._decoder, self._first = decoder, InUse(decoder, output, wanted)

    def lines(self, file: BinaryIO, log: str, form: str | None = None, largest: int = LARGEST) -> Iterator[str]:
        """Yield the output for an open log named `log`, line by line or many at once; errors as `formats.batches`.

        What is wrong in the log is counted, whether it is wanted or not.
        """
        write, clock = self.output.writer(log), self._window.clock()
        decoded = DecodedLog(self, self._decoder, self._first)
        for batch in formats.batches(file, form, largest):
            rows = decoded.rows(batch)
            for place, defects in decoded.defects():
                self.damage.add(log, batch.lines[place], defects)
            yield write(batch, rows, clock)
        self.damage.notes += [f"{log}: {note}" for note in decoded.notes()]
        for _, last, transfer in decoded.unfinished():
            if self.wanted is None or self.wanted(last):
                self.output.cut(transfer)
        if footer := self.output.footer():
            yield footer


Groups: TypeAlias = Mapping["int | Raw", Sequence[int]]
"""The places of some entries by their heads."""


class DecodedLog:
    """Turns the batches of a log into rows.

    The frames of a message are decoded together; services and oddities one by one, in their order.
    """

    def __init__(self, asked: Decoding, decoder: Decoder, first: InUse) -> None:
        self._asked, self._first = asked, first
        self._now: dict[str, InUse] = {}
        self._following = Following(decoder)
        self.unfinished, self.notes = self._following.unfinished, self._following.notes
        self._defects: dict[int, tuple[Defect, ...]] = {}

    def _in_use(self, channel: str, decoder: Decoder) -> InUse:
        in_use = self._now.get(channel, self._first)
        if in_use.decoder is not decoder:
            in_use = self._now[channel] = InUse(decoder, self._asked.output, self._asked.wanted)
        return in_use

    def defects(self) -> list[tuple[int, tuple[Defect, ...]]]:
        """Return what was wrong in the last batch, by the places in it."""
        found = sorted(self._defects.items()) if self._defects else []
        self._defects.clear()
        return found

    def rows(self, batch: Batch) -> list[Any]:
        """Return the row of each entry, None for one without a line."""
        rows: list[Any] = [None] * len(batch.heads)
        for channel in batch.channels[:1] if batch.is_of_one_channel else dict.fromkeys(batch.channels):
            places: Sequence[int] = range(len(batch.heads))
            if not batch.is_of_one_channel:
                places = [place for place, each in enumerate(batch.channels) if each == channel]
            groups = batch.grouped(places)
            for span in self._following.spans(channel, partial(self._followed, batch, groups)):
                self._fill(batch, groups, span, self._in_use(channel, span.decoder), rows)
        return rows

    def _followed(
        self, batch: Batch, groups: Groups, decoder: Decoder, after: int
    ) -> Iterator[tuple[int, float, int, Raw]]:
        """Yield what a decoder follows; of heartbeats without a guarding master only what may change something."""
        is_guarded = self._following.is_guarded or any(isinstance(head, RemoteFrame) for head in groups)
        found, data = list[int](), batch.data
        for head, places in groups.items():
            if (head if isinstance(head, int) else head[0]) not in decoder.followed:
                continue
            some = places[bisect_right(places, after) :]
            if head in HEARTBEATS and not is_guarded:
                some = [place for place in some if data[place] not in RUNNING]
            found += some
        for place in sorted(found):
            yield place, batch.times[place], batch.lines[place], batch.raw(place)

    def _fill(self, batch: Batch, groups: Groups, span: DecoderSpan, in_use: InUse, rows: list[Any]) -> None:
        """Fill in the rows of a span."""
        data = batch.data
        for head, places in groups.items():
            end = len(places) if span.last is None else bisect_right(places, span.last)
            some = places[bisect_right(places, span.after) : end]
            if rows_of := in_use.at_once(head):
                made = rows_of([data[place] for place in some])
                for place, row in zip(some, made):
                    rows[place] = row
                some = [place for place, row in zip(some, made) if row is None] if None in made else ()
            for place in some:
                if place not in span.followed:
                    rows[place] = self._row(place, in_use.known(batch.raw(place)))
        for place, (_, said) in span.followed.items():
            rows[place] = self._row(place, self._said(said, in_use))

    def _row(self, place: int, known: Known) -> Any:
        """Return the row of an entry that is decoded by itself, and note what is wrong with it."""
        row, defects = known
        if defects:
            self._defects[place] = defects
        return row

    def _said(self, said: Meaning, in_use: InUse) -> Known:
        """Return the row and the defects of a followed frame: most say by themselves what they mean."""
        if said is in_use.decoder.remembered(said.raw):
            return in_use.known(said.raw)
        wanted = self._asked.wanted
        return self._asked.output.row(said) if wanted is None or wanted(said) else None, said.defects
