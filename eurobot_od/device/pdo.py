"""PDOs of a running device: configuration over SDO by CiA 301's procedure, and values in the objects.

There is always one complete `protocol`. A change is prepared separately and replaces it in one step, or is refused
without effect (CiA 301, 7.5.2.35 to 7.5.2.38: invalidate, sub0 = 0, entries, sub0 = n, validate).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from math import inf

from eurobot_od.device.broadcasts import ACYCLIC, COUNTERS
from eurobot_od.device.objects import Objects, OnWrite
from eurobot_od.device.timers import caught_up
from eurobot_od.errors import MappingError, Refused
from eurobot_od.frame import Frame
from eurobot_od.od import values
from eurobot_od.od.pdos import Mapped
from eurobot_od.od.standard import EMCY, SYNC, SYNC_COUNTER, SYNC_PERIOD, SYNC_PRODUCER
from eurobot_od.od.values import COB_ID, Address, PdoDirection, Value
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Catalogue
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.sdo.wire import Abort, Reason

REFUSED = (*values.RESTRICTED, values.CIA_EXTENSIONS)
"""Identifiers that no PDO may have; the low restricted ones are allowed, because the robot uses them."""

EVENT_DRIVEN = (254, 255)
"""Transmission types that do not need SYNC (CiA 301, Tables 68 and 72)."""

SAMPLED, REQUESTED = 252, 253
"""Transmission types of TPDOs sent on a remote frame: with the values of the last SYNC, or the present ones."""


class Pdos:
    """The PDOs as presently configured by `objects`.

    `protocol` has the messages of the valid ones, `received` the bindings of RPDOs by COB-ID, `sent` those of TPDOs by
    message type, `always_sent` the COB-IDs of TPDOs that are sent in every NMT state, `requestable` the TPDOs that
    remote frames may request, by COB-ID. `unusable` has errors of PDOs in the file, by index.
    """

    def __init__(self, objects: Objects, catalogue: Catalogue) -> None:
        self._objects, self._catalogue = objects, catalogue
        self.unusable: dict[int | None, MappingError] = {}
        # An unusable PDO is left out, so that the others work.
        self._apply(self._built(objects.value, lambda error: self.unusable.update({error.index: error})))

    def _built(self, value: Callable[[Address], Value], harm: Callable[[MappingError], object]) -> Protocol:
        """Return the messages for values of objects.

        `harm` is called with each error in a mapping, and may raise it.
        """
        dictionary = self._objects.dictionary
        return Protocol([(dictionary, dictionary.read_pdos(value, harm))], self._catalogue, harm)

    def _refuse_new_harm(self, error: MappingError) -> None:
        """Refuse a change that makes another PDO unusable: raises the error."""
        if error.index not in self.unusable:
            raise error

    def _apply(self, protocol: Protocol) -> None:
        ours = self._objects.dictionary.name
        self.received = {each.cob_id: each for each in protocol.bindings if ours in each.receivers}
        self.sent = {each.type: each for each in protocol.bindings if ours in each.senders}
        self.always_sent = {each.cob_id for each in self.sent.values() if each.always}
        self.requestable = {each.cob_id: each for each in self.sent.values() if self._is_requestable(each.pdo.index)}
        self.protocol = protocol

    def inhibit_time(self, binding: Binding) -> float:
        """Return the inhibit time of a TPDO in s, 0.0 for none, and for messages that are always sent."""
        # The inhibit time is in 100 us, the event timer in ms (CiA 301, 7.5.2.37).
        return 0.0 if binding.always else self._objects.raw((binding.pdo.index, values.INHIBIT_TIME)) / 10_000

    def event_timer(self, binding: Binding) -> float:
        """Return the event timer of an event-driven TPDO in s; 0.0 for none, and for other TPDOs."""
        return self.deadline(binding) if self.is_event_driven(binding) else 0.0

    def deadline(self, binding: Binding) -> float:
        """Return the event timer in s, within which an RPDO has to come again; 0.0 for none."""
        return self._objects.raw((binding.pdo.index, values.EVENT_TIMER)) / 1000

    def is_event_driven(self, binding: Binding) -> bool:
        """Return whether a TPDO is sent when the application sends it."""
        asked_for = self._type(binding.pdo.index) in (SAMPLED, REQUESTED)
        return self.sync_type(binding) is None and not asked_for

    def follows_changes(self, binding: Binding) -> bool:
        """Return whether a TPDO is sent when its values change: at once, or at the next SYNC (type 0)."""
        return self.sync_type(binding) == ACYCLIC or self.is_event_driven(binding)

    def is_sampled(self, binding: Binding) -> bool:
        """Return whether a requested TPDO has the values of the last SYNC."""
        return self._type(binding.pdo.index) == SAMPLED and self.sync_cob_id is not None

    def _type(self, index: int) -> int:
        return self._objects.raw((index, values.TRANSMISSION_TYPE))

    def _is_requestable(self, index: int) -> bool:
        return not self._objects.raw((index, COB_ID)) & values.NO_RTR

    # SYNC

    @property
    def sync_cob_id(self) -> int | None:
        """COB-ID of SYNC; None without the object, or with NMT's identifier in it."""
        return self._objects.raw(SYNC) & values.BASE_IDENTIFIER or None

    def sync_type(self, binding: Binding) -> int | None:
        """Return the transmission type of a synchronous PDO, None for others and for messages that are always sent."""
        number = self._type(binding.pdo.index)
        return number if number in self._sync_types and not binding.always else None

    def sync_start(self, binding: Binding) -> int:
        """Return the SYNC start value of a TPDO; 0 for any, and without a counter."""
        return self._objects.raw((binding.pdo.index, values.SYNC_START)) if self.sync_counter else 0

    @property
    def _sync_types(self) -> range:
        return values.SYNCHRONOUS if self.sync_cob_id is not None else range(0)

    @property
    def sync_period(self) -> float:
        """Period of the device's own SYNC in s, 0.0 if it sends none."""
        sends = self._objects.raw(SYNC) & SYNC_PRODUCER and self.sync_cob_id is not None
        return self._objects.raw(SYNC_PERIOD) / 1_000_000 if sends else 0.0

    @property
    def sync_counter(self) -> int:
        """Overflow value of the SYNC counter, 0 without a counter."""
        overflow = self._objects.raw(SYNC_COUNTER)
        return overflow if overflow in COUNTERS else 0

    def _write_sync(self, address: Address, value: Value) -> None:
        number = value if isinstance(value, int) else 0
        can_send = SYNC_PERIOD[0] in self._objects.dictionary.members
        if number & values.EXTENDED or (number & SYNC_PRODUCER and not can_send):
            raise Abort(Reason.SYNC_COB_ID)
        before = self._objects.raw(address)
        # A producer's identifier is fixed until its bit 30 is cleared (CiA 301, 7.5.2.5).
        if before & number & SYNC_PRODUCER and before != number:
            raise Abort(Reason.SYNC_SENT)
        self._objects.put(address, number)

    def _write_counter(self, address: Address, value: Value) -> None:
        if value not in COUNTERS:
            raise Abort(Reason.SYNC_COUNTER)
        if self._objects.raw(SYNC_PERIOD):  # only while 0x1006 is 0 (CiA 301, 7.5.2.22)
            raise Abort(Reason.SYNC_PERIOD)
        self._objects.put(address, value)

    # Written over SDO

    def writers(self) -> dict[int, OnWrite]:
        """Return the functions that write SYNC parameters and records of PDOs, by index."""
        members = self._objects.dictionary.members
        records = [index for index in members if index in values.COMMUNICATIONS]
        mappings = [index + values.MAPPING_OFFSET for index in records]
        return {
            SYNC[0]: self._write_sync,
            SYNC_PERIOD[0]: self._objects.put,
            SYNC_COUNTER[0]: self._write_counter,
            **dict.fromkeys(records, self._write_communication),
            **dict.fromkeys(mappings, self._write_mapping),
        }

    def _write_communication(self, address: Address, value: Value) -> None:
        index, subindex = address
        number = value if isinstance(value, int) else 0
        if subindex == COB_ID:
            self._write_cob_id(index, number)
            return
        asked_for = (REQUESTED, *([SAMPLED] if self._sync_types else []))
        requestable = index >= PdoDirection.TPDO.value and self._is_requestable(index)
        types = {*EVENT_DRIVEN, *self._sync_types, *(asked_for if requestable else ())}
        if subindex == values.TRANSMISSION_TYPE and number not in types:
            raise Abort(Reason.TRANSMISSION_TYPE)
        if subindex == values.INHIBIT_TIME and number and index < PdoDirection.TPDO.value:
            raise Abort(Reason.RPDO_INHIBITED)
        if subindex in (values.INHIBIT_TIME, values.SYNC_START) and self._is_valid(index):  # CiA 301, 7.5.2.37
            raise Abort(Reason.PDO_VALID)
        self._objects.put(address, number)

    def _is_valid(self, index: int) -> bool:
        return self._objects.cob_id((index, COB_ID)) is not None

    def _write_cob_id(self, index: int, entry: int) -> None:
        """Change validity and identifier; the identifier of a valid PDO is fixed."""
        address = index, COB_ID
        valid = not entry & values.NOT_VALID
        if entry & ~(values.NOT_VALID | values.NO_RTR | values.BASE_IDENTIFIER):
            raise Abort(Reason.PDO_COB_ID)
        if valid and self._is_valid(index) and entry != self._objects.raw(address):
            raise Abort(Reason.PDO_VALID)
        cob_id = entry & values.BASE_IDENTIFIER
        # The present identifiers of EMCY and SYNC, which may have been changed.
        if valid and (cob_id in (self._objects.raw(EMCY), self.sync_cob_id) or values.owner(cob_id, REFUSED)):
            raise Abort(Reason.COB_ID_TAKEN)
        try:
            protocol = self._built(lambda a: entry if a == address else self._objects.value(a), self._refuse_new_harm)
        except MappingError as error:
            raise Abort(Reason.PDO_CONFLICT, str(error)) from error
        # The node could not send some values of the message. A message outside the catalogue is just its mapped bits.
        ours = (each for each in protocol.bindings if each.pdo.index == index >= PdoDirection.TPDO.value)
        if narrow := [field for each in ours if self._catalogue.find(each.name) for field in each.too_narrow]:
            raise Abort(Reason.TOO_FEW_BITS, f"too few bits for {', '.join(narrow)}")
        self._objects.put(address, entry)
        self._apply(protocol)

    def _write_mapping(self, address: Address, value: Value) -> None:
        index, subindex = address
        number = value if isinstance(value, int) else 0
        if self._is_valid(index - values.MAPPING_OFFSET):
            raise Abort(Reason.PDO_VALID)
        if subindex == 0:  # only the number of entries determines the length of the PDO
            entries = (self._objects.raw((index, sub)) for sub in range(1, number + 1))
            if sum(self.mapped(index, entry).bits for entry in entries) > values.MAX_BITS:
                raise Abort(Reason.MAPPING_TOO_LONG)
        elif self._objects.raw((index, 0)):
            raise Abort(Reason.MAPPING_USED)
        elif number:
            self.mapped(index, number)
        self._objects.put(address, number)

    def mapped(self, index: int, entry: int) -> Mapped:
        """Return the object of a mapping entry; raises Abort if it cannot be mapped."""
        direction = next(each for each, records in values.MAPPING_RECORDS.items() if index in records)
        dictionary = self._objects.dictionary
        variable = dictionary.variable(values.MappingEntry.of(entry).address)
        if variable is None:
            raise Abort(Reason.MAPPED_MISSING)
        # A dummy skips received bits, and cannot be sent.
        dummy = variable.index in values.DUMMIES and direction is PdoDirection.RPDO
        if not dummy and not (variable.pdo_mappable and variable.access_type in values.MAPPABLE[direction]):
            raise Abort(Reason.NOT_MAPPABLE)
        try:
            return dictionary.pdo_reader(dictionary.default).mapped(index, entry)
        except MappingError as error:
            raise Abort(Reason.MAPPED_BITS, str(error)) from error


