"""Sends random SDO requests to nodes, valid, damaged and out of order, and judges every answer by CiA 301, 7.2.4.3.

The judge knows the standard and the EDS, and nothing of the server: the right answer to a request follows from the
requests and answers so far. A wrong answer is a `Fault`; an exception in the node ends the program.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable
from enum import Enum, auto
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from eurobot_od.device.device import Device
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.values import Address, Value
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import ROLES
from eurobot_od.sdo.wire import AbortCode

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

SILENCE = 5.0
"""Silence after which any server has ended a transfer, in s."""


class Fault(AssertionError):
    """An answer that the standard does not allow."""


class Phase(Enum):
    """The kind of transfer under way, and its state."""

    IDLE = auto()
    UPLOAD = auto()
    DOWNLOAD = auto()
    BLOCK_UPLOAD = auto()
    BLOCK_UPLOAD_SENT = auto()
    BLOCK_UPLOAD_ENDED = auto()
    BLOCK_DOWNLOAD = auto()
    BLOCK_DOWNLOAD_COMPLETE = auto()


class State(NamedTuple):
    """A phase, its object, the next toggle bit, and the number of segments sent or received in the block."""

    phase: Phase = Phase.IDLE
    address: Address = (0, 0)
    toggle: int = 0
    segments: int = 0


IDLE = State()


def demand(condition: bool, what: str) -> None:
    """Check a condition; raises Fault with the text."""
    if not condition:
        raise Fault(what)


def address_in(data: bytes) -> Address:
    """Return index and sub-index of an initiate or abort."""
    return data[1] | data[2] << 8, data[3]


def abort_in(answers: list[bytes]) -> AbortCode | None:
    """Return the abort code of a single abort, None for anything else."""
    if len(answers) != 1 or answers[0][0] != 0x80:
        return None
    return AbortCode(int.from_bytes(answers[0][4:], "little"))


class Judge:
    """Judges answers; `state` is the state of the transfer after them."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self.state = IDLE

    def exchange(self, request: bytes, answers: list[bytes]) -> None:
        """Judge the answers to a request; raises Fault."""
        demand(all(len(answer) == 8 for answer in answers), "an answer is not 8 bytes long")
        if len(request) != 8 or request[0] == 0x80:
            demand(not answers, "an answer to what needs none")
            self.state = IDLE if len(request) == 8 else self.state
            return
        self.state = self._continued(request, answers) or self._initiated(request, answers)

    def silence(self, answers: list[bytes]) -> None:
        """Judge what a server sends while its client is silent."""
        if self.state.phase is Phase.IDLE:
            demand(not answers, "an answer without a request")
        else:
            self._abort(answers, self.state.address, AbortCode.TIMEOUT)
        self.state = IDLE

    def _abort(self, answers: list[bytes], address: Address, *codes: AbortCode) -> State:
        code = abort_in(answers)
        demand(code in codes, f"{code!r} where {codes} is right")
        demand(address_in(answers[0]) == address, "an abort names another object")
        return IDLE

    # Within a transfer

    def _continued(self, request: bytes, answers: list[bytes]) -> State | None:
        """Judge a request that continues the transfer; None if it does not."""
        phase = self.state.phase
        command = request[0]
        if phase is Phase.BLOCK_DOWNLOAD:
            return self._block_segment(request, answers)
        step = self.STEPS.get((phase, command >> 5))
        wanted = {5: command & 3 != 0, 6: command & 3 == 1}.get(command >> 5, True)
        return step(self, request, answers) if step and wanted else None

    def _upload_segment(self, request: bytes, answers: list[bytes]) -> State:
        if request[0] & 0x10 != self.state.toggle:
            return self._abort(answers, self.state.address, AbortCode.TOGGLE_BIT)
        demand(len(answers) == 1 and answers[0][0] & 0xF0 == self.state.toggle, "not the segment asked for")
        return IDLE if answers[0][0] & 1 else self.state._replace(toggle=self.state.toggle ^ 0x10)

    def _download_segment(self, request: bytes, answers: list[bytes]) -> State:
        if request[0] & 0x10 != self.state.toggle:
            return self._abort(answers, self.state.address, AbortCode.TOGGLE_BIT)
        if abort_in(answers):
            return self._abort(answers, self.state.address, *REFUSALS)
        demand(len(answers) == 1 and answers[0][0] == 0x20 | self.state.toggle, "a segment not confirmed")
        return IDLE if request[0] & 1 else self.state._replace(toggle=self.state.toggle ^ 0x10)

    def _block_start(self, request: bytes, answers: list[bytes]) -> State:
        if request[0] & 3 != 3:
            return self._abort(answers, self.state.address, AbortCode.UNKNOWN_COMMAND)
        return self._block_sent(answers)

    def _block_sent(self, answers: list[bytes]) -> State:
        numbers = [answer[0] & 0x7F for answer in answers]
        demand(1 <= len(answers) <= 127 and numbers == list(range(1, len(answers) + 1)), "segments not in order")
        demand(all(answer[0] < 0x80 for answer in answers[:-1]), "a last segment in the middle")
        return self.state._replace(phase=Phase.BLOCK_UPLOAD_SENT, segments=len(answers))

    def _block_acknowledged(self, request: bytes, answers: list[bytes]) -> State:
        if request[0] & 3 != 2:
            return self._abort(answers, self.state.address, AbortCode.UNKNOWN_COMMAND)
        if not 1 <= request[2] <= 127:
            return self._abort(answers, self.state.address, AbortCode.BLOCK_SIZE)
        if request[1] > self.state.segments:
            return self._abort(answers, self.state.address, AbortCode.SEQUENCE_NUMBER)
        if len(answers) == 1 and answers[0][0] & 0xE3 == 0xC1:
            return self.state._replace(phase=Phase.BLOCK_UPLOAD_ENDED)
        return self._block_sent(answers)

    def _block_ended(self, request: bytes, answers: list[bytes]) -> State:
        if request[0] & 3 != 1:
            return self._abort(answers, self.state.address, AbortCode.UNKNOWN_COMMAND)
        demand(not answers, "an answer to the end of a block upload")
        return IDLE

    def _block_segment(self, request: bytes, answers: list[bytes]) -> State:
        number = request[0] & 0x7F
        last = bool(request[0] & 0x80)
        if number == 0:
            return self._abort(answers, self.state.address, AbortCode.SEQUENCE_NUMBER)
        in_order = number == self.state.segments + 1
        if in_order and abort_in(answers):
            return self._abort(answers, self.state.address, AbortCode.TOO_LONG)
        arrived = self.state.segments + in_order
        if not last and number != 127:
            demand(not answers, "an answer within a block")
            return self.state._replace(segments=arrived)
        demand(len(answers) == 1 and answers[0][:2] == bytes([0xA2, arrived]), "a block not acknowledged as it arrived")
        phase = Phase.BLOCK_DOWNLOAD_COMPLETE if last and in_order else Phase.BLOCK_DOWNLOAD
        return self.state._replace(phase=phase, segments=0)

    def _block_complete(self, _: bytes, answers: list[bytes]) -> State:
        if abort_in(answers):
            return self._abort(answers, self.state.address, AbortCode.CRC, *REFUSALS)
        demand(len(answers) == 1 and answers[0][0] == 0xA1, "a block download not confirmed")
        return IDLE

    STEPS: ClassVar[dict[tuple[Phase, int], Callable[[Judge, bytes, list[bytes]], State]]] = {
        (Phase.UPLOAD, 3): _upload_segment,
        (Phase.DOWNLOAD, 0): _download_segment,
        (Phase.BLOCK_UPLOAD, 5): _block_start,
        (Phase.BLOCK_UPLOAD_SENT, 5): _block_acknowledged,
        (Phase.BLOCK_UPLOAD_ENDED, 5): _block_ended,
        (Phase.BLOCK_DOWNLOAD_COMPLETE, 6): _block_complete,
    }

    # The first request of a transfer

    def _initiated(self, request: bytes, answers: list[bytes]) -> State:
        command = request[0]
        address = address_in(request)
        kind = INITIATE.get(command >> 5)
        if kind is None or command & kind.sub_command:
            return self._abort(answers, self.state.address, AbortCode.UNKNOWN_COMMAND)
        cause = self._cause(request, kind)
        if cause is not None:
            return self._abort(answers, address, cause)
        if abort_in(answers):
            return self._abort(answers, address, *kind.refusals)
        demand(len(answers) == 1 and answers[0][0] & kind.mask == kind.answer, "not the answer to an initiate")
        demand(address_in(answers[0]) == address_in(request), "an answer about another object")
        expedited = command if kind.writes else answers[0][0]
        over = kind.phase in (Phase.UPLOAD, Phase.DOWNLOAD) and expedited & 2
        return IDLE if over else State(kind.phase, address_in(request))

    def _cause(self, request: bytes, kind: Initiate) -> AbortCode | None:
        """Return the abort code that follows from the EDS alone, None if it allows the access."""
        address = address_in(request)
        variable = self._dictionary.variable(address)
        if variable is None:
            known = address[0] in self._dictionary.objects.indices
            return AbortCode.NO_SUBINDEX if known else AbortCode.NO_OBJECT
        if kind.writes:
            return _cause_not_to_write(variable, request, kind)
        return None if variable.readable else AbortCode.WRITE_ONLY


