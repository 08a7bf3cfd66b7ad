"""Monitors a bus, message by message: counts, periods, values and defects.

`Traffic` counts: frames go in with their times. A frame costs the same however many came before, and memory does not
grow with them. Then come the table and its keys, where the frames are from (`BusSource`, `LogSource`), and at the end
the screen of a terminal, which alone needs rich.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from math import fsum, inf, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.bus import frame_bits
from eurobot_od.bus.live import FrameReader, Opener
from eurobot_od.client.watch import Heartbeats
from eurobot_od.device.nmt import STATE_NAMES, NmtState
from eurobot_od.errors import BusError
from eurobot_od.frame import EXTENDED, Frame, identifier_text
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import absence
from eurobot_od.od.standard import HEARTBEAT_TIME
from eurobot_od.od.values import ERROR_CONTROL_BASE
from eurobot_od.support.texts import GAP, amount, columns, one_line
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.entries import Damage, Foreign, LogEntry, Raw, Timed, shortened
from eurobot_od.traffic.formats.python_can import of_message
from eurobot_od.traffic.load import MessageSet
from eurobot_od.traffic.meaning import CANOPEN, REQUEST, DamageCounts, Decoder, Meaning, with_defects
from eurobot_od.traffic.services import EMCY_NAME, GUARDING, HEARTBEAT
from eurobot_od.traffic.statistics import NOTHING, SeenTraffic

if TYPE_CHECKING:
    import can
    from rich.console import JustifyMethod, RenderableType
    from rich.table import Table
    from rich.text import Text


REMEMBERED_TIMES = 33
"""Number of times kept, for period and jitter of the last 32 intervals."""

TWO = 2
LOAD_SPAN = 1.0
"""Time over which the bus load is computed, in s."""


class MeanPeriod(NamedTuple):
    """Mean interval between frames of a message, and the intervals' standard deviation, both in s."""

    mean: float
    jitter: float


@dataclass
class MonitorRow:
    """A message, service or kind of damage: `meaning` is the last frame's, `wrong` counts defective frames.

    It has a `channel` where there are several.
    """

    identifier: int | None
    meaning: Meaning
    channel: str = ""
    count: int = 0
    wrong: int = 0
    times: deque[float] = field(default_factory=lambda: deque(maxlen=REMEMBERED_TIMES))

    @property
    def last(self) -> float:
        """Time of the last frame."""
        return self.times[-1]

    @property
    def period(self) -> MeanPeriod | None:
        """Period, None before the first interval."""
        intervals = [later - earlier for earlier, later in pairwise(self.times)]
        if not intervals:
            return None
        mean = fsum(intervals) / len(intervals)
        # `statistics.pstdev` uses fractions, which is too slow for a table.
        return MeanPeriod(mean, sqrt(fsum((each - mean) ** 2 for each in intervals) / len(intervals)))

    @property
    def name(self) -> str:
        """Name of the message, or of the service with its node, or the damage."""
        meaning = self.meaning
        if meaning.message is None and meaning.name and len(meaning.nodes) == 1:
            return f"{meaning.name} {meaning.nodes[0]}"
        return meaning.name or meaning.defects[0].damage.value


@dataclass
class NodeHealth:
    """A node's last reported state and EMCY; `pulse` tells whether the node is lost."""

    pulse: Heartbeats = field(default_factory=Heartbeats)
    state: str = ""
    emergency: str = ""