class ProcessData:
    """Stores values from PDOs in the objects; those of a frame are stored when one of them is needed.

    `seen` has the last contents of PDOs by index, for `changed`.
    """

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self.seen: dict[int, Frame] = {}
        self._latest: dict[str, tuple[Binding, bytes]] = {}

    def note(self, binding: Binding, data: bytes) -> None:
        """Note the newest frame of a message; `data` has a length that the mapping allows."""
        # Moved to the end, because of several PDOs with an object, the newest applies.
        self._latest.pop(binding.name, None)
        self._latest[binding.name] = binding, data

    def settle(self) -> None:
        """Store the values of the noted frames in the objects, in the order of arrival."""
        for binding, data in self._latest.values():
            word = int.from_bytes(binding.complete(data), "little")
            for entry, address, mask, offset in binding.placed:
                with suppress(Refused):  # a refused value is ignored
                    self._objects.put(address, entry.meant(word >> offset & mask))
        self._latest.clear()

    def frame(self, binding: Binding) -> Frame:
        """Return a PDO's frame with the present values of its objects."""
        if self._latest:
            self.settle()
        word = 0
        raw = self._objects.raw
        for _, address, mask, offset in binding.placed:
            word |= (raw(address) & mask) << offset
        return Frame(binding.cob_id, word.to_bytes(binding.layout.length, "little"))

    def changed(self, bindings: Iterable[Binding]) -> list[tuple[Binding, Frame]]:
        """Return the PDOs that have changed since the last call, with their frames; those without data never change."""
        looked_at = [(each, self.frame(each)) for each in bindings if each.layout.length]
        # By index, because remapping makes a new binding.
        changed = [(each, frame) for each, frame in looked_at if self.seen.get(each.pdo.index) != frame]
        self.seen |= {each.pdo.index: frame for each, frame in changed}
        return changed


