"""A frame as bits on the wire, stuff bits included (ISO 11898-1, classic base frames), and read back from them.

Rule of this file: exact, not estimated: the bits are written out, protected by the CRC and stuffed. A bit is a level:
0 is dominant, 1 recessive.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from eurobot_od.frame import Frame

DOMINANT, RECESSIVE = 0, 1

CRC_POLYNOMIAL = 0x4599
CRC_BITS = 15
STUFF_AFTER = 5
ACKNOWLEDGE_BITS = 1 + 2
"""CRC delimiter, acknowledge slot and delimiter; neither they nor what follows is stuffed."""

END_OF_FRAME = 7
INTERMISSION = 3

ARBITRATION_BITS = 1 + 11 + 1
"""Start of frame, identifier and RTR: here a recessive bit may be overwritten without an error."""

KNOWN = 1 << 16
"""How many frames are kept as bits: a bus repeats itself."""


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
    head = f"0{frame.cob_id:011b}000{len(frame.data):04b}" + "".join(f"{byte:08b}" for byte in frame.data)
    plain = [int(bit) for bit in head]
    stuffing = Stuffing()
    bits: list[int] = []
    stuffed: set[int] = set()
    arbitration = 0
    for number, bit in enumerate([*plain, *crc(plain)], 1):
        bits.append(bit)
        if stuffing.follows(bit):
            stuffed.add(len(bits))
            bits.append(1 - bit)
            stuffing.follows(1 - bit)
        if number == ARBITRATION_BITS:
            arbitration = len(bits)
    return Wire(tuple(bits), frozenset(stuffed), arbitration, len(bits) + ACKNOWLEDGE_BITS + END_OF_FRAME)


def frame_bits(frame: Frame) -> int:
    """Return the number of bit times from the start of frame to the end of the intermission behind it."""
    return on_wire(frame).end + INTERMISSION


def crc(bits: list[int]) -> list[int]:
    """Return the bits of the CRC over `bits`, the highest first."""
    register = 0
    for bit in bits:
        invert = bit ^ register >> (CRC_BITS - 1)
        register = register << 1 & (1 << CRC_BITS) - 1
        register ^= CRC_POLYNOMIAL * invert
    return [register >> place & 1 for place in reversed(range(CRC_BITS))]


class Stuffing:
    """Knows after which bit a stuff bit follows; such a bit begins the next run itself."""

    def __init__(self) -> None:
        self.last, self.run = -1, 0

    def follows(self, bit: int) -> bool:
        """Take in a bit, and tell whether a stuff bit has to follow it."""
        self.run = self.run + 1 if bit == self.last else 1
        self.last = bit
        return self.run == STUFF_AFTER


class Reading:
    """What a receiver makes of the bits it sees, from the start of frame to the end of the CRC.

    A bit error may have made it a remote frame, or one with 29 bits: such a frame is read to its end, too.
    """

    def __init__(self) -> None:
        self._stuffing = Stuffing()
        self._stuff_bit = False
        self._bits: list[int] = []

    def take(self, bit: int) -> bool:
        """Take in a bit; False if it breaks the rule of bit stuffing."""
        fits = not self._stuff_bit or bit != self._stuffing.last
        if not self._stuff_bit:
            self._bits.append(bit)
        self._stuff_bit = self._stuffing.follows(bit)
        return fits

    @property
    def complete(self) -> bool:
        """Tell whether the CRC is there, and the stuff bit that may follow it."""
        return len(self._bits) == self._length and not self._stuff_bit

    @property
    def intact(self) -> bool:
        """Tell whether the CRC is right."""
        return crc(self._bits[:-CRC_BITS]) == self._bits[-CRC_BITS:]

    @property
    def frame(self) -> Frame | None:
        """Return the frame that was read, None for a remote one or one with 29 bits."""
        if self._extended or self._bits[12]:
            return None
        data = self._bits[19:-CRC_BITS]
        return Frame(_number(self._bits[1:12]), bytes(_number(data[at : at + 8]) for at in range(0, len(data), 8)))

    @property
    def _extended(self) -> bool:
        return len(self._bits) > ARBITRATION_BITS and bool(self._bits[ARBITRATION_BITS])

    @property
    def _length(self) -> int:
        """How many bits it takes without stuff bits; as long as that is not known, one more than there are."""
        head, remote = (39, 32) if self._extended else (19, 12)
        if len(self._bits) < head:
            return len(self._bits) + 1
        octets = 0 if self._bits[remote] else min(_number(self._bits[head - 4 : head]), 8)
        return head + 8 * octets + CRC_BITS


def _number(bits: list[int]) -> int:
    return int("".join(map(str, bits)), 2) if bits else 0
