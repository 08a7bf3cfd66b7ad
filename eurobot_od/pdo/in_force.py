"""The current configuration of devices: parameters observed on the bus, and their files for everything else.

A confirmed write, and the answer to a read, replace the file's value until the device is reset. It then has its stored
values, or else its file's (CiA 301, 7.5.2.13). Objects and PDOs that the file lacks are added once the device has
accepted a write to them. For a device without a file, a dictionary is made from the observed values.

Nothing is guessed. A mapping entry is unknown if it was written with data that the log does not have, while a write of
it is unanswered, or if it may have been written before the log begins: when the log has only the end of a
configuration, or when a device's answer differs from its file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.errors import DictionaryError
from eurobot_od.od import cia402, profiles, standard, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import data_type
from eurobot_od.od.profiles import variable_text
from eurobot_od.od.sdo_channels import sdo_channels
from eurobot_od.od.values import (
    ALL_NODES,
    UNSIGNED8,
    UNSIGNED32,
    Address,
    MappingEntry,
    Multiplex,
    UnknownEntry,
    Value,
)

SERVICES = (standard.SYNC, standard.TIME, standard.EMCY, standard.SDO_REQUESTS, standard.SDO_ANSWERS)
"""Objects with the COB-IDs of services other than PDOs and further SDO channels."""

SETTINGS = (standard.SYNC_PERIOD, standard.HEARTBEAT_TIME)
"""Objects with periods."""

SDO_CHANNELS = frozenset((*standard.SDO_SERVERS, *standard.SDO_CLIENTS))


Describe: TypeAlias = Callable[[int, Mapping[Address, int], Dictionary | None], Dictionary | None]
"""Function from node-ID, observed values of 0x1000 and 0x1018, and the node's named file, to its dictionary."""


def nothing_known(*_: object) -> None:
    """Return None, as a `Describe` without a library."""


def is_followed(address: Address) -> bool:
    """Return whether an object affects the meaning of other frames."""
    index = address[0]
    in_record = values.pdo_of(index) is not None or index in SDO_CHANNELS or index == standard.CONSUMED_HEARTBEATS
    return in_record or address in (*SERVICES, *SETTINGS)


class LeftIdentifier(NamedTuple):
    """An identifier that a PDO no longer has: the PDO's communication record, its identifier `now`, and the evidence.

    `now` is None for a PDO that is not valid. `how` completes a sentence, such as "by SDO at line 2".
    """

    record: int
    now: int | None
    how: str


@dataclass
class DeviceInForce:
    """The observed configuration of one device.

    `shown` has the observed values, `unknown` the objects that were written with unknown values, `asked` the mapping
    entries with an unanswered write. PDOs are given by their communication records: for those in `begun` the log has
    the whole configuration, as for all PDOs once the device `is_started`; for those in `doubted`, entries that were not
    observed may differ from the file. `left` has the identifiers that PDOs no longer have.
    """

    shown: dict[Address, int] = field(default_factory=dict)
    unknown: set[Address] = field(default_factory=set)
    asked: set[Address] = field(default_factory=set)
    begun: set[int] = field(default_factory=set)
    doubted: set[int] = field(default_factory=set)
    left: dict[int, LeftIdentifier] = field(default_factory=dict)
    is_started: bool = False

    def copy(self, is_started: bool) -> DeviceInForce:
        """Return the configuration after a reset, or before one."""
        parts = dict(self.shown), set(self.unknown), set[Address](), set(self.begun), set(self.doubted), dict(self.left)
        return DeviceInForce(*parts, is_started)

    def is_open(self, index: int) -> bool:
        """Return whether a PDO's mapping may have been rewritten before the log begins."""
        return not (self.is_started or index in self.begun)

    def present(self, file: Dictionary | None) -> dict[Address, int]:
        """Return the values that replace those of the file, with unknown ones marked."""
        unknown = self.unknown | self.asked
        present = {address: value for address, value in self.shown.items() if address not in unknown}
        if file is None:
            return present
        touched = {index for address in (*self.shown, *unknown) if (index := values.pdo_of(address[0]))}
        for index in touched:
            present |= self._of_unknown(file, index)
        return present

    def _of_unknown(self, file: Dictionary, index: int) -> dict[Address, int]:
        """Return placeholders for the unknown parameters of a PDO."""
        mapping = index + values.MAPPING_OFFSET
        found = dict[Address, int]()
        if (index, values.COB_ID) in self.unknown:
            found[index, values.COB_ID] = (file.number((index, values.COB_ID)) or 0) & ~values.NOT_VALID
        highest = max((sub for at, sub in (*self.shown, *self.unknown) if at == mapping), default=0)
        count = self.shown.get((mapping, 0))
        if self.is_unknown(file, (mapping, 0)):
            count = found[mapping, 0] = max(file.number((mapping, 0)) or 0, highest)
        elif count is None:
            count = file.number((mapping, 0)) or 0
        for sub in range(1, min(count, values.MAX_BITS) + 1):
            if self.is_unknown(file, (mapping, sub)):
                said = file.number((mapping, sub)) or 0
                found[mapping, sub] = UnknownEntry.of(sub, MappingEntry.of(said).bits)
        return found

    def is_unknown(self, file: Dictionary, address: Address) -> bool:
        """Return whether a mapping entry is unknown."""
        index = values.pdo_of(address[0])
        is_missing = address not in self.shown and address[0] not in file.members
        is_asked = any(values.pdo_of(each) == index for each, _ in self.asked)
        is_in_doubt = index is not None and (index in self.doubted or (is_asked and self.is_open(index)))
        is_doubted = address not in self.shown and is_in_doubt
        return address in self.unknown or address in self.asked or is_missing or is_doubted


