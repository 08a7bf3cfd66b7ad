"""Diagnoses a bus: takes frames, and returns incidents with causes and remedies.

A `Diagnosis` takes what `decode` and `monitor` take: meanings with their times, channels and places. For each bus it
has watchers (`nodes`, `transfers`, `pdos`, and a robot's own), which report what breaks a rule of the table (`rules`).
The same thing again is the same incident (`incidents`), so memory does not grow with the log.

Rules of this package: nothing here has a clock or a bus, and `meaning` alone says what a frame means. A rule that
waits for something counts from what the log has shown; a log may begin and end anywhere.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, TypeAlias

from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.lint.findings import LEVELS, Severity
from eurobot_od.od.standard import HEARTBEAT_TIME
from eurobot_od.support.texts import amount, one_line
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.decoding import TrackingDecoder
from eurobot_od.traffic.diagnosis.drives import DriveWatcher
from eurobot_od.traffic.diagnosis.incidents import Incident, Incidents, ObservedBus, Occurrences, SeenAt, Take, Watcher
from eurobot_od.traffic.diagnosis.load import BusLoad
from eurobot_od.traffic.diagnosis.modules import ModuleWatcher
from eurobot_od.traffic.diagnosis.nodes import EmergencyWatcher, LssWatcher, NodesWatcher
from eurobot_od.traffic.diagnosis.pdos import (
    AnswerWatcher,
    DeadlineWatcher,
    PdoWatcher,
    StreamWatcher,
    SyncWatcher,
    TimeWatcher,
)
from eurobot_od.traffic.diagnosis.questions import Questions
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.diagnosis.transfers import SdoWatcher
from eurobot_od.traffic.entries import Damage, Raw
from eurobot_od.traffic.load import MessageSet, load_report
from eurobot_od.traffic.meaning import CANOPEN, Decoder, Meaning, SdoTransfer
from eurobot_od.traffic.statistics import NOTHING

TICK = 0.02
"""Interval in which watchers look for missing frames, in s."""

SILENCE = 1.0
"""Minimum time without frames that may be a gap in the log, in s."""

MISFITS = 20
"""Number of frames of another length from which more than half of a bus's services say that it is not CANopen."""

DELTAS = 0.2
"""Minimum share of frames with decreasing times from which the log's times count as differences."""

BUS_OFF = 0x40
"""Class bit of Linux's error frames: the controller is bus-off (linux/can/error.h)."""

OF_DAMAGE = {
    Damage.UNREADABLE: BusRule.LOG_UNREADABLE,
    Damage.CUT_OFF: BusRule.LOG_UNREADABLE,
    Damage.ERROR_FRAME: BusRule.ERROR_FRAME,
    Damage.UNKNOWN_IDENTIFIER: BusRule.PDO_UNKNOWN,
    Damage.SWITCHED_OFF: BusRule.PDO_OFF,
    Damage.UNKNOWN_MAPPING: BusRule.PDO_MAPPING_UNKNOWN,
    Damage.OUT_OF_RANGE: BusRule.OUT_OF_RANGE,
}
"""Rules for defects that need no context."""


WatchersOf: TypeAlias = Callable[[Decoder], Iterable[type[Watcher]]]
"""Returns the watchers of plug-ins for a bus with the devices of a decoder."""


def nobody(_: Decoder) -> Iterable[type[Watcher]]:
    """Return no watchers, without plug-ins."""
    return ()


