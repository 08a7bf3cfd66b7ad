"""The SDO server: expedited, segmented and block transfer, both ways (CiA 301, 7.2.4.3).

Rule of this file: requests and the time in seconds go in, answers come out, each 8 bytes. One transfer at a time; a new
one replaces it. What an object is, who may access it and how long it is, the object access says; here are only bytes.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Mapping
from enum import IntEnum
from math import inf
from typing import ClassVar, NamedTuple, Protocol, TypeAlias

from eurobot_od.od.values import Address
from eurobot_od.sdo.wire import Abort, AbortCode

LENGTH = 8
"""Bytes of every SDO request and answer; frames of another length are no SDO (CiA 301, 7.2.4.3.1)."""

TIMEOUT = 1.0
"""Seconds without a request after which the server gives up a transfer."""

EXPEDITED_SIZE = 4
SEGMENT_SIZE = 7
BLOCK_SEGMENTS = 127
"""Most bytes in an expedited transfer and in a segment, most segments in a block (CiA 301, 7.2.4.3)."""

SIZE_LIMIT = 1 << 16
"""Most bytes the server takes for an object without a length of its own."""

ABORT = 0x80
TOGGLE = 0x10
LAST = 0x01
EXPEDITED = 0x02
SIZE_GIVEN = 0x01
BLOCK_SIZE_GIVEN = 0x02
BLOCK_CRC = 0x04
BLOCK_LAST = 0x80
"""Bits of command bytes (CiA 301, Figures 23 to 36)."""


class Client(IntEnum):
    """What a client asks for: the upper three bits of the command byte."""

    DOWNLOAD_SEGMENT = 0
    DOWNLOAD = 1
    UPLOAD = 2
    UPLOAD_SEGMENT = 3
    BLOCK_UPLOAD = 5
    BLOCK_DOWNLOAD = 6


NO_INITIATE: Mapping[int, int] = {Client.BLOCK_UPLOAD: 3, Client.BLOCK_DOWNLOAD: 1}
"""Bits of a block request's command byte that make it another one than the first."""

NO_ADDRESS: Address = (0, 0)
"""What an abort names that is about no transfer."""


class Block(IntEnum):
    """Sub-command of a block request or answer: its lowest two bits; a download has the first three."""

    INITIATE = 0
    END = 1
    ACKNOWLEDGE = 2
    START = 3


class Server(IntEnum):
    """Command bytes of answers, without their flags."""

    UPLOAD_SEGMENT = 0x00
    DOWNLOAD_SEGMENT = 0x20
    UPLOAD = 0x40
    DOWNLOAD = 0x60
    BLOCK_DOWNLOAD = 0xA0
    BLOCK_UPLOAD = 0xC0


class ObjectAccess(Protocol):
    """The objects behind a server; every method raises Abort."""

    def read(self, address: Address) -> bytes:
        """Return an object's value."""

    def admit(self, address: Address, size: int | None) -> int:
        """Return how many bytes may be written; refuses what cannot be written, or not with `size` bytes."""

    def write(self, address: Address, data: bytes) -> None:
        """Give an object its value."""


class Request(NamedTuple):
    """The first request of a transfer: command byte, object, and the four bytes behind."""

    command: int
    address: Address
    rest: bytes

    @classmethod
    def of(cls, data: bytes) -> Request:
        """Read a request."""
        return cls(data[0], (data[1] | data[2] << 8, data[3]), data[4:])

    @property
    def number(self) -> int:
        """The four bytes behind, as a number: mostly a size."""
        return int.from_bytes(self.rest, "little")


def _initiated(command: int, address: Address, rest: bytes = b"") -> bytes:
    return bytes([command]) + address[0].to_bytes(2, "little") + bytes([address[1]]) + rest.ljust(4, b"\0")


def _plain(command: int, rest: bytes = b"") -> bytes:
    return bytes([command]) + rest.ljust(SEGMENT_SIZE, b"\0")


