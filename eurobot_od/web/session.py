"""The live bus as the page shows it: processes every frame, and returns what has changed since a turn.

Rule of this file: one thread calls everything here except the methods of `tap`; `poll` never waits.
"""

from __future__ import annotations

import json
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import islice, takewhile
from pathlib import Path
from queue import Empty, Full, Queue
from threading import Lock
from typing import Any, NamedTuple, TypeAlias

import can
from canopen.objectdictionary import ODVariable

from eurobot_od.errors import BusError, LocalError
from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.od.values import NODE_IDS, SDO_RESPONSE_BASE
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.entries import Damage, Raw
from eurobot_od.traffic.meaning import Decoder, wrong
from eurobot_od.traffic.monitor import BusSource, NodeHealth, Traffic
from eurobot_od.traffic.recorder import recording
from eurobot_od.web.events import BusEvents, PageEvent
from eurobot_od.web.page import (
    DIGITS,
    Panel,
    described,
    event_data,
    fields_of,
    hex_of,
    key_of,
    page,
    picked,
    row_data,
    values,
)

# A second bus on one adapter, for a master that asks nodes while the session takes every frame


DEFAULT_ANSWERS = frozenset(SDO_RESPONSE_BASE + node for node in NODE_IDS)
"""COB-IDs of SDO answers where no file has others."""

MOST_WAITING = 1000
"""Most frames that wait for the master; the oldest make room."""

PATIENCE = 0.5
"""Time for the driver to accept a frame, in s."""


