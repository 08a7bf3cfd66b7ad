"""The longest that a frame can be (ISO 11898-1)."""

from __future__ import annotations

STUFFABLE = 34
"""Bits besides the data that stuff bits are put between: start of frame to CRC."""

TAIL_BITS = 13
"""CRC delimiter, acknowledge slot and delimiter, end of frame, intermission: never stuffed."""

RECOVERY_BITS = 31
"""The longest that an error keeps the bus busy besides the frame that is sent again: error flags that follow each other
(12), delimiter (8), intermission (3), and the 8 bits for which an error passive node suspends its transmission."""


def longest_frame(length: int) -> int:
    """Return the bits of the longest frame with `length` bytes of data, intermission included.

    Davis, Burns, Bril, Lukkien 2007, equation 1: a stuff bit after the first five bits, and after every four from then
    on, as each one begins the next run itself.
    """
    stuffable = STUFFABLE + 8 * length
    return stuffable + TAIL_BITS + (stuffable - 1) // 4
