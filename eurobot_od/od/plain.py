"""Numbers and values of a file as every tool reads them, whatever an editor has written.

What is plain already stays as it is.
"""

from __future__ import annotations

import re
from functools import lru_cache

from eurobot_od.od import values
from eurobot_od.od.values import NODE_ID, REMEMBERED_NUMBERS, DataType, parse_number

TEXTS = (values.VISIBLE_STRING, values.UNICODE_STRING)
BYTES = (values.OCTET_STRING, values.DOMAIN)


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def plain_number(text: str, type_: DataType | None = None) -> str | None:
    """Write a number as every tool reads it, in its own words where they are; None for what is not a number."""
    number = parse_number(text)
    if number is None:
        return None
    if number.relative:
        return text if PLAIN_RELATIVE.fullmatch(text) else f"{NODE_ID}+0x{number.value:X}"
    value = type_.meant(number.value) if type_ is not None else number.value
    if PLAIN.fullmatch(text) and int(text, 0) == value:
        return text
    is_hexadecimal = value >= 0 and ("0X" in text.upper() or text.upper().endswith("H"))
    return f"0x{value:X}" if is_hexadecimal else str(value)


PLAIN = re.compile(r"-?(?:0[xX][0-9A-Fa-f]+|0|[1-9][0-9]*)")
PLAIN_RELATIVE = re.compile(r"\$NODEID\+(?:0[xX][0-9A-Fa-f]+|0|[1-9][0-9]*)")


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def plain_value(text: str, type_: DataType) -> str | None:
    """Write a value of a data type as every tool reads it; None if it does not fit the type."""
    if type_ in TEXTS:
        return text
    if type_ in BYTES:
        return _plain_bytes(text)
    if type_.code in values.TIMES and parse_number(text) is None:
        return _plain_time(text, type_)
    return _plain_real(text, type_) if type_ in values.REALS else plain_number(text, type_)


def _plain_time(text: str, type_: DataType) -> str | None:
    """Write all the bits of a time as one number; canopen reads no other, and people write `2014-05-28 12:00`."""
    try:
        return f"0x{int.from_bytes(type_.write(text), 'little'):X}"
    except (ValueError, OverflowError):
        return None


def _plain_bytes(text: str) -> str | None:
    """Write bytes in hexadecimal digits; an editor may put 0x in front of them."""
    for digits in (text, text[2:] if text[:2].lower() == "0x" else ""):
        try:
            bytes.fromhex(digits)
        except ValueError:
            continue
        return digits if digits or not text else None
    return None


def _plain_real(text: str, type_: DataType) -> str | None:
    """Write a REAL in decimal; editors also write its bits in hexadecimal, C's suffix, and a comma."""
    try:
        if text[:2].lower() == "0x":
            bits = parse_number(text)
            return None if bits is None else repr(type_.read(bits.value.to_bytes(type_.size, "big")[::-1]))
        for each in (text, text.rstrip("fF").replace(",", ".", 1)):
            try:
                float(each)
            except ValueError:
                continue
            return each
    except OverflowError:  # more bits than the type has
        pass
    return None
