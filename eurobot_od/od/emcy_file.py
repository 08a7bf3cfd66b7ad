"""A maker's words for emergency error codes, in a YAML file: `0x7310: speed`, `0x73xx: sensor`, `0xFF01..0xFF0F: axis`.

A mistake in the file is one line, with its place.
"""

from __future__ import annotations

import re
from pathlib import Path

from eurobot_od.errors import DictionaryError
from eurobot_od.od.document import read_bytes
from eurobot_od.support.yaml_places import Problem, Problems, ReadError, any_text, mapping, read_yaml, scalar

KEY = re.compile(r"0x(?P<first>[0-9A-F]{1,4}|[0-9A-F]{2,3}X{1,2})(\.\.0x(?P<last>[0-9A-F]{1,4}))?", re.IGNORECASE)
"""A code, a class of codes with an x for any digit, or the first and the last of a range."""


def read_error_words(file: str | Path) -> dict[int, str]:
    """Return the words by code; of several entries for a code the narrowest counts. Raises DictionaryError."""
    problems: Problems = []
    try:
        words = read_yaml(read_bytes(file).decode("utf-8", "replace"), mapping(any_text, key=scalar), problems)
        ranges = [(_codes(str(key)), str(text)) for key, text in words.items()]
        problems += [
            Problem(key.place, f"{str(key)!r} is not an error code: write 0x7310, 0x73xx or 0x7380..0x738F")
            for key, (codes, _) in zip(words, ranges)
            if not codes
        ]
        if problems:
            raise ReadError
    except ReadError as error:
        place, what = problems[0]
        raise DictionaryError(file, None, f"line {place.line}: {what}") from error
    # The narrowest comes last, and so replaces what wider entries say about its codes.
    widest_first = sorted(ranges, key=lambda each: len(each[0]), reverse=True)
    return {code: text for codes, text in widest_first for code in codes}


def _codes(key: str) -> range:
    """Return the codes that a key stands for, none if it stands for no code."""
    found = KEY.fullmatch(key.strip())
    if found is None:
        return range(0)
    first = found["first"].upper()
    low, high = (int(first.replace("X", digit), 16) for digit in "0F")
    if "X" in first and (len(first) < 4 or found["last"]):
        return range(0)
    return range(low, (int(found["last"], 16) if found["last"] else high) + 1)
