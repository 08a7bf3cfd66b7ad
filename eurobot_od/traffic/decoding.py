"""Turns logs of any format into lines of any output format, batch by batch.

A frame has the meaning that the decoder keeps, and what only the frames before it tell: which transfer an SDO frame
belongs to, that an answer to a guarding master is not a heartbeat, and how the devices on its channel are set by then.
There is one `TrackingDecoder` for each log or bus.
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
    compile_text_writer,
    with_defects,
    words_of,
    wrong,
)
from eurobot_od.traffic.services import FOLLOWED, GUARDING, LSS, NMT, SDO, WRITE, SdoEnd, guarding_words
from eurobot_od.traffic.transfers import ONE_WAY, LssConfiguration, Said, Transfers

NAME_WIDTH = 29
"""Width of the column of names; longer names push their fields to the right."""

WIDTH = 13
"""Width of the column of times."""

Clock: TypeAlias = Callable[[float], "float | None"]
"""Maps the time of an entry to the displayed time, in s; None drops the entry."""

Rows: TypeAlias = Callable[[Sequence[bytes]], Sequence[Any]]
"""Returns the rows of frames of one message from their data; None for a frame to decode separately."""

Write: TypeAlias = Callable[[Batch, Sequence[Any], Clock], str]
"""Returns the lines of a batch, with line ends; an entry without a row has no line."""

WriteLine: TypeAlias = Callable[[int, float, str, Any], str]
"""Returns a line, with its end, for an entry's line number, time in s, channel, and row."""


class Output:
    """An output format, with a `header` before the first line."""

    header = ""

    def row(self, meaning: Meaning) -> Any:
        """Return the part of a line that depends on the frame alone; None for no line."""
        raise NotImplementedError

    def rows_of(self, binding: Binding) -> Rows | None:
        """Return the function for the rows of a message's frames; None to decode them one by one."""
        return None

    def line_writer(self, log: str) -> WriteLine:
        """Return the function that formats a line of the log `log`."""
        raise NotImplementedError

    def writer(self, log: str) -> Write:
        """Return the function that formats the lines of the log `log`."""
        line = self.line_writer(log)

        def write(batch: Batch, rows: Sequence[Any], clock: Clock) -> str:
            shown = map(clock, batch.times)
            entries = zip(batch.lines, shown, batch.channels, rows)
            return "".join([line(*each) for each in entries if each[1] is not None and each[3] is not None])  # type: ignore[arg-type]

        return write

    def cut(self, transfer: SdoTransfer) -> None:
        """Process an SDO transfer that is cut off by the end of a log."""

    def footer(self) -> str:
        """Return the text after the lines of a log."""
        return ""


class TextOutput(Output):
    """Aligned columns for a person: time in s, channel, message, fields with units; `!` before what is wrong.

    With `several` logs each line starts with the name of its log, as grep does it.
    """

    def __init__(self, several: bool = False) -> None:
        self._several = several

    def row(self, meaning: Meaning) -> str:
        name = meaning.name or ("?" if meaning.defects else "")
        text = with_defects(meaning)
        return one_line(f"{name.ljust(NAME_WIDTH)} {text}" if text else name)

    def rows_of(self, binding: Binding) -> Rows:
        head = f"{binding.name.ljust(NAME_WIDTH)} "
        length = binding.layout.length
        writer = cache(partial(compile_text_writer, binding))  # compiled on first use, as a device may be remapped
        alone = [one_line(binding.name)]
        head = one_line(head)

        def rows(data: Sequence[bytes]) -> Sequence[str | None]:
            if set(map(len, data)) != {length}:
                return [rows([each])[0] if len(each) == length else None for each in data]
            if not binding.limits:
                return alone * len(data)
            written = writer()(head, words_of(binding, data))
            if OUTSIDE not in "".join(written):
                return written
            return [None if OUTSIDE in each else each for each in written]

        return rows

    def line_writer(self, log: str) -> WriteLine:
        start = one_line(f"{log}:") if self._several else ""
        shown = lru_cache(one_line)
        return lambda _, time, channel, row: f"{start}{time:{WIDTH}.6f}  {shown(channel)}  {row}\n"

    def writer(self, log: str) -> Write:
        write = super().writer(log)
        start = one_line(f"{log}:") if self._several else ""

        def per_batch(batch: Batch, rows: Sequence[str | None], clock: Clock) -> str:
            if clock is not float or batch.stamps is None or not batch.is_of_one_channel or None in rows:
                return write(batch, rows, clock)
            gap = f"  {one_line(batch.channels[0])}  "
            (width, *others) = set(map(len, batch.stamps))
            head = start
            stamps = [f"{stamp:>{WIDTH}}" for stamp in batch.stamps] if others else batch.stamps
            head += " " * (0 if others else WIDTH - width)
            return "".join([f"{head}{stamp}{gap}{row}\n" for stamp, row in zip(stamps, rows)])

        return per_batch


