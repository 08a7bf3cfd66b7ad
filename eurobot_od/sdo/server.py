"""The SDO server: expedited, segmented and block transfer, both ways (CiA 301, 7.2.4.3).

Rule of this file: requests and the time in seconds go in, answers come out, each 8 bytes. One transfer at a time; a new
one replaces it. What an object is, who may access it and how long it is, the object access says; here are only bytes.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections import deque
from collections.abc import Callable, Mapping
from math import inf
from typing import ClassVar, Protocol, TypeAlias

from eurobot_od.od.values import Address
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import Abort, AbortCode, Block, ClientCommand, Initiate, ServerCommand

TIMEOUT = 1.0
"""Seconds without a request after which the server gives up a transfer."""

SIZE_LIMIT = 1 << 16
"""Most bytes the server takes for an object without a length of its own."""

NO_ADDRESS: Address = (0, 0)
"""What an abort names that is about no transfer."""


class ObjectAccess(Protocol):
    """The objects that a server gives access to; every method raises Abort."""

    def read(self, address: Address) -> bytes:
        """Return an object's value."""

    def admit(self, address: Address, size: int | None) -> int:
        """Return how many bytes may be written; refuses what cannot be written, or not with `size` bytes."""

    def write(self, address: Address, data: bytes) -> None:
        """Give an object its value."""


# Transfers under way


class ServedTransfer(Protocol):
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
        self._left, self._toggle = deque(wire.parts(content)), 0

    def takes(self, command: int) -> bool:
        return command >> 5 == ClientCommand.UPLOAD_SEGMENT

    def receive(self, data: bytes) -> list[bytes]:
        if data[0] & wire.TOGGLE != self._toggle:
            raise Abort(AbortCode.TOGGLE_BIT)
        part = self._left.popleft()
        self.done = not self._left
        answer = wire.segment(ServerCommand.UPLOAD_SEGMENT, self._toggle, part, last=self.done)
        self._toggle ^= wire.TOGGLE
        return [answer]


class Download:
    """Collects the bytes of an object; `size` is what the client said, `room` what the object takes."""

    def __init__(self, access: ObjectAccess, address: Address, size: int | None) -> None:
        self.address, self.done = address, False
        self._access, self._size = access, size
        self._room = access.admit(address, size)
        self._content = bytearray()

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
        return command >> 5 == ClientCommand.DOWNLOAD_SEGMENT

    def receive(self, data: bytes) -> list[bytes]:
        command = data[0]
        if command & wire.TOGGLE != self._toggle:
            raise Abort(AbortCode.TOGGLE_BIT)
        self._content += wire.part_in(data)
        self._check_room()
        if command & wire.LAST:
            self._finish()
        answer = wire.plain(ServerCommand.DOWNLOAD_SEGMENT << 5 | self._toggle)
        self._toggle ^= wire.TOGGLE
        return [answer]


class BlockUpload:
    """Sends an object in blocks of segments, each block acknowledged, the whole under a CRC (CiA 301, 7.2.4.3.12)."""

    def __init__(self, address: Address, content: bytes, segments: int, crc: bool) -> None:
        self.address, self.done = address, False
        self._segments = _checked_block_size(segments)
        self._parts = wire.parts(content)
        self._crc = crc_hqx(content, 0) if crc else 0
        self._acknowledged, self._sent = 0, 0
        self._next: dict[Block, Callable[[bytes], list[bytes]]] = {Block.START: self._start}

    def takes(self, command: int) -> bool:
        return command >> 5 == ClientCommand.BLOCK_UPLOAD and command & 3 != Block.INITIATE

    def receive(self, data: bytes) -> list[bytes]:
        step = self._next.get(Block(data[0] & 3))
        if step is None:
            raise Abort(AbortCode.UNKNOWN_COMMAND)
        return step(data)

    def _start(self, _: bytes) -> list[bytes]:
        return self._block()

    def _block(self) -> list[bytes]:
        """Return the segments after the last one acknowledged, as many as the client takes."""
        sent = self._parts[self._acknowledged : self._acknowledged + self._segments]
        self._sent = len(sent)
        self._next = {Block.ACKNOWLEDGE: self._acknowledge}
        return wire.block(sent, last=self._acknowledged + len(sent) == len(self._parts))

    def _acknowledge(self, data: bytes) -> list[bytes]:
        """Go on after the segments that arrived, at the end with the CRC."""
        arrived, self._segments = data[1], _checked_block_size(data[2])
        if arrived > self._sent:
            raise Abort(AbortCode.SEQUENCE_NUMBER)
        self._acknowledged += arrived
        if self._acknowledged < len(self._parts):
            return self._block()
        self._next = {Block.END: self._end}
        return [wire.block_end(ServerCommand.BLOCK_UPLOAD, self._parts[-1], self._crc)]

    def _end(self, _: bytes) -> list[bytes]:
        self.done = True
        return []


