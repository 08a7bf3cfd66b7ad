"""The PDOs of a running device: changed over SDO by CiA 301's procedure, swapped whole, their values in the objects.

Rule of this file: there is always one complete `protocol`. A change is built beside it and takes its place in one step,
or is refused and leaves no trace (CiA 301, 7.5.2.35 to 7.5.2.38: invalidate, sub0 = 0, entries, sub0 = n, validate).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from itertools import accumulate
from math import inf

from eurobot_od.device.objects import EMCY_COB_ID, Objects, OnWrite
from eurobot_od.device.sync import PRODUCER, SYNC, SYNCHRONOUS
from eurobot_od.errors import MappingError
from eurobot_od.frame import Frame
from eurobot_od.od import values
from eurobot_od.od.pdos import MappedObject
from eurobot_od.od.values import DUMMIES, MAPPABLE, Address, PdoDirection, Value, owner
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.catalogue import Catalogue
from eurobot_od.pdo.layout import MAX_BITS
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.sdo.wire import Abort, AbortCode

REFUSED = (*values.RESTRICTED, values.CIA_EXTENSIONS)
"""Identifiers that no PDO may have; the low restricted ones are allowed, as this protocol has its messages there."""

EVENT_DRIVEN = (254, 255)
"""Transmission types that need no SYNC (CiA 301, Tables 68 and 72)."""

COB_ID, TRANSMISSION_TYPE, INHIBIT_TIME, EVENT_TIMER = 1, 2, 3, 5
"""Sub-indices of a communication record (CiA 301, Tables 66 and 70)."""


class Pdos:
    """The PDOs as they are configured now, by the values in `objects`.

    `protocol` are the messages of the valid ones, `received` the bindings of its RPDOs by COB-ID, `sent` those of its
    TPDOs by message type, `always_sent` the COB-IDs of those that act in every NMT state. `unusable` says what is wrong
    with those that the file does not describe well, by index.
    """

    def __init__(self, objects: Objects, catalogue: Catalogue) -> None:
        self._objects, self._catalogue = objects, catalogue
        self.unusable: dict[int | None, MappingError] = {}
        # A PDO that the file does not describe well is left out, and the others work.
        self._apply(self._built(objects.value, lambda error: self.unusable.update({error.index: error})))

    def _built(self, value: Callable[[Address], Value], harm: Callable[[MappingError], object]) -> Protocol:
        """Return the messages by these values of objects; `harm` is told of what does not hold, and may raise that."""
        dictionary = self._objects.dictionary
        return Protocol([(dictionary, dictionary.read_pdos(value, harm))], self._catalogue, harm)

    def _refuse_new_harm(self, error: MappingError) -> None:
        """Refuse a change that does more harm than there is already."""
        if error.index not in self.unusable:
            raise error

    def _apply(self, protocol: Protocol) -> None:
        ours = self._objects.dictionary.name
        self.received = {each.cob_id: each for each in protocol.bindings if ours in each.receivers}
        self.sent = {each.type: each for each in protocol.bindings if ours in each.senders}
        self.always_sent = {each.cob_id for each in self.sent.values() if each.always}
        self.protocol = protocol

    def inhibit_time(self, binding: Binding) -> float:
        """Return the seconds from a TPDO to the next one, 0.0 for no inhibit time; what acts always never waits."""
        return 0.0 if binding.always else self._objects.raw((binding.pdo.index, INHIBIT_TIME)) / 10_000

    def event_timer(self, binding: Binding) -> float:
        """Return after how many seconds without an event a TPDO is sent; 0.0 if it is not, or if it follows SYNC."""
        if self.sync_type(binding) is not None:
            return 0.0
        return self._objects.raw((binding.pdo.index, EVENT_TIMER)) / 1000

    # SYNC

    @property
    def sync_cob_id(self) -> int | None:
        """The COB-ID of SYNC, None if the device has no object for it."""
        return self._objects.raw(SYNC) & values.BASE_IDENTIFIER if SYNC[0] in self._objects.dictionary.members else None

    def sync_type(self, binding: Binding) -> int | None:
        """Return the transmission type of a PDO that follows SYNC, None for another; what acts always never waits."""
        number = self._objects.raw((binding.pdo.index, TRANSMISSION_TYPE))
        return number if number in self._sync_types and not binding.always else None

    @property
    def _sync_types(self) -> range:
        return SYNCHRONOUS if self.sync_cob_id is not None else range(0)

    def _write_sync(self, address: Address, value: Value) -> None:
        number = value if isinstance(value, int) else 0
        if number & (PRODUCER | values.EXTENDED):
            raise Abort(AbortCode.VALUE, "it sends no SYNC, and hears one in base frames only")
        self._objects.put(address, number)

    # Written over SDO

    def writers(self) -> dict[int, OnWrite]:
        """Return what writing the COB-ID of SYNC and a record of a PDO does, by the index."""
        members = self._objects.dictionary.members
        records = [n for each in PdoDirection for n in range(each.value, each.value + values.PDO_COUNT) if n in members]
        mappings = [index + values.MAPPING_OFFSET for index in records]
        return {
            SYNC[0]: self._write_sync,
            **dict.fromkeys(records, self._write_communication),
            **dict.fromkeys(mappings, self._write_mapping),
        }

    def _write_communication(self, address: Address, value: Value) -> None:
        index, subindex = address
        number = value if isinstance(value, int) else 0
        if subindex == COB_ID:
            self._write_cob_id(index, number)
            return
        if subindex == TRANSMISSION_TYPE and number not in (*EVENT_DRIVEN, *self._sync_types):
            raise Abort(AbortCode.VALUE, "event-driven, or by SYNC if the device has one")
        if subindex in (INHIBIT_TIME, EVENT_TIMER) and number and index < PdoDirection.TPDO.value:
            raise Abort(AbortCode.VALUE, "an RPDO has no times")  # of ours: it watches no deadline
        if subindex == INHIBIT_TIME and self._is_valid(index):
            raise Abort(AbortCode.STATE, "the PDO is valid")
        self._objects.put(address, number)

    def _is_valid(self, index: int) -> bool:
        return not self._objects.raw((index, COB_ID)) & values.NOT_VALID

    def _write_cob_id(self, index: int, entry: int) -> None:
        """Change validity and identifier; the identifier of a PDO that is and stays valid is fixed."""
        address = index, COB_ID
        valid = not entry & values.NOT_VALID
        if entry & ~(values.NOT_VALID | values.NO_RTR | values.BASE_IDENTIFIER):
            raise Abort(AbortCode.VALUE, "base frames only")
        if valid and self._is_valid(index) and entry != self._objects.raw(address):
            raise Abort(AbortCode.STATE, "the PDO is valid")
        cob_id = entry & values.BASE_IDENTIFIER
        if valid and (cob_id in (self._objects.raw(EMCY_COB_ID), self.sync_cob_id) or owner(cob_id, REFUSED)):
            raise Abort(AbortCode.VALUE, "an identifier that CANopen itself uses")
        try:
            protocol = self._built(lambda a: entry if a == address else self._objects.value(a), self._refuse_new_harm)
        except MappingError as error:
            raise Abort(AbortCode.INCOMPATIBLE, str(error)) from error
        self._objects.put(address, entry)
        self._apply(protocol)

    def _write_mapping(self, address: Address, value: Value) -> None:
        index, subindex = address
        number = value if isinstance(value, int) else 0
        if self._is_valid(index - values.MAPPING_OFFSET):
            raise Abort(AbortCode.STATE, "the PDO is valid")
        if subindex == 0:
            entries = (self._objects.raw((index, sub)) for sub in range(1, number + 1))
            if sum(self._mapped(index, entry).bits for entry in entries) > MAX_BITS:
                raise Abort(AbortCode.MAPPING_TOO_LONG)
        elif self._objects.raw((index, 0)):
            raise Abort(AbortCode.STATE, "the mapping is in use: sub-index 0 is not 0")
        elif number:
            self._mapped(index, number)
        self._objects.put(address, number)

    def _mapped(self, index: int, entry: int) -> MappedObject:
        """Return what a mapping entry stands for; raises Abort if that cannot be mapped there."""
        direction = PdoDirection(index - values.MAPPING_OFFSET & ~(values.PDO_COUNT - 1))
        dictionary = self._objects.dictionary
        variable = dictionary.variable((entry >> 16, entry >> 8 & 0xFF))
        if variable is None:
            raise Abort(AbortCode.NO_OBJECT)
        dummy = variable.index in DUMMIES and direction is PdoDirection.RPDO
        if not dummy and not (variable.pdo_mappable and variable.access_type in MAPPABLE[direction]):
            raise Abort(AbortCode.NOT_MAPPABLE)
        try:
            return dictionary.mapped_object(index, entry)
        except MappingError as error:
            raise Abort(AbortCode.NOT_MAPPABLE, str(error)) from error


class ProcessData:
    """What PDOs carry, in the objects: each frame's values are stored together, when somebody asks for one of them."""

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self._latest: dict[str, tuple[Binding, bytes]] = {}

    def note(self, binding: Binding, data: bytes) -> None:
        """Remember the newest frame of a message; `data` has a length that the mapping allows."""
        self._latest.pop(binding.name, None)
        self._latest[binding.name] = binding, data

    def settle(self) -> None:
        """Bring the values of the frames noted into the objects, in the order in which they came."""
        for binding, data in self._latest.values():
            word = int.from_bytes(binding.complete(data), "little")
            for entry, offset in _placed(binding):
                self._objects.put((entry.index, entry.subindex), word >> offset & (1 << entry.bits) - 1)
        self.forget()

    def forget(self) -> None:
        """Drop what has not been asked for."""
        self._latest.clear()

    def frame(self, binding: Binding) -> Frame:
        """Return a TPDO with the objects' present values."""
        self.settle()
        word = 0
        for entry, offset in _placed(binding):
            word |= (self._objects.raw((entry.index, entry.subindex)) & (1 << entry.bits) - 1) << offset
        return Frame(binding.cob_id, word.to_bytes(binding.layout.length, "little"))