# Data: a field is a number, None (unknown), or text

DIGITS = {"index": 4, "code": 4, "register": 2, "abort": 8}
"""Hexadecimal fields of services, and their numbers of digits."""

SERVICE_FIELDS = (
    *("node", "direction", "index", "subindex", "value", "content", "size", "how", "seconds", "abort", "abort_name"),
    *("code", "register", "words", "info", "state", "command"),
)
"""Fields of all services."""


def _fields(meaning: Meaning) -> dict[str, Any]:
    """Return the fields of a frame as numbers and texts."""
    if meaning.message is not None:
        return plain(meaning.message, meaning.kinds)
    if meaning.group != CANOPEN:
        return meaning.fields
    return {name: _plain(name, value) for name, value in meaning.fields.items()}


def _plain(name: str, value: Any) -> Any:
    """Return a field of a service as a number or text."""
    if name in DIGITS:
        return f"0x{value:0{DIGITS[name]}X}"
    if isinstance(value, bytes):
        return value.hex().upper()
    if isinstance(value, float) and isfinite(value):  # JSON has no other numbers
        return round(value, 6) if name == "seconds" else value
    return value if isinstance(value, (int, str)) else str(value)


def _units(meaning: Meaning) -> dict[str, str]:
    """Return the units of a frame's fields that have one."""
    if meaning.message is not None:
        return dict(units(type(meaning.message)))
    if isinstance(meaning.service, ForeignMessage):
        return {name: unit for name, unit in meaning.service.units.items() if unit}
    return {}


class JsonOutput(Output):
    """One JSON object per line, with fields as numbers, null (unknown) or text, and their units."""

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
        start = f'{{"log": {_json(log)}, "line":'
        quoted = lru_cache(_json)
        return lambda number, time, channel, row: (
            f'{start} {number}, "time": {time:.6f}, {_dated(time)}"channel": {quoted(channel)}, {row}\n'
        )


OF_DATES = 1e8
"""Times from here on, in s, count from 1970, as no log lasts three years."""


def _date(time: float) -> str:
    """Return the date of a time in ISO 8601, empty for a log without dates."""
    return datetime.fromtimestamp(time, UTC).isoformat(timespec="microseconds") if time >= OF_DATES else ""


def _dated(time: float) -> str:
    return f'"datetime": "{_date(time)}", ' if time >= OF_DATES else ""


def _identification(meaning: Meaning) -> dict[str, Any]:
    """Return the known ones of identifier, data, name, group and nodes."""
    raw = meaning.raw
    cob_id, data = (raw.frame or (None, b"")) if isinstance(raw, Foreign) else raw
    is_remote = isinstance(raw, RemoteFrame)
    is_fd = isinstance(raw, Foreign) and cob_id is not None
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
    """Write data as JSON, with escapes only if it has characters that a terminal might act on."""
    text = json.dumps(data, ensure_ascii=False)
    return text if text.isprintable() else json.dumps(data)


UNITS = "units"
"""Last column of CSV."""

FRAME = ("id", "data", "fd", "brs", "message", "protocol")
"""Columns of CSV that describe the frame; a remote frame is named in the text."""