def _checked_block_size(segments: int) -> int:
    if not 1 <= segments <= wire.BLOCK_SEGMENTS:
        raise Abort(AbortCode.BLOCK_SIZE)
    return segments


class BlockDownload(Download):
    """Takes an object in blocks of segments; what arrives after a gap is asked for again (CiA 301, 7.2.4.3.8)."""

    def __init__(self, access: ObjectAccess, address: Address, size: int | None, crc: bool) -> None:
        super().__init__(access, address, size)
        self._crc = crc
        self._arrived = 0
        self._complete = False

    def takes(self, command: int) -> bool:
        # A segment has no command, only its number: until the last one has come, a frame cannot be anything else.
        return not self._complete or (command >> 5 == ClientCommand.BLOCK_DOWNLOAD and command & 3 == Block.END)

    def receive(self, data: bytes) -> list[bytes]:
        return self._end(data) if self._complete else self._segment(data)

    def _segment(self, data: bytes) -> list[bytes]:
        number, last = data[0] & ~wire.BLOCK_LAST, bool(data[0] & wire.BLOCK_LAST)
        if number == 0:
            raise Abort(AbortCode.SEQUENCE_NUMBER)
        if number == self._arrived + 1:
            self._arrived = number
            self._content += data[1:]
            self._check_room(surplus=wire.SEGMENT_SIZE)
            self._complete = last
        if not last and number != wire.BLOCK_SEGMENTS:
            return []
        arrived, self._arrived = self._arrived, 0
        return [
            wire.plain(ServerCommand.BLOCK_DOWNLOAD << 5 | Block.ACKNOWLEDGE, bytes([arrived, wire.BLOCK_SEGMENTS]))
        ]

    def _end(self, data: bytes) -> list[bytes]:
        del self._content[len(self._content) - wire.unused_in(data) :]
        self._check_room()
        if self._crc and crc_hqx(self._content, 0) != wire.crc_in(data):
            raise Abort(AbortCode.CRC)
        self._finish()
        return [wire.plain(ServerCommand.BLOCK_DOWNLOAD << 5 | Block.END)]


# The server


Initiator: TypeAlias = "Callable[[SdoServer, Initiate], bytes]"
"""Begins a transfer with its first request, or does it all; returns the answer."""


