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
from tests.rows import rows

ROOT = Path(__file__).resolve().parents[2]
NETWORK_FILE = ROOT / "eds/network.yaml"
DIALECTS = sorted(each for each in (ROOT / "eds").iterdir() if each.is_dir())


def network_of(texts: dict[str, str]) -> LintedNetwork:
    devices = [NetworkNode(name, f"{name}.eds", load(text.encode(), f"{name}.eds")) for name, text in texts.items()]
    return LintedNetwork(nodes_of(devices))


def our_texts() -> dict[str, str]:
    return {name: (ROOT / f"eds/canopen/{name}.eds").read_text() for name in ("core", "drive", "navigation")}


@pytest.mark.parametrize("dialect", DIALECTS, ids=lambda each: each.name)
def test_our_own_networks_have_nothing_above_info(dialect: Path) -> None:
    found = lint_network(read_network([str(each) for each in sorted(dialect.glob("*.eds"))]))
    assert [each for each in found if each.severity is not Severity.INFO] == []


def test_every_identifier_has_its_producers_and_consumers() -> None:
    table = yaml.safe_load((ROOT / "eds/protocol.yaml").read_text())["messages"]
    expected = [
        (f"0x{each['identifier']:03X}", name, ", ".join(each["senders"]), ", ".join(each["receivers"]))
        for name, each in table.items()
    ]
    assert overview(network_of(our_texts())) == expected


def test_the_shared_message_is_declared_not_forgiven() -> None:
    texts = our_texts()
    assert [each.message for each in lint_network(network_of(texts)) if each.code == "I802"] == [
        "0x300 Start Configuration Confirm: sent by drive TPDO 4 and navigation TPDO 5, "
        "declared by one name everywhere and no data"
    ]
    texts["drive"] = texts["drive"].replace("=Start Configuration Confirm\n", "=Done\n")
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
    ("E801", "drive", entry("1800sub1", "DefaultValue", "0x80"), "navigation/1800sub1"),  # two send 0x080
    ("W803", "drive", entry("1400sub1", "DefaultValue", "0x650"), "drive/1400sub1"),  # nobody sends 0x650
    ("W804", "core", entry("1800sub1", "DefaultValue", "0x690"), "core/1800sub1"),  # nobody receives 0x690
    ("I805", "core", entry("1402sub1", "DefaultValue", "0x80000080"), "core/1402sub1"),  # could listen, but is off
    ("E806", "core", entry("1601sub1", "DefaultValue", "0x20020120"), "core/1601sub0"),  # 32 bits of 24
    ("W807", "drive", entry("1603sub0", "DefaultValue", "3"), "drive/1603sub0"),  # takes the first three of six
    ("E808", "drive", entry("1400sub1", "DefaultValue", "0x601"), "drive/1400sub1"),  # SDO request of the core
    ("E808", "core", extra(var("1005", "0x0007", "0x80")), "navigation/1800sub1"),  # SYNC is in use now
    ("E808", "core", extra(var("1012", "0x0007", "0x100")), "drive/1802sub1"),  # TIME is in use now
    ("E808", "core", entry("1014", "DefaultValue", "0x140"), "core/1807sub1"),  # EMCY where a message is
    ("I809", "core", entry("1800sub1", "DefaultValue", "0x001"), "core/1800sub1"),  # GFC, which nobody has
    ("E810", "drive", entry("1603sub1", "DefaultValue", "0x2000020C"), "drive/1603sub0"),  # y, then x
    ("W811", "drive", entry("1603sub5", "DefaultValue", "0x20000605"), "drive/1603sub0"),  # 5 bits of 6
    ("E812", "core", entry("1014", "DefaultValue", "0x82"), "drive/1014"),  # one EMCY identifier for two nodes
    ("I815", "core", entry("1800sub1", "DefaultValue", "0x003"), "core/1801sub1"),  # TPDO 2 wins against TPDO 1
    ("E816", "drive", entry("2100sub1", "DefaultValue", "1"), "drive/"),  # two nodes 1
    ("I817", "drive", entry("2100sub1", "DefaultValue", "0"), "drive/"),  # no node-ID anywhere
    ("E818", "core", entry("1016sub1", "DefaultValue", "0x000203E8"), "core/1016sub1"),  # waits 1000, sent every 1000
    ("W819", "core", entry("1016sub1", "DefaultValue", "0x001107D0"), "core/1016sub1"),  # node 17 is nobody
    ("W820", "drive", entry("1017", "DefaultValue", "0"), "core/1016sub1"),  # the drive sends none
    ("E824", "core", extra(var("1005", "0x0007", "0x40000650")), "drive/1005"),  # two SYNC producers
    ("E825", "core", entry("1F80", "DefaultValue", "1"), "drive/1F80"),  # two NMT masters
    ("W826", "drive", entry("1400sub2", "DefaultValue", "1"), "drive/1400sub2"),  # synchronous, nobody sends SYNC
    ("W827", "core", entry("1800sub1", "DefaultValue", "0x182"), "core/1800sub1"),  # TPDO 1 of the drive
]
ALSO = {
    "I809": ("navigation", entry("1800sub1", "DefaultValue", "0x001")),
    "E810": ("drive", entry("1603sub2", "DefaultValue", "0x2000010C")),
    "E824": ("drive", extra(var("1005", "0x0007", "0x40000650"))),
    "E825": ("drive", entry("1F80", "DefaultValue", "1")),
}
"""What has to be changed in a second place to make the conflict."""


