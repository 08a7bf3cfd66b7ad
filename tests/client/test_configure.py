"""Mapping objects into a PDO of a node, and reading all of a node."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import astuple, replace
from datetime import datetime
from pathlib import Path

import pytest

from eurobot_od.client.configure import (
    PDO_RECORDS,
    Configured,
    ObjectReading,
    all_pdo_parameters,
    configure,
    dcf_of_node,
    difference,
    map_objects,
    mapping_entries,
    parameters,
    pdo_parameters,
    read_all,
    readable,
)
from eurobot_od.client.master import RemoteNode
from eurobot_od.client.network import SimulatedNetwork, simulated
from eurobot_od.client.remote_device import RemoteDevice
from eurobot_od.device.device import Device
from eurobot_od.errors import ConfigurationError, EurobotError, LocalError, NoAnswer
from eurobot_od.od import dcf
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import parse
from eurobot_od.od.editing import edited, said
from eurobot_od.od.objects import address_of, find_one
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import Address
from eurobot_od.pdo.in_force import made
from tests.client.peers import LIFT, line, master_on, new_channel, stock_lift
from tests.client.servo import EDS
from tests.client.wired import agree_on_parameters, started, wired
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


def same_pdos(node: RemoteNode, file: Dictionary) -> bool:
    """Return whether a node's PDOs are the same read without its file, but for their names."""
    asked = [each for each in PDO_RECORDS if each & 0xFF < 0x20]  # a sample, for the test's sake: none has more
    found, known = made(node.node_id, all_pdo_parameters(node, asked)), file.configured(pdo_parameters(node, file))
    read = [pdo for each in found for pdo in each.pdos]
    told = ([(*astuple(replace(p, mapping=(), name="")), *mapping_of(p)) for p in each] for each in (read, known.pdos))
    return next(told) == next(told) != []


def mapping_of(pdo: Pdo) -> list[tuple[Address, int]]:
    return [(each.address, each.bits) for each in pdo.mapping]


def test_pdos_are_read_without_a_file_as_with_one() -> None:
    with SimulatedNetwork() as network:
        network.simulate(Dictionary.load("docs/servo.eds", 7))
        assert same_pdos(network[7]._node, Dictionary.load("docs/servo.eds", 7))
    with stock_lift(LIFT) as (channel, _), master_on(channel) as master:  # canopen's own server
        assert same_pdos(master.node(2), Dictionary.load(LIFT, 2))


def test_a_pdo_behind_a_gap_is_read() -> None:
    lone = pdo(0x1850, "0x20000010", cob_id="0x385")
    text = DEVICE_TYPE + variable("2000", "Speed", "INTEGER16", "0") + lone
    with SimulatedNetwork() as network:
        network.simulate(Dictionary.read(text.encode(), Path("a.eds"), 5))
        found = all_pdo_parameters(network[5]._node, range(0x1840, 0x1860))
    assert found[0x1A50, 1] == 0x20000010


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
def test_unmappable_objects_are_refused_before_any_write(names: list[str], words: str) -> None:
    with pytest.raises(LocalError) as error:
        mapping_entries(TPDO, [find_one(each, DICTIONARY.objects) for each in names])
    assert str(error.value) == words


# Reading all of a node: what it refuses is reported and left out, and its DCF makes another node like it.


DRIVE_FILE = Dictionary.load(LIFT)
WRITTEN = {(0x1017, 0): b"\xf4\x01", (0x2101, 1): b"\x84\x03"}


def test_everything_that_can_be_read_is_read() -> None:
    with line("lift") as channel, master_on(channel) as master:
        readings = {address_of(each.thing): each for each in read_all(master.node(2), readable(DRIVE_FILE))}
    assert readings[0x1008, 0].value == "Packaging line lift"
    assert readings[0x1403, 1].value == 0x281
    assert readings[0x1003, 1] == ObjectReading(readings[0x1003, 1].thing, None, "No data available")
    assert (0x1021, 0) not in readings  # the EDS itself is not a value to look at


def test_parameters_are_what_can_be_set_and_is_no_process_data() -> None:
    addresses = {address_of(thing) for thing in parameters(DRIVE_FILE)}
    assert {(0x1017, 0), (0x1403, 1), (0x1603, 0), (0x2101, 1)} <= addresses
    assert not {(0x1018, 1), (0x1010, 1), (0x1003, 0), (0x1020, 1), (0x2000, 1)} & addresses


