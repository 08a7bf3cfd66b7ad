"""A maker's words for emergency error codes, a YAML file: `0x7310: speed`, `0x73xx: sensor`, `0xFF01..0xFF0F: axis`."""

from __future__ import annotations

import re
from pathlib import Path

from eurobot_od.errors import LocalError
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_shapes import SCALAR, TEXT, converted, mapping, read_yaml

KEY = re.compile(r"0x(?P<first>[0-9A-F]{1,4}|[0-9A-F]{2,3}X{1,2})(\.\.0x(?P<last>[0-9A-F]{1,4}))?", re.IGNORECASE)
"""A code, a class of codes with an x for any digit, or the first and the last of a range."""


def read_error_words(file: str | Path) -> dict[int, str]:
    """Return the words by code; of several entries for a code the narrowest counts. Raises FileError."""
    ranges = read_yaml(read_whole(file).decode("utf-8", "replace"), mapping(TEXT, converted(SCALAR, _codes)), file)
    # The narrowest comes last, and so replaces what wider entries say about its codes.
    widest_first = sorted(ranges.items(), key=lambda each: len(each[0]), reverse=True)
    return {code: str(text) for codes, text in widest_first for code in codes}


def _codes(key: str) -> range:
    """Return the codes that a key stands for; raises LocalError for a key that stands for none."""
    codes, found = range(0), KEY.fullmatch(key.strip())
    if found is not None and not ("X" in found["first"].upper() and (len(found["first"]) < 4 or found["last"])):
        low, high = (int(found["first"].upper().replace("X", digit), 16) for digit in "0F")
        codes = range(low, (int(found["last"], 16) if found["last"] else high) + 1)
    if not codes:
        raise LocalError(f"{str(key)!r} is not an error code: write 0x7310, 0x73xx or 0x7380..0x738F")
    return codes