@rows("code, node, change, at", CONFLICTS)
def test_a_conflict_is_flagged_where_it_is(code: str, node: str, change: Callable[[str], str], at: str) -> None:
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
    ("I805", "core", entry("1402sub1", "DefaultValue", "0x80")),  # all that it receives is valid now
    ("E810", "drive", entry("2000sub1", "ParameterName", "abscissa")),  # another maker's word for x
    ("I815", "core", entry("1801sub1", "DefaultValue", "0x001")),  # as TPDO 1 has
    ("I817", "drive", str),  # 0x2100 says the node-ID
    ("E818", "core", entry("1016sub1", "DefaultValue", "0x000203E9")),  # waits 1001, sent every 1000
    ("E818", "core", entry("1016sub1", "DefaultValue", "0x00020000")),  # does not wait
]


@pytest.mark.parametrize(("code", "node", "change"), SILENT)
def test_what_fits_is_not_flagged(code: str, node: str, change: Callable[[str], str]) -> None:
    texts = our_texts()
    texts[node] = change(texts[node])
    assert code not in {each.code for each in lint_network(network_of(texts))}


def _section_of(texts: dict[str, str], file: str, line: int) -> str:
    before = texts[file.removesuffix(".eds")].split("\n")[:line]
    headers = [each for each in before if each.startswith("[")]
    return headers[-1].strip("[]") if line > 1 else ""


BIT_RATES = "BaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\nBaudRate_800=0\nBaudRate_1000=1"


def test_nodes_need_a_bit_rate_in_common() -> None:
    texts = our_texts()
    texts["drive"] = (
        texts["drive"].replace("BaudRate_10=0", "BaudRate_10=1").replace(BIT_RATES, BIT_RATES.replace("=1", "=0"))
    )
    assert "E821" in {each.code for each in lint_network(network_of(texts))}


def test_commissioned_nodes_need_one_bit_rate() -> None:
    texts = {name: f"{text}\n[DeviceComissioning]\nNodeID=1\nBaudrate=500\n" for name, text in our_texts().items()}
    assert "E823" not in {each.code for each in lint_network(network_of(texts))}
    for name, rate in ("drive", 250), ("navigation", 125):
        texts[name] = texts[name].replace("Baudrate=500", f"Baudrate={rate}")
    assert [(each.file, each.message) for each in lint_network(network_of(texts)) if each.code == "E823"] == [
        ("drive.eds", "drive is set to 250 kbit/s, core to 500"),
        ("navigation.eds", "navigation is set to 125 kbit/s, core to 500"),
    ]


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], str]:
    """Writes a network file beside our EDS files and gives its path."""

    def write(text: str) -> str:
        file = tmp_path / "network.yaml"
        file.write_text(text.replace("EDS", str(ROOT / "eds/canopen")))
        return str(file)

    return write


NODES = (
    "nodes: {core: {file: EDS/core.eds}, drive: {file: EDS/drive.eds, node_id: 2}, off: {file: EDS/navigation.eds}}\n"
)
DECLARED = [
    # (what the network file adds, codes above info)
    ("", set()),
    ("order: [Emergency Shutdown, Emergency Stop, Goto XY]\n", set()),
    ("order: [Goto XY, Emergency Stop]\n", {"W813"}),  # 0x002 wins against 0x008
    ("order: [Emergency Stop, Coffee]\n", {"W814"}),  # nobody sends that
    ("bit_rate: 500\n", set()),
    ("bit_rate: 800\n", {"E822"}),
    ("shared: [Start Configuration Confirm]\n", set()),
]


