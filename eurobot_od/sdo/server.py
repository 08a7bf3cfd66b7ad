"""The SDO server: expedited, segmented and block transfer, both ways (CiA 301, 7.2.4.3).

Requests and the time in seconds go in, answers come out, each of 8 bytes. There is one transfer at a time; a new one
replaces it. The object access knows what an object is, who may access it and how long it is; in here there are only
bytes.

As in the client, each kind of transfer is a generator that reads as CiA 301 draws it: it is given a request and yields
the answers.
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
"""Seconds without a request after which the server gives up a transfer."""


class ObjectAccess(Protocol):
    """The objects that a server gives access to; every method raises Abort."""

    def read(self, address: Address) -> bytes:
        """Return an object's value."""

    def admit(self, address: Address, size: int | None) -> int:
        """Return how many bytes may be written; refuses an object that cannot be written, or not with `size` bytes."""

    def write(self, address: Address, data: bytes) -> None:
        """Give an object its value."""


class Reply(NamedTuple):
    """The `frames` that answer a request, and the command bytes that continue the transfer; None at its end."""

    frames: list[bytes]
    takes: Callable[[int], bool] | None = None


ServerSteps: TypeAlias = Generator[Reply, bytes, None]
"""The steps of a transfer; a step may raise Abort."""


class SdoServer:
    """One SDO server.

    `deadline` is when it gives up the transfer under way, infinite without one. `aborted` is its last abort.
    """

    def __init__(self, access: ObjectAccess) -> None:
        self._access = access
        self.aborted: Abort | None = None
        self.forget()

    def forget(self) -> None:
        """Drop the transfer under way silently."""
        # An abort outside a transfer is about no object, and names 0x0000:00.
        self._address, self.deadline = wire.NO_TRANSFER, inf
        self._steps: ServerSteps | None = None
        self._takes: Callable[[int], bool] | None = None

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Return the answers to a request; there is none to a client's abort, or to a frame that is not a request."""
        # All SDO frames have 8 bytes (CiA 301, 7.2.4.3). Others are not even aborted: a truncated frame may belong to
        # another client's transfer, which an abort would end.
        if len(data) != wire.LENGTH:
            return []
        # Before the transfer under way, which takes any frame for a segment during a block download.
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
        # It is neither a step of the transfer nor the first request of another: its client has lost its way.
        return self._abort(Abort(Reason.OUT_OF_STEP))

    def tick(self, now: float) -> list[bytes]:
        """Return the abort of a transfer whose client has fallen silent."""
        return self._abort(Abort(Reason.CLIENT_SILENT)) if now >= self.deadline else []

    def _answered(self, steps: ServerSteps, data: bytes | None, now: float) -> list[bytes]:
        """Return the answers to a request (None starts the transfer), or the abort that ends it."""
        try:
            frames, self._takes = steps.send(data)  # type: ignore[arg-type]  # None starts a generator
        except Abort as abort:
            return self._abort(abort)
        self.deadline = now + TIMEOUT  # again with each step: a transfer may take long, but not be silent for long
        if self._takes is None:  # the last answer: nothing is left that could time out
            self.forget()
        return frames

    def _abort(self, abort: Abort) -> list[bytes]:
        # Kept without the frames in which it was raised: they would hold on to the bus that the request came from.
        abort.__cause__ = abort.__context__ = None
        address, self.aborted = self._address, abort.with_traceback(None)
        self.forget()
        return [wire.aborted(address, abort.reason.code)]


# Uploads


