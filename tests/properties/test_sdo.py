"""SDO transfers of any content, in any form, over a line that loses segments; any bytes as requests and as answers."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from math import inf
from typing import Any

import canopen
import pytest
from canopen.objectdictionary import ODVariable
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.sdo.client import (
    OddAnswer,
    Silence,
    Transfer,
    TransferError,
    block_download,
    block_upload,
    download,
    upload,
)
from eurobot_od.sdo.server import SdoServer
from eurobot_od.sdo.wire import LENGTH, SEGMENT_SIZE, segments_of
from tests.device.shelf import TEXT, Shelf
from tests.sdo.line import WAIT, Line

contents = st.binary(max_size=2000)


class StockLine:
    """What stock canopen's client takes for a network: it hands requests to a server and answers to the client."""

    def __init__(self, server: SdoServer) -> None:
        make: Any = canopen.RemoteNode
        self.client = make(2, None).sdo
        self.client.network = self
        self._server = server

    def send_message(self, can_id: int, data: bytes) -> None:
        for answer in self._server.receive(bytes(data), 0.0):
            self.client.on_response(can_id, answer, 0.0)


@given(contents, st.booleans(), st.booleans())
def test_stock_canopen_reads_its_writes_from_our_server(content: bytes, blocks_in: bool, blocks_out: bool) -> None:
    shelf = Shelf()
    client = StockLine(SdoServer(shelf)).client
    if blocks_in and content:
        with client.open(*TEXT, "wb", size=len(content), block_transfer=True) as stream:
            stream.write(content)
    else:
        client.download(*TEXT, content, force_segment=True)
    assert shelf.objects[TEXT] == content
    with client.open(*TEXT, "rb", block_transfer=blocks_out) as stream:
        assert stream.read() == content


class StockServer:
    """Stock canopen's server with one object of any content; what it takes for a network keeps its answers."""

    deadline = inf

    def __init__(self) -> None:
        objects = canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
        objects.add_object(ODVariable("Text", *TEXT))
        make: Any = canopen.LocalNode
        self._sdo = make(2, objects).sdo
        self._sdo.network = self
        self._answers: list[bytes] = []

    def send_message(self, _: int, data: bytes) -> None:
        self._answers.append(bytes(data))

    def receive(self, data: bytes, now: float) -> list[bytes]:
        self._answers = []
        self._sdo.on_request(0x602, data, now)
        return self._answers

    def tick(self, _: float) -> list[bytes]:
        return []


@given(st.binary(min_size=1, max_size=2000))  # canopen refuses to read an object without bytes
def test_our_client_reads_its_writes_from_stock_canopen(content: bytes) -> None:
    line = Line(StockServer())
    line.run(download(TEXT, content, WAIT))
    assert line.run(upload(TEXT, WAIT)) == content


@pytest.mark.parametrize("make", [partial(block_upload, TEXT, WAIT), partial(block_download, TEXT, b"123456", WAIT)])
def test_stock_canopen_has_no_block_transfer(make: Callable[[], Transfer]) -> None:
    line = Line(StockServer())
    line.run(download(TEXT, b"123456", WAIT))
    with pytest.raises(TransferError):
        line.run(make())


@given(contents, st.booleans(), st.booleans(), st.integers(1, 127))
def test_our_client_reads_its_writes_from_our_server(
    content: bytes, blocks_in: bool, blocks_out: bool, size: int
) -> None:
    line = Line(SdoServer(Shelf()))
    line.run((block_download if blocks_in else download)(TEXT, content, WAIT))
    assert line.run(block_upload(TEXT, WAIT, size) if blocks_out else upload(TEXT, WAIT)) == content


@given(contents, st.integers(1, 127), st.floats(0.0, 0.5), st.randoms(use_true_random=False))
def test_a_server_sends_again_whatever_is_lost_of_a_block_upload(
    content: bytes, segments: int, loss: float, chance: random.Random
) -> None:
    shelf = Shelf()
    shelf.objects[TEXT] = content
    server = SdoServer(shelf)
    server.receive(bytes([0xA4, 0x08, 0x10, 0x00, segments, 0, 0, 0]), 0.0)
    answers, arrived, complete = server.receive(b"\xa3".ljust(LENGTH, b"\0"), 0.0), b"", False
    while not complete:
        count = 0
        for answer in answers:
            if answer[0] & 0x7F == count + 1 and chance.random() >= loss:
                count, arrived, complete = count + 1, arrived + answer[1:], bool(answer[0] & 0x80)
        answers = server.receive(bytes([0xA2, count, segments]).ljust(LENGTH, b"\0"), 0.0)
    unused = answers[0][0] >> 2 & SEGMENT_SIZE
    assert arrived[: len(arrived) - unused] == content


@given(contents, st.integers(1, 127), st.floats(0.0, 0.5), st.integers())
def test_a_block_upload_arrives_whole_or_not_at_all_whatever_is_lost(
    content: bytes, segments: int, loss: float, seed: int
) -> None:
    chance = random.Random(seed)
    shelf = Shelf()
    shelf.objects[TEXT] = content
    line = Line(SdoServer(shelf), lost_answers={number for number in range(1000) if chance.random() < loss})
    with suppress(Silence, OddAnswer):  # the second is for a first segment that is lost twice
        assert line.run(block_upload(TEXT, WAIT, segments)) == content


