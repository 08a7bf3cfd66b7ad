"""Concise DCF: the form in which a configuration manager keeps a node's configuration in 0x1F22 (CiA 302-3).

A number of entries, then index, sub-index, length and data of each, all little-endian; the entries stand in the order
in which they are to be written.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import NamedTuple

from eurobot_od.od.values import Address

COUNT = struct.Struct("<I")
HEAD = struct.Struct("<HBI")
"""Number of entries; index, sub-index and length of one."""


class Truncated(ValueError):
    """Bytes that end before what they announce, or go on after it; the text says where."""


class Write(NamedTuple):
    """One write: an object's address, and the bytes it is to have."""

    address: Address
    data: bytes


def pack(entries: Iterable[tuple[Address, bytes]]) -> bytes:
    """Return the concise DCF of writes in their order."""
    packed = [HEAD.pack(*address, len(data)) + data for address, data in entries]
    return COUNT.pack(len(packed)) + b"".join(packed)


def unpack(data: bytes) -> list[Write]:
    """Return the writes of a concise DCF; raises Truncated."""
    (count,) = COUNT.unpack(_part(data, 0, COUNT.size))
    place, entries = COUNT.size, list[Write]()
    for _ in range(count):
        index, subindex, length = HEAD.unpack(_part(data, place, HEAD.size))
        entries.append(Write((index, subindex), _part(data, place + HEAD.size, length)))
        place += HEAD.size + length
    if place != len(data):  # a length before this was wrong: nothing can be trusted
        raise Truncated(f"{len(data) - place} bytes after the last of {count} entries")
    return entries


def _part(data: bytes, place: int, length: int) -> bytes:
    part = data[place : place + length]
    if len(part) < length:
        raise Truncated(f"ends at byte {len(data)}, {length} bytes expected at byte {place}")
    return part
