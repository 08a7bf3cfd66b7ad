"""The SDO client: reads or writes one object of a server, expedited, by segments or by blocks (CiA 301, 7.2.4.3).

Answers and the time in seconds go in, requests come out, each of 8 bytes; whoever drives a transfer has the bus and the
clock. Whatever comes from the wire, nothing raises here: it ends the transfer, and `result` says how.

    transfer = upload((0x1018, 1), wait=0.5)
    requests = transfer.start(now)
    while not transfer.done:
        send all `requests`, and await a frame from the server until `transfer.deadline`
        requests = transfer.receive(data, now) if it came, else transfer.tick(now)
    content = transfer.result()

The last requests have to be sent, too: the end of a block upload, or the abort that tells the server of an odd answer
or of our time-out. Each kind of transfer is a generator that reads as CiA 301 draws it: it yields requests, is given
the answers, and returns the object's content with the requests that are still to be sent.

A server answers all its clients under one COB-ID. An answer about another object, or to another command, is somebody
else's: it is skipped, and the wait goes on to its own time-out.
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
"""Most bytes, or segments, that are taken of an object whose size the server does not give; it could go on for ever."""

LONGEST_TEXT = 1 << 14
"""The same for what is no file: a text, or what no EDS describes."""

FRUITLESS_BLOCKS = 2
"""A transfer ends after this many blocks in a row without their first segment: one may have been lost, but not more."""


class TransferError(RemoteError):
    """A transfer that failed, with its abort `code`."""

    code: int


class Aborted(TransferError):
    """The server aborted."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"the node aborts: {wire.reason(code)} (0x{code:08X})")


class OddAnswer(TransferError):
    """An answer that does not fit its request; `code` is the code of our abort."""

    def __init__(self, answer: bytes, expected: str, code: AbortCode = AbortCode.UNKNOWN_COMMAND) -> None:
        self.code = code
        super().__init__(f"the answer {answer.hex().upper()} is not {expected}")


class Silence(TransferError):
    """No answer came in time; `skipped` answers came that do not belong to the request."""

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
"""The steps of a transfer; time-out and abort are thrown into it, and a step may raise OddAnswer."""

SKIPPED: list[bytes] = []
"""What a step yields for an answer to somebody else; the time-out stays the one of the request before."""

MOST_SKIPPED = 100
"""Most skipped answers that a transfer keeps, to say what was seen."""


class Transfer:
    """One transfer; the server has `wait` seconds for each answer.

    `deadline` is when to call `tick`; it is infinite before the transfer starts and when it is `done`. `skipped` are
    the last answers that belong to another client.
    """

    def __init__(self, address: Address, steps: ClientSteps, wait: float) -> None:
        self.wait = wait
        self._address, self._steps = address, steps
        self._outcome: bytes | TransferError | None = None
        self.deadline = inf
        self.skipped: deque[bytes] = deque(maxlen=MOST_SKIPPED)

    @property
    def done(self) -> bool:
        """Whether there is a result."""
        return self._outcome is not None

    def start(self, now: float) -> list[bytes]:
        """Return the first request."""
        return self._step(lambda: next(self._steps), now)

    def receive(self, data: bytes, now: float) -> list[bytes]:
        """Return the requests that follow an answer.

        A frame that is not 8 bytes long is ignored. An abort for another object is skipped, as any other answer to an
        earlier transfer or to another client.
        """
        if self.done or len(data) != wire.LENGTH:
            return []
        if data[0] == wire.ABORT:
            abort = Initiate.of(data)
            # A server without a transfer under way, such as ours, names no object: that abort can only be for us.
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
        """Return what is sent when the server's time is over, which is usually the abort."""
        return self._step(lambda: self._steps.throw(Silence(self.skipped)), now) if now >= self.deadline else []

    def result(self) -> bytes:
        """Return the object's content, empty after a download; raises Aborted, OddAnswer, Silence."""
        assert self._outcome is not None, "the transfer is under way"
        if isinstance(self._outcome, TransferError):
            raise self._outcome
        return self._outcome

    @property
    def was_disturbed(self) -> bool:
        """Whether it got no answer while another client got some: its own may have been lost to that one's request."""
        return isinstance(self._outcome, Silence) and bool(self.skipped)

    def _step(self, step: Callable[[], list[bytes]], now: float) -> list[bytes]:
        try:
            requests = step()
        except StopIteration as end:
            self._outcome, requests = end.value
        except TransferError as error:
            self._outcome = error
            # An abort is not answered, neither by a server nor by us.
            requests = [] if isinstance(error, Aborted) else [wire.aborted(self._address, AbortCode(error.code))]
        self.deadline = inf if self.done else now + self.wait
        return requests