class Pacing:
    """Times of TPDOs: not before their inhibit time, and not after their event timer.

    `inhibit` and `event` return both times of a TPDO in s, 0.0 for none. Of several frames that wait, the newest is
    sent.
    """

    def __init__(self, inhibit: Callable[[Binding], float], event: Callable[[Binding], float]) -> None:
        self._inhibit, self._event = inhibit, event
        self._inhibits: dict[Binding, float] = {}
        self._events: dict[Binding, float] = {}
        self._free: dict[Binding, float] = {}
        self._held: dict[Binding, Frame] = {}

    def restart(self, bindings: Collection[Binding], now: float) -> None:
        """Start over with these TPDOs and their present times; waiting frames are dropped."""
        self._inhibits = {each: time for each in bindings if (time := self._inhibit(each))}
        self._events = {each: now + time for each in bindings if (time := self._event(each))}
        self._free.clear()
        self._held.clear()

    def admit(self, binding: Binding, frame: Frame, now: float) -> list[Frame]:
        """Return the frame if it may be sent now; else keep it in place of an older one."""
        if now < self._free.get(binding, now):
            self._held[binding] = frame
            return []
        if self._inhibits or self._events:
            self.sent(binding, now)
        return [frame]

    def sent(self, binding: Binding, now: float) -> None:
        """Note that a TPDO is sent, which restarts both times."""
        self._held.pop(binding, None)
        if binding in self._events:
            self._events[binding] = now + self._event(binding)
        if binding in self._inhibits:
            self._free[binding] = now + self._inhibits[binding]

    @property
    def next(self) -> float:
        """Time of the next TPDO, infinite if none is planned."""
        if not self._events and not self._held:
            return inf
        return min([*self._events.values(), *map(self._free.__getitem__, self._held)])

    def released(self, now: float) -> list[Frame]:
        """Return the waiting frames that may be sent now."""
        released = {each: frame for each, frame in self._held.items() if self._free[each] <= now}
        for binding in released:  # from the first allowed time, so that a late call does not extend the inhibit time
            self.sent(binding, self._free[binding])
        return list(released.values())

    def due(self, now: float) -> list[Binding]:
        """Return the TPDOs whose event timer has expired."""
        due = [binding for binding, time in self._events.items() if time <= now]
        for binding in due:
            self.sent(binding, caught_up(self._events[binding], now))
        return due
