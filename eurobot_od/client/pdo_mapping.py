"""Changes the PDOs of a device by CiA 301's procedure: in which order, and a mapping from beginning to end.

A PDO is switched off, its mapping is emptied, its entries and their number are written, and it becomes what it was
before or is to be (7.5.2.36, 7.5.2.38).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.client.master import Procedure, RemoteNode
from eurobot_od.errors import ConfigurationError, LocalError
from eurobot_od.od.concise import Write
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import (
    COB_ID,
    MAPPABLE,
    MAPPING_OFFSET,
    MAX_BITS,
    NOT_VALID,
    Address,
    MappingEntry,
    label,
    pdo_of,
)
from eurobot_od.support.texts import amount

# The order of writes


Bytes: TypeAlias = Mapping[Address, bytes]
"""The bytes of objects, by address."""


def procedure_objects(addresses: Iterable[Address]) -> Iterator[Address]:
    """Yield the objects that the procedure needs: each PDO's COB-ID, and the number of its mapping entries."""
    for address in addresses:
        pdo = pdo_of(address[0])
        if pdo is not None:
            yield pdo, COB_ID
            if address[0] != pdo:
                yield address[0], 0


def in_order(wanted: Bytes, present: Bytes) -> list[Write]:
    """Return the writes that give objects their `wanted` bytes, without those that are `present` already.

    Other objects come first. Then all PDOs that change become invalid, each mapping is emptied and gets its entries and
    their number, the rest of the communication records follows, and the PDOs become what is wanted (CiA 301, 7.5.2.36
    and 7.5.2.38). `wanted` or `present` must have the `procedure_objects`.
    """
    former, final = {**wanted, **present}, {**present, **wanted}
    pdos = sorted({pdo for address in wanted if (pdo := pdo_of(address[0])) is not None})
    others = (Write(address, data) for address, data in wanted.items() if pdo_of(address[0]) is None)
    entries = ((pdo, int.from_bytes(former[pdo, COB_ID], "little")) for pdo in pdos)
    invalid = (Write((pdo, COB_ID), (entry | NOT_VALID).to_bytes(4, "little")) for pdo, entry in entries)
    mapped = (write for pdo in pdos for write in _mapping(pdo + MAPPING_OFFSET, wanted, final))
    communication = (Write(a, data) for a, data in sorted(wanted.items()) if a[0] in pdos and a[1] > COB_ID)
    valid = (Write((pdo, COB_ID), final[pdo, COB_ID]) for pdo in pdos)
    needed, state = [], dict(present)
    for write in (*others, *invalid, *mapped, *communication, *valid):
        if state.get(write.address) != write.data:
            needed.append(write)
        state[write.address] = write.data
    return needed


def _mapping(index: int, wanted: Bytes, final: Bytes) -> Iterator[Write]:
    """Yield the writes of one mapping record; entries beyond the number of entries are left alone."""
    entries = sorted(address for address in wanted if address[0] == index)
    if not entries:
        return
    count = final[index, 0]
    yield Write((index, 0), b"\0")
    yield from (Write(address, wanted[address]) for address in entries if 1 <= address[1] <= count[0])
    yield Write((index, 0), count)


# A mapping


def mapping_entries(pdo: Pdo, things: Sequence[ODVariable]) -> list[int]:
    """Return the mapping entries for some objects; raises LocalError for objects that cannot be mapped into the PDO."""
    for thing in things:
        where = label(address_of(thing), thing.qualname)
        if not thing.pdo_mappable or not data_type(thing).bits:
            raise LocalError(f"{where} cannot be mapped: its file says so")
        if thing.access_type not in MAPPABLE[pdo.direction]:
            raise LocalError(f"{where} is {thing.access_type}, which a {pdo.direction.name} cannot carry")
    bits = sum(data_type(thing).bits for thing in things)
    if bits > MAX_BITS:
        raise LocalError(f"{amount(bits, 'bit')} are mapped, a PDO has at most {MAX_BITS}")
    return [MappingEntry(*address_of(thing), data_type(thing).bits).number for thing in things]


@Procedure
async def map_objects(node: RemoteNode, dictionary: Dictionary, pdo: Pdo, things: Sequence[ODVariable]) -> None:
    """Map objects into a PDO of a node, in their order, and read the mapping back.

    Raises LocalError for what cannot be mapped, ConfigurationError if the node then has something else, RemoteError for
    a write that it refuses (the PDO is then off), BusError.
    """
    entries = mapping_entries(pdo, things)
    cob_id: Address = (pdo.index, COB_ID)
    wanted = {(pdo.mapping_index, 0): bytes([len(entries)])}
    wanted |= {(pdo.mapping_index, sub): entry.to_bytes(4, "little") for sub, entry in enumerate(entries, start=1)}
    # As the node has it now, valid or not: it gets this back at the end.
    wanted[cob_id] = await node.upload.steps(cob_id)
    for address, data in in_order(wanted, {}):
        await node.download.steps(address, data, _name(dictionary, address))
    for address, data in wanted.items():
        found = await node.upload.steps(address, _name(dictionary, address))
        if found != data:
            what = f"{label(address)} is 0x{found[::-1].hex().upper()}, not 0x{data[::-1].hex().upper()}"
            raise ConfigurationError(what)


def _name(dictionary: Dictionary, address: Address) -> str:
    variable = dictionary.variable(address)
    return variable.qualname if variable else ""
