"""The network view sees what no file shows alone: identifiers, mappings, heartbeats and bit rates that do not fit."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from eurobot_od.cli.lint import read_network
from eurobot_od.errors import DictionaryError, FileError
from eurobot_od.lint.findings import Severity
from eurobot_od.lint.model import load
from eurobot_od.lint.network import RULES, LintedNetwork, NetworkNode, lint_network, nodes_of, overview
from tests.kit import lift


def network_of(texts: dict[str, str]) -> LintedNetwork:
    devices = [NetworkNode(name, f"{name}.eds", load(text.encode(), f"{name}.eds")) for name, text in texts.items()]
    return LintedNetwork(nodes_of(devices))


def our_texts() -> dict[str, str]:
    return {name: lift.texts()[f"plain/{name}.eds"] for name in lift.NAMES}


@pytest.mark.parametrize("dialect", [lift.DIALECT, lift.REVERSED])
def test_our_networks_have_only_infos(tmp_path: Path, dialect: str) -> None:
    folder = lift.write(tmp_path).parent / dialect
    found = lint_network(read_network([str(each) for each in sorted(folder.glob("*.eds"))]))
    assert [each for each in found if each.severity is not Severity.INFO] == []


def test_a_generated_network_file_has_only_infos(tmp_path: Path) -> None:
    found = lint_network(read_network([str(lift.write(tmp_path).parent / "network.yaml")]))
    assert [each for each in found if each.severity is not Severity.INFO] == []


def test_every_identifier_has_its_producers_and_consumers() -> None:
    table = yaml.safe_load(lift.TABLE.read_text())["messages"]
    expected = [
        (f"0x{each['identifier']:03X}", name, ", ".join(each["senders"]), ", ".join(each["receivers"]))
        for name, each in table.items()
    ]
    assert overview(network_of(our_texts())) == expected


def test_a_shared_message_needs_a_declaration() -> None:
    texts = our_texts()
    assert [each.message for each in lint_network(network_of(texts)) if each.code == "I802"] == [
        "0x305 Configure Confirm: sent by cabin TPDO 4 and door TPDO 2, declared by one name everywhere and no data"
    ]
    texts["cabin"] = texts["cabin"].replace("=Configure Confirm\n", "=Done\n")
    assert "E801" in {each.code for each in lint_network(network_of(texts))}


def entry(section: str, key: str, value: str) -> Callable[[str], str]:
    """Make the change of one entry of a file."""

    def change(text: str) -> str:
        changed, count = re.subn(rf"(\[{section}\]\n(?:[^\[\n].*\n)*?{key}=).*", rf"\g<1>{value}", text)
        assert count == 1, (section, key)
        return changed

    return change


def extra(text: str) -> Callable[[str], str]:
    return lambda old: old + text


def var(index: str, type_: str, value: str) -> str:
    return f"\n[{index}]\nParameterName=x\nDataType={type_}\nAccessType=rw\nDefaultValue={value}\n"


CONFLICTS = [
    # (code, node, change, section of the line that is flagged, key): the reason beside each
    ("E801", "cabin", entry("1800sub1", "DefaultValue", "0x195"), "door/1800sub1"),  # two send 0x195
    ("W803", "cabin", entry("1400sub1", "DefaultValue", "0x650"), "cabin/1400sub1"),  # nobody sends 0x650
    ("W804", "panel", entry("1800sub1", "DefaultValue", "0x690"), "panel/1800sub1"),  # nobody receives 0x690
    ("I805", "panel", entry("1402sub1", "DefaultValue", "0x80000195"), "panel/1402sub1"),  # could listen, but is off
    ("E806", "panel", entry("1601sub1", "DefaultValue", "0x20020120"), "panel/1601sub0"),  # 32 bits of 24
    ("W807", "cabin", entry("1603sub0", "DefaultValue", "3"), "cabin/1603sub0"),  # takes the first three of five
    ("E808", "cabin", entry("1400sub1", "DefaultValue", "0x601"), "cabin/1400sub1"),  # SDO request of the panel
    ("E808", "panel", extra(var("1005", "0x0007", "0x195")), "door/1800sub1"),  # SYNC is in use now
    ("E808", "panel", extra(var("1012", "0x0007", "0x205")), "cabin/1802sub1"),  # TIME is in use now
    ("E808", "panel", entry("1014", "DefaultValue", "0x2C5"), "panel/1807sub1"),  # EMCY where a message is
    ("I809", "panel", entry("1800sub1", "DefaultValue", "0x001"), "panel/1800sub1"),  # GFC, which nobody has
    ("E810", "panel", entry("1603sub1", "DefaultValue", "0x2011020C"), "panel/1603sub0"),  # the sway, then the height
    ("W811", "cabin", entry("1603sub4", "DefaultValue", "0x20000502"), "cabin/1603sub0"),  # 2 bits of 3
    ("E812", "panel", entry("1014", "DefaultValue", "0x82"), "cabin/1014"),  # one EMCY identifier for two nodes
    ("I815", "panel", entry("1800sub1", "DefaultValue", "0x103"), "panel/1801sub1"),  # TPDO 2 wins against TPDO 1
    ("E816", "cabin", entry("2100sub1", "DefaultValue", "1"), "cabin/"),  # two nodes 1
    ("I817", "cabin", entry("2100sub1", "DefaultValue", "0"), "cabin/"),  # no node-ID anywhere
    ("E818", "panel", entry("1016sub1", "DefaultValue", "0x000203E8"), "panel/1016sub1"),  # waits 1000, sent every 1000
    ("W819", "panel", entry("1016sub1", "DefaultValue", "0x001107D0"), "panel/1016sub1"),  # node 17 is nobody
    ("W820", "cabin", entry("1017", "DefaultValue", "0"), "panel/1016sub1"),  # the cabin sends none
    ("E824", "panel", extra(var("1005", "0x0007", "0x40000650")), "cabin/1005"),  # two SYNC producers
    ("E825", "panel", entry("1F80", "DefaultValue", "1"), "cabin/1F80"),  # two NMT masters
    ("W826", "cabin", entry("1400sub2", "DefaultValue", "1"), "cabin/1400sub2"),  # synchronous, nobody sends SYNC
    ("W827", "panel", entry("1800sub1", "DefaultValue", "0x182"), "panel/1800sub1"),  # TPDO 1 of the cabin
]
ALSO = {
    "I809": ("door", entry("1800sub1", "DefaultValue", "0x001")),
    "E810": ("panel", entry("1603sub2", "DefaultValue", "0x2011010C")),
    "E824": ("cabin", extra(var("1005", "0x0007", "0x40000650"))),
    "E825": ("cabin", entry("1F80", "DefaultValue", "1")),
}
"""What has to be changed in a second place to make the conflict."""


@pytest.mark.parametrize(("code", "node", "change", "at"), CONFLICTS)
def test_a_conflict_is_reported_at_its_place(code: str, node: str, change: Callable[[str], str], at: str) -> None:
    texts = our_texts()
    texts[node] = change(texts[node])
    if code in ALSO:
        other, also = ALSO[code]
        texts[other] = also(texts[other])
    file, section = at.split("/")
    found = lint_network(network_of(texts))
    places = [(each.file, _section_of(texts, each.file, each.line)) for each in found if each.code == code]
    assert (f"{file}.eds", section) in places, found


SILENT = [
    ("I805", "panel", entry("1402sub1", "DefaultValue", "0x195")),  # all that it receives is valid now
    ("E810", "cabin", entry("2000sub1", "ParameterName", "elevation")),  # another maker's word for the height
    ("I815", "panel", entry("1801sub1", "DefaultValue", "0x101")),  # as TPDO 1 has
    ("I817", "cabin", str),  # 0x2100 says the node-ID
    ("E818", "panel", entry("1016sub1", "DefaultValue", "0x000203E9")),  # waits 1001, sent every 1000
    ("E818", "panel", entry("1016sub1", "DefaultValue", "0x00020000")),  # does not wait
]


@pytest.mark.parametrize(("code", "node", "change"), SILENT)
def test_matching_files_are_not_reported(code: str, node: str, change: Callable[[str], str]) -> None:
    texts = our_texts()
    texts[node] = change(texts[node])
    assert code not in {each.code for each in lint_network(network_of(texts))}


def _section_of(texts: dict[str, str], file: str, line: int) -> str:
    before = texts[file.removesuffix(".eds")].split("\n")[:line]
    headers = [each for each in before if each.startswith("[")]
    return headers[-1].strip("[]") if line > 1 else ""


BIT_RATES = "BaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\nBaudRate_800=0\nBaudRate_1000=1"


def test_nodes_need_a_common_bit_rate() -> None:
    texts = our_texts()
    texts["cabin"] = (
        texts["cabin"].replace("BaudRate_10=0", "BaudRate_10=1").replace(BIT_RATES, BIT_RATES.replace("=1", "=0"))
    )
    assert "E821" in {each.code for each in lint_network(network_of(texts))}


def test_commissioned_nodes_need_the_same_bit_rate() -> None:
    texts = {name: f"{text}\n[DeviceComissioning]\nNodeID=1\nBaudrate=500\n" for name, text in our_texts().items()}
    assert "E823" not in {each.code for each in lint_network(network_of(texts))}
    for name, rate in ("cabin", 250), ("door", 125):
        texts[name] = texts[name].replace("Baudrate=500", f"Baudrate={rate}")
    assert [(each.file, each.message) for each in lint_network(network_of(texts)) if each.code == "E823"] == [
        ("cabin.eds", "cabin is set to 250 kbit/s, panel to 500"),
        ("door.eds", "door is set to 125 kbit/s, panel to 500"),
    ]


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], str]:
    """Writes a network file for the lift's EDS files and gives its path."""

    def write(text: str) -> str:
        file = tmp_path / "network.yaml"
        file.write_text(text.replace("EDS", str(lift.write(tmp_path))))
        return str(file)

    return write