@given(contents, st.sets(st.integers(2, 100), max_size=3), st.integers(10, 127))
def test_a_few_segments_that_are_lost_do_not_end_a_block_upload(content: bytes, lost: set[int], segments: int) -> None:
    shelf = Shelf()
    shelf.objects[TEXT] = content
    sent = min(len(segments_of(content)), segments)  # answers 2, 3, ... are the first block; not all of them are lost
    line = Line(SdoServer(shelf), lost_answers=sorted(number for number in lost if number < sent + 2)[: sent - 1])
    assert line.run(block_upload(TEXT, WAIT, segments)) == content


@given(st.sampled_from((upload, block_upload)), st.lists(st.binary(max_size=8) | st.binary(min_size=8, max_size=8)))
def test_no_answer_raises_where_it_is_received(read: Callable[..., Transfer], answers: list[bytes]) -> None:
    transfer = read(TEXT, WAIT)
    transfer.start(0.0)
    for answer in answers:
        assert all(len(request) == LENGTH for request in transfer.receive(answer, 0.0))
    assert not transfer.done or transfer.receive(bytes(LENGTH), 0.0) == []


@given(st.lists(st.binary(max_size=8) | st.binary(min_size=8, max_size=8), max_size=50))
def test_no_request_ends_the_server(requests: list[bytes]) -> None:
    server = SdoServer(Shelf())
    for request in requests:
        answers = server.receive(request, 0.0)
        assert all(len(answer) == LENGTH for answer in answers)
    assert server.receive(bytes.fromhex("4000200100000000"), 0.0) is not None


@pytest.mark.parametrize("length", [0, 4, 5, 7, 8, 14, 888, 889, 890])
def test_lengths_at_the_edges_of_segments_and_blocks(length: int) -> None:
    content = bytes(range(256)) * 4
    shelf = Shelf()
    client = StockLine(SdoServer(shelf)).client
    client.download(*TEXT, content[:length], force_segment=True)
    with client.open(*TEXT, "rb", block_transfer=True) as stream:
        assert stream.read() == content[:length]


FATES = ("comes", "is lost", "comes twice", "comes late", "comes after the next")


class BadLine:
    """Carries requests and answers, each with a fate of its own; what comes late comes when both have given up."""

    def __init__(self, server: SdoServer, fates: Iterator[str]) -> None:
        self._server, self._fates = server, fates
        self.now = 0.0
        self._late: list[tuple[bool, bytes]] = []

    def run(self, transfer: Transfer) -> bytes:
        """Do a transfer to its end; late frames of earlier ones come in the midst of it."""
        waiting = deque((True, each) for each in transfer.start(self.now))
        waiting.extend(self._late)
        self._late = []
        for _ in range(MOST_FRAMES):
            if transfer.done:
                return transfer.result()
            if waiting:
                self._carry(transfer, waiting)
            else:
                self.now = min(transfer.deadline, self._server.deadline)
                waiting += ((True, each) for each in transfer.tick(self.now))
                waiting += ((False, each) for each in self._server.tick(self.now))
        raise AssertionError("no end")

    def _carry(self, transfer: Transfer, waiting: deque[tuple[bool, bytes]]) -> None:
        is_request, data = waiting.popleft()
        fate = next(self._fates, "comes")
        if fate == "comes late":
            self._late.append((is_request, data))
        elif fate == "comes after the next" and waiting and waiting[0][0] == is_request:
            waiting.insert(1, (is_request, data))
        elif fate != "is lost":
            for _ in range(1 + (fate == "comes twice")):
                if is_request:
                    waiting += ((False, each) for each in self._server.receive(data, self.now))
                elif not transfer.done:
                    waiting += ((True, each) for each in transfer.receive(data, self.now))


MOST_FRAMES = 5000

KINDS: dict[str, Callable[[bytes], Transfer]] = {
    "upload": lambda _: upload(TEXT, WAIT),
    "block upload": lambda _: block_upload(TEXT, WAIT),
    "download": lambda content: download(TEXT, content, WAIT),
    "block download": lambda content: block_download(TEXT, content, WAIT),
}


@pytest.mark.parametrize("kind", KINDS)
@given(
    content=st.binary(min_size=1, max_size=300),
    fates=st.lists(st.sampled_from((*FATES, *["comes"] * 8)), max_size=60),
    before=st.sampled_from(sorted(KINDS)),
)
def test_no_wrong_value_and_always_an_end_whatever_the_line_does(
    kind: str, content: bytes, fates: list[str], before: str
) -> None:
    """A transfer after another, so that late frames of the first come in the midst of the second."""
    shelf, old = Shelf(), b"what was there before"
    shelf.objects[TEXT] = old
    line = BadLine(SdoServer(shelf), iter(fates))
    for each in (before, kind):
        had = shelf.objects[TEXT]
        with suppress(TransferError):
            result = line.run(KINDS[each](content))
            assert result in ((had, shelf.objects[TEXT]) if "upload" in each else (b"",))
            assert "upload" in each or shelf.objects[TEXT] == content
        assert shelf.objects[TEXT] in (old, content)
