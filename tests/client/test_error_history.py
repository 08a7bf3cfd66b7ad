"""The errors a node remembers: read newest first, with the names of our codes and of CiA 301's classes."""

from __future__ import annotations

import pytest

from eurobot_od.client.streams import History, RememberedError, clear_history, read_history
from eurobot_od.errors import NodeRefused
from tests.client.peers import line, master_on, stock_lift


def test_errors_are_read_newest_first_and_cleared() -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        node.set_data(0x1003, 0, b"\2")
        node.set_data(0x1003, 1, bytes.fromhex("20820700"))
        node.set_data(0x1003, 2, (0xFF02).to_bytes(4, "little"))
        node.set_data(0x1001, 0, b"\x11")
        remote = master.node(2)
        found = read_history(remote)
        clear_history(remote)
        assert read_history(remote).entries == []
    assert found == History(0x11, [RememberedError(0x8220, 7), RememberedError(0xFF02, 0)])
    assert found.register_bits == ["generic error", "communication"]


def test_our_node_has_no_error_at_first_and_refuses_nonsense() -> None:
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        assert read_history(node) == History(0, [])
        with pytest.raises(NodeRefused):
            node.download((0x1003, 0), b"\1")
