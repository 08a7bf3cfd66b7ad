"""Watches nodes: boot-up, NMT, heartbeats, guarding, emergencies, LSS (CiA 301, 7.2.7, 7.2.8; CiA 305)."""

from __future__ import annotations

from collections import defaultdict, deque
from functools import partial
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from eurobot_od.client.watch import LATE_AFTER, LOST_AFTER, NodeChange
from eurobot_od.device.nmt import COMMAND_NAMES, RESETS, STATE_NAMES, TARGET, TOGGLE, NmtState, boot_state
from eurobot_od.frame import Frame
from eurobot_od.od.identity import absence
from eurobot_od.od.standard import ANSWERS, CONSUMED_HEARTBEATS, HEARTBEAT_TIME, NMT_STARTUP, Lss, LssState
from eurobot_od.od.values import ALL_NODES, ERROR_CONTROL_BASE, NODE_IDS
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Occurrences, Watcher, brief
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.diagnosis.series import WINDOW, is_even, two_series
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.services import EMCY_NAME, GUARDING, HEARTBEAT, LSS, NMT

OBEYS_WITHIN = 0.5
"""Time after an NMT command in which a heartbeat may still have the old state, in s."""

BOOTS_WITHIN = 5.0
"""Timeout for a boot-up after a reset, and for a start after the node was first heard, in s."""

TOGETHER = 0.5
"""Maximum time between boot-ups of two nodes with one node-ID after a reset, in s."""

SURE = 3
"""Number of contradicting heartbeats from which a second node is assumed."""

PATIENCE = 1.0
"""Minimum silence for a lost heartbeat while its period is unconfirmed, in s."""

CHANGED, UNEVEN = 0.25, 0.2
"""Relative deviations of an interval from the period: for a changed period, and for one of two series."""

IN_PHASE = 0.15
"""Maximum relative deviation of a heartbeat that continues a series."""

EXACT, CLEARER = 0.02, 5
"""Maximum relative deviation of a heartbeat surely in phase, and the minimum ratio of the alternative's to it."""

REACTS_WITHIN = 1.0
"""Maximum time from an emergency to a change of state that it causes, in s."""

ENDS_WITHIN = 1.0
"""Silence at the end of a log that is not reported, in s, as nodes and recorder are switched off together."""

ANSWERS_WITHIN = 0.1
"""Maximum time for an answer to node guarding, in s."""

STATES = {each.value: each for each in NmtState}
"""States by the data of a heartbeat."""

OFF_OR_ELSEWHERE = "its heartbeat is switched off, or it sends it under another node-ID"
"""Likely cause of a missing heartbeat of a node that is there."""


class UnclearBootUp(NamedTuple):
    """A boot-up amid heartbeats, which may be another node's; `rule` and `text` apply if it is not."""

    rule: BusRule
    text: str
    at: float
    seen: Occurrences
    last: float
    period: float
    state: NmtState

    def is_of_another(self, time: float, state: NmtState) -> bool:
        """Return whether a heartbeat at a time in s continues the series and state from before the boot-up."""
        periods, own = (time - self.last) / self.period, (time - self.at) / self.period
        deviation = abs(periods - round(periods))
        own_deviation = min(own, abs(own - 1))
        is_next = round(periods) >= 1 and deviation < IN_PHASE
        is_sure = own_deviation > IN_PHASE or (deviation < EXACT and own_deviation > CLEARER * deviation)
        return is_next and is_sure and own > IN_PHASE and state is self.state


def consumed_by(consumer: ObservedNode) -> set[int]:
    """Return the node-IDs whose heartbeat a node consumes by its 0x1016, as shown."""
    shown = consumer.in_force().items()
    entries = [number for (index, sub), number in shown if index == CONSUMED_HEARTBEATS and sub]
    return {entry >> 16 & 0x7F for entry in entries if entry & 0xFFFF} - {0}