def _aborted(address: Address, code: AbortCode) -> bytes:
    return _initiated(ABORT, address, code.to_bytes(4, "little"))


# Transfers under way


class Transfer(Protocol):
    """A transfer that takes more than one request; `done` once it needs no more."""

    address: Address
    done: bool

    def takes(self, command: int) -> bool:
        """Tell whether a request with this command byte goes on with the transfer."""

    def receive(self, data: bytes) -> list[bytes]:
        """Return the answers to a request; raises Abort."""


class SegmentedUpload:
    """Sends an object in segments of 7 bytes, one for each request (CiA 301, 7.2.4.3.6)."""

    def __init__(self, address: Address, content: bytes) -> None:
        self.address, self.done = address, False
        self._content, self._sent, self._toggle = content, 0, 0

    def takes(self, command: int) -> bool:
        return command >> 5 == Client.UPLOAD_SEGMENT

    def receive(self, data: bytes) -> list[bytes]:
        if data[0] & TOGGLE != self._toggle:
            raise Abort(AbortCode.TOGGLE_BIT)
        segment = self._content[self._sent : self._sent + SEGMENT_SIZE]
        self._sent += len(segment)
        self.done = self._sent == len(self._content)
        command = Server.UPLOAD_SEGMENT | self._toggle | SEGMENT_SIZE - len(segment) << 1 | self.done * LAST
        self._toggle ^= TOGGLE
        return [_plain(command, segment)]


class Download:
    """Collects the bytes of an object; `size` is what the client said, `room` what the object takes."""

    def __init__(self, access: ObjectAccess, address: Address, size: int | None) -> None:
        self.address, self.done = address, False
        self._access, self._size = access, size
        self._room = access.admit(address, size)
        self._content = bytearray()

    def _add(self, segment: bytes) -> None:
        self._content += segment

    def _check_room(self, surplus: int = 0) -> None:
        limit = self._room if self._size is None else self._size
        if len(self._content) > limit + surplus:
            raise Abort(AbortCode.TOO_LONG)

    def _finish(self) -> None:
        if self._size is not None and len(self._content) < self._size:
            raise Abort(AbortCode.TOO_SHORT)
        self._access.write(self.address, bytes(self._content))
        self.done = True


class SegmentedDownload(Download):
    """Takes an object in segments of up to 7 bytes, each answered (CiA 301, 7.2.4.3.4)."""

    _toggle = 0

    def takes(self, command: int) -> bool:
        return command >> 5 == Client.DOWNLOAD_SEGMENT

    def receive(self, data: bytes) -> list[bytes]:
        command = data[0]
        if command & TOGGLE != self._toggle:
            raise Abort(AbortCode.TOGGLE_BIT)
        self._add(data[1 : LENGTH - (command >> 1 & SEGMENT_SIZE)])
        self._check_room()
        if command & LAST:
            self._finish()
        answer = _plain(Server.DOWNLOAD_SEGMENT | self._toggle)
        self._toggle ^= TOGGLE
        return [answer]