class WatchedBus:
    """A bus with all its watchers; `more` returns those of plug-ins."""

    def __init__(self, bus: ObservedBus, more: WatchersOf, bit_rate: int, promised: MessageSet = NOTHING) -> None:
        self.bus, self.bit_rate, self._more = bus, bit_rate, more
        self._tick_at, self._due = 0.0, 0.0
        self.nodes, self.pdos, self.sdo = NodesWatcher(bus), PdoWatcher(bus), SdoWatcher(bus)
        self.drives = DriveWatcher(bus)
        streams = StreamWatcher(bus)
        self._watchers: list[Watcher] = [
            *(self.sdo, self.nodes, EmergencyWatcher(bus, self.nodes), LssWatcher(bus, self.nodes)),
            *(SyncWatcher(bus), TimeWatcher(bus), self.pdos, self.drives, ModuleWatcher(bus)),
            *(streams, DeadlineWatcher(bus, streams)),
            *([AnswerWatcher(bus, promised, bit_rate)] if promised.messages else []),
        ]
        self._services: dict[str, tuple[Take, ...]] = {}
        self._watch_more()
        self._promised = promised
        self._load = BusLoad(bus, bit_rate)
        self._first: SeenAt | None = None
        self._frames = 0
        self._backwards = ""
        self._went_back = Occurrences()
        self._misfits = Occurrences()

    def _watch_more(self) -> None:
        """Add the watchers of plug-ins for the devices known now, and ask all again what they listen to."""
        there = set(map(type, self._watchers))
        self._watchers += [each(self.bus) for each in self._more(self.bus.decoder) if each not in there]
        names = {name for each in self._watchers for name in each.SERVICES}
        self._services = {name: tuple(each.take for each in self._watchers if name in each.SERVICES) for name in names}
        self.bus.listeners.clear()

    def take(self, time: float, meaning: Meaning) -> None:
        """Process an entry at a time in s."""
        bus, raw = self.bus, meaning.raw
        if not bus.now <= time < self._due:
            self._pass_time(time, raw)
        bus.now, bus.frame = time, raw
        self._frames += 1
        if meaning.defects:
            self._damaged(meaning)
        if isinstance(raw, Frame):
            self._load.take(raw)
            takers = bus.listeners.get(raw[0])
            if takers is None or raw.__class__ is RemoteFrame:
                takers = self._takers(meaning, raw)
            for take in takers:
                take(time, meaning)

    def _pass_time(self, time: float, raw: Raw) -> None:
        """Process the time of an entry: gaps, missing frames, the load until then."""
        bus = self.bus
        if self._first is None:
            bus.frame, bus.began = raw, time
            self._first = bus.at()
            self._gap(time)
        elif time < bus.now:
            self._backwards = self._backwards or f"the time goes back from {bus.now:.6f} s to {time:.6f} s"
            bus.now = time
            self._went_back.add(bus.at())
            self._gap(time)
        elif time - bus.now > SILENCE:
            self._silence(time)
        bus.now = time
        if time >= self._tick_at:
            self.tick(time)
        bus.frame = raw
        if time >= self._load.due and isinstance(raw, Frame):
            self._load.judge(time)
        self._due = min(self._tick_at, self._load.due)

    def _takers(self, meaning: Meaning, frame: Frame) -> tuple[Take, ...]:
        """Return the watchers of a frame: of a service, or of a PDO's first frame."""
        if meaning.group == CANOPEN:
            self.bus.counts[meaning.name] += 1
            return self._services.get(meaning.name, ()) if meaning.is_read else ()
        if frame.is_remote:
            return ()
        asked = (each.listener(frame.cob_id, meaning) for each in self._watchers)
        takers = self.bus.listeners[frame.cob_id] = tuple(filter(None, asked))
        return takers

    def _damaged(self, meaning: Meaning) -> None:
        who = meaning.sender or (meaning.nodes[0] if len(meaning.nodes) == 1 else "")
        for damage, text, _ in meaning.defects:
            if damage is Damage.INCOMPLETE:
                self.sdo.damaged(meaning)
            elif self._is_of_before(damage, who):
                continue
            elif damage is Damage.WRONG_LENGTH:
                if meaning.group == CANOPEN:
                    self._misfits.add(self.bus.at())
                rule = BusRule.FRAME_LENGTH if meaning.group == CANOPEN else BusRule.PDO_LENGTH
                self.bus.found(rule, who, text, meaning.raw[0])
            elif rule_of := OF_DAMAGE.get(damage):
                is_off = damage is Damage.ERROR_FRAME and _is_bus_off(text)
                subject = meaning.raw[0] if isinstance(meaning.raw, Frame) else ""
                said = f"a controller is bus-off ({text})" if is_off else f"{damage.value}: {text}"
                if rule_of is BusRule.PDO_UNKNOWN and who not in self.bus.numbers:
                    self._without_file(who, subject, said)
                else:
                    self.bus.found(BusRule.BUS_OFF if is_off else rule_of, who, said, subject)

    def _is_of_before(self, damage: Damage, who: str) -> bool:
        """Return whether a PDO is only out of step with a reset, or a write, that the device has not confirmed yet."""
        if damage is Damage.SWITCHED_OFF:
            return self.sdo.is_setting_pdo
        sender = self.bus.named(who) if damage is Damage.WRONG_LENGTH else None
        return sender is not None and sender.reset is not None

    def _without_file(self, who: str, subject: int | str, said: str) -> None:
        """Report a frame under an identifier that is in no file."""
        if who:
            text = f"sends or receives PDOs, the first under 0x{subject:03X}, and has no file"
            self.bus.found(BusRule.PDO_WITHOUT_FILE, who, text)
        elif self.bus.numbers:
            self.bus.found(BusRule.PDO_UNKNOWN, who, said, subject)

    def shown(self, ended: SdoTransfer, decoder: Decoder) -> None:
        """Process what a transfer has shown, and use a decoder from now on."""
        if decoder is not self.bus.decoder:
            self.bus.decoder = decoder
            self.pdos.changed()
            self._watch_more()
        if ended.address == HEARTBEAT_TIME and ended.end:
            self.nodes.set_period(self.bus.node(ended.end.server))

    # Time

    def _silence(self, time: float) -> None:
        beating = self.nodes.beating
        if len(beating) > 1 and all(each.is_lost(time) for each in beating):
            text = f"nothing came for {duration(time - self.bus.now, 3)}, not even from {len(beating)} heartbeats"
            self.bus.found(BusRule.LOG_GAP, "", text)
            self._gap(time)

    def _gap(self, time: float) -> None:
        for each in self._watchers:
            each.gap(time)
        self._tick_at = time
        self._load.restart(time)

    def tick(self, time: float) -> None:
        """Report frames missing until now, in s."""
        self._tick_at = time + TICK
        self.bus.frame = None
        for each in self._watchers:
            each.tick(time)

    def end(self, time: float) -> None:
        """Report what is unresolved at the end of the log or watch."""
        self.bus.frame = None
        for each in self._watchers:
            each.end(max(time, self.bus.now))
        if self._went_back.number:
            is_of_deltas = self._went_back.number >= max(2, DELTAS * self._frames)
            rule = BusRule.LOG_DELTAS if is_of_deltas else BusRule.LOG_BACKWARDS
            self.bus.found(rule, "", self._backwards, seen=self._went_back)
        services = sum(self.bus.counts.values())
        if max(MISFITS, services / 2) <= self._misfits.number:
            text = f"frames of another protocol: {self._misfits.number} of {services} of CANopen's services do not fit"
            self.bus.found(BusRule.NO_CANOPEN, "", text, seen=self._misfits)
        for row in load_report(self._promised, self.bit_rate).rows:
            if not row.holds and self._promised.messages:
                text = f"{row.message.name} can be later than its deadline at {self.bit_rate / 1000:g} kbit/s"
                seen = Occurrences.once(self._first or self.bus.at())
                self.bus.found(BusRule.CAN_STARVE, row.message.node, text, row.message.identifier, seen=seen)


