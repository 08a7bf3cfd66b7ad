"""Nodes in processes of their own on a bus of python-can-remote: what is noticed, and what comes back by itself."""

from __future__ import annotations

import pytest

from tests.processes import bus_server, free_port, node, shared

pytest.importorskip("can_remote")
pytestmark = pytest.mark.live


def test_a_bus_server_that_is_restarted_is_found_again() -> None:
    port = free_port()
    with bus_server(port) as first, node("drive", *shared(port)) as drive, node("core", *shared(port)) as core:
        first.kill()
        for each in (drive, core):
            assert each.line("bus failed").endswith("; it is opened again")
        with bus_server(port):
            for each in (drive, core):
                assert "after a gap of " in each.line("bus back")
            with node("navigation", *shared(port)), node("core", "--team", "red", *shared(port)) as another:
                another.line("start configuration confirmed after ")


def test_without_reconnection_a_lost_bus_ends_a_node_with_status_3() -> None:
    port = free_port()
    with bus_server(port) as server, node("drive", "--no-reconnect", *shared(port)) as drive:
        server.kill()
        assert drive.wait() == 3
        [line] = [line for line in drive.told() if line.startswith("eurobot-od: ")]
        assert line.startswith("eurobot-od: the bus Virtual bus channel shared on ws://127.0.0.1:")
