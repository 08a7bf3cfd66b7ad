"""Watches PDOs, SYNC and TIME: their times, senders and mappings (CiA 301, 7.2.2, 7.2.5, 7.2.6).

`DeadlineWatcher` watches those that their receivers expect in time, by event timer or emergency (7.5.2.35).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import combinations, pairwise
from math import inf
from statistics import fmean, median
from typing import NamedTuple

from eurobot_od.client.watch import LATE_AFTER
from eurobot_od.device.nmt import STATE_NAMES, NmtState
from eurobot_od.frame import Frame, identifier_text
from eurobot_od.od import values
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.standard import SYNC, SYNC_PERIOD, SYNC_PRODUCER, ErrorCode
from eurobot_od.od.values import COB_ID, COMMUNICATION_RECORDS, DAY, NODE_IDS, NOT_VALID, PdoDirection
from eurobot_od.od.values import identifier as identifier_of
from eurobot_od.pdo.binding import Binding
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Occurrences, SeenAt, Take, Watcher, brief
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.diagnosis.series import SAME, WINDOW, two_series
from eurobot_od.traffic.load import MICROSECONDS, BoundRow, MessageSet, PeriodicMessage
from eurobot_od.traffic.meaning import Decoder, Meaning
from eurobot_od.traffic.services import EMCY_NAME, SYNC_NAME, TIME_NAME
from eurobot_od.traffic.statistics import SeenTraffic

INHIBITED, STAMP = 0.9, 0.0005
"""Minimum share of the inhibit time between two PDOs, and the error of two time stamps in s."""

ON_ITS_WAY = 0.05
"""Time after a change of state in which an earlier frame may still arrive, in s."""

OF_EVENTS = range(254, 256)
"""Transmission types of PDOs that have an event timer (CiA 301, 7.5.2.37)."""

TPDOS = COMMUNICATION_RECORDS[PdoDirection.TPDO]
"""Communication records of the PDOs that a device sends."""

SYNCS = 3
"""Maximum delay of a synchronous PDO, as a multiple of its number of SYNCs."""


@dataclass
class TpdoWatch:
    """A watched TPDO: its parameters, sender and last time, and the `early` frames (not OPERATIONAL)."""

    name: str
    pdo: Pdo
    sender: ObservedNode
    always: bool = False
    last: float | None = None
    early: Occurrences = field(default_factory=Occurrences)

    @cached_property
    def inhibit(self) -> float:
        """Inhibit time, in s."""
        return self.pdo.inhibit_time / 10_000

    @cached_property
    def timer(self) -> float:
        """Event timer, in s; 0 for a PDO sent on SYNC or request."""
        return self.pdo.event_timer / 1000 if self.pdo.transmission_type in OF_EVENTS else 0.0


class PdoWatcher(Watcher):
    """Watches the PDOs of devices with files."""

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._pdos: dict[int, TpdoWatch] = {}
        self._early: dict[int, list[TpdoWatch]] = {}
        self._since = 0.0
        bus.stated.append(self._said)

    def changed(self) -> None:
        """Process a change of the mapping."""
        self._pdos.clear()
        self._since = self.bus.now

    def listener(self, cob_id: int, meaning: Meaning) -> Take | None:
        watched = self._pdos.get(cob_id) or (self._first(cob_id) if meaning.sender else None)
        if watched is None:
            return None
        self._pdos[cob_id] = watched
        return partial(self._came, watched)

    def _came(self, watched: TpdoWatch, time: float, _: Meaning) -> None:
        """Process a frame of a TPDO."""
        sender, last = watched.sender, watched.last
        sender.heard = sender.is_device = True
        watched.last = time
        is_operational = sender.is_operational
        if last is not None and (watched.inhibit or watched.timer) and time >= last:
            self._judge(watched, time - last, is_steady=is_operational and sender.since <= last)
        if not (is_operational or watched.always or time - sender.since < ON_ITS_WAY):
            if not watched.early.number:
                self._early.setdefault(sender.node_id, []).append(watched)
            watched.early.add(self.bus.at())

    def _judge(self, watched: TpdoWatch, interval: float, *, is_steady: bool) -> None:
        """Compare the interval since the last frame with the PDO's timers."""
        if watched.inhibit and interval < INHIBITED * watched.inhibit - STAMP:
            after = brief(interval)
            allowed = brief(watched.inhibit)
            text = f"{watched.name} comes {after} after the one before, inhibit time {allowed}"
            self.bus.found(BusRule.PDO_INHIBIT, watched.sender.name, text, watched.pdo.cob_id)
        if watched.timer and is_steady and interval > LATE_AFTER * watched.timer:
            self._late(watched, interval)

    def _late(self, watched: TpdoWatch, gap: float) -> None:
        text = f"{watched.name} after {brief(gap)}, event timer {brief(watched.timer)}"
        self.bus.found(BusRule.PDO_TIMER, watched.sender.name, text, watched.pdo.cob_id)

    def _said(self, node: ObservedNode) -> None:
        """Process a state that a node reports; earlier frames were sent in that state."""
        for each in self._early.pop(node.node_id, ()):
            if not node.is_operational:
                text = f"{each.name} while it is {STATE_NAMES[node.state or 0]}"
                self.bus.found(BusRule.PDO_STATE, node.name, text, each.pdo.cob_id, seen=each.early)
            each.early = Occurrences()

    def _first(self, cob_id: int) -> TpdoWatch | None:
        """Return the watch of an identifier, and check its first frame."""
        decoder = self.bus.decoder
        binding = decoder.binding(cob_id)
        sender = self.bus.named(binding.senders[0]) if binding and binding.senders else None
        if binding is None or sender is None:
            return None
        if decoder is not self.bus.files and sender.dictionary:
            self._mapped(cob_id, binding, sender)
        if not binding.receivers and len(self.bus.numbers) > 1:
            text = f"{binding.name} (0x{identifier_text(cob_id)}) is received by no file"
            self.bus.found(BusRule.PDO_UNHEARD, sender.name, text, cob_id)
        has_type = decoder.protocol.catalogue.find(binding.name) is not None
        if len(binding.senders) > 1 and not has_type:  # a robot's message may have several senders by design
            text = f"{' and '.join(binding.senders)} send {binding.name} under 0x{identifier_text(cob_id)}"
            self.bus.found(BusRule.COB_ID_SHARED, "", text, cob_id)
        return TpdoWatch(binding.name, binding.pdo, sender, binding.always)

    def _mapped(self, cob_id: int, binding: Binding, sender: ObservedNode) -> None:
        """Report a PDO whose known mapping or COB-ID differs from its sender's file."""
        if not binding.is_whole:
            return
        said = next((each for each in self.bus.files.protocol.bindings if each.name == binding.name), None)
        if said is None or said.layout.slots != binding.layout.slots:
            text = f"{binding.name} maps {', '.join(binding.layout.fields) or 'nothing'}"
            mapped = f"; its file {', '.join(said.layout.fields) or 'nothing'}" if said else ""
            file = mapped or ", which its file does not have"
            self.bus.found(BusRule.PDO_MAPPED_OTHERWISE, sender.name, f"{text}{file}", cob_id)
        elif said.cob_id != cob_id:
            text = f"{binding.name} is sent under 0x{identifier_text(cob_id)}"
            file = f"; its file says 0x{identifier_text(said.cob_id)}"
            self.bus.found(BusRule.PDO_MAPPED_OTHERWISE, sender.name, f"{text}{file}", cob_id)

    def gap(self, time: float) -> None:
        for each in self._pdos.values():
            each.last = None

    def _shared(self) -> None:
        """Report TPDO identifiers that were given to several devices without files."""
        nodes = [each for each in self.bus.nodes.values() if each.dictionary is None]
        given = [
            (entry, each)
            for each in nodes
            for (index, sub), entry in each.in_force().items()
            if index in TPDOS and sub == COB_ID and not entry & NOT_VALID
        ]
        owners: dict[int, dict[str, None]] = {}
        for entry, node in given:
            owners.setdefault(identifier_of(entry), {})[node.name] = None
        for cob_id, names in owners.items():
            if len(names) > 1:
                text = f"{' and '.join(names)} were both told to send a PDO under 0x{identifier_text(cob_id)}"
                self.bus.found(BusRule.COB_ID_SHARED, "", text, cob_id)

    def end(self, time: float) -> None:
        self._shared()
        for each in self._pdos.values():
            gap = 0.0 if each.last is None else time - each.last
            if each.timer and gap > LATE_AFTER * each.timer and each.sender.is_operational:
                self._late(each, gap)
        for binding in self.bus.decoder.protocol.bindings:
            sender = self.bus.named(binding.senders[0]) if binding.senders else None
            pdo = binding.pdo
            # Only the sender's record counts; a receiver's may differ.
            if not (sender and sender.heard and pdo.direction is PdoDirection.TPDO and sender.state):
                continue
            span = time - max(sender.since, self._since)
            is_sent = binding.cob_id in self._pdos
            if not sender.is_operational or span < 1.0:
                continue
            syncs = self.bus.counts[SYNC_NAME]
            watched = TpdoWatch(binding.name, pdo, sender)
            if watched.timer and not is_sent and span > LATE_AFTER * watched.timer:
                text = f"{binding.name} is never sent, event timer {brief(watched.timer)}"
                self.bus.found(BusRule.PDO_TIMER, sender.name, text, binding.cob_id)
            if not (pdo.is_synchronous and pdo.transmission_type):  # type 0 is sent only after an event
                continue
            if not syncs:
                text = f"{binding.name} waits for SYNC (transmission type {pdo.transmission_type}), which nobody sends"
                self.bus.found(BusRule.PDO_NO_SYNC, sender.name, text, binding.cob_id)
            elif not is_sent and syncs > SYNCS * pdo.transmission_type:
                text = f"{binding.name} is never sent in {syncs} SYNCs (transmission type {pdo.transmission_type})"
                self.bus.found(BusRule.PDO_NOT_SENT, sender.name, text, binding.cob_id)


