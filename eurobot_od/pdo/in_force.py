"""The mapping in force: what a bus has shown of its devices' parameters, over what their files say.

A write that a device has confirmed, and its answer to a read, count more than its file, until the device starts anew:
then it has what it was told to store, or else its file's values again (CiA 301, 7.5.2.13). A file only fills in: an
object or a PDO that it lacks is there once the device has taken it. Of a device without a file, what was shown makes
one.

What a log cannot know is not guessed. A mapping entry is unknown if it was written and the log does not have what, as
long as the device has not answered a write of it, or if it may have been written before the log begins: when a master
is seen to end a mapping whose beginning is not there, or when a device answers with something else than its file says.
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
"""Objects that say where a service is, besides those of the PDOs and of further SDO channels."""

SETTINGS = (standard.SYNC_PERIOD, standard.HEARTBEAT_TIME)
"""Objects that say how often something comes."""

SDO_CHANNELS = frozenset((*standard.SDO_SERVERS, *standard.SDO_CLIENTS))


Describe: TypeAlias = Callable[[int, Mapping[Address, int], Dictionary | None], Dictionary | None]
"""Returns the description of a node by what it has shown of 0x1000 and 0x1018; the last one is its named file."""


def nothing_known(*_: object) -> None:
    """Describe no node: there is no library."""


def is_followed(address: Address) -> bool:
    """Return whether an object is one of those that say what other frames mean."""
    index = address[0]
    in_record = values.pdo_of(index) is not None or index in SDO_CHANNELS or index == standard.CONSUMED_HEARTBEATS
    return in_record or address in (*SERVICES, *SETTINGS)


class LeftIdentifier(NamedTuple):
    """An identifier that a PDO has left: the PDO's communication record, where it is `now`, and how that was seen.

    `now` is None for a PDO that is switched off. `how` ends a sentence: "by SDO at line 2".
    """

    record: int
    now: int | None
    how: str


@dataclass
class DeviceInForce:
    """What a device has shown that it has, and which objects were written, nobody knows with what (`unknown`).

    `asked` are entries of mappings that a master has asked to write, and the device has not answered.
    `begun` are the PDOs whose configuration the log has from its beginning, by their communication records; all of them
    once the device `is_started`. The mapping of those in `doubted` may be another than the file's, but for what was
    shown. `left` are identifiers that PDOs have left.
    """

    shown: dict[Address, int] = field(default_factory=dict)
    unknown: set[Address] = field(default_factory=set)
    asked: set[Address] = field(default_factory=set)
    begun: set[int] = field(default_factory=set)
    doubted: set[int] = field(default_factory=set)
    left: dict[int, LeftIdentifier] = field(default_factory=dict)
    is_started: bool = False

    def copy(self, is_started: bool) -> DeviceInForce:
        """Return what the device has after it starts anew."""
        parts = dict(self.shown), set(self.unknown), set[Address](), set(self.begun), set(self.doubted), dict(self.left)
        return DeviceInForce(*parts, is_started)

    def is_open(self, index: int) -> bool:
        """Return whether the mapping of a PDO may have been rewritten before the log begins."""
        return not (self.is_started or index in self.begun)

    def present(self, file: Dictionary | None) -> dict[Address, int]:
        """Return what is in force in place of the file's values, with what is not known marked as such."""
        unknown = self.unknown | self.asked
        present = {address: value for address, value in self.shown.items() if address not in unknown}
        if file is None:
            return present
        touched = {index for address in (*self.shown, *unknown) if (index := values.pdo_of(address[0]))}
        for index in touched:
            present |= self._of_unknown(file, index)
        return present

    def _of_unknown(self, file: Dictionary, index: int) -> dict[Address, int]:
        """Return what stands for the unknown parameters of a PDO."""
        mapping, found = index + values.MAPPING_OFFSET, dict[Address, int]()
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
        """Return whether nobody knows what an entry of a mapping is."""
        index = values.pdo_of(address[0])
        is_missing = address not in self.shown and address[0] not in file.members
        is_asked = any(values.pdo_of(each) == index for each, _ in self.asked)
        is_in_doubt = index is not None and (index in self.doubted or (is_asked and self.is_open(index)))
        is_doubted = address not in self.shown and is_in_doubt
        return address in self.unknown or address in self.asked or is_missing or is_doubted