class Room(NamedTuple):
    """Most bytes of an object: one whose size the server announces, and one whose size it does not give.

    An object that is announced as longer, or of which more comes, is an odd answer.
    """

    announced: int = wire.LARGEST
    unannounced: int = UNANNOUNCED

    def of(self, answer: bytes, size: int | None) -> int:
        """Return how many bytes may come after the server's first answer; raises OddAnswer."""
        if size is not None and size > self.announced:
            raise OddAnswer(answer, f"about an object of at most {self.announced} bytes", AbortCode.TOO_LONG)
        return self.unannounced if size is None else size


ANY_OBJECT = Room()


def upload(address: Address, wait: float, progress: Progress = unwatched, room: Room = ANY_OBJECT) -> Transfer:
    """Read an object; the server has `wait` seconds for each answer."""
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
    """Read an object in blocks of up to 127 segments. A server without block transfer aborts; without `crc` it is 0."""
    return Transfer(address, _block_upload(address, segments, progress, room, crc), wait)


def block_download(
    address: Address, content: bytes, wait: float, progress: Progress = unwatched, crc: int = wire.BLOCK_CRC
) -> Transfer:
    """Write an object in blocks as long as the server wants them. A server without block transfer aborts."""
    return Transfer(address, _block_download(address, content, progress, crc), wait)


# Expedited and segmented


def _upload(address: Address, progress: Progress, room: Room) -> ClientSteps:
    request = wire.initiate(ClientCommand.UPLOAD << 5, address)
    answer = yield from _initiated([request], ServerCommand.UPLOAD, address)
    initiated = Initiate.of(answer)
    if initiated.command & wire.EXPEDITED:
        return Ended(initiated.rest[: initiated.size], [])  # without a size, all four bytes are the value
    content, toggle, last, count = bytearray(), 0, 0, 0
    # The size is optional (CiA 301, 7.2.4.3.6): a broken server could send segments until the memory is full.
    most = room.of(answer, initiated.size)
    while not last:
        request = wire.plain(ClientCommand.UPLOAD_SEGMENT << 5 | toggle)
        answer = yield from _segment([request], ServerCommand.UPLOAD_SEGMENT, toggle)
        content += wire.part_in(answer)
        last, toggle, count = answer[0] & wire.LAST, toggle ^ wire.TOGGLE, count + 1
        _check_size(answer, content, initiated.size, complete=bool(last))
        _check_end(answer, max(count - 1, len(content)), most)  # one that is announced as empty also has a segment
        progress(len(content), initiated.size)
    return Ended(bytes(content), [])


def _download(address: Address, content: bytes, progress: Progress) -> ClientSteps:
    request = wire.carrying(ClientCommand.DOWNLOAD, address, content)
    yield from _initiated([request], ServerCommand.DOWNLOAD, address)
    for place in () if request[0] & wire.EXPEDITED else wire.segments_of(content):
        request = wire.next_segment(ClientCommand.DOWNLOAD_SEGMENT, content, place)
        yield from _segment([request], ServerCommand.DOWNLOAD_SEGMENT, request[0] & wire.TOGGLE)
        progress(min(place + wire.SEGMENT_SIZE, len(content)), len(content))
    return Ended(b"", [])


# Blocks


def _block_upload(address: Address, segments: int, progress: Progress, room: Room, crc: int) -> ClientSteps:
    # The byte after the block size, the protocol switch threshold, stays 0: the server must not go on by segments
    # instead (CiA 301, 7.2.4.3.12). A caller that wants to fall back starts another transfer, and knows that it did.
    request = wire.initiate(ClientCommand.BLOCK_UPLOAD << 5 | crc, address, bytes([segments]))
    answer = yield from _initiated([request], ServerCommand.BLOCK_UPLOAD, address)
    initiated = Initiate.of(answer)
    size = initiated.number if initiated.command & wire.BLOCK_SIZE_GIVEN else None
    most = room.of(answer, size)
    content, complete, fruitless = bytearray(), False, 0
    request = wire.plain(ClientCommand.BLOCK_UPLOAD << 5 | Block.START)
    while not complete:
        arrived, complete, latest = yield from _receive_block(request, content, segments)
        fruitless = 0 if arrived else fruitless + 1
        # Not beyond the size: until the end says how much of the last segment is filling, it counts whole.
        progress(len(content) if size is None else min(len(content), size), size)
        _check_end(latest, len(content) - wire.SEGMENT_SIZE, most)  # up to one segment of it may be filling
        if fruitless == FRUITLESS_BLOCKS:
            raise OddAnswer(latest, "of a block that begins with segment 1", AbortCode.SEQUENCE_NUMBER)
        # The last segment in sequence and the size of the next block: the server repeats from there.
        request = wire.plain(ClientCommand.BLOCK_UPLOAD << 5 | Block.ACKNOWLEDGE, bytes([arrived, segments]))
    end = yield from _answer([request], ServerCommand.BLOCK_UPLOAD, Block.END)
    # The last segment is filled up to 7 bytes; the end says how many of them are unused (CiA 301, 7.2.4.3.15).
    del content[len(content) - wire.unused_in(end) :]
    _check_size(end, content, size, complete=True)
    if initiated.command & crc and crc_hqx(content, 0) != wire.crc_in(end):
        raise OddAnswer(end, f"the end of what came, whose CRC is 0x{crc_hqx(content, 0):04X}", AbortCode.CRC)
    return Ended(bytes(content), [wire.plain(ClientCommand.BLOCK_UPLOAD << 5 | Block.END)])


