"""A frame as bits on the wire, stuff bits included (ISO 11898-1, classic frames), and base frames read back from them.

Rule of this file: exact, not estimated: the bits are written out, protected by the CRC and stuffed. A bit is a level:
0 is dominant, 1 recessive.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, Frame

DOMINANT, RECESSIVE = 0, 1

# x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1, its highest power left out (ISO 11898-1).
CRC_POLYNOMIAL = 0x4599
CRC_BITS = 15
STUFF_AFTER = 5
ACKNOWLEDGE_BITS = 1 + 2
"""CRC delimiter, acknowledge slot and delimiter; neither they nor what follows is stuffed."""

END_OF_FRAME = 7
INTERMISSION = 3

ARBITRATION_BITS = 1 + 11 + 1
"""Start of frame, identifier and RTR of a base frame: here a recessive bit may be overwritten without an error."""

RUN = {run: (min(run, 0) - 1, max(run, 0) + 1) for run in range(-STUFF_AFTER, STUFF_AFTER + 1)}
"""How long a run of equal bits is after a dominant and after a recessive bit: zeros count down, ones up."""

KNOWN = 1 << 11
"""How many frames are kept as bits, a kilobyte each: a bus repeats itself, at least within a few seconds."""


class Wire(NamedTuple):
    """The stuffed bits of a frame, from its start to the end of its CRC.

    `stuffed` are the places of the stuff bits, `arbitration` the place where the arbitration is over, and `end` the
    number of bits from the start of frame to the end of frame.
    """

    bits: tuple[int, ...]
    stuffed: frozenset[int]
    arbitration: int
    end: int


@lru_cache(maxsize=KNOWN)
def on_wire(frame: Frame) -> Wire:
    """Write out the bits of a frame."""
    head = _identifier_bits(frame) + f"{len(frame.data):04b}"
    if not frame.is_remote:  # a remote frame has the length of the answer, and no data
        head += "".join(f"{byte:08b}" for byte in frame.data)
    bits: list[int] = []
    stuffed: list[int] = []
    run = arbitration = 0
    for number, bit in enumerate(map(int, f"{head}{crc(head):0{CRC_BITS}b}"), 1):
        bits.append(bit)
        run = RUN[run][bit]
        # The stuff bit is the first of the next run; and the last bits of the CRC are stuffed like all others.
        if abs(run) == STUFF_AFTER:
            # Five equal bits without an edge are as long as two clocks may run apart: the receivers resynchronise on
            # edges.
            stuffed.append(len(bits))
            bits.append(1 - bit)
            run = RUN[run][1 - bit]
        if number == ARBITRATION_BITS:
            arbitration = len(bits)
    return Wire(tuple(bits), frozenset(stuffed), arbitration, len(bits) + ACKNOWLEDGE_BITS + END_OF_FRAME)


def _identifier_bits(frame: Frame) -> str:
    """Return the bits from the start of frame to the length."""
    remote = int(frame.is_remote)
    if not frame.cob_id & EXTENDED:  # after the identifier RTR, IDE 0 for 11 bits, and a reserved bit
        return f"0{frame.cob_id:011b}{remote}00"
    bits = f"{frame.cob_id & HIGHEST_EXTENDED:029b}"  # between its parts SRR and IDE, both 1; two reserved bits behind
    return f"0{bits[:11]}11{bits[11:]}{remote}00"


def frame_bits(frame: Frame) -> int:
    """Return the number of bit times from the start of frame to the end of the intermission behind it."""
    return on_wire(frame).end + INTERMISSION


def crc(bits: str) -> int:
    """Return the CRC over bits. Byte by byte: zeros in front change nothing, as it begins with zero."""
    register = 0
    for byte in int(bits, 2).to_bytes((len(bits) + 7) // 8, "big"):
        register = (register << 8 ^ CRC_OF_BYTE[register >> (CRC_BITS - 8) ^ byte]) & (1 << CRC_BITS) - 1
    return register


def _crc_of_byte(byte: int) -> int:
    register = byte << (CRC_BITS - 8)
    for _ in range(8):
        register = register << 1 ^ CRC_POLYNOMIAL * (register >> (CRC_BITS - 1) & 1)
    return register & (1 << CRC_BITS) - 1


CRC_OF_BYTE = [_crc_of_byte(byte) for byte in range(256)]


class BitReading:
    """What a receiver makes of the bits it sees, from the start of frame to the end of the CRC.

    A bit error may have made it a remote frame, or one with 29 bits: such a frame is read to its end, too.
    """

    def __init__(self) -> None:
        self._run = 0
        self._bits = ""

    def take(self, bit: int) -> bool:
        """Take in a bit; False if it breaks the rule of bit stuffing."""
        stuff_bit = abs(self._run) == STUFF_AFTER
        # RUN ends at five: after a sixth equal bit the frame is broken anyway.
        self._run = RUN[self._run][bit] if abs(RUN[self._run][bit]) <= STUFF_AFTER else 0
        if not stuff_bit:
            self._bits += str(bit)
        return not stuff_bit or abs(self._run) == 1

    @property
    def complete(self) -> bool:
        """Tell whether the CRC is there, and the stuff bit that may follow it."""
        # Nobody sends extended frames here, but a bit error in IDE makes one: its RTR and length code stand elsewhere.
        head, remote = (39, 32) if self._extended else (19, 12)
        if len(self._bits) < head:
            return False
        # A data length code above 8 still means 8 bytes; a remote frame has a length and no data.
        octets = 0 if self._is_recessive(remote) else min(int(self._bits[head - 4 : head], 2), 8)
        return len(self._bits) == head + 8 * octets + CRC_BITS and abs(self._run) < STUFF_AFTER

    @property
    def intact(self) -> bool:
        """Tell whether the CRC is right."""
        return crc(self._bits[:-CRC_BITS]) == int(self._bits[-CRC_BITS:], 2)

    @property
    def frame(self) -> Frame | None:
        """Return the frame that was read, None for a remote one or one with 29 bits."""
        # Neither is delivered: nobody sends such a frame here, so it is made of bit errors that the CRC has let pass.
        if self._extended or self._is_recessive(12):
            return None
        data = self._bits[19:-CRC_BITS]
        return Frame(int(self._bits[1:12], 2), bytes(int(data[at : at + 8], 2) for at in range(0, len(data), 8)))

    @property
    def _extended(self) -> bool:
        return self._is_recessive(ARBITRATION_BITS)

    def _is_recessive(self, place: int) -> bool:
        return self._bits[place : place + 1] == str(RECESSIVE)
