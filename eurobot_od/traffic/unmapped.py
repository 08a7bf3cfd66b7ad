"""PDOs that are not messages: multiplexed, switched off in their files, or known only by the predefined identifiers.

Rule of this file: what no file says is a guess, and is marked as one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import NamedTuple, Self

from eurobot_od.device.nmt import ALL_NODES
from eurobot_od.frame import EXTENDED
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import PdoDirection
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.words import object_words, plain, value_words

DEFAULT_PDOS = tuple(each for each in values.PREDEFINED if each.is_per_node)
"""What an identifier belongs to unless it was moved (CiA 301, 7.3.3)."""


class OtherPdo(NamedTuple):
    """What a frame is: a name, the nodes, its words; `damage` and `why` if that is wrong or not certain.

    Without `is_sent` its one node receives it. `length` is what it has to have, in bytes; None if nothing says it.
    """

    name: str
    nodes: tuple[str, ...]
    text: Callable[[bytes], str]
    is_sent: bool
    damage: Damage | None = None
    why: str = ""
    length: int | None = None

    @property
    def sender(self) -> str:
        """Who sends it; empty if that is not known."""
        return self.nodes[0] if self.is_sent else ""


class Unmapped:
    """The PDOs by identifier that are not messages, and guesses for identifiers of the predefined connection set."""

    def __init__(self, known: Mapping[int, OtherPdo], nodes: Mapping[int, str]) -> None:
        self._known, self._nodes = known, nodes

    @classmethod
    def of(cls, dictionaries: Iterable[Dictionary]) -> Self:
        """Return those of some devices."""
        devices = {each.node_id: each for each in dictionaries}
        pdos = [
            (each, pdo)
            for each in devices.values()
            for pdo in each.read_pdos(each.default, lambda _: None, listening=True)
            if pdo.cob_id
        ]
        known: dict[int, OtherPdo] = {}
        for device, pdo in pdos:
            is_sent = pdo.direction is PdoDirection.TPDO
            if not pdo.valid:
                why = f": {pdo.title} of {device.name}, off in its {device.file.suffix.lstrip('.').upper() or 'file'}"
                known[pdo.cob_id] = OtherPdo(pdo.title, (device.name,), plain, is_sent, Damage.SWITCHED_OFF, why)
        # Senders last, as they know what they send.
        for device, pdo in sorted(pdos, key=lambda each: each[1].direction is PdoDirection.TPDO):
            is_sent = pdo.direction is PdoDirection.TPDO
            if pdo.valid and pdo.multiplex is not None:
                name = f"{device.name}.{pdo.key}"
                text = partial(_mpdo_words, devices)
                known[pdo.cob_id] = OtherPdo(name, (device.name,), text, is_sent, length=MPDO_LENGTH)
        return cls(known, {node_id: each.name for node_id, each in devices.items()})

    def get(self, cob_id: int) -> OtherPdo | None:
        """Return what an identifier is for, by the files or else a guess; None if nothing fits."""
        if cob_id in self._known:
            return self._known[cob_id]
        if found := values.owner(cob_id, DEFAULT_PDOS):
            if not self._nodes:  # no file is missing where none is given
                return OtherPdo(f"PDO 0x{cob_id:03X}", (), plain, is_sent=False)
            node_id = found.node_id(cob_id)
            node = self._nodes.get(node_id or 0, f"node {node_id}")
            why = f": in no file; a guess by its identifier: {found.owner} of {node}"
            is_sent = PdoDirection.RPDO.name not in found.owner
            return OtherPdo(found.owner, (node,), plain, is_sent, Damage.UNKNOWN_IDENTIFIER, why)
        if found := values.owner(cob_id, values.RESERVED):
            why = f": in no file; its identifier is reserved for {found.owner}"
            return OtherPdo("", (), plain, False, Damage.UNKNOWN_IDENTIFIER, why)
        return None

    def defect(self, cob_id: int) -> tuple[Damage | None, str]:
        """Return what is wrong with the frames of an identifier, None for nothing, and why."""
        if found := self.get(cob_id):
            return found.damage, found.why
        return (Damage.EXTENDED if cob_id & EXTENDED else Damage.UNKNOWN_IDENTIFIER), ""


MPDO_LENGTH = values.MAX_BITS // 8
"""Bytes of a PDO whose frames name their object: node-ID, index, sub-index and four bytes of value."""

DESTINATION = 1 << 7
"""Bit of an MPDO's first byte: the node after it is who is meant, and not who sends (CiA 301, 7.2.2.6.2)."""


def _mpdo_words(devices: Mapping[int, Dictionary], data: bytes) -> str:
    """Say which object of which node has which value (CiA 301, 7.2.2.6); data of MPDO_LENGTH."""
    node_id, address, octets = data[0] & ~DESTINATION, (data[1] | data[2] << 8, data[3]), data[4:]
    device = devices.get(node_id)
    node = device.name if device else f"node {node_id}"
    receiver = "all nodes" if node_id == ALL_NODES else node
    whose = f"to {receiver}" if data[0] & DESTINATION else f"of {node}"
    variable = device.variable(address) if device else None
    type_ = values.DATA_TYPES.get(variable.data_type or 0) if variable else None
    # A shorter object has the first of the four bytes; how many, is unknown for a type without a size.
    size = type_.size if type_ and 0 < type_.size < 4 else 4
    return f"{object_words(device, address)} {whose} = {value_words(device, address, octets[:size])}"