class InForce:
    """The current configuration of all devices on a bus; at first from their files, or as `learned` before."""

    def __init__(
        self,
        dictionaries: Iterable[Dictionary],
        learned: Iterable[Dictionary] = (),
        describe: Describe = nothing_known,
    ) -> None:
        self._files = {each.node_id: each for each in dictionaries}
        self._named = dict(self._files)
        self._describe = describe
        self._identities: dict[int, dict[Address, int]] = {}
        self._objects: dict[int, set[int]] = {}
        self._present: dict[int, Dictionary] = {}
        self._learned: dict[int, tuple[Dictionary, ...]] = {}
        self._stored: dict[int, DeviceInForce] = {}
        for each in learned:
            self._learned[each.node_id] = (*self._learned.get(each.node_id, ()), each)
            # Assumed after a reset, too: most devices keep it.
            self._stored.setdefault(each.node_id, DeviceInForce()).shown.update(_numbers(each))
            if (device_type := each.number(standard.DEVICE_TYPE)) is not None:
                self._identities[each.node_id] = {standard.DEVICE_TYPE: device_type}
        self._devices = {node_id: stored.copy(is_started=False) for node_id, stored in self._stored.items()}
        self._all_started = False

    @property
    def described(self) -> list[Dictionary]:
        """The devices with files, in their current configuration."""
        return [self._present.get(node_id, each) for node_id, each in self._files.items()]

    @property
    def learned(self) -> list[Dictionary]:
        """Dictionaries of devices without files, from the observed mappings."""
        return [each for parts in self._learned.values() for each in parts]

    @property
    def left(self) -> dict[int, dict[int, LeftIdentifier]]:
        """Identifiers that PDOs no longer have, by node-ID and identifier."""
        return {node_id: each.left for node_id, each in self._devices.items() if each.left}

    def shown(self, node_id: int) -> Mapping[Address, int]:
        """Return a device's observed values."""
        return self._devices[node_id].shown if node_id in self._devices else {}

    def profile(self, node_id: int) -> int:
        """Return the device profile by 0x1000 or by the observed objects; 0 if unknown."""
        device_type = self._identities.get(node_id, {}).get(standard.DEVICE_TYPE, 0)
        return profiles.profile_shown(device_type, self._objects.get(node_id, ()))

    def renumber(self, identity: Mapping[int, int], node_id: int) -> Dictionary | None:
        """Note the new node-ID of the device with an identity, whose parts are numbered as by LSS_IDENTITY.

        Return its dictionary, from the only file for such devices; None without one, with several, or if the new
        node-ID has a file.
        """
        return self._renumber([each for each in self._files.values() if _is_of(Identity.of(each), identity)], node_id)

    def renumber_only(self, heard: Set[int], node_id: int) -> Dictionary | None:
        """Note the new node-ID of the only device on a bus; `heard` are the node-IDs heard so far.

        Return as `renumber` does; None if several devices were heard, or if several files are possible.
        """
        files = list(self._files.values())
        possible = [each for each in files if each.node_id in heard] or files
        return self._renumber(possible, node_id) if len(heard) <= 1 and len(possible) == 1 else None

    def _renumber(self, found: Iterable[Dictionary], node_id: int) -> Dictionary | None:
        files = {each.file: each for each in found}
        if node_id in self._files or len(files) != 1:
            return None
        (file,) = files.values()
        # In addition to the file's own node, because another device of this type may have that node-ID.
        made = self._files[node_id] = file.renumbered(node_id).named(f"{file.name}_{node_id}")
        return made

    def _device(self, node_id: int) -> DeviceInForce:
        return self._devices.setdefault(node_id, DeviceInForce(is_started=self._all_started))

    def show(self, node_id: int, address: Address, octets: bytes, written: str = "") -> bool:
        """Note a value of a device; return whether this changes the meaning of other frames.

        Args:
            node_id: node-ID of the device, 1..127
            address: index and sub-index of the object
            octets: its value as an SDO carries it
            written: the evidence of a write, such as "by SDO at line 2"; empty for an answer to a read
        """
        device, profile = self._device(node_id), self.profile(node_id)
        is_news = self._show(node_id, device, address, octets, written)
        if profile == self.profile(node_id) or node_id in self._files:
            return is_news
        self._changed(node_id)  # the profile names its objects
        return True

    def _show(self, node_id: int, device: DeviceInForce, address: Address, octets: bytes, written: str) -> bool:
        if address[0] == standard.IDENTITY or address == standard.DEVICE_TYPE:
            return self._identified(node_id, address, octets)
        if address[0] in profiles.AREA:
            self._has_object(node_id, address[0])
        elif address[0] == standard.STORE:
            if octets == standard.SIGNATURES[standard.STORE]:
                self._stored[node_id] = device.copy(is_started=True)
        elif address[0] == standard.RESTORE:
            if octets == standard.SIGNATURES[standard.RESTORE]:
                self._stored.pop(node_id, None)  # takes effect at the next reset
        elif is_followed(address):
            before = self._said_by(node_id, address)
            value = int.from_bytes(octets, "little")
            self._doubt(node_id, address, value, is_written=bool(written))
            if address[1] == values.COB_ID and address[0] in values.COMMUNICATIONS:
                self._move(node_id, address[0], value, written)
            if address[0] in values.MAPPINGS and address[1]:
                self._has_object(node_id, MappingEntry.of(value).index)
            device.shown[address] = value
            device.asked.discard(address)
            device.unknown.discard(address)
            # The dictionary is made again only if frames change, not after each of the writes that map a PDO.
            return before != self._said_by(node_id, address) and self._changed(node_id)
        return False

    def _has_object(self, node_id: int, index: int) -> None:
        if index in profiles.AREA:
            self._objects.setdefault(node_id, set()).add(cia402.on_first_axis(index))

    def _identified(self, node_id: int, address: Address, octets: bytes) -> bool:
        """Note an identity value; return whether the device has another dictionary now."""
        numbers = self._identities.setdefault(node_id, {})
        numbers[address] = int.from_bytes(octets, "little")
        found = self._describe(node_id, numbers, self._named.get(node_id))
        if found is None and (standard.IDENTITY, 2) in numbers:  # a file that is named for another node-ID
            named = {sub - 1: number for (index, sub), number in numbers.items() if index == standard.IDENTITY}
            found = self.renumber(named, node_id)
        elif found is self._files.get(node_id):
            return False
        if found is None:
            return False
        self._files[node_id] = found
        self._learned.pop(node_id, None)
        self._present.pop(node_id, None)
        self._changed(node_id)  # values observed before replace those of the file
        return True

    def ask(self, node_id: int, address: Address) -> bool:
        """Note a write request of a mapping entry, which is unknown until the answer; return as `show` does."""
        if address[0] not in values.MAPPINGS or not address[1]:
            return False
        before = self._said_by(node_id, address)
        self._device(node_id).asked.add(address)
        return before != self._said_by(node_id, address) and self._changed(node_id)

    def refuse(self, node_id: int, address: Address) -> bool:
        """Note that a device has refused a write and keeps its value; return as `show` does."""
        device = self._device(node_id)
        if address not in device.asked:
            return False
        before = self._said_by(node_id, address)
        device.asked.discard(address)
        return before != self._said_by(node_id, address) and self._changed(node_id)

    def forget(self, node_id: int, address: Address) -> bool:
        """Note a write with unknown data; return as `show` does."""
        if not is_followed(address) or values.pdo_of(address[0]) is None:
            return False
        before = self._said_by(node_id, address)
        device = self._device(node_id)
        self._doubt(node_id, address, None, is_written=True)
        device.shown.pop(address, None)
        device.asked.discard(address)
        device.unknown.add(address)
        return before != self._said_by(node_id, address) and self._changed(node_id)

    def _doubt(self, node_id: int, address: Address, value: int | None, is_written: bool) -> None:
        """Note whether a PDO parameter's value shows a configuration from before the log."""
        index = values.pdo_of(address[0])
        device = self._device(node_id)
        if index is None:
            return
        is_entry = address[0] != index
        known = self._number(node_id, address)
        if not is_written:
            if is_entry and known is not None and known != value and address not in device.unknown:
                device.doubted.add(index)
        elif value is not None and self._begins(address, index, value):
            device.begun.add(index)
        # A master that enables a valid PDO has disabled it before.
        elif device.is_open(index) and (is_entry or (address[1] == values.COB_ID and _is_valid(known))):
            device.doubted.add(index)

    def _begins(self, address: Address, index: int, value: int) -> bool:
        """Return whether a write begins the configuration of a PDO, so that the log has all of it."""
        is_off = address == (index, values.COB_ID) and not _is_valid(value)
        return is_off or (address == (index + values.MAPPING_OFFSET, 0) and value == 0)

    def _move(self, node_id: int, index: int, value: int, written: str) -> None:
        """Note the identifier that a PDO leaves, and the one that it takes."""
        device = self._device(node_id)
        known = self._number(node_id, (index, values.COB_ID))
        now = values.identifier(value) if _is_valid(value) else None
        if now is not None:
            device.left.pop(now, None)
        before = None if known is None else values.identifier(known)
        how = written or "as it has answered"
        # A PDO that was not valid keeps the evidence of when it was disabled.
        if before and before != now and (_is_valid(known) or before not in device.left):
            device.left[before] = LeftIdentifier(index, now, how)
        if now is None and values.identifier(value):
            device.left.setdefault(values.identifier(value), LeftIdentifier(index, now, how))

    def _number(self, node_id: int, address: Address) -> int | None:
        """Return the number at an address, as observed or else from the file."""
        found = self.shown(node_id).get(address)
        file = self._files.get(node_id)
        return file.number(address) if found is None and file else found

    def _said_by(self, node_id: int, address: Address) -> Any:
        """Return all parameters that determine the frames of an object's PDO; only the COB-ID if it is not valid."""
        file = self._files.get(node_id)
        found = self._device(node_id).present(file)

        def present(index: int, subindex: int) -> Any:
            number = found.get((index, subindex))
            return file.default((index, subindex)) if number is None and file else number

        index = values.pdo_of(address[0])
        if index is None:
            return present(*address)
        settings = [present(index, sub) for sub in range(1, values.EVENT_TIMER + 1)]
        if settings[0] is None or not _is_valid(settings[0]):
            return settings[0]
        mapping = index + values.MAPPING_OFFSET
        return settings, [present(mapping, sub) for sub in range(min(present(mapping, 0) or 0, values.MAX_BITS) + 1)]

    def start(self, node_id: int) -> bool:
        """Note the reset of a device, or of all; return whether this changes the meaning of other frames."""
        changed = False
        node_ids = [node_id]
        if node_id == ALL_NODES:
            self._all_started = True
            node_ids = list(self._devices)
        for each in node_ids:
            file = self._files.get(each)
            before = self._device(each)
            self._devices[each] = now = self._stored.get(each, DeviceInForce()).copy(is_started=True)
            is_other = (before.present(file), before.left) != (now.present(file), now.left)
            changed |= is_other and self._changed(each)
        return changed

    def _changed(self, node_id: int) -> bool:
        """Make a device's dictionary again; return whether the meaning of its frames has changed."""
        file = self._files.get(node_id)
        device = self._device(node_id)
        present = device.present(file)
        if file is None:
            profile = self.profile(node_id)
            known = self._learned.get(node_id, ())
            self._learned[node_id] = made(node_id, present, profile)
            return known != self._learned[node_id]
        before = self._present.get(node_id, file)
        now = self._present[node_id] = completed(file, present).configured(present)
        return bool(_said(before) != _said(now))


