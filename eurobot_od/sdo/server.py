"""The SDO server: expedited, segmented and block transfer, both ways (CiA 301, 7.2.4.3).

Input is requests and the time in s, output is answers of 8 bytes. There is one transfer at a time; a new one replaces
it. The `ObjectAccess` knows the objects, their access types and sizes; this module only moves bytes.

As in the client, each kind of transfer is a generator in the order of CiA 301's figures: it receives requests and
yields the answers.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Generator, Mapping
from math import inf
from typing import NamedTuple, Protocol, TypeAlias

from eurobot_od.od.values import Address
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import Abort, Block, ClientCommand, Initiate, Reason, ServerCommand

TIMEOUT = 1.0
"""Time without a request after which the server aborts a transfer, in s."""


class ObjectAccess(Protocol):
    """The objects of a server; every method may raise Abort."""

    def read(self, address: Address) -> bytes:
        """Return an object's value."""

    def admit(self, address: Address, size: int | None) -> int:
        """Return the most bytes that may be written; raises Abort for a read-only object or a wrong `size`."""

    def write(self, address: Address, data: bytes) -> None:
        """Set an object's value."""


class Reply(NamedTuple):
    """The `frames` that answer a request, and the predicate for command bytes that continue the transfer.

    `takes` is None at the end of the transfer.
    """

    frames: list[bytes]
    takes: Callable[[int], bool] | None = None


ServerSteps: TypeAlias = Generator[Reply, bytes, None]
"""Generator of a transfer; it may raise Abort."""


class SdoServer:
    """One SDO server.

    `deadline` is the time-out of the current transfer, infinite without one. `aborted` is the last abort.
    """

    def __init__(self, access: ObjectAccess) -> None:
        self._access = access
        self.aborted: Abort | None = None
        self.forget()

    def forget(self) -> None:
        """Drop the current transfer without an abort."""
        # An abort outside a transfer names 0x0000:00.
        self._address = wire.NO_TRANSFER
        self.deadline = inf
        self._steps: ServerSteps | None = None
        self._takes: Callable[[int], bool] | None = None

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Return the answers to a request; none to a client's abort, or to a frame that is not a request."""
        # All SDO frames have 8 bytes (CiA 301, 7.2.4.3). Others are ignored: an abort could end another client's
        # transfer.
        if len(data) != wire.LENGTH:
            return []
        # First, because a block download takes any frame for a segment.
        if data[0] == wire.ABORT:
            self.forget()
            return []
        steps = self._steps
        if steps is not None and self._takes is not None and self._takes(data[0]):
            return self._answered(steps, data, now)
        specifier = data[0] >> 5
        if specifier in INITIATE and not data[0] & wire.REQUEST_SUB_COMMAND.get(specifier, 0):
            request = Initiate.of(data)
            self._steps = INITIATE[specifier](self._access, request)
            self._address = request.address
            return self._answered(self._steps, None, now)
        # The request neither continues the transfer nor starts another.
        return self._abort(Abort(Reason.OUT_OF_STEP))

    def tick(self, now: float) -> list[bytes]:
        """Return the abort of a transfer after the client's time-out."""
        return self._abort(Abort(Reason.CLIENT_SILENT)) if now >= self.deadline else []

    def _answered(self, steps: ServerSteps, data: bytes | None, now: float) -> list[bytes]:
        """Return the answers to a request (None starts the transfer), or the abort that ends it."""
        try:
            frames, self._takes = steps.send(data)  # type: ignore[arg-type]  # None starts a generator
        except Abort as abort:
            return self._abort(abort)
        self.deadline = now + TIMEOUT  # renewed by each request
        if self._takes is None:  # the last answer
            self.forget()
        return frames

    def _abort(self, abort: Abort) -> list[bytes]:
        # Without its traceback, whose frames would keep the request's bus alive.
        abort.__cause__ = abort.__context__ = None
        address = self._address
        self.aborted = abort.with_traceback(None)
        self.forget()
        return [wire.aborted(address, abort.reason.code)]


# Uploads


