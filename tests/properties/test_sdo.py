"""SDO transfers of any content, in any form, over a line that loses segments; any bytes as requests and as answers."""

from __future__ import annotations

import random
from collections.abc import Callable
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
def test_what_stock_canopen_writes_it_reads_again(content: bytes, blocks_in: bool, blocks_out: bool) -> None:
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
def test_what_our_client_writes_to_stock_canopen_it_reads_again(content: bytes) -> None:
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
def test_what_our_client_writes_it_reads_again(content: bytes, blocks_in: bool, blocks_out: bool, size: int) -> None:
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