def _is_valid(cob_id: int | None) -> bool:
    return cob_id is not None and not cob_id & values.NOT_VALID


def _is_of(file: Sequence[int], named: Mapping[int, int]) -> bool:
    """Return whether a file is for devices with an identity: same product, and same vendor unless the file has none."""
    vendor, product, *_ = file
    return bool(product) and product == named.get(1) and vendor in (0, named.get(0, vendor))


def _said(device: Dictionary) -> Any:
    """Return all parameters of a device that determine the meaning of its frames."""
    pdos = device.read_pdos(device.default, lambda _: None, listening=True)
    # A PDO that is not valid keeps its identifier: a frame with it belongs to no other PDO.
    said = [each if each.valid else (each.index, each.cob_id) for each in pdos]
    return said, [device.default(each) for each in SERVICES], list(sdo_channels(device))


# A device whose file is incomplete


def completed(file: Dictionary, present: Mapping[Address, int]) -> Dictionary:
    """Return a device's file with missing records, and with mapped objects that it lacks."""
    records = {at for at, _ in present if at not in file.members and is_followed((at, values.COB_ID))}
    subs = {at: {sub: number for (index, sub), number in present.items() if index == at} for at in sorted(records)}
    texts = [_record(at, _record_name(at), {0: max(kept)} | kept) for at, kept in subs.items()]
    texts += _missing(file, present)
    lacking = _read(file.node_id, "".join(texts)) if texts else None
    return file.completed(lacking) if lacking else file