def test_the_dcf_of_one_drive_makes_another_like_it(tmp_path: Path) -> None:
    file = tmp_path / "lift.dcf"
    with line("lift") as channel, master_on(channel) as master:
        for address, data in WRITTEN.items():
            master.node(2).download(address, data)
        made, left_out, _ = dcf_of_node(master.node(2), DRIVE_FILE, 500, "lift")
    assert (left_out, made.files) == ([], {})
    assert dcf.missing(parse(made.content.decode())) == []
    file.write_bytes(made.content)
    with line("lift") as channel, master_on(channel) as master:
        node = master.node(2)
        assert {
            address_of(each.thing): each.after for each in difference(node, Dictionary.load(file)).changes
        } == WRITTEN
        configure(node, Dictionary.load(file), datetime(2014, 5, 28))
        assert [node.upload(address) for address in WRITTEN] == [*WRITTEN.values()]


LEVEL: Address = (0x2000, 0)
BEYOND = DEVICE_TYPE + variable("2000", "Level", "INTEGER16", "0", "LowLimit=1\nHighLimit=9\n")


@pytest.mark.parametrize(
    ("has", "says", "told"),
    [
        (0, 0, ""),  # the default, which is beyond the limits: it needs no write
        (12, 12, ""),
        (12, 9, "changed"),
        (0, 12, "12 is not allowed; allowed: 1..9"),
        (5, 0, "refused to write"),  # the device, not the file: what the maker calls the default may be written
    ],
)
def test_a_value_beyond_its_limits_is_refused_only_where_it_would_be_new(
    tmp_path: Path, has: int, says: int, told: str
) -> None:
    dictionary = Dictionary.read(BEYOND.encode(), Path("a.eds"), 5)
    nodes = []
    for value in (says, has):
        device = Device(dictionary)
        device.objects.values = {LEVEL: value}
        nodes.append(wired(started(device)).node(5))
    file = tmp_path / "a.dcf"
    file.write_bytes(dcf_of_node(nodes[0], dictionary, 500, "a").dcf.content)
    try:
        said = "changed" if configure(nodes[1], Dictionary.load(file), datetime(2014, 5, 28)).changed else ""
    except EurobotError as error:
        said = str(error)
    assert (told in said, bool(said)) == (True, bool(told))


def test_refused_objects_are_left_out_and_reported() -> None:
    with stock_lift() as (channel, node), master_on(channel) as master:
        del node.object_dictionary[0x2101]
        made, left_out, _ = dcf_of_node(master.node(2), DRIVE_FILE, 500, "lift")
    assert {address_of(each.thing)[0] for each in left_out} == {0x2101}
    assert {each.refusal for each in left_out} == {"Object does not exist"}
    assert b"ParameterValue=1000" in made.content


def test_a_node_that_does_not_answer_ends_the_reading() -> None:
    with master_on(new_channel(), 0.01) as master, pytest.raises(NoAnswer):
        dcf_of_node(master.node(2), DRIVE_FILE, 500, "lift")


# Settings, although they can be mapped

SETTINGS: dict[Address, int] = {
    (0x6065, 0): 3000,
    (0x6067, 0): 44,
    (0x607C, 0): -1200,
    (0x607D, 1): -90000,
    (0x607D, 2): 91000,
    (0x6081, 0): 1200,
    (0x6083, 0): 7100,
    (0x6084, 0): 7200,
    (0x6098, 0): 35,
    (0x6099, 1): 321,
}


def test_a_drive_is_cloned_to_the_byte_whatever_of_it_can_be_mapped(tmp_path: Path) -> None:
    text = EDS.read_text().replace("PDOMapping=0", "PDOMapping=1")
    eds, made = tmp_path / "lift.eds", tmp_path / "clone.dcf"
    eds.write_text(text, encoding="ascii")
    dictionary = Dictionary.load(eds, 5)
    assert all(dictionary.objects.get_variable(*each).pdo_mappable for each in SETTINGS)  # type: ignore[union-attr]
    with simulated(eds, node_id=5) as first:
        for address, value in SETTINGS.items():
            first[5][address].value = value
        first[5][0x6040].value = 0
        dcf, left_out, _ = dcf_of_node(first[5]._node, dictionary, 500, "clone")
        made.write_bytes(dcf.content)
        wanted = [each.value for each in read_all(first[5]._node, parameters(dictionary))]
    assert left_out == []
    with simulated(eds, node_id=5) as second:
        assert second[5].configure(made) == Configured(len(SETTINGS), stored=True, verified=True)
        second[5]._node.reset()
        assert [each.value for each in read_all(second[5]._node, parameters(dictionary))] == wanted
        assert {address: second[5][address].raw for address in SETTINGS} == SETTINGS


