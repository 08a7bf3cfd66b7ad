"""The PDOs of a running device: changed over SDO by CiA 301's procedure, with their values kept in the objects.

There is always one complete `protocol`. A change is built beside it and takes its place in one step, or is refused and
leaves no trace (CiA 301, 7.5.2.35 to 7.5.2.38: invalidate, sub0 = 0, entries, sub0 = n, validate).
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
"""Identifiers that no PDO may have. The low restricted ones are allowed, because the robot has messages there."""

EVENT_DRIVEN = (254, 255)
"""Transmission types that do not need SYNC (CiA 301, Tables 68 and 72)."""

SAMPLED, REQUESTED = 252, 253
"""Transmission types of TPDOs that a remote frame asks for: with the values of the last SYNC, or the present ones."""


class Pdos:
    """The PDOs as the values in `objects` configure them now.

    `protocol` has the messages of the valid ones, `received` the bindings of its RPDOs by COB-ID, `sent` those of its
    TPDOs by message type, `always_sent` the COB-IDs of those that act in every NMT state, `requestable` the TPDOs that
    remote frames may ask for, by COB-ID. `unusable` says what is wrong with PDOs that the file does not describe well,
    by index.
    """

    def __init__(self, objects: Objects, catalogue: Catalogue) -> None:
        self._objects, self._catalogue = objects, catalogue
        self.unusable: dict[int | None, MappingError] = {}
        # A PDO that the file does not describe well is left out, and the others still work.
        self._apply(self._built(objects.value, lambda error: self.unusable.update({error.index: error})))

    def _built(self, value: Callable[[Address], Value], harm: Callable[[MappingError], object]) -> Protocol:
        """Return the messages by these values of objects; `harm` gets each error in a mapping, and may raise it."""
        dictionary = self._objects.dictionary
        return Protocol([(dictionary, dictionary.read_pdos(value, harm))], self._catalogue, harm)

    def _refuse_new_harm(self, error: MappingError) -> None:
        """Refuse a change that breaks another PDO."""
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
        """Return the inhibit time of a TPDO in seconds, 0.0 for none; a message that always acts never waits."""
        # Sub-index 3 counts 100 µs, the event timer in sub-index 5 milliseconds (CiA 301, 7.5.2.37).
        return 0.0 if binding.always else self._objects.raw((binding.pdo.index, values.INHIBIT_TIME)) / 10_000

    def event_timer(self, binding: Binding) -> float:
        """Return the event timer of an event-driven TPDO in seconds; 0.0 if it has none, or for any other TPDO."""
        return self.deadline(binding) if self.is_event_driven(binding) else 0.0

    def deadline(self, binding: Binding) -> float:
        """Return the event timer in seconds, within which an RPDO has to come again; 0.0 for none."""
        return self._objects.raw((binding.pdo.index, values.EVENT_TIMER)) / 1000

    def is_event_driven(self, binding: Binding) -> bool:
        """Return whether a TPDO is sent whenever the application wants to send it."""
        asked_for = self._type(binding.pdo.index) in (SAMPLED, REQUESTED)
        return self.sync_type(binding) is None and not asked_for

    def follows_changes(self, binding: Binding) -> bool:
        """Return whether a TPDO is sent when its values change: at once or with the next SYNC (transmission type 0)."""
        return self.sync_type(binding) == ACYCLIC or self.is_event_driven(binding)

    def is_sampled(self, binding: Binding) -> bool:
        """Return whether a TPDO carries the values of the last SYNC when it is asked for."""
        return self._type(binding.pdo.index) == SAMPLED and self.sync_cob_id is not None

    def _type(self, index: int) -> int:
        return self._objects.raw((index, values.TRANSMISSION_TYPE))

    def _is_requestable(self, index: int) -> bool:
        return not self._objects.raw((index, COB_ID)) & values.NO_RTR

    # SYNC

    @property
    def sync_cob_id(self) -> int | None:
        """The COB-ID of SYNC; None if the device has no object for it, or only the identifier of NMT in it."""
        return self._objects.raw(SYNC) & values.BASE_IDENTIFIER or None

    def sync_type(self, binding: Binding) -> int | None:
        """Return the transmission type of a PDO that follows SYNC, None for any other; what always acts never waits."""
        number = self._type(binding.pdo.index)
        return number if number in self._sync_types and not binding.always else None

    def sync_start(self, binding: Binding) -> int:
        """Return the number of the SYNC that a TPDO starts with; 0 for any, as without a counter."""
        return self._objects.raw((binding.pdo.index, values.SYNC_START)) if self.sync_counter else 0

    @property
    def _sync_types(self) -> range:
        return values.SYNCHRONOUS if self.sync_cob_id is not None else range(0)

    @property
    def sync_period(self) -> float:
        """Seconds between two SYNCs of the device, 0.0 if it sends none."""
        sends = self._objects.raw(SYNC) & SYNC_PRODUCER and self.sync_cob_id is not None
        return self._objects.raw(SYNC_PERIOD) / 1_000_000 if sends else 0.0

    @property
    def sync_counter(self) -> int:
        """The number up to which SYNC is counted, 0 if it is not counted."""
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
        """Return what writing a SYNC parameter or a record of a PDO does, by index."""
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
        """Change validity and identifier; while a PDO is valid and stays so, its identifier is fixed."""
        address = index, COB_ID
        valid = not entry & values.NOT_VALID
        if entry & ~(values.NOT_VALID | values.NO_RTR | values.BASE_IDENTIFIER):
            raise Abort(Reason.PDO_COB_ID)
        if valid and self._is_valid(index) and entry != self._objects.raw(address):
            raise Abort(Reason.PDO_VALID)
        cob_id = entry & values.BASE_IDENTIFIER
        # EMCY and SYNC count where this device has them now, which need not be the pre-defined connection set.
        if valid and (cob_id in (self._objects.raw(EMCY), self.sync_cob_id) or values.owner(cob_id, REFUSED)):
            raise Abort(Reason.COB_ID_TAKEN)
        try:
            protocol = self._built(lambda a: entry if a == address else self._objects.value(a), self._refuse_new_harm)
        except MappingError as error:
            raise Abort(Reason.PDO_CONFLICT, str(error)) from error
        # The node could not send a message with such a value, and nobody would know why it does not answer. A message
        # that no catalogue knows is just its mapped bits, however few.
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
        if subindex == 0:  # entries are written one by one: only their number shows how long the PDO is
            entries = (self._objects.raw((index, sub)) for sub in range(1, number + 1))
            if sum(self.mapped(index, entry).bits for entry in entries) > values.MAX_BITS:
                raise Abort(Reason.MAPPING_TOO_LONG)
        elif self._objects.raw((index, 0)):
            raise Abort(Reason.MAPPING_USED)
        elif number:
            self.mapped(index, number)
        self._objects.put(address, number)

    def mapped(self, index: int, entry: int) -> Mapped:
        """Return what a mapping entry stands for; raises Abort if it cannot be mapped there."""
        direction = next(each for each, records in values.MAPPING_RECORDS.items() if index in records)
        dictionary = self._objects.dictionary
        variable = dictionary.variable(values.MappingEntry.of(entry).address)
        if variable is None:
            raise Abort(Reason.MAPPED_MISSING)
        # A dummy skips received bits that mean nothing to this device; it has nothing to send.
        dummy = variable.index in values.DUMMIES and direction is PdoDirection.RPDO
        if not dummy and not (variable.pdo_mappable and variable.access_type in values.MAPPABLE[direction]):
            raise Abort(Reason.NOT_MAPPABLE)
        try:
            return dictionary.pdo_reader(dictionary.default).mapped(index, entry)
        except MappingError as error:
            raise Abort(Reason.MAPPED_BITS, str(error)) from error


class ProcessData:
    """Stores in the objects what PDOs carry; a frame's values are stored together, when one of them is asked for.

    `seen` has the contents of PDOs, by index, with which `changed` compares.
    """

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self.seen: dict[int, Frame] = {}
        self._latest: dict[str, tuple[Binding, bytes]] = {}

    def note(self, binding: Binding, data: bytes) -> None:
        """Note the newest frame of a message; `data` has a length that the mapping allows."""
        # Removed first: a dict leaves a known key in its old place, and where PDOs share an object the newest one
        # counts.
        self._latest.pop(binding.name, None)
        self._latest[binding.name] = binding, data

    def settle(self) -> None:
        """Store the values of the noted frames in the objects, in the order in which the frames came."""
        for binding, data in self._latest.values():
            word = int.from_bytes(binding.complete(data), "little")
            for entry, address, mask, offset in binding.placed:
                with suppress(Refused):  # a value that the application refuses counts as if it had not come
                    self._objects.put(address, entry.meant(word >> offset & mask))
        self._latest.clear()

    def frame(self, binding: Binding) -> Frame:
        """Return a PDO with the present values of its objects."""
        if self._latest:
            self.settle()
        word, raw = 0, self._objects.raw
        for _, address, mask, offset in binding.placed:
            word |= (raw(address) & mask) << offset
        return Frame(binding.cob_id, word.to_bytes(binding.layout.length, "little"))

    def changed(self, bindings: Iterable[Binding]) -> list[tuple[Binding, Frame]]:
        """Return the PDOs that have changed since this was last asked, with their frames.

        One without data never changes.
        """
        looked_at = [(each, self.frame(each)) for each in bindings if each.layout.length]
        # By index, which stays when a master remaps the PDO and it gets another binding.
        changed = [(each, frame) for each, frame in looked_at if self.seen.get(each.pdo.index) != frame]
        self.seen |= {each.pdo.index: frame for each, frame in changed}
        return changed


class Pacing:
    """When TPDOs are sent: not sooner than their inhibit time allows, not later than their event timer asks.

    `inhibit` and `event` give a TPDO's two times in seconds, 0.0 for none. When several frames are held back, the
    newest is sent.
    """

    def __init__(self, inhibit: Callable[[Binding], float], event: Callable[[Binding], float]) -> None:
        self._inhibit, self._event = inhibit, event
        self._inhibits: dict[Binding, float] = {}
        self._events: dict[Binding, float] = {}
        self._free: dict[Binding, float] = {}
        self._held: dict[Binding, Frame] = {}

    def restart(self, bindings: Collection[Binding], now: float) -> None:
        """Start over with these TPDOs and their present times; what was held back is dropped."""
        self._inhibits = {each: time for each in bindings if (time := self._inhibit(each))}
        self._events = {each: now + time for each in bindings if (time := self._event(each))}
        self._free.clear()
        self._held.clear()

    def admit(self, binding: Binding, frame: Frame, now: float) -> list[Frame]:
        """Return the frame if it may be sent now; otherwise hold it back, in place of an older one."""
        if now < self._free.get(binding, now):
            self._held[binding] = frame
            return []
        if self._inhibits or self._events:
            self.sent(binding, now)
        return [frame]

    def sent(self, binding: Binding, now: float) -> None:
        """Note that a TPDO is sent, which starts both its times."""
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
        """Return what was held back and may be sent now."""
        released = {each: frame for each, frame in self._held.items() if self._free[each] <= now}
        for binding in released:  # as if sent at the first allowed time: a late call does not stretch the inhibit time
            self.sent(binding, self._free[binding])
        return list(released.values())

    def due(self, now: float) -> list[Binding]:
        """Return the TPDOs whose event timer is up."""
        due = [binding for binding, time in self._events.items() if time <= now]
        for binding in due:
            self.sent(binding, caught_up(self._events[binding], now))
        return due
