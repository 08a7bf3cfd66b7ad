"""The scan lists who is there: by an answer or a heartbeat, and never for a frame that only looks like one."""

from __future__ import annotations

from functools import partial

import can
import pytest

from eurobot_od.client.description import Found, scan
from eurobot_od.device.nmt import NmtState
from eurobot_od.od.identity import Identity
from eurobot_od.sdo.wire import ABORT, ClientCommand
from tests.client.peers import line, master_on, new_channel, open_bus, peer, stock_lift

quick_scan = partial(scan, pace=0.0005, listen=0.1)
"""Enough for nodes of this process."""


def test_our_three_nodes_are_found_with_their_names_and_nothing_else() -> None:
    with line("panel", "lift", "scale") as channel, master_on(channel, 0.3) as master:
        found = quick_scan(master)
    assert [(each.node_id, each.name) for each in found] == [
        (1, "Packaging line panel"),
        (2, "Packaging line lift"),
        (3, "Packaging line scale"),
    ]
    assert [each.identity for each in found] == [Identity(0, number, 0x10000, 1) for number in (1, 2, 3)]


def test_own_identifiers_of_a_protocol_are_no_node() -> None:
    channel = new_channel()
    with master_on(channel, 0.3) as master, open_bus(channel) as robot_bus:
        for cob_id in (0x0C0, 0x1C0, 0x2C0, 0x3C0, 0x080, 0x100):  # what services of node 64 would have
            robot_bus.send(can.Message(arbitration_id=cob_id, data=b"\0", is_extended_id=False))
        assert quick_scan(master) == []


def test_a_node_that_only_sends_heartbeats_is_found() -> None:
    channel = new_channel()
    with master_on(channel, 0.05) as master, open_bus(channel) as silent:
        silent.send(can.Message(arbitration_id=0x709, data=b"\x04", is_extended_id=False))
        assert quick_scan(master) == [Found(9, NmtState.STOPPED, None, "")]


def test_stock_canopen_is_found() -> None:
    with stock_lift() as (channel, _), master_on(channel, 0.3) as master:
        assert [(each.node_id, each.name) for each in quick_scan(master)] == [(2, "Packaging line lift")]


@pytest.mark.parametrize(
    ("answer", "there"),
    [
        ("4300100000000000", True),  # the device type
        ("8000100000000206", True),  # an abort is an answer, too
        ("4318100100000000", False),  # an answer to somebody else's question
        ("43001000", False),  # too short
        ("2300100000000000", False),  # another service
    ],
)
def test_an_answer_is_what_an_sdo_server_says_to_our_request(answer: str, there: bool) -> None:
    with peer(lambda _: [bytes.fromhex(answer)], 5) as channel, master_on(channel, 0.05) as master:
        assert [each.node_id for each in quick_scan(master)] == ([5] if there else [])


def test_only_the_wanted_node_ids_are_listed() -> None:
    with line("panel", "lift") as channel, master_on(channel, 0.3) as master:
        assert [each.node_id for each in quick_scan(master, [2, 5])] == [2]


@pytest.mark.parametrize(("address", "most"), [((0x1008, 0), 1024), ((0x1018, 1), 4)])
def test_a_node_that_never_ends_an_upload_does_not_hold_the_scan(address: tuple[int, int], most: int) -> None:
    asked = [0]

    def answers(request: bytes) -> list[bytes]:
        index = request[1:4]
        if request[0] >> 5 == ClientCommand.UPLOAD and index == address[0].to_bytes(2, "little") + bytes([address[1]]):
            return [b"\x40" + index + bytes(4)]
        if request[0] >> 5 == ClientCommand.UPLOAD_SEGMENT:
            asked[0] += 1
            return [bytes([request[0] & 0x10]) + b"endless"]
        return [] if request[0] == ABORT else [b"\x43" + index + bytes(4)]

    with peer(answers, 5) as channel, master_on(channel, 0.3) as master:
        assert [each.node_id for each in quick_scan(master)] == [5]
    assert asked[0] <= most / 7 + 2
