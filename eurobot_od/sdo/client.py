"""The SDO client: reads or writes one object of a server, expedited, by segments or by blocks (CiA 301, 7.2.4.3).

Input is answers and the time in s, output is requests of 8 bytes; the caller has the bus and the clock. Nothing that
comes from the bus raises: it ends the transfer, and `result` raises the error.

    transfer = upload((0x1018, 1), wait=0.5)
    requests = transfer.start(now)
    while not transfer.done:
        send all `requests`, and await a frame from the server until `transfer.deadline`
        requests = transfer.receive(data, now) if it came, else transfer.tick(now)
    content = transfer.result()

The last requests must be sent, too: the end of a block upload, or the abort after an invalid answer or a time-out. Each
kind of transfer is a generator in the order of CiA 301's figures: it yields requests, receives the answers, and returns
the object's content with the requests still to be sent.

A server answers all clients with one COB-ID. An answer about another object, or to another command, belongs to another
client: it is skipped, and does not extend the time-out.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections import deque
from collections.abc import Callable, Generator, Sequence
from math import inf
from typing import NamedTuple, TypeAlias

from eurobot_od.errors import RemoteError
from eurobot_od.od.values import Address
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import AbortCode, Block, ClientCommand, Initiate, ServerCommand
from eurobot_od.support.progress import Progress, unwatched

UNANNOUNCED = 1 << 20
"""Most bytes, or segments, that are read of an object whose size the server does not announce."""

LONGEST_TEXT = 1 << 14
"""The same limit for texts, and for objects without a description."""

FRUITLESS_BLOCKS = 2
"""Number of blocks in a row without their first segment after which a transfer ends."""


class TransferError(RemoteError):
    """A transfer that failed, with its abort `code`."""

    code: int


class Aborted(TransferError):
    """The server aborted."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"the node aborts: {wire.reason(code)} (0x{code:08X})")


class OddAnswer(TransferError):
    """An invalid answer; `code` is the code of our abort."""

    def __init__(self, answer: bytes, expected: str, code: AbortCode = AbortCode.UNKNOWN_COMMAND) -> None:
        self.code = code
        super().__init__(f"the answer {answer.hex().upper()} is not {expected}")


class Silence(TransferError):
    """No answer in time; `skipped` are answers that do not belong to the request."""

    code = AbortCode.TIMEOUT

    def __init__(self, skipped: Sequence[bytes] = ()) -> None:
        self.skipped = tuple(skipped)
        super().__init__("no answer in its time")
        if skipped:
            last = skipped[-1].hex().upper()
            self.args = (f"{self}; {len(skipped)} came that are not to this request, the last {last}",)


class Ended(NamedTuple):
    """A finished transfer: the object's `content`, empty after a download, and the `requests` still to send."""

    content: bytes
    requests: list[bytes]


ClientSteps: TypeAlias = Generator[list[bytes], bytes, Ended]
"""Generator of a transfer; time-outs and aborts are thrown into it, and it may raise OddAnswer."""

SKIPPED: list[bytes] = []
"""Yielded for an answer to another client; the time-out is not extended."""

MOST_SKIPPED = 100
"""Number of skipped answers that a transfer keeps for its error."""


