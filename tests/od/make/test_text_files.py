"""What a table makes: the same files every time, written whole, and every difference told by file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.od.make import read_table
from eurobot_od.od.make.text import differences, make_files, write_files
from eurobot_od.od.network import NetworkFile, NodeFile, TrafficEntry, read_network_file
from tests.od.make.tables import TABLE

TEXTS = make_files(read_table(TABLE, "table.yaml"))
EMPTY = TABLE[: TABLE.index("messages:")] + "messages: {}\ndialects: {plain: {revision_number: 1}}\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_files(TEXTS, tmp_path / "eds")
    return tmp_path / "eds"


def test_a_file_for_each_node_in_each_dialect_and_the_network() -> None:
    assert set(TEXTS) == {"plain/core.eds", "plain/drive.eds", "other/core.eds", "other/drive.eds", "network.yaml"}


def test_the_same_table_makes_the_same_texts() -> None:
    assert make_files(read_table(TABLE, "table.yaml")) == TEXTS


def test_the_comment_is_the_tables() -> None:
    assert "Line1=Made by eurobot-od make-eds from a protocol table; change it there.\n" in TEXTS["plain/core.eds"]
    said = TABLE.replace("author: somebody", "author: somebody, comment: Ours")
    assert "\nLine1=Ours\n" in make_files(read_table(said, ""))["plain/core.eds"]


def test_a_reading_is_read_only_and_a_setting_is_not() -> None:
    readings = (
        "settings: {}\n    readings: {Now: {index: 0x2102, fields: {Rate: {bits: 8, range: [0, 9], default: 0}}}}"
    )
    text = make_files(read_table(TABLE.replace("settings: {}", readings), ""))["plain/drive.eds"]
    access = {name: text.split(f"[{name}]")[1].split("AccessType=")[1][:2] for name in ("2102sub1", "2100sub1")}
    assert access == {"2102sub1": "ro", "2100sub1": "rw"}


def _default(text: str, section: str) -> str:
    return text.split(f"[{section}]")[1].split("DefaultValue=")[1].split("\n")[0]


def test_the_event_timer_of_a_message_is_that_of_its_senders_tpdo() -> None:
    periodic = TABLE.replace("receivers: [drive], object", "receivers: [drive], event_timer: 100, object")
    texts = make_files(read_table(periodic, ""))
    assert _default(texts["plain/core.eds"], "1800sub5") == "100"
    assert _default(texts["plain/drive.eds"], "1400sub5") == "0"


@pytest.mark.parametrize("default", ["1.5", "-0.25", "2"])
def test_a_real32_setting_has_its_default_as_it_is_written(default: str) -> None:
    real = f"settings: {{Joint: {{index: 0x2102, fields: {{Gain: {{bits: 32, type: REAL32, default: {default}}}}}}}}}"
    text = make_files(read_table(TABLE.replace("settings: {}", real), ""))["plain/drive.eds"]
    assert _default(text, "2102sub1") == default


def test_the_network_says_how_often_what_is_sent() -> None:
    rows = "traffic: {Goto: {every: Wait.Check wait, reason: again}, Confirm: {answers: Goto, jitter: 1 ms}}\n"
    network = read_network_file(make_files(read_table(rows + TABLE, ""))["network.yaml"], "network.yaml")
    assert network.traffic == {
        "Goto": TrafficEntry(every="Wait.Check wait", reason="again"),
        "Confirm": TrafficEntry(answers="Goto", jitter="1 ms"),
    }


def test_the_network_is_that_of_the_first_dialect() -> None:
    two = TABLE.replace("identifier: 12, senders: [drive]", "identifier: 4, senders: [core, drive]")
    network = read_network_file(make_files(read_table(two, ""))["network.yaml"], "made/network.yaml")
    nodes = [NodeFile("made/plain/core.eds", 1, "core"), NodeFile("made/plain/drive.eds", 2, "drive")]
    assert network == NetworkFile(nodes, ("Confirm",), ("Confirm", "Goto"), 500)


# The smallest tables: names that YAML takes for something else, no message, one node.
def test_a_name_that_yaml_takes_for_something_else_is_quoted() -> None:
    network = make_files(read_table(TABLE.replace("  Goto:", '  "off":'), ""))["network.yaml"]
    assert read_network_file(network, "network.yaml").order == ("off", "Confirm")


def test_a_table_without_messages_makes_devices_without_pdos() -> None:
    assert "NrOfRXPDO=0\nNrOfTXPDO=0\n" in make_files(read_table(EMPTY, ""))["plain/core.eds"]


def test_writes_plain_lines(folder: Path) -> None:
    contents = [each.read_bytes() for each in folder.rglob("*.*")]
    assert len(contents) == len(TEXTS)
    assert all(each.isascii() and b"\r" not in each and each.endswith(b"\n") for each in contents)


def test_written_files_equal_the_generated_ones(folder: Path) -> None:
    assert differences(TEXTS, folder) == []


def test_nothing_is_replaced_if_a_file_cannot_be_written(folder: Path) -> None:
    texts = {**TEXTS, "plain/core.eds": "new", "other/core.eds": "caf\xe9"}
    with pytest.raises(UnicodeEncodeError):
        write_files(texts, folder)
    assert differences(TEXTS, folder) == []
    assert sorted(each.name for each in folder.iterdir()) == ["network.yaml", "other", "plain"]


def test_tells_a_changed_width(folder: Path) -> None:
    wider = make_files(read_table(TABLE.replace("bits: 12", "bits: 13"), ""))
    lines = differences(wider, folder)
    assert [line.rpartition(" ")[0] for line in lines] == [
        f"{folder / path}: differs first in line" for path in sorted(TEXTS) if path != "network.yaml"
    ]


def test_tells_the_first_line_that_differs(folder: Path) -> None:
    changed, shorter = folder / "other" / "core.eds", folder / "plain" / "core.eds"
    changed.write_bytes(changed.read_bytes().replace(b"FileVersion=1", b"FileVersion=2").replace(b"ro\n", b"rw\n"))
    shorter.write_bytes(b"[FileInfo]\n")
    assert differences(TEXTS, folder) == [f"{changed}: differs first in line 3", f"{shorter}: differs first in line 2"]


# An EDS file too many would be loaded as a node; what else a team keeps in its folders is its own affair.
def test_tells_missing_files_and_nodes_too_many(folder: Path) -> None:
    missing, network, camera = folder / "other" / "core.eds", folder / "network.yaml", folder / "other" / "camera.eds"
    missing.rename(camera)
    network.unlink()
    (folder / "plain" / "drive.dcf").touch()
    assert differences(TEXTS, folder) == [
        f"{network}: is missing",
        f"{camera}: should not be there",
        f"{missing}: is missing",
    ]
