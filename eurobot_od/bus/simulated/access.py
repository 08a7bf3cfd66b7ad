"""What a controller does in each bit of an attempt to send a frame (ISO 11898-1, medium access control).

Each controller is a generator: it gives the level that it sends, and gets the level that it sees. So the file reads as
the standard does, one field after the other. Errors need no cases of their own: who sees something wrong sends an
error flag; the others see the flag, and what follows from that follows.

Rule of this file: bits and no time. Whatever is counted or has come is noted in `noted`, for the bus to date it.
"""

from __future__ import annotations

from collections.abc import Generator
from enum import Enum, auto
from typing import NamedTuple, TypeAlias

from eurobot_od.bus.simulated.bits import DOMINANT, END_OF_FRAME, INTERMISSION, RECESSIVE, BitReading, on_wire
from eurobot_od.bus.simulated.confinement import RECOVERY_BITS, Counters, CountingRule, ErrorState
from eurobot_od.bus.simulated.controller import Controller
from eurobot_od.frame import Frame

FLAG = 6
"""Bits of an error flag or overload flag."""

DELIMITER = 8
"""Recessive bits after such flags."""

STUCK = 8
"""How many dominant bits behind a flag are an error of their own; up to seven are the flags of others."""


class BusCondition(Enum):
    """Why a controller sends a flag."""

    ERROR = auto()
    ARBITRATION_STUFFING = auto()
    NOT_ACKNOWLEDGED = auto()
    FLAG_ERROR = auto()
    OVERLOAD = auto()


TRANSMITTER_COUNTS: dict[BusCondition, CountingRule | None] = {
    BusCondition.ERROR: CountingRule.TRANSMITTER_ERROR,
    BusCondition.ARBITRATION_STUFFING: None,  # rule c, exception 2: it may well be the other one who is wrong
    BusCondition.NOT_ACKNOWLEDGED: CountingRule.TRANSMITTER_ERROR,
    BusCondition.FLAG_ERROR: CountingRule.TRANSMITTER_FLAG_ERROR,
    BusCondition.OVERLOAD: None,  # it only asks for time: nothing was wrong with a frame
}
RECEIVER_COUNTS: dict[BusCondition, CountingRule | None] = {
    BusCondition.ERROR: CountingRule.RECEIVER_ERROR,
    BusCondition.FLAG_ERROR: CountingRule.RECEIVER_FLAG_ERROR,
    BusCondition.OVERLOAD: None,
}

Levels: TypeAlias = Generator[int, int, None]
"""Gives the level of each bit that is sent, gets the level that is seen."""

Field: TypeAlias = Generator[int, int, "BusCondition | None"]
"""The same for a part of a frame; returns what went wrong in it."""


class Through(NamedTuple):
    """A frame that is through: it has been `sent`, or it has come."""

    frame: Frame
    sent: bool


Note: TypeAlias = "Through | CountingRule"
"""What a controller notes."""


