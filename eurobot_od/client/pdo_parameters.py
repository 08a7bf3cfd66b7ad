"""What a node's PDOs are at present: their parameters, read over SDO in place of the file's.

A master may have moved or remapped a PDO since the file was written (CiA 301, 7.5.2.35 to 7.5.2.38).
"""

from __future__ import annotations

from eurobot_od.client.master import RemoteNode
from eurobot_od.client.pdo_order import pdo_of
from eurobot_od.client.procedure import Procedure
from eurobot_od.client.reading import read_bytes
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value


@Procedure
async def pdo_parameters(node: RemoteNode, dictionary: Dictionary) -> dict[Address, Value]:
    """Read the numbers that a node has in its PDOs' records; what it refuses is left out.

    Raises NoAnswer, RemoteError, BusError.
    """
    found = await read_bytes.steps(node, (each for each in dictionary.addresses() if pdo_of(each) is not None))
    return {address: int.from_bytes(data, "little") for address, data in found.items() if isinstance(data, bytes)}