class Transfer:
    """One transfer; the server has `wait` s for each answer.

    `deadline` is the time to call `tick`; it is infinite before the start and when the transfer is `done`. `skipped`
    are the last answers that belong to another client.
    """

    def __init__(self, address: Address, steps: ClientSteps, wait: float) -> None:
        self.wait = wait
        self._address, self._steps = address, steps
        self._outcome: bytes | TransferError | None = None
        self.deadline = inf
        self.skipped: deque[bytes] = deque(maxlen=MOST_SKIPPED)

    @property
    def done(self) -> bool:
        """Whether the transfer has ended, by success or failure."""
        return self._outcome is not None

    def start(self, now: float) -> list[bytes]:
        """Return the first request."""
        return self._step(lambda: next(self._steps), now)

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Return the requests that follow an answer.

        A frame that is not 8 bytes long is ignored. Aborts for another object, and answers to an earlier transfer or
        another client, are skipped.
        """
        if self.done or len(data) != wire.LENGTH:
            return []
        if data[0] == wire.ABORT:
            abort = Initiate.of(data)
            # A server without a transfer names no object in its abort.
            if abort.address not in (self._address, wire.NO_TRANSFER):
                self.skipped.append(data)
                return []
            return self._step(lambda: self._steps.throw(Aborted(abort.number)), now)
        deadline = self.deadline
        requests = self._step(lambda: self._steps.send(data), now)
        if requests is SKIPPED:
            self.skipped.append(data)
            self.deadline = deadline
        return requests

    def tick(self, now: float) -> list[bytes]:
        """Return the requests after the time-out: usually the abort."""
        return self._step(lambda: self._steps.throw(Silence(self.skipped)), now) if now >= self.deadline else []

    def result(self) -> bytes:
        """Return the object's content, empty after a download; raises Aborted, OddAnswer, Silence."""
        assert self._outcome is not None, "the transfer is under way"
        if isinstance(self._outcome, TransferError):
            raise self._outcome
        return self._outcome

    @property
    def was_disturbed(self) -> bool:
        """Whether it got no answer while another client did, whose request may have replaced this one."""
        return isinstance(self._outcome, Silence) and bool(self.skipped)

    def _step(self, step: Callable[[], list[bytes]], now: float) -> list[bytes]:
        try:
            requests = step()
        except StopIteration as end:
            self._outcome, requests = end.value
        except TransferError as error:
            self._outcome = error
            # An abort is not answered.
            requests = [] if isinstance(error, Aborted) else [wire.aborted(self._address, AbortCode(error.code))]
        self.deadline = inf if self.done else now + self.wait
        return requests


class Room(NamedTuple):
    """Size limits of an object in bytes: if the server announces its size, and if it does not."""

    announced: int = wire.LARGEST
    unannounced: int = UNANNOUNCED

    def of(self, answer: bytes, size: int | None) -> int:
        """Return the limit after the server's first answer; raises OddAnswer if `size` is above it."""
        if size is not None and size > self.announced:
            raise OddAnswer(answer, f"about an object of at most {self.announced} bytes", AbortCode.TOO_LONG)
        return self.unannounced if size is None else size


ANY_OBJECT, A_TEXT, A_NUMBER = Room(), Room(unannounced=LONGEST_TEXT), Room(unannounced=64)
"""Room for what no file describes, for a text, and for a number: more than it needs, so that what is wrong is seen."""


def upload(address: Address, wait: float, progress: Progress = unwatched, room: Room = ANY_OBJECT) -> Transfer:
    """Read an object; the server has `wait` s for each answer."""
    return Transfer(address, _upload(address, progress, room), wait)


def download(address: Address, content: bytes, wait: float, progress: Progress = unwatched) -> Transfer:
    """Write an object, by segments if it has more than 4 bytes."""
    return Transfer(address, _download(address, content, progress), wait)


def block_upload(
    address: Address,
    wait: float,
    segments: int = wire.BLOCK_SEGMENTS,
    progress: Progress = unwatched,
    room: Room = ANY_OBJECT,
    crc: int = wire.BLOCK_CRC,
) -> Transfer:
    """Read an object in blocks of `segments` segments; a server without block transfer aborts.

    `crc` is 0 for a transfer without CRC.
    """
    return Transfer(address, _block_upload(address, segments, progress, room, crc), wait)


def block_download(
    address: Address, content: bytes, wait: float, progress: Progress = unwatched, crc: int = wire.BLOCK_CRC
) -> Transfer:
    """Write an object in blocks of the size that the server asks for; a server without block transfer aborts."""
    return Transfer(address, _block_download(address, content, progress, crc), wait)


# Expedited and segmented