class Beats:
    """Heartbeats of a node: the configured `period` in s (0 for none), and the time of the `last` one.

    `last` is None while none is due. `usual` is the period by the settings, or by what came if that is longer; 0 if
    nothing says it. `before` is the state before the last one, `flips` how often it came back.
    `observed` is the period of heartbeats that came evenly, 0 until then; they are of two nodes if `is_of_two`.
    The first one came when it `began`. `silence` is what is to be reported of a loss, and where, unless the log ends.
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.lost = False
        self.usual = period
        self.last: float | None = None
        self.began = 0.0
        self.intervals: deque[float] = deque(maxlen=2 * SURE)
        self.times: deque[float] = deque(maxlen=WINDOW)
        self.observed, self.is_of_two, self._number = 0.0, False, 0
        self.before: NmtState | None = None
        self.flips = 0
        self.silence: tuple[str, Occurrences] | None = None

    def add(self, interval: float) -> None:
        """Process an interval between two heartbeats, in s."""
        self.intervals.append(interval)
        if len(self.intervals) >= SURE:
            # The second longest, so that a single long silence does not count; with few intervals, the longest.
            place = -2 if len(self.intervals) > SURE + 1 else -1
            self.usual = max(self.period, sorted(self.intervals)[place])

    def is_lost(self, now: float) -> bool:
        """Return whether the next heartbeat is overdue."""
        if self.last is None or not now - self.last > LOST_AFTER * self.usual > 0:
            return False
        return len(self.intervals) >= SURE or now - self.last > PATIENCE  # its period may differ from the file's

    @property
    def middle(self) -> float:
        """Median of the last intervals, in s; with too few the usual one."""
        return median(self.intervals) if len(self.intervals) >= SURE else self.usual

    @property
    def shortest(self) -> float:
        """Shortest of the last intervals, in s; 0 for too few."""
        return min(self.intervals) if len(self.intervals) >= SURE else 0.0

    @property
    def came(self) -> bool:
        """Whether there was any heartbeat."""
        return bool(self.last is not None or self.intervals or self.lost)

    def restart(self, last: float | None) -> None:
        """Restart: the next heartbeat is due after `last`, or none is."""
        self.last = last
        self.lost = False
        self.flips = 0
        self.observed = 0.0
        self.usual = self.period
        self.intervals.clear()
        self.times.clear()

    def is_next(self, time: float) -> bool:
        """Return whether a frame at a time in s continues the series."""
        if self.last is None or not self.usual or len(self.intervals) < SURE:
            return False
        periods = (time - self.last) / self.usual
        return round(periods) >= 1 and abs(periods - round(periods)) < IN_PHASE

    def is_paired(self, period: float) -> bool:
        """Return whether any two successive intervals sum to a period in s, as with two nodes."""
        return all(abs((one + two) / period - 1) < UNEVEN for one, two in pairwise(self.intervals))

    def series(self, time: float) -> tuple[float, float] | None:
        """Process a heartbeat at a time in s; return the periods if there are two series.

        A twin does not go away: few windows are looked at.
        """
        self.times.append(time)
        self._number += 1
        if self._number % (WINDOW // 2):
            return None
        times = [*self.times]
        if len(self.intervals) == self.intervals.maxlen and not self.observed and is_even(times, 1 + IN_PHASE):
            self.observed = sum(self.intervals) / len(self.intervals)
        return None if self.is_of_two else two_series(times, 1 + CHANGED)


class NodesWatcher(Watcher):
    """Watches NMT commands, boot-ups, heartbeats, and node guarding."""

    SERVICES = NMT, HEARTBEAT, GUARDING

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._told: dict[int, tuple[int, float]] = {}
        self._wanted: dict[int, NmtState] = {}
        self._booted: dict[int, float] = {}
        self._beats: dict[int, Beats] = {}
        self._toggles: dict[int, int | None] = {}
        self._asked: dict[int, int] = {}
        self._asked_at: dict[int, float] = {}
        self._pre_operational: dict[int, Occurrences] = {}
        self._unclear: dict[int, UnclearBootUp] = {}

    def take(self, time: float, meaning: Meaning) -> None:
        frame = meaning.raw
        assert isinstance(frame, Frame)
        if meaning.name == NMT:
            if not frame.is_remote:
                self._command(time, *frame.data)
            return
        node = self.bus.node(frame.cob_id - ERROR_CONTROL_BASE)
        is_answer = meaning.name == GUARDING and not self._is_beat(time, node, frame)
        if is_answer:
            self._guard(time, node, frame)
        if not frame.is_remote:
            if not node.heard:
                self._beats_of(node).began = time
            node.heard = True
            state = frame.data[0] & ~TOGGLE
            if state == NmtState.INITIALISING:
                node.is_device = True
                self._boot(time, node)
            elif state in STATES:
                self._state(time, node, STATES[state], is_answer)

    # NMT

    def _command(self, time: float, command: int, node_id: int) -> None:
        self.bus.commanded = time
        heard = [each for each in self.bus.nodes.values() if each.heard]
        nodes = heard
        if node_id != ALL_NODES:
            nodes = [self.bus.node(node_id)] if node_id in NODE_IDS else []
        for node in nodes:
            self._beats_of(node).flips = 0
            if command in RESETS:
                node.reset = time
                node.state = None
                node.boots += 1
                self._forget_orders(node)
                self._beats_of(node).restart(None)
            elif command in TARGET:
                wanted = self._wanted[node.node_id] = TARGET[command]  # type: ignore[index]
                self._told[node.node_id] = command, time
                if node.heard:
                    node.state, node.since = wanted, time

    def _forget_orders(self, node: ObservedNode) -> None:
        self._told.pop(node.node_id, None)
        self._wanted.pop(node.node_id, None)

    def _boot(self, time: float, node: ObservedNode) -> None:
        last = self._booted.get(node.node_id)
        self._booted[node.node_id] = time
        beats = self._beats_of(node)
        self._lost(node.node_id, beats)
        rule = None
        text = f"{NodeChange.BOOTED.value} again without a reset"
        if node.reset is not None:
            node.reset = None
        elif last is not None and time - last < TOGETHER and node.state is None:
            self._two(node, "two boot-ups come after one start", "boot-ups")
        elif node.state is NmtState.OPERATIONAL:
            rule = BusRule.BOOTS_OPERATIONAL
            text = f"{NodeChange.BOOTED.value} while it was operational"
        elif last is not None or node.state is not None:
            rule = BusRule.BOOTS_AGAIN
        if rule and node.state and beats.last is not None and beats.usual and not beats.lost:
            seen = Occurrences.once(self.bus.at())
            unclear = UnclearBootUp(rule, text, time, seen, beats.last, beats.middle, node.state)
            self._unclear[node.node_id] = unclear
        elif rule:
            self.bus.found(rule, node.name, text)
        node.booted = True
        node.state = None
        node.since = time
        node.boots += 1
        self._forget_orders(node)
        self._toggles[node.node_id] = None
        beats.restart(time)

    def _settle(self, time: float, node: ObservedNode, state: NmtState) -> None:
        """Decide by a heartbeat whether the node or another one with its node-ID has booted."""
        unclear = self._unclear.pop(node.node_id, None)
        if unclear is None:
            return
        if not unclear.is_of_another(time, state):
            self.bus.found(unclear.rule, node.name, unclear.text, seen=unclear.seen)
            return
        node.state = state
        text = f"a boot-up, and the heartbeats go on in phase as {STATE_NAMES[state]}"
        self._two(node, text, "boot-up", unclear.seen)

    def _two(self, node: ObservedNode, text: str, subject: str, seen: Occurrences | None = None) -> None:
        self._beats_of(node).is_of_two = True
        self.bus.found(
            BusRule.TWO_NODES, node.name, f"node-ID {node.node_id} is used twice: {text}", subject, seen=seen
        )

    def _state(self, time: float, node: ObservedNode, state: NmtState, is_guarding: bool) -> None:
        if not is_guarding:
            self._settle(time, node, state)
            self._beat(time, node, state)
        if state is not node.state:
            if node.node_id not in self._told and state is not self._wanted.get(node.node_id):
                self._untold(node, state)
            node.state, node.since = state, time
        for tell in self.bus.stated:
            tell(node)
        if state is NmtState.PRE_OPERATIONAL:
            self._pre_operational.setdefault(node.node_id, Occurrences()).add(self.bus.at())
        else:
            self._pre_operational.pop(node.node_id, None)
        command, since = self._told.get(node.node_id, (0, time))
        if command and TARGET[command] is state:  # type: ignore[index]
            del self._told[node.node_id]
        elif command and time - since > OBEYS_WITHIN:
            del self._told[node.node_id]
            text = f"is {STATE_NAMES[state]} {duration(time - since, 3)} after NMT {COMMAND_NAMES[command]}"
            self.bus.found(BusRule.NOT_FOLLOWED, node.name, text, command)

    def _untold(self, node: ObservedNode, state: NmtState) -> None:
        """Check a state that was not commanded."""
        missed = f"; missed: {node.missed[1]}" if node.missed and self.bus.now - node.missed[0] < REACTS_WITHIN else ""
        text = f"goes from {STATE_NAMES[node.state or 0]} to {STATE_NAMES[state]} without a command{missed}"
        starts = node.dictionary and boot_state(node.dictionary.default(NMT_STARTUP))
        is_first = state is NmtState.OPERATIONAL is not starts and self._booted.get(node.node_id) == node.since
        is_unseen_start = state is NmtState.OPERATIONAL and not self.bus.counts[NMT] and not starts
        if (node.state is not None and not is_unseen_start) or (starts and is_first):
            self.bus.found(BusRule.STATE_UNTOLD, node.name, text, (node.state, state))

    # Heartbeats

    def _beats_of(self, node: ObservedNode) -> Beats:
        if node.node_id not in self._beats:
            self._beats[node.node_id] = Beats(node.number(HEARTBEAT_TIME) / 1000)
        return self._beats[node.node_id]

    def _beat(self, time: float, node: ObservedNode, state: NmtState) -> None:
        beats = self._beats_of(node)
        if node.state not in (None, state):
            beats.flips = beats.flips + 1 if state is beats.before else 0
            beats.before = node.state
            if beats.flips >= SURE and node.node_id not in self._told:
                states = f"{STATE_NAMES[state]} and {STATE_NAMES[beats.before or state]}"
                self._two(node, f"its heartbeats say by turns {states}", "states")
        if beats.last is not None and time > beats.last and not beats.lost:  # a log may have no times
            beats.add(time - beats.last)
            self._judge(node, beats, time - beats.last)
            if (periods := beats.series(time)) and not beats.is_of_two:
                every = " and ".join(brief(each) for each in periods)
                self._two(node, f"two series of heartbeats, every {every} (observed)", "heartbeats")
        self._lost(node.node_id, beats)
        beats.last = time
        beats.lost = False
        node.is_lost = False

    def _lost(self, node_id: int, beats: Beats) -> None:
        """Report a pending loss."""
        if beats.silence:
            text, seen = beats.silence
            beats.silence = None
            self.bus.found(BusRule.HEARTBEAT_LOST, self.bus.node(node_id).name, text, seen=seen)

    def _judge(self, node: ObservedNode, beats: Beats, last: float) -> None:
        """Check a node's last intervals; `last` is the latest, in s."""
        intervals = beats.intervals
        period = beats.period or beats.observed
        if last > LATE_AFTER * beats.usual and len(intervals) > SURE and not beats.is_of_two:
            text = f"a heartbeat after {brief(last)}, with a period of {brief(beats.usual)}"
            self.bus.found(BusRule.HEARTBEAT_LATE, node.name, text)
        if not period or len(intervals) < 2 * SURE:
            return
        is_paired = abs((last + intervals[-2]) / period - 1) < UNEVEN and beats.is_paired(period)
        is_changed = beats.period and abs(last / period - 1) > CHANGED
        if not (is_paired or is_changed):
            return
        shortest, longest = min(intervals), max(intervals)
        uneven = longest > (1 + CHANGED) * shortest
        if is_paired and (uneven or beats.observed):
            if not beats.is_of_two:
                self._two(node, f"two series of heartbeats, each every {brief(period)}", "heartbeats")
        elif is_changed and not uneven and (shortest / period - 1 > CHANGED or 1 - longest / period > CHANGED):
            text = f"a heartbeat every {brief(last)}, with 0x1017 = {period * 1000:g} ms"
            self.bus.found(BusRule.HEARTBEAT_CHANGED, node.name, text)

    def set_period(self, node: ObservedNode) -> None:
        """Update the heartbeat time of a node."""
        beats = self._beats_of(node)
        beats.period = node.number(HEARTBEAT_TIME) / 1000
        beats.restart(None)  # none is due, as the heartbeat may have been disabled

    @property
    def beating(self) -> list[Beats]:
        """Heartbeats that are due."""
        return [each for each in self._beats.values() if each.last is not None and not each.lost and each.usual]

    def tick(self, time: float) -> None:
        for node_id, beats in self._beats.items():
            if not beats.lost and beats.is_lost(time):
                node = self.bus.node(node_id)
                if self._is_of_program(node, beats):
                    beats.restart(None)
                    continue
                beats.lost = node.is_lost = True
                silence = f"no heartbeat for {LOST_AFTER:g} periods of {brief(beats.usual)}"
                state = f"; it was {STATE_NAMES[node.state]}" if node.state else ""
                beats.silence = f"{NodeChange.LOST.value}: {silence}{state}", Occurrences.once(self.bus.at())
            if beats.silence and beats.last is not None and time - beats.last > ENDS_WITHIN:
                self._lost(node_id, beats)
        for node_id, unclear in list(self._unclear.items()):
            if time - unclear.at > LOST_AFTER * unclear.period:
                del self._unclear[node_id]
                self.bus.found(unclear.rule, self.bus.node(node_id).name, unclear.text, seen=unclear.seen)
        for node in self.bus.nodes.values():
            if node.reset is not None and time - node.reset > BOOTS_WITHIN:
                node.reset = None
                self.bus.found(BusRule.NO_BOOT, node.name, f"no boot-up in {BOOTS_WITHIN:g} s after a reset")

    def _is_of_program(self, node: ObservedNode, beats: Beats) -> bool:
        """Return whether a heartbeat is that of a master's program, which ends when it has done its work.

        It began within the log, without the boot-up of a device, nothing else was sent, and no node consumes it.
        """
        began_here = beats.began - self.bus.began > LOST_AFTER * beats.usual
        if node.is_device or node.dictionary or not began_here:
            return False
        return not any(node.node_id in consumed_by(each) for each in self.bus.nodes.values())

    def gap(self, time: float) -> None:
        for beats in self.beating:
            beats.restart(time)
        self._booted.clear()
        self._unclear.clear()
        for node in self.bus.nodes.values():
            node.state = None

    def silent(self, time: float, consumer: ObservedNode) -> list[str]:
        """Return the nodes whose heartbeat a consumer misses at a time in s: those in its 0x1016, or else all."""
        wanted = consumed_by(consumer)
        found = []
        for node_id, beats in self._beats.items():
            is_due = beats.last is not None and beats.usual and time - beats.last > LATE_AFTER * beats.usual
            if is_due and node_id != consumer.node_id and (not wanted or node_id in wanted):
                found.append(f"{self.bus.node(node_id).name}, silent since {beats.last:.3f} s")
        return found

    def pause(self, until: float) -> None:
        """Expect no heartbeats until a time in s, as the bit rate changes."""
        for beats in self.beating:
            beats.restart(until)

    # Guarding

    def _is_beat(self, time: float, node: ObservedNode, frame: Frame) -> bool:
        """Return whether an apparent answer to node guarding is a heartbeat."""
        if frame.is_remote or frame.data[0] & TOGGLE:
            return False
        late = time - self._asked_at.get(node.node_id, time) > ANSWERS_WITHIN
        return late or self._beats_of(node).is_next(time)

    def _guard(self, time: float, node: ObservedNode, frame: Frame) -> None:
        if frame.is_remote:
            self._asked[node.node_id] = self._asked.get(node.node_id, 0) + 1
            self._asked_at[node.node_id] = time
            if self._asked[node.node_id] > 2:  # the last two were not answered
                lives = "; its heartbeats come, so it lives" if self._beats_of(node).came else ""
                self.bus.found(BusRule.GUARD_UNANSWERED, node.name, f"does not answer node guarding{lives}")
            return
        toggle = frame.data[0] & TOGGLE
        if toggle == self._toggles.get(node.node_id):
            text = f"two answers to node guarding with toggle {toggle // TOGGLE}"
            self.bus.found(BusRule.GUARD_TOGGLE, node.name, text)
        self._toggles[node.node_id], self._asked[node.node_id] = toggle, 0

    # The end

    def end(self, time: float) -> None:
        self.tick(time)
        for node_id, unclear in self._unclear.items():
            self.bus.found(unclear.rule, self.bus.node(node_id).name, unclear.text, seen=unclear.seen)
        for node in list(self.bus.nodes.values()):
            waiting = self._pre_operational.get(node.node_id)
            beats = self._beats_of(node)
            if not node.heard and node.dictionary and time - self.bus.began > LOST_AFTER:
                strangers = (each.node_id for each in self.bus.nodes.values() if each.heard and not each.dictionary)
                others = absence([node.node_id], strangers)
                text = f"is never heard (node-ID {node.node_id}){others and f': {others}'}"
                self.bus.found(BusRule.NEVER_HEARD, node.name, text)
            if waiting and time - waiting.places[0].time > BOOTS_WITHIN and node.node_id not in self._told:
                missed = f"; missed: {node.missed[1]}" if node.missed else ""
                text = f"stays {STATE_NAMES[NmtState.PRE_OPERATIONAL]} for {duration(time - node.since, 1)}{missed}"
                self.bus.found(BusRule.NOT_STARTED, node.name, text, seen=waiting)
            is_by_file = node.heard and beats.period and HEARTBEAT_TIME not in node.in_force()
            watched = self.bus.now - self.bus.began > max(LOST_AFTER * beats.period, PATIENCE)
            if is_by_file and watched and not beats.came:
                text = f"sends no heartbeat, with 0x1017 = {beats.period * 1000:g} ms"
                self.bus.found(BusRule.HEARTBEAT_CHANGED, node.name, text, cause=OFF_OR_ELSEWHERE)
            self._consumers(node)

    def _consumers(self, node: ObservedNode) -> None:
        """Compare the heartbeats that a node consumes (0x1016) with those that are sent."""
        if not node.heard:
            return
        known = set(node.in_force())
        if node.dictionary:
            known.update(node.dictionary.addresses())
        entries = (node.number(each) for each in sorted(known) if each[0] == CONSUMED_HEARTBEATS and each[1])
        for node_id, wait in ((entry >> 16 & 0x7F, (entry & 0xFFFF) / 1000) for entry in entries):
            beats = self._beats.get(node_id)
            if not wait or node_id not in NODE_IDS:
                continue
            producer = self.bus.node(node_id)
            if beats is None or not beats.came:
                if self.bus.now - self.bus.began < wait:  # it may come yet
                    continue
                text = f"waits for the heartbeat of {producer.name} (0x1016), which sends none"
                self.bus.found(BusRule.CONSUMER_UNFED, node.name, text, node_id)
            elif (period := beats.period or beats.observed or beats.shortest) >= wait:
                observed = "" if beats.period else " (observed)"
                sent = f"which sends a heartbeat every {brief(period)}{observed}"
                text = f"waits {brief(wait)} for {producer.name} (0x1016), {sent}"
                self.bus.found(BusRule.CONSUMER_SHORT, node.name, text, node_id)


