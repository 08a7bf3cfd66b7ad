"""Concise DCF: the bytes of CiA 302-3, there and back, and damaged ones told by their place."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eurobot_od.od.concise import Truncated, Write, pack, unpack

ENTRIES = [Write((0x1017, 0), b"\xf4\x01"), Write((0x1403, 1), b"\x18\0\0\0")]
BYTES = bytes.fromhex("02000000  1710 00 02000000 f401  0314 01 04000000 18000000")


def test_the_bytes_are_those_of_the_standard() -> None:
    assert pack(ENTRIES) == BYTES
    assert unpack(BYTES) == ENTRIES


@pytest.mark.parametrize(
    ("data", "where"),
    [
        (b"", "ends at byte 0, 4 bytes expected at byte 0"),  # no number of entries
        (BYTES[:3], "ends at byte 3, 4 bytes expected at byte 0"),
        (BYTES[:8], "ends at byte 8, 7 bytes expected at byte 4"),  # in an entry's head
        (BYTES[:12], "ends at byte 12, 2 bytes expected at byte 11"),  # in its data
        (BYTES[:13], "ends at byte 13, 7 bytes expected at byte 13"),  # an entry missing
        (BYTES + b"\0", "1 bytes after the last of 2 entries"),
        (b"\xff\xff\xff\xff", "ends at byte 4, 7 bytes expected at byte 4"),  # a number of entries out of nothing
    ],
)
def test_damage_is_told_by_its_place(data: bytes, where: str) -> None:
    with pytest.raises(Truncated, match=where):
        unpack(data)


@settings(deadline=None)
@given(st.lists(st.tuples(st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFF)), st.binary(max_size=20))))
def test_writes_come_back_in_their_order(writes: list[tuple[tuple[int, int], bytes]]) -> None:
    assert unpack(pack(writes)) == [Write(*write) for write in writes]


@settings(deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_are_entries_or_refused(data: bytes) -> None:
    with suppress(Truncated):
        assert pack(unpack(data)) == data