def _record_name(index: int) -> str:
    for direction, records in values.COMMUNICATION_RECORDS.items():
        if (record := values.pdo_of(index)) is not None and record in records:
            return f"{direction.name} {record - records[0] + 1} {'parameter' if record == index else 'mapping'}"
    return f"0x{index:04X}"


def _missing(file: Dictionary, present: Mapping[Address, int]) -> Iterator[str]:
    """Yield the mapped objects that are not in a file, or that have fewer bits there than are mapped."""
    objects: dict[Address, int] = {}
    for (at, sub), number in present.items():
        entry = MappingEntry.of(number)
        if sub and at in values.MAPPINGS and entry.index >= values.FIRST and 0 < entry.bits <= values.MAX_BITS:
            variable = file.variable(entry.address)
            most = 0 if variable is None else data_type(variable).size * 8 or values.MAX_BITS
            if most < entry.bits:
                objects[entry.address] = max(entry.bits, objects.get(entry.address, 0))
    for each in dict.fromkeys(at for at, _ in objects):
        yield _mapped(each, {sub: bits for (at, sub), bits in objects.items() if at == each})


# A device without a file

MOST_PDOS = 1 << 11
"""Number of cached dictionaries: twice the PDOs of one device."""


def _numbers(device: Dictionary) -> dict[Address, int]:
    """Return a dictionary's values that affect the meaning of frames."""
    numbers = {each: device.number(each) for each in device.addresses() if is_followed(each)}
    return {address: number for address, number in numbers.items() if number is not None}


