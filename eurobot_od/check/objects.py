"""Objects of a node's dictionary as suites name them, and their values as SDO carries them.

Rule of this file: types and limits are the EDS's; an object that it does not have has bytes and no value.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import Any, NamedTuple

from eurobot_od.check.suite import NodeServices
from eurobot_od.check.values import ValueProblem
from eurobot_od.errors import DictionaryError, UnknownName
from eurobot_od.logs.services import SDO_ANSWER_ENTRY, SDO_REQUEST_ENTRY
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import BASE_IDENTIFIER, Address, Limits
from eurobot_od.pdo.kinds import Kind

ADDRESS = re.compile(r"0[xX](?P<index>[0-9A-Fa-f]{1,4})(?::(?P<subindex>0x[0-9A-Fa-f]{1,2}|\d{1,3}))?")

TEXT_TYPES = frozenset({0x09, 0x0A})
SIGNED_TYPES = {0x02: 1, 0x03: 2, 0x04: 4, 0x10: 3, 0x12: 5, 0x13: 6, 0x14: 7, 0x15: 8}
UNSIGNED_TYPES = {0x01: 1, 0x05: 1, 0x06: 2, 0x07: 4, 0x16: 3, 0x18: 5, 0x19: 6, 0x1A: 7, 0x1B: 8}
"""Data types with their bytes (CiA 301, Table 44)."""


class TextKind(Kind):
    """A text of an object."""

    def parse(self, text: str) -> Any:
        return text

    def write(self, value: Any, limits: Limits) -> int:
        """Take any text; it has no raw integer."""
        return 0

    def text(self, value: Any) -> str:
        return repr(value)


class ObjectType(NamedTuple):
    """How an object's value is written and measured; `size` in bytes, None for a text."""

    kind: Kind
    limits: Limits
    size: int | None
    signed: bool

    @property
    def widest(self) -> Limits:
        """What its type can carry, whatever the EDS's limits are."""
        if self.size is None:
            return self.limits
        bits = 8 * self.size
        return Limits(-1 << bits - 1, (1 << bits - 1) - 1) if self.signed else Limits(0, (1 << bits) - 1)

    def encode(self, value: Any) -> bytes:
        """Return a value's bytes."""
        if self.size is None:
            return str(value).encode()
        return int(value).to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> Any:
        """Return the value in bytes from a node; raises ValueProblem for another length than the type's."""
        if self.size is None:
            return data.decode(errors="replace")
        if len(data) != self.size:
            raise ValueProblem(f"{len(data)} bytes came, the object has {self.size}")
        return int.from_bytes(data, "little", signed=self.signed)


def find_address(dictionary: Dictionary, text: str) -> Address:
    """Return the address of `0x1017`, `0x1018:1`, `Producer heartbeat time` or `Motion.Braking`; raises UnknownName."""
    match = ADDRESS.fullmatch(text)
    if match is not None:
        return int(match["index"], 16), int(match["subindex"] or "0", 0)
    try:
        return dictionary.address(text)
    except DictionaryError:
        near = get_close_matches(text, _names(dictionary), n=3, cutoff=0.6)
        raise UnknownName(f"object of {dictionary.name}", text, near) from None


def _names(dictionary: Dictionary) -> list[str]:
    entries = dictionary.objects.values()
    members = [f"{entry.name}.{each.name}" for entry in entries for each in getattr(entry, "subindices", {}).values()]
    return [entry.name for entry in entries] + members


def object_type(dictionary: Dictionary, address: Address) -> ObjectType | None:
    """Return the type of an object, None if the EDS does not have it or if it is none of numbers and texts."""
    variable = dictionary.variable(address)
    if variable is None:
        return None
    code = variable.data_type or 0
    if code in TEXT_TYPES:
        return ObjectType(TextKind(), Limits(0, 0), None, False)
    size = SIGNED_TYPES.get(code) or UNSIGNED_TYPES.get(code)
    if size is None:
        return None
    plain = ObjectType(Kind(), Limits(0, 0), size, code in SIGNED_TYPES)
    low, high = plain.widest
    limits = Limits(low if variable.min is None else variable.min, high if variable.max is None else variable.max)
    return plain._replace(limits=limits)


def services(dictionary: Dictionary) -> NodeServices:
    """Return where a node's services are, as its EDS has them."""
    request, answer = (dictionary.default(address) for address in (SDO_REQUEST_ENTRY, SDO_ANSWER_ENTRY))
    if not isinstance(request, int) or not isinstance(answer, int):
        raise DictionaryError(dictionary.file, SDO_REQUEST_ENTRY[0], "the COB-IDs of the SDO server are missing")
    return NodeServices(dictionary.name, dictionary.node_id, request & BASE_IDENTIFIER, answer & BASE_IDENTIFIER)