class MediumAccess:
    """A controller during one attempt: `level` is what it sends now, `idle` tells whether it waits for a frame.

    `sequences` counts what it has to see to come back when it is bus-off.
    """

    def __init__(self, controller: Controller, counters: Counters, frame: Frame | None) -> None:
        self.controller, self.counters = controller, counters
        self.transmitting = False
        self.noted: list[Note] = []
        self._levels: Levels
        self.level, self.idle = RECESSIVE, True
        self.sequences = self._recessive = 0
        if frame is not None:
            self._begin(self._transmit(frame))

    @property
    def off(self) -> bool:
        """Tell whether it has gone bus-off."""
        return self.counters.state is ErrorState.OFF

    @property
    def suspends(self) -> bool:
        """Tell whether it has to let the others go first now: it has sent, and is error passive."""
        return self.transmitting and self.counters.state is ErrorState.PASSIVE

    def see(self, level: int) -> None:
        """Take in the level of the bit that it has sent its own `level` in, and go on to the next bit."""
        if self.off:
            self.level, self.idle = RECESSIVE, True
            # A dominant bit starts the sequence over, so frames of the others delay the return.
            self._recessive = self._recessive + 1 if level == RECESSIVE else 0
            if self._recessive == RECOVERY_BITS:
                self.sequences, self._recessive = self.sequences + 1, 0
        elif not self.idle:
            try:
                self.level = self._levels.send(level)
            except StopIteration:
                self.level, self.idle = RECESSIVE, True
        elif level == DOMINANT:
            self._begin(self._receive((level,)))

    def _begin(self, field: Field) -> None:
        self.idle, self._levels = False, self._attempt(field)
        # The first level is sent before anything is seen; each later one answers a bit that was.
        self.level = next(self._levels)

    def _note(self, note: Note | None) -> None:
        if isinstance(note, CountingRule):
            self.counters = self.counters.after(note)
        if note is not None:
            self.noted.append(note)

    # From the start of frame to the end of the intermission

    def _attempt(self, field: Field) -> Levels:
        while True:
            fault = yield from field
            if fault is None:
                fault = yield from self._intermission()
            if fault is None:
                return
            field = self._signal(fault)

    def _intermission(self) -> Field:
        """Wait until the bus is free."""
        for _ in range(INTERMISSION - 1):
            # Nobody may send yet: a dominant bit here asks for more time, and destroys no frame.
            if (yield RECESSIVE) == DOMINANT:
                return BusCondition.OVERLOAD
        if (yield RECESSIVE) == RECESSIVE:
            return None
        # A dominant third bit is a start of frame: the sender's clock may run a little fast, and has seen three bits.
        fault = yield from self._receive((DOMINANT,))
        return fault if fault is not None else (yield from self._intermission())

    # A frame

    def _transmit(self, frame: Frame) -> Field:
        self.transmitting, wire = True, on_wire(frame)
        for place, bit in enumerate(wire.bits):
            seen = yield bit
            if seen == bit:
                continue
            # Nobody can make a dominant bit recessive, and after the arbitration nobody else sends.
            if seen == RECESSIVE or place >= wire.arbitration:
                return BusCondition.ERROR
            if place in wire.stuffed:  # an error that a transmitter does not count (rule c, exception 2)
                return BusCondition.ARBITRATION_STUFFING
            # The arbitration is lost: it goes on as a receiver of what it has sent so far, and of this bit.
            return (yield from self._receive((*wire.bits[:place], seen)))
        if (yield RECESSIVE) == DOMINANT:  # the CRC delimiter
            return BusCondition.ERROR
        if (yield RECESSIVE) == RECESSIVE:  # the acknowledge slot: every receiver overwrites it
            return BusCondition.NOT_ACKNOWLEDGED
        for _ in range(1 + END_OF_FRAME):  # after the acknowledge delimiter
            if (yield RECESSIVE) == DOMINANT:
                return BusCondition.ERROR
        # A sender's frame is through with the last bit of its end, a receiver's one bit before: an error just there has
        # one side take the frame and the other repeat it, which is how a frame comes twice.
        self._note(CountingRule.TRANSMITTED)
        self._note(Through(frame, sent=True))
        return None

    def _receive(self, seen: tuple[int, ...]) -> Field:
        """Receive a frame from the bits on that were `seen`; it is valid before the last bit of its end."""
        # From here on its counters follow the receiver's rules, even if it came here by losing an arbitration.
        self.transmitting, reading = False, BitReading()
        for bit in seen:  # a start of frame, or what was sent until the arbitration was lost: stuffed as it should be
            reading.take(bit)
        while not reading.complete:
            if not reading.take((yield RECESSIVE)):
                return BusCondition.ERROR
        # Looked at once, before the delimiter: what is read after it is not a part of what the CRC protects.
        intact = reading.intact
        if (yield RECESSIVE) == DOMINANT:  # the CRC delimiter
            return BusCondition.ERROR
        # A receiver with a wrong CRC does not acknowledge, and waits: its flag begins after the acknowledge delimiter.
        if (yield DOMINANT if intact else RECESSIVE) == RECESSIVE and intact:
            return BusCondition.ERROR
        if (yield RECESSIVE) == DOMINANT or not intact:  # the acknowledge delimiter; a wrong CRC is signalled after it
            return BusCondition.ERROR
        # Counted with the acknowledgement; the end of frame can still go wrong.
        self._note(CountingRule.RECEIVED)
        for _ in range(END_OF_FRAME - 1):
            if (yield RECESSIVE) == DOMINANT:
                return BusCondition.ERROR
        # The frame is valid for receivers before its last bit: a dominant one there is an overload, not an error.
        last = yield RECESSIVE
        if reading.frame is not None:
            self._note(Through(reading.frame, sent=False))
        return BusCondition.OVERLOAD if last == DOMINANT else None

    # What is sent when something is wrong

    def _signal(self, fault: BusCondition) -> Field:
        """Send a flag and its delimiter, and count why."""
        # Looked up before it is counted: the error that makes a node passive is still told by an active flag.
        passive = fault is not BusCondition.OVERLOAD and self.counters.state is ErrorState.PASSIVE
        # Rule c, exception 1: a passive transmitter that is alone does not count on.
        if not (passive and fault is BusCondition.NOT_ACKNOWLEDGED):
            self._note((TRANSMITTER_COUNTS if self.transmitting else RECEIVER_COUNTS)[fault])
        if passive:
            yield from self._passive_flag(fault)
        else:
            # An overload flag looks the same as an active error flag; the two differ only in what is counted.
            for _ in range(FLAG):
                if (yield DOMINANT) == RECESSIVE:
                    return BusCondition.FLAG_ERROR
        return (yield from self._delimiter(fault))

    def _passive_flag(self, fault: BusCondition) -> Field:
        # Its own recessive bits disturb nobody, so it cannot force a flag: it waits for six equal bits on the bus.
        seen: list[int] = []
        while len(seen) < FLAG or len(set(seen[-FLAG:])) > 1:
            seen.append((yield RECESSIVE))
        # Rule c, exception 1, second half: a dominant bit in the flag shows that somebody is there after all.
        if fault is BusCondition.NOT_ACKNOWLEDGED and DOMINANT in seen:
            self._note(CountingRule.TRANSMITTER_ERROR)
        return None

    def _delimiter(self, fault: BusCondition) -> Field:
        """Wait until the flags of all others are over, then for the rest of the delimiter."""
        dominant = 0
        while (yield RECESSIVE) == DOMINANT:
            dominant += 1
            # The first one to see the error finds the others' flags behind its own: it is the likely culprit (rule b).
            if dominant == 1 and not self.transmitting and fault is not BusCondition.OVERLOAD:
                self._note(CountingRule.RECEIVER_DOMINANT_AFTER_FLAG)
            if dominant % STUCK == 0:  # rule f: after each further eight dominant bits
                self._note(CountingRule.TRANSMITTER_STUCK if self.transmitting else CountingRule.RECEIVER_STUCK)
        for place in reversed(range(DELIMITER - 1)):
            if (yield RECESSIVE) == DOMINANT:
                return BusCondition.ERROR if place else BusCondition.OVERLOAD
        return None
