"""Watches drives: fault, refused enabling, limits, modes, quick stop (CiA 402-2), with a file or without.

What an axis says comes by PDO, as mapped, or by SDO. A device without a file is a drive if 0x1000 says so, or if it
answers for its statusword and another object of CiA 402 (`od.profiles`). Each axis is judged by itself (CiA 402-2,
clause 6.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from eurobot_od.device.nmt import RESETS, STATE_NAMES
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import DriveCommand, Mode, State
from eurobot_od.od.values import ALL_NODES, NODE_IDS, PdoDirection
from eurobot_od.od.words import error_words
from eurobot_od.support.texts import amount
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Occurrences, Take, Watcher
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.services import EMCY_NAME, HEARTBEAT, NMT, SDO

ENABLED_WITHIN = 1.0
"""Timeout from the command to enable operation until the drive is enabled, in s."""

TOGETHER = 0.5
"""Time around the start of a fault in which an emergency, or a changed error code, belongs to it, in s."""

STANDS = 3.0
"""Time without motion after which a target is not reached any more, in s."""

FAULTS = (State.FAULT_REACTION, State.FAULT)

POSITION_MODES = (Mode.PROFILE_POSITION, Mode.CYCLIC_POSITION)
"""Modes in which bit 13 of the statusword is the following error (CiA 402-2, clauses 10 and 14)."""

WORDS_OF_DRIVES = frozenset(
    (cia402.ERROR_CODE, cia402.CONTROLWORD, cia402.STATUSWORD, cia402.MODE, cia402.MODE_DISPLAY,
     cia402.POSITION, cia402.TARGET_POSITION)
)  # fmt: skip
"""Watched objects, by their indices on the first axis."""

SIGNED = frozenset((cia402.MODE, cia402.MODE_DISPLAY, cia402.POSITION, cia402.TARGET_POSITION))

ENABLING_BITS: Mapping[int, str] = {0: "switch on", 1: "enable voltage", 2: "quick stop"}
"""Bits of the controlword that must be set together with bit 3, enable operation."""

DEFAULT_PDOS: Mapping[int, Sequence[Mapping[int, int]]] = {
    0x180: ({cia402.STATUSWORD: 16},),
    0x280: ({cia402.STATUSWORD: 16, cia402.MODE_DISPLAY: 8}, {cia402.STATUSWORD: 16, cia402.POSITION: 32}),
    0x380: ({cia402.STATUSWORD: 16, cia402.POSITION: 32},),
    0x200: ({cia402.CONTROLWORD: 16},),
    0x300: ({cia402.CONTROLWORD: 16, cia402.MODE: 8}, {cia402.CONTROLWORD: 16, cia402.TARGET_POSITION: 32}),
    0x400: ({cia402.CONTROLWORD: 16, cia402.TARGET_POSITION: 32},),
}
"""Default mappings of a drive's first PDOs: objects and their bits, by COB-ID (CiA 402-2, 7).

