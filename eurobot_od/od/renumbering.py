"""A DCF of one node for another node of the same type: values that follow the node-ID are changed.

A value follows the node-ID if it is the default for its node: the file's `$NODEID+...`, the identifier of the
pre-defined connection set (CiA 301, 7.3.3), or the device's setting of its node-ID. For any other COB-ID, the user must
choose whether the other node gets the same one.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.errors import DictionaryError
from eurobot_od.od import standard, values
from eurobot_od.od.description import DescribedDevice, DescribedVariable
from eurobot_od.od.document import Rewriting
from eurobot_od.od.values import DEFAULT_PDO_BASES, Address, Number, PdoDirection, label, parse_number

if TYPE_CHECKING:
    from eurobot_od.od.dictionary import Dictionary


class ChosenCobIds(Enum):
    """Treatment of COB-IDs that do not follow the node-ID: they stay, or move by the same distance."""

    KEEP = "keep"
    MOVE = "move"


PREDEFINED = {
    standard.EMCY: values.EMCY_BASE,
    standard.SDO_REQUESTS: values.SDO_REQUEST_BASE,
    standard.SDO_ANSWERS: values.SDO_RESPONSE_BASE,
    **{
        (direction.value + number, values.COB_ID): base
        for direction, bases in DEFAULT_PDO_BASES.items()
        for number, base in enumerate(bases)
    },
}
"""COB-IDs of the pre-defined connection set without the node-ID, by object."""

FLAGS = values.NOT_VALID | values.NO_RTR
"""Bits of a COB-ID entry beside its identifier; the second is reserved for SDO and EMCY."""


def is_own_cob_id(address: Address) -> bool:
    """Return whether an object is the COB-ID of a service of the device itself: PDO, EMCY, SDO server."""
    index, sub = address
    is_pdo = index in values.COMMUNICATIONS and sub == values.COB_ID
    return is_pdo or address == standard.EMCY or (index in standard.SDO_SERVERS and sub in (1, 2))


def relative_text(variable: DescribedVariable, value: int, node_id: int, is_node_id: bool = False) -> str | None:
    """Return the text for a value that follows the node-ID, such as `$NODEID+0x180`; None if it does not.

    `is_node_id` marks the device's setting of its node-ID.
    """
    address = variable.index, variable.sub
    text = variable.section.text("defaultvalue")
    default = variable.read(text) if text else None
    if default and default.relative and default.at(node_id) == value:
        return text
    if is_node_id and value == node_id:
        return f"{values.NODE_ID}+0x0"
    base = default.value if default and default.relative else PREDEFINED.get(address)
    if base is None or not is_own_cob_id(address):
        return None
    follows = (value ^ (base + node_id)) & ~FLAGS == 0
    return f"{values.NODE_ID}+0x{value - node_id:X}" if follows else None


class ChosenCobId(NamedTuple):
    """A COB-ID in a DCF that does not follow the node-ID."""

    variable: DescribedVariable
    value: int

    def moved(self, distance: int) -> int:
        """Return the COB-ID moved by a distance; raises DictionaryError if it leaves 11 bits."""
        value = self.value + distance
        if (value ^ self.value) & ~values.BASE_IDENTIFIER or not value & values.BASE_IDENTIFIER:
            what = f"0x{values.identifier(self.value):03X} cannot be moved by {distance}"
            raise DictionaryError(label((self.variable.index, self.variable.sub)), None, what)
        return value


def following(device: DescribedDevice, node_id: int) -> Iterator[tuple[DescribedVariable, str]]:
    """Yield the variables of a DCF whose values follow the node-ID, with their texts."""
    for variable, value in _own_values(device):
        if text := relative_text(variable, value, node_id, variable is device.own_node_id):
            yield variable, text


def chosen_cob_ids(device: DescribedDevice, node_id: int) -> list[ChosenCobId]:
    """Return the valid COB-IDs of a DCF that neither follow the node-ID nor equal the type's default."""
    follow = {(each.index, each.sub) for each, _ in following(device, node_id)}
    found = []
    for variable, value in _own_values(device):
        address = variable.index, variable.sub
        is_stock = parse_number(variable.section.text("defaultvalue")) == Number(value)
        if is_own_cob_id(address) and address not in follow and not (is_stock or value & values.NOT_VALID):
            found.append(ChosenCobId(variable, value))
    return found


def _own_values(device: DescribedDevice) -> Iterator[tuple[DescribedVariable, int]]:
    """Yield the variables of a DCF with a number as ParameterValue."""
    for whole in device.objects.values():
        for variable in whole.variables():
            number = variable.read(variable.section.text("parametervalue"))
            if number and not number.relative:
                yield variable, number.value


def renumbered(dcf: Dictionary, node_id: int, chosen: ChosenCobIds | None = None) -> Dictionary:
    """Return a DCF for another node; a file that is not a DCF, or for this node already, is returned unchanged.

    `chosen` is the treatment of COB-IDs that do not follow the node-ID. Raises DictionaryError with a list of them if
    it is None, and for one that cannot be moved.
    """
    device = dcf.device
    former = dcf.device.commissioned_node_id
    if former in (None, node_id) or device.commissioning is None or former not in values.NODE_IDS:
        return dcf
    found = chosen_cob_ids(device, former)
    if found and chosen is None:
        raise DictionaryError(dcf.file, None, _question(found, former, node_id))
    rewriting = Rewriting(device.document)
    for variable, text in following(device, former):
        rewriting.set(variable.section, "ParameterValue", text)
    if chosen is ChosenCobIds.MOVE:
        for each in found:
            rewriting.set(each.variable.section, "ParameterValue", f"0x{each.moved(node_id - former):X}")
    rewriting.set(device.commissioning, "NodeID", node_id)
    return type(dcf).read(rewriting.text().encode(dcf.normal.encoding), dcf.file, node_id, dcf.name)


def _question(found: list[ChosenCobId], former: int, node_id: int) -> str:
    """Return the error about COB-IDs without a chosen treatment."""
    listed = ", ".join(
        f"{label((each.variable.index, each.variable.sub))} {_owner(each.variable.index)} "
        f"0x{values.identifier(each.value):03X}"
        for each in found
    )
    return (
        f"is of node {former}; these COB-IDs do not follow the node-ID: {listed}; for node {node_id} "
        f"keep them (--keep-cob-ids), or move them by {node_id - former} (--move-cob-ids)"
    )


def _owner(index: int) -> str:
    for direction in PdoDirection:
        if index in values.COMMUNICATION_RECORDS[direction]:
            return f"{direction.name}{index - direction.value + 1}"
    return "EMCY" if index == standard.EMCY[0] else "SDO"