class InForce:
    """What the devices of one bus have in force; at first what their files say, or what was `learned` of them."""

    def __init__(
        self,
        dictionaries: Iterable[Dictionary],
        learned: Iterable[Dictionary] = (),
        describe: Describe = nothing_known,
    ) -> None:
        self._files = {each.node_id: each for each in dictionaries}
        self._named, self._describe = dict(self._files), describe
        self._identities: dict[int, dict[Address, int]] = {}
        self._objects: dict[int, set[int]] = {}
        self._present: dict[int, Dictionary] = {}
        self._learned: dict[int, tuple[Dictionary, ...]] = {}
        self._stored: dict[int, DeviceInForce] = {}
        for each in learned:
            self._learned[each.node_id] = (*self._learned.get(each.node_id, ()), each)
            # After a start, too: nothing is known of what it has then, and most have the same.
            self._stored.setdefault(each.node_id, DeviceInForce()).shown.update(_numbers(each))
            if (device_type := each.number(standard.DEVICE_TYPE)) is not None:
                self._identities[each.node_id] = {standard.DEVICE_TYPE: device_type}
        self._devices = {node_id: stored.copy(is_started=False) for node_id, stored in self._stored.items()}
        self._all_started = False

    @property
    def described(self) -> list[Dictionary]:
        """The devices that have files, each as it is now."""
        return [self._present.get(node_id, each) for node_id, each in self._files.items()]

    @property
    def learned(self) -> list[Dictionary]:
        """What is known of the devices that have no files and have shown a mapping."""
        return [each for parts in self._learned.values() for each in parts]

    @property
    def left(self) -> dict[int, dict[int, LeftIdentifier]]:
        """The identifiers that PDOs have left, by node-ID and identifier."""
        return {node_id: each.left for node_id, each in self._devices.items() if each.left}

    def shown(self, node_id: int) -> Mapping[Address, int]:
        """Return what a device has shown that it has by now."""
        return self._devices[node_id].shown if node_id in self._devices else {}

    def profile(self, node_id: int) -> int:
        """Return the device profile that a device has shown by 0x1000, or by its objects; 0: none."""
        device_type = self._identities.get(node_id, {}).get(standard.DEVICE_TYPE, 0)
        return profiles.profile_shown(device_type, self._objects.get(node_id, ()))

    def renumber(self, identity: Mapping[int, int], node_id: int) -> Dictionary | None:
        """Take in that the device of an identity, by its parts as LSS_IDENTITY counts them, has a new node-ID.

        Return its description by the one file for such devices; None without one, with several, or if that node-ID has
        a file.
        """
        return self._renumber([each for each in self._files.values() if _is_of(Identity.of(each), identity)], node_id)

    def renumber_only(self, heard: Set[int], node_id: int) -> Dictionary | None:
        """Take in that the one device on a bus has a new node-ID; of several files that of the one that was `heard`.

        Return as `renumber` does; None if several were heard, or if several files may be meant.
        """
        files = list(self._files.values())
        meant = [each for each in files if each.node_id in heard] or files
        return self._renumber(meant, node_id) if len(heard) <= 1 and len(meant) == 1 else None

    def _renumber(self, found: Iterable[Dictionary], node_id: int) -> Dictionary | None:
        files = {each.file: each for each in found}
        if node_id in self._files or len(files) != 1:
            return None
        (file,) = files.values()
        # Besides the one that the file is for: another device of its kind may have that node-ID.
        made = self._files[node_id] = file.renumbered(node_id).named(f"{file.name}_{node_id}")
        return made

    def _device(self, node_id: int) -> DeviceInForce:
        return self._devices.setdefault(node_id, DeviceInForce(is_started=self._all_started))

    def show(self, node_id: int, address: Address, octets: bytes, written: str = "") -> bool:
        """Take in what a device has at an address; return whether other frames mean something else now.

        Args:
            node_id: node-ID of the device, 1..127
            address: index and sub-index of the object
            octets: its value as an SDO carries it
            written: where it was written, such as "by SDO at line 2"; empty for what the device has answered to a read
        """
        device, profile = self._device(node_id), self.profile(node_id)
        is_news = self._show(node_id, device, address, octets, written)
        if profile == self.profile(node_id) or node_id in self._files:
            return is_news
        self._changed(node_id)  # its objects have names now
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
                self._stored.pop(node_id, None)  # in force from the next start on
        elif is_followed(address):
            before, value = self._said_by(node_id, address), int.from_bytes(octets, "little")
            self._doubt(node_id, address, value, is_written=bool(written))
            if address[1] == values.COB_ID and address[0] in values.COMMUNICATIONS:
                self._move(node_id, address[0], value, written)
            if address[0] in values.MAPPINGS and address[1]:
                self._has_object(node_id, MappingEntry.of(value).index)
            device.shown[address] = value
            device.asked.discard(address)
            device.unknown.discard(address)
            # A device is made anew when it matters, and not at each of the dozen writes that map one PDO.
            return before != self._said_by(node_id, address) and self._changed(node_id)
        return False

    def _has_object(self, node_id: int, index: int) -> None:
        if index in profiles.AREA:
            self._objects.setdefault(node_id, set()).add(cia402.on_first_axis(index))

    def _identified(self, node_id: int, address: Address, octets: bytes) -> bool:
        """Take in what a device is; return whether it has another description now."""
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
        self._changed(node_id)  # what it has shown before counts more than the file
        return True

    def ask(self, node_id: int, address: Address) -> bool:
        """Take in that a master asks to write an object: until the answer nobody knows it; return as `show` does."""
        if address[0] not in values.MAPPINGS or not address[1]:
            return False
        before = self._said_by(node_id, address)
        self._device(node_id).asked.add(address)
        return before != self._said_by(node_id, address) and self._changed(node_id)

    def refuse(self, node_id: int, address: Address) -> bool:
        """Take in that a device has refused a write, and has what it had before; return as `show` does."""
        device = self._device(node_id)
        if address not in device.asked:
            return False
        before = self._said_by(node_id, address)
        device.asked.discard(address)
        return before != self._said_by(node_id, address) and self._changed(node_id)

    def forget(self, node_id: int, address: Address) -> bool:
        """Take in that an object was written, nobody knows with what; return as `show` does."""
        if not is_followed(address) or values.pdo_of(address[0]) is None:
            return False
        before, device = self._said_by(node_id, address), self._device(node_id)
        self._doubt(node_id, address, None, is_written=True)
        device.shown.pop(address, None)
        device.asked.discard(address)
        device.unknown.add(address)
        return before != self._said_by(node_id, address) and self._changed(node_id)

    def _doubt(self, node_id: int, address: Address, value: int | None, is_written: bool) -> None:
        """Note what a value of a PDO's parameter says of the others, which the log may not have."""
        index, device = values.pdo_of(address[0]), self._device(node_id)
        if index is None:
            return
        is_entry, known = address[0] != index, self._number(node_id, address)
        if not is_written:
            if is_entry and known is not None and known != value and address not in device.unknown:
                device.doubted.add(index)
        elif value is not None and self._begins(address, index, value):
            device.begun.add(index)
        # A PDO that was valid is switched on only by a master that has switched it off before.
        elif device.is_open(index) and (is_entry or (address[1] == values.COB_ID and _is_valid(known))):
            device.doubted.add(index)

    def _begins(self, address: Address, index: int, value: int) -> bool:
        """Return whether a write begins to configure a PDO, by which all that follows is in the log."""
        is_off = address == (index, values.COB_ID) and not _is_valid(value)
        return is_off or (address == (index + values.MAPPING_OFFSET, 0) and value == 0)

    def _move(self, node_id: int, index: int, value: int, written: str) -> None:
        """Note which identifier a PDO leaves, and which it takes."""
        device, known = self._device(node_id), self._number(node_id, (index, values.COB_ID))
        now = values.identifier(value) if _is_valid(value) else None
        if now is not None:
            device.left.pop(now, None)
        before = None if known is None else values.identifier(known)
        how = written or "as it has answered"
        # What is said of a PDO that was off before stays: since when it is off.
        if before and before != now and (_is_valid(known) or before not in device.left):
            device.left[before] = LeftIdentifier(index, now, how)
        if now is None and values.identifier(value):
            device.left.setdefault(values.identifier(value), LeftIdentifier(index, now, how))

    def _number(self, node_id: int, address: Address) -> int | None:
        """Return the number that a device has at an address by what was shown, or else by its file."""
        found, file = self.shown(node_id).get(address), self._files.get(node_id)
        return file.number(address) if found is None and file else found

    def _said_by(self, node_id: int, address: Address) -> Any:
        """Return what an object and those beside it say of a device's frames; None for a PDO that is not valid."""
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
        """Take in that a device starts anew, or all; return whether other frames mean something else now."""
        changed, self._all_started = False, self._all_started or node_id == ALL_NODES
        for each in list(self._devices) if node_id == ALL_NODES else [node_id]:
            file, before = self._files.get(each), self._device(each)
            self._devices[each] = now = self._stored.get(each, DeviceInForce()).copy(is_started=True)
            is_other = (before.present(file), before.left) != (now.present(file), now.left)
            changed |= is_other and self._changed(each)
        return changed

    def _changed(self, node_id: int) -> bool:
        """Make a device anew; return whether what it sends or receives has changed."""
        file, device = self._files.get(node_id), self._device(node_id)
        present = device.present(file)
        if file is None:
            profile = self.profile(node_id)
            known, self._learned[node_id] = self._learned.get(node_id, ()), made(node_id, present, profile)
            return known != self._learned[node_id]
        before = self._present.get(node_id, file)
        now = self._present[node_id] = completed(file, present).configured(present)
        return bool(_said(before) != _said(now))


