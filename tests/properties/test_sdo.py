"""SDO transfers of any content, in any form, over a line that loses segments; and any bytes at all as requests."""

from __future__ import annotations

import random
from typing import Any

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.sdo.server import LENGTH, SEGMENT_SIZE, SdoServer
from tests.device.shelf import TEXT, Shelf

contents = st.binary(max_size=2000)


class Line:
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
    client = Line(SdoServer(shelf)).client
    if blocks_in and content:
        with client.open(*TEXT, "wb", size=len(content), block_transfer=True) as stream:
            stream.write(content)
    else:
        client.download(*TEXT, content, force_segment=True)
    assert shelf.objects[TEXT] == content
    with client.open(*TEXT, "rb", block_transfer=blocks_out) as stream:
        assert stream.read() == content


@given(contents, st.integers(1, 127), st.floats(0.0, 0.5), st.randoms(use_true_random=False))
def test_a_block_upload_arrives_whole_whatever_is_lost(
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
    client = Line(SdoServer(shelf)).client
    client.download(*TEXT, content[:length], force_segment=True)
    with client.open(*TEXT, "rb", block_transfer=True) as stream:
        assert stream.read() == content[:length]