def _upload(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Answer up to 4 bytes at once, or segments of 7 bytes, one for each request (CiA 301, 7.2.4.3.6)."""
    content = access.read(request.address)
    answer = wire.carrying(ServerCommand.UPLOAD, request.address, content)
    places = range(0) if answer[0] & wire.EXPEDITED else wire.segments_of(content)
    for place in places:
        data = yield Reply([answer], lambda command: command >> 5 == ClientCommand.UPLOAD_SEGMENT)
        answer = wire.next_segment(ServerCommand.UPLOAD_SEGMENT, content, place)
        _check_toggle(data, answer[0] & wire.TOGGLE)
    yield Reply([answer])


def _block_upload(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Send blocks of segments, which the client acknowledges, and a CRC at the end (CiA 301, 7.2.4.3.12)."""

    def takes(command: int) -> bool:
        # The initiate has the same specifier, but starts another transfer.
        return command >> 5 == ClientCommand.BLOCK_UPLOAD and command & 3 != Block.INITIATE

    content = access.read(request.address)
    place = 0
    segments = _checked_block_size(request.rest[0])
    command = ServerCommand.BLOCK_UPLOAD << 5 | wire.BLOCK_CRC | wire.BLOCK_SIZE_GIVEN
    # The CRC is 0 for a client that does not offer it (CiA 301, 7.2.4.3.15).
    end = wire.block_end(
        ServerCommand.BLOCK_UPLOAD, content, crc_hqx(content, 0) if request.command & wire.BLOCK_CRC else 0
    )
    first = wire.initiate(command, request.address, len(content).to_bytes(4, "little"))
    _check_block((yield Reply([first], takes)), Block.START)
    while place in wire.segments_of(content):
        sent = wire.block(content, place, segments)
        data = yield Reply(sent, takes)
        _check_block(data, Block.ACKNOWLEDGE)
        # The client may change the block size with each acknowledgement; missed segments are sent again.
        arrived = data[1]
        segments = _checked_block_size(data[2])
        # A segment that was not sent; CiA's test tool acknowledges segment 128 of 127 (test 2.27).
        if arrived > len(sent):
            raise Abort(Reason.NEVER_SENT)
        place += arrived * wire.SEGMENT_SIZE
    _check_block((yield Reply([end], takes)), Block.END)
    yield Reply([])


def _check_toggle(data: bytes, toggle: int) -> None:
    if data[0] & wire.TOGGLE != toggle:
        # A request was repeated or lost; continuing would repeat or drop seven bytes (CiA 301, 7.2.4.3.7).
        raise Abort(Reason.TOGGLE_BIT)


def _check_block(data: bytes, sub_command: Block) -> None:
    if data[0] & 3 != sub_command:
        # For example an end in place of an acknowledgement.
        raise Abort(Reason.OUT_OF_STEP)


def _checked_block_size(segments: int) -> int:
    if not 1 <= segments <= wire.BLOCK_SEGMENTS:
        # Segments are numbered from 1 in seven bits (CiA 301, 7.2.4.3.12).
        raise Abort(Reason.BLOCK_SIZE)
    return segments


# Downloads


class Download:
    """The received bytes of an object; `size` is the number that the client has announced, or None."""

    def __init__(self, access: ObjectAccess, address: Address, size: int | None) -> None:
        self.content = bytearray()
        self._access, self._address, self._size = access, address, size
        # Checked before the first byte, so that the client need not send a long object in vain.
        self._room = access.admit(address, size)

    def check_room(self, surplus: int = 0) -> None:
        limit = self._room if self._size is None else self._size
        if len(self.content) > limit + surplus:
            raise Abort(Reason.MORE_BYTES)

    def finish(self) -> None:
        # Only now is the object written: an incomplete transfer leaves it unchanged.
        if self._size is not None and len(self.content) < self._size:
            raise Abort(Reason.FEWER_BYTES)
        self._access.write(self._address, bytes(self.content))


def _download(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Receive up to 4 bytes at once, or segments of up to 7 bytes, each answered (CiA 301, 7.2.4.3.4)."""
    answer = wire.initiate(ServerCommand.DOWNLOAD << 5, request.address)
    if request.command & wire.EXPEDITED:
        # Without a size, the value has as many bytes as the object.
        room = access.admit(request.address, request.size)
        access.write(request.address, request.rest[: request.size or min(room, wire.EXPEDITED_SIZE)])
    else:
        download = Download(access, request.address, request.size)
        toggle = last = 0  # the first segment has toggle bit 0 (CiA 301, 7.2.4.3.4)
        while not last:
            data = yield Reply([answer], lambda command: command >> 5 == ClientCommand.DOWNLOAD_SEGMENT)
            _check_toggle(data, toggle)
            download.content += wire.part_in(data)
            download.check_room()
            answer = wire.plain(ServerCommand.DOWNLOAD_SEGMENT << 5 | toggle)
            last = data[0] & wire.LAST
            toggle ^= wire.TOGGLE
        download.finish()
    yield Reply([answer])


def _block_download(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Receive blocks of segments; segments after a gap are sent again (CiA 301, 7.2.4.3.8)."""
    size = request.number if request.command & wire.BLOCK_SIZE_GIVEN else None
    download = Download(access, request.address, size)
    arrived = 0
    complete = False
    command = ServerCommand.BLOCK_DOWNLOAD << 5
    answers = [wire.initiate(command | wire.BLOCK_CRC, request.address, bytes([wire.BLOCK_SEGMENTS]))]
    while not complete:
        # A segment has a number in place of a command, so every frame is one until the last.
        data = yield Reply(answers, lambda _: True)
        number = data[0] & ~wire.BLOCK_LAST
        last = bool(data[0] & wire.BLOCK_LAST)
        if number == 0:  # segments count from 1 (CiA 301, 7.2.4.3.9)
            raise Abort(Reason.SEGMENT_ZERO)
        if number == arrived + 1:
            # Segments after a gap are dropped; the client sends them again with the next block.
            arrived, complete = number, last
            download.content += data[1:]
            # The end has the number of unused bytes in the last segment.
            download.check_room(surplus=wire.SEGMENT_SIZE)
        answers = []  # only the end of a block is acknowledged
        if last or number == wire.BLOCK_SEGMENTS:
            answers = [wire.plain(command | Block.ACKNOWLEDGE, bytes([arrived, wire.BLOCK_SEGMENTS]))]
            arrived = 0  # each block numbers its segments from 1
    data = yield Reply(answers, lambda c: c >> 5 == ClientCommand.BLOCK_DOWNLOAD and c & 3 == Block.END)
    del download.content[len(download.content) - wire.unused_in(data) :]
    download.check_room()
    # The CRC is checked only if the client has offered one (CiA 301, 7.2.4.3.8).
    if request.command & wire.BLOCK_CRC and crc_hqx(download.content, 0) != wire.crc_in(data):
        # The object keeps its value, because only `finish` writes it.
        raise Abort(Reason.CRC)
    download.finish()
    yield Reply([wire.plain(command | Block.END)])


INITIATE: Mapping[int, Callable[[ObjectAccess, Initiate], ServerSteps]] = {
    ClientCommand.DOWNLOAD: _download,
    ClientCommand.UPLOAD: _upload,
    ClientCommand.BLOCK_UPLOAD: _block_upload,
    ClientCommand.BLOCK_DOWNLOAD: _block_download,
}
"""Transfers by the command of their first request."""