class NodesHealth:
    """Health of the nodes of a network by name: those with files, and any other that is heard."""

    def __init__(self, dictionaries: Iterable[Dictionary]) -> None:
        self.nodes: dict[str, NodeHealth] = {}
        self.learn(dictionaries)

    def learn(self, dictionaries: Iterable[Dictionary]) -> None:
        """Update which nodes have files; a node heard before keeps its state under its new name."""
        for each in dictionaries:
            if each.name not in self.nodes:
                period = (each.number(HEARTBEAT_TIME) or 0) / 1000
                heard = self.nodes.pop(f"node {each.node_id}", None)
                self.nodes[each.name] = heard or NodeHealth(Heartbeats(period))

    def take(self, time: float, meaning: Meaning) -> None:
        """Process the meaning of a frame."""
        if meaning.name in (HEARTBEAT, GUARDING, EMCY_NAME) and meaning.is_read:
            self._note(time, meaning)
        if (ended := meaning.transfer) and ended.address == HEARTBEAT_TIME and ended.content and ended.aborted is None:
            self._note_period(time, meaning.nodes[0], int.from_bytes(ended.content, "little") / 1000)

    def _note_period(self, time: float, node: str, period: float) -> None:
        """Set the heartbeat time of a node, in s."""
        health = self.nodes.setdefault(node, NodeHealth())
        is_known = health.pulse.heard is not None
        health.pulse = Heartbeats(period)
        if is_known:
            health.pulse.boot(time)

    def _note(self, time: float, meaning: Meaning) -> None:
        health = self.nodes.setdefault(meaning.nodes[0], NodeHealth())  # also one that no file describes
        text = meaning.text.partition(", ")[2]  # the words of a service begin with the node's name
        if meaning.name == EMCY_NAME:  # 0x0000 is "error reset or no error" (CiA 301, Table 26)
            health.emergency = "" if text.startswith("0x0000") else text
        elif text != REQUEST:
            health.state = text.partition(",")[0]  # before the toggle bit of an answer to a guarding master
            (health.pulse.boot if health.state == STATE_NAMES[NmtState.INITIALISING] else health.pulse.beat)(time)


UNHEARD_AFTER = 5.0
"""Time in s after which a node that has a file and was not heard counts as absent."""


class Presence:
    """Compares the nodes that are heard with those that have files, without asking any."""

    def __init__(self, dictionaries: Iterable[Dictionary]) -> None:
        self._files = {each.name: each.node_id for each in dictionaries}
        self._heard = set[int]()
        self._first: float | None = None
        self._last = 0.0

    def take(self, time: float, meaning: Meaning) -> None:
        """Process the meaning of a frame; a node without a file is heard by its heartbeat only."""
        self._last = time
        if self._first is None:
            self._first = time
        if meaning.name == HEARTBEAT and isinstance(meaning.raw, Frame):
            self._heard.add(meaning.raw.cob_id - ERROR_CONTROL_BASE)
        elif (node_id := self._files.get(meaning.sender)) is not None:
            self._heard.add(node_id)

    @property
    def note(self) -> str:
        """Which nodes with files are absent while others are there; empty if none is."""
        is_early = self._first is None or self._last - self._first < UNHEARD_AFTER
        return "" if is_early else absence(self._files.values(), self._heard)


MOST_EXTENDED = 4096
"""Maximum number of distinct 29-bit identifiers; a J1939 bus has some hundred, a hostile one half a billion."""


