"""Watches nodes: boot-up, NMT, heartbeats, guarding, emergencies, LSS (CiA 301, 7.2.7, 7.2.8; CiA 305)."""

from __future__ import annotations

from collections import defaultdict, deque
from functools import partial
from itertools import pairwise

from eurobot_od.client.watch import LATE_AFTER, LOST_AFTER, NodeChange
from eurobot_od.device.nmt import COMMAND_NAMES, RESETS, STATE_NAMES, TARGET, TOGGLE, NmtState, boot_state
from eurobot_od.frame import Frame
from eurobot_od.od.standard import ANSWERS, CONSUMED_HEARTBEATS, HEARTBEAT_TIME, NMT_STARTUP, Lss, LssState
from eurobot_od.od.values import ALL_NODES, ERROR_CONTROL_BASE, NODE_IDS
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Occurrences, Watcher, brief
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.services import GUARDING, NMT

OBEYS_WITHIN = 0.5
"""Seconds after an NMT command in which a heartbeat may still have the state before."""

BOOTS_WITHIN = 5.0
"""Seconds that a node has to boot up after a reset, and to be started after it was heard first."""

TOGETHER = 0.5
"""Two boot-ups of one node-ID in so many seconds after one reset are those of two nodes."""

SURE = 3
"""So often a heartbeat has to contradict the one before until it is taken for another node's."""

PATIENCE = 1.0
"""Seconds in which no heartbeat is missed until three have shown their period."""

CHANGED, UNEVEN = 0.25, 0.2
"""Shares of a heartbeat's period: it comes at another one, is one of two series."""

OFF_OR_ELSEWHERE = "its heartbeat is switched off, or it sends it under another node-ID"
"""Why a node that is there likely sends no heartbeat."""


class Beats:
    """The heartbeats of a node: the `period` that its settings say in s, 0 for none, and when the `last` one came.

    `last` is None while none is due. `before` is the state before the last one, `flips` how often it came back.
    """

    def __init__(self, period: float) -> None:
        self.period, self.last, self.lost = period, None, False
        self.intervals: deque[float] = deque(maxlen=2 * SURE)
        self.before: NmtState | None = None
        self.flips = 0

    last: float | None

    @property
    def usual(self) -> float:
        """The period by the settings, or by what came if that is longer; 0 if nothing says it."""
        is_known = len(self.intervals) >= SURE
        # The last but one: a single long silence does not change it, and two nodes' heartbeats come unevenly.
        return max(self.period, sorted(self.intervals)[-2] if is_known else 0.0)

    def is_lost(self, now: float) -> bool:
        """Whether the next one should have come by now."""
        least = 0.0 if len(self.intervals) >= SURE else PATIENCE  # a device may have another period than its file
        return self.last is not None and self.usual > 0 and now - self.last > max(LOST_AFTER * self.usual, least)

    @property
    def came(self) -> bool:
        """Whether there was any."""
        return bool(self.last is not None or self.intervals or self.lost)

    def restart(self, last: float | None) -> None:
        """Begin anew: one is due after `last`, or none."""
        self.last, self.lost, self.flips = last, False, 0
        self.intervals.clear()


