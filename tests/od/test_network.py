"""Which devices there are: files, folders, network files; every device with a node-ID and a name of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError, FileError
from eurobot_od.od.network import load, node_file, read_network
from eurobot_od.od.network_file import NodeFile
from tests.eds_text import DEVICE_TYPE

ROOT = Path(__file__).parents[2]
COMMISSIONED = "[DeviceComissioning]\nNodeID={}\n"
NODELIST = r"""[Topology]
NetName=arm
Nodes=0x03
Node3Present=0x01
Node3Name=motor
Node3DCFName=dcf\motor.dcf
Node10Present=0x01
Node10DCFName=dcf/panel.dcf
Node11Present=0x00
"""

FILES = [
    ("motor.eds", NodeFile("motor.eds")),
    ("5=motor.eds", NodeFile("motor.eds", 5)),
    ("0x7F=motor.eds", NodeFile("motor.eds", 127)),
    ("a=b.eds", NodeFile("a=b.eds")),  # a file may be called so
    ("5=a=b.eds", NodeFile("a=b.eds", 5)),
]


@pytest.mark.parametrize(("text", "expected"), FILES)
def test_a_file_may_have_its_node_id_before_it(text: str, expected: NodeFile) -> None:
    assert node_file(text) == expected


@pytest.mark.parametrize("number", ["0", "128", "-1", "0x80"])
def test_a_node_id_that_cannot_be_is_told(number: str) -> None:
    with pytest.raises(DictionaryError, match=rf"motor\.eds: node-ID {number} is not in 1\.\.127"):
        node_file(f"{number}=motor.eds")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two DCFs in a folder of their own, and network files beside it."""
    (tmp_path / "dcf").mkdir()
    for name, node_id in (("motor", 3), ("panel", 10)):
        (tmp_path / "dcf" / f"{name}.dcf").write_text(DEVICE_TYPE + COMMISSIONED.format(node_id))
    (tmp_path / "nodelist.cpj").write_text(NODELIST)
    (tmp_path / "network.yaml").write_text("nodes:\n  motor: {file: dcf/motor.dcf}\n  panel: {file: dcf/panel.dcf}\n")
    return tmp_path


@pytest.mark.parametrize("path", ["dcf", "nodelist.cpj", "network.yaml"])
def test_every_form_names_the_same_devices(folder: Path, path: str) -> None:
    found = load(read_network(folder / path).nodes)
    assert [(each.node_id, each.name) for each in found] == [(3, "motor"), (10, "panel")]


def test_a_nodelist_gives_the_names_that_it_has(folder: Path) -> None:
    nodes = read_network(folder / "nodelist.cpj").nodes
    assert [(Path(each.file).name, each.node_id, each.name) for each in nodes] == [
        ("motor.dcf", 3, "motor"),
        ("panel.dcf", 10, ""),
    ]


def test_a_network_file_gives_names_and_node_ids(folder: Path) -> None:
    (folder / "plain.eds").write_text(DEVICE_TYPE)
    (folder / "network.yaml").write_text(
        "nodes:\n  left: {file: plain.eds, node_id: 7}\n  off: {file: plain.eds, node_id: 8}"
    )
    found = load(read_network(folder / "network.yaml").nodes)
    assert [(each.node_id, each.name) for each in found] == [(7, "left"), (8, "off")]


def test_a_dcf_counts_before_the_eds_of_its_name(folder: Path) -> None:
    (folder / "dcf" / "motor.eds").write_text(DEVICE_TYPE)
    assert [Path(each.file).name for each in read_network(folder / "dcf").nodes] == ["motor.dcf", "panel.dcf"]


def test_devices_of_one_name_are_told_apart_by_node_id(folder: Path) -> None:
    file = str(folder / "dcf" / "motor.dcf")
    found = load([NodeFile(file, 9), NodeFile(file), NodeFile(file, 5, "arm")])
    assert [each.name for each in found] == ["motor_3", "arm", "motor_9"]


def test_two_files_with_one_node_id_are_refused(spoil_eds: Callable[..., Path]) -> None:
    nodes = read_network(spoil_eds(("navigation", "2100sub1", "DefaultValue", "2"))).nodes
    with pytest.raises(DictionaryError, match="node-ID 2 is taken by drive"):
        load(nodes)


def test_a_bare_eds_asks_for_its_node_id(tmp_path: Path) -> None:
    (tmp_path / "motor.eds").write_text(DEVICE_TYPE)
    with pytest.raises(DictionaryError, match=r"motor\.eds: the file names no node-ID; give one, as in 5=motor\.eds$"):
        load([NodeFile(str(tmp_path / "motor.eds"))])


# A file's name, its text, and what is said.
WRONG = [
    ("nodelist.cpj", "[Other]\n", " not a nodelist: it has no [Topology]"),
    ("nodelist.cpj", "[Topology]\nNode4Present=1\n", " line 1: node 4 has no Node4DCFName"),
    ("network.yaml", "nodes: {}\n", " it names no nodes"),
    ("network.yaml", "nodes:\n  a: {}\n", "2:6: key 'file' is missing"),
    ("network.toml", "", " not a network: neither a folder nor one of .yaml, .yml, .cpj"),
]


@pytest.mark.parametrize(("name", "text", "what"), WRONG)
def test_what_is_no_network_is_told_in_one_line(tmp_path: Path, name: str, text: str, what: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError) as error:
        read_network(tmp_path / name)
    assert str(error.value) == f"{tmp_path / name}:{what}"


def test_an_empty_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(DictionaryError, match="no EDS, DCF, XDD or XDC in this folder"):
        read_network(tmp_path)