def _cause_not_to_write(variable: ODVariable, request: bytes, kind: Initiate) -> AbortCode | None:
    if not variable.writable:
        return AbortCode.READ_ONLY
    size = kind.size(request)
    if size is None or not variable.fixed_size:
        return None
    if size != len(variable) // 8:
        return AbortCode.TOO_LONG if size > len(variable) // 8 else AbortCode.TOO_SHORT
    if kind.phase is Phase.DOWNLOAD and request[0] & 2:
        return _cause_in_value(variable, data_type(variable).read(request[4 : 4 + size]))
    return None


def _cause_in_value(variable: ODVariable, value: Value) -> AbortCode | None:
    if not isinstance(value, (int, float)):
        return None
    if variable.max is not None and value > variable.max:
        return AbortCode.TOO_HIGH
    return AbortCode.TOO_LOW if variable.min is not None and value < variable.min else None


def _download_size(request: bytes) -> int | None:
    if not request[0] & 1:
        return None
    return 4 - (request[0] >> 2 & 3) if request[0] & 2 else int.from_bytes(request[4:], "little")


def _block_download_size(request: bytes) -> int | None:
    return int.from_bytes(request[4:], "little") if request[0] & 2 else None


REFUSALS = (
    AbortCode.OUT_OF_MEMORY,
    AbortCode.NO_OBJECT,
    AbortCode.NOT_MAPPABLE,
    AbortCode.MAPPING_TOO_LONG,
    AbortCode.INCOMPATIBLE,
    AbortCode.HARDWARE,
    AbortCode.TOO_LONG,
    AbortCode.TOO_SHORT,
    AbortCode.VALUE,
    AbortCode.TOO_HIGH,
    AbortCode.TOO_LOW,
    AbortCode.NOT_TRANSFERRED,
    AbortCode.STATE,
    AbortCode.NO_DATA,
)
"""Abort codes that depend on a value, or on the device's state."""