def _is_bus_off(text: str) -> bool:
    identifier = re.match("([0-9A-F]+)#", text)  # drivers of Windows and some formats have other texts
    return identifier is not None and bool(int(identifier[1], 16) & BUS_OFF)


class Diagnosis:
    """The diagnosis of logs or of a bus, based on the devices' files.

    `more` returns the watchers of plug-ins for what is known of the devices; `promised` is what should be sent how
    often, at `bit_rate` in bit/s.
    """

    def __init__(
        self,
        decoder: Decoder,
        more: WatchersOf = nobody,
        bit_rate: int = 500_000,
        promised: MessageSet = NOTHING,
    ) -> None:
        self.incidents = Incidents()
        self.frames, self.seconds = 0, 0.0
        self.first: float | None = None
        """The time of the first entry, in s."""
        self._decoder, self._more, self._bit_rate, self._promised = decoder, more, bit_rate, promised
        self._buses: dict[str, WatchedBus] = {}
        self._log, self._line, self._time = "", 0, 0.0
        self._following = TrackingDecoder(decoder)

    def begin(self, log: str) -> None:
        """Start a log, without knowledge of the nodes from the log before."""
        self.end()
        self._buses = {}
        self._log = log
        self._following = TrackingDecoder(self._decoder)

    def take(self, time: float, channel: str, raw: Raw, line: int = 0) -> Meaning:
        """Process an entry of the log at its line, or a frame of a bus; return its meaning."""
        meaning = self._following(time, channel, raw, line)
        self.take_meaning(time, channel, meaning, self._following, line)
        return meaning

    def take_meaning(
        self, time: float, channel: str, meaning: Meaning, following: TrackingDecoder, line: int = 0
    ) -> None:
        """Process a meaning from another decoder, `following`, of the same bus."""
        self.first = time if self.first is None else self.first
        self.frames += 1
        self._line, self._time = line, time
        watched = self._buses.get(channel)
        if watched is None:
            bus = ObservedBus(channel, self._decoder, partial(following.shown, channel), self._at, self.incidents.at)
            watched = self._buses[channel] = WatchedBus(bus, self._more, self._bit_rate, self._promised)
        watched.take(time, meaning)
        if meaning.transfer:
            watched.shown(meaning.transfer, following.decoder(channel))

    def _at(self) -> tuple[float, str, int]:
        """Return time, log and line of the present entry."""
        return self._time, self._log, self._line

    def tick(self, time: float) -> None:
        """Report frames missing until now, in s."""
        self._time = max(time, self._time)
        for each in self._buses.values():
            each.tick(time)

    def end(self, time: float = 0.0) -> None:
        """Report what is unresolved at the end of the log, or of the watch at a time in s."""
        for each in self._buses.values():
            each.end(time)
        self.seconds += self._span
        self._buses = {}

    @property
    def _span(self) -> float:
        """Duration of the present log, in s."""
        return max((each.bus.now - each.bus.began for each in self._buses.values()), default=0.0)

    def silent(self, log: str = "") -> None:
        """Report that a log, or a bus, had no frames."""
        missing = ", ".join(each.name for each in self._decoder.dictionaries)
        text = (f"no frame in {log}" if log else "no frame came") + (f": {missing} should be there" if missing else "")
        self.incidents.at(BusRule.BUS_SILENT, "", "", log, text).add(SeenAt(0.0, log))

    def missed(self, notes: Iterable[str]) -> None:
        """Report frames that their source could not receive."""
        for note in notes:
            self.incidents.at(BusRule.FRAMES_MISSED, "", "", note, note).add(SeenAt(*self._at()))

    def questions(self, channel: str) -> Questions | None:
        """Return the questions to a bus's nodes in trouble, None if no frame came from the bus."""
        watched = self._buses.get(channel)
        return Questions(watched.bus, watched.drives.axes) if watched else None

    def so_far(self, time: float) -> list[Incident]:
        """Return the incidents as if the watch ended at a time in s, worst first."""
        still_open = Incidents()
        for each in self._buses.values():
            each.bus.report = still_open.at
            each.end(time)
            each.bus.report = self.incidents.at
        return self.incidents.sorted(still_open)

    def as_data(self, time: float) -> dict[str, Any]:
        """Return the state at a time in s as data for a page."""
        found = self.so_far(time)
        rows = [{"level": LEVELS[each.rule.severity], "title": each.title, "facts": each.facts} for each in found]
        return {"verdict": self.verdict(found), "incidents": rows}

    def verdict(self, found: Sequence[Incident]) -> str:
        """Return a summary in one line."""
        seen = f"{amount(self.frames, 'frame')}, {duration(self.seconds + self._span, 1)}"
        counts = Counter(each.rule.severity for each in found)
        levels = ", ".join(amount(counts[each], LEVELS[each]) for each in Severity if counts[each])
        if not found:
            return f"Nothing is wrong in {seen}"
        return one_line(f"{levels} in {seen}. {'First look at' if len(found) > 1 else 'It is'} {found[0].title}")