class CsvOutput(Output):
    """Comma-separated values with a column for each field of any message or service; unknown is empty.

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
        start = _joined([log])
        quoted = lru_cache(lambda channel: _joined([channel]))
        return lambda number, time, channel, row: f"{start},{number},{time:.6f},{_date(time)},{quoted(channel)},{row}\n"


def _joined(values: Sequence[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(map(cell, values))
    return text.getvalue()


HEARTBEATS = range(ERROR_CONTROL_BASE + NODE_IDS[0], ERROR_CONTROL_BASE + NODE_IDS[-1] + 1)
"""COB-IDs of heartbeats (CiA 301, 7.3.3)."""

RUNNING = frozenset(bytes([state]) for state in NmtState if state is not NmtState.INITIALISING)
"""Data of heartbeats other than boot-ups."""

SHOWN = range(FIRST, MANUFACTURER[0])
"""Indices whose objects can change how later frames decode."""

SHOWING = frozenset((*SHOWN, *AREA))
"""`SHOWN`, and the objects that reveal the profile of a device without a file."""


def is_followed(meaning: Meaning) -> bool:
    """Return whether the meaning of a frame depends on earlier frames."""
    return meaning.group == CANOPEN and meaning.name in FOLLOWED and not meaning.defects


def _writes_setting(end: SdoEnd, data: bytes) -> bool:
    """Return whether a frame writes, or confirms the write of, an object that changes decoding."""
    if data[2] >> 4 != SHOWN.start >> 12:  # rejects nearly all others by one byte
        return False
    command = end.command(data)
    is_write = command is not None and command.names_object and command.direction == WRITE
    return is_write and in_force.is_followed(Initiate.of(data).address)


Candidates: TypeAlias = Callable[[Decoder, int], Iterable["tuple[int, float, int, Raw]"]]
"""Yields place, time in s, line and frame of the entries after a place that need earlier frames."""


class DecoderSpan(NamedTuple):
    """Consecutive entries of a channel with one `decoder`, after place `after` up to `last` (None: the end).

    `followed` has time and meaning of those that are understood by the ones before them, by their places.
    """

    decoder: Decoder
    after: int
    last: int | None
    followed: Mapping[int, tuple[float, Meaning]]


class TrackingDecoder:
    """Decodes the entries of a log or bus in order, following configuration changes.

    A frame may show a new setting of its sender; its channel then gets another `decoder`. `is_guarded` is whether a
    master has requested a node's state.
    """

    def __init__(self, decoder: Decoder) -> None:
        self._first = decoder
        self._decoders = dict[str, Decoder]()
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
        """Return the present decoder of a channel."""
        return self._decoders.get(channel, self._first)

    def at(self, time: float, channel: str, raw: Raw) -> Callable[[Raw], Meaning]:
        """Process an entry, and return its decoder, for an entry that may never be decoded."""
        decoder = self.decoder(channel)
        if raw[0] in decoder.followed:
            self(time, channel, raw)
        return decoder.remembered

    def __call__(self, time: float, channel: str, raw: Raw, line: int = 0) -> Meaning:
        """Return the meaning of an entry; time is in s, channel and line are those of the log."""
        meaning = self._decoders.get(channel, self._first).remembered(raw)
        return self._follow(time, channel, meaning, line) if is_followed(meaning) else meaning

    def spans(self, channel: str, candidates: Candidates) -> Iterator[DecoderSpan]:
        """Yield the spans of a channel's entries between changes of the decoder."""
        after = -1
        while True:
            decoder = self.decoder(channel)
            followed = dict[int, tuple[float, Meaning]]()
            last = None
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
        """Return the values that a device is known to have now."""
        return self._shown[channel].shown(node_id) if channel in self._shown else {}

    def _in_force(self, channel: str) -> InForce:
        if channel not in self._shown:
            self._shown[channel] = InForce(self._first.dictionaries, self._first.learned, self._first.describe)
        return self._shown[channel]

    def _follow(self, time: float, channel: str, meaning: Meaning, line: int) -> Meaning:
        """Return the meaning of a frame after earlier ones; the time is in s."""
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
        """Return the meaning of a frame in its SDO transfer, and process what it shows."""
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
            ended = said.ended
            if ended and ended.end and ended.address and not ended.is_upload and ended.address[0] in SHOWN:
                # Whether the device accepted an abandoned write is unknown.
                self._news(channel, self._in_force(channel).forget(ended.end.server, ended.address))
            if is_setting:
                self._news(channel, self._in_force(channel).ask(end.server, Initiate.of(meaning.raw.data).address))
        if not any(said):
            return meaning
        text = f"{meaning.nodes[0]}, {said.text}" if said.text else meaning.text
        defects = (Defect(Damage.INCOMPLETE, f"{meaning.raw}: {said.lost}"),) if said.lost else ()
        # The bytes of a block segment are no command.
        if said.text and not said.ended:
            meaning = meaning._replace(service=None)
        return meaning._replace(text=f"{text}{said.more}", defects=defects, transfer=said.ended)

    def _confirm(self, channel: str, server: int, said: Said, place: int | float) -> None:
        """Process what an answer shows; a write (at a line or a time in s) counts once it is confirmed."""
        unseen = set[Address]()
        ended = said.ended
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
        """Yield the transfers cut off by the end of the log, with channel and the last frame's meaning."""
        for key, transfer in self._transfers.unfinished():
            yield key[0], self._last[key], transfer

    def notes(self) -> Iterator[str]:
        """Yield notes on what cannot be known, as the log has only one direction of SDO."""
        ways = (self._ways[each] for each in self._settings)
        yield from dict.fromkeys(ONE_WAY[way] for each in ways if len(each) == 1 for way in each)

    def _news(self, channel: str, is_news: bool) -> None:
        if is_news:
            self._decoders[channel] = self.decoder(channel).as_shown(self._shown[channel])

    def _booted(self, channel: str, frame: Frame, meaning: Meaning) -> Meaning:
        """Add the transfers that a boot-up cuts off to its meaning."""
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
        """Return the description of a device that boots with a node-ID set by LSS, else None."""
        taken = self._lss[channel].taken
        heard = self._heard[channel] - {node_id}
        self._heard[channel].add(node_id)
        if node_id not in taken:
            return None
        identity, shown = taken.pop(node_id), self._in_force(channel)
        return shown.renumber_only(heard, node_id) if identity is None else shown.renumber(identity, node_id)

    def _guarded(self, channel: str, frame: Frame, meaning: Meaning) -> Meaning:
        """Recognise answers to node guarding, which only the toggle bit tells from heartbeats."""
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
"""Row and defects of a frame."""