STEADY, EVEN = 12, 0.5
"""Number of successive intervals that make a period, and their maximum relative deviation."""

STOPPED_AFTER = 10
"""Number of silent periods after which a message has stopped."""

LEAST_SILENCE = 1.0
"""Minimum silence after which a message has stopped, in s."""


@dataclass
class PeriodicStream:
    """Frames of one identifier: their name, the time of the `last` one, their `period`, in s.

    So many intervals in a row were `even`, from a frame at `since` on; those of an even number ended at `paired`.
    """

    name: str
    last: float | None = None
    period: float = 0.0
    even: int = 0
    since: float = 0.0
    paired: float = 0.0

    @property
    def observed(self) -> float:
        """Average period since it became steady, in s; over pairs, as a coarse clock alternates."""
        return (self.paired - self.since) / (self.even & ~1)

    def take(self, time: float, _: Meaning) -> None:
        """Process a frame."""
        last = self.last
        self.last = time
        if last is None:
            return
        interval = time - last
        if abs(interval - self.period) <= EVEN * self.period:
            self.even += 1
            self.period += (interval - self.period) / STEADY
            if not self.even & 1:
                self.paired = time
        else:
            self.even = 0
            self.period = interval
            self.since = time

    def restart(self) -> None:
        """Forget everything before a gap."""
        self.last, self.period, self.even = None, 0.0, 0


