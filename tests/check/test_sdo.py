"""The SDO client reads and writes what our SDO server has, and tells aborts and odd answers."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from eurobot_od.check.sdo import OddAnswer, SdoAborted, download, upload
from eurobot_od.od.values import Address
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import Abort, AbortCode

OBJECT: Address = (0x2000, 1)
SIZES = [0, 1, 2, 3, 4, 5, 6, 7, 8, 13, 14, 15, 100]


class Objects:
    """One object of any length, as an SDO server wants it."""

    def __init__(self, content: bytes = b"") -> None:
        self.content = content

    def read(self, address: Address) -> bytes:
        if address != OBJECT:
            raise Abort(AbortCode.NO_OBJECT)
        return self.content

    def admit(self, address: Address, size: int | None) -> int:
        self.read(address)
        return 1000

    def write(self, address: Address, data: bytes) -> None:
        self.content = data


class Line:
    """Carries requests to a server and its answers back."""

    def __init__(self, objects: Objects) -> None:
        self._server = SdoServer(objects)

    async def exchange(self, request: bytes) -> bytes:
        assert len(request) == 8
        (answer,) = self._server.receive(request, 0.0)
        return answer


class Recording:
    """Gives the same answers whatever is asked."""

    def __init__(self, answers: Sequence[str]) -> None:
        self._answers = [bytes.fromhex(answer) for answer in answers]

    async def exchange(self, _: bytes) -> bytes:
        return self._answers.pop(0)


@pytest.mark.parametrize("size", SIZES)
def test_reads_what_is_there(size: int) -> None:
    content = bytes(range(size))
    assert asyncio.run(upload(Line(Objects(content)).exchange, OBJECT)) == content


@pytest.mark.parametrize("size", SIZES)
def test_writes_what_it_is_given(size: int) -> None:
    objects = Objects(b"before")
    asyncio.run(download(Line(objects).exchange, OBJECT, bytes(range(size))))
    assert objects.content == bytes(range(size))


def test_tells_an_abort() -> None:
    exchange = Line(Objects()).exchange
    with pytest.raises(SdoAborted, match="the node aborts with 0x06020000"):
        asyncio.run(upload(exchange, (0x5000, 0)))
    with pytest.raises(SdoAborted, match="the node aborts with 0x06020000"):
        asyncio.run(download(exchange, (0x5000, 0), b"\1"))


ODD_UPLOADS = [
    (["4B00200100"], "of 8 bytes"),
    (["4B01200100000000"], "about 0x2000:1"),  # another object
    (["6000200100000000"], "an answer to the request"),  # a download's answer
    (["4100200108000000", "1000000000000000"], "with the toggle bit"),
    (["4100200108000000", "2000000000000000"], "an answer to the request"),
]


@pytest.mark.parametrize(("answers", "what"), ODD_UPLOADS)
def test_tells_an_odd_answer(answers: Sequence[str], what: str) -> None:
    with pytest.raises(OddAnswer, match=what):
        asyncio.run(upload(Recording(answers).exchange, OBJECT))


def test_takes_an_expedited_answer_that_does_not_say_its_size() -> None:
    assert asyncio.run(upload(Recording(["4200200101020304"]).exchange, OBJECT)) == bytes([1, 2, 3, 4])
