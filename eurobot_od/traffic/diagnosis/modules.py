"""Watches I/O modules: inputs that flutter, that are at the end of their range, or that send nothing (CiA 401-1).

What an input says comes by PDO, as mapped, or as CiA 401 maps it by default.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from eurobot_od.frame import Frame
from eurobot_od.od import cia401
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import NODE_IDS, Address, PdoDirection, label
from eurobot_od.pdo.binding import Binding
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.diagnosis.incidents import ObservedBus, ObservedNode, Occurrences, Take, Watcher
from eurobot_od.traffic.diagnosis.pdos import OF_EVENTS
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.services import SDO

FLUTTER = 20
"""Maximum number of changes per second of an input that a person operates."""

STAYS = 1.0
"""Minimum time at the end of the range for an analogue input to be reported, in s."""

DIGITAL = frozenset(each.value for each in cia401.DIGITAL_INPUTS)
ANALOGUE = frozenset(each.value for each in cia401.ANALOGUE_INPUTS)

ENABLES: Mapping[Address, tuple[frozenset[int], str]] = {
    (cia401.INTERRUPT_ENABLE, 0): (DIGITAL, "digital inputs"),
    (cia401.ANALOGUE_INTERRUPT_ENABLE, 0): (ANALOGUE, "analogue inputs"),
}
"""Objects that enable PDOs on changes of inputs: the inputs' indices and their name."""

DEFAULT_PDOS: Mapping[int, tuple[int, int, int]] = {
    0x180: (0x6000, 1, 8), 0x280: (0x6401, 1, 16), 0x380: (0x6401, 5, 16), 0x480: (0x6401, 9, 16),
}  # fmt: skip
"""Default mappings of TPDOs by COB-ID: object, first sub-index and bits (CiA 401-1)."""


class MappedInput(NamedTuple):
    """An input object in a PDO: the module, its address, and its position in bits."""

    node: ObservedNode
    address: Address
    offset: int
    bits: int

    def value(self, frame: int) -> int:
        """Return its raw value in a frame given as one number."""
        return frame >> self.offset & (1 << self.bits) - 1

    @property
    def ends(self) -> tuple[int, int]:
        """Lowest and highest value of a signed analogue input, as raw values."""
        return 1 << self.bits - 1, (1 << self.bits - 1) - 1


