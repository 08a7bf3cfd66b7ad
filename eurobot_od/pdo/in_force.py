"""The mapping in force: what a bus has shown of its devices' parameters, over what their files say.

A write that a device has confirmed, and its answer to a read, count more than its file, until the device starts anew:
then it has what it was told to store, or else its file's values again (CiA 301, 7.5.2.13). Of a device without a file,
what was shown makes one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

from eurobot_od.errors import DictionaryError
from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import ALL_NODES, UNSIGNED8, UNSIGNED32, Address, MappingEntry, Multiplex, Value

SERVICES = (standard.SYNC, standard.TIME, standard.EMCY, standard.SDO_REQUESTS, standard.SDO_ANSWERS)
"""Objects that say where a service is, besides those of the PDOs."""

SETTINGS = (standard.SYNC_PERIOD, standard.HEARTBEAT_TIME)
"""Objects that say how often something comes."""


Describe: TypeAlias = Callable[[int, Mapping[Address, int], Dictionary | None], Dictionary | None]
"""Returns the description of a node by what it has shown of 0x1000 and 0x1018; the last one is its named file."""


def nothing_known(*_: object) -> None:
    """Describe no node: there is no library."""


def is_followed(address: Address) -> bool:
    """Whether an object is one of those that say what other frames mean."""
    in_record = values.pdo_of(address[0]) is not None or address[0] == standard.CONSUMED_HEARTBEATS
    return in_record or address in (*SERVICES, *SETTINGS)


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
        self._present: dict[int, Dictionary] = {}
        self._learned: dict[int, tuple[Dictionary, ...]] = {}
        self._stored: dict[int, dict[Address, int]] = {}
        for each in learned:
            self._learned[each.node_id] = (*self._learned.get(each.node_id, ()), each)
            # After a start, too: nothing is known of what it has then, and most have the same.
            self._stored.setdefault(each.node_id, {}).update(_numbers(each))
        self._shown = {node_id: dict(shown) for node_id, shown in self._stored.items()}

    @property
    def described(self) -> list[Dictionary]:
        """The devices that have files, each as it is now."""
        return [self._present.get(node_id, each) for node_id, each in self._files.items()]

    @property
    def learned(self) -> list[Dictionary]:
        """What is known of the devices that have no files and have shown a mapping."""
        return [each for parts in self._learned.values() for each in parts]

    def shown(self, node_id: int) -> Mapping[Address, int]:
        """Return what a device has shown that it has by now."""
        return self._shown.get(node_id, {})

    def renumber(self, identity: Mapping[int, int], node_id: int) -> Dictionary | None:
        """Take in that the device of an identity, by its parts as LSS_IDENTITY counts them, has a new node-ID.

        Return its description by the one file for such devices; None without one, with several, or if that node-ID has
        a file.
        """
        files = {each.file: each for each in self._files.values() if _is_of(each.identity, identity)}
        if node_id in self._files or len(files) != 1:
            return None
        (file,) = files.values()
        # Besides the one that the file is for: another device of its kind may have that node-ID.
        made = self._files[node_id] = file.renumbered(node_id).named(f"{file.name}_{node_id}")
        return made

    def show(self, node_id: int, address: Address, octets: bytes) -> bool:
        """Take in what a device has at an address; return whether other frames mean something else now."""
        shown = self._shown.setdefault(node_id, {})
        if address[0] == standard.IDENTITY or address == standard.DEVICE_TYPE:
            return self._identified(node_id, address, octets)
        if address[0] == standard.STORE:
            if octets == standard.SIGNATURES[standard.STORE]:
                self._stored[node_id] = dict(shown)
        elif address[0] == standard.RESTORE:
            if octets == standard.SIGNATURES[standard.RESTORE]:
                self._stored.pop(node_id, None)  # in force from the next start on
        elif is_followed(address):
            before = self._said_by(node_id, address)
            shown[address] = int.from_bytes(octets, "little")
            # A device is made anew when it matters, and not at each of the dozen writes that map one PDO.
            return before != self._said_by(node_id, address) and self._changed(node_id)
        return False

    def _identified(self, node_id: int, address: Address, octets: bytes) -> bool:
        """Take in what a device is; return whether it has another description now."""
        numbers = self._identities.setdefault(node_id, {})
        numbers[address] = int.from_bytes(octets, "little")
        found = self._describe(node_id, numbers, self._named.get(node_id))
        if found is None or found is self._files.get(node_id):
            return False
        self._files[node_id] = found
        self._learned.pop(node_id, None)
        self._present.pop(node_id, None)
        self._changed(node_id)  # what it has shown before counts more than the file
        return True

    def _said_by(self, node_id: int, address: Address) -> Any:
        """Return what an object and those beside it say of a device's frames; None for a PDO that is not valid."""
        shown, file = self._shown[node_id], self._files.get(node_id)

        def present(index: int, subindex: int) -> Any:
            found = shown.get((index, subindex))
            return file.default((index, subindex)) if found is None and file else found

        index = values.pdo_of(address[0])
        if index is None:
            return present(*address)
        settings = [present(index, sub) for sub in range(1, values.EVENT_TIMER + 1)]
        if settings[0] is None or settings[0] & values.NOT_VALID:
            return None
        mapping = index + values.MAPPING_OFFSET
        return settings, [present(mapping, sub) for sub in range(min(present(mapping, 0) or 0, values.MAX_BITS) + 1)]

    def start(self, node_id: int) -> bool:
        """Take in that a device starts anew, or all; return whether other frames mean something else now."""
        changed = False
        for each in list(self._shown) if node_id == ALL_NODES else [node_id]:
            before, self._shown[each] = self._shown.get(each, {}), dict(self._stored.get(each, {}))
            changed |= before != self._shown[each] and self._changed(each)
        return changed

    def _changed(self, node_id: int) -> bool:
        """Make a device anew; return whether what it sends or receives has changed."""
        file, shown = self._files.get(node_id), self._shown[node_id]
        if file is None:
            known, self._learned[node_id] = self._learned.get(node_id, ()), made(node_id, shown)
            return known != self._learned[node_id]
        before, self._present[node_id] = self._present.get(node_id, file), file.configured(shown)
        return bool(_said(before) != _said(self._present[node_id]))


