"""An SDO client: expedited and segmented transfer, one request and one answer at a time (CiA 301, 7.2.4.3).

Rule of this file: bytes only. A request goes into `exchange`, which returns the answer; how long that may take and
what an object's bytes mean is the caller's business.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TypeAlias

from eurobot_od.errors import RemoteError
from eurobot_od.od.values import Address
from eurobot_od.sdo.server import (
    ABORT,
    EXPEDITED,
    EXPEDITED_SIZE,
    LAST,
    SEGMENT_SIZE,
    SIZE_GIVEN,
    TOGGLE,
    Client,
    Server,
)

Exchange: TypeAlias = Callable[[bytes], Awaitable[bytes]]

COMMAND = 0xE0
"""The upper three bits of an answer's command byte say what it answers."""


class SdoAborted(RemoteError):
    """The node refused a transfer with an abort `code`."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"the node aborts with 0x{code:08X}")


class OddAnswer(RemoteError):
    """An answer that does not fit the request."""

    def __init__(self, answer: bytes, expected: str) -> None:
        super().__init__(f"the answer {answer.hex().upper()} is not {expected}")


async def upload(exchange: Exchange, address: Address) -> bytes:
    """Read an object's bytes; raises SdoAborted, OddAnswer."""
    answer = await _initiate(exchange, Client.UPLOAD << 5, address, b"", Server.UPLOAD)
    if not answer[0] & EXPEDITED:
        return await _upload_segments(exchange)
    unused = answer[0] >> 2 & 3 if answer[0] & SIZE_GIVEN else 0
    return answer[4 : 8 - unused]


async def _upload_segments(exchange: Exchange) -> bytes:
    content, toggle, last = b"", 0, 0
    while not last:
        answer = await _ask(exchange, bytes([Client.UPLOAD_SEGMENT << 5 | toggle]), Server.UPLOAD_SEGMENT)
        _check_toggle(answer, toggle)
        content += answer[1 : 8 - (answer[0] >> 1 & 7)]
        last, toggle = answer[0] & LAST, toggle ^ TOGGLE
    return content


async def download(exchange: Exchange, address: Address, content: bytes) -> None:
    """Write an object's bytes; raises SdoAborted, OddAnswer."""
    command = Client.DOWNLOAD << 5 | SIZE_GIVEN
    if 1 <= len(content) <= EXPEDITED_SIZE:
        expedited = command | EXPEDITED | EXPEDITED_SIZE - len(content) << 2
        await _initiate(exchange, expedited, address, content, Server.DOWNLOAD)
    else:
        await _initiate(exchange, command, address, len(content).to_bytes(4, "little"), Server.DOWNLOAD)
        await _download_segments(exchange, content)


async def _download_segments(exchange: Exchange, content: bytes) -> None:
    toggle = 0
    for start in range(0, max(len(content), 1), SEGMENT_SIZE):
        segment = content[start : start + SEGMENT_SIZE]
        last = start + SEGMENT_SIZE >= len(content)
        command = Client.DOWNLOAD_SEGMENT << 5 | toggle | SEGMENT_SIZE - len(segment) << 1 | last * LAST
        answer = await _ask(exchange, bytes([command]) + segment, Server.DOWNLOAD_SEGMENT)
        _check_toggle(answer, toggle)
        toggle ^= TOGGLE


async def _initiate(exchange: Exchange, command: int, address: Address, rest: bytes, expected: Server) -> bytes:
    index, subindex = address
    place = index.to_bytes(2, "little") + bytes([subindex])
    answer = await _ask(exchange, bytes([command]) + place + rest, expected)
    if answer[1:4] != place:
        raise OddAnswer(answer, f"about 0x{index:04X}:{subindex}")
    return answer


async def _ask(exchange: Exchange, request: bytes, expected: Server) -> bytes:
    answer = await exchange(request.ljust(8, b"\0"))
    if len(answer) != 8:
        raise OddAnswer(answer, "of 8 bytes")
    if answer[0] == ABORT:
        raise SdoAborted(int.from_bytes(answer[4:8], "little"))
    if answer[0] & COMMAND != expected:
        raise OddAnswer(answer, f"an answer to the request {request.hex().upper()}")
    return answer


def _check_toggle(answer: bytes, toggle: int) -> None:
    if answer[0] & TOGGLE != toggle:
        raise OddAnswer(answer, "with the toggle bit of the request")
