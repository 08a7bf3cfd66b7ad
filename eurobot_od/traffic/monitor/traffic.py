"""What is on a bus, message by message: how often, how regularly, with which values, and what is wrong.

There is no clock, bus or screen in here: frames go in with their times. A frame costs the same however many came
before, and memory does not grow with them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import fmean, pstdev
from typing import Any, NamedTuple

from eurobot_od.client.watch import Heartbeats
from eurobot_od.device.nmt import STATE_NAMES, NmtState
from eurobot_od.frame import Frame, identifier_text
from eurobot_od.od.standard import HEARTBEAT_TIME
from eurobot_od.support.texts import GAP, columns, one_line
from eurobot_od.traffic.decoding import Following
from eurobot_od.traffic.entries import Damage, Raw
from eurobot_od.traffic.load.analysis import MessageSet
from eurobot_od.traffic.load.seen import NOTHING, SeenTraffic
from eurobot_od.traffic.meaning import REQUEST, DamageCounts, Decoder, Meaning, with_defects
from eurobot_od.traffic.services import EMCY_NAME, GUARDING, HEARTBEAT

REMEMBERED_TIMES = 33
"""Period and jitter are those of the last 32 intervals."""

LOAD_SPAN = 1.0
"""The bus load is that of the last second."""


class MeanPeriod(NamedTuple):
    """Mean interval between frames of a message, and the intervals' standard deviation, both in s."""

    mean: float
    jitter: float


@dataclass
class MonitorRow:
    """One message, service or kind of damage: `meaning` is the last frame's, `wrong` counts frames with damage."""

    identifier: int | None
    meaning: Meaning
    count: int = 0
    wrong: int = 0
    times: deque[float] = field(default_factory=lambda: deque(maxlen=REMEMBERED_TIMES))

    @property
    def last(self) -> float:
        """When the last frame came."""
        return self.times[-1]

    @property
    def period(self) -> MeanPeriod | None:
        """The period; None before there is an interval."""
        intervals = [later - earlier for earlier, later in pairwise(self.times)]
        return MeanPeriod(fmean(intervals), pstdev(intervals)) if intervals else None

    @property
    def name(self) -> str:
        """Name of the message; of a service with its node; of what is not known, why."""
        meaning = self.meaning
        if meaning.message is None and meaning.name and len(meaning.nodes) == 1:
            return f"{meaning.name} {meaning.nodes[0]}"
        return meaning.name or meaning.defects[0].damage.value


@dataclass
class NodeHealth:
    """A node's last reported state and EMCY; `pulse` knows whether the node is lost."""

    pulse: Heartbeats = field(default_factory=Heartbeats)
    state: str = ""
    emergency: str = ""


class Traffic:
    """The traffic on a bus of `bitrate` bit/s; `rows` by identifier, or by kind of damage where there is none.

    `groups` are those of the messages that may come; `seen` is what came beside what is `promised`.
    """

    def __init__(self, decoder: Decoder, bitrate: int, promised: MessageSet = NOTHING) -> None:
        self.bitrate, self._promised = bitrate, promised
        self.seen = SeenTraffic(bitrate, promised)
        self.groups = decoder.protocol.catalogue.groups
        self.rows: dict[int | Damage, MonitorRow] = {}
        periods = {each.name: (each.number(HEARTBEAT_TIME) or 0) / 1000 for each in decoder.dictionaries}
        self.nodes = {name: NodeHealth(Heartbeats(period)) for name, period in periods.items()}
        self.damage = DamageCounts()
        self.frames = 0
        self.now = 0.0
        self._bits = 0
        self._marks: deque[tuple[float, int, int]] = deque()
        self._following = Following(decoder)

    def take(self, time: float, raw: Raw, place: tuple[str, int] | None = None) -> Meaning:
        """Take in a frame, with the log and the line where it stands, and return what it means."""
        meaning = self._following(time, "", raw)
        self.now = time
        self.frames += 1
        row = self.rows.get(raw[0])  # by COB-ID or Damage: both kinds of entry have it first
        if row is None:
            row = self.rows[raw[0]] = MonitorRow(raw.cob_id if isinstance(raw, Frame) else None, meaning)
        row.meaning = meaning
        row.count += 1
        row.times.append(time)
        if isinstance(raw, Frame):
            self._bits += self.seen.take(time, raw, row.name, meaning.sender)
        if meaning.defects:
            row.wrong += 1
            self.damage.add(*(place or ("frame", self.frames)), meaning.defects)
        if meaning.name in (HEARTBEAT, GUARDING, EMCY_NAME) and meaning.is_read:
            self._note_health(time, meaning)
        return meaning

    def _note_health(self, time: float, meaning: Meaning) -> None:
        health = self.nodes.setdefault(meaning.nodes[0], NodeHealth())  # also one that no file describes
        text = meaning.text.partition(", ")[2]  # the words of a service begin with the node's name
        if meaning.name == EMCY_NAME:  # 0x0000 is "error reset or no error" (CiA 301, Table 26)
            health.emergency = "" if text.startswith("0x0000") else text
        elif text != REQUEST:
            health.state = text.partition(",")[0]  # before the toggle bit of an answer to a guarding master
            (health.pulse.boot if health.state == STATE_NAMES[NmtState.INITIALISING] else health.pulse.beat)(time)

    def clear(self) -> None:
        """Forget what was counted."""
        # Not the frames and bits of all: the load is a difference between two of their counts.
        self.rows.clear()
        self.seen = SeenTraffic(self.bitrate, self._promised)
        self.damage = DamageCounts()

    def load(self, now: float) -> tuple[float, float]:
        """Return bus load (share of 1, stuff bits counted) and frames per second since the last second's mark.

        Called at every refresh; between two calls the traffic is assumed to be even.
        """
        self._marks.append((now, self._bits, self.frames))
        # One that is a second old stays, or the load would be that of the time since the last refresh.
        while len(self._marks) > 2 and now - self._marks[1][0] >= LOAD_SPAN:
            self._marks.popleft()
        since, bits, frames = self._marks[0]
        span = now - since
        if span <= 0:
            return 0.0, 0.0
        return (self._bits - bits) / span / self.bitrate, (self.frames - frames) / span


