"""`boot`: a master starts its slaves as CiA 302-2 says, and says why one is not there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

import pytest

from eurobot_od.client.boot import (
    BootedSlave,
    boot_slave,
    hear_slave,
    order_start,
    prepare_slave,
    start_slave,
    started_state,
)
from eurobot_od.client.description import described
from eurobot_od.client.master import RemoteNode
from eurobot_od.client.network import SimulatedNetwork
from eurobot_od.device.nmt import NmtState
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import HEARTBEAT_TIME
from tests.eds_text import record, variable

NOW = datetime(2026, 11, 1, 12)
TYPE = variable("1000", "Device type", "UNSIGNED32", "0x191")
NUMBERS = ((1, "Vendor-ID"), (2, "Product code"), (3, "Revision number"), (4, "Serial number"))
TEXT = (
    TYPE
    + record(0x1018, "Identity", (0, "UNSIGNED8", "4"), *((sub, "UNSIGNED32", f"0x1{sub}") for sub, _ in NUMBERS))
    + variable("1017", "Producer heartbeat time", "UNSIGNED16", "100")
    + record(0x1020, "Verify configuration", *((sub, "UNSIGNED32", "0") for sub in (1, 2)))
    + variable("2000", "Speed", "INTEGER16", "5")
)
LISTS = "[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
COMMISSIONED = "[DeviceComissioning]\nNodeID=5\nBaudrate=500\n"


@contextmanager
def slave(text: str = TEXT) -> Iterator[RemoteNode]:
    with SimulatedNetwork() as network:
        network.simulate(Dictionary.read(text.encode(), Path("a.eds"), 5))
        yield network[5]._node


def booted(text: str, wanted: str) -> BootedSlave:
    """Boot a slave of one file by another."""
    with slave(text) as node:
        return boot_slave(node, described(Dictionary.read(wanted.encode(), Path("a.dcf"), 5)), NOW)


def test_a_slave_that_is_as_its_eds_says_boots_and_starts() -> None:
    with slave() as node:
        dictionary = Dictionary.read(TEXT.encode(), Path("a.eds"), 5)
        found = boot_slave(node, described(dictionary), NOW)
        assert found.failed is None
        assert found.done == (
            "reset",
            "identity as in its file",
            "an EDS: its own configuration",
            "heartbeat every 100 ms",
        )
        assert start_slave(node, found, dictionary) is NmtState.OPERATIONAL


WITHOUT = TEXT.replace(variable("1017", "Producer heartbeat time", "UNSIGNED16", "100"), "")


def test_a_slave_without_heartbeat_and_guarding_says_no_state() -> None:
    with slave(WITHOUT) as node:
        dictionary = Dictionary.read(WITHOUT.encode(), Path("a.eds"), 5)
        found = boot_slave(node, described(dictionary), NOW)
        assert (found.failed, found.heartbeat) == (None, 0)
        assert start_slave(node, found, dictionary) is None


OFF = TEXT.replace("DefaultValue=100\n", "DefaultValue=0\n")


@pytest.mark.parametrize(
    ("access", "state"),
    [("rw", NmtState.OPERATIONAL), ("const", None)],  # a constant of 0 stays 0
)
def test_a_heartbeat_that_is_off_is_lent_to_see_the_state(access: str, state: NmtState | None) -> None:
    before, after = OFF.partition("[1017]")[::2]
    text = f"{before}[1017]{after.replace('AccessType=rw', f'AccessType={access}', 1)}"
    with slave(text) as node:
        dictionary = Dictionary.read(text.encode(), Path("a.eds"), 5)
        found = boot_slave(node, described(dictionary), NOW)
        assert (found.done[-1], found.heartbeat) == ("no heartbeat", 0)
        assert start_slave(node, found, dictionary) is state
        assert node.upload(HEARTBEAT_TIME) == bytes(2)


CONFIGURED = TEXT.replace("DefaultValue=5\n", "DefaultValue=5\nParameterValue=7\n") + LISTS + COMMISSIONED
STAMPED = CONFIGURED.replace("Entry 1\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\n",
    "Entry 1\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\nParameterValue=15\n").replace(
    "Entry 2\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\n",
    "Entry 2\nDataType=0x0007\nAccessType=rw\nPDOMapping=1\nDefaultValue=0\nParameterValue=16\n")  # fmt: skip


def test_a_dcf_is_loaded_into_a_slave_without_it() -> None:
    with slave() as node:
        found = boot_slave(node, described(Dictionary.read(CONFIGURED.encode(), Path("a.dcf"))), NOW)
        assert found.failed is None
        assert found.done[2] == "configured: 1 object changed"
        assert node.upload((0x2000, 0)) == b"\7\0"


def test_an_eds_that_is_commissioned_for_another_node_is_an_eds() -> None:
    """Editors leave the section in an EDS; without a ParameterValue there is nothing in it to load."""
    wanted = TEXT + LISTS + COMMISSIONED.replace("NodeID=5", "NodeID=9")
    assert booted(TEXT, wanted).done[2] == "no ParameterValue: its own configuration"


def test_a_slave_whose_0x1020_is_the_dcfs_is_not_configured_again() -> None:
    assert STAMPED.count("ParameterValue") == 3
    stamped = STAMPED.replace("ParameterValue=7\n", "").replace(COMMISSIONED, "").replace(LISTS, "")
    with slave(stamped) as node:
        found = boot_slave(node, described(Dictionary.read(STAMPED.encode(), Path("a.dcf"))), NOW)
        assert found.done[2] == "configured already (0x1020)"
        assert node.upload((0x2000, 0)) == b"\5\0"


UNFIT = [
    ("another device type", TEXT.replace("0x191", "0x192"), "error C: device type 0x00000191, its file has 0x00000192"),
    ("another vendor", TEXT.replace("0x11", "0x21"), "error D: vendor 0x00000011, its file has 0x00000021"),
    ("another product", TEXT.replace("0x12\n", "0x22\n"), "error M: product 0x00000012, its file has 0x00000022"),
    ("another revision", TEXT.replace("0x13", "0x23"), "error N: revision 0x00000013, its file has 0x00000023"),
    ("another serial number", TEXT.replace("0x14", "0x24"), "error O: serial 0x00000014, its file has 0x00000024"),
    (
        "a DCF for another node",
        CONFIGURED.replace("NodeID=5", "NodeID=9"),
        "error J: a.dcf: is for node 9, not for node 5",
    ),
]


@pytest.mark.parametrize(("wanted", "words"), [row[1:] for row in UNFIT], ids=[row[0] for row in UNFIT])
def test_a_slave_that_is_another_does_not_boot(wanted: str, words: str) -> None:
    assert str(booted(TEXT, wanted).failed) == words


def test_a_slave_that_is_not_there_does_not_boot() -> None:
    with slave() as node:
        absent = RemoteNode(node.master, 9)
        found = boot_slave(absent, described(Dictionary.read(TEXT.encode(), Path("a.eds"), 9)), NOW)
    assert str(found.failed).startswith("error B: ")
    assert found.done == ()


def test_many_slaves_are_waited_for_at_once() -> None:
    """The wait for heartbeats does not grow with the number of slaves, as it would one after the other."""
    dictionary = Dictionary.read(TEXT.encode(), Path("a.eds"), 5)
    with SimulatedNetwork() as network:
        for node_id in range(1, 31):
            network.simulate(Dictionary.read(TEXT.encode(), Path("a.eds"), node_id))
        nodes = [network[each]._node for each in range(1, 31)]
        clock = nodes[0].master.clock
        slaves = [prepare_slave(each, described(dictionary), NOW) for each in nodes]
        began = clock()
        assert not any(slave.failed for slave in map(hear_slave, nodes, slaves))
        assert [order_start(*each, dictionary) for each in zip(nodes, slaves)] == slaves
        states = {*map(started_state, nodes, slaves)}
        assert states == {NmtState.OPERATIONAL}
        assert clock() - began < 0.3  # each has a heartbeat in 100 ms