Of several the length of the frame says which.
"""

WIDE = 4
"""Size in bytes of a statusword or error code that has that of a second axis in its upper half."""


class MappedWord(NamedTuple):
    """An object of an axis in a PDO, with its position in bits."""

    axis: ObservedAxis
    object: int
    offset: int
    bits: int

    def value(self, frame: int) -> int:
        """Return its value in a frame given as one number."""
        return _signed(self.object, frame >> self.offset & (1 << self.bits) - 1, self.bits)


def _signed(index: int, raw: int, bits: int) -> int:
    return raw - (1 << bits) if index in SIGNED and raw >> bits - 1 else raw


@dataclass
class FaultSeen:
    """A fault that is not over: its start, the state and command before it.

    Its error `codes` are those that the axis has shown; an emergency `told` one of the device, of any of its axes.
    Bit 7 of the controlword, fault reset, `is_held` if it was commanded without a rising edge.
    """

    since: float
    seen: Occurrences
    before: State | None
    command: DriveCommand | None
    codes: dict[int, None] = field(default_factory=dict)
    told: dict[int, None] = field(default_factory=dict)
    resets: int = 0
    is_held: bool = False


class LastingBit(NamedTuple):
    """A statusword bit that is wrong if it lasts: rule, text, mask, minimum time in s, and condition."""

    rule: BusRule
    text: str
    mask: int
    at_least: float
    counts: Callable[[ObservedAxis], bool]


@dataclass(eq=False)
class ObservedAxis:
    """One axis of a drive: the known values of its objects with times, and open incidents."""

    node: ObservedNode
    number: int
    values: dict[int, int] = field(default_factory=dict)
    changed: dict[int, float] = field(default_factory=dict)
    by_pdo: set[int] = field(default_factory=set)
    state: State | None = None
    tried: set[DriveCommand] = field(default_factory=set)
    wanted: tuple[float, Occurrences] | None = None
    is_confirmed: bool = False
    fault: FaultSeen | None = None
    lasting: dict[BusRule, tuple[float, Occurrences]] = field(default_factory=dict)
    target: tuple[float, Occurrences] | None = None
    commander: str = ""

    @property
    def name(self) -> str:
        """Name in a sentence."""
        return f"axis {self.number}"

    @property
    def command(self) -> DriveCommand | None:
        """Last command to the axis."""
        word = self.values.get(cia402.CONTROLWORD)
        return None if word is None else DriveCommand.of(word)

    @property
    def mode(self) -> int | None:
        """Mode of operation that it shows, or else was commanded."""
        return self.values.get(cia402.MODE_DISPLAY, self.values.get(cia402.MODE))

    @property
    def is_enabled(self) -> bool:
        """Whether its state is Operation enabled."""
        return self.state is State.ENABLED

    @property
    def is_open(self) -> bool:
        """Whether the passing of time alone may cause a report, or its state is unknown."""
        return bool(self.state is None or self.wanted or self.lasting or self.fault or self.target)

    @property
    def is_halted(self) -> bool:
        """Whether it is enabled and halted by its controlword."""
        return self.is_enabled and bool(self.values.get(cia402.CONTROLWORD, 0) & cia402.HALT)


LASTING = (
    LastingBit(
        BusRule.DRIVE_FOLLOWING, "following error", cia402.BIT_13, 0.1, lambda axis: axis.mode in POSITION_MODES
    ),
    LastingBit(BusRule.DRIVE_HOMING, "homing error", cia402.BIT_13, 0.1, lambda axis: axis.mode == Mode.HOMING),
    LastingBit(BusRule.DRIVE_LIMIT, "internal limit active", cia402.INTERNAL_LIMIT, 1.0, lambda axis: axis.is_enabled),
    LastingBit(BusRule.DRIVE_WARNING, "warning", cia402.WARNING, 1.0, lambda axis: axis.state not in FAULTS),
)
"""Statusword bits that are wrong if they last."""


class DriveWatcher(Watcher):
    """Watches the axes of all drives of a bus."""

    SERVICES = NMT, HEARTBEAT, EMCY_NAME, SDO

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._axes: dict[tuple[int, int], ObservedAxis] = {}
        self._data: dict[int, bytes] = {}
        self._emergencies: dict[int, tuple[float, int]] = {}

    def listener(self, cob_id: int, meaning: Meaning) -> Take | None:
        self._data.pop(cob_id, None)
        words = tuple(self._mapped(cob_id)) or tuple(self._by_default(cob_id, len(meaning.raw[1])))
        # The statusword comes last, as some of its bits depend on the mode.
        words = tuple(sorted(words, key=lambda each: each.object == cia402.STATUSWORD))
        return partial(self._message, words) if words else None

    def take(self, time: float, meaning: Meaning) -> None:
        if meaning.name == SDO:
            self._transfer(time, meaning)
        elif meaning.name == EMCY_NAME:
            self._emergency(time, meaning)
        elif meaning.name == NMT and meaning.fields and _is_reset(meaning):
            self._restart(meaning.fields["node"], "an NMT reset")
        elif meaning.name == HEARTBEAT and isinstance(meaning.raw, Frame) and not meaning.raw.data[0]:
            self._restart(meaning.fields["node"], "a boot-up")

    def _restart(self, node_id: int, how: str) -> None:
        for (owner, _), axis in self._axes.items():
            if node_id in (owner, ALL_NODES):
                self._fault_over(axis, how)
                axis.values.clear()
                axis.state, axis.wanted, axis.target = None, None, None
                axis.lasting.clear()

    # What comes

    def _message(self, words: Sequence[MappedWord], time: float, meaning: Meaning) -> None:
        """Process a PDO with these objects."""
        assert isinstance(meaning.raw, Frame)
        cob_id, data = meaning.raw
        if self._data.get(cob_id) == data:
            for axis in dict.fromkeys(each.axis for each in words):
                if axis.wanted or axis.lasting or axis.fault:
                    self._judge(time, axis)
            return
        self._data[cob_id] = data
        number = int.from_bytes(data, "little")
        for word in words:
            if word.offset + word.bits <= 8 * len(data):
                word.axis.by_pdo.add(word.object)
                self._show(time, word.axis, word.object, word.value(number), meaning.sender)

    def _mapped(self, cob_id: int) -> Iterator[MappedWord]:
        """Yield the objects of drives that a PDO maps."""
        binding = self.bus.decoder.binding(cob_id)
        if binding is None or binding.layout.byte_order != "little":
            return
        is_sent = binding.pdo.direction is PdoDirection.TPDO
        names = binding.senders if is_sent else binding.receivers
        for node in filter(None, map(self.bus.named, names[:1])):
            for entry, (index, sub), _, offset in binding.placed:
                first = cia402.on_first_axis(index)
                if first in WORDS_OF_DRIVES and sub == 0:
                    yield MappedWord(self._axis(node, index), first, offset, entry.bits)

    def _by_default(self, cob_id: int, length: int) -> Iterator[MappedWord]:
        """Yield the default mapping of a drive's PDO, chosen by identifier and length."""
        node = self.bus.nodes.get(cob_id & NODE_IDS[-1])
        mappings = DEFAULT_PDOS.get(cob_id & ~NODE_IDS[-1], ())
        mapping = next((each for each in mappings if sum(each.values()) == 8 * length), None)
        if node is None or node.dictionary or mapping is None or not self._is_drive(node):
            return
        offset = 0
        for index, bits in mapping.items():
            yield MappedWord(self._axis(node, index), index, offset, bits)
            offset += bits

    def _transfer(self, time: float, meaning: Meaning) -> None:
        ended = meaning.transfer
        if ended is None or ended.end is None or ended.address is None or not ended.is_whole:
            return
        index, sub = ended.address
        node = self.bus.node(ended.end.server)
        content = ended.content
        first = cia402.on_first_axis(index)
        if first not in WORDS_OF_DRIVES or sub or content is None or ended.aborted is not None:
            return
        sender = "" if ended.is_upload else "an SDO client"
        for each, raw in _halves(first, content, index):
            value = _signed(first, raw, 8 * len(content))
            self._show(time, self._axis(node, each), first, value, sender)

    def _axis(self, node: ObservedNode, index: int) -> ObservedAxis:
        number = (index - cia402.FIRST_AXIS.start) // cia402.AXIS_STEP + 1
        return self._axes.setdefault((node.node_id, number), ObservedAxis(node, number))

    def axes(self, node_id: int) -> list[int]:
        """Return the numbers of a drive's axes, at least the first; none if the node is no drive."""
        if not self._is_drive(self.bus.node(node_id)):
            return []
        return sorted(number for owner, number in self._axes if owner == node_id) or [1]

    def _emergency(self, time: float, meaning: Meaning) -> None:
        said = meaning.fields
        if not said.get("code"):
            return
        self._emergencies[said["node"]] = time, said["code"]
        for (node_id, _), axis in self._axes.items():
            if node_id == said["node"] and axis.fault and time - axis.fault.since < TOGETHER:
                axis.fault.told.setdefault(said["code"])

    # What an axis shows

    def _show(self, time: float, axis: ObservedAxis, index: int, value: int, sender: str) -> None:
        before = axis.values.get(index)
        axis.values[index] = value
        if before == value and index == cia402.STATUSWORD and not axis.is_open:
            axis.is_confirmed = True  # most frames repeat the one before
            return
        if before != value:
            axis.changed[index] = time
        if index == cia402.STATUSWORD:
            self._status(time, axis, value)
        elif index == cia402.CONTROLWORD:
            self._control(time, axis, value, before or 0, sender)
        elif index == cia402.ERROR_CODE and value and axis.fault:
            axis.fault.codes.setdefault(value)
        elif index == cia402.MODE_DISPLAY:
            self._mode(time, axis)

    def _status(self, time: float, axis: ObservedAxis, word: int) -> None:
        state = State.of(word)
        if state is not axis.state:
            self._move(time, axis, state)
        axis.is_confirmed = True
        for each in LASTING:
            is_set = bool(word & each.mask) and each.counts(axis)
            if is_set:
                axis.lasting.setdefault(each.rule, (time, Occurrences.once(self.bus.at())))
            elif each.rule in axis.lasting:
                self._lasted(time, axis, each)
                del axis.lasting[each.rule]
        if word & cia402.TARGET_REACHED:
            axis.target = None
        self._judge(time, axis)

    def _move(self, time: float, axis: ObservedAxis, state: State | None) -> None:
        """Process a new state of an axis."""
        before = axis.state
        axis.state = state
        if state in FAULTS and axis.fault is None:
            self._fault(time, axis, before)
        elif axis.fault and state not in FAULTS:
            self._fault_over(axis, "")
        if state is State.QUICK_STOP:
            self._quick_stop(axis)
        if state is State.ENABLED or state in FAULTS:
            axis.wanted = None
        elif before is State.ENABLED and axis.command is DriveCommand.ENABLE and state not in (None, State.QUICK_STOP):
            now = state.words if state else ""
            text = f"{axis.name} leaves Operation enabled for {now}, though its command is Enable operation"
            self._report(axis, BusRule.DRIVE_DISABLED, text)
            axis.wanted = None
        if state is not State.ENABLED:
            axis.target = None
        axis.tried.clear()
        self._halt(time, axis)

    def _control(self, time: float, axis: ObservedAxis, word: int, before: int, sender: str) -> None:
        command = DriveCommand.of(word)
        axis.commander = sender or axis.commander
        if command:
            axis.tried.add(command)
        if axis.fault and command is DriveCommand.FAULT_RESET:
            axis.fault.is_held = bool(before & cia402.FAULT_RESET)
            axis.fault.resets += not axis.fault.is_held
        if not _wants_enabled(axis, word):
            axis.wanted = None
        elif axis.wanted is None and axis.state not in (State.ENABLED, *FAULTS):
            axis.wanted = (time, Occurrences.once(self.bus.at()))
            axis.is_confirmed = False
        is_set_point = word & ~before & cia402.NEW_SET_POINT and axis.mode == Mode.PROFILE_POSITION
        if is_set_point and axis.is_enabled:
            axis.target = time, Occurrences.once(self.bus.at())
        self._halt(time, axis)

    def _halt(self, time: float, axis: ObservedAxis) -> None:
        if axis.is_halted:
            axis.lasting.setdefault(BusRule.DRIVE_HALTED, (time, Occurrences.once(self.bus.at())))
        else:
            axis.lasting.pop(BusRule.DRIVE_HALTED, None)

    def _mode(self, time: float, axis: ObservedAxis) -> None:
        wanted = axis.values.get(cia402.MODE)
        shown = axis.values[cia402.MODE_DISPLAY]
        since = axis.changed.get(cia402.MODE, time)
        if wanted not in (None, shown) and axis.is_enabled and time - since > ENABLED_WITHIN:
            text = f"{axis.name} shows mode {_mode_words(shown)}, and was given {_mode_words(wanted or 0)}"
            self._report(axis, BusRule.DRIVE_MODE, text)

    # Faults

    def _fault(self, time: float, axis: ObservedAxis, before: State | None) -> None:
        is_held = bool(axis.values.get(cia402.CONTROLWORD, 0) & cia402.FAULT_RESET)
        axis.fault = FaultSeen(time, Occurrences.once(self.bus.at()), before, axis.command, is_held=is_held)
        at, code = self._emergencies.get(axis.node.node_id, (0.0, 0))
        if code and time - at < TOGETHER:
            axis.fault.told[code] = None
        code = axis.values.get(cia402.ERROR_CODE, 0)
        if code and time - axis.changed[cia402.ERROR_CODE] < TOGETHER:
            axis.fault.codes[code] = None

    def _fault_over(self, axis: ObservedAxis, how: str) -> None:
        """Report a fault that is over; `how` is empty if the axis itself shows the reason."""
        fault = axis.fault
        axis.fault = None
        if fault:
            self._say_fault(axis, fault, how or _what_ended(axis, fault))

    def _say_fault(self, axis: ObservedAxis, fault: FaultSeen, ended: str) -> None:
        span = self.bus.now - fault.since
        codes = [f"0x{each:04X} ({error_words(each, {}, cia402.PROFILE)})" for each in self._codes(axis, fault)]
        code = f"error code {', '.join(codes)}" if codes else "its error code (0x603F) is not in the log"
        before = f"before: {fault.before.words}" if fault.before else "it was so when first seen"
        text = f"{axis.name} is in Fault for {duration(span, 3)}, {code}; {before}; {ended}"
        is_old = fault.before is None and not ended.startswith("not ended")
        rule = BusRule.DRIVE_FAULT_RESET if is_old else BusRule.DRIVE_FAULT
        cause = f"the drive reports {', '.join(codes)}" if codes else ""
        self._report(axis, rule, text, fault.seen, cause=cause, subject=" ".join(codes))

    def _codes(self, axis: ObservedAxis, fault: FaultSeen) -> list[int]:
        """Return the error codes of an axis, without those of other axes of its device."""
        others = [each for each in self._axes.values() if each.node is axis.node and each is not axis]
        if not others:
            return list(fault.told | fault.codes)
        theirs = {each.values.get(cia402.ERROR_CODE) for each in others}
        return list(fault.codes or [each for each in fault.told if each not in theirs])

    def _quick_stop(self, axis: ObservedAxis) -> None:
        if axis.command is DriveCommand.QUICK_STOP:
            text = f"{axis.name} is in Quick stop active, as {axis.commander or 'a controlword'} commands"
            self._report(axis, BusRule.DRIVE_STOPPED, text)
        elif axis.command is not None:
            text = f"{axis.name} is in Quick stop active, though its command is {axis.command.words}"
            self._report(axis, BusRule.DRIVE_QUICK_STOP, text)

    # What lasts

    def _judge(self, time: float, axis: ObservedAxis) -> None:
        """Report an axis that should be enabled by now."""
        if axis.wanted and time - axis.wanted[0] > ENABLED_WITHIN and axis.is_confirmed and axis.state:
            text = f"{axis.name} stays {axis.state.words} after Enable operation: {_why_not_enabled(axis)}"
            (_, seen) = axis.wanted
            axis.wanted = None
            self._report(axis, BusRule.DRIVE_NOT_ENABLED, text, seen)

    def _lasted(self, time: float, axis: ObservedAxis, bit: LastingBit) -> None:
        since, seen = axis.lasting[bit.rule]
        if time - since >= bit.at_least:
            self._report(axis, bit.rule, f"{axis.name}: {bit.text} for {duration(time - since, 3)}", seen)

    def _report(
        self,
        axis: ObservedAxis,
        rule: BusRule,
        text: str,
        seen: Occurrences | None = None,
        *,
        cause: str = "",
        subject: str = "",
    ) -> None:
        if self._is_drive(axis.node):
            self.bus.found(rule, axis.node.name, text, (axis.number, subject), seen=seen, cause=cause)

    def _is_drive(self, node: ObservedNode) -> bool:
        """Return whether a node is a drive, judging by its file or by its objects."""
        return self.bus.decoder.errors.profiles.get(node.node_id, 0) == cia402.PROFILE

    def gap(self, time: float) -> None:
        self._data.clear()
        for axis in self._axes.values():
            axis.state, axis.wanted, axis.target = None, None, None
            axis.lasting.clear()

    def end(self, time: float) -> None:
        for axis in self._axes.values():
            if axis.fault:
                self._say_fault(axis, axis.fault, _not_ended(axis.fault))
            if axis.wanted and cia402.STATUSWORD in axis.by_pdo:
                axis.is_confirmed = True
            wanted = axis.wanted
            self._judge(time, axis)
            axis.wanted = wanted
            for each in LASTING:
                if each.rule in axis.lasting:
                    self._lasted(time, axis, each)
            self._ends_still(time, axis)
            if cia402.MODE_DISPLAY in axis.by_pdo:
                self._mode(time, axis)

    def _ends_still(self, time: float, axis: ObservedAxis) -> None:
        """Report an axis that was commanded to move but stands."""
        halted = axis.lasting.get(BusRule.DRIVE_HALTED)
        if halted and time - halted[0] > STANDS:
            rule, on_its_way = (BusRule.DRIVE_HELD, " on its way") if axis.target else (BusRule.DRIVE_HALTED, "")
            text = f"{axis.name} is halted{on_its_way} for {duration(time - halted[0], 1)}"
            self._report(axis, rule, f"{text}: bit 8 of its controlword is set", halted[1])
        moved = axis.changed.get(cia402.POSITION)
        if axis.target and moved is not None and time - max(moved, axis.target[0]) > STANDS:
            goal = axis.values.get(cia402.TARGET_POSITION)
            where = f"it stands at {axis.values[cia402.POSITION]}" + (f" of {goal}" if goal is not None else "")
            self._report(axis, BusRule.DRIVE_TARGET, f"{axis.name} does not reach its target: {where}", axis.target[1])


