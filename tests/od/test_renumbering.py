"""A DCF for another node of its kind: what moves along with the node-ID, and what somebody has to decide."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.renumbering import ChosenCobIds, chosen_cob_ids, renumbered
from eurobot_od.od.values import Address
from tests.eds_text import DEVICE_TYPE, pdo, record, variable

SDO = record(0x1200, "SDO server", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", None), (2, "UNSIGNED32", None))
EDS = (
    "[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
    + DEVICE_TYPE
    + variable("1005", "COB-ID SYNC", "UNSIGNED32", "0x80")
    + variable("1014", "COB-ID EMCY", "UNSIGNED32", "$NODEID+0x80")
    + variable("2000", "Node-ID", "UNSIGNED8", "0xFF")
    + variable("2001", "Base", "UNSIGNED16", "$NODEID+0x10")
    + variable("2002", "Speed", "INTEGER16", "7")
    + SDO
    + pdo(0x1400, "0x20020010", cob_id="$NODEID+0x200")
    + pdo(0x1800, "0x20020010", cob_id="$NODEID+0x40000180")
    + pdo(0x1801, "0x20020010", cob_id="0x80000000")
    + pdo(0x1804, "0x20020010", cob_id="0x391")
)


def of_node(values: dict[Address, int], node_id: int = 5) -> Dictionary:
    """A DCF with these values as plain numbers, as other tools write them."""
    text = EDS
    for (index, sub), value in values.items():
        section = f"[{index:04X}]\n" if index < 0x1200 or index >= 0x2000 else f"[{index:04X}sub{sub:X}]\n"
        assert section in text
        text = text.replace(section, f"{section}ParameterValue=0x{value:X}\n")
    commissioning = f"[DeviceComissioning]\nNodeID={node_id}\nNodeName=five\nBaudrate=500\n"
    return Dictionary.read((text + commissioning).encode(), Path("five.dcf"), node_id)


EMCY, NODE_ID, BASE, SPEED = (0x1014, 0), (0x2000, 0), (0x2001, 0), (0x2002, 0)
RPDO1, TPDO1, TPDO2, TPDO5 = (0x1400, 1), (0x1800, 1), (0x1801, 1), (0x1804, 1)
REQUESTS, ANSWERS, SYNC = (0x1200, 1), (0x1200, 2), (0x1005, 0)

# An object, its value in node 5, and what node 6 gets.
FOLLOWS = [
    (EMCY, 0x85, 0x86),
    (RPDO1, 0x205, 0x206),
    (RPDO1, 0x80000205, 0x80000206),  # switched off
    (TPDO1, 0x40000185, 0x40000186),
    (TPDO1, 0x185, 0x186),  # remote frames allowed: a bit besides the identifier
    (TPDO2, 0x285, 0x286),  # the file has no default with $NODEID, the pre-defined connection set has
    (REQUESTS, 0x605, 0x606),
    (ANSWERS, 0x585, 0x586),
    (BASE, 0x15, 0x16),  # no COB-ID, but its default follows
    (NODE_ID, 5, 6),  # the device's own setting
    (BASE, 0x17, 0x17),  # a value that somebody chose, of no service
    (SPEED, 0x185, 0x185),  # a number that only looks like one
    (SYNC, 0x85, 0x85),  # what all nodes share
    (TPDO5, 0x391, 0x391),  # as in all devices of the kind
    (TPDO1, 0x80000391, 0x80000391),  # switched off: nobody is in its way
]


@pytest.mark.parametrize(("address", "value", "moved"), FOLLOWS)
def test_values_that_depend_on_the_node_id_are_renumbered(address: Address, value: int, moved: int) -> None:
    found = renumbered(of_node({address: value}), 6)
    assert (found.default(address), found.node_id, found.device.commissioned_node_id) == (moved, 6, 6)
    assert chosen_cob_ids(of_node({address: value}).device, 5) == []


# A COB-ID of node 5 that somebody chose, and what node 6 gets if it moves.
CHOSEN = [(EMCY, 0x123, 0x124), (TPDO1, 0x391, 0x392), (RPDO1, 0x181, 0x182), (REQUESTS, 0x640, 0x641)]


@pytest.mark.parametrize(("address", "value", "moved"), CHOSEN)
def test_a_cob_id_that_somebody_chose_needs_a_decision(address: Address, value: int, moved: int) -> None:
    given = of_node({address: value})
    with pytest.raises(DictionaryError, match=f"^five.dcf: is of node 5; .* 0x{address[0]:04X}:{address[1]} .* 0x"):
        renumbered(given, 6)
    assert renumbered(given, 6, ChosenCobIds.KEEP).default(address) == value
    assert renumbered(given, 6, ChosenCobIds.MOVE).default(address) == moved


def test_all_cob_ids_that_need_a_decision_are_named_together() -> None:
    with pytest.raises(DictionaryError) as asked:
        renumbered(of_node({EMCY: 0x123, TPDO1: 0x391}), 7)
    assert "0x1014:0 EMCY 0x123, 0x1800:1 TPDO1 0x391; for node 7 keep" in str(asked.value)
    assert "move them by 2 (--move-cob-ids)" in str(asked.value)


def test_a_cob_id_that_would_be_none_is_not_moved() -> None:
    with pytest.raises(DictionaryError, match="0x1014:0: 0x7FF cannot be moved by 1"):
        renumbered(of_node({EMCY: 0x7FF}), 6, ChosenCobIds.MOVE)


@pytest.mark.parametrize("node_id", [5, None])
def test_a_nodes_own_dcf_and_an_eds_stay_as_they_are(node_id: int | None) -> None:
    given = of_node({TPDO1: 0x391}) if node_id else Dictionary.read(EDS.encode(), Path("a.eds"), 5)
    assert renumbered(given, node_id or 6) is given


def test_what_a_dcf_is_written_with_follows_the_node_id() -> None:
    eds = Dictionary.read(EDS.encode(), Path("a.eds"), 5)
    contents = {EMCY: 0x85, TPDO1: 0x391, TPDO2: 0x285, NODE_ID: 5, SPEED: 9}
    text = dcf.with_values(eds.device, dict(contents), 5, "five", 500)
    said = [line.partition("=")[2] for line in text.splitlines() if line.startswith("ParameterValue")]
    assert said == ["$NODEID+0x80", "$NODEID+0x0", "9", "0x00000391", "$NODEID+0x280"]
    read = Dictionary.read(text.encode(), Path("a.dcf"))
    assert {address: read.default(address) for address in contents} == contents