class StreamWatcher(Watcher):
    """Watches for periodic messages that stop."""

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._streams: dict[int, PeriodicStream] = {}

    def listener(self, cob_id: int, meaning: Meaning) -> Take | None:
        return self._streams.setdefault(cob_id, PeriodicStream(meaning.name)).take

    def tick(self, time: float) -> None:
        for cob_id, stream in self._streams.items():
            silence = max(STOPPED_AFTER * stream.period, LEAST_SILENCE)
            if stream.even >= STEADY and stream.last is not None and time - stream.last > silence:
                self._stopped(cob_id, stream, stream.last)
                stream.even = 0

    def last(self, cob_id: int) -> float | None:
        """Return the time of a message's last frame, in s."""
        stream = self._streams.get(cob_id)
        return stream.last if stream else None

    def silent(self, time: float) -> Iterator[tuple[int, str, float, float]]:
        """Yield messages that have just stopped at a time in s: COB-ID, name, last time, and period in s."""
        for cob_id, stream in self._streams.items():
            if stream.even >= STEADY and stream.last is not None and time - stream.last > SYNCS * stream.period:
                yield cob_id, stream.name or f"0x{identifier_text(cob_id)}", stream.last, stream.observed

    def _stopped(self, cob_id: int, stream: PeriodicStream, last: float) -> None:
        node = self.bus.nodes.get(cob_id & NODE_IDS[-1])  # nearly all PDOs have the node-ID in their COB-ID
        is_told = self.bus.commanded > last - LEAST_SILENCE
        if not is_told and node and node.state is NmtState.OPERATIONAL and not node.is_lost:
            text = f"{stream.name or '0x' + identifier_text(cob_id)} stops: {_came(stream.observed, last)}"
            self.bus.found(BusRule.PDO_STOPS, node.name, text, cob_id)

    def gap(self, time: float) -> None:
        for each in self._streams.values():
            each.restart()