def made(node_id: int, shown: Mapping[Address, Value], profile: int = 0) -> tuple[Dictionary, ...]:
    """Return a dictionary of the observed services, and one of each PDO whose whole mapping was observed.

    They are separate because PDOs are observed one by one: a common dictionary would be read again for each. Each has
    the device profile in 0x1000 unless `profile` is 0, unknown.
    """
    numbers = {address: value for address, value in shown.items() if isinstance(value, int)}
    head = profiles.device_type_text(profile) if profile else ""
    texts = filter(None, (head + "".join(_services(numbers)), *(head + each for each in _pdos(numbers, profile))))
    return tuple(filter(None, (_read(node_id, each) for each in texts)))


@lru_cache(MOST_PDOS)
def _read(node_id: int, text: str) -> Dictionary | None:
    name = f"node {node_id}"
    try:
        return Dictionary.read(text.encode(), Path(name), node_id, name)
    except DictionaryError:  # a mapping of impossible objects
        return None


def _services(shown: Mapping[Address, int]) -> Iterator[str]:
    for index in dict.fromkeys(index for index, _ in SERVICES):
        kept = {sub: shown[index, sub] for at, sub in SERVICES if at == index and (index, sub) in shown}
        if list(kept) == [0]:
            yield variable_text(f"{index:X}", f"0x{index:04X}", UNSIGNED32.code, f"DefaultValue={kept[0]}\n")
        elif kept:
            yield _record(index, f"0x{index:04X}", {0: max(kept)} | kept)
    for index in sorted(SDO_CHANNELS.intersection(at for at, _ in shown) - {standard.SDO_REQUESTS[0]}):
        kept = {sub: value for (at, sub), value in shown.items() if at == index and sub}
        yield _record(index, f"0x{index:04X}", {0: max(kept, default=0)} | kept)


