"""A suite as values: what is to be done and seen, step by step; times in seconds."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeAlias

from eurobot_od.check.values import Expected, Operand, Variables
from eurobot_od.device.nmt import STATE_NAMES
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import flagged_fields
from eurobot_od.pdo.protocol import Protocol as Messages
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.support.texts import amount
from eurobot_od.support.yaml_places import Place
from eurobot_od.traffic.meaning import Decoder

# What a suite sends and expects: messages, raw frames, heartbeats and emergencies.
#
# A pattern knows the one identifier that its frames have, and says about such a frame in what it differs from what is
# expected; no mismatch is a match.


ANY = "any"
"""Any state in a heartbeat, any code in an EMCY."""


class Mismatch(NamedTuple):
    """One thing in which a frame is not as expected."""

    what: str
    expected: str
    came: str

    @property
    def words(self) -> str:
        """Say what was expected, and what came."""
        return f"expected {self.expected}, came {self.came}"


# Sent


class SentMessage(NamedTuple):
    """A message to be sent; fields may be variables."""

    protocol: Messages
    binding: Binding
    fields: Mapping[str, Operand]

    def frame(self, variables: Variables) -> Frame:
        """Return the frame; raises FieldError, NotSaved."""
        values = {field: operand.resolve(variables) for field, operand in self.fields.items()}
        return self.protocol.encode(self.binding.message(**values))

    def __str__(self) -> str:
        return self.binding.name


class SentFrame(NamedTuple):
    """A frame to be sent as it is."""

    raw: Frame

    def frame(self, _: Variables) -> Frame:
        """Return the frame."""
        return self.raw

    def __str__(self) -> str:
        return str(self.raw)


Sent: TypeAlias = "SentMessage | SentFrame"


# Expected


class MessagePattern(NamedTuple):
    """A message whose `fields` are as expected; the others may be anything in their range."""

    protocol: Messages
    binding: Binding
    fields: Mapping[str, Expected]

    @property
    def cob_id(self) -> int:
        """Identifier of the frames that may match."""
        return self.binding.cob_id

    def mismatches(self, frame: Frame, variables: Variables) -> list[Mismatch]:
        """Return how a frame of this identifier differs; raises NotSaved."""
        lengths, kinds = self.binding.lengths, self.binding.kinds
        # First, as a frame of another length than the mapping allows cannot be decoded field by field.
        if len(frame.data) not in lengths:
            return [Mismatch("length", f"{' or '.join(map(str, lengths))} bytes", amount(len(frame.data), "byte"))]
        message = self.protocol.decode(*frame)
        came = message._asdict()
        differing = [
            Mismatch(field, expected.text(variables), kinds[field].text(came[field]))
            for field, expected in self.fields.items()
            if not expected.fits(came[field], variables)
        ]
        # A field that the step does not name must be in its range all the same, or a node that sends rubbish is green.
        unnamed = [field for field in flagged_fields(message) if field not in self.fields]
        allowed = {field: kinds[field].allowed(self.binding.limits[field]) for field in unnamed}
        return differing + [Mismatch(field, what, kinds[field].text(came[field])) for field, what in allowed.items()]

    def text(self, variables: Variables) -> str:
        """Write what is expected, variables with their values."""
        fields = ", ".join(f"{field} {expected.text(variables)}" for field, expected in self.fields.items())
        return f"{self.binding.name}: {fields}" if fields else self.binding.name

    def __str__(self) -> str:
        return self.binding.name


class FramePattern(NamedTuple):
    """A frame with these hexadecimal digits as its data, `?` for any digit, `[23]` for one of several."""

    cob_id: int
    digits: str

    def mismatches(self, frame: Frame, _: Variables) -> list[Mismatch]:
        """Return how a frame of this identifier differs."""
        came = frame.data.hex().upper()
        if re.fullmatch(self.digits.replace("?", "."), came):
            return []
        return [Mismatch("data", self.digits or "none", came or "none")]

    def text(self, _: Variables) -> str:
        """Write what is expected."""
        return str(self)

    def __str__(self) -> str:
        return f"{self.cob_id:03X}#{self.digits}"


class Service(NamedTuple):
    """What a node says of itself: the length of its frames, `what` their first `compared` bytes are, and in `words`."""

    name: str
    length: int
    what: str
    compared: int
    words: Callable[[int], str]


# A state that CiA 301 does not have is the node's fault, and shown as its byte.
HEARTBEAT = Service("heartbeat", 1, "state", 1, lambda state: STATE_NAMES.get(state, f"0x{state:02X}"))

# The error register and the maker's five bytes are not compared (CiA 301, 7.2.7).
EMCY = Service("EMCY", 8, "code", 2, lambda code: f"0x{code:04X}")


class ServicePattern(NamedTuple):
    """A node's heartbeat with a state, or EMCY with an error code, None for any; `save`: variable for the register."""

    service: Service
    node: str
    cob_id: int
    wanted: int | None
    save: str | None = None

    def mismatches(self, frame: Frame, _: Variables) -> list[Mismatch]:
        """Return how a frame of this identifier differs."""
        service = self.service
        if len(frame.data) != service.length:
            return [Mismatch("length", amount(service.length, "byte"), amount(len(frame.data), "byte"))]
        came = int.from_bytes(frame.data[: service.compared], "little")
        return [] if self.wanted in (None, came) else [Mismatch(service.what, self._wanted, service.words(came))]

    @property
    def _wanted(self) -> str:
        return ANY if self.wanted is None else self.service.words(self.wanted)

    def text(self, _: Variables) -> str:
        """Write what is expected."""
        return f"{self}: {self._wanted}"

    def __str__(self) -> str:
        return f"{self.service.name} of {self.node}"