class Traffic:
    """The traffic on one or more buses of `bitrate` bit/s, with `rows` by identifier or damage.

    Those of a second bus are by its channel, too. `groups` are those of the messages that may come; `buses` are, by
    channel, what came beside what is `promised`. `following` decodes the frames.
    """

    def __init__(self, decoder: Decoder, bitrate: int, promised: MessageSet = NOTHING) -> None:
        self.bitrate, self._promised = bitrate, promised
        self.buses: dict[str, SeenTraffic] = {}
        self.groups = decoder.protocol.catalogue.groups
        self.rows: dict[int | str | Damage | tuple[str, int | str | Damage], MonitorRow] = {}
        self.health = NodesHealth(decoder.dictionaries)
        self.nodes = self.health.nodes
        self.presence = Presence(decoder.dictionaries)
        self.damage = DamageCounts()
        self.frames = 0
        self.now = 0.0
        self._bits = 0
        self._extended = set[tuple[str, int]]()
        self._marks: deque[tuple[float, int, int]] = deque()
        self.following = TrackingDecoder(decoder)
        self._decoder = decoder

    @property
    def seen(self) -> SeenTraffic:
        """Traffic of the first bus."""
        return next(iter(self.buses.values())) if self.buses else self._bus("")

    def _bus(self, channel: str) -> SeenTraffic:
        """Return the traffic of a bus; with a second bus, rows get their channel."""
        found = self.buses.get(channel)
        if found is None:
            found = self.buses[channel] = SeenTraffic(self.bitrate, self._promised)
            if len(self.buses) == TWO:
                for row in self.rows.values():
                    row.channel = next(iter(self.buses))
        return found

    def take(self, time: float, raw: Raw, place: tuple[str, int] | None = None, channel: str = "") -> Meaning:
        """Process a frame of a channel, with its log and line, and return its meaning."""
        counted = self._counted(raw, channel)
        meaning = self.following(time, channel, counted)
        if (decoder := self.following.decoder(channel)) is not self._decoder:
            self._decoder = decoder
            self.health.learn(decoder.dictionaries)
        self.presence.take(time, meaning)
        self.now = time
        self.frames += 1
        bus = self._bus(channel)
        # The key is COB-ID or Damage, or the name of a CAN FD message in a DBC file.
        first = meaning.name if isinstance(counted, Foreign) and meaning.group else counted[0]
        key = first if bus is self.seen else (channel, first)
        row = self.rows.get(key)
        if row is None:
            identifier = counted.cob_id if isinstance(counted, Frame) else None
            row = self.rows[key] = MonitorRow(identifier, meaning, channel if len(self.buses) >= TWO else "")
        row.meaning = meaning
        row.count += 1
        row.times.append(time)
        if isinstance(counted, Frame):
            self._bits += bus.take(time, counted, row.name, meaning.sender)
        elif isinstance(raw, Frame):
            self._bits += frame_bits(raw)
        if meaning.defects:
            row.wrong += 1
            self.damage.add(*(place or ("frame", self.frames)), meaning.defects)
        self.health.take(time, meaning)
        return meaning

    def _counted(self, raw: Raw, channel: str) -> Raw:
        """Return an entry, or a placeholder for all frames beyond the maximum of 29-bit identifiers."""
        if not isinstance(raw, Frame) or not raw.cob_id & EXTENDED:
            return raw
        key = channel, raw.cob_id
        if key not in self._extended and len(self._extended) >= MOST_EXTENDED:
            return Foreign(Damage.OTHERS, str(raw))
        self._extended.add(key)
        return raw

    def clear(self) -> None:
        """Forget what was counted."""
        # Keeps the totals, as the load is a difference of them.
        self.rows.clear()
        self.buses.clear()
        self._extended.clear()
        self.damage = DamageCounts()

    def load(self, now: float) -> tuple[float, float]:
        """Return the bus load (share of 1, with stuff bits, mean of the buses) and frames per second.

        Both are since the last second's mark.

        Called at every refresh; between two calls the traffic is assumed to be even.
        """
        self._marks.append((now, self._bits, self.frames))
        # Keeps a mark that is a second old, so that the load covers a whole second.
        while len(self._marks) > 2 and now - self._marks[1][0] >= LOAD_SPAN:
            self._marks.popleft()
        since, bits, frames = self._marks[0]
        span = now - since
        if span <= 0:
            return 0.0, 0.0
        return (self._bits - bits) / span / self.bitrate / max(len(self.buses), 1), (self.frames - frames) / span


# What is shown


SORTS: Mapping[str, Callable[[MonitorRow], Any]] = {
    "identifier": lambda row: (row.identifier is None, row.identifier or 0),
    "name": lambda row: row.name.casefold(),
    "count": lambda row: -row.count,
    "period": lambda row: row.period.mean if row.period else inf,
    "age": lambda row: -row.last,
    "wrong": lambda row: -row.wrong,
}
"""Orders of the table."""


def selected(rows: Iterable[MonitorRow], sort: str, part: str) -> list[MonitorRow]:
    """Return the rows that `part` names, in an order of SORTS."""
    return sorted((row for row in rows if named(row.meaning, part)), key=SORTS[sort])


def named(meaning: Meaning, part: str) -> bool:
    """Return whether `part` occurs in the name, protocol or nodes of a message, or is its identifier."""
    frame = meaning.raw.frame if isinstance(meaning.raw, Foreign) else meaning.raw
    if frame and part.upper().removeprefix("0X") == f"{frame[0]:03X}":
        return True
    return part.casefold() in " ".join((meaning.name, meaning.group, *meaning.nodes)).casefold()