NODES = "nodes: {panel: {file: EDS/panel.eds}, cabin: {file: EDS/cabin.eds, node_id: 2}, off: {file: EDS/door.eds}}\n"
DECLARED = [
    # (what the network file adds, codes above info)
    ("", set()),
    ("order: [Emergency Off, Brake, Move To]\n", set()),
    ("order: [Move To, Brake]\n", {"W813"}),  # 0x102 wins against 0x108
    ("order: [Brake, Coffee]\n", {"W814"}),  # nobody sends that
    ("bit_rate: 500\n", set()),
    ("bit_rate: 800\n", {"E822"}),
    ("shared: [Configure Confirm]\n", set()),
]


@pytest.mark.parametrize(("declared", "codes"), DECLARED)
def test_a_network_file_declares_shared_messages_priorities_and_bit_rate(
    write: Callable[[str], str], declared: str, codes: set[str]
) -> None:
    found = lint_network(read_network([write(NODES + declared)]))
    assert {each.code for each in found if each.severity is not Severity.INFO} == codes


MALFORMED = [
    # (text, what the error says)
    ("", "1:1: the file is empty"),
    ("panel.eds", "1:1: expected a mapping (keys: nodes, shared, order, "),
    ("5: panel.eds", "1:1: unknown key '5'; known: nodes, shared, order, "),
    ("nodes: {5: panel.eds}", "1:12: expected a mapping (keys: file, node_id, "),
    ("nodes: {}\n", ": it names no nodes"),
    ("nodes:\n  panel: {node_id: 1}\n", ": node panel names no file, and lint asks no library"),
    (
        "nodes: {panel: {file: panel.eds, node_id: 128}}",
        "node_id = '128' is not allowed; allowed: whole numbers 1..127",
    ),
    (
        "nodes: {panel: {file: panel.eds}}\nbit_rate: $NODEID+1",
        "2:11: bit_rate = '$NODEID+1' is not allowed; allowed: whole numbers 1..1000 kbit/s",
    ),
    ("nodes: {panel: {file: panel.eds, colour: red}}", "unknown key 'colour'"),
    ("nodes: {panel: {file: panel.eds}}\nnodes: {}", "2:1: key 'nodes' is given twice"),
    ("nodes: {panel: {file: panel.eds}}\nshared: x", "2:9: expected a list, found 'x'"),
    ("nodes: [", "1:9: a value is missing"),
    ("nodes: {panel: {file: [a]}}", "expected a single value, found a list"),
    ("nodes: {panel: {file: none.eds}}", "No such file"),
]


