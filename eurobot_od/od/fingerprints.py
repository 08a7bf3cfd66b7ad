"""Fingerprints of messages: numbers that differ if two nodes would read a frame differently.

`make-eds` adds an object with them to each node: one number for all messages together, and one for each message of the
table, whether the node has it or not. CANopen's own objects do not serve: the revision number (0x1018:3) depends on a
person, and date and time in 0x1020 are reset by any write.

A fingerprint covers name and identifier, the names, order and bits of the mapped objects, their units and codes. Ranges
are not included, because a receiver notices values out of range. The upper 11 bits are the identifier, so that messages
can be identified without their names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple
from zlib import crc32

from eurobot_od.od.meanings import ObjectMeaning
from eurobot_od.od.values import REALS, Address, MappingEntry, Value

if TYPE_CHECKING:
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.od.pdos import Mapped, Pdo

FINGERPRINTS = 0x2F00
"""Index of a node's fingerprints; sub-index `OF_ALL` is that of all messages, single messages follow."""

OBJECT_NAME, ALL_NAME = "Message fingerprints", "All messages"
OF_ALL, FIRST = 1, 2
MOST_MESSAGES = 0xFE - 1
"""Largest number of messages, limited by the sub-indices."""

HASH_BITS = 21
"""Number of bits of a fingerprint below the identifier."""

NOT_MAPPED = 0
"""A node's answer for a message of its table without a PDO."""


class MappedPart(NamedTuple):
    """An entry of a mapping, as far as it affects how a frame is read.

    A dummy has no `name`, and its `is_signed` is None. Names are included because two fields of the same width that are
    swapped have the same entries.
    """

    name: str
    entry: int
    is_signed: bool | None
    is_real: bool
    meaning: ObjectMeaning

    @property
    def text(self) -> str:
        """The entry as one text."""
        codes = sorted(self.meaning.codes.items())
        return f"{self.name} {self.entry:08X} {self.is_signed} {self.is_real} {self.meaning.unit} {codes}"


def fingerprint(name: str, identifier: int, parts: Iterable[MappedPart]) -> int:
    """Return the fingerprint of a message."""
    text = "\n".join([name, *(each.text for each in parts)])
    return identifier << HASH_BITS | crc32(text.encode()) & (1 << HASH_BITS) - 1


def of_all(fingerprints: Iterable[int]) -> int:
    """Return the fingerprint of all messages together."""
    return crc32(b"".join(each.to_bytes(4, "little") for each in fingerprints))


def of_pdo(pdo: Pdo) -> int:
    """Return the fingerprint of a PDO's message, valid or not."""
    return fingerprint(pdo.name, pdo.cob_id, map(_part, pdo.mapping))


def _part(mapped: Mapped) -> MappedPart:
    signed = None if mapped.is_padding else mapped.type.is_signed
    entry = MappingEntry(*mapped.address, mapped.bits).number
    name = "" if mapped.is_padding else mapped.variable.name
    return MappedPart(name, entry, signed, mapped.type in REALS, mapped.meaning)


def in_force(dictionary: Dictionary, value: Callable[[Address], Value]) -> dict[str, int]:
    """Return the fingerprints of all messages by name, with the node's own PDOs as these values map them.

    Empty for a device whose file has no fingerprints.
    """
    members = dictionary.members.get(FINGERPRINTS, {})
    said = {each.name: dictionary.number((FINGERPRINTS, sub)) or 0 for sub, each in members.items() if sub >= FIRST}
    own = own_in_force(dictionary, value)
    return {name: own.get(name, number) for name, number in said.items()}


def at(sub: int, dictionary: Dictionary, value: Callable[[Address], Value]) -> int:
    """Return the fingerprint at a sub-index of a node's object, as these values map its messages."""
    found = in_force(dictionary, value)
    if sub == OF_ALL:
        return of_all(found.values())
    return own_in_force(dictionary, value).get([*found][sub - FIRST], NOT_MAPPED)


def own_in_force(dictionary: Dictionary, value: Callable[[Address], Value]) -> dict[str, int]:
    """Return the fingerprints of a node's own PDOs by name, as these values map them."""
    return {pdo.name: of_pdo(pdo) for pdo in dictionary.read_pdos(value, lambda _: None)}


class MessageDifference(NamedTuple):
    """A message that another node maps differently; `name` is empty for a message that only the other node has.

    `identifier` is the other node's, None if it does not have the message; `bits` is set if the identifiers agree and
    the mappings do not.
    """

    name: str
    identifier: int | None
    bits: bool = False


def differences(ours: dict[str, int], theirs: Sequence[int]) -> list[MessageDifference]:
    """Return the messages with different fingerprints; messages that the other node does not map are ignored."""
    unmapped = theirs.count(NOT_MAPPED)
    theirs = [each for each in theirs if each != NOT_MAPPED]
    by_identifier = {each >> HASH_BITS: each for each in theirs}
    odd = {name: each for name, each in ours.items() if by_identifier.get(each >> HASH_BITS) != each}
    moved = {each & (1 << HASH_BITS) - 1: each >> HASH_BITS for each in theirs if each not in ours.values()}
    found = []
    for name, each in odd.items():
        there = moved.get(each & (1 << HASH_BITS) - 1)
        same = each >> HASH_BITS in by_identifier and there is None
        found.append(MessageDifference(name, each >> HASH_BITS if same else there, same))
    # The other node does not name the messages that it does not map, so only their number is compared.
    missing = [each for each in found if each.identifier is None]
    found = [each for each in found if each not in missing or len(missing) > unmapped]
    known = {each >> HASH_BITS for each in ours.values()} | {each.identifier for each in found}
    return found + [MessageDifference("", each) for each in by_identifier if each not in known]
