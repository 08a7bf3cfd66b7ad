"""How many bits a frame takes on the wire, stuff bits included (ISO 11898-1, classic base frames).

Rule of this file: exact, not estimated: the bits are written out, protected by the CRC and stuffed.
"""

from __future__ import annotations

from functools import lru_cache

from eurobot_od.frame import Frame

CRC_POLYNOMIAL = 0x4599
CRC_BITS = 15
STUFF_AFTER = 5
TAIL_BITS = 1 + 2 + 7 + 3
"""CRC delimiter, acknowledge slot and delimiter, end of frame, intermission: never stuffed."""


@lru_cache(maxsize=4096)
def frame_bits(frame: Frame) -> int:
    """Return the number of bit times from the start of frame to the end of the intermission behind it."""
    head = f"0{frame.cob_id:011b}000{len(frame.data):04b}" + "".join(f"{byte:08b}" for byte in frame.data)
    stuffable = head + f"{_crc(head):0{CRC_BITS}b}"
    return len(stuffable) + _stuff_bits(stuffable) + TAIL_BITS


def _crc(bits: str) -> int:
    register = 0
    for bit in bits:
        invert = (bit == "1") ^ (register >> (CRC_BITS - 1))
        register = register << 1 & (1 << CRC_BITS) - 1
        register ^= CRC_POLYNOMIAL * invert
    return register


def _stuff_bits(bits: str) -> int:
    """Count the bits a sender puts in after five equal ones; such a bit begins the next run itself."""
    count, last, run = 0, "", 0
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == STUFF_AFTER:
            count, last, run = count + 1, "10"[int(bit)], 1
    return count
