"""Maps other objects into a PDO of a node, by CiA 301's procedure, and reads back what the node has then.

The PDO is switched off, its mapping emptied, its entries and their number written, and it becomes what it was before
(7.5.2.36, 7.5.2.38).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from eurobot_od.client.master import RemoteNode
from eurobot_od.client.pdo_order import in_order
from eurobot_od.client.procedure import Procedure
from eurobot_od.errors import ConfigurationError, LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import address_of, data_type
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import COB_ID, MAPPABLE, MAX_BITS, Address, label
from eurobot_od.support.amounts import amount

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


def mapping_entries(pdo: Pdo, things: Sequence[ODVariable]) -> list[int]:
    """Return the entries of a mapping of some objects; raises LocalError for what cannot be mapped into the PDO."""
    for thing in things:
        where = label(address_of(thing), thing.qualname)
        if not thing.pdo_mappable or not data_type(thing).bits:
            raise LocalError(f"{where} cannot be mapped: its file says so")
        if thing.access_type not in MAPPABLE[pdo.direction]:
            raise LocalError(f"{where} is {thing.access_type}, which no {pdo.direction.name} carries")
    bits = sum(data_type(thing).bits for thing in things)
    if bits > MAX_BITS:
        raise LocalError(f"{amount(bits, 'bit')} are mapped, a PDO has at most {MAX_BITS}")
    return [thing.index << 16 | thing.subindex << 8 | data_type(thing).bits for thing in things]


@Procedure
async def map_objects(node: RemoteNode, dictionary: Dictionary, pdo: Pdo, things: Sequence[ODVariable]) -> None:
    """Map objects into a PDO of a node, in their order, and read back that they are.

    Raises LocalError for what cannot be mapped, ConfigurationError if the node has something else then, RemoteError for
    a write that it refuses (the PDO is off then), BusError.
    """
    entries = mapping_entries(pdo, things)
    cob_id: Address = (pdo.index, COB_ID)
    wanted = {(pdo.mapping_index, 0): bytes([len(entries)])}
    wanted |= {(pdo.mapping_index, sub): entry.to_bytes(4, "little") for sub, entry in enumerate(entries, start=1)}
    # As the node has it now, valid or not: that is what it gets back at the end.
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
