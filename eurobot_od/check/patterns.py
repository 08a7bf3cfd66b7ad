"""What a suite sends and expects: messages, raw frames, heartbeats and emergencies.

A pattern knows the one identifier that its frames have, and says about such a frame in what it differs from what is
expected; no mismatch is a match.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from eurobot_od.check.values import Expected, Operand, Variables
from eurobot_od.device.nmt import STATE_NAMES, NmtState
from eurobot_od.frame import Frame
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.catalogue import flagged_fields
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.texts import amount

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

    protocol: Protocol
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

    protocol: Protocol
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


class HeartbeatPattern(NamedTuple):
    """A node's heartbeat with a state, None for any."""

    node: str
    cob_id: int
    state: NmtState | None

    def mismatches(self, frame: Frame, _: Variables) -> list[Mismatch]:
        """Return how a heartbeat differs."""
        if len(frame.data) != 1:
            return [Mismatch("length", "1 byte", amount(len(frame.data), "byte"))]
        # A state that CiA 301 does not have is the node's fault, and shown as its byte.
        came = STATE_NAMES.get(frame.data[0], f"0x{frame.data[0]:02X}")
        return [] if self.state is None or frame.data[0] == self.state else [Mismatch("state", self._state, came)]

    @property
    def _state(self) -> str:
        return ANY if self.state is None else STATE_NAMES[self.state]

    def text(self, _: Variables) -> str:
        """Write what is expected."""
        return f"{self}: {self._state}"

    def __str__(self) -> str:
        return f"heartbeat of {self.node}"


class EmergencyPattern(NamedTuple):
    """A node's EMCY with an error code, None for any (CiA 301, 7.2.7); `save` is the variable for its register."""

    node: str
    cob_id: int
    code: int | None
    save: str | None = None

    def mismatches(self, frame: Frame, _: Variables) -> list[Mismatch]:
        """Return how an EMCY differs."""
        if len(frame.data) != 8:
            return [Mismatch("length", "8 bytes", amount(len(frame.data), "byte"))]
        # The code is the first two bytes; the error register and the maker's five bytes are not compared.
        came = int.from_bytes(frame.data[:2], "little")
        return [] if self.code in (None, came) else [Mismatch("code", self._code, f"0x{came:04X}")]

    @property
    def _code(self) -> str:
        return ANY if self.code is None else f"0x{self.code:04X}"

    def text(self, _: Variables) -> str:
        """Write what is expected."""
        return f"{self}: {self._code}"

    def __str__(self) -> str:
        return f"EMCY of {self.node}"


Pattern: TypeAlias = "MessagePattern | FramePattern | HeartbeatPattern | EmergencyPattern"


def is_final(pattern: Pattern, frame: Frame) -> bool:
    """Whether a frame that differs ends the waiting.

    No heartbeat does, as the node may be on its way to the state, nor an EMCY that takes an earlier error back.
    """
    takes_back = isinstance(pattern, EmergencyPattern) and not any(frame.data[:2])
    return not (isinstance(pattern, HeartbeatPattern) or takes_back)