# What is shown


SORTS: Mapping[str, Callable[[MonitorRow], Any]] = {
    "identifier": lambda row: (row.identifier is None, row.identifier or 0),
    "name": lambda row: row.name.casefold(),
    "count": lambda row: -row.count,
    "period": lambda row: row.period.mean if row.period else float("inf"),
    "age": lambda row: -row.last,
    "wrong": lambda row: -row.wrong,
}
"""The orders of the table."""


def selected(rows: Iterable[MonitorRow], sort: str, part: str) -> list[MonitorRow]:
    """Return the rows whose name, group or nodes contain `part`, in an order of SORTS."""
    return sorted((row for row in rows if named(row.meaning, part)), key=SORTS[sort])


def named(meaning: Meaning, part: str) -> bool:
    """Tell whether `part` is part of the name of a message, of its protocol, or of a node that has it."""
    return part.casefold() in " ".join((meaning.name, meaning.group, *meaning.nodes)).casefold()


# Cells of the table as text, the same for every terminal


HEADINGS = ("ID", "Message", "Count", "Period ms", "Age s", "Last values")
ALIGN = "llrrrl"

DROPPED = ("Age s", "Count", "Period ms")
"""The columns that a narrow terminal drops, the least important first."""

ROOM = 24
"""Characters for the last values; columns are dropped to keep them."""


def fitting(lines: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return the numbers of the columns that fit into `width` characters; `lines` are the cells of all columns."""
    widths = [max(map(len, column)) for column in zip(HEADINGS, *lines)]
    shown = list(range(len(HEADINGS)))
    for dropped in map(HEADINGS.index, DROPPED):
        # The last values get what the others leave, so their own width does not count.
        if sum(widths[each] + len(GAP) for each in shown[:-1]) + ROOM <= width:
            break
        shown.remove(dropped)
    return shown


def cells(row: MonitorRow, now: float) -> tuple[str, ...]:
    """Write a row, one text for each heading."""
    identifier = "" if row.identifier is None else identifier_text(row.identifier)
    period = row.period
    every = f"{period.mean * 1000:.1f} ± {period.jitter * 1000:.1f}" if period else ""
    age = f"{max(now - row.last, 0.0):.1f}"  # the clocks of driver and computer do not run alike
    return identifier, one_line(row.name), str(row.count), every, age, one_line(values(row))


def values(row: MonitorRow) -> str:
    """Write the last values and what is wrong with them."""
    return with_defects(row.meaning) if row.meaning.defects else row.meaning.text


def health(name: str, node: NodeHealth, now: float) -> str:
    """Write the state of a node."""
    state = "not heard" if node.pulse.heard is None else "LOST" if node.pulse.lost(now) else node.state
    return one_line(f"{name} {state} ({node.emergency})" if node.emergency else f"{name} {state}")


def plain_table(rows: list[MonitorRow], now: float) -> Iterator[str]:
    """Write the table without colours, one line a row."""
    return columns([HEADINGS, *(cells(row, now) for row in rows)], ALIGN)


# What the keys do


ENTER, ESCAPE, BACKSPACES = "\r\n", "\x1b", "\x08\x7f"  # a terminal sends one or the other
HELP = "q quit  p pause  s sort  / filter  j k scroll  c clear counts"


@dataclass
class Controls:
    """Settings of the table: `part` is what names must contain, `typing` whether it is being typed.

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
        """Return how many rows are scrolled away, `most` at most: what is shown ends with the last row."""
        # Kept, or each press of `j` beyond the end would have to be taken back by one of `k`.
        self.top = min(self.top, max(most, 0))
        return self.top

    def key(self, key: str) -> None:
        """Take in a key; unknown keys do nothing."""
        if not self.typing:
            for name, value in (KEYS[key](self) if key in KEYS else {}).items():
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
"""What the keys change while no filter is being typed."""
