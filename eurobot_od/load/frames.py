"""The longest that a frame can be, and which of two frames is the more urgent (ISO 11898-1)."""

from __future__ import annotations

from typing import TypeAlias

Urgency: TypeAlias = tuple[int, int, int]
"""What arbitration compares: of two frames the one with the lower value wins."""

STUFFABLE_BASE, STUFFABLE_EXTENDED = 34, 54
"""Bits besides the data that stuff bits are put between: start of frame to CRC, 11 and 29 bits of identifier."""

TAIL_BITS = 13
"""CRC delimiter, acknowledge slot and delimiter, end of frame, intermission: never stuffed."""

RECOVERY_BITS = 31
"""The longest that an error keeps the bus busy besides the frame that is sent again: error flags that follow each other
(12), delimiter (8), intermission (3), and the 8 bits for which an error passive node suspends its transmission."""

MOST_BYTES = 8
HIGHEST_BASE, HIGHEST_EXTENDED = 0x7FF, 0x1FFFFFFF


def longest_frame(length: int, extended: bool = False) -> int:
    """Return the bits of the longest frame with `length` bytes of data, intermission included.

    Davis, Burns, Bril, Lukkien 2007, equation 1: a stuff bit after the first five bits, and after every four from then
    on, as each one begins the next run itself.
    """
    stuffable = (STUFFABLE_EXTENDED if extended else STUFFABLE_BASE) + 8 * length
    return stuffable + TAIL_BITS + (stuffable - 1) // 4


def urgency(identifier: int, extended: bool = False) -> Urgency:
    """Return what arbitration compares: the base 11 bits, then a base frame before an extended one, then the rest."""
    return (identifier >> 18, 1, identifier & 0x3FFFF) if extended else (identifier, 0, 0)
