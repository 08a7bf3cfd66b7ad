"""Reassembles SDO transfers from frames: segments, blocks, aborts, and missing frames (CiA 301, 7.2.4).

Theory of operation: a channel, on one bus, has one transfer at a time. Its frames move a `Running` on; the frame that
ends it says object, value, size, time and CRC. In the middle of a block only the frames before it tell a segment
from a command. A log that begins there, or lacks the beginning, is understood from the second segment on: only
segments of a block come one after the other from one end, numbered. A block without an end, as when its master was
killed, ends with the first frame that cannot be in it: another kind of answer, a number that the block cannot have, a
gap in the numbers after a silence, or the node's boot-up.

There is no clock in here: frames go in with their times. A transfer takes at most KEPT bytes of memory, however long it
is, and frames that a log lacks do not spoil another transfer.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple, TypeAlias

from eurobot_od.od.standard import LSS_IDENTITY, Lss
from eurobot_od.od.values import DATA_TYPES, Address
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import BLOCK_LAST, SEGMENT_SIZE, Block, ClientCommand, Initiate, ServerCommand
from eurobot_od.support.texts import amount
from eurobot_od.support.texts import text as duration
from eurobot_od.traffic.entries import shortened
from eurobot_od.traffic.meaning import SdoTransfer
from eurobot_od.traffic.services import READ, SdoEnd, command_of, object_words, value_words

KEPT = 4096
"""Maximum size of a content kept for its value, in bytes; longer ones have only size and CRC."""

LONGEST_VALUE = 100
"""Maximum number of characters of a value in a line."""

SKIPPED = "a segment before this one is not in the log"
"""Text for a wrong toggle bit."""

ONE_WAY = {
    False: "no answers in this log: settings are as the files say, but for those that are written in it",
    True: "no requests in this log: of what was written nobody knows what it was",
}
"""Notes on a log with only SDO requests (False) or only answers (True)."""

SILENCE = 1.0
"""Silence after which a segment with an unexpected number does not count as one, in s."""


class How(Enum):
    """Kinds of transfers, with their words."""

    EXPEDITED = "expedited"
    SEGMENTED = "segmented"
    BLOCKS = "in blocks"


class Said(NamedTuple):
    """What a frame adds to its transfer.

    `text` stands in place of its own words, `more` behind them; `lost` is what the log lacks. `ended` is a transfer
    that ends here. `unseen` is an object whose write is confirmed here, and the log does not have the request.
    """

    text: str = ""
    more: str = ""
    lost: str = ""
    ended: SdoTransfer | None = None
    unseen: Address | None = None


NOTHING = Said()


@dataclass
class Running:
    """A transfer in progress.

    `end` is that of its requests; `taken` are the segments of the present block, `tail` the last segment that was
    acknowledged, whose unused bytes only the end of the transfer tells; a block has at most `longest`, the last one was
    `heard`. Without an `address` its beginning is missing.
    """

    end: SdoEnd
    address: Address | None
    is_upload: bool
    began: float
    how: How = How.EXPEDITED
    announced: int | None = None
    content: bytearray = field(default_factory=bytearray)
    size: int = 0
    crc: int = 0
    lost: int = 0
    is_last: bool = False
    toggle: int = 0
    has_crc: bool = False
    in_block: bool = False
    longest: int = wire.BLOCK_SEGMENTS
    heard: float = 0.0
    expected: int = 1
    taken: dict[int, bytes] = field(default_factory=dict)
    tail: bytes = b""
    verdict: str = ""

    @classmethod
    def begun(cls, end: SdoEnd, direction: str, time: float, data: bytes) -> Running:
        """Return the transfer that a request starts."""
        initiate = Initiate.of(data)
        is_upload = direction == READ
        running = cls(end, initiate.address, is_upload, time)
        # The size of a read comes with the server's answer (CiA 301, 7.2.4.3.12).
        content, running.announced = end.content(direction, data)
        if end.is_in_blocks(data):
            running.how = How.BLOCKS
            running.heard = time
            running.has_crc = bool(data[0] & wire.BLOCK_CRC)
            running.longest = data[4] if is_upload and data[4] else wire.BLOCK_SEGMENTS
        elif content is not None:
            running.announced = None
            running.add(content)
        elif not is_upload:
            running.how = How.SEGMENTED
        return running

    def add(self, part: bytes) -> None:
        """Add a part of the content."""
        self.content += part[: max(0, KEPT - self.size)]
        self.size += len(part)
        self.crc = crc_hqx(part, self.crc)

    def words(self, what: str, time: float) -> str:
        """Format the transfer with object, value, size and time."""
        value = ""
        if self.address is not None and self.size <= KEPT and not self.lost:
            value = shortened(value_words(self.end.dictionary, self.address, bytes(self.content)), LONGEST_VALUE)
        parts = [f"{self.object}{f' = {value}' if value else ''}", amount(self.size, "byte"), f"in {_took(self, time)}"]
        return f"{what} {', '.join(filter(None, (*parts, self.verdict)))}"

    @property
    def object(self) -> str:
        """Object with its name."""
        return "an object" if self.address is None else object_words(self.end.dictionary, self.address)

    @property
    def missing(self) -> str:
        """Text on what the log lacks of the transfer."""
        if self.address is None:
            return "its beginning is not in the log"
        return f"{amount(self.lost, 'segment')} of it not in the log" if self.lost else ""

    def ended(self, time: float, aborted: int | None = None, is_whole: bool = True) -> SdoTransfer:
        """Return the finished transfer, for statistics."""
        seconds = time - self.began
        # Of a refused write in one frame all bytes were there, too.
        came = aborted is None or (not self.is_upload and self.how is How.EXPEDITED)
        kept = is_whole and came and not self.lost and self.size <= KEPT
        way = self.object, self.is_upload, self.how.value, self.size, seconds, aborted, self.lost, is_whole
        return SdoTransfer(*way, self.end, self.address, bytes(self.content) if kept else None)

    @property
    def broken(self) -> str:
        """Text on a transfer without an end, with the size received."""
        came = amount(self.size if self.announced is None else self.announced, "byte")
        came = came if self.announced is None else f"{self.size} of {came}"
        variable = self.end.dictionary.variable(self.address) if self.end.dictionary and self.address else None
        type_ = DATA_TYPES.get(variable.data_type or 0) if variable else None
        misfit = self.announced is not None and type_ is not None and type_.size not in (0, self.announced)
        has = f"; the object has {type_.size}" if type_ and misfit else ""
        return f"the {'read' if self.is_upload else 'write'} of {self.object} before did not end; {came} came{has}"

    def is_left(self, end: SdoEnd, time: float, data: bytes) -> bool:
        """Return whether a frame amid a block shows that its sender abandoned the transfer."""
        if end.is_answer is not self.is_upload:
            return data[0] >> 5 != ServerCommand.BLOCK_DOWNLOAD  # the same number as the client's BLOCK_UPLOAD
        number = data[0] & ~BLOCK_LAST
        return not 0 < number <= self.longest or (number > self.expected and time - self.heard > SILENCE)

    def forget(self, data: bytes) -> None:
        """Remove a segment that turned out to be a request."""
        if self.taken.get(number := data[0] & ~BLOCK_LAST) == data[1:]:
            del self.taken[number]

    def take_segment(self, time: float, data: bytes) -> Said:
        """Process a segment of a block."""
        number = data[0] & ~BLOCK_LAST
        part = data[1:]
        self.heard = time
        if number < self.expected:  # another block, whose acknowledgement is not in the log
            self.take_over()
        self.taken[number] = part
        self.expected = number + 1
        self.is_last = bool(data[0] & BLOCK_LAST)
        return Said(text=f"block segment {number}{', the last' if self.is_last else ''}")

    def take_over(self) -> None:
        """Append the segments of a block whose acknowledgement is missing."""
        for number in sorted(self.taken):
            # One segment late, as only the end of the transfer gives the length of the last one.
            self.add(self.tail)
            self.tail = self.taken[number]
        self.taken.clear()

    def take_rest(self) -> None:
        """Append the received segments of an abandoned transfer, up to its announced size."""
        self.take_over()
        left = SEGMENT_SIZE if self.announced is None else self.announced - self.size
        self.add(self.tail[: max(0, left)])
        self.tail = b""

    def count_lost(self) -> None:
        """Count missing segments by the announced size, after all received ones were appended."""
        if self.announced is not None and self.size < self.announced and not self.lost:
            # Rounded up, as the last segment may be shorter.
            self.lost = -(-(self.announced - self.size) // SEGMENT_SIZE)

    def ends_with(self, end: SdoEnd, data: bytes) -> bool:
        """Return whether a frame is the end, after the last segment; no block segment looks like it."""
        command = ServerCommand.BLOCK_UPLOAD if self.is_upload else ClientCommand.BLOCK_DOWNLOAD
        is_possible = self.is_last or not self.taken
        ends = data[0] >> 5 == command and bool(data[0] & Block.END)
        return is_possible and ends and end.is_answer is self.is_upload

    def compare(self, crc: int) -> str:
        """Return text on the comparison of the final CRC with that of the content."""
        if not self.has_crc:
            return "no CRC"
        if self.missing:
            return f"CRC 0x{crc:04X}, which cannot be checked"
        return f"CRC 0x{crc:04X} is right" if self.crc == crc else f"CRC 0x{crc:04X} is wrong: it is 0x{self.crc:04X}"


def _took(running: Running, time: float) -> str:
    return duration(max(0.0, time - running.began), 6)


SdoStep: TypeAlias = "Callable[[Transfers, tuple[str, int], Running, float, bytes], Said]"
"""Processes a frame of a transfer."""


class Transfers:
    """Transfers on all buses of a log, by channel of the log and of SDO."""

    def __init__(self) -> None:
        self._running: dict[tuple[str, int], Running] = {}
        self._before: dict[tuple[str, int], tuple[bool, bytes]] = {}

    def take(self, time: float, channel: str, end: SdoEnd, data: bytes) -> Said:
        """Process an SDO frame of 8 bytes, and return what it adds to its transfer."""
        key = channel, end.channel
        running = self._running.get(key)
        before = self._before.get(key)
        self._before[key] = (end.is_answer, data)
        if before and before[0] is end.is_answer and (running is None or running.how is not How.BLOCKS):
            running = self._begun_before(key, end, time, before[1], data) or running
        if data[0] == wire.ABORT:
            return self._aborted(key, end, time, data)
        left = NOTHING
        if running and running.in_block and not running.ends_with(end, data):
            if running.is_left(end, time, data):
                left = self._left(key, time, before if end.is_answer else None)
            elif end.is_answer is running.is_upload:
                return running.take_segment(time, data)
        said = self._step(key, end, time, data)
        return said._replace(lost=left.lost or said.lost, ended=left.ended or said.ended)

    def _step(self, key: tuple[str, int], end: SdoEnd, time: float, data: bytes) -> Said:
        command = end.command(data)
        step = STEPS[end.is_answer].get(command_of(end.is_answer, data))
        if command and command.names_object and not end.is_answer:
            # An unfinished transfer was abandoned, or its end is not in the log.
            abandoned = self._give_up(key, time)
            self._running[key] = Running.begun(end, command.direction, time, data)
            return abandoned
        running = self._running.get(key)
        if command_of(end.is_answer, data) == (ServerCommand.DOWNLOAD, 0) and end.is_answer:
            address = Initiate.of(data).address
            if running is None or running.is_upload or running.address != address:
                return Said(unseen=address)
        if not (running and command and step) or running.is_upload is not (command.direction == READ):
            return NOTHING
        if end.is_in_blocks(data) and running.how is not How.BLOCKS:
            return NOTHING
        return step(self, key, running, time, data)

    def unfinished(self) -> Iterator[tuple[tuple[str, int], SdoTransfer]]:
        """Yield the transfers cut off by the end of the log, with their channels of the log and of SDO."""
        for key, running in self._running.items():
            running.take_rest()
            yield key, running.ended(running.began, is_whole=False)

    # How a transfer begins and ends

    def _begun_before(
        self, key: tuple[str, int], end: SdoEnd, time: float, before: bytes, data: bytes
    ) -> Running | None:
        """Start amid a block if two frames from one end are its segments; return None otherwise."""
        number = before[0] & ~BLOCK_LAST
        if before[0] & BLOCK_LAST or number == 0 or data[0] & ~BLOCK_LAST != number + 1:
            return None
        taken = {number: before[1:]}
        self._running[key] = Running(end, None, end.is_answer, time, How.BLOCKS, in_block=True, taken=taken)
        return self._running[key]

    def _give_up(self, key: tuple[str, int], time: float) -> Said:
        """End the running transfer of a channel, if any, without its end."""
        running = self._running.pop(key, None)
        if running is None:
            return NOTHING
        running.take_rest()
        # An unanswered expedited request is no broken transfer, as the node may not be there.
        lost = "" if running.how is How.EXPEDITED else running.broken
        return Said(lost=lost, ended=running.ended(time, is_whole=False))

    def _left(self, key: tuple[str, int], time: float, before: tuple[bool, bytes] | None) -> Said:
        """End an abandoned transfer; `before` is the frame before, if it may be a request."""
        running = self._running[key]
        asked = before[1] if before and not before[0] and not running.is_upload else b""
        if asked:
            running.forget(asked)
        said = self._give_up(key, time)
        if asked:
            self._step(key, running.end, time, asked)
        return said

    def boot(self, channel: str, server: int) -> Iterator[Said]:
        """End the transfers with a server that has booted."""
        for key in [key for key, each in self._running.items() if key[0] == channel and each.end.server == server]:
            self._before.pop(key, None)
            yield self._give_up(key, self._running[key].heard)

    def _finish(self, key: tuple[str, int], time: float) -> Said:
        """End a transfer with the present frame."""
        running = self._running.pop(key)
        what = "value of" if running.is_upload else "written"
        running.count_lost()
        is_whole = running.address is not None
        return Said(running.words(what, time), lost=running.missing, ended=running.ended(time, is_whole=is_whole))

    def _aborted(self, key: tuple[str, int], end: SdoEnd, time: float, data: bytes) -> Said:
        running = self._running.pop(key, None)
        abort = Initiate.of(data)
        if running is None:
            return NOTHING
        running.take_rest()
        name = running.object if abort.address == wire.NO_TRANSFER else object_words(end.dictionary, abort.address)
        by = "the server" if end.is_answer else "the client"
        text = f"abort {name}: {wire.code_and_reason(abort.number)}"
        if running.how is not How.EXPEDITED:
            text += f", by {by} after {amount(running.size, 'byte')} in {_took(running, time)}"
        return Said(text=text, ended=running.ended(time, abort.number))

    # Segments

    def _segment(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        """Process a segment; the last one of a read is the end."""
        if running.how is not How.SEGMENTED:
            return NOTHING
        lost = "" if data[0] & wire.TOGGLE == running.toggle else SKIPPED
        running.lost += bool(lost)
        running.toggle = data[0] & wire.TOGGLE ^ wire.TOGGLE
        running.add(wire.part_in(data))
        running.is_last = bool(data[0] & wire.LAST)
        return self._finish(key, time) if running.is_last and running.is_upload else Said(lost=lost)

    def _segment_taken(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        return self._finish(key, time) if running.is_last else NOTHING

    # Answers to the first request

    def _value(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        initiate = Initiate.of(data)
        if running.address != initiate.address:
            return NOTHING
        # A server may answer a block read with a normal upload (CiA 301, 7.2.4.3.12).
        if initiate.command & wire.EXPEDITED:
            running.how = How.EXPEDITED
            running.add(initiate.rest[: initiate.size])
            return Said(ended=self._running.pop(key).ended(time))
        running.how, running.announced = How.SEGMENTED, initiate.size
        return NOTHING

    def _written(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        if running.address != Initiate.of(data).address or running.how is not How.EXPEDITED:
            return NOTHING
        return Said(ended=self._running.pop(key).ended(time))

    # Blocks

    def _blocks_begin(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        running.has_crc = running.has_crc and bool(data[0] & wire.BLOCK_CRC)
        if running.is_upload:
            running.announced = Initiate.of(data).number if data[0] & wire.BLOCK_SIZE_GIVEN else None
        else:
            running.in_block = True
            running.longest = data[4] or wire.BLOCK_SEGMENTS
        return NOTHING

    def _start(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        running.in_block = True
        return NOTHING

    def _acknowledged(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        """Append the acknowledged segments of a block; later ones are sent again."""
        highest = data[1]
        missing = 0
        sent = max(running.taken, default=0)
        for number in range(1, highest + 1):
            part = running.taken.get(number)
            missing += part is None
            running.add(running.tail)
            running.tail = bytes(SEGMENT_SIZE) if part is None else part
        running.lost += missing
        running.is_last = running.is_last and sent <= highest
        running.in_block = running.in_block and not running.is_last
        running.longest = data[2] or wire.BLOCK_SEGMENTS
        running.taken.clear()
        running.expected = 1
        again = f", {amount(sent - highest, 'segment')} to be sent again" if sent > highest else ""
        return Said(more=again, lost=f"{amount(missing, 'segment')} of the block not in the log" if missing else "")

    def _blocks_end(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        """Append the last segment, and compare the CRC."""
        running.in_block = False
        running.take_over()  # segments whose acknowledgement is not in the log
        running.add(running.tail[: SEGMENT_SIZE - wire.unused_in(data)])
        running.count_lost()
        running.verdict = running.compare(wire.crc_in(data))
        return Said(more=f", {running.verdict}")

    def _blocks_end_taken(self, key: tuple[str, int], running: Running, time: float, data: bytes) -> Said:
        if running.verdict:
            return self._finish(key, time)
        running.take_rest()
        said = self._finish(key, time)
        return said._replace(lost=said.lost or "the end of its blocks is not in the log")


# Steps by frame


STEPS: tuple[Mapping[tuple[int, int], SdoStep], ...] = (
    {
        (ClientCommand.DOWNLOAD_SEGMENT, 0): Transfers._segment,
        (ClientCommand.BLOCK_DOWNLOAD, Block.END): Transfers._blocks_end,
        (ClientCommand.BLOCK_UPLOAD, Block.START): Transfers._start,
        (ClientCommand.BLOCK_UPLOAD, Block.ACKNOWLEDGE): Transfers._acknowledged,
        (ClientCommand.BLOCK_UPLOAD, Block.END): Transfers._blocks_end_taken,
    },
    {
        (ServerCommand.UPLOAD, 0): Transfers._value,
        (ServerCommand.DOWNLOAD, 0): Transfers._written,
        (ServerCommand.UPLOAD_SEGMENT, 0): Transfers._segment,
        (ServerCommand.DOWNLOAD_SEGMENT, 0): Transfers._segment_taken,
        (ServerCommand.BLOCK_DOWNLOAD, Block.INITIATE): Transfers._blocks_begin,
        (ServerCommand.BLOCK_DOWNLOAD, Block.ACKNOWLEDGE): Transfers._acknowledged,
        (ServerCommand.BLOCK_DOWNLOAD, Block.END): Transfers._blocks_end_taken,
        (ServerCommand.BLOCK_UPLOAD, Block.INITIATE): Transfers._blocks_begin,
        (ServerCommand.BLOCK_UPLOAD, Block.END): Transfers._blocks_end,
    },
)
"""Steps of requests and of answers, by command specifier and sub-command, without those that start a transfer."""


# LSS: whose node-ID it sets (CiA 305)


class LssConfiguration:
    """Node-IDs that LSS gives to devices, with what is known of each identity.

    `taken` are those that the devices have confirmed; they hold from the next boot-up under the node-ID on. None stands
    for the one device on the bus: who switches all into configuration state at once has only one there.
    """

    def __init__(self) -> None:
        self._named: dict[int, int] = {}
        self._asked = b""
        self._is_global = False
        self.taken: dict[int, dict[int, int] | None] = {}

    def take(self, is_answer: bool, data: bytes) -> None:
        """Process a request or an answer."""
        command = data[0]
        asked = self._asked
        if not is_answer:
            self._asked = data
        if command in (Lss.SWITCH_GLOBAL, Lss.SELECT):
            self._named = {}
            self._is_global = command == Lss.SWITCH_GLOBAL
        if command in SELECTS or (command in INQUIRES and is_answer):
            self._named[(command - Lss.SELECT) % (Lss.INQUIRE - Lss.SELECT)] = int.from_bytes(data[1:5], "little")
        elif command == Lss.IDENTIFY_SLAVE and asked[:1] == bytes([Lss.FASTSCAN]) and asked[5] == 0:
            self._named[asked[6]] = int.from_bytes(asked[1:5], "little")  # all bits down to the lowest one are found
        elif command == Lss.CONFIGURE_NODE_ID and is_answer and asked[:1] == data[:1] and not data[1]:
            self.taken[asked[1]] = None if self._is_global and not self._named else dict(self._named)


SELECTS, INQUIRES = (range(first, first + len(LSS_IDENTITY)) for first in (Lss.SELECT, Lss.INQUIRE))
"""Commands that name a part of an identity."""