def _is_valid(cob_id: int | None) -> bool:
    return cob_id is not None and not cob_id & values.NOT_VALID


def _is_of(file: Sequence[int], named: Mapping[int, int]) -> bool:
    """Return whether a file is for devices of an identity: of that product, and of that vendor if it says its own."""
    vendor, product, *_ = file
    return bool(product) and product == named.get(1) and vendor in (0, named.get(0, vendor))


def _said(device: Dictionary) -> Any:
    """Return what a device's parameters say of its frames."""
    pdos = device.read_pdos(device.default, lambda _: None, listening=True)
    # Of one that is off, its identifier: a frame under it is not that of another PDO.
    said = [each if each.valid else (each.index, each.cob_id) for each in pdos]
    return said, [device.default(each) for each in SERVICES], list(sdo_channels(device))


# A device whose file lacks what it has


def completed(file: Dictionary, present: Mapping[Address, int]) -> Dictionary:
    """Return a device's file with the records that it lacks, and with the objects that are mapped all the same."""
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
    """Yield the objects that are mapped and are not in a file, or are there with fewer bits than are mapped."""
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
"""How many that were made are kept: twice as many as a device can have."""


def _numbers(device: Dictionary) -> dict[Address, int]:
    """Return what a device that was made has of what is followed."""
    numbers = {each: device.number(each) for each in device.addresses() if is_followed(each)}
    return {address: number for address, number in numbers.items() if number is not None}


def made(node_id: int, shown: Mapping[Address, Value], profile: int = 0) -> tuple[Dictionary, ...]:
    """Return a dictionary of the services that are shown, and of each PDO whose whole mapping is.

    Each has its own, as they are shown one by one: a device of 64 PDOs would be read 64 times. Each says in 0x1000
    which `profile` the device has; 0: it is not known.
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
    except DictionaryError:  # nothing in it can be used: a mapping of objects that no device can have
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
        # Few of the 512 are there, and all are looked for at each change.
        for index in sorted({each - values.MAPPING_OFFSET for each, _ in shown}.intersection(records)):
            mapping, text = index + values.MAPPING_OFFSET, ""
            objects: dict[Address, int] = {}
            count = shown.get((mapping, 0), 0)
            subs = range(1, (0 if count in set(Multiplex) else count) + 1)
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
    """Write an object that a PDO maps, by its device's profile, or else by its index."""
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