def _came(period: float, last: float) -> str:
    return f"it came every {brief(period)} (observed), and last at {last:.3f} s"


NO_SOONER = 0.5
"""Minimum timeout of an answer, in s, even with a shorter deadline."""


class AnswerWatcher(Watcher):
    """Watches for the answers that the network file promises, within their computed bounds."""

    def __init__(self, bus: ObservedBus, promised: MessageSet, bit_rate: int) -> None:
        super().__init__(bus)
        self._promised = SeenTraffic(bit_rate, promised)
        self._asked: dict[int, float] = {}
        self._open: dict[int, tuple[float, PeriodicMessage, SeenAt]] = {}

    def listener(self, cob_id: int, meaning: Meaning) -> Take | None:
        seen = self._promised
        if cob_id not in seen.asking:
            return None
        return partial(self._came, cob_id, seen.promised.get(cob_id), seen.answers.get(cob_id, ()))

    def _came(self, cob_id: int, row: BoundRow | None, answers: Collection[int], time: float, meaning: Meaning) -> None:
        """Process an answer, whose bound is in `row`, or a message that others answer."""
        self._open.pop(cob_id, None)
        asked = self._asked.pop(cob_id, None)
        if asked is not None and row and row.response is not None and time - asked > row.response / MICROSECONDS:
            computed = f"computed: {brief(row.response / MICROSECONDS)} at most"
            text = f"{meaning.name} comes {brief(time - asked)} after its request, {computed}"
            self.bus.found(BusRule.ANSWER_LATE, meaning.sender, text, cob_id)
        for answer in answers:
            self._asked[answer] = time
            if answer not in self._open:
                self._open[answer] = time, self._promised.promised[answer].message, self.bus.at()

    def tick(self, time: float) -> None:
        for identifier, (since, answer, asked) in list(self._open.items()):
            if time - since > max(NO_SOONER, 2 * answer.deadline / MICROSECONDS):
                del self._open[identifier]
                text = f"no {answer.name} to {answer.answers}"
                seen = Occurrences.once(asked)
                self.bus.found(BusRule.ANSWER_MISSING, answer.node, text, identifier, seen=seen)

    def gap(self, time: float) -> None:
        self._open.clear()

    def end(self, time: float) -> None:
        self.tick(time)


DOUBLE = 0.1
"""Maximum distance of SYNCs of two producers in phase, as a share of the period."""

ONE_PRODUCER = 1.55
"""Maximum ratio of SYNC intervals of one producer; a timer on a coarse clock reaches 1.5."""

INTERVALS = 500
"""Number of the last SYNC intervals that statistics use."""


ALTERNATES = (
    "one producer whose timer alternates, or two of one period whose clocks agree: unplug one, or give SYNC a counter "
    "(0x1019), which tells"
)
"""Likely cause of two alternating SYNC intervals that do not drift."""