@pytest.mark.parametrize(("text", "message"), MALFORMED)
def test_a_malformed_network_file_is_reported_by_line(write: Callable[[str], str], text: str, message: str) -> None:
    with pytest.raises(FileError, match=re.escape(message)):
        read_network([write(text)])


def test_every_network_rule_has_a_test() -> None:
    shown = {code for code, *_ in CONFLICTS} | {"I802", "W813", "W814", "E821", "E822", "E823"}
    assert {each.code for each in RULES} == shown


@pytest.mark.parametrize(
    ("master", "codes"),
    [("", {"W803", "W804"}), ("panel", {"W803", "W804"}), ("PC", set())],
    ids=["none is named", "it is a node", "it has no file"],
)
def test_a_master_without_a_file_may_send_and_receive_anything(tmp_path: Path, master: str, codes: set[str]) -> None:
    line = f"master: {master}\n" if master else ""
    panel = lift.write(tmp_path / "files") / "panel.eds"
    (tmp_path / "network.yaml").write_text(f"nodes: {{panel: {{file: {panel}}}}}\n{line}")
    found = lint_network(read_network([str(tmp_path / "network.yaml")]))
    assert {each.code for each in found} & {"W803", "W804"} == codes


@pytest.mark.parametrize(("master", "codes"), [("", {"W826"}), ("master: PC\n", set())])
def test_a_master_without_a_file_may_send_sync(tmp_path: Path, master: str, codes: set[str]) -> None:
    (tmp_path / "cabin.eds").write_text(entry("1400sub2", "DefaultValue", "1")(our_texts()["cabin"]))
    file = tmp_path / "network.yaml"
    file.write_text(f"nodes: {{cabin: {{file: cabin.eds, node_id: 2}}}}\n{master}")
    assert {each.code for each in lint_network(read_network([str(file)]))} & {"W826"} == codes


def test_a_node_is_checked_with_the_patches_over_its_file(tmp_path: Path) -> None:
    for name, text in our_texts().items():
        (tmp_path / f"{name}.eds").write_text(text)
    (tmp_path / "own.yaml").write_text(
        "0x1800:1: {DefaultValue: 0x7E5}\n0x2FFF: {ParameterName: x, DataType: BOOLEAN, AccessType: ro}"
    )
    files = {name: {"file": f"{name}.eds"} for name in our_texts()}
    plain, over = tmp_path / "plain.yaml", tmp_path / "over.yaml"
    plain.write_text(yaml.safe_dump({"nodes": files}))
    over.write_text(yaml.safe_dump({"nodes": files | {"panel": {"file": "panel.eds", "patch": "own.yaml"}}}))
    before, after = (lint_network(read_network([str(each)])) for each in (plain, over))
    assert [each for each in after if "0x7E5" in each.message and each.file.endswith("panel.eds")]
    assert not [each for each in before if "0x7E5" in each.message]
    (tmp_path / "own.yaml").write_text("0x1800:9: {DefaultValue: 1}")
    with pytest.raises(DictionaryError, match=r"own.yaml:1: the file has no 0x1800:9"):
        read_network([str(over)])