# Emergencies

STORM = 10
"""Maximum number of emergencies of a node per second that is not reported."""

OPEN = 16
"""Maximum number of distinct open errors of a node; further ones count as the last of them."""

MISSING = (0x8100, 0x8130)
"""Error codes for a missed node: communication, life guarding or heartbeat (CiA 301, Table 26)."""

GENERIC = 1
"""Bit of the error register for any error (CiA 301, 7.5.2.2)."""


class EmergencyWatcher(Watcher):
    """Watches the errors that nodes report and clear."""

    SERVICES = (EMCY_NAME,)

    def __init__(self, bus: ObservedBus, nodes: NodesWatcher) -> None:
        super().__init__(bus)
        self._nodes = nodes
        self._open: dict[int, dict[int, tuple[str, Occurrences]]] = defaultdict(dict)
        self._times: dict[int, deque[float]] = defaultdict(partial(deque, maxlen=STORM + 1))

    def take(self, time: float, meaning: Meaning) -> None:
        said = meaning.fields
        if "code" not in said:
            return
        node = self.bus.node(said["node"])
        code = said["code"]
        register = said["register"]
        node.heard = node.is_device = True
        times, present = self._times[node.node_id], self._open[node.node_id]
        times.append(time)
        if len(times) > STORM and 0 < time - times[0] <= 1.0:
            self.bus.found(BusRule.EMCY_STORM, node.name, f"{len(times)} emergencies in a second")
        if not code:
            if not register:  # else other errors are left
                self._report(node, BusRule.EMCY_CLEARED)
                present.clear()
            return
        words = f"EMCY 0x{code:04X} {said['words']}"
        if not register & GENERIC:
            self.bus.found(BusRule.EMCY_REGISTER, node.name, f"{words} with register 0x{register:02X}", code)
        if code not in present and len(present) >= OPEN:
            code = next(reversed(present))
        silent = self._nodes.silent(time, node) if code in MISSING and code not in present else []
        if silent:
            node.missed = time, " and ".join(silent)
        missed = f"; missed: {' and '.join(silent)}" if silent else ""
        text = f"{words}, register 0x{register:02X}{missed}"
        present.setdefault(code, (text, Occurrences()))[1].add(self.bus.at())

    def _report(self, node: ObservedNode, rule: BusRule) -> None:
        for code, (text, seen) in self._open[node.node_id].items():
            self.bus.found(rule, node.name, text, code, seen=seen, cause=CAUSES.get(code, ""))

    def end(self, time: float) -> None:
        for node_id in list(self._open):
            self._report(self.bus.node(node_id), BusRule.EMCY_RAISED)


