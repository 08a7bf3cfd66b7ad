"""The order in which objects of a device are written so that its PDOs change by CiA 301's procedure.

Bytes by address in, writes in their order out; no bus and no dictionary.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeAlias

from eurobot_od.od.concise import Write
from eurobot_od.od.values import MAPPING_OFFSET, NOT_VALID, PDO_COUNT, Address, PdoDirection

Bytes: TypeAlias = Mapping[Address, bytes]
"""Objects' bytes by address."""

COB_ID = 1
"""Sub-index of the COB-ID in a communication record."""


def pdo_of(address: Address) -> int | None:
    """Return the index of the communication record of the PDO that has this parameter; None for any other object."""
    index = address[0]
    has_pdo = any(each.value <= index < each.value + MAPPING_OFFSET + PDO_COUNT for each in PdoDirection)
    return index & ~MAPPING_OFFSET if has_pdo else None  # a mapping record's index is the other's with one bit set


def procedure_objects(addresses: Iterable[Address]) -> Iterator[Address]:
    """Give what the procedure needs when these objects change: each PDO's COB-ID, and the number of its entries."""
    for address in addresses:
        pdo = pdo_of(address)
        if pdo is not None:
            yield pdo, COB_ID
            if address[0] != pdo:
                yield address[0], 0


def in_order(wanted: Bytes, present: Bytes) -> list[Write]:
    """Return the writes that give objects their `wanted` bytes; what is `present` already is not written again.

    Other objects come first. Then all PDOs that change become invalid, each mapping goes empty and gets its entries
    and their number, the rest of the communication records follows, and the PDOs become what they are to be (CiA 301,
    7.5.2.36 and 7.5.2.38). One of the two must have the `procedure_objects`.
    """
    former, final = {**wanted, **present}, {**present, **wanted}
    pdos = sorted({pdo for address in wanted if (pdo := pdo_of(address)) is not None})
    others = (Write(address, data) for address, data in wanted.items() if pdo_of(address) is None)
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
    """Give the writes of one mapping record; entries after the last that counts are left alone."""
    entries = sorted(address for address in wanted if address[0] == index)
    if not entries:
        return
    count = final[index, 0]
    yield Write((index, 0), b"\0")
    yield from (Write(address, wanted[address]) for address in entries if 1 <= address[1] <= count[0])
    yield Write((index, 0), count)