def _receive_block(
    request: bytes, content: bytearray, segments: int
) -> Generator[list[bytes], bytes, tuple[int, bool, bytes]]:
    """Ask for a block and take it in.

    Returns how many segments came in sequence, whether the last of all is among them, and the frame heard last.
    """
    requests, latest, last = [request], b"", False
    arrived, number, complete = 0, 0, False
    try:
        while not last and number < segments:
            latest = yield requests
            requests, number, last = [], latest[0] & ~wire.BLOCK_LAST, bool(latest[0] & wire.BLOCK_LAST)
            if number == arrived + 1:  # what follows a gap is sent again after the acknowledgement
                content += latest[1:]
                arrived, complete = number, last
    except Silence:
        # If anything came, only the end of the block is lost, and the acknowledgement makes the server go on. If
        # nothing did, our request may be lost, and the server would take the next one for an answer to the block
        # before.
        if not latest:
            raise
    return arrived, complete, latest


def _block_download(address: Address, content: bytes, progress: Progress, crc: int) -> ClientSteps:
    # The optional size is given, so that a server with little memory can refuse before the first segment.
    command = ClientCommand.BLOCK_DOWNLOAD << 5 | crc | wire.BLOCK_SIZE_GIVEN
    request = wire.initiate(command, address, len(content).to_bytes(4, "little"))
    answer = yield from _initiated([request], ServerCommand.BLOCK_DOWNLOAD, address)
    place, segments, fruitless = 0, _block_size(answer, answer[4]), 0
    while place in wire.segments_of(content):
        sent = wire.block(content, place, segments)
        answer = yield from _answer(sent, ServerCommand.BLOCK_DOWNLOAD, Block.ACKNOWLEDGE)
        # A server may change the block size with each acknowledgement, for example while its buffer is not yet empty.
        arrived, segments = answer[1], _block_size(answer, answer[2])
        fruitless = 0 if arrived else fruitless + 1
        if arrived > len(sent) or fruitless == FRUITLESS_BLOCKS:
            raise OddAnswer(answer, f"about {len(sent)} segments that were sent", AbortCode.SEQUENCE_NUMBER)
        place += arrived * wire.SEGMENT_SIZE  # the next block begins with the first segment that did not arrive
        progress(min(place, len(content)), len(content))
    request = wire.block_end(ClientCommand.BLOCK_DOWNLOAD, content, crc_hqx(content, 0) if crc else 0)
    yield from _answer([request], ServerCommand.BLOCK_DOWNLOAD, Block.END)
    return Ended(b"", [])


def _block_size(answer: bytes, segments: int) -> int:
    if not 1 <= segments <= wire.BLOCK_SEGMENTS:
        raise OddAnswer(answer, f"with a block of 1 to {wire.BLOCK_SEGMENTS} segments", AbortCode.BLOCK_SIZE)
    return segments


# What an answer has to be


ClientStep: TypeAlias = Generator[list[bytes], bytes, bytes]
"""One step: its requests, and the answer to them."""


def _answer(requests: list[bytes], specifier: ServerCommand, sub_command: Block = Block.INITIATE) -> ClientStep:
    """Return the answer to some requests; answers to other commands are skipped."""
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
    """Refuse a content that does not end."""
    if moved > most:
        raise OddAnswer(answer, f"the end of an object of at most {most} bytes", AbortCode.TOO_LONG)


def _check_size(answer: bytes, content: bytearray, size: int | None, complete: bool) -> None:
    """Refuse a content that is longer than its server has announced, or shorter once it is complete."""
    if size is None or len(content) == size or (len(content) < size and not complete):
        return
    code = AbortCode.TOO_LONG if len(content) > size else AbortCode.TOO_SHORT
    raise OddAnswer(answer, f"the end of {size} bytes: {len(content)} came", code)