def _is_of(file: Sequence[int], named: Mapping[int, int]) -> bool:
    """Whether a file is for devices of an identity: of that product, and of that vendor if the file says its own."""
    vendor, product, *_ = file
    return bool(product) and product == named.get(1) and vendor in (0, named.get(0, vendor))


def _said(device: Dictionary) -> Any:
    """Return what a device's parameters say of its frames."""
    pdos = device.read_pdos(device.default, lambda _: None, listening=True)
    return [each for each in pdos if each.valid], [device.default(each) for each in SERVICES]


# A device without a file

MOST_PDOS = 1 << 11
"""How many that were made are kept: twice as many as a device can have."""


def _numbers(device: Dictionary) -> dict[Address, int]:
    """Return what a device that was made has of what is followed."""
    numbers = {each: device.number(each) for each in device.addresses() if is_followed(each)}
    return {address: number for address, number in numbers.items() if number is not None}


def made(node_id: int, shown: Mapping[Address, Value]) -> tuple[Dictionary, ...]:
    """Return a dictionary of the services that are shown, and of each PDO whose whole mapping is.

    Each has its own, as they are shown one by one: a device of 64 PDOs would be read 64 times.
    """
    numbers = {address: value for address, value in shown.items() if isinstance(value, int)}
    texts = filter(None, ("".join(_services(numbers)), *_pdos(numbers)))
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
            yield _variable(f"{index:X}", f"0x{index:04X}", UNSIGNED32.code, f"DefaultValue={kept[0]}\n")
        elif kept:
            yield _record(index, f"0x{index:04X}", {0: max(kept)} | kept)


def _pdos(shown: Mapping[Address, int]) -> Iterator[str]:
    for direction, records in values.COMMUNICATION_RECORDS.items():
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
                name = f"{direction.name} {index - records[0] + 1} {'parameter' if record == index else 'mapping'}"
                text += _record(record, name, kept | {0: count if record == mapping else last})
            for entry in (MappingEntry.of(shown[mapping, sub]) for sub in subs):
                objects[entry.address] = max(entry.bits, objects.get(entry.address, 0))
            for each in dict.fromkeys(at for at, _ in objects if at not in values.DUMMIES):
                text += _mapped(each, {sub: bits for (at, sub), bits in objects.items() if at == each})
            yield text


def _record(index: int, name: str, subs: Mapping[int, int]) -> str:
    each = ((sub, (UNSIGNED32 if sub else UNSIGNED8).code, f"DefaultValue={value}\n") for sub, value in subs.items())
    members = "".join(_variable(f"{index:X}sub{sub:X}", f"{sub}", code, default) for sub, code, default in each)
    return f"[{index:X}]\nParameterName={name}\nObjectType=9\nSubNumber={len(subs)}\n{members}"


def _mapped(index: int, bits: Mapping[int, int]) -> str:
    """Write an object that a PDO maps, by the standard's or a profile's name, or else by its index."""
    name, type_ = standard.PROFILE_OBJECTS.get(index, ("", None))

    def code(sub: int) -> int:
        fits = type_ is not None and type_.bits == bits[sub]
        return type_.code if fits and type_ else next(each.code for each in UNSIGNED if each.bits >= bits[sub])

    if list(bits) == [0]:
        return _variable(f"{index:X}", name or f"0x{index:04X}:00", code(0))
    members = (_variable(f"{index:X}sub{sub:X}", f"{name or f'0x{index:04X}'}:{sub:02X}", code(sub)) for sub in bits)
    return f"[{index:X}]\nParameterName=0x{index:04X}\nObjectType=9\nSubNumber={len(bits)}\n{''.join(members)}"


UNSIGNED = sorted(
    (each for each in values.DATA_TYPES.values() if each.is_integer and not each.is_signed and each.bits),
    key=lambda each: each.bits,
)


def _variable(section: str, name: str, type_: int, more: str = "") -> str:
    return f"[{section}]\nParameterName={name}\nObjectType=7\nDataType={type_}\nAccessType=rw\nPDOMapping=1\n{more}"