def _upload(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Send up to 4 bytes at once, or segments of 7 bytes, one for each request (CiA 301, 7.2.4.3.6)."""
    content = access.read(request.address)
    answer = wire.carrying(ServerCommand.UPLOAD, request.address, content)
    for place in () if answer[0] & wire.EXPEDITED else wire.segments_of(content):
        data = yield Reply([answer], lambda command: command >> 5 == ClientCommand.UPLOAD_SEGMENT)
        answer = wire.next_segment(ServerCommand.UPLOAD_SEGMENT, content, place)
        _check_toggle(data, answer[0] & wire.TOGGLE)
    yield Reply([answer])


def _block_upload(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Send blocks of segments, each of them acknowledged, with a CRC over the whole (CiA 301, 7.2.4.3.12)."""

    def takes(command: int) -> bool:
        # The initiate has the same specifier, and is left to the table below, as it starts another transfer.
        return command >> 5 == ClientCommand.BLOCK_UPLOAD and command & 3 != Block.INITIATE

    content = access.read(request.address)
    place, segments = 0, _checked_block_size(request.rest[0])
    command = ServerCommand.BLOCK_UPLOAD << 5 | wire.BLOCK_CRC | wire.BLOCK_SIZE_GIVEN
    # A client that does not offer a CRC need not be able to check one; the field is then 0 (CiA 301, 7.2.4.3.15).
    end = wire.block_end(
        ServerCommand.BLOCK_UPLOAD, content, crc_hqx(content, 0) if request.command & wire.BLOCK_CRC else 0
    )
    first = wire.initiate(command, request.address, len(content).to_bytes(4, "little"))
    _check_block((yield Reply([first], takes)), Block.START)
    while place in wire.segments_of(content):
        sent = wire.block(content, place, segments)
        data = yield Reply(sent, takes)
        _check_block(data, Block.ACKNOWLEDGE)
        # The client may change the block size with each acknowledgement; segments that it missed are sent again.
        arrived, segments = data[1], _checked_block_size(data[2])
        # It acknowledges what was never sent, so the two ends no longer mean the same bytes; CiA's own test tool asks
        # for segment 128 of 127 (its test 2.27).
        if arrived > len(sent):
            raise Abort(Reason.NEVER_SENT)
        place += arrived * wire.SEGMENT_SIZE
    _check_block((yield Reply([end], takes)), Block.END)
    yield Reply([])


def _check_toggle(data: bytes, toggle: int) -> None:
    if data[0] & wire.TOGGLE != toggle:
        # The bit alternates so that a repeated or lost request is noticed: to go on would double or drop seven bytes
        # unnoticed (CiA 301, 7.2.4.3.7).
        raise Abort(Reason.TOGGLE_BIT)


def _check_block(data: bytes, sub_command: Block) -> None:
    if data[0] & 3 != sub_command:
        # For example an end where an acknowledgement was due: the client believes that it has something else.
        raise Abort(Reason.OUT_OF_STEP)


def _checked_block_size(segments: int) -> int:
    if not 1 <= segments <= wire.BLOCK_SEGMENTS:
        # Segments are numbered from 1, in seven bits (CiA 301, 7.2.4.3.12).
        raise Abort(Reason.BLOCK_SIZE)
    return segments


# Downloads


class Download:
    """The bytes of an object as they come; `size` is what the client has announced, None if it has not."""

    def __init__(self, access: ObjectAccess, address: Address, size: int | None) -> None:
        self.content = bytearray()
        self._access, self._address, self._size = access, address, size
        # Asked before the first byte comes: for a read-only object, or one that is too long, the client should know now
        # and not after a megabyte.
        self._room = access.admit(address, size)

    def check_room(self, surplus: int = 0) -> None:
        limit = self._room if self._size is None else self._size
        if len(self.content) > limit + surplus:
            raise Abort(Reason.MORE_BYTES)

    def finish(self) -> None:
        # The object is written only now, as a whole: a transfer that breaks off leaves it as it was.
        if self._size is not None and len(self.content) < self._size:
            raise Abort(Reason.FEWER_BYTES)
        self._access.write(self._address, bytes(self.content))


def _download(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Take up to 4 bytes at once, or segments of up to 7 bytes, each of them answered (CiA 301, 7.2.4.3.4)."""
    answer = wire.initiate(ServerCommand.DOWNLOAD << 5, request.address)
    if request.command & wire.EXPEDITED:
        # If the client does not say how many bytes it means, it means as many as the object has.
        room = access.admit(request.address, request.size)
        access.write(request.address, request.rest[: request.size or min(room, wire.EXPEDITED_SIZE)])
    else:
        # The first segment has the toggle bit 0, whatever the last transfer ended with (CiA 301, 7.2.4.3.4).
        download, toggle, last = Download(access, request.address, request.size), 0, 0
        while not last:
            data = yield Reply([answer], lambda command: command >> 5 == ClientCommand.DOWNLOAD_SEGMENT)
            _check_toggle(data, toggle)
            download.content += wire.part_in(data)
            download.check_room()
            answer, last = wire.plain(ServerCommand.DOWNLOAD_SEGMENT << 5 | toggle), data[0] & wire.LAST
            toggle ^= wire.TOGGLE
        download.finish()
    yield Reply([answer])


def _block_download(access: ObjectAccess, request: Initiate) -> ServerSteps:
    """Take blocks of segments; segments after a gap are asked for again (CiA 301, 7.2.4.3.8)."""
    size = request.number if request.command & wire.BLOCK_SIZE_GIVEN else None
    download, arrived, complete = Download(access, request.address, size), 0, False
    command = ServerCommand.BLOCK_DOWNLOAD << 5
    answers = [wire.initiate(command | wire.BLOCK_CRC, request.address, bytes([wire.BLOCK_SEGMENTS]))]
    while not complete:
        # A segment has no command, only its number: until the last one has come, a frame cannot be anything else.
        data = yield Reply(answers, lambda _: True)
        number, last = data[0] & ~wire.BLOCK_LAST, bool(data[0] & wire.BLOCK_LAST)
        if number == 0:  # segments count from 1 (CiA 301, 7.2.4.3.9)
            raise Abort(Reason.SEGMENT_ZERO)
        if number == arrived + 1:
            # Only in sequence: nothing after a gap is kept, as the client sends it again with the next block.
            arrived, complete = number, last
            download.content += data[1:]
            # Only the end tells how many bytes of the last segment count, so until then it may look too long.
            download.check_room(surplus=wire.SEGMENT_SIZE)
        answers = []  # a block is acknowledged as a whole, and its client does not wait before
        if last or number == wire.BLOCK_SEGMENTS:
            answers = [wire.plain(command | Block.ACKNOWLEDGE, bytes([arrived, wire.BLOCK_SEGMENTS]))]
            arrived = 0  # each block numbers its segments from 1
    data = yield Reply(answers, lambda c: c >> 5 == ClientCommand.BLOCK_DOWNLOAD and c & 3 == Block.END)
    del download.content[len(download.content) - wire.unused_in(data) :]
    download.check_room()
    # The CRC counts only if the client has offered one; we always do (CiA 301, 7.2.4.3.8).
    if request.command & wire.BLOCK_CRC and crc_hqx(download.content, 0) != wire.crc_in(data):
        # The object keeps its value: `finish`, which writes it, comes later.
        raise Abort(Reason.CRC)
    download.finish()
    yield Reply([wire.plain(command | Block.END)])


INITIATE: Mapping[int, Callable[[ObjectAccess, Initiate], ServerSteps]] = {
    ClientCommand.DOWNLOAD: _download,
    ClientCommand.UPLOAD: _upload,
    ClientCommand.BLOCK_UPLOAD: _block_upload,
    ClientCommand.BLOCK_DOWNLOAD: _block_download,
}
"""The transfer that each first request starts."""