class BlockUpload:
    """Sends an object in blocks of segments, each block acknowledged, the whole under a CRC (CiA 301, 7.2.4.3.12)."""

    def __init__(self, address: Address, content: bytes, segments: int, crc: bool) -> None:
        self.address, self.done = address, False
        self._segments = _checked_block_size(segments)
        self._parts = [content[at : at + SEGMENT_SIZE] for at in range(0, max(len(content), 1), SEGMENT_SIZE)]
        self._crc = crc_hqx(content, 0) if crc else 0
        self._acknowledged, self._sent = 0, 0
        self._next: dict[Block, Callable[[bytes], list[bytes]]] = {Block.START: self._start}

    def takes(self, command: int) -> bool:
        return command >> 5 == Client.BLOCK_UPLOAD and command & 3 != Block.INITIATE

    def receive(self, data: bytes) -> list[bytes]:
        step = self._next.get(Block(data[0] & 3))
        if step is None:
            raise Abort(AbortCode.UNKNOWN_COMMAND)
        return step(data)

    def _start(self, _: bytes) -> list[bytes]:
        return self._block()

    def _block(self) -> list[bytes]:
        """Return the segments behind the last one acknowledged, as many as the client takes."""
        block = self._parts[self._acknowledged : self._acknowledged + self._segments]
        self._sent = len(block)
        last = self._acknowledged + len(block) == len(self._parts)
        self._next = {Block.ACKNOWLEDGE: self._acknowledge}
        return [
            _plain(number | BLOCK_LAST * (last and number == len(block)), part) for number, part in enumerate(block, 1)
        ]

    def _acknowledge(self, data: bytes) -> list[bytes]:
        """Go on behind the segments that arrived, at the end with the CRC."""
        arrived, self._segments = data[1], _checked_block_size(data[2])
        if arrived > self._sent:
            raise Abort(AbortCode.SEQUENCE_NUMBER)
        self._acknowledged += arrived
        if self._acknowledged < len(self._parts):
            return self._block()
        self._next = {Block.END: self._end}
        unused = SEGMENT_SIZE - len(self._parts[-1])
        return [_plain(Server.BLOCK_UPLOAD | unused << 2 | Block.END, self._crc.to_bytes(2, "little"))]

    def _end(self, _: bytes) -> list[bytes]:
        self.done = True
        return []


def _checked_block_size(segments: int) -> int:
    if not 1 <= segments <= BLOCK_SEGMENTS:
        raise Abort(AbortCode.BLOCK_SIZE)
    return segments


class BlockDownload(Download):
    """Takes an object in blocks of segments; what arrives behind a gap is asked for again (CiA 301, 7.2.4.3.8)."""

    def __init__(self, access: ObjectAccess, address: Address, size: int | None, crc: bool) -> None:
        super().__init__(access, address, size)
        self._crc = crc
        self._arrived = 0
        self._complete = False

    def takes(self, command: int) -> bool:
        return not self._complete or (command >> 5 == Client.BLOCK_DOWNLOAD and command & 3 == Block.END)

    def receive(self, data: bytes) -> list[bytes]:
        return self._end(data) if self._complete else self._segment(data)

    def _segment(self, data: bytes) -> list[bytes]:
        number, last = data[0] & ~BLOCK_LAST, bool(data[0] & BLOCK_LAST)
        if number == 0:
            raise Abort(AbortCode.SEQUENCE_NUMBER)
        if number == self._arrived + 1:
            self._arrived = number
            self._add(data[1:])
            self._check_room(surplus=SEGMENT_SIZE)
            self._complete = last
        if not last and number != BLOCK_SEGMENTS:
            return []
        arrived, self._arrived = self._arrived, 0
        return [_plain(Server.BLOCK_DOWNLOAD | Block.ACKNOWLEDGE, bytes([arrived, BLOCK_SEGMENTS]))]

    def _end(self, data: bytes) -> list[bytes]:
        unused = data[0] >> 2 & SEGMENT_SIZE
        del self._content[len(self._content) - unused :]
        self._check_room()
        if self._crc and crc_hqx(self._content, 0) != int.from_bytes(data[1:3], "little"):
            raise Abort(AbortCode.CRC)
        self._finish()
        return [_plain(Server.BLOCK_DOWNLOAD | Block.END)]


# The server


Initiator: TypeAlias = "Callable[[SdoServer, Request], bytes]"
"""Begins a transfer with its first request, or does it all; returns the answer."""


