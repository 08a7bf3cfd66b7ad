"""A suite as values: the steps, what they send and what they expect; times in s."""

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

# A pattern has the one COB-ID of its frames, and lists the differences between such a frame and the expected one.


ANY = "any"
"""Any state in a heartbeat, any code in an EMCY."""


class Mismatch(NamedTuple):
    """One difference between a frame and the expected one."""

    what: str
    expected: str
    came: str

    @property
    def words(self) -> str:
        """The difference as text."""
        return f"expected {self.expected}, came {self.came}"


# Sent


class SentMessage(NamedTuple):
    """A message to send; its fields may be variables."""

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
    """A raw frame to send."""

    raw: Frame

    def frame(self, _: Variables) -> Frame:
        """Return the frame."""
        return self.raw

    def __str__(self) -> str:
        return str(self.raw)


Sent: TypeAlias = "SentMessage | SentFrame"


# Expected


class MessagePattern(NamedTuple):
    """A message with expected `fields`; the other fields may have any value in their range."""

    protocol: Messages
    binding: Binding
    fields: Mapping[str, Expected]

    @property
    def cob_id(self) -> int:
        """COB-ID of the frames that may match."""
        return self.binding.cob_id

    def mismatches(self, frame: Frame, variables: Variables) -> list[Mismatch]:
        """Return how a frame with this COB-ID differs; raises NotSaved."""
        lengths, kinds = self.binding.lengths, self.binding.kinds
        # A frame whose length the mapping does not allow cannot be decoded.
        if len(frame.data) not in lengths:
            return [Mismatch("length", f"{' or '.join(map(str, lengths))} bytes", amount(len(frame.data), "byte"))]
        message = self.protocol.decode(*frame)
        came = message._asdict()
        differing = [
            Mismatch(field, expected.text(variables), kinds[field].text(came[field]))
            for field, expected in self.fields.items()
            if not expected.fits(came[field], variables)
        ]
        # A field that the step does not name must still be in its range, or a node that sends garbage is green.
        unnamed = [field for field in flagged_fields(message) if field not in self.fields]
        allowed = {field: kinds[field].allowed(self.binding.limits[field]) for field in unnamed}
        return differing + [Mismatch(field, what, kinds[field].text(came[field])) for field, what in allowed.items()]

    def text(self, variables: Variables) -> str:
        """Return the expectation as text, variables with their values."""
        fields = ", ".join(f"{field} {expected.text(variables)}" for field, expected in self.fields.items())
        return f"{self.binding.name}: {fields}" if fields else self.binding.name

    def __str__(self) -> str:
        return self.binding.name


class FramePattern(NamedTuple):
    """A frame with these hexadecimal digits as data; `?` is any digit, `[23]` one of several."""

    cob_id: int
    digits: str

    def mismatches(self, frame: Frame, _: Variables) -> list[Mismatch]:
        """Return how a frame with this COB-ID differs."""
        came = frame.data.hex().upper()
        if re.fullmatch(self.digits.replace("?", "."), came):
            return []
        return [Mismatch("data", self.digits or "none", came or "none")]

    def text(self, _: Variables) -> str:
        """Return the expectation as text."""
        return str(self)

    def __str__(self) -> str:
        return f"{self.cob_id:03X}#{self.digits}"


class Service(NamedTuple):
    """Heartbeat or EMCY: the length of its frames, and the first `compared` bytes with their name and their `words`."""

    name: str
    length: int
    what: str
    compared: int
    words: Callable[[int], str]


# A state that CiA 301 does not define is shown as its byte.
HEARTBEAT = Service("heartbeat", 1, "state", 1, lambda state: STATE_NAMES.get(state, f"0x{state:02X}"))

# The error register and the maker's five bytes are not compared (CiA 301, 7.2.7).
EMCY = Service("EMCY", 8, "code", 2, lambda code: f"0x{code:04X}")