class NodesWatcher(Watcher):
    """Watches NMT commands, boot-ups, heartbeats, and node guarding."""

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._told: dict[int, tuple[int, float]] = {}
        self._wanted: dict[int, NmtState] = {}
        self._booted: dict[int, float] = {}
        self._beats: dict[int, Beats] = {}
        self._toggles: dict[int, int | None] = {}
        self._asked: dict[int, int] = {}
        self._pre_operational: dict[int, Occurrences] = {}

    def take(self, time: float, meaning: Meaning) -> None:
        frame = meaning.raw
        assert isinstance(frame, Frame)
        if meaning.name == NMT:
            if not frame.is_remote:
                self._command(time, *frame.data)
            return
        node = self.bus.node(frame.cob_id - ERROR_CONTROL_BASE)
        if meaning.name == GUARDING:
            self._guard(node, frame)
        if not frame.is_remote:
            node.heard = True
            state = frame.data[0] & ~TOGGLE
            if state == NmtState.INITIALISING:
                self._boot(time, node)
            elif state in set(NmtState):
                self._state(time, node, NmtState(state), meaning.name == GUARDING)

    # NMT

    def _command(self, time: float, command: int, node_id: int) -> None:
        heard = [each for each in self.bus.nodes.values() if each.heard]
        for node in heard if node_id == ALL_NODES else [self.bus.node(node_id)] if node_id in NODE_IDS else []:
            self._beats_of(node).flips = 0
            if command in RESETS:
                node.reset, node.state = time, None
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
        last, self._booted[node.node_id] = self._booted.get(node.node_id), time
        if node.reset is not None:
            node.reset = None
        elif last is not None and time - last < TOGETHER and node.state is None:
            self.bus.found(BusRule.TWO_NODES, node.name, "two boot-ups come after one start")
        elif node.state is NmtState.OPERATIONAL:
            self.bus.found(BusRule.BOOTS_OPERATIONAL, node.name, f"{NodeChange.BOOTED.value} while it was operational")
        elif last is not None or node.state is not None:
            self.bus.found(BusRule.BOOTS_AGAIN, node.name, f"{NodeChange.BOOTED.value} again without a reset")
        node.booted, node.state, node.since = True, None, time
        self._forget_orders(node)
        self._toggles[node.node_id] = None
        self._beats_of(node).restart(time)

    def _state(self, time: float, node: ObservedNode, state: NmtState, is_guarding: bool) -> None:
        if not is_guarding:
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
        """Look at a state that nobody has commanded: the first one after a boot-up, or one after another."""
        text = f"goes from {STATE_NAMES[node.state or 0]} to {STATE_NAMES[state]} without a command"
        starts = node.dictionary and boot_state(node.dictionary.default(NMT_STARTUP))
        is_first = state is NmtState.OPERATIONAL is not starts and self._booted.get(node.node_id) == node.since
        if node.state is not None or (starts and is_first):
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
                self.bus.found(BusRule.TWO_NODES, node.name, f"says by turns that it is {states}", "states")
        if beats.last is not None and time > beats.last and not beats.lost:  # a log may have no times
            beats.intervals.append(time - beats.last)
            self._judge(node, beats)
        beats.last, beats.lost = time, False

    def _judge(self, node: ObservedNode, beats: Beats) -> None:
        """Look at a node's last intervals."""
        *others, last = beats.intervals
        if len(others) >= SURE and last > LATE_AFTER * (usual := beats.usual):
            text = f"a heartbeat after {brief(last)}, with a period of {brief(usual)}"
            self.bus.found(BusRule.HEARTBEAT_LATE, node.name, text)
        if not beats.period or len(beats.intervals) < 2 * SURE:
            return
        period, uneven = beats.period, max(beats.intervals) > (1 + CHANGED) * min(beats.intervals)
        pairs = [one + two for one, two in pairwise(beats.intervals)]
        if uneven and all(abs(each / period - 1) < UNEVEN for each in pairs):
            text = f"two series of heartbeats, each every {brief(period)}"
            self.bus.found(BusRule.TWO_NODES, node.name, text, "heartbeats")
        elif not uneven and all(abs(each / period - 1) > CHANGED for each in beats.intervals):
            text = f"a heartbeat every {brief(last)}, with 0x1017 = {period * 1000:g} ms"
            self.bus.found(BusRule.HEARTBEAT_CHANGED, node.name, text)

    def set_period(self, node: ObservedNode) -> None:
        """Take in that a node has another heartbeat time now."""
        beats = self._beats_of(node)
        beats.period = node.number(HEARTBEAT_TIME) / 1000
        beats.restart(None)  # until the next one: it may also have been switched off

    @property
    def beating(self) -> list[Beats]:
        """The heartbeats that are due."""
        return [each for each in self._beats.values() if each.last is not None and not each.lost and each.usual]

    def tick(self, time: float) -> None:
        for node_id, beats in self._beats.items():
            if not beats.lost and beats.is_lost(time):
                beats.lost = True
                node = self.bus.node(node_id)
                silence = f"no heartbeat for {LOST_AFTER:g} periods of {brief(beats.usual)}"
                state = f"; it was {STATE_NAMES[node.state]}" if node.state else ""
                self.bus.found(BusRule.HEARTBEAT_LOST, node.name, f"{NodeChange.LOST.value}: {silence}{state}")
        for node in self.bus.nodes.values():
            if node.reset is not None and time - node.reset > BOOTS_WITHIN:
                node.reset = None
                self.bus.found(BusRule.NO_BOOT, node.name, f"no boot-up in {BOOTS_WITHIN:g} s after a reset")

    def gap(self, time: float) -> None:
        for beats in self.beating:
            beats.restart(time)
        self._booted.clear()
        for node in self.bus.nodes.values():
            node.state = None

    # Guarding

    def _guard(self, node: ObservedNode, frame: Frame) -> None:
        if frame.is_remote:
            self._asked[node.node_id] = self._asked.get(node.node_id, 0) + 1
            if self._asked[node.node_id] > 2:  # the last two were not answered
                self.bus.found(BusRule.GUARD_UNANSWERED, node.name, "does not answer node guarding")
            return
        toggle = frame.data[0] & TOGGLE
        if toggle == self._toggles.get(node.node_id):
            text = f"two answers to node guarding with toggle {toggle // TOGGLE}"
            self.bus.found(BusRule.GUARD_TOGGLE, node.name, text)
        self._toggles[node.node_id], self._asked[node.node_id] = toggle, 0

    # The end

    def end(self, time: float) -> None:
        self.tick(time)
        for node in list(self.bus.nodes.values()):
            waiting, beats = self._pre_operational.get(node.node_id), self._beats_of(node)
            if not node.heard and node.dictionary and time - self.bus.began > LOST_AFTER:
                self.bus.found(BusRule.NEVER_HEARD, node.name, f"is never heard (node-ID {node.node_id})")
            if waiting and time - waiting.places[0].time > BOOTS_WITHIN and node.node_id not in self._told:
                text = f"stays {STATE_NAMES[NmtState.PRE_OPERATIONAL]} for {duration(time - node.since, 1)}"
                self.bus.found(BusRule.NOT_STARTED, node.name, text, seen=waiting)
            is_by_file = node.heard and beats.period and HEARTBEAT_TIME not in node.in_force()
            watched = self.bus.now - self.bus.began > max(LOST_AFTER * beats.period, PATIENCE)
            if is_by_file and watched and not beats.came:
                text = f"sends no heartbeat, with 0x1017 = {beats.period * 1000:g} ms"
                self.bus.found(BusRule.HEARTBEAT_CHANGED, node.name, text, cause=OFF_OR_ELSEWHERE)
            self._consumers(node)

    def _consumers(self, node: ObservedNode) -> None:
        """Compare what a node waits for (0x1016) with what its producers send."""
        known = {*node.in_force(), *(node.dictionary.addresses() if node.dictionary else ())} if node.heard else set()
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
            elif (period := producer.number(HEARTBEAT_TIME) / 1000) >= wait:
                sent = f"which sends a heartbeat every {brief(period)}"
                text = f"waits {brief(wait)} for {producer.name} (0x1016), {sent}"
                self.bus.found(BusRule.CONSUMER_SHORT, node.name, text, node_id)