Pattern: TypeAlias = "MessagePattern | FramePattern | ServicePattern"


def is_final(pattern: Pattern, frame: Frame) -> bool:
    """Return whether a frame that differs ends the waiting.

    No heartbeat does, as the node may be on its way to the state, nor an EMCY that takes an earlier error back.
    """
    return not isinstance(pattern, ServicePattern) or (pattern.service is EMCY and any(frame.data[:2]))


TIMEOUT = 1.0
"""Seconds that an answer may take where the suite does not say."""


class Order(Enum):
    """How several expected frames belong together."""

    IN_ORDER = "in this order"
    ALL = "all, in any order"
    ANY = "any of them"


class Patterns(NamedTuple):
    """Frames to be expected together."""

    order: Order
    patterns: tuple[Pattern, ...]

    def __str__(self) -> str:
        return ", ".join(map(str, self.patterns))


class NodeServices(NamedTuple):
    """Where a node's CANopen services are: its name, node-ID, and the COB-IDs of its SDO server."""

    name: str
    node_id: int
    sdo_request: int
    sdo_answer: int

    @classmethod
    def of(cls, device: Dictionary) -> NodeServices:
        """Return where the services of a device are."""
        return cls(device.name, device.node_id, *SdoChannel.of(device))


class Reported(Enum):
    """What is red once for a node, however many steps find it."""

    NO_BOOT_UP = "it sends no boot-up"
    OWN_ERROR = "it reports an error of its own"
    HEARD = "somebody else sends what nobody should"


Report: TypeAlias = "tuple[Reported, NodeServices | int]"
"""What was found, and about which node or COB-ID."""


class AbortCodes(NamedTuple):
    """Abort codes, one of which has to come; none of them stands for any code."""

    codes: tuple[int, ...]

    def fits(self, code: int) -> bool:
        """Return whether a code is one of them."""
        return not self.codes or code in self.codes

    def __str__(self) -> str:
        return "abort " + (" or ".join(map(code_and_reason, self.codes)) or "with any code")


class Blocks(Enum):
    """How an object is transferred in blocks."""

    NONE = "by segments"
    PLAIN = "block"
    WITHOUT_CRC = "block without CRC"


class FieldOf(NamedTuple):
    """A field of the last message of a type."""

    binding: Binding
    field: str


class Group(NamedTuple):
    """Steps that belong together: where one is skipped, or red and needed by what follows, those after it are skipped.

    Its steps that `undo` are done all the same.
    """

    steps: tuple[Step, ...]

    def __str__(self) -> str:
        return amount(len(self.steps), "step")


class StepAction(Protocol):
    """What a step does: a value that knows what was read, and does it. Its text names a step that has no name."""

    async def run(self, tester: Any, /) -> None:
        """Do it with the BenchTester; raises Failed, LocalError or RemoteError if it is red, Skipped, BusError."""


Action: TypeAlias = "StepAction | Group"


class Step(NamedTuple):
    """One step: its name, where it stands, what is done, how many times, and whether the suite ends if it fails.

    `needed` is None where that depends on the part of the suite. A step that is to `undo` what its group has changed is
    done whatever becomes of the others.
    """

    name: str
    place: Place
    action: Action
    repeat: int = 1
    needed: bool | None = None
    undo: bool = False

    @property
    def total(self) -> int:
        """How often something is done, with all repetitions inside it."""
        inside = sum(each.total for each in self.action.steps) if isinstance(self.action, Group) else 1
        return self.repeat * inside


class Suite(NamedTuple):
    """One document: `nodes` are under test, `dialect` is that of the EDS files it is for (None: any).

    `timeout` is in seconds; `dictionaries` are the EDS files that it was checked against, by node, and `decoder` tells
    what frames mean by them. `world` tells that the nodes have to be in one world.
    """

    file: Path
    place: Place
    dictionaries: Mapping[str, Dictionary]
    decoder: Decoder
    nodes: tuple[str, ...]
    name: str
    steps: tuple[Step, ...]
    dialect: str | None = None
    timeout: float = TIMEOUT
    world: bool = False
    tags: tuple[str, ...] = ()
    setup: tuple[Step, ...] = ()
    teardown: tuple[Step, ...] = ()