def test_a_mark_that_is_read_only_is_left_out_and_the_rest_is_verified(tmp_path: Path) -> None:
    eds, made = tmp_path / "lift.eds", tmp_path / "ours.dcf"
    read_only = [said(f"1020:{sub}", {"AccessType": "ro"}) for sub in (1, 2)]
    eds.write_bytes(edited(EDS.read_bytes(), "servo.eds", read_only))
    dictionary = Dictionary.load(eds, 5)
    made.write_bytes(dcf.with_contents(dictionary, {(0x1017, 0): b"\xfa\0"}, 5, "ours", 500, "ours").content)
    with simulated(eds, node_id=5) as network:
        plan = difference(network[5]._node, Dictionary.load(made))
        assert plan.cannot_be_marked
        assert network[5].configure(made).changed == 1
        assert network[5][0x1017].raw == 250


DRIVE_402 = DEVICE_TYPE.replace("DefaultValue=0", "DefaultValue=0x20192")
MODULE_401 = DEVICE_TYPE.replace("DefaultValue=0", "DefaultValue=0x30191")
RPDO = pdo(0x1400, "0x20000008", cob_id="0x205")
TPDO_OF_2000 = pdo(0x1800, "0x20000008", cob_id="0x185")
OFF = pdo(0x1400, "0x20000008", cob_id="0x80000205")


@pytest.mark.parametrize(
    ("head", "index", "access", "is_one"),
    [
        (DRIVE_402, "6081", "rw", True),  # a profile velocity, which many drives let map
        (DRIVE_402, "6081", "rww", True),
        (DRIVE_402, "6881", "rww", True),  # ... of the second axis
        (DRIVE_402, "6040", "rww", False),  # a controlword
        (DRIVE_402, "6840", "rww", False),
        (DRIVE_402, "607A", "rw", False),  # a target
        (DRIVE_402, "6064", "rw", False),  # an actual value
        (DEVICE_TYPE, "6040", "rww", True),  # not a drive: anything may be there
        (MODULE_401, "6200", "rww", True),  # sub-index 0 is a count, not an output
        (DEVICE_TYPE, "2000", "rww", True),  # nothing maps it
        (DEVICE_TYPE + RPDO, "2000", "rw", False),
        (DEVICE_TYPE + RPDO, "2000", "rww", False),
        (DEVICE_TYPE + OFF, "2000", "rww", True),  # the mapping is not in force
        (DEVICE_TYPE + TPDO_OF_2000, "2000", "rw", True),  # a setting that the device also sends
        (DEVICE_TYPE + TPDO_OF_2000, "2000", "rwr", False),
        (DEVICE_TYPE, "2000", "ro", False),
    ],
)
def test_a_setting_is_one_unless_its_profile_or_a_mapping_in_force_says_otherwise(
    head: str, index: str, access: str, is_one: bool
) -> None:
    text = head + variable(index, "Value", "UNSIGNED8", "1").replace("AccessType=rw", f"AccessType={access}")
    assert ((int(index, 16), 0) in Dictionary.read(text.encode(), Path("a.eds"), 5).parameters) is is_one


def test_objects_mapped_by_a_master_become_process_data() -> None:
    eds = DEVICE_TYPE + RPDO + variable("2000", "One", "UNSIGNED8", "1") + variable("2001", "Two", "UNSIGNED8", "1")
    dictionary = Dictionary.read(eds.encode(), Path("a.eds"), 5)
    changed = dictionary.configured({(0x1600, 1): 0x20010008})
    assert [{*each.parameters.process_data} for each in (dictionary, changed)] == [{(0x2000, 0)}, {(0x2001, 0)}]


@pytest.mark.parametrize("file", sorted(EDS.parent.glob("*.eds")), ids=lambda file: file.stem)
def test_a_device_stores_what_a_dcf_of_it_has(file: Path) -> None:
    agree_on_parameters(Dictionary.load(file, 5))
