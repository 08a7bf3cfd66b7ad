"""Four objects behind an SDO server, the least that all its transfers can be tried on."""

from __future__ import annotations

from eurobot_od.od.values import Address
from eurobot_od.sdo.wire import Abort, Reason

NUMBER: Address = (0x2000, 1)
TEXT: Address = (0x1008, 0)
EMPTY: Address = (0x1009, 0)
WIDE: Address = (0x2001, 0)
ANY = 100_000
"""Bytes that the texts take."""


class Shelf:
    """Objects for a server: a number of 2 bytes, one of 8, a text of any length, and an empty one."""

    def __init__(self) -> None:
        self.objects = {NUMBER: b"\x34\x12", TEXT: b"Eurobot 2014", EMPTY: b"", WIDE: bytes(range(8))}
        self.room = {NUMBER: 2, WIDE: 8}

    def read(self, address: Address) -> bytes:
        if address not in self.objects:
            raise Abort(Reason.NO_OBJECT)
        return self.objects[address]

    def admit(self, address: Address, size: int | None) -> int:
        room = self.room.get(address, ANY)
        if size is not None and size > room:
            raise Abort(Reason.LONGER_THAN_TYPE)
        return room

    def write(self, address: Address, data: bytes) -> None:
        if address in self.room and len(data) != self.room[address]:
            raise Abort(Reason.SHORTER_THAN_TYPE)
        self.objects[address] = data