class SdoServer:
    """One SDO server; `deadline` is when it gives up the transfer under way, infinite without one."""

    def __init__(self, access: ObjectAccess) -> None:
        self._access = access
        self._transfer: ServedTransfer | None = None
        self.deadline = inf

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Return the answers to a request; what is not a request has none, nor has a client's abort."""
        if len(data) != wire.LENGTH:
            return []
        # Looked at before the transfer under way, which in a block download takes any frame for a segment.
        if data[0] == wire.ABORT:
            self.forget()
            return []
        transfer = self._transfer
        if transfer is not None and transfer.takes(data[0]):
            return self._answered(transfer.address, lambda: self._go_on(transfer, data), now)
        begin = self._initiator(data[0])
        if begin is not None:
            request = Initiate.of(data)
            return self._answered(request.address, lambda: [begin(self, request)], now)
        # Neither a step of the transfer nor the first request of another: its client has lost its way.
        self.forget()
        return [wire.aborted(transfer.address if transfer else NO_ADDRESS, AbortCode.UNKNOWN_COMMAND)]

    def tick(self, now: float) -> list[bytes]:
        """Return the abort of a transfer whose client fell silent."""
        if self._transfer is None or now < self.deadline:
            return []
        address = self._transfer.address
        self.forget()
        return [wire.aborted(address, AbortCode.TIMEOUT)]

    def forget(self) -> None:
        """Drop the transfer under way without a word."""
        self._transfer, self.deadline = None, inf

    def _answered(self, address: Address, answer: Callable[[], list[bytes]], now: float) -> list[bytes]:
        """Return the answers, or the abort that takes their place and ends the transfer."""
        try:
            answers = answer()
        except Abort as abort:
            self.forget()
            return [wire.aborted(address, abort.code)]
        self.deadline = now + TIMEOUT if self._transfer else inf
        return answers

    def _go_on(self, transfer: ServedTransfer, data: bytes) -> list[bytes]:
        answers = transfer.receive(data)
        if transfer.done:
            self._transfer = None
        return answers

    def _initiator(self, command: int) -> Initiator | None:
        """Return what begins a transfer for a command byte, None if it begins none."""
        specifier = command >> 5
        return None if command & wire.REQUEST_SUB_COMMAND.get(specifier, 0) else self.INITIATE.get(specifier)

    # The first request of a transfer

    def _upload(self, request: Initiate) -> bytes:
        self._transfer = None
        content = self._access.read(request.address)
        answer = wire.carrying(ServerCommand.UPLOAD, request.address, content)
        if not answer[0] & wire.EXPEDITED:
            self._transfer = SegmentedUpload(request.address, content)
        return answer

    def _download(self, request: Initiate) -> bytes:
        self._transfer = None
        if request.command & wire.EXPEDITED:
            self._write_expedited(request)
        else:
            self._transfer = SegmentedDownload(self._access, request.address, request.size)
        return wire.initiate(ServerCommand.DOWNLOAD << 5, request.address)

    def _write_expedited(self, request: Initiate) -> None:
        """Write up to 4 bytes; a client that does not say how many means as many as the object has."""
        size = request.size
        room = self._access.admit(request.address, size)
        self._access.write(request.address, request.rest[: min(room, wire.EXPEDITED_SIZE) if size is None else size])

    def _block_upload(self, request: Initiate) -> bytes:
        content = self._access.read(request.address)
        crc = bool(request.command & wire.BLOCK_CRC)
        self._transfer = BlockUpload(request.address, content, request.rest[0], crc)
        command = ServerCommand.BLOCK_UPLOAD << 5 | wire.BLOCK_CRC | wire.BLOCK_SIZE_GIVEN
        return wire.initiate(command, request.address, len(content).to_bytes(4, "little"))

    def _block_download(self, request: Initiate) -> bytes:
        size = request.number if request.command & wire.BLOCK_SIZE_GIVEN else None
        self._transfer = BlockDownload(self._access, request.address, size, bool(request.command & wire.BLOCK_CRC))
        return wire.initiate(
            ServerCommand.BLOCK_DOWNLOAD << 5 | wire.BLOCK_CRC, request.address, bytes([wire.BLOCK_SEGMENTS])
        )

    INITIATE: ClassVar[Mapping[int, Initiator]] = {
        ClientCommand.DOWNLOAD: _download,
        ClientCommand.UPLOAD: _upload,
        ClientCommand.BLOCK_UPLOAD: _block_upload,
        ClientCommand.BLOCK_DOWNLOAD: _block_download,
    }
