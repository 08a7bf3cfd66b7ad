"""Buses: `live` and `simulated`; in here, how long a frame is on the wire (ISO 11898-1, classic frames).

Lengths are in bit times: exactly, and at most.
"""

from __future__ import annotations

import re
from functools import lru_cache

from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, Frame

# x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1, its highest power left out (ISO 11898-1).
CRC_POLYNOMIAL = 0x4599
CRC_BITS = 15

STUFFED = re.compile("0{5}(?:1{4}0{4})*(?:1{4})?|1{5}(?:0{4}1{4})*(?:0{4})?")
"""Bits with stuff bits among them: one behind five equal bits, and behind each four of the other level from then on.

A stuff bit has the other level, and begins the next run itself.
"""

END_OF_FRAME = 7
INTERMISSION = 3
ACKNOWLEDGE_BITS = 1 + 2
"""CRC delimiter, acknowledge slot and delimiter; neither they nor what follows is stuffed."""

STUFFABLE = 1 + 11 + 1 + 2 + 4 + CRC_BITS
"""Bits of a base frame besides its data, from the start of frame to the end of the CRC."""

KNOWN = 1 << 11
"""How many frames are remembered: a bus repeats itself, at least within a few seconds."""


@lru_cache(maxsize=KNOWN)
def frame_bits(frame: Frame) -> int:
    """Return the bit times from the start of frame to the end of the intermission behind it."""
    bits = _identifier_bits(frame) + f"{len(frame.data):04b}"
    if not frame.is_remote:  # a remote frame has the length of the answer, and no data
        bits += "".join(f"{byte:08b}" for byte in frame.data)
    bits += f"{crc(bits):0{CRC_BITS}b}"
    stuffed = sum((len(each) - 1) // 4 for each in STUFFED.findall(bits))
    return len(bits) + stuffed + ACKNOWLEDGE_BITS + END_OF_FRAME + INTERMISSION


def longest_frame(length: int) -> int:
    """Return the bit times of the longest base frame with `length` bytes of data, intermission included.

    Davis, Burns, Bril, Lukkien 2007, equation 1: a stuff bit after the first five bits, and after every four from then
    on.
    """
    stuffable = STUFFABLE + 8 * length
    return stuffable + (stuffable - 1) // 4 + ACKNOWLEDGE_BITS + END_OF_FRAME + INTERMISSION


def _identifier_bits(frame: Frame) -> str:
    """Return the bits from the start of frame to the length."""
    remote = int(frame.is_remote)
    if not frame.cob_id & EXTENDED:  # after the identifier RTR, IDE 0 for 11 bits, and a reserved bit
        return f"0{frame.cob_id:011b}{remote}00"
    bits = f"{frame.cob_id & HIGHEST_EXTENDED:029b}"  # between its parts SRR and IDE, both 1; two reserved bits behind
    return f"0{bits[:11]}11{bits[11:]}{remote}00"


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
