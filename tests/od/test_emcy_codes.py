"""What device profiles mean by emergency error codes."""

from __future__ import annotations

import pytest

from eurobot_od.od.emcy_codes import OF_PROFILES, profile_words
from tests.rows import rows

CODES = [
    # of a drive: the code itself, a code in its class, the class of that class
    (402, 0x7310, "speed"),
    (402, 0x7312, "speed"),
    (402, 0x7333, "sensor"),
    (402, 0x8611, "following error"),
    (402, 0x2332, "earth leakage at the output, phase V"),
    (402, 0x630F, "data record no. 15"),
    (402, 0x4310, "drive temperature too high"),
    # of an I/O module the same code is something else
    (401, 0x2330, "load dump at the outputs"),
    (401, 0x7310, None),
    # nobody's
    (402, 0xFF00, None),
    (406, 0x7310, None),
    (0, 0x7310, None),
]


@rows("profile, code, words", CODES)
def test_words(profile: int, code: int, words: str | None) -> None:
    assert profile_words(profile, code) == words


@pytest.mark.parametrize("profile", OF_PROFILES)
def test_codes_are_codes_and_words_are_words(profile: int) -> None:
    for code, words in OF_PROFILES[profile].items():
        assert 0x1000 <= code <= 0xFFFF
        assert words == words.strip() != ""