# Cells of the table as text, the same for every terminal


HEADINGS = ("ID", "Message", "Count", "Period ms", "Age s", "Last values")
ALIGN = "llrrrl"

DROPPED = ("Age s", "Count", "Period ms")
"""Columns that a narrow terminal drops, least important first."""

ROOM = 24
"""Minimum width of the last values, in characters; columns are dropped for it."""


def fitting(lines: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return the numbers of the columns that fit into `width` characters; `lines` are the cells of all columns."""
    widths = [max(map(len, column)) for column in zip(HEADINGS, *lines)]
    shown = list(range(len(HEADINGS)))
    for dropped in map(HEADINGS.index, DROPPED):
        # The last values get the remaining width, so their own does not count.
        if sum(widths[each] + len(GAP) for each in shown[:-1]) + ROOM <= width:
            break
        shown.remove(dropped)
    return shown


def cells(row: MonitorRow, now: float) -> tuple[str, ...]:
    """Return the cells of a row, one for each heading."""
    identifier = "" if row.identifier is None else identifier_text(row.identifier)
    period = row.period
    every = f"{period.mean * 1000:.1f} ± {period.jitter * 1000:.1f}" if period else ""
    age = f"{max(now - row.last, 0.0):.1f}"  # the clocks of driver and computer differ
    place = f"{row.channel} {identifier}".strip()
    name = row.name
    values = with_defects(row.meaning)
    return one_line(place), one_line(name), str(row.count), every, age, one_line(values)


def health(name: str, node: NodeHealth, now: float) -> str:
    """Return the state of a node as text."""
    state = node.state
    if node.pulse.heard is None:
        state = "not heard"
    elif node.pulse.lost(now):
        state = "LOST"
    return one_line(f"{name} {state} ({node.emergency})" if node.emergency else f"{name} {state}")


def plain_table(rows: list[MonitorRow], now: float) -> Iterator[str]:
    """Yield the table without colours, one line per row."""
    return columns([HEADINGS, *(cells(row, now) for row in rows)], ALIGN)


# What the keys do


ENTER, ESCAPE, BACKSPACES = "\r\n", "\x1b", "\x08\x7f"  # a terminal sends one or the other
HELP = "q quit  p pause  s sort  / filter  j k scroll  c clear counts"


@dataclass
class Controls:
    """Settings of the table: `part` filters names, `typing` is whether it is being typed.

    `top` is how many rows are scrolled away.
    """

    sort: str = "identifier"
    part: str = ""
    typing: bool = False
    paused: bool = False
    clear: bool = False
    running: bool = True
    top: int = 0

    def within(self, most: int) -> int:
        """Return the number of rows scrolled away, at most `most`, so that the last row stays in view."""
        # Stored, so that presses of `j` beyond the end need no presses of `k` to undo.
        self.top = min(self.top, max(most, 0))
        return self.top

    def key(self, key: str) -> None:
        """Process a key; unknown keys do nothing."""
        if not self.typing:
            if key in KEYS:
                for name, value in KEYS[key](self).items():
                    setattr(self, name, value)
        elif key in ENTER:
            self.typing = False
        elif key == ESCAPE:
            self.typing, self.part = False, ""
        elif key in BACKSPACES:
            self.part = self.part[:-1]
        elif key.isprintable():
            self.part += key


ORDERS = list(SORTS)

KEYS: Mapping[str, Callable[[Controls], Mapping[str, object]]] = {
    **dict.fromkeys("p ", lambda controls: {"paused": not controls.paused}),
    "s": lambda controls: {"sort": ORDERS[(ORDERS.index(controls.sort) + 1) % len(ORDERS)]},
    "/": lambda _: {"typing": True, "part": ""},
    **dict.fromkeys("j\x0e", lambda controls: {"top": controls.top + 1}),
    **dict.fromkeys("k\x10", lambda controls: {"top": max(controls.top - 1, 0)}),
    "c": lambda _: {"clear": True},
    "q": lambda _: {"running": False},
}
"""Settings that keys change while no filter is being typed."""


Place: TypeAlias = tuple[str, int]
"""A log and a line."""

AT_ONCE = 20_000
"""Maximum number of log entries played between two refreshes of the screen."""


GRACE = 0.02
"""Time that our own frame waits for earlier received ones, in s, as a busy machine reads late."""

RESOLUTION = 0.002
"""Maximum error of a driver's time, in s; a frame precedes ours only if it is earlier by more."""

FRAMES_LOST = "{} frames have been lost so far because the driver's queue was full"
"""Note on lost frames, with their number."""

CLOCK_SET = "the clock was set by {:.1f} s; times go on as before"
"""Note on a set clock, with the change; no frame is lost."""

NOTED_AGAIN = 5.0
"""Minimum time before the note is repeated, in s, unless twice as many were lost."""

APART = 0.1
"""Maximum difference of two clocks, in s; a clock that is set goes back by more."""


@dataclass
class FrameUnderWay:
    """Our own frame among the received ones; `taken` is whether the driver accepted it, None until known.

    It was entered at the time `entered` of our clock.
    """

    frame: Frame
    entered: float
    taken: bool | None = None


SET = 1.0
"""What the driver's clock goes back, or ahead of ours, at least, when it was set, in s; a frame read late does not."""


class BusSource:
    """Frames of a bus with the driver's times, which are more exact than ours; a thread reads them.

    What is sent by `send` is given among them, in the order of the bus: before what answers it.

    A bus that is lost is opened again by `opener`, if there is one; meanwhile `trouble` says why. `notes` say when it
    was lost, for how long, and how many frames were lost because the driver's queue was full.
    """

    ended = False
    place: Place | None = None
    channel = ""

    def __init__(
        self, bus: can.BusABC, clock: Callable[[], float] = time.monotonic, opener: Opener | None = None
    ) -> None:
        self.notes: list[str] = []
        self.trouble = ""
        self._clock, self._opener = clock, opener
        self._came: deque[tuple[float, Raw | FrameUnderWay]] = deque()
        self._failures: list[BusError] = []
        self._heard = (0.0, clock())
        """Time of the last frame by the driver's clock and by ours; one tuple, as several threads read it."""
        self._offset, self._restarted, self._is_stamped = 0.0, False, False
        self._ahead = -inf
        """By how much the driver's clock is ahead of ours, by the frame that was read soonest."""
        self._overflow = 0
        self._noted = -inf
        self._given = 0.0
        self._leaving = ExitStack()

        def back(gap: float) -> None:
            self.trouble, self._restarted = "", True
            self.notes.append(f"the bus is back after a gap of {gap:.1f} s")

        watch = FrameReader(bus, self._enter, None, self._fail, self._take_foreign, opener=opener, back=back)
        self._watch = self._leaving.enter_context(watch)

    def _fail(self, why: BusError) -> None:
        self.trouble = str(why)
        if self._opener is None:  # raised by `poll`, not on this thread
            self._failures.append(why)
        else:
            self.notes.append(f"{why}; it is opened again")

    def _note_overflow(self) -> None:
        self._overflow, self._noted = self._watch.overflow(), self._clock()
        self.notes.append(FRAMES_LOST.format(self._overflow))

    def _take_foreign(self, message: can.Message | None) -> None:
        if message is None:
            self._came.append((self.now, Foreign(Damage.UNREADABLE, "the driver cannot read it")))
            return
        try:
            raw = of_message(message)
        except ValueError:  # a network peer can send what no adapter could receive
            raw = Foreign(Damage.UNREADABLE, shortened(str(message)))
        self._enter(message.timestamp, raw)

    def _enter(self, stamp: float, raw: Raw) -> None:
        """Add an entry with its time, which goes on as before if the driver's clock was set or has begun anew."""
        seen = self._clock()
        time = stamp + self._offset
        if not self._is_stamped:
            self._offset += self.now - time if self._restarted else 0.0
        elif not self._heard[0] - (0.0 if self._restarted else SET) <= time <= seen + self._ahead + SET:
            expected = seen + self._ahead
            self._offset += expected - time
            if not self._restarted:
                self.notes.append(CLOCK_SET.format(time - expected))
        self._restarted, self._is_stamped = False, True
        time = stamp + self._offset
        self._heard = time, seen
        self._ahead = max(self._ahead, time - seen)
        self._came.append((time, raw))

    def send(self, frame: Frame, timeout: float) -> bool:
        """Send a frame on this bus; return False if the driver does not accept it in `timeout` s. Raises BusError.

        Callers on several threads send one after the other.
        """
        under_way = FrameUnderWay(frame, self._clock())
        self._restarted |= not self._is_stamped  # times begin with this frame
        # Added before it is sent, as its answer may come before `send` returns.
        self._came.append((self.now, under_way))
        try:
            under_way.taken = self._watch.send(frame, timeout)
        finally:
            under_way.taken = bool(under_way.taken)
        return under_way.taken

    @property
    def now(self) -> float:
        """Present time in s, by the driver's clock."""
        last, seen = self._heard
        return last + self._clock() - seen

    def pause(self, longest: float) -> float:
        """Return how long to wait before the next poll, s."""
        return longest

    def poll(self) -> Iterator[Timed]:
        """Yield the received frames; raises BusError if the bus failed."""
        for _ in range(len(self._came)):  # bounded, so that the screen is drawn even on a full bus
            time, raw = self._came[0]
            if not isinstance(raw, FrameUnderWay):
                self._came.popleft()
                yield self._in_order(time), raw
                continue
            place = self._received()
            behind, late = self._came[place] if place else (time, None)
            if behind < time - RESOLUTION and late is not None and not isinstance(late, FrameUnderWay):
                del self._came[place]  # read late, it was on the bus before
                yield self._in_order(behind), late
            elif raw.taken is None or (late is None and self._clock() - raw.entered < GRACE):
                break
            else:
                self._came.popleft()
                if raw.taken:
                    yield self._in_order(min(time, behind)), raw.frame
        # Noted when the number has doubled, or after a while, so that notes do not flood the screen.
        lost = self._watch.overflow()
        told = self._overflow
        if lost.bit_length() > told.bit_length() or (lost > told and self._clock() - self._noted > NOTED_AGAIN):
            self._note_overflow()
        if self._failures:
            raise self._failures[0]

    def _received(self) -> int:
        """Return the place of the first received frame after one of ours, 0 without one."""
        places = range(1, len(self._came))  # places, as another thread appends frames meanwhile
        return next((each for each in places if not isinstance(self._came[each][1], FrameUnderWay)), 0)

    def _in_order(self, time: float) -> float:
        """Return a frame's time, or the previous one if stamps are slightly out of order."""
        if time < self._given < time + APART:
            return self._given
        self._given = time
        return time

    def close(self) -> None:
        """Close the bus."""
        # Read before closing, as a closed bus cannot report its overflow.
        if self._watch.overflow() > self._overflow:
            self._note_overflow()
        self._leaving.close()


class LogSource:
    """Entries of logs, with the logs' names, played `speed` times as fast as recorded.

    `place` is where the entry stands that `poll` gave last, and `channel` on which it came.
    """

    notes: Sequence[str] = ()

    def __init__(
        self,
        entries: Generator[tuple[str, LogEntry], None, None],
        speed: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.ended = False
        self.place: Place | None = None
        self.channel = ""
        self._entries, self._speed, self._clock = entries, speed, clock
        self._started = clock()
        self._next = next(entries, None)
        self._first = self._last = self._next[1][1] if self._next else 0.0

    @property
    def now(self) -> float:
        """Present time in s, by the log's clock."""
        if self.ended or self._speed == inf:
            return self._last
        return self._first + (self._clock() - self._started) * self._speed

    def pause(self, longest: float) -> float:
        """Return how long to wait before the next poll, s."""
        return 0.0 if self._speed == inf else longest

    def close(self) -> None:
        """Close the logs."""
        self._entries.close()

    def poll(self) -> Iterator[Timed]:
        """Yield the entries that are due."""
        until = inf if self._speed == inf else self.now
        for _ in range(AT_ONCE):
            if self._next is None or self._next[1][1] > until:
                break
            log, (line, self._last, self.channel, raw) = self._next
            self.place = log, line
            yield self._last, raw
            self._next = next(self._entries, None)
        self.ended = self._next is None


COLOURS = ("bright_cyan", "green", "yellow", "bright_blue", "bright_magenta")
"""Colours of the groups, in the catalogue's order; further groups have none."""

SERVICE_COLOUR = "magenta"

WRONG, OLD = "bold red", "dim"
OLD_AFTER = 3.0
"""Number of periods after which a message is old, at least 1 s."""

BAR_WIDTH = 20
HEAVY_LOAD = 0.8


class Size(NamedTuple):
    """Size of a terminal, in characters and lines."""

    width: int
    height: int


def screen(
    traffic: Traffic, controls: Controls, now: float, load: tuple[float, float], size: Size, notes: Sequence[str] = ()
) -> RenderableType:
    """Return the whole screen for a terminal size, with the last of the `notes`."""
    from rich.console import Group  # an extra
    from rich.text import Text

    rows = selected(traffic.rows.values(), controls.sort, controls.part)
    absent = traffic.presence.note
    room = max(size.height - 8 - bool(absent), 1)
    top = controls.within(len(rows) - room)
    colours = {CANOPEN: SERVICE_COLOUR} | dict(zip(traffic.groups, COLOURS))
    table = _table(rows[top : top + room], now, colours, size.width)
    nodes = Text()
    for name, node in traffic.nodes.items():
        colour = OLD if node.pulse.heard is None else "green"
        bad = node.pulse.lost(now) or node.emergency
        nodes.append(f"● {health(name, node, now)}   ", WRONG if bad else colour)
    lines = [_top(traffic, load), nodes]
    if absent:
        lines.insert(0, Text(absent, WRONG, no_wrap=True, overflow="ellipsis"))
    return Group(*lines, table, _bottom(controls, len(rows) - room, notes))


def _top(traffic: Traffic, load: tuple[float, float]) -> Text:
    from rich.text import Text

    share, rate = load
    filled = min(round(share * BAR_WIDTH), BAR_WIDTH)
    colour = WRONG if share >= HEAVY_LOAD else "green"
    text = Text(f"{traffic.frames} frames  {rate:.0f}/s  load ", no_wrap=True, overflow="ellipsis")
    text.append(f"{share:.1%}", colour).append(f" of {traffic.bitrate // 1000} kbit/s ")
    text.append("█" * filled, colour).append("░" * (BAR_WIDTH - filled), OLD)
    if traffic.damage.total:
        kinds = ", ".join(f"{count.number} x {damage.value}" for damage, count in traffic.damage.counts.items())
        text.append(f"   {kinds}", WRONG)
    return text


def _table(rows: list[MonitorRow], now: float, colours: Mapping[str, str], width: int) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold", expand=True, padding=(0, len(GAP), 0, 0))
    lines = [cells(row, now) for row in rows]
    columns = fitting(lines, width)
    for column in columns:
        ratio = 1 if column == len(HEADINGS) - 1 else None
        justify: JustifyMethod = "right" if ALIGN[column] == "r" else "left"
        table.add_column(HEADINGS[column], justify=justify, no_wrap=True, ratio=ratio)
    for row, line in zip(rows, lines):
        colour = colours.get(row.meaning.group, "")
        period = row.period
        old = period is not None and now - row.last > max(OLD_AFTER * period.mean, 1.0)
        style = f"{colour} {OLD}" if old else colour
        if row.meaning.defects:
            style = WRONG
        # Text, as rich would read brackets in a str as markup.
        table.add_row(*(Text(line[column]) for column in columns), style=style)
    return table


def _bottom(controls: Controls, hidden: int, notes: Sequence[str]) -> Text:
    from rich.text import Text

    text = Text("\n", no_wrap=True, overflow="ellipsis")
    if controls.paused:
        text.append("PAUSED", "bold reverse").append("   ")
    if notes:
        text.append(f"{notes[-1]}   ", WRONG)
    if hidden > 0:
        text.append(f"{amount(hidden, 'row')} more   ", OLD)
    typed = f"{controls.part}{'_' if controls.typing else ''}"
    return text.append(f"sort: {controls.sort}   filter: {typed}   {HELP}", OLD)