class SdoServer:
    """One SDO server; `deadline` is when it gives up the transfer under way, infinite without one."""

    def __init__(self, access: ObjectAccess) -> None:
        self._access = access
        self._transfer: Transfer | None = None
        self.deadline = inf

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Return the answers to a request; what is no request, or a client's abort, has none."""
        if len(data) != LENGTH:
            return []
        if data[0] == ABORT:
            self.forget()
            return []
        transfer = self._transfer
        if transfer is not None and transfer.takes(data[0]):
            return self._answered(transfer.address, lambda: self._go_on(transfer, data), now)
        initiate = self._initiator(data[0])
        if initiate is not None:
            request = Request.of(data)
            return self._answered(request.address, lambda: [initiate(self, request)], now)
        self.forget()
        return [_aborted(transfer.address if transfer else NO_ADDRESS, AbortCode.UNKNOWN_COMMAND)]

    def tick(self, now: float) -> list[bytes]:
        """Return the abort of a transfer whose client fell silent."""
        if self._transfer is None or now < self.deadline:
            return []
        address = self._transfer.address
        self.forget()
        return [_aborted(address, AbortCode.TIMEOUT)]

    def forget(self) -> None:
        """Drop the transfer under way without a word."""
        self._transfer, self.deadline = None, inf

    def _answered(self, address: Address, answer: Callable[[], list[bytes]], now: float) -> list[bytes]:
        """Return the answers, or the abort that takes their place and ends the transfer."""
        try:
            answers = answer()
        except Abort as abort:
            self.forget()
            return [_aborted(address, abort.code)]
        self.deadline = now + TIMEOUT if self._transfer else inf
        return answers

    def _go_on(self, transfer: Transfer, data: bytes) -> list[bytes]:
        answers = transfer.receive(data)
        if transfer.done:
            self._transfer = None
        return answers

    def _initiator(self, command: int) -> Initiator | None:
        """Return what begins a transfer for a command byte, None if it begins none."""
        specifier = command >> 5
        return None if command & NO_INITIATE.get(specifier, 0) else self.INITIATE.get(specifier)

    # The first request of a transfer

    def _upload(self, request: Request) -> bytes:
        self._transfer = None
        content = self._access.read(request.address)
        if 1 <= len(content) <= EXPEDITED_SIZE:
            command = Server.UPLOAD | EXPEDITED | SIZE_GIVEN | EXPEDITED_SIZE - len(content) << 2
            return _initiated(command, request.address, content)
        self._transfer = SegmentedUpload(request.address, content)
        return _initiated(Server.UPLOAD | SIZE_GIVEN, request.address, len(content).to_bytes(4, "little"))

    def _download(self, request: Request) -> bytes:
        self._transfer = None
        size_given = bool(request.command & SIZE_GIVEN)
        if request.command & EXPEDITED:
            self._write_expedited(request, size_given)
        else:
            size = request.number if size_given else None
            self._transfer = SegmentedDownload(self._access, request.address, size)
        return _initiated(Server.DOWNLOAD, request.address)

    def _write_expedited(self, request: Request, size_given: bool) -> None:
        """Write up to 4 bytes; a client that does not say how many means as many as the object has."""
        size = EXPEDITED_SIZE - (request.command >> 2 & 3) if size_given else None
        room = self._access.admit(request.address, size)
        self._access.write(request.address, request.rest[: min(room, EXPEDITED_SIZE) if size is None else size])

    def _block_upload(self, request: Request) -> bytes:
        content = self._access.read(request.address)
        crc = bool(request.command & BLOCK_CRC)
        self._transfer = BlockUpload(request.address, content, request.rest[0], crc)
        command = Server.BLOCK_UPLOAD | BLOCK_CRC | BLOCK_SIZE_GIVEN
        return _initiated(command, request.address, len(content).to_bytes(4, "little"))

    def _block_download(self, request: Request) -> bytes:
        size = request.number if request.command & BLOCK_SIZE_GIVEN else None
        self._transfer = BlockDownload(self._access, request.address, size, bool(request.command & BLOCK_CRC))
        return _initiated(Server.BLOCK_DOWNLOAD | BLOCK_CRC, request.address, bytes([BLOCK_SEGMENTS]))

    INITIATE: ClassVar[Mapping[int, Initiator]] = {
        Client.DOWNLOAD: _download,
        Client.UPLOAD: _upload,
        Client.BLOCK_UPLOAD: _block_upload,
        Client.BLOCK_DOWNLOAD: _block_download,
    }