@pytest.mark.parametrize(("declared", "codes"), DECLARED)
def test_a_network_file_declares(write: Callable[[str], str], declared: str, codes: set[str]) -> None:
    found = lint_network(read_network([write(NODES + declared)]))
    assert {each.code for each in found if each.severity is not Severity.INFO} == codes


def test_our_network_file_is_what_the_protocol_table_says() -> None:
    table = yaml.safe_load((ROOT / "eds/protocol.yaml").read_text())
    declared = yaml.safe_load(NETWORK_FILE.read_text())
    assert declared["order"] == [*table["messages"]]
    assert declared["shared"] == [name for name, each in table["messages"].items() if len(each["senders"]) > 1]
    assert {name: each["node_id"] for name, each in declared["nodes"].items()} == {
        name: each["node_id"] for name, each in table["nodes"].items()
    }


def test_our_network_file_has_nothing_above_info() -> None:
    found = lint_network(read_network([str(NETWORK_FILE)]))
    assert {each.code for each in found if each.severity is not Severity.INFO} == set()


MALFORMED = [
    # (text, what the error says)
    ("", "1:1: the file is empty"),
    ("core.eds", "1:1: expected a mapping, `key: value`, found 'core.eds'"),
    ("nodes: {}\n", ": it names no nodes"),
    ("nodes:\n  core: {node_id: 1}\n", "2:9: key 'file' is missing"),
    ("nodes: {core: {file: core.eds, node_id: 128}}", "node_id = '128' is not allowed; allowed: whole numbers 1..127"),
    (
        "nodes: {core: {file: core.eds}}\nbit_rate: $NODEID+1",
        "2:11: bit_rate = '$NODEID+1' is not allowed; allowed: whole numbers 1..1000 kbit/s",
    ),
    ("nodes: {core: {file: core.eds, colour: red}}", "unknown key 'colour'"),
    ("nodes: {core: {file: core.eds}}\nnodes: {}", "2:1: key 'nodes' is given twice"),
    ("nodes: {core: {file: core.eds}}\nshared: x", "2:9: expected a list, found 'x'"),
    ("nodes: [", "1:9: a value is missing"),
    ("nodes: {core: {file: [a]}}", "expected a single value, found a list"),
    ("nodes: {core: {file: none.eds}}", "No such file"),
]


@rows("text, message", MALFORMED)
def test_a_malformed_network_file_is_told_by_line(write: Callable[[str], str], text: str, message: str) -> None:
    with pytest.raises(FileError, match=re.escape(message)):
        read_network([write(text)])


def test_every_network_rule_is_shown() -> None:
    shown = {code for code, *_ in CONFLICTS} | {"I802", "W813", "W814", "E821", "E822", "E823"}
    assert {each.code for each in RULES} == shown


@pytest.mark.parametrize(
    ("master", "codes"),
    [("", {"W803", "W804"}), ("core", {"W803", "W804"}), ("PC", set())],
    ids=["none is named", "it is a node", "it has no file"],
)
def test_a_master_without_a_file_may_send_and_receive_anything(tmp_path: Path, master: str, codes: set[str]) -> None:
    line = f"master: {master}\n" if master else ""
    core = ROOT / "eds" / "canopen" / "core.eds"
    (tmp_path / "network.yaml").write_text(f"nodes: {{core: {{file: {core}}}}}\n{line}")
    found = lint_network(read_network([str(tmp_path / "network.yaml")]))
    assert {each.code for each in found} & {"W803", "W804"} == codes


@pytest.mark.parametrize(("master", "codes"), [("", {"W826"}), ("master: PC\n", set())])
def test_a_master_without_a_file_may_send_sync(tmp_path: Path, master: str, codes: set[str]) -> None:
    (tmp_path / "drive.eds").write_text(
        entry("1400sub2", "DefaultValue", "1")((ROOT / "eds" / "canopen" / "drive.eds").read_text())
    )
    file = tmp_path / "network.yaml"
    file.write_text(f"nodes: {{drive: {{file: drive.eds, node_id: 2}}}}\n{master}")
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
    over.write_text(yaml.safe_dump({"nodes": files | {"core": {"file": "core.eds", "patch": "own.yaml"}}}))
    before, after = (lint_network(read_network([str(each)])) for each in (plain, over))
    assert [each for each in after if "0x7E5" in each.message and each.file.endswith("core.eds")]
    assert not [each for each in before if "0x7E5" in each.message]
    (tmp_path / "own.yaml").write_text("0x1800:9: {DefaultValue: 1}")
    with pytest.raises(DictionaryError, match=r"own.yaml:1: the file has no 0x1800:9"):
        read_network([str(over)])
