"""Mapping objects into a PDO of a node: in CiA 301's order, read back, and what cannot be mapped is refused here."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od.client.configure import map_objects, mapping_entries
from eurobot_od.client.network import SimulatedNetwork
from eurobot_od.client.remote_device import RemoteDevice
from eurobot_od.client.remote_pdos import pdo_parameters
from eurobot_od.errors import ConfigurationError, LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import find_one
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import Address
from tests.eds_text import DEVICE_TYPE, pdo, variable

TEXT = (
    DEVICE_TYPE
    + variable("2000", "Speed", "INTEGER16", "0")
    + variable("2001", "Current", "UNSIGNED16", "0")
    + variable("2002", "Energy", "UNSIGNED64", "0")
    + variable("2003", "Name", "VISIBLE_STRING", "x")
    + variable("2004", "Mode", "UNSIGNED8", "0").replace("AccessType=rw", "AccessType=rww")
    + variable("2005", "Hidden", "UNSIGNED8", "0").replace("PDOMapping=1", "PDOMapping=0")
    + pdo(0x1800, "0x20000010", "0", "0", settings={2: "255"}).replace("DefaultValue=3", "DefaultValue=1")
)
DICTIONARY = Dictionary.read(TEXT.encode(), Path("a.eds"), 5)
(TPDO,) = DICTIONARY.pdos


@pytest.fixture
def node() -> Iterator[RemoteDevice]:
    with SimulatedNetwork() as network:
        network.simulate(DICTIONARY)
        yield network[5]


def mapped(node: RemoteDevice) -> Pdo:
    (found,) = DICTIONARY.configured(pdo_parameters(node._node, DICTIONARY)).pdos
    return found


@pytest.mark.parametrize("names", [["Current"], ["Current", "Speed"], ["Speed", "Current", "Speed"], ["Energy"]])
def test_objects_are_mapped_in_their_order(node: RemoteDevice, names: list[str]) -> None:
    map_objects(node._node, DICTIONARY, TPDO, [find_one(each, DICTIONARY.objects) for each in names])
    found = mapped(node)
    assert [each.name for each in found.mapping] == names
    assert (found.cob_id, found.valid) == (0x185, True)


def test_a_pdo_that_is_off_stays_off(node: RemoteDevice) -> None:
    node._node.download((0x1800, 1), (0x80000185).to_bytes(4, "little"))
    map_objects(node._node, DICTIONARY, TPDO, [find_one("Current", DICTIONARY.objects)])
    assert (mapped(node).valid, [each.name for each in mapped(node).mapping]) == (False, ["Current"])


def test_a_node_that_keeps_another_mapping_is_told(node: RemoteDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    upload = node._node.upload

    class Forgetful:
        async def steps(self, address: Address, *_: object) -> bytes:
            return b"\0\0\0\0" if address == (0x1A00, 1) else upload(address)

    monkeypatch.setattr(node._node, "upload", Forgetful())
    with pytest.raises(ConfigurationError, match="0x1A00:1 is 0x00000000, not 0x20010010"):
        map_objects(node._node, DICTIONARY, TPDO, [find_one("Current", DICTIONARY.objects)])


UNFIT = [
    (["Name"], "0x2003:0 Name cannot be mapped: its file says so"),
    (["Hidden"], "0x2005:0 Hidden cannot be mapped: its file says so"),
    (["Mode"], "0x2004:0 Mode is rww, which a TPDO cannot carry"),
    (["Energy", "Speed"], "80 bits are mapped, a PDO has at most 64"),
]


@pytest.mark.parametrize(("names", "words"), UNFIT)
def test_what_cannot_be_mapped_is_refused_before_anything_is_written(names: list[str], words: str) -> None:
    with pytest.raises(LocalError) as error:
        mapping_entries(TPDO, [find_one(each, DICTIONARY.objects) for each in names])
    assert str(error.value) == words
