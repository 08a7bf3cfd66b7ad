"""What both ends read and write: sizes, segments, blocks, abort codes."""

from __future__ import annotations

import pytest
from canopen.sdo.exceptions import SdoAbortedError

from eurobot_od.sdo.wire import Initiate, block, carrying, part_in, reason, segment, segments_of
from tests.rows import rows


@rows("code", SdoAbortedError.CODES)
def test_every_abort_code_has_canopens_words(code: int) -> None:
    assert reason(code) == SdoAbortedError.CODES[code].replace("can not", "cannot")


def test_a_code_of_a_devices_own_has_none() -> None:
    assert reason(0xDEADBEEF) == "unknown code"


@pytest.mark.parametrize(
    ("data", "size"),
    [
        ("4f002001 01000000", 1),
        ("43002001 01020304", 4),
        ("42002001 01020304", None),  # expedited, the size is not given
        ("41002001 00010000", 256),
        ("40002001 00000000", None),
    ],
)
def test_the_size_that_an_initiate_tells(data: str, size: int | None) -> None:
    assert Initiate.of(bytes.fromhex(data)).size == size


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_what_fits_is_in_the_initiate_itself(size: int) -> None:
    initiate = Initiate.of(carrying(2, (0x2000, 1), bytes(range(size))))
    assert (initiate.address, initiate.size, initiate.rest[:size]) == ((0x2000, 1), size, bytes(range(size)))


@pytest.mark.parametrize("size", [0, 5, 300])
def test_what_does_not_fit_is_announced(size: int) -> None:
    assert carrying(1, (0x2000, 1), bytes(size)).hex() == f"21002001{size.to_bytes(4, 'little').hex()}"


@pytest.mark.parametrize(
    ("content", "carried"), [(b"", [b""]), (b"1234567", [b"1234567"]), (b"12345678", [b"1234567", b"8"])]
)
def test_a_content_in_segments(content: bytes, carried: list[bytes]) -> None:
    assert [content[at : at + 7] for at in segments_of(content)] == carried
    assert [part_in(segment(3, 0x10, part, last=True)) for part in carried] == carried


def test_a_block_is_numbered_and_ends_with_the_last_of_all() -> None:
    content = bytes(8 * 7)
    assert [each[0] for each in block(content, 0, 2)] == [1, 2]
    assert [each[0] for each in block(content, 6 * 7, 2)] == [1, 0x82]
    assert [each[0] for each in block(content, 6 * 7, 127)] == [1, 0x82]
    assert [each[0] for each in block(b"", 0, 127)] == [0x81]
