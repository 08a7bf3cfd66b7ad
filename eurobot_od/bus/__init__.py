"""Buses: `live` and `simulated`; in here, how long a frame is on the wire (ISO 11898-1, classic frames).

Lengths are in bit times: exactly, and at most.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, Frame

# x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1, its highest power left out (ISO 11898-1).
CRC_POLYNOMIAL = 0x4599
CRC_BITS = 15
POLYNOMIAL_PLACES = [place for place in range(CRC_BITS) if CRC_POLYNOMIAL >> (CRC_BITS - 1 - place) & 1]
"""Where it has a 1, counted from its highest bit."""

END_OF_FRAME = 7
INTERMISSION = 3
ACKNOWLEDGE_BITS = 1 + 2
"""CRC delimiter, acknowledge slot and delimiter; neither they nor what follows is stuffed."""

STUFFABLE = 1 + 11 + 1 + 2 + 4 + CRC_BITS
"""Bits of a base frame besides its data, from the start of frame to the end of the CRC."""

EXTENSION = 18 + 2
"""Bits that a frame with an identifier of 29 bits has more: its rest, SRR, and a second reserved bit."""

KNOWN = 1 << 11
"""How many frames are remembered: a bus repeats itself, at least within a few seconds."""


@lru_cache(maxsize=KNOWN)
def frame_bits(frame: Frame) -> int:
    """Return the bit times from the start of frame to the end of the intermission behind it."""
    head = _head(frame.cob_id, frame.is_remote, len(frame.data))
    return _bits(
        head, b"" if frame.is_remote else frame.data
    )  # a remote frame has the length of the answer, and no data


def bits_together(cob_id: int, data: Sequence[bytes]) -> int:
    """Return the bit times of data frames with one identifier, as `frame_bits` of each; quicker for hundreds of them.

    A bit of all frames is one integer: what is done to it is done to as many frames at once.
    """
    lengths = set(map(len, data))
    if len(lengths) != 1:
        return sum(bits_together(cob_id, [each for each in data if len(each) == length]) for length in lengths)
    length, joined, every = lengths.pop(), b"".join(data), (1 << len(data)) - 1
    head = _head(cob_id, False, length)
    columns = (joined[place::length] for place in range(length))
    bits = [int(column.translate(digits), 2) for column in columns for digits in DIGITS]
    bits += _crc_bits([every * (head.register >> place & 1) for place in reversed(range(CRC_BITS))], bits)
    # By the number of equal bits at the end, from 1 to 4, the frames that have so many.
    one, two, three, four = (every * (head.run >> 9 == number) for number in range(1, LONGEST_RUN))
    level, stuffed = every * (head.run >> 8 & 1), 0
    for bit in bits:
        same = every ^ bit ^ level
        five = four & same
        one, two, three, four = every ^ same | five, one & same, two & same, three & same
        level = bit ^ five
        stuffed += five.bit_count()
    return len(data) * (head.bits + 8 * length + head.stuffed) + stuffed


DIGITS = [bytes(b"01"[byte >> place & 1] for byte in range(256)) for place in reversed(range(8))]
"""For each bit, from the highest on, what it is in each byte, as a binary digit."""


def _crc_bits(register: list[int], bits: Iterable[int]) -> list[int]:
    """Return the bits of a CRC behind these, from the highest on; each is that of many frames."""
    for bit in bits:
        back, *register = bit ^ register[0], *register[1:], 0
        for place in POLYNOMIAL_PLACES:
            register[place] ^= back
    return register


def longest_frame(length: int, is_extended: bool = False) -> int:
    """Return the bit times of the longest frame with `length` bytes of data, intermission included.

    Davis, Burns, Bril, Lukkien 2007, equation 1: a stuff bit after the first five bits, and after every four from then
    on.
    """
    stuffable = STUFFABLE + EXTENSION * is_extended + 8 * length
    return stuffable + (stuffable - 1) // 4 + ACKNOWLEDGE_BITS + END_OF_FRAME + INTERMISSION


# Byte by byte, with a table: how many stuff bits there are in it depends on the run of equal bits before it


class _Head(NamedTuple):
    """A frame up to its length: all bits but stuff bits, CRC register, run at its end, and stuff bits so far."""

    bits: int
    register: int
    run: int
    stuffed: int


LONGEST_RUN = 5
"""Behind so many equal bits comes one of the other level, which begins the next run itself."""


@cache
def _head(cob_id: int, is_remote: bool, length: int) -> _Head:
    bits = _identifier_bits(cob_id, is_remote) + f"{length:04b}"
    register = 0
    for byte in int(bits, 2).to_bytes((len(bits) + 7) // 8, "big"):  # zeros in front change nothing: it begins with 0
        register = _crc(register, byte)
    run, stuffed = _stuffed(0, bits)
    fixed = len(bits) + CRC_BITS + ACKNOWLEDGE_BITS + END_OF_FRAME + INTERMISSION
    return _Head(fixed, register, run << 8, stuffed)


def _bits(head: _Head, data: bytes) -> int:
    bits, register, run, stuffed = head
    runs, stuff_bits, last = _runs()
    crc_of_byte = CRC_OF_BYTE
    for byte in data:
        register = (register << 8 ^ crc_of_byte[register >> 7 ^ byte]) & 0x7FFF  # as `_crc`, without a call
        place = run | byte
        run = runs[place]
        stuffed += stuff_bits[place]
    place = run | register >> 7
    return bits + 8 * len(data) + stuffed + stuff_bits[place] + last[runs[place] | register & 0x7F]


def _crc(register: int, byte: int) -> int:
    return (register << 8 ^ CRC_OF_BYTE[register >> (CRC_BITS - 8) ^ byte]) & (1 << CRC_BITS) - 1


def _stuffed(run: int, bits: str) -> tuple[int, int]:
    """Return the run at the end of bits, and how many stuff bits are among them.

    A run is twice the number of equal bits and their level; 0 at the start of a frame, where the bus is idle.
    """
    length, level, stuffed = run >> 1, run & 1, 0
    for bit in map(int, bits):
        length, level = (length + 1 if bit == level else 1), bit
        if length == LONGEST_RUN:
            length, level, stuffed = 1, 1 - bit, stuffed + 1
    return length << 1 | level, stuffed


@cache
def _runs() -> tuple[list[int], list[int], list[int]]:
    """Return what `_stuffed` gives for each run and byte: runs, 256 times their number, and stuff bits.

    At last the stuff bits for each run and the 7 bits of the CRC that are not a byte.
    """
    found = [_stuffed(run, f"{byte:08b}") for run in range(2 * LONGEST_RUN) for byte in range(256)]
    last = [_stuffed(run, f"{bits & 0x7F:07b}")[1] for run in range(2 * LONGEST_RUN) for bits in range(256)]
    return [run << 8 for run, _ in found], [stuffed for _, stuffed in found], last


def _identifier_bits(cob_id: int, is_remote: bool) -> str:
    """Return the bits from the start of frame to the length."""
    remote = int(is_remote)
    if not cob_id & EXTENDED:  # after the identifier RTR, IDE 0 for 11 bits, and a reserved bit
        return f"0{cob_id:011b}{remote}00"
    bits = f"{cob_id & HIGHEST_EXTENDED:029b}"  # between its parts SRR and IDE, both 1; two reserved bits behind
    return f"0{bits[:11]}11{bits[11:]}{remote}00"


def _crc_of_byte(byte: int) -> int:
    register = byte << (CRC_BITS - 8)
    for _ in range(8):
        register = register << 1 ^ CRC_POLYNOMIAL * (register >> (CRC_BITS - 1) & 1)
    return register & (1 << CRC_BITS) - 1


CRC_OF_BYTE = [_crc_of_byte(byte) for byte in range(256)]
