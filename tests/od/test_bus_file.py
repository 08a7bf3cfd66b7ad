"""Networks of dcfgen and ros2_canopen: which nodes they have, and that these have what the master would write."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError, YamlError
from eurobot_od.od.bus_file import load_bus
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import load, not_understood, read_network
from eurobot_od.od.values import Address, Value

EDS = Path(__file__).parents[2] / "docs" / "servo.eds"

ROS = """\
options: {dcf_path: "@BUS_CONFIG_PATH@"}
master: {node_id: 1, driver: "ros2_canopen::MasterDriver", sync_period: 10000, heartbeat_producer: 100, baudrate: 500}
defaults:
  dcf: servo.eds
  sdo:
    - {index: 0x6081, sub_index: 0, value: 1000}
    - {index: 0x607C, value: -3}
    - {index: 0x6081, sub_index: 0, value: 1200}
  tpdo:
    1:
      enabled: true
      cob_id: auto
      transmission: 0x01
      mapping:
        - {index: 0x6041, sub_index: 0}
        - {index: 0x6064, sub_index: 0}
    2: {enabled: false, cob_id: 0x300}
  heartbeat_producer: 250
  remappings: none
nodes:
  left: {node_id: 2, namespace: /a}
  right: {node_id: 3}
"""

DCFGEN = """\
master: {node_id: 1}
.drive: &drive
  dcf: servo.eds
  heartbeat_producer: 250
left:
  <<: *drive
  node_id: 2
"""

WRITTEN: dict[Address, Value] = {
    (0x1017, 0): 250,
    (0x6081, 0): 1200,  # what is written later counts
    (0x607C, 0): -3,
    (0x1800, 1): 0x182,
    (0x1800, 2): 1,
    (0x1A00, 0): 2,
    (0x1A00, 1): 0x60410010,
    (0x1A00, 2): 0x60640020,
    (0x1801, 1): 0x80000300,
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the servo's EDS."""
    (tmp_path / "servo.eds").write_bytes(EDS.read_bytes())
    return tmp_path


def written(folder: Path, text: str) -> Path:
    file = folder / "bus.yml"
    file.write_text(text)
    return file


def test_the_nodes_have_what_the_master_would_write(folder: Path) -> None:
    network = read_network(written(folder, ROS))
    left, right = load(network.nodes)
    assert [(each.name, each.node_id) for each in (left, right)] == [("left", 2), ("right", 3)]
    assert (network.bit_rate, network.master) == (500, "master")
    assert {address: left.default(address) for address in WRITTEN} == WRITTEN
    assert right.default((0x1800, 1)) == 0x183
    [pdo] = [each for each in left.pdos if each.index == 0x1800]
    assert [each.name for each in pdo.mapping] == ["Statusword", "Position actual value"]


def test_entries_may_come_from_an_anchor(folder: Path) -> None:
    [left] = load(read_network(written(folder, DCFGEN)).nodes)
    assert (left.name, left.node_id, left.default((0x1017, 0))) == ("left", 2, 250)


def test_unknown_keys_are_named(folder: Path) -> None:
    file = written(folder, ROS)
    assert not_understood(file) == (f"{file}:19: remappings is not understood",)
    assert not_understood(EDS) == ()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("index: 0x607C", "index: 0x5FFF", "bus.yml:7: the file has no 0x5FFF:0"),
        (
            "{index: 0x6064,",
            "{index: 0x6063, sub_index: 7,",
            "0x6063:7 is not an object of servo.eds",
        ),
        ("  dcf: servo.eds\n", "", "left has no dcf"),
        ("node_id: 2", "node: 2", "left has no node_id"),
        ("  2: {enabled", "  1: {enabled", "key 1 is given twice"),
    ],
)
def test_errors_name_line_and_column(folder: Path, old: str, new: str, told: str) -> None:
    file = written(folder, ROS.replace(old, new).replace("sub_index: 7, sub_index: 0", "sub_index: 7"))
    with pytest.raises((DictionaryError, YamlError)) as error:
        load(read_network(file).nodes)
    assert told in str(error.value)


def test_a_pdo_beyond_the_fourth_gets_the_next_free_identifier(folder: Path) -> None:
    right = "right: {dcf: servo.eds, node_id: 3, rpdo: {5: {cob_id: auto}}}\n"
    text = f"{DCFGEN}  rpdo: {{5: {{cob_id: auto}}, 6: {{cob_id: auto}}}}\n{right}"
    bus = load_bus(written(folder, text))
    found = [each.value for name in ("left", "right") for each in bus.writes(name)[1] if each.address[0] >= 0x1400]
    assert [each for each in found if not each >> 31] == [0x680, 0x681, 0x682]


def test_a_node_watches_the_master_if_both_say_so(folder: Path) -> None:
    text = ROS.replace("  heartbeat_producer: 250", "  heartbeat_consumer: true")
    _, writes = load_bus(written(folder, text)).writes("left")
    has_it = 0x1016 in Dictionary.load(EDS, 2).members
    assert [each.value for each in writes if each.address[0] == 0x1016] == [1 << 16 | 300] * has_it


def test_a_nodelist_of_beremiz_names_eds_files_in_their_folder(folder: Path) -> None:
    (folder / "eds").mkdir()
    (folder / "servo.eds").rename(folder / "eds" / "servo.eds")
    file = folder / "nodelist.cpj"
    for entry in ("Node3DCFName=servo.eds", "Node3Name=servo"):
        file.write_text(f"[Topology]\nNodes=1\nEDSBaseName=eds\nNode3Present=1\n{entry}\n")
        assert [each.node_id for each in load(read_network(file).nodes)] == [3]