class SyncWatcher(Watcher):
    """Watches the period, counter and producers of SYNC."""

    SERVICES = (SYNC_NAME,)

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._last: tuple[float, bytes] | None = None
        self._times: deque[float] = deque(maxlen=WINDOW)
        self._more_times: deque[float] = deque(maxlen=2 * WINDOW)
        self._number = 0
        self._two = False
        self._skipped: tuple[str, Occurrences] | None = None
        self._producers: list[ObservedNode] = []
        self._short = self._doubles = 0
        self._interval = inf
        self._intervals: deque[float] = deque(maxlen=INTERVALS)
        self._before, self._usual = b"", 0.0
        self._uneven = Occurrences()
        self._jitter = ""
        self._turns: tuple[Sequence[float], Sequence[float]] | None = None

    def take(self, time: float, meaning: Meaning) -> None:
        frame, before = meaning.raw, self._last
        if not isinstance(frame, Frame) or frame.is_remote:
            return
        if not self._number % SYNCS:
            self._look_for_producers()
        self._last = time, frame.data
        if before is None or time < before[0]:
            return
        self._count(before[1], frame.data)
        self._before = before[1]
        self._period(time, time - before[0])

    def _two_producers(self, text: str, subject: str, seen: Occurrences | None = None) -> None:
        self.bus.found(BusRule.SYNC_TWO, "", f"two producers of SYNC: {text}", subject, seen=seen)

    def _look_for_producers(self) -> None:
        """Update the producers of SYNC from settings, which a master may have written."""
        producers = [each for each in self.bus.nodes.values() if each.number(SYNC) & SYNC_PRODUCER]
        if producers != self._producers:
            self._producers = producers
            for one, two in combinations(producers, 2):
                text = f"{one.name} and {two.name} are both to send SYNC (0x1005)"
                self._two_producers(text, "files")

    def _period(self, time: float, interval: float) -> None:
        """Compare an interval with the configured period, or else the observed one."""
        said = next((each.number(SYNC_PERIOD) / 1e6 for each in self._producers if each.number(SYNC_PERIOD)), 0.0)
        if not self._number % SYNCS:
            self._usual = self._observed
        usual = said or self._usual
        self._times.append(time)
        self._more_times.append(time)
        self._intervals.append(interval)
        self._number += 1
        periods = None
        if not self._two:
            # The larger window has enough of the slower one where the periods differ much.
            window = self._times if self._number % WINDOW else self._more_times
            periods = None if self._number % SYNCS else two_series([*window], ONE_PRODUCER)
        if periods and self._are_of_two(*periods):
            self._two = True
            every = " and ".join(brief(each) for each in periods)
            text = f"two series of SYNC, every {every} (observed)"
            self._two_producers(text, "period", seen=self._uneven if self._uneven.number else None)
            self._uneven = Occurrences()
        self._short = self._short + 1 if usual and interval < 0.9 * usual else 0
        self._extra(interval, usual)
        if not usual or self._two:
            return
        is_short = said and self._short >= SYNCS
        is_uneven = abs(interval / usual - 1) > 0.25
        if not (is_short or is_uneven):
            return
        text = f"SYNC comes after {brief(interval)}, with a period of {brief(usual)}" if said else ""
        if is_short:
            self._two = True
            self._two_producers(text, "period")
        else:
            self._jitter = self._jitter or text
            self._uneven.add(self.bus.at())

    def _are_of_two(self, one: float, two: float) -> bool:
        """Return whether two series with these periods, in s, come from two producers.

        Those of one period drift, as no two clocks agree. What does not may be one producer whose timer alternates.
        """
        if abs(one / two - 1) > SAME:
            return True
        intervals = sorted(after - before for before, after in pairwise(self._times))
        short = intervals[1 : len(intervals) // 2 - 1]
        long = intervals[(len(intervals) + 1) // 2 + 1 : -1]
        if self._turns is None:
            self._turns = short, long
        first, _ = self._turns
        return short[0] > first[-1] + STAMP or short[-1] < first[0] - STAMP

    def _extra(self, interval: float, usual: float) -> None:
        """Detect SYNCs of a second producer in phase with the first.

        Without data most of such frames are sent as one: a wire cannot tell two nodes that send the same bits.
        """
        before = self._interval
        self._interval = interval
        if before < DOUBLE * usual and abs(before + interval - usual) < DOUBLE * usual:
            self._doubles += 1
            if self._doubles >= SYNCS and not self._two:
                self._two = True
                text = f"SYNC comes twice in a period of {brief(usual)} (observed), {brief(before)} apart"
                self._two_producers(text, "double", seen=self._uneven if self._uneven.number else None)
                self._uneven = Occurrences()

    @property
    def _observed(self) -> float:
        """Period by the last SYNCs, in s: half of two intervals, as a coarse clock alternates; 0 for too few."""
        times = [*self._times]
        pairs = sorted(after - before for before, after in zip(times, times[2:]))
        return pairs[len(pairs) // 2] / 2 if len(times) > 2 * SYNCS else 0.0

    def _count(self, before: bytes, present: bytes) -> None:
        if len(before) != len(present):
            self._two_producers("SYNC comes with and without a counter", "length")
        elif present and present == before:
            self._two_producers(f"SYNC comes twice with counter {present[0]}", "counter")
        elif present and self._skipped and _follows(self._before, present) and not _follows(before, present):
            text = f"the counter of SYNC goes on from {self._before[0]} to {present[0]} across another series"
            self._two_producers(text, "counter", seen=self._skipped[1])
            self._skipped = None
        elif present:
            self._say_skipped()
            if not _follows(before, present):
                text = f"the counter of SYNC goes from {before[0]} to {present[0]}"
                self._skipped = text, Occurrences.once(self.bus.at())

    def tick(self, time: float) -> None:
        usual = self._usual
        if self._last is None or not usual or time - self._last[0] < max(STOPPED_AFTER * usual, LEAST_SILENCE):
            return
        since = self._last[0]
        self._last = None
        self._times.clear()
        self._more_times.clear()
        is_told = self.bus.commanded > since - LEAST_SILENCE
        if not is_told and any(each.state is NmtState.OPERATIONAL for each in self.bus.nodes.values()):
            self.bus.found(BusRule.SYNC_STOPS, "", f"SYNC stops: {_came(usual, since)}")

    def _say_skipped(self) -> None:
        if self._skipped:
            text, seen = self._skipped
            self.bus.found(BusRule.SYNC_COUNTER, "", text, seen=seen)
            self._skipped = None

    def gap(self, time: float) -> None:
        self._last = None
        self._times.clear()
        self._more_times.clear()

    def end(self, time: float) -> None:
        if self._skipped:
            self.bus.found(BusRule.SYNC_COUNTER, "", self._skipped[0], seen=self._skipped[1])
        if self._uneven.number:
            cause = ALTERNATES if self._turns else ""
            text = self._jitter or self._as_seen()
            self.bus.found(BusRule.SYNC_JITTER, "", text, seen=self._uneven, cause=cause)

    def _as_seen(self) -> str:
        """Return text on the observed SYNC intervals; of an even number, as a coarse clock alternates."""
        intervals = [*self._intervals][len(self._intervals) % 2 :]
        span = f"{brief(min(intervals))} to {brief(max(intervals))}"
        if self._turns:
            span = f"{' and '.join(brief(median(each)) for each in self._turns)} by turns"
        return f"SYNC comes {span} after the one before, {brief(fmean(intervals))} on average (observed)"


def _follows(before: bytes, present: bytes) -> bool:
    """Return whether one SYNC counter follows another; 1 follows the overflow value (CiA 301, 7.5.2.22)."""
    return bool(before) and present[0] in (before[0] + 1, 1)


JUMP = 1.0
"""Maximum deviation of TIME from the log's clock between two messages, in s."""

TIMES = 3
"""Number of silent periods after which TIME has stopped; most periods are 1 s or more."""


class TimeWatcher(Watcher):
    """Watches that TIME keeps pace with the log's clock and does not stop."""

    SERVICES = (TIME_NAME,)

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._last: tuple[float, float] | None = None
        self._intervals: deque[float] = deque(maxlen=2 * SYNCS)

    def take(self, time: float, meaning: Meaning) -> None:
        frame, before = meaning.raw, self._last
        if not isinstance(frame, Frame) or frame.is_remote:
            return
        milliseconds = int.from_bytes(frame.data[:4], "little") & 0x0FFF_FFFF
        said = (int.from_bytes(frame.data[4:6], "little") * DAY + milliseconds) / 1000
        if before and time > before[0]:
            self._intervals.append(time - before[0])
        self._last = time, said
        if before and abs((said - before[1]) - (time - before[0])) > JUMP:
            went = f"{said - before[1]:+g} s in {duration(time - before[0], 3)}"
            self.bus.found(BusRule.TIME_JUMPS, "", f"TIME jumps by {went}")

    def tick(self, time: float) -> None:
        if self._last is None or len(self._intervals) < SYNCS:
            return
        period = max(self._intervals)
        since = self._last[0]
        if period > ONE_PRODUCER * min(self._intervals) or time - since < max(TIMES * period, LEAST_SILENCE):
            return
        self._intervals.clear()
        is_told = self.bus.commanded > since - LEAST_SILENCE
        if not is_told and any(each.state is NmtState.OPERATIONAL for each in self.bus.nodes.values()):
            self.bus.found(BusRule.TIME_STOPS, "", f"TIME stops: {_came(period, since)}")

    def gap(self, time: float) -> None:
        self._last = None
        self._intervals.clear()


RPDO_BASES = values.DEFAULT_PDO_BASES[PdoDirection.RPDO]
"""COB-IDs of the first RPDOs, without the node-ID (CiA 301, 7.3.3)."""


class Deadline(NamedTuple):
    """An RPDO with an event timer: its receiver, its name, and the timer in s."""

    receiver: ObservedNode
    name: str
    timer: float


class DeadlineWatcher(Watcher):
    """Watches PDOs with a deadline; `streams` has the time of the last frame of each."""

    SERVICES = (EMCY_NAME,)

    def __init__(self, bus: ObservedBus, streams: StreamWatcher) -> None:
        super().__init__(bus)
        self._streams = streams
        self._decoder: Decoder | None = None
        self._expected: dict[int, Deadline] = {}
        self._late: set[int] = set()

    def take(self, time: float, meaning: Meaning) -> None:
        said = meaning.fields
        if said.get("code") != ErrorCode.PDO_MISSING:
            return
        node = self.bus.node(said["node"])
        for cob_id, name, last, period in self._streams.silent(time):
            if cob_id in self._identifiers(node):
                text = f"{name} is not refreshed: it came every {brief(period)} (observed), and last at {last:.3f} s"
                self._report(cob_id, node, text)

    def _identifiers(self, node: ObservedNode) -> set[int]:
        """Return the COB-IDs of a node's RPDOs from its file, or else the predefined ones."""
        bindings = self.bus.decoder.protocol.bindings
        known = {each.cob_id for each in bindings if node.name in each.receivers}
        return known or {base + node.node_id for base in RPDO_BASES}

    def _report(self, cob_id: int, node: ObservedNode, text: str) -> None:
        if cob_id not in self._late:
            self._late.add(cob_id)
            self.bus.found(BusRule.PDO_DEADLINE, node.name, text, cob_id)

    def tick(self, time: float) -> None:
        if self._decoder is not self.bus.decoder:
            self._decoder = self.bus.decoder
            self._expected = dict(self._timers())
        for cob_id, (receiver, name, timer) in self._expected.items():
            last = self._streams.last(cob_id)
            if last is None or time - last < max(LATE_AFTER * timer, LEAST_SILENCE):
                self._late.discard(cob_id)
            elif receiver.is_operational and self.bus.commanded < last:
                text = f"{name} (0x{identifier_text(cob_id)}) is not refreshed: event timer {brief(timer)}"
                self._report(cob_id, receiver, f"{text}, last at {last:.3f} s")

    def _timers(self) -> Iterator[tuple[int, Deadline]]:
        """Yield the RPDOs with an event timer by COB-ID."""
        for device in (*self.bus.decoder.dictionaries, *self.bus.decoder.learned):
            for pdo in device.read_pdos(device.default, lambda _: None, listening=True):
                if pdo.direction is PdoDirection.RPDO and pdo.valid and pdo.event_timer:
                    node = self.bus.node(device.node_id)
                    yield pdo.cob_id, Deadline(node, f"{node.name}.{pdo.key}", pdo.event_timer / 1000)