class Initiate(NamedTuple):
    """A first request, with its answer under a mask and the phase it leads to.

    `sub_command` are bits of the command byte that make it another request; `refusals` are the abort codes that only
    the server can decide.
    """

    phase: Phase
    mask: int
    answer: int
    writes: bool
    sub_command: int = 0
    size: Callable[[bytes], int | None] = _download_size
    refusals: tuple[AbortCode, ...] = REFUSALS


INITIATE = {
    1: Initiate(Phase.DOWNLOAD, 0xFF, 0x60, writes=True),
    2: Initiate(Phase.UPLOAD, 0xE0, 0x40, writes=False, refusals=(AbortCode.NO_DATA,)),
    5: Initiate(
        Phase.BLOCK_UPLOAD,
        0xFF,
        0xC6,
        writes=False,
        sub_command=3,
        refusals=(AbortCode.NO_DATA, AbortCode.BLOCK_SIZE),
    ),
    6: Initiate(Phase.BLOCK_DOWNLOAD, 0xFF, 0xA4, writes=True, sub_command=1, size=_block_download_size),
}

# Requests

LONG: list[Address] = [(0x1008, 0), (0x1009, 0), (0x1021, 0)]
"""Objects that do not fit an expedited transfer; they are asked for more often than the others."""


class RandomClient:
    """Makes up requests: mostly ones that fit the state, sometimes any."""

    def __init__(self, dictionary: Dictionary, chance: random.Random) -> None:
        self._random = chance
        self._addresses = [
            (variable.index, variable.subindex)
            for entry in dictionary.objects.values()
            for variable in getattr(entry, "subindices", {0: entry}).values()
        ] + 20 * LONG

    def request(self, state: State) -> bytes:
        """Return the next request."""
        whim = self._random.random()
        if whim < 0.03:
            return self._random.randbytes(self._random.choice((0, 1, 3, 7, 8, 8, 8)))
        if whim < 0.15 or state.phase is Phase.IDLE:
            return self._initiate()
        return self._fitting(state)

    def _initiate(self) -> bytes:
        index, subindex = self._address()
        make: Callable[[], tuple[int, bytes]] = self._random.choice(
            (self._upload, self._download, self._download, self._blocks)
        )
        command, rest = make()
        return bytes([command]) + index.to_bytes(2, "little") + bytes([subindex]) + rest

    def _address(self) -> Address:
        index, subindex = self._random.choice(self._addresses)
        unknown = ((index, self._random.randrange(256)), (self._random.randrange(1 << 16), 0))
        return self._random.choice(unknown) if self._random.random() < 0.1 else (index, subindex)

    def _upload(self) -> tuple[int, bytes]:
        return 0x40, bytes(4)

    def _download(self) -> tuple[int, bytes]:
        expedited = 0x23 | self._random.randrange(4) << 2
        size = self._random.choice((1, 2, 4, 8, 1000)).to_bytes(4, "little")
        value = self._random.randrange(1 << self._random.choice((1, 8, 16, 32))).to_bytes(4, "little")
        return self._random.choice(((expedited, value), (0x22, value), (0x21, size), (0x20, bytes(4))))

    def _blocks(self) -> tuple[int, bytes]:
        size = self._random.choice((1, 2, 4, 8)).to_bytes(4, "little")
        segments = self._random.choice((0, 1, 2, 127, 128))
        return self._random.choice(((0xA4, bytes([segments, 0, 0, 0])), (0xC6, size), (0xC4, bytes(4))))

    def _fitting(self, state: State) -> bytes:
        toggle = state.toggle ^ 0x10 * (self._random.random() < 0.05)
        last = self._random.random() < 0.5
        commands = {
            Phase.UPLOAD: 0x60 | toggle,
            Phase.DOWNLOAD: toggle | self._random.randrange(8) << 1 | last,
            Phase.BLOCK_UPLOAD: 0xA3,
            Phase.BLOCK_UPLOAD_SENT: 0xA2,
            Phase.BLOCK_UPLOAD_ENDED: 0xA1,
            Phase.BLOCK_DOWNLOAD: (state.segments + self._random.choice((1, 1, 1, 2)) & 0x7F) | last << 7,
            Phase.BLOCK_DOWNLOAD_COMPLETE: 0xC1 | self._random.randrange(8) << 2,
        }
        acknowledged = bytes([self._random.choice((state.segments, state.segments, 0, 1, 128)), 127])
        rest = acknowledged + bytes(5) if state.phase is Phase.BLOCK_UPLOAD_SENT else self._random.randbytes(7)
        return bytes([commands[state.phase]]) + rest