CAUSES = {
    0x8110: "it could not read or send frames as fast as they came",
    0x8120: "many transmissions fail: wiring, terminators or bit rate",
    0x8130: "it no longer hears the node whose heartbeat, or guarding, it waits for (0x1016, 0x100C)",
    0x8140: "it was bus-off: wiring, terminators or bit rate",
    0x8210: "another node sends it a PDO that is shorter than its own mapping",
    0x8220: "another node sends it a PDO that is longer than its own mapping",
    0x8240: "SYNC has another length than its 0x1019 says",
    0x8250: "a PDO that it receives stays away for longer than its event timer",
}
"""Likely causes of errors of CiA 301, Table 26."""


# LSS


class LssWatcher(Watcher):
    """Watches for devices left in LSS configuration state, and for changes of the bit rate."""

    SERVICES = (LSS,)

    def __init__(self, bus: ObservedBus, nodes: NodesWatcher) -> None:
        super().__init__(bus)
        self._nodes = nodes
        self._configured: Occurrences | None = None

    def take(self, time: float, meaning: Meaning) -> None:
        frame = meaning.raw
        assert isinstance(frame, Frame)
        is_answer = frame.cob_id == ANSWERS
        if not frame.is_remote and frame.data[0] == (Lss.SELECTED if is_answer else Lss.SWITCH_GLOBAL):
            is_configured = is_answer or frame.data[1] == LssState.CONFIGURATION
            self._configured = Occurrences.once(self.bus.at()) if is_configured else None
        elif not frame.is_remote and not is_answer and frame.data[0] == Lss.ACTIVATE_BIT_TIMING:
            # The bus is silent for the delay before the switch and the same time after it (CiA 305).
            self._nodes.pause(time + 2 * int.from_bytes(frame.data[1:3], "little") / 1000)

    def end(self, time: float) -> None:
        if self._configured:
            self.bus.found(BusRule.LSS_LEFT, "", "a device stays in LSS configuration state", seen=self._configured)