def _is_reset(meaning: Meaning) -> bool:
    return isinstance(meaning.raw, Frame) and not meaning.raw.is_remote and meaning.raw.data[0] in RESETS


def _halves(first: int, content: bytes, index: int) -> Iterator[tuple[int, int]]:
    """Yield the index and value of an object, and of a second axis in its upper half."""
    raw = int.from_bytes(content, "little")
    if first not in (cia402.STATUSWORD, cia402.ERROR_CODE) or len(content) != WIDE:
        yield index, raw
        return
    yield index, raw & 0xFFFF
    if raw >> 16:
        yield index + cia402.AXIS_STEP, raw >> 16


def _wants_enabled(axis: ObservedAxis, word: int) -> bool:
    """Return whether a controlword tries to enable operation, even with bits missing."""
    command = DriveCommand.of(word)
    if command is DriveCommand.ENABLE:
        return True
    is_stop = command is DriveCommand.QUICK_STOP and axis.state in (State.ENABLED, State.QUICK_STOP)
    return bool(word & 1 << 3) and not word & cia402.FAULT_RESET and not is_stop and axis.state is not State.ENABLED


def _why_not_enabled(axis: ObservedAxis) -> str:
    """Return the likely reason why a drive does not enable operation."""
    control = axis.values.get(cia402.CONTROLWORD, 0)
    status = axis.values.get(cia402.STATUSWORD, 0)
    missing = [f"{name} (bit {bit})" for bit, name in ENABLING_BITS.items() if not control >> bit & 1]
    arrow = cia402.ARROWS.get((axis.state, DriveCommand.ENABLE)) if axis.state else None
    if missing:
        return f"controlword 0x{control:04X} lacks {', '.join(missing)}"
    if not axis.node.is_operational and cia402.CONTROLWORD in axis.by_pdo:
        return f"the node is {STATE_NAMES[axis.node.state or 0]}, and takes no PDO"
    if axis.state is State.DISABLED and DriveCommand.SHUTDOWN not in axis.tried:
        return "Shutdown (0x0006) was left out: transition 2 comes first"
    if not status & cia402.REMOTE:
        return "statusword bit 9 (remote) is 0: it does not heed its controlword"
    if not status & cia402.VOLTAGE:
        return "statusword bit 4 is 0: its power stage has no voltage"
    if axis.state is State.READY and DriveCommand.SWITCH_ON not in axis.tried:
        return "Switch on (0x0007) was left out, and this drive does not do transition 3 by itself"
    number = f"transition {arrow.number} " if arrow else ""
    return (
        f"{number}is refused with voltage and controlword as they should be" if number else "it has no way from there"
    )


def _what_ended(axis: ObservedAxis, fault: FaultSeen) -> str:
    if fault.resets:
        return f"ended by Fault reset of {axis.commander or 'a master'}"
    return "ended without a Fault reset in the log"


def _not_ended(fault: FaultSeen) -> str:
    if fault.is_held and not fault.resets:
        return "not ended: Fault reset (bit 7) of the controlword is 1 all the time, and only its rising edge resets"
    if not fault.resets:
        return "not ended: no Fault reset is in the log"
    return f"not ended: {amount(fault.resets, 'Fault reset')} without effect"


def _mode_words(mode: int) -> str:
    return f"{mode} ({cia402.MODE_WORDS[mode]})" if mode in cia402.MODE_WORDS else str(mode)