# A run

ANY_NODE_ID = 5


def run(dictionary: Dictionary, requests: int, seed: int) -> int:
    """Send a number of requests to a device; return how many it answered with an abort; raises Fault."""
    chance = random.Random(seed)
    device = Device(dictionary)
    judge = Judge(dictionary)
    client = RandomClient(dictionary, chance)
    rx, tx = device.sdo_service.requests, device.sdo_service.answers
    device.start(0.0)
    aborts = 0
    for number in range(requests):
        now = SILENCE * number
        request = client.request(judge.state)
        answers = [frame.data for frame in device.receive(Frame(rx, request), now).frames if frame.cob_id == tx]
        aborts += abort_in(answers) is not None
        judge.exchange(request, answers)
        if chance.random() < 0.02:
            judge.silence([frame.data for frame in device.tick(now + SILENCE).frames if frame.cob_id == tx])
    return aborts


def main() -> int:
    """Run the tool; exit status 1 at the first wrong answer."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--eds", metavar="FILE", help="any device, with node-ID 5 (default: all of our own)")
    parser.add_argument("--requests", type=int, default=10_000, help="how many (default 10000)")
    parser.add_argument("--seed", type=int, default=1, help="which ones (default 1)")
    arguments = parser.parse_args()
    dictionaries = [dialects.load(node, dialect) for dialect in dialects.names() for node in ROLES]
    if arguments.eds:
        dictionaries = [Dictionary.load(arguments.eds, ANY_NODE_ID)]
    for dictionary in dictionaries:
        started = time.perf_counter()
        try:
            aborts = run(dictionary, arguments.requests, arguments.seed)
        except Fault as fault:
            print(f"{dictionary.name}: wrong: {fault}")
            return 1
        took = time.perf_counter() - started
        print(f"{arguments.requests} requests to {dictionary.name}, {aborts} aborts, no wrong answer, {took:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