class ChannelDecoding:
    """Current decoders of a channel: `per_frame`, and `per_batch` for frames of one identifier."""

    def __init__(self, decoder: Decoder, output: Output, wanted: Wanted | None) -> None:
        # Cached, as most frames on a bus are repeated requests and confirmations.
        @lru_cache(REMEMBERED)
        def known(raw: Raw) -> Known:
            meaning = decoder.remembered(raw)
            row = output.row(meaning) if wanted is None or wanted(meaning) else None
            return row, meaning.defects

        self.per_frame = known
        self.decoder = decoder
        self._wanted = wanted
        bindings = decoder.protocol.bindings if wanted is None else ()
        self._bindings = {each.cob_id: each for each in bindings if each.is_whole}
        self._rows_of = output.rows_of
        self._made = dict[int, Rows | None]()
        # Heartbeats are nearly all alike; those that depend on earlier frames are decoded again.
        self._alone = decoder.followed.difference(HEARTBEATS)

    def per_batch(self, head: int | Raw) -> Rows | None:
        """Return the function for the rows of an identifier; None to decode its frames one by one."""
        if not isinstance(head, int):
            return None
        if head not in self._made:
            binding = self._bindings.get(head)
            self._made[head] = self._rows_of(binding) if binding else self._by_data(head)
        return self._made[head]

    def _by_data(self, cob_id: int) -> Rows | None:
        """Return the function for the rows of an identifier without a message, cached by data."""
        if self._wanted is not None or cob_id in self._alone:
            return None

        @lru_cache(REMEMBERED)
        def row(data: bytes) -> Any:
            row, defects = self.per_frame(Frame(cob_id, data))
            return None if defects else row

        return lambda data: [*map(row, data)]