class ServicePattern(NamedTuple):
    """A node's heartbeat with a state, or EMCY with a code; None is any, `save` a variable for the error register."""

    service: Service
    node: str
    cob_id: int
    wanted: int | None
    save: str | None = None

    def mismatches(self, frame: Frame, _: Variables) -> list[Mismatch]:
        """Return how a frame with this COB-ID differs."""
        service = self.service
        if len(frame.data) != service.length:
            return [Mismatch("length", amount(service.length, "byte"), amount(len(frame.data), "byte"))]
        came = int.from_bytes(frame.data[: service.compared], "little")
        return [] if self.wanted in (None, came) else [Mismatch(service.what, self._wanted, service.words(came))]

    @property
    def _wanted(self) -> str:
        return ANY if self.wanted is None else self.service.words(self.wanted)

    def text(self, _: Variables) -> str:
        """Return the expectation as text."""
        return f"{self}: {self._wanted}"

    def __str__(self) -> str:
        return f"{self.service.name} of {self.node}"


Pattern: TypeAlias = "MessagePattern | FramePattern | ServicePattern"


def is_final(pattern: Pattern, frame: Frame) -> bool:
    """Return whether a frame that differs ends the waiting.

    A heartbeat does not, as the node may be on its way to the state; an EMCY that resets an earlier error does not,
    either.
    """
    return not isinstance(pattern, ServicePattern) or (pattern.service is EMCY and any(frame.data[:2]))


TIMEOUT = 1.0
"""Maximum time for an answer where the suite names none, in s."""


class Order(Enum):
    """The order of several expected frames."""

    IN_ORDER = "in this order"
    ALL = "all, in any order"
    ANY = "any of them"


class Patterns(NamedTuple):
    """Frames that one step expects."""

    order: Order
    patterns: tuple[Pattern, ...]

    def __str__(self) -> str:
        return ", ".join(map(str, self.patterns))


class NodeServices(NamedTuple):
    """A node's name, node-ID and the COB-IDs of its SDO server."""

    name: str
    node_id: int
    sdo_request: int
    sdo_answer: int

    @classmethod
    def of(cls, device: Dictionary) -> NodeServices:
        """Return the services of a device."""
        return cls(device.name, device.node_id, *SdoChannel.of(device))


class Reported(Enum):
    """Findings that are reported once per node or COB-ID."""

    NO_BOOT_UP = "it sends no boot-up"
    OWN_ERROR = "it reports an error of its own"
    HEARD = "another node sends what none should"


Report: TypeAlias = "tuple[Reported, NodeServices | int]"
"""A finding, and its node or COB-ID."""


class AbortCodes(NamedTuple):
    """Abort codes of which one is expected; without codes any abort is."""

    codes: tuple[int, ...]

    def fits(self, code: int) -> bool:
        """Return whether a code is expected."""
        return not self.codes or code in self.codes

    def __str__(self) -> str:
        return "abort " + (" or ".join(map(code_and_reason, self.codes)) or "with any code")


class Blocks(Enum):
    """Whether the step uses SDO block transfer."""

    NONE = "by segments"
    PLAIN = "block"
    WITHOUT_CRC = "block without CRC"


class FieldOf(NamedTuple):
    """A field of the last message of a type."""

    binding: Binding
    field: str


class Group(NamedTuple):
    """Steps that belong together: after a skipped step, or a red one that they need, the rest are skipped.

    `undo` steps are always done.
    """

    steps: tuple[Step, ...]

    def __str__(self) -> str:
        return amount(len(self.steps), "step")


class StepAction(Protocol):
    """What a step does. Its text is the name of a step without a name."""

    async def run(self, tester: Any, /) -> None:
        """Run it; raises Failed, LocalError or RemoteError if it is red, Skipped, BusError."""


Action: TypeAlias = "StepAction | Group"


class Step(NamedTuple):
    """One step: its name and place, its action, how often it is done, and whether the suite ends if it fails.

    If `needed` is None, that depends on the part of the suite. An `undo` step puts back what its group has changed, and
    is always done. A step `above` a level is skipped at that level.
    """

    name: str
    place: Place
    action: Action
    repeat: int = 1
    needed: bool | None = None
    undo: bool = False
    above: str = ""

    @property
    def total(self) -> int:
        """Number of actions, with all repetitions of the steps inside."""
        inside = sum(each.total for each in self.action.steps) if isinstance(self.action, Group) else 1
        return self.repeat * inside


class Suite(NamedTuple):
    """One YAML document.

    `nodes` are under test. `dialect` is that of the EDS files it is for (None: any). `timeout` is in s. `dictionaries`
    are the EDS files by node, `decoder` decodes frames by them. `world`: whether the nodes have to be in one simulated
    world.
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