class ModuleWatcher(Watcher):
    """Watches the inputs of all I/O modules of a bus."""

    SERVICES = (SDO,)

    def __init__(self, bus: ObservedBus) -> None:
        super().__init__(bus)
        self._data: dict[int, bytes] = {}
        self._changes = defaultdict[tuple[int, Address, int], deque[float]](partial(deque, maxlen=FLUTTER + 1))
        self._at_end: dict[tuple[int, Address], tuple[float, int, Occurrences]] = {}
        self._enabled: dict[tuple[int, Address], bool] = {}

    def listener(self, cob_id: int, meaning: Meaning) -> Take | None:
        self._data.pop(cob_id, None)
        inputs = tuple(self._mapped(cob_id)) or tuple(self._by_default(cob_id, len(meaning.raw[1])))
        return partial(self._message, inputs) if inputs else None

    def take(self, time: float, meaning: Meaning) -> None:
        ended = meaning.transfer
        if ended and ended.end and ended.address and ended.address in ENABLES and ended.content is not None:
            self._enabled[ended.end.server, ended.address] = any(ended.content)

    def _message(self, inputs: Sequence[MappedInput], time: float, meaning: Meaning) -> None:
        """Process a PDO with these inputs."""
        assert isinstance(meaning.raw, Frame)
        cob_id, data = meaning.raw
        before = self._data.get(cob_id)
        self._data[cob_id] = data
        if before == data:
            return
        number = int.from_bytes(data, "little")
        former = number if before is None else int.from_bytes(before, "little")
        for each in inputs:
            if each.offset + each.bits > 8 * len(data):
                continue
            if each.address[0] in DIGITAL:
                self._switched(time, each, each.value(number) ^ each.value(former))
            else:
                self._measured(time, each, each.value(number))

    def _mapped(self, cob_id: int) -> Iterator[MappedInput]:
        """Yield the inputs that a TPDO maps."""
        binding = self.bus.decoder.binding(cob_id)
        if binding is None or binding.layout.byte_order != "little" or binding.pdo.direction is not PdoDirection.TPDO:
            return
        for node in filter(None, map(self.bus.named, binding.senders[:1])):
            if not self._is_module(node):
                continue
            for entry, (index, sub), _, offset in binding.placed:
                if index in DIGITAL | ANALOGUE and sub:
                    yield MappedInput(node, (index, sub), offset, entry.bits)

    def _by_default(self, cob_id: int, length: int) -> Iterator[MappedInput]:
        """Yield the default mapping of a TPDO of a module without a file."""
        node = self.bus.nodes.get(cob_id & NODE_IDS[-1])
        if node is None or node.dictionary or not self._is_module(node) or cob_id & ~NODE_IDS[-1] not in DEFAULT_PDOS:
            return
        index, first, bits = DEFAULT_PDOS[cob_id & ~NODE_IDS[-1]]
        for number in range(8 * length // bits):
            yield MappedInput(node, (index, first + number), number * bits, bits)

    def _is_module(self, node: ObservedNode) -> bool:
        return self.bus.decoder.errors.profiles.get(node.node_id, 0) == cia401.PROFILE

    def _switched(self, time: float, each: MappedInput, changed: int) -> None:
        """Count the changes of digital inputs."""
        for bit in range(each.bits):
            if changed >> bit & 1:
                times = self._changes[each.node.node_id, each.address, bit]
                times.append(time)
                if len(times) > FLUTTER and 0 < time - times[0] <= 1.0:
                    place = (each.address[1] - 1) * each.bits + bit + 1
                    text = f"input {place} ({label(each.address)}, bit {bit}) changes {FLUTTER} times in a second"
                    self.bus.found(BusRule.INPUT_FLUTTERS, each.node.name, text, (each.address, bit))
                    times.clear()  # reported again only after as many changes, to save time

    def _measured(self, time: float, each: MappedInput, value: int) -> None:
        """Check whether an analogue input reaches or leaves an end of its range."""
        key = each.node.node_id, each.address
        if key in self._at_end and self._at_end[key][1] != value:
            self._stayed(time, *key)
        if value in each.ends:
            self._at_end.setdefault(key, (time, value, Occurrences.once(self.bus.at())))

    def _stayed(self, time: float, node_id: int, address: Address) -> None:
        since, value, seen = self._at_end.pop((node_id, address))
        if time - since >= STAYS:
            text = f"channel {address[1]} ({label(address)}) is 0x{value:X} for {duration(time - since, 1)}"
            self.bus.found(BusRule.INPUT_AT_END, self.bus.node(node_id).name, text, address, seen=seen)

    def gap(self, time: float) -> None:
        self._data.clear()
        self._at_end.clear()
        self._changes.clear()

    def end(self, time: float) -> None:
        for key, at_end in list(self._at_end.items()):
            self._stayed(time, *key)
            self._at_end[key] = at_end
        for node in list(self.bus.nodes.values()):
            if node.heard and node.state and node.is_operational and self._is_module(node):
                self._silent(node)

    def _silent(self, node: ObservedNode) -> None:
        """Report inputs that cause no PDO because their interrupt is disabled."""
        for address, (objects, words) in ENABLES.items():
            by_file = node.dictionary.number(address) if node.dictionary else None
            is_on = self._enabled.get((node.node_id, address), by_file != 0)
            waits = any(self._waits(each.pdo, objects) for each in self._sent(node)) or not node.dictionary
            if not is_on and waits:
                text = f"its {words} cause no PDO: {label(address)} is 0"
                self.bus.found(BusRule.INPUTS_OFF, node.name, text, address)

    def _sent(self, node: ObservedNode) -> Iterator[Binding]:
        """Yield the TPDOs of a node that have not been received."""
        for each in self.bus.decoder.protocol.bindings:
            if node.name in each.senders[:1] and each.cob_id not in self.bus.listeners:
                yield each

    @staticmethod
    def _waits(pdo: Pdo, objects: frozenset[int]) -> bool:
        """Return whether a PDO is sent only on changes of certain inputs."""
        is_of_events = pdo.transmission_type in OF_EVENTS and not pdo.event_timer
        return is_of_events and any(each.address[0] in objects for each in pdo.mapping)