class Decoding:
    """A request for output: the format, the entries `wanted` (None: all), their times; `damage` counts defects."""

    def __init__(
        self, decoder: Decoder, output: Output, wanted: Wanted | None = None, window: Window = EVERYTHING
    ) -> None:
        self.damage = DamageCounts()
        self.silent = list[str]()
        """The logs without any entry."""
        self.output, self.wanted, self._window = output, wanted, window
        self._decoder = decoder
        self._first = ChannelDecoding(decoder, output, wanted)

    def lines(self, file: BinaryIO, log: str, form: str | None = None, largest: int = LARGEST) -> Iterator[str]:
        """Yield the output of the open log `log`, in one or more lines at once; errors as `formats.batches`.

        What is wrong in the log is counted, whether it is wanted or not.
        """
        write = self.output.writer(log)
        clock = self._window.clock()
        decoded = DecodedLog(self, self._decoder, self._first)
        batch = None
        for batch in formats.batches(file, form, largest):
            rows = decoded.rows(batch)
            for place, defects in decoded.defects():
                self.damage.add(log, batch.lines[place], defects)
            yield write(batch, rows, clock)
        if batch is None:
            self.silent.append(log)
        self.damage.notes += [f"{log}: {note}" for note in decoded.notes()]
        for _, last, transfer in decoded.unfinished():
            if self.wanted is None or self.wanted(last):
                self.output.cut(transfer)
        if footer := self.output.footer():
            yield footer


Groups: TypeAlias = Mapping["int | Raw", Sequence[int]]
"""Places of entries by their heads."""


class DecodedLog:
    """Turns the batches of a log into rows.

    The frames of a message are decoded together; services and oddities one by one, in their order.
    """

    def __init__(self, asked: Decoding, decoder: Decoder, first: ChannelDecoding) -> None:
        self._asked, self._first = asked, first
        self._now: dict[str, ChannelDecoding] = {}
        self._following = TrackingDecoder(decoder)
        self.unfinished, self.notes = self._following.unfinished, self._following.notes
        self._defects: dict[int, tuple[Defect, ...]] = {}

    def _in_use(self, channel: str, decoder: Decoder) -> ChannelDecoding:
        in_use = self._now.get(channel, self._first)
        if in_use.decoder is not decoder:
            in_use = self._now[channel] = ChannelDecoding(decoder, self._asked.output, self._asked.wanted)
        return in_use

    def defects(self) -> list[tuple[int, tuple[Defect, ...]]]:
        """Return the defects in the last batch by place, and forget them."""
        found = sorted(self._defects.items()) if self._defects else []
        self._defects.clear()
        return found

    def rows(self, batch: Batch) -> list[Any]:
        """Return the row of each entry, None for one without a line."""
        rows: list[Any] = [None] * len(batch.heads)
        channels = batch.channels[:1] if batch.is_of_one_channel else list(dict.fromkeys(batch.channels))
        for channel in channels:
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
        """Yield entries that depend on earlier ones; without a guarding master, few heartbeats do."""
        is_guarded = self._following.is_guarded or any(isinstance(head, RemoteFrame) for head in groups)
        found = list[int]()
        data = batch.data
        for head, places in groups.items():
            if (head if isinstance(head, int) else head[0]) not in decoder.followed:
                continue
            some = places[bisect_right(places, after) :]
            if head in HEARTBEATS and not is_guarded:
                some = [place for place in some if data[place] not in RUNNING]
            found += some
        for place in sorted(found):
            yield place, batch.times[place], batch.lines[place], batch.raw(place)

    def _fill(self, batch: Batch, groups: Groups, span: DecoderSpan, in_use: ChannelDecoding, rows: list[Any]) -> None:
        """Fill in the rows of a span."""
        data = batch.data
        for head, places in groups.items():
            end = len(places) if span.last is None else bisect_right(places, span.last)
            some = places[bisect_right(places, span.after) : end]
            if rows_of := in_use.per_batch(head):
                made = rows_of([data[place] for place in some])
                for place, row in zip(some, made):
                    rows[place] = row
                some = [place for place, row in zip(some, made) if row is None] if None in made else ()
            for place in some:
                if place not in span.followed:
                    rows[place] = self._row(place, in_use.per_frame(batch.raw(place)))
        for place, (_, said) in span.followed.items():
            rows[place] = self._row(place, self._said(said, in_use))

    def _row(self, place: int, known: Known) -> Any:
        """Return the row of an entry decoded separately, and note its defects."""
        row, defects = known
        if defects:
            self._defects[place] = defects
        return row

    def _said(self, said: Meaning, in_use: ChannelDecoding) -> Known:
        """Return the row and defects of a frame that depends on earlier ones."""
        if said is in_use.decoder.remembered(said.raw):
            return in_use.per_frame(said.raw)
        wanted = self._asked.wanted
        return self._asked.output.row(said) if wanted is None or wanted(said) else None, said.defects