def _placed(binding: Binding) -> Iterator[tuple[MappedObject, int]]:
    """Give the mapped objects that carry something, each with its lowest bit in the frame (CiA 301, 7.4.8.2)."""
    mapping = binding.pdo.mapping
    offsets = accumulate((entry.bits for entry in mapping), initial=0)
    return ((entry, offset) for entry, offset in zip(mapping, offsets) if not entry.is_padding)


class Pacing:
    """When TPDOs are sent: not sooner than their inhibit time allows, not later than their event timer wants.

    `inhibit` and `event` give a TPDO's two times in seconds, 0.0 for none. Of what is held back, the newest is sent.
    """

    def __init__(self, inhibit: Callable[[Binding], float], event: Callable[[Binding], float]) -> None:
        self._inhibit, self._event = inhibit, event
        self._inhibits: dict[Binding, float] = {}
        self._events: dict[Binding, float] = {}
        self._free: dict[Binding, float] = {}
        self._held: dict[Binding, Frame] = {}

    def restart(self, bindings: Collection[Binding], now: float) -> None:
        """Begin anew with these TPDOs, and with their times as they are now; what was held back is dropped."""
        self._inhibits = {each: time for each in bindings if (time := self._inhibit(each))}
        self._events = {each: now + time for each in bindings if (time := self._event(each))}
        self._free.clear()
        self._held.clear()

    def admit(self, binding: Binding, frame: Frame, now: float) -> list[Frame]:
        """Return the frame if it may be sent now; otherwise hold it back in place of an older one."""
        if now < self._free.get(binding, now):
            self._held[binding] = frame
            return []
        if self._inhibits or self._events:
            self.sent(binding, now)
        return [frame]

    def sent(self, binding: Binding, now: float) -> None:
        """Note that a TPDO is sent: both its times begin."""
        self._held.pop(binding, None)
        if binding in self._events:
            self._events[binding] = now + self._event(binding)
        if binding in self._inhibits:
            self._free[binding] = now + self._inhibits[binding]

    @property
    def next(self) -> float:
        """When the next TPDO is due, infinite if none is."""
        if not self._events and not self._held:
            return inf
        return min([*self._events.values(), *map(self._free.__getitem__, self._held)])

    def released(self, now: float) -> list[Frame]:
        """Return what was held back and may be sent now."""
        released = {each: frame for each, frame in self._held.items() if self._free[each] <= now}
        for binding in released:
            self.sent(binding, self._free[binding])
        return list(released.values())

    def due(self, now: float) -> list[Binding]:
        """Return the TPDOs whose event timer wants them sent now."""
        due = [binding for binding, time in self._events.items() if time <= now]
        for binding in due:
            self.sent(binding, self._events[binding])
        return due