def _upload(address: Address, progress: Progress, room: Room) -> ClientSteps:
    request = wire.initiate(ClientCommand.UPLOAD << 5, address)
    answer = yield from _initiated([request], ServerCommand.UPLOAD, address)
    initiated = Initiate.of(answer)
    if initiated.command & wire.EXPEDITED:
        return Ended(initiated.rest[: initiated.size], [])  # without a size, the value has four bytes
    content = bytearray()
    toggle = last = count = 0
    # The size is optional (CiA 301, 7.2.4.3.6), so that a broken server could send segments without end.
    most = room.of(answer, initiated.size)
    while not last:
        request = wire.plain(ClientCommand.UPLOAD_SEGMENT << 5 | toggle)
        answer = yield from _segment([request], ServerCommand.UPLOAD_SEGMENT, toggle)
        content += wire.part_in(answer)
        last = answer[0] & wire.LAST
        toggle ^= wire.TOGGLE
        count += 1
        _check_size(answer, content, initiated.size, complete=bool(last))
        _check_end(answer, max(count - 1, len(content)), most)  # an empty object has a segment, too
        progress(len(content), initiated.size)
    return Ended(bytes(content), [])


def _download(address: Address, content: bytes, progress: Progress) -> ClientSteps:
    request = wire.carrying(ClientCommand.DOWNLOAD, address, content)
    yield from _initiated([request], ServerCommand.DOWNLOAD, address)
    if request[0] & wire.EXPEDITED:
        return Ended(b"", [])
    for place in wire.segments_of(content):
        request = wire.next_segment(ClientCommand.DOWNLOAD_SEGMENT, content, place)
        yield from _segment([request], ServerCommand.DOWNLOAD_SEGMENT, request[0] & wire.TOGGLE)
        progress(min(place + wire.SEGMENT_SIZE, len(content)), len(content))
    return Ended(b"", [])


# Blocks


def _block_upload(address: Address, segments: int, progress: Progress, room: Room, crc: int) -> ClientSteps:
    # The byte after the block size, the protocol switch threshold, is 0: the server must not switch to segments (CiA
    # 301, 7.2.4.3.12).
    request = wire.initiate(ClientCommand.BLOCK_UPLOAD << 5 | crc, address, bytes([segments]))
    answer = yield from _initiated([request], ServerCommand.BLOCK_UPLOAD, address)
    initiated = Initiate.of(answer)
    size = initiated.number if initiated.command & wire.BLOCK_SIZE_GIVEN else None
    most = room.of(answer, size)
    content = bytearray()
    complete = False
    fruitless = 0
    request = wire.plain(ClientCommand.BLOCK_UPLOAD << 5 | Block.START)
    while not complete:
        arrived, complete, latest = yield from _receive_block(request, content, segments)
        fruitless = 0 if arrived else fruitless + 1
        # At most the size, because the last segment's unused bytes are counted until the end.
        progress(len(content) if size is None else min(len(content), size), size)
        _check_end(latest, len(content) - wire.SEGMENT_SIZE, most)  # up to one segment may be unused
        if fruitless == FRUITLESS_BLOCKS:
            raise OddAnswer(latest, "of a block that begins with segment 1", AbortCode.SEQUENCE_NUMBER)
        # The server repeats from the last segment in sequence.
        request = wire.plain(ClientCommand.BLOCK_UPLOAD << 5 | Block.ACKNOWLEDGE, bytes([arrived, segments]))
    end = yield from _answer([request], ServerCommand.BLOCK_UPLOAD, Block.END)
    # The end has the number of unused bytes in the last segment (CiA 301, 7.2.4.3.15).
    del content[len(content) - wire.unused_in(end) :]
    _check_size(end, content, size, complete=True)
    if initiated.command & crc and crc_hqx(content, 0) != wire.crc_in(end):
        raise OddAnswer(end, f"the end of what came, whose CRC is 0x{crc_hqx(content, 0):04X}", AbortCode.CRC)
    return Ended(bytes(content), [wire.plain(ClientCommand.BLOCK_UPLOAD << 5 | Block.END)])


def _receive_block(
    request: bytes, content: bytearray, segments: int
) -> Generator[list[bytes], bytes, tuple[int, bool, bytes]]:
    """Send `request` and receive a block.

    Returns the number of segments in sequence, whether the last one of all is among them, and the last frame.
    """
    requests = [request]
    latest = b""
    arrived = number = 0
    last = complete = False
    try:
        while not last and number < segments:
            latest = yield requests
            requests = []
            number = latest[0] & ~wire.BLOCK_LAST
            last = bool(latest[0] & wire.BLOCK_LAST)
            if number == arrived + 1:  # segments after a gap are sent again after the acknowledgement
                content += latest[1:]
                arrived, complete = number, last
    except Silence:
        # If a segment came, only the end of the block is lost, and the acknowledgement makes the server continue. If
        # none came, our request may be lost, and the server would take the next one as the answer to the block before.
        if not latest:
            raise
    return arrived, complete, latest


