"""Which devices there are: files, folders, network files; every device with a node-ID and a name of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError, FileError, YamlError
from eurobot_od.od.maker import read_error_words
from eurobot_od.od.network import NetworkBus, NodeFile, load, node_file, read_network, read_network_file, with_bus
from tests.eds_text import DEVICE_TYPE
from tests.kit import lift

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


@pytest.mark.parametrize("slash", ["/", "\\"])
def test_a_nodelist_names_the_folder_of_all_eds_files(folder: Path, slash: str) -> None:
    (folder / "nodelist.cpj").write_text(
        f"[Topology]\nEDSBaseName=all{slash}eds\nNode3Name=motor\nNode4DCFName=arm.eds\nNode10DCFName=dcf{slash}panel.dcf\n"
    )
    nodes = read_network(folder / "nodelist.cpj").nodes
    assert [(each.node_id, Path(each.file)) for each in nodes] == [
        (3, folder / "all" / "eds" / "motor.eds"),
        (4, folder / "all" / "eds" / "arm.eds"),
        (10, folder / "dcf" / "panel.dcf"),
    ]


def test_files_of_a_network_are_beside_it(folder: Path) -> None:
    (folder / "network.yaml").write_text("nodes:\n  a: {file: dcf/motor.dcf, patch: [own/a.yaml, /b.yaml]}\n")
    (node,) = read_network(folder / "network.yaml").nodes
    assert node.file == str(folder / "dcf" / "motor.dcf")
    assert list(node.patch) == [str(folder / "own" / "a.yaml"), str(Path("/b.yaml"))]


@pytest.mark.parametrize("bit_rate", [1, 1000])
def test_a_network_file_gives_names_node_ids_and_the_bit_rate(folder: Path, bit_rate: int) -> None:
    (folder / "plain.eds").write_text(DEVICE_TYPE)
    (folder / "network.yaml").write_text(
        f"bit_rate: {bit_rate}\nnodes:\n  left: {{file: plain.eds, node_id: 7}}\n  off: {{file: plain.eds, node_id: 8}}"
    )
    network = read_network(folder / "network.yaml")
    assert network.bit_rate == bit_rate
    found = load(network.nodes)
    assert [(each.node_id, each.name) for each in found] == [(7, "left"), (8, "off")]


def test_a_dcf_counts_before_the_eds_of_its_name(folder: Path) -> None:
    (folder / "dcf" / "motor.eds").write_text(DEVICE_TYPE)
    assert [Path(each.file).name for each in read_network(folder / "dcf").nodes] == ["motor.dcf", "panel.dcf"]


def test_devices_of_one_name_are_told_apart_by_node_id(folder: Path) -> None:
    file = str(folder / "dcf" / "motor.dcf")
    found = load([NodeFile(file, 9), NodeFile(file), NodeFile(file, 5, "arm")])
    assert [each.name for each in found] == ["motor_3", "arm", "motor_9"]


def test_two_files_with_one_node_id_are_refused(tmp_path: Path) -> None:
    nodes = read_network(lift.spoilt(tmp_path, ("door", "2100sub1", "DefaultValue", "2"))).nodes
    with pytest.raises(DictionaryError, match="node-ID 2 is taken by cabin"):
        load(nodes)


def test_one_node_id_twice_is_refused_before_any_file_is_opened() -> None:
    with pytest.raises(DictionaryError, match=r"^b\.eds: node-ID 2 is taken by a\.eds$"):
        load([NodeFile("a.eds", 2), NodeFile("b.eds", 2)])


def test_a_bare_eds_asks_for_its_node_id(tmp_path: Path) -> None:
    (tmp_path / "motor.eds").write_text(DEVICE_TYPE)
    with pytest.raises(
        DictionaryError,
        match=r"motor\.eds: the file names no node-ID; give one, as in 5=motor\.eds, or in Python node_id=5$",
    ):
        load([NodeFile(str(tmp_path / "motor.eds"))])


# A file's name, its text, and what is said.
WRONG = [
    ("nodelist.cpj", "[Other]\n", " not a nodelist: it has no [Topology]"),
    ("nodelist.cpj", "[Topology]\nNode4Present=1\n", " line 1: node 4 has no Node4DCFName"),
    ("network.yaml", "nodes: {}\n", " it names no nodes"),
    ("network.yaml", "nodes:\n  a: {}\n", " node a has neither `file` nor `node_id`"),
    ("network.toml", "", " not a network: neither a folder nor one of .yaml, .yml, .cpj"),
]


@pytest.mark.parametrize(("name", "text", "what"), WRONG)
def test_a_file_that_is_no_network_is_refused_in_one_line(tmp_path: Path, name: str, text: str, what: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError) as error:
        read_network(tmp_path / name)
    assert str(error.value) == f"{tmp_path / name}:{what}"


def test_an_empty_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(DictionaryError, match="no EDS, DCF, XDD or XDC in this folder"):
        read_network(tmp_path)


def read(folder: Path, text: str) -> dict[int, str]:
    file = folder / "maker.yaml"
    file.write_text(text)
    return read_error_words(file)


def test_codes_classes_and_ranges(tmp_path: Path) -> None:
    words = read(
        tmp_path, "0x73xx: sensor\n0x7310: 'speed: too high'\n0xFF01..0xFF03: axis\n0xff02: Achse übersteuert\n"
    )
    assert [words[code] for code in (0x7300, 0x7310, 0x73FF)] == ["sensor", "speed: too high", "sensor"]
    assert [words.get(code) for code in range(0xFF00, 0xFF05)] == [None, "axis", "Achse übersteuert", "axis", None]


def test_the_narrowest_entry_counts_in_any_order(tmp_path: Path) -> None:
    words = read(tmp_path, "0x7310: one\n0x731x: ten\n0x73xx: all\n")
    assert [words[code] for code in (0x7310, 0x7311, 0x7320)] == ["one", "ten", "all"]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("0x7310: speed\nspeed: fast\n", "2:1: 'speed' is not an error code: write 0x7310, 0x73xx or 0x7380..0x738F"),
        ("0x12345: long\n", "1:1: '0x12345' is not an error code"),
        ("0xxxxx: any\n", "1:1: '0xxxxx' is not an error code"),
        ("0x7320..0x7310: turned round\n", "1:1: '0x7320..0x7310' is not an error code"),
        ("0x73xx..0x74FF: mixed\n", "1:1: '0x73xx..0x74FF' is not an error code"),
        ("7310: decimal\n", "1:1: '7310' is not an error code"),
        ("0x7310: 5\n", "1:9: expected a text, found '5', which needs quotes to be one"),
        ("0x7310: a\n0x7310: b\n", "2:1: key '0x7310' is given twice"),
        ("- 0x7310\n", "1:1: expected a mapping"),
        ("", "1:1: the file is empty"),
    ],
)
def test_an_error_in_a_network_file_names_its_place(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(YamlError) as error:
        read(tmp_path, text)
    assert str(error.value).startswith(f"{tmp_path / 'maker.yaml'}:{what}")
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"nothing\.yaml"):
        read_error_words(tmp_path / "nothing.yaml")


@pytest.mark.parametrize(
    ("text", "after"),
    [
        ("library: [a]  # ours\n", 'library: [a]  # ours\nbus: {"interface": "slcan", "channel": "/dev/tty"}\n'),
        ("library: [a]", 'library: [a]\nbus: {"interface": "slcan", "channel": "/dev/tty"}\n'),
        (
            "bus:\n  interface: pcan\n  bit_rate: 125\nlibrary: [a]\n",
            'bus: {"interface": "slcan", "channel": "/dev/tty"}\nlibrary: [a]\n',
        ),
    ],
    ids=["none before", "no end of line", "one before"],
)
def test_a_network_file_is_given_another_bus_and_stays_else_as_it_is(text: str, after: str) -> None:
    bus = NetworkBus("slcan", "/dev/tty")
    assert with_bus(text, bus) == after
    assert read_network_file(after, "eurobot-od.yaml").bus == bus