class Tap(can.BusABC):
    """A bus for a master: it sends by another's `send`, and receives the frames passed to it.

    These are the SDO answers; `moved` are their COB-IDs where a file has moved them. While there is `trouble` with the
    bus, sending raises it as a BusError.
    """

    def __init__(self, send: Callable[[Frame, float], bool], moved: Iterable[int] = ()) -> None:
        super().__init__(channel="tap")
        self.channel_info = "bus"
        self._send_by = send
        self._wanted = DEFAULT_ANSWERS.union(moved)
        self.trouble = ""
        self._lock = Lock()
        self._came: Queue[can.Message] = Queue(MOST_WAITING)

    def give(self, frame: Frame, _time: float) -> None:
        """Pass a frame to the master if it listens to it."""
        if frame.cob_id not in self._wanted or frame.is_remote:
            return
        self._put(can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False))

    def _put(self, message: can.Message) -> None:
        with suppress(Full):  # only this thread puts anything in
            if self._came.full():
                with suppress(Empty):  # the master was quicker
                    self._came.get_nowait()
            self._came.put_nowait(message)

    def send_frame(self, frame: Frame) -> None:
        """Send a frame; raises BusError if the driver does not take it."""
        with self._lock:
            if self.trouble:
                raise BusError(self.trouble)
            if not self._send_by(frame, PATIENCE):
                raise BusError("the bus did not take the frame: is another node there to acknowledge it?")

    # Methods of a bus of python-can

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.send_frame(Frame(msg.arbitration_id, bytes(msg.data)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            return self._came.get(timeout=timeout), False
        except Empty:
            return None, False


MOST_OWN = 128
"""Most frames of our own that may still come back from the adapter: a block of SDO has 127."""


class JobBus(Tap):
    """A bus for long work: it receives all frames of others, with their times. `gate` may refuse a frame."""

    def __init__(
        self, send: Callable[[Frame, float], bool], gate: Callable[[Frame], None], left: Callable[[Tap], None]
    ) -> None:
        super().__init__(send)
        self._gate = gate
        self._left = left
        self._own: deque[Frame] = deque(maxlen=MOST_OWN)
        """What was sent, and did not come back yet from the adapter: of most, what they send is never received."""

    def give(self, frame: Frame, time: float) -> None:
        """Pass on a frame, unless it is our own."""
        if frame in self._own:
            self._own.remove(frame)
            return
        message = can.Message(
            timestamp=time,
            arbitration_id=frame.cob_id % EXTENDED,
            is_extended_id=frame.cob_id >= EXTENDED,
            is_remote_frame=frame.is_remote,
            dlc=len(frame.data),
            data=None if frame.is_remote else frame.data,
        )
        self._put(message)

    def send_frame(self, frame: Frame) -> None:
        """Send a frame; raises BusError if the driver does not take it, and the errors of the gate."""
        self._gate(frame)
        self._own.append(frame)
        try:
            super().send_frame(frame)
        except BusError:
            self._own.remove(frame)
            raise

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a message, also a remote frame."""
        kind = RemoteFrame if msg.is_remote_frame else Frame
        self.send_frame(kind(msg.arbitration_id, bytes(msg.dlc) if msg.is_remote_frame else bytes(msg.data)))

    def shutdown(self) -> None:
        """Leave the adapter."""
        self._left(self)
        super().shutdown()


POLL_PERIOD = 0.25
"""Time between two readings of all polled objects, in s."""

MOST_POLLED = 16
"""Most objects that are polled at once, for all browsers together."""


POLLED_FOR = 15.0
"""How long an object is polled after a request, in s; a page that still plots it asks again before that."""


MOST_SAMPLES = 10_000
"""Most values of a polled object that a page can still ask for: those of 40 minutes."""


class Sample(NamedTuple):
    """A `value` that was read at a `time`; a snapshot has it that is newer than a `turn` of the session."""

    turn: int
    time: float
    value: Any


@dataclass
class PolledObject:
    """An object of a node, its last values, the error of its last reading, and until when it is read."""

    node: str
    node_id: int
    thing: ODVariable
    samples: deque[Sample] = field(default_factory=lambda: deque(maxlen=MOST_SAMPLES))
    trouble: str = ""
    wanted_until: float = 0.0

    def shown(self, since: int) -> dict[str, Any]:
        """Return the data that is newer than a turn."""
        new = takewhile(lambda sample: sample.turn > since, reversed(self.samples))
        samples = [(round(time, 4), value) for _, time, value in new]
        return {"samples": samples[::-1], "trouble": self.trouble}


# The session


MOST_KEPT = 100_000
"""Most frames that a page can still ask for, about 25 MB; the oldest make room, `DROPPED` of them at once."""

DROPPED = 10_000

AT_ONCE = 5000
"""Most frames in one snapshot: a page that is opened late catches up in some seconds."""


PanelsOf: TypeAlias = Callable[[Decoder], Iterable[type[Panel]]]
"""Returns the panels of a page for the devices of a decoder."""


def no_panels(_: Decoder) -> Iterable[type[Panel]]:
    """Return no panels."""
    return ()


class Stretch(NamedTuple):
    """Frames that follow each other, as JSON; `first` is the number of the first one."""

    first: int
    frames: Sequence[str]

    @property
    def next(self) -> int:
        """The number of the frame after them."""
        return self.first + len(self.frames)


class FrameHistory:
    """The last frames, each as text, made once for all browsers; they are numbered from 0 on."""

    def __init__(self) -> None:
        self._first = 0
        self._frames = list[str]()

    def add(self, frame: str) -> None:
        """Add the next frame."""
        self._frames.append(frame)
        if len(self._frames) >= MOST_KEPT + DROPPED:
            del self._frames[:DROPPED]
            self._first += DROPPED

    def since(self, number: int) -> Stretch:
        """Return frames from a number on, or from the oldest one left."""
        first = max(number, self._first)
        return Stretch(first, self._frames[first - self._first :][:AT_ONCE])


NO_FRAMES = Stretch(0, ())


MOST_TAKEN = 500
"""Most frames that are processed at once."""

COMPACT = json.JSONEncoder(separators=(",", ":")).encode  # made once: it takes longer than a frame

FEW = 2
"""Number of frames of a message that give no period yet."""

MOST_EVENTS = 2000
"""Most events that are kept; the oldest make room."""

MOST_RECORDED = 10_000_000
"""Most frames of a recording, about half a gigabyte; it then ends by itself."""


class Session:
    """A watched bus.

    `open_bus` opens it, now and whenever it is lost; raises BusError now. `now` counts the seconds since then.
    `trouble` is the error of the bus, empty without one; `panels_of` returns the panels for the devices of a decoder,
    and `history` has the last frames. `diagnosis` has the errors that the frames show. `tap` is for questions, `orders`
    and `polls` are for masters that they do not delay. `first` is called with each frame; it returns whether it keeps
    it.

    Devices are `learned` as their identity is seen: by that number a page notices that its list is old. By its `name`
    it notices that it is another session.
    """

    def __init__(
        self,
        open_bus: Callable[[], can.BusABC],
        decoder: Decoder,
        bitrate: int,
        panels_of: PanelsOf = no_panels,
        clock: Callable[[], float] = time.monotonic,
        diagnosis: Diagnosis | None = None,
    ) -> None:
        self.decoder = decoder
        self._known = fields_of(decoder)
        self.bitrate = bitrate
        self.learned = 0
        self.diagnosis = diagnosis or Diagnosis(decoder, bit_rate=bitrate)
        self.polled: dict[str, PolledObject] = {}
        self.trouble = ""
        self.turn = 0
        self.history = FrameHistory()
        self.name = secrets.token_hex(4)
        self._clock = clock
        self._watch = BusEvents(decoder)
        self._panels_of = panels_of
        self.panels = [panel() for panel in panels_of(decoder)]
        self._traffic = Traffic(decoder, bitrate)
        self._changed: dict[int | Damage, int] = {}
        self._written: dict[int | Damage, tuple[int, str]] = {}
        self._events: dict[str, tuple[int, PageEvent]] = {}
        self.recording = LogRecording()
        self._load = (0.0, 0.0)
        self._started = clock()
        self._began = round(time.time(), 3)
        self._origin: float | None = None
        self._source = BusSource(open_bus(), clock, open_bus)
        answers = [SdoChannel.of(each).answers for each in decoder.dictionaries]
        self.tap, self.orders, self.polls = (Tap(self._source.send, answers) for _ in range(3))
        self._taps: tuple[Tap, ...] = (self.tap, self.orders, self.polls)
        self.first: Callable[[Frame], bool] = lambda _: False
        self.on_learned: Callable[[Dictionary], object] = lambda _: None

    @property
    def now(self) -> float:
        """The present time in seconds since the start."""
        return self._clock() - self._started

    @property
    def frames(self) -> int:
        """The number of processed frames."""
        return self._traffic.frames

    @property
    def in_force(self) -> Decoder:
        """The decoder for the PDO mapping that is in force, as far as the bus has shown it."""
        return self._traffic.following.decoder("")

    # The bus

    def open_for_job(self, gate: Callable[[Frame], None]) -> JobBus:
        """Open a bus that shares the adapter and receives everything; each frame that it sends passes the gate."""
        bus = JobBus(self._source.send, gate, self._leave)
        bus.trouble = self.trouble
        self._taps = (*self._taps, bus)  # replaced as a whole: another thread goes through it
        return bus

    def _leave(self, bus: Tap) -> None:
        self._taps = tuple(each for each in self._taps if each is not bus)

    def poll(self) -> bool:
        """Process the frames that have come since the last call; return whether more are left for the next one."""
        self.turn += 1
        taken = 0
        # Not all at once: on a machine that is too slow for the bus, browsers would get no snapshot for minutes.
        for frame_time, raw in islice(self._source.poll(), MOST_TAKEN):
            taken += 1
            if self._origin is None:  # a driver's clock may start anywhere
                self._origin = min(self._source.now - self.now, frame_time)
            self._take(frame_time - self._origin, raw)
        self.trouble = self._source.trouble
        for tap in self._taps:
            tap.trouble = self.trouble
        for event in self._watch.look(self.now, self._traffic.nodes):
            self._enter(event)
        self._load = self._traffic.load(self.now)
        is_behind = taken == MOST_TAKEN
        if not is_behind:  # a frame that still waits here is not missing
            self.diagnosis.tick(self.now)
        return is_behind

    def _learn(self, decoder: Decoder) -> None:
        """Add the devices of a decoder that were not known, with the plug-ins' data of them."""
        known = {(each.node_id, each.file) for each in self.decoder.dictionaries}
        new = [each for each in decoder.dictionaries if (each.node_id, each.file) not in known]
        if new:
            self.decoder, self.learned = decoder, self.learned + 1
            self._known = fields_of(decoder)
            self._watch.learn(decoder)
            there = set(map(type, self.panels))
            self.panels += [panel() for panel in self._panels_of(decoder) if panel not in there]
            for each in new:
                self.on_learned(each)

    def _take(self, now: float, raw: Raw) -> None:
        meaning = self._traffic.take(now, raw)
        if meaning.transfer:  # which may read a device's identity
            self._learn(self.in_force)
        self.diagnosis.take_meaning(now, "", meaning, self._traffic.following)
        counted = meaning.raw
        self._changed[counted[0]] = self.turn
        if isinstance(raw, Frame):
            if not self.first(raw):
                for tap in self._taps:
                    tap.give(raw, now)
            self.recording.write(now, raw)
        said = values(meaning, self._known)
        shown = [key_of(counted), round(now, DIGITS), hex_of(meaning), said, meaning.text, wrong(meaning)]
        self.history.add(COMPACT(shown))
        for event in self._watch.take(self._traffic.frames, now, meaning):
            self._enter(event)
        if meaning.message is not None:
            for panel in self.panels:
                for event in panel.take(now, meaning.message):
                    self._enter(event)

    def _enter(self, event: PageEvent) -> None:
        self._events.pop(event.key, None)  # an event that has changed becomes the newest
        self._events[event.key] = self.turn, event
        if len(self._events) > MOST_EVENTS:
            del self._events[next(iter(self._events))]

    def close(self) -> None:
        """Close the bus and end a recording; raises OSError if that cannot be finished, BusError."""
        with ExitStack() as leaving:  # if one fails, the others are still closed
            for tap in self._taps:
                leaving.callback(tap.shutdown)
            leaving.callback(self._source.close)
            self.recording.stop()

    # Data for the page

    def page(self, name: str, leave: bool = False, editor: bool = False) -> str:
        """Return the page of the bus, with the devices and panels known now.

        `leave`: the page offers to leave it for another; `editor`: its server edits files.
        """
        about = {"name": name, "bitrate": self.bitrate, **described(self.decoder)}
        return page(
            name, [about], list(map(type, self.panels)), live=True, learned=self.learned, leave=leave, editor=editor
        )

    def snapshot(self, since: int, stretch: Stretch = NO_FRAMES, **more: object) -> str:
        """Return as JSON what has changed after a `turn`, -1 for everything, and a stretch of the history."""
        load, rate = self._load
        head = {
            **picked(self, "turn", "frames", "trouble", "learned"),
            "session": self.name,
            "began": self._began,
            "first": stretch.first,
            "time": round(self.now, 4),
            "load": round(load, 4),
            "rate": round(rate, 1),
            "recording": self.recording.state(),
            "nodes": [self._node(name, node) for name, node in self._traffic.nodes.items()],
            "events": [event_data(event) for turn, event in self._events.values() if turn > since],
            "objects": {key: each.shown(since) for key, each in self.polled.items()},
            **more,
        }
        rows = ",".join(self._row(key) for key, turn in self._changed.items() if turn > since)
        # Put together by hand: a row is already text, made once for all browsers.
        return f'{json.dumps(head)[:-1]}, "history": [{",".join(stretch.frames)}], "rows": [{rows}]}}'

    def _node(self, name: str, node: NodeHealth) -> dict[str, Any]:
        age = None if node.pulse.heard is None else round(self.now - node.pulse.heard, 2)
        return picked(node, "state", "emergency") | {"name": name, "age": age, "life": node.pulse.life(self.now).value}

    def _row(self, key: int | Damage) -> str:
        """Return a row as JSON, made once for all browsers."""
        row = self._traffic.rows[key]
        count, text = self._written.get(key, (0, ""))
        if count == row.count:
            return text
        period = row.period if len(row.times) > FEW else None  # one interval is not a period
        times = {"period": period and round(period.mean, 6), "jitter": period and round(period.jitter, 6)}
        last = {
            "time": round(row.last, DIGITS),
            "data": hex_of(row.meaning),
            "values": values(row.meaning, self._known),
        }
        words = {"text": row.meaning.text, "defects": wrong(row.meaning)}
        data = row_data(row) | picked(row, "count", "wrong") | times | last | words
        self._written[key] = row.count, json.dumps(data)
        return self._written[key][1]


class LogRecording:
    """Writes frames to a log while it is switched on; a new log replaces the last one."""

    def __init__(self) -> None:
        self._frames = 0
        self._trouble = ""
        self._file: Path | None = None
        self._write: Callable[[float, Frame], None] | None = None
        self._open = ExitStack()

    def start(self, folder: Path) -> None:
        """Start a new log in a folder; raises LocalError if a recording is under way."""
        if self._write is not None:
            raise LocalError("a recording is under way")
        if self._file is not None:
            self._file.unlink(missing_ok=True)
        self._file = folder / time.strftime("bus-%Y%m%d-%H%M%S.log")
        self._frames = 0
        self._trouble = ""
        self._write = self._open.enter_context(recording(self._file, tell=partial(setattr, self, "_trouble")))

    def write(self, now: float, frame: Frame) -> None:
        """Write a frame, if the recording is on."""
        if self._write is None:
            return
        try:
            self._write(now, frame)
            self._frames += 1
            if self._frames >= MOST_RECORDED:
                self.stop()
        except OSError as error:  # a full disk ends the recording and nothing else
            self._trouble = f"the recording has ended: {error}"
            with suppress(OSError):  # on the same disk
                self.stop()

    def stop(self) -> None:
        """End the log that is under way, if any."""
        self._write = None
        self._open.close()

    @property
    def finished(self) -> Path:
        """The last log, once it has ended; raises LocalError."""
        if self._file is None or self._write is not None:
            raise LocalError("there is no finished recording: record first, and stop")
        return self._file

    def state(self) -> dict[str, Any]:
        """Return the data for the page."""
        name = self._file.name if self._file else ""
        return {"on": self._write is not None, "frames": self._frames, "file": name, "trouble": self._trouble}