# Emergencies

STORM = 10
"""More emergencies of a node in a second are a storm."""

OPEN = 16
"""Most different errors of a node that are kept open; more are counted as the last of them."""

GENERIC = 1
"""Bit of the error register that is set while there is any error (CiA 301, 7.5.2.2)."""


class EmergencyWatcher(Watcher):
    """Watches which errors nodes report, and which of them they take back."""

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._open: dict[int, dict[int, tuple[str, Occurrences]]] = defaultdict(dict)
        self._times: dict[int, deque[float]] = defaultdict(partial(deque, maxlen=STORM + 1))

    def take(self, time: float, meaning: Meaning) -> None:
        said = meaning.fields
        if "code" not in said:
            return
        node, code, register = self.bus.node(said["node"]), said["code"], said["register"]
        node.heard = True
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
        present.setdefault(code, (f"{words}, register 0x{register:02X}", Occurrences()))[1].add(self.bus.at())

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
"""Why a node likely reports an error of CiA 301, Table 26."""


# LSS


class LssWatcher(Watcher):
    """Watches that devices do not stay in LSS configuration state."""

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._configured: Occurrences | None = None

    def take(self, time: float, meaning: Meaning) -> None:
        frame = meaning.raw
        assert isinstance(frame, Frame)
        is_answer = frame.cob_id == ANSWERS
        if not frame.is_remote and frame.data[0] == (Lss.SELECTED if is_answer else Lss.SWITCH_GLOBAL):
            is_configured = is_answer or frame.data[1] == LssState.CONFIGURATION
            self._configured = Occurrences.once(self.bus.at()) if is_configured else None

    def end(self, time: float) -> None:
        if self._configured:
            self.bus.found(BusRule.LSS_LEFT, "", "a device stays in LSS configuration state", seen=self._configured)