def _pdos(shown: Mapping[Address, int], profile: int) -> Iterator[str]:
    for records in values.COMMUNICATION_RECORDS.values():
        # Only those that exist, as this runs at each change and there may be 512.
        for index in sorted({each - values.MAPPING_OFFSET for each, _ in shown}.intersection(records)):
            mapping = index + values.MAPPING_OFFSET
            text = ""
            objects: dict[Address, int] = {}
            count = shown.get((mapping, 0), 0)
            subs = range(1, 1 if count in set(Multiplex) else count + 1)
            if (mapping, 0) not in shown or any((mapping, sub) not in shown for sub in subs):
                continue
            for record, last in ((index, values.EVENT_TIMER), (mapping, len(subs))):
                kept = {sub: shown[record, sub] for sub in range(1, last + 1) if (record, sub) in shown}
                text += _record(record, _record_name(record), kept | {0: count if record == mapping else last})
            for entry in (MappingEntry.of(shown[mapping, sub]) for sub in subs):
                objects[entry.address] = max(entry.bits, objects.get(entry.address, 0))
            for each in dict.fromkeys(at for at, _ in objects if at not in values.DUMMIES):
                text += _mapped(each, {sub: bits for (at, sub), bits in objects.items() if at == each}, profile)
            yield text


def _record(index: int, name: str, subs: Mapping[int, int]) -> str:
    each = ((sub, (UNSIGNED32 if sub else UNSIGNED8).code, f"DefaultValue={value}\n") for sub, value in subs.items())
    members = "".join(variable_text(f"{index:X}sub{sub:X}", f"{sub}", code, default) for sub, code, default in each)
    return f"[{index:X}]\nParameterName={name}\nObjectType=9\nSubNumber={len(subs)}\n{members}"


def _mapped(index: int, bits: Mapping[int, int], profile: int = 0) -> str:
    """Return the EDS text of an object that a PDO maps, named by the device's profile, or else by its index."""
    found = {sub: profiles.object_of(profile, (index, sub)) for sub in bits}

    def code(sub: int) -> int:
        type_ = each.type if (each := found[sub]) else None
        fits = type_ is not None and type_.bits == bits[sub]
        return type_.code if fits and type_ else next(each.code for each in UNSIGNED if each.bits >= bits[sub])

    names = {sub: each.name if each else f"0x{index:04X}" for sub, each in found.items()}
    if list(bits) == [0]:
        return variable_text(f"{index:X}", names[0] if found[0] else f"0x{index:04X}:00", code(0))
    members = (variable_text(f"{index:X}sub{sub:X}", f"{names[sub]}:{sub:02X}", code(sub)) for sub in bits)
    return f"[{index:X}]\nParameterName=0x{index:04X}\nObjectType=9\nSubNumber={len(bits)}\n{''.join(members)}"


UNSIGNED = sorted(
    (each for each in values.DATA_TYPES.values() if each.is_integer and not each.is_signed and each.bits),
    key=lambda each: each.bits,
)
