"""Objects of a node's dictionary as suites name them, and their values as SDO carries them.

Types and limits are the EDS's. An object that it does not have can still be read and written, as bytes.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import Any, NamedTuple

from eurobot_od.amounts import amount
from eurobot_od.check.suite import NodeServices
from eurobot_od.check.values import ValueProblem
from eurobot_od.errors import LONGEST_NAME, DictionaryError, UnknownName
from eurobot_od.logs.services import SDO_ANSWER_ENTRY, SDO_REQUEST_ENTRY
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Kind

ADDRESS = re.compile(r"0[xX](?P<index>[0-9A-Fa-f]{1,4})(?::(?P<subindex>0x[0-9A-Fa-f]{1,2}|\d{1,3}))?")

ANY_BYTES = "surrogateescape"
"""How bytes that are no text are kept in one, so that they can be written back."""

TEXT_TYPES = (values.VISIBLE_STRING.code, values.OCTET_STRING.code)


class TextKind(Kind):
    """A text of an object."""

    def parse(self, text: str) -> Any:
        return text

    def write(self, value: Any, limits: values.Limits) -> int:
        """Take any text; it has no raw integer."""
        return 0

    def text(self, value: Any) -> str:
        return repr(value)


class ObjectType(NamedTuple):
    """An object's data type, a number's or a text's, and how its value is written and measured."""

    type: values.DataType
    kind: Kind
    limits: values.Limits

    def encode(self, value: Any) -> bytes:
        """Return a value's bytes."""
        if not self.type.is_integer:
            return str(value).encode(errors=ANY_BYTES)
        return int(value).to_bytes(self.type.size, "little", signed=self.type.is_signed)

    def decode(self, data: bytes) -> Any:
        """Return the value in bytes from a node; raises ValueProblem for another length than the type's."""
        if not self.type.is_integer:
            return data.decode(errors=ANY_BYTES)
        if len(data) != self.type.size:
            raise ValueProblem(f"{amount(len(data), 'byte')} came, the object has {self.type.size}")
        return int.from_bytes(data, "little", signed=self.type.is_signed)


def find_address(dictionary: Dictionary, text: str) -> values.Address:
    """Return the address of `0x1017`, `0x1018:1`, `Producer heartbeat time` or `Motion.Braking`; raises UnknownName."""
    match = ADDRESS.fullmatch(text)
    if match is not None:
        return int(match["index"], 16), int(match["subindex"] or "0", 0)
    try:
        return dictionary.address(text)
    except DictionaryError:
        hexadecimal = [f"0x{text}"] if ADDRESS.fullmatch(f"0x{text}") else []  # `1017` is meant as CiA 301 writes it
        near = hexadecimal or get_close_matches(text[:LONGEST_NAME], _names(dictionary))
        raise UnknownName(f"object of {dictionary.name}", text, near) from None


def _names(dictionary: Dictionary) -> list[str]:
    entries = dictionary.objects.values()
    members = [f"{entry.name}.{each.name}" for entry in entries for each in getattr(entry, "subindices", {}).values()]
    return [entry.name for entry in entries] + members


def object_type(dictionary: Dictionary, address: values.Address) -> ObjectType | None:
    """Return the type of an object, None if the EDS does not have it or if it is neither a whole number nor a text."""
    variable = dictionary.variable(address)
    if variable is None:
        return None
    data_type = values.DATA_TYPES.get(variable.data_type or 0)
    if data_type is None or not (data_type.is_integer or data_type.code in TEXT_TYPES):
        return None
    low = data_type.low if variable.min is None else variable.min
    high = data_type.high if variable.max is None else variable.max
    return ObjectType(data_type, Kind() if data_type.is_integer else TextKind(), values.Limits(low, high))


def services(dictionary: Dictionary) -> NodeServices:
    """Return where a node's services are."""
    request = _sdo_cob_id(dictionary, SDO_REQUEST_ENTRY, values.SDO_REQUEST_BASE)
    answer = _sdo_cob_id(dictionary, SDO_ANSWER_ENTRY, values.SDO_RESPONSE_BASE)
    return NodeServices(dictionary.name, dictionary.node_id, request, answer)


def _sdo_cob_id(dictionary: Dictionary, entry: values.Address, base: int) -> int:
    """Return an identifier of the default SDO server, which is there whatever the file says (CiA 301, 7.5.2.33)."""
    said = dictionary.number(entry)
    return base + dictionary.node_id if said is None or said & values.NOT_VALID else said & values.BASE_IDENTIFIER
