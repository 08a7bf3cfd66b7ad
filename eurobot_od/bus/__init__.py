"""Buses, `live` and `simulated`; and lengths of frames in bit times (ISO 11898-1, classic frames)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, Frame

# x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1, without the highest power (ISO 11898-1).
CRC_POLYNOMIAL = 0x4599
CRC_BITS = 15
POLYNOMIAL_PLACES = [place for place in range(CRC_BITS) if CRC_POLYNOMIAL >> (CRC_BITS - 1 - place) & 1]
"""Positions of its ones, counted from the highest bit."""

END_OF_FRAME = 7
INTERMISSION = 3
ACKNOWLEDGE_BITS = 1 + 2
"""Bits of CRC delimiter, acknowledge slot and delimiter; no stuff bits from here on."""

STUFFABLE = 1 + 11 + 1 + 2 + 4 + CRC_BITS
"""Bits of a base frame besides its data, from the start of frame to the end of the CRC."""

EXTENSION = 18 + 2
"""Additional bits of a frame with a 29-bit identifier: rest of the identifier, SRR, a second reserved bit."""

KNOWN = 1 << 11
"""Number of frames whose length is cached; a bus repeats its frames."""


@lru_cache(maxsize=KNOWN)
def frame_bits(frame: Frame) -> int:
    """Return the length of a frame in bit times, from start of frame to the end of the intermission."""
    head = _head(frame.cob_id, frame.is_remote, len(frame.data))
    # A remote frame has the length of the requested data, but no data.
    return _bits(head, b"" if frame.is_remote else frame.data)


def bits_together(cob_id: int, data: Sequence[bytes]) -> int:
    """Return the total length in bit times of data frames with one identifier; faster than `frame_bits` for hundreds.

    An integer holds the same bit of all frames, so that one operation works on all of them.
    """
    lengths = set(map(len, data))
    if len(lengths) != 1:
        return sum(bits_together(cob_id, [each for each in data if len(each) == length]) for length in lengths)
    length = lengths.pop()
    joined = b"".join(data)
    every = (1 << len(data)) - 1
    head = _head(cob_id, False, length)
    columns = (joined[place::length] for place in range(length))
    bits = [int(column.translate(digits), 2) for column in columns for digits in DIGITS]
    bits += _crc_bits([every * (head.register >> place & 1) for place in reversed(range(CRC_BITS))], bits)
    # Sets of frames by the number of equal bits at their end, from 1 to 4.
    one, two, three, four = (every * (head.run >> 9 == number) for number in range(1, LONGEST_RUN))
    level = every * (head.run >> 8 & 1)
    stuffed = 0
    for bit in bits:
        same = every ^ bit ^ level
        five = four & same
        one, two, three, four = every ^ same | five, one & same, two & same, three & same
        level = bit ^ five
        stuffed += five.bit_count()
    return len(data) * (head.bits + 8 * length + head.stuffed) + stuffed


DIGITS = [bytes(b"01"[byte >> place & 1] for byte in range(256)) for place in reversed(range(8))]
"""For each bit, from the highest on: its binary digit in each byte."""


def _crc_bits(register: list[int], bits: Iterable[int]) -> list[int]:
    """Return the bits of the CRC after `bits`, from the highest on; each integer holds a bit of many frames."""
    for bit in bits:
        back, *register = bit ^ register[0], *register[1:], 0
        for place in POLYNOMIAL_PLACES:
            register[place] ^= back
    return register


def longest_frame(length: int, is_extended: bool = False) -> int:
    """Return the length in bit times of the longest frame with `length` bytes of data, intermission included.

    The worst case has a stuff bit after the first five bits, and then after every four (Davis, Burns, Bril, Lukkien
    2007, equation 1).
    """
    stuffable = STUFFABLE + (EXTENSION if is_extended else 0) + 8 * length
    return stuffable + (stuffable - 1) // 4 + ACKNOWLEDGE_BITS + END_OF_FRAME + INTERMISSION


# Stuff bits of a byte from a table: their number depends on the run of equal bits before it


class _Head(NamedTuple):
    """A frame up to its length field: number of bits without stuff bits, CRC register, last run, and stuff bits."""

    bits: int
    register: int
    run: int
    stuffed: int


LONGEST_RUN = 5
"""After this many equal bits, a stuff bit of the other level follows, and begins the next run."""


@cache
def _head(cob_id: int, is_remote: bool, length: int) -> _Head:
    bits = _identifier_bits(cob_id, is_remote) + f"{length:04b}"
    register = 0
    for byte in int(bits, 2).to_bytes((len(bits) + 7) // 8, "big"):  # leading zeros do not change the CRC
        register = _crc(register, byte)
    run, stuffed = _stuffed(0, bits)
    fixed = len(bits) + CRC_BITS + ACKNOWLEDGE_BITS + END_OF_FRAME + INTERMISSION
    return _Head(fixed, register, run << 8, stuffed)


def _bits(head: _Head, data: bytes) -> int:
    bits, register, run, stuffed = head
    runs, stuff_bits, last = _runs()
    crc_of_byte = CRC_OF_BYTE
    for byte in data:
        register = (register << 8 ^ crc_of_byte[register >> 7 ^ byte]) & 0x7FFF  # `_crc`, inlined for speed
        place = run | byte
        run = runs[place]
        stuffed += stuff_bits[place]
    place = run | register >> 7
    return bits + 8 * len(data) + stuffed + stuff_bits[place] + last[runs[place] | register & 0x7F]


def _crc(register: int, byte: int) -> int:
    return (register << 8 ^ CRC_OF_BYTE[register >> (CRC_BITS - 8) ^ byte]) & (1 << CRC_BITS) - 1


def _stuffed(run: int, bits: str) -> tuple[int, int]:
    """Return the run at the end of bits, and the number of stuff bits.

    A run is twice the number of equal bits, plus their level; 0 at the start of a frame.
    """
    length = run >> 1
    level = run & 1
    stuffed = 0
    for bit in map(int, bits):
        length = length + 1 if bit == level else 1
        level = bit
        if length == LONGEST_RUN:
            length = 1
            level = 1 - bit
            stuffed = stuffed + 1
    return length << 1 | level, stuffed


@cache
def _runs() -> tuple[list[int], list[int], list[int]]:
    """Return the tables of `_stuffed` for each run and byte: runs times 256, and numbers of stuff bits.

    The last table has the numbers of stuff bits for each run and the last 7 bits of the CRC.
    """
    found = [_stuffed(run, f"{byte:08b}") for run in range(2 * LONGEST_RUN) for byte in range(256)]
    last = [_stuffed(run, f"{bits & 0x7F:07b}")[1] for run in range(2 * LONGEST_RUN) for bits in range(256)]
    return [run << 8 for run, _ in found], [stuffed for _, stuffed in found], last


def _identifier_bits(cob_id: int, is_remote: bool) -> str:
    """Return the bits from the start of frame to the length field."""
    remote = int(is_remote)
    if not cob_id & EXTENDED:  # identifier, RTR, IDE (0 for 11 bits), reserved bit
        return f"0{cob_id:011b}{remote}00"
    bits = f"{cob_id & HIGHEST_EXTENDED:029b}"  # SRR and IDE, both 1, are between its parts; two reserved bits follow
    return f"0{bits[:11]}11{bits[11:]}{remote}00"


def _crc_of_byte(byte: int) -> int:
    register = byte << (CRC_BITS - 8)
    for _ in range(8):
        register = register << 1 ^ CRC_POLYNOMIAL * (register >> (CRC_BITS - 1) & 1)
    return register & (1 << CRC_BITS) - 1


CRC_OF_BYTE = [_crc_of_byte(byte) for byte in range(256)]