def _block_download(address: Address, content: bytes, progress: Progress, crc: int) -> ClientSteps:
    # With the optional size, a server with little memory can refuse at once.
    command = ClientCommand.BLOCK_DOWNLOAD << 5 | crc | wire.BLOCK_SIZE_GIVEN
    request = wire.initiate(command, address, len(content).to_bytes(4, "little"))
    answer = yield from _initiated([request], ServerCommand.BLOCK_DOWNLOAD, address)
    place = 0
    segments = _block_size(answer, answer[4])
    fruitless = 0
    while place in wire.segments_of(content):
        sent = wire.block(content, place, segments)
        answer = yield from _answer(sent, ServerCommand.BLOCK_DOWNLOAD, Block.ACKNOWLEDGE)
        # A server may change the block size with each acknowledgement, for example while its buffer is not empty.
        arrived = answer[1]
        segments = _block_size(answer, answer[2])
        fruitless = 0 if arrived else fruitless + 1
        if arrived > len(sent) or fruitless == FRUITLESS_BLOCKS:
            raise OddAnswer(answer, f"about {len(sent)} segments that were sent", AbortCode.SEQUENCE_NUMBER)
        place += arrived * wire.SEGMENT_SIZE  # the next block begins with the first missing segment
        progress(min(place, len(content)), len(content))
    request = wire.block_end(ClientCommand.BLOCK_DOWNLOAD, content, crc_hqx(content, 0) if crc else 0)
    yield from _answer([request], ServerCommand.BLOCK_DOWNLOAD, Block.END)
    return Ended(b"", [])


def _block_size(answer: bytes, segments: int) -> int:
    if not 1 <= segments <= wire.BLOCK_SEGMENTS:
        raise OddAnswer(answer, f"with a block of 1 to {wire.BLOCK_SEGMENTS} segments", AbortCode.BLOCK_SIZE)
    return segments


# Checks of answers


ClientStep: TypeAlias = Generator[list[bytes], bytes, bytes]
"""Generator of one step: yields requests, returns the answer."""


def _answer(requests: list[bytes], specifier: ServerCommand, sub_command: Block = Block.INITIATE) -> ClientStep:
    """Return the answer to requests; answers to other commands are skipped."""
    expected = specifier, sub_command
    answer = yield requests
    while (answer[0] >> 5, answer[0] & wire.ANSWER_SUB_COMMAND.get(specifier, 0)) != expected:
        answer = yield SKIPPED
    return answer


def _initiated(requests: list[bytes], specifier: ServerCommand, address: Address) -> ClientStep:
    """Return the answer to the first request of a transfer; answers about other objects are skipped."""
    answer = yield from _answer(requests, specifier)
    while Initiate.of(answer).address != address:
        answer = yield from _answer(SKIPPED, specifier)
    return answer


def _segment(requests: list[bytes], specifier: ServerCommand, toggle: int) -> ClientStep:
    answer = yield from _answer(requests, specifier)
    if answer[0] & wire.TOGGLE != toggle:
        raise OddAnswer(answer, "with the toggle bit of the request", AbortCode.TOGGLE_BIT)
    return answer


def _check_end(answer: bytes, moved: int, most: int) -> None:
    """Check that at most `most` bytes were moved; raises OddAnswer."""
    if moved > most:
        raise OddAnswer(answer, f"the end of an object of at most {most} bytes", AbortCode.TOO_LONG)


def _check_size(answer: bytes, content: bytearray, size: int | None, complete: bool) -> None:
    """Check that content is not longer than announced, nor shorter once it is complete; raises OddAnswer."""
    if size is None or len(content) == size or (len(content) < size and not complete):
        return
    code = AbortCode.TOO_LONG if len(content) > size else AbortCode.TOO_SHORT
    raise OddAnswer(answer, f"the end of {size} bytes: {len(content)} came", code)
