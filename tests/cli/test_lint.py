"""The commands `lint`, `diff`, `edit` and `devices`: their output, their options and their exit status."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from eurobot_od.bus.live import Live
from eurobot_od.cli import main
from eurobot_od.client.master import Master
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from tests.cli.console import Said, run
from tests.client.lss_slave import LssStation
from tests.client.peers import new_channel, open_bus
from tests.client.wired import WiredBus
from tests.kit import plant
from tests.kit.devices import DOCS
from tests.kit.library import LISTS, OTHER_PRODUCT, device_text, library_of

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "tests/lint/samples"
CLEAN, OLD, GENERATED = (str(SAMPLES / f"{name}.eds") for name in ("clean", "old", "generated"))
LINE = plant.FILES.folder()
OWN = sorted(str(each) for each in LINE.glob("*.eds"))

CALLS = [
    # (arguments, exit status, part of the output)
    (["lint", CLEAN], 0, "1 file: nothing found"),
    (["lint", *OWN], 0, "3 files: 90 infos (-v lists infos)"),
    (["lint", *OWN, "-v"], 0, "lift.eds:503:14: I608"),
    (["lint", *OWN, "--select", "I608"], 0, "lift.eds:503:14: I608"),
    (["lint", OLD, "--select", "E999"], 2, ""),
    (["lint", OLD, "--ignore", "W,E3,X"], 2, ""),
    (["lint", OLD], 1, f"{OLD}:1:1: E202 EDSVersion is missing"),
    (["lint", OLD, "--ignore", "E"], 0, "W203"),
    (["lint", OLD, "--ignore", "E", "--strict"], 1, "W203"),
    (["lint", OLD, "--select", "e308,W5"], 1, "E308"),
    (["lint", OLD, "--select", "W5"], 0, "W510"),
    (["lint", OLD, "--select", "E2", "--format", "sarif"], 1, '"version": "2.1.0"'),
    (["lint", "--network", OWN[1], "--format", "sarif"], 0, '"ruleId": "W803"'),
    (["lint", str(LINE)], 0, "3 files: 90 infos (-v lists infos)"),
    (["lint", CLEAN, str(ROOT / "docs"), "--select", "W442"], 0, "motor.eds:389:14: W442"),
    (["lint", str(ROOT / "tools")], 2, ""),  # no file of a device in it
    (["lint", CLEAN, "none.eds"], 2, ""),
    (["lint", "--explain", "e606"], 0, "E606 (error): No PDO has an identifier of NMT"),
    (["lint", "--explain", "I802"], 0, "I802 (info)"),
    (["lint", "--explain", "E999"], 2, ""),
    (["lint", "--network", *OWN], 0, "0x202  Move To"),
    (["lint", "--network", OWN[1]], 0, "W803 panel RPDO 1 waits for 0x182, which no node sends"),
    (["lint", "--network", OWN[1], "--strict"], 1, "W804"),
    (["lint", "--network", "-v", str(LINE.parent / "network.yaml")], 0, "declared by the network file"),
    (["lint", "--network", "none.yaml"], 2, ""),
    (["diff", CLEAN, CLEAN], 0, ""),
    (["diff", CLEAN, GENERATED], 1, ": RPDO 1 COB-ID: $NODEID+0x200 -> 0x200"),
    (["diff", CLEAN, GENERATED, "--node", "5"], 1, ": RPDO 1 COB-ID: 0x205 -> 0x200"),
    (["diff", CLEAN, GENERATED, "--node", "128"], 2, ""),
    (["diff", CLEAN], 2, ""),
    (["diff", CLEAN, "none.eds"], 2, ""),
    (["diff", CLEAN, __file__], 2, ""),
    (["diff", CLEAN, "--node", "5", "-i", "nonsense"], 3, ""),
]


@pytest.mark.parametrize(("arguments", "status", "part"), CALLS)
def test_a_call(arguments: list[str], status: int, part: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == status
    assert part in capsys.readouterr().out


def test_a_finding_that_repeats_is_one_line_with_a_count(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint", OLD, "--select", "W203"]) == 0
    finding, last = capsys.readouterr().out.splitlines()
    assert finding.endswith("(and 2 more; -v lists them)")
    assert last == "1 file: 3 warnings"
    main(["lint", OLD, "--select", "W203", "-v"])
    assert capsys.readouterr().out.count("W203 ") == 3


FIXED = [(["--fix"], "own.eds"), (["--fix", "-o", "new.eds"], "new.eds")]


@pytest.mark.parametrize(("options", "written"), FIXED)
def test_fix_writes_the_repaired_file(
    options: list[str],
    written: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    commented = Path(CLEAN).read_text().replace("DefaultValue=-5", "; slow\nDefaultValue=-5")
    odd = commented.replace("; slow\nDefaultValue=-5", "DefaultValue=-5 ; slow")
    Path("own.eds").write_text(odd.replace("SubNumber=4\n", "SubNumber=\n", 1))
    assert main(["lint", "own.eds", *options]) == 0
    said = [each.partition(": ")[2] for each in capsys.readouterr().out.splitlines()]
    assert said == ["[2001]: SubNumber=4 written", "comment put on a line of its own"]
    assert Path(written).read_text() == commented
    assert main(["lint", written, "--fix"]) == 0
    assert capsys.readouterr().out == ""


WRONG_FIXES = [(["none.eds"], 2), ([CLEAN, OLD, "-o", "x.eds"], 2), ([str(SAMPLES)], 2)]


@pytest.mark.parametrize(("words", "status"), WRONG_FIXES)
def test_findings_that_fix_cannot_repair_are_named(
    words: list[str], status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["lint", "--fix", *words]) == status
    assert capsys.readouterr().err.count("\n") == 1


def test_an_unknown_code_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint", OLD, "--select", "E3008"]) == 2
    assert capsys.readouterr().err == "eurobot-od: unknown rule 'E3008'; did you mean E308?\n"


def test_differences_are_written_as_in_the_files(capsys: pytest.CaptureFixture[str]) -> None:
    main(["diff", OWN[1], OWN[1].replace("/plain/", "/packed/")])
    lines = capsys.readouterr().out.splitlines()
    assert "0x1018 sub 3 Identity object.Revision number: value: 0x00010000 -> 0x00020000" in lines


def test_findings_come_in_the_order_of_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    main(["lint", OLD, "-v"])
    lines = [int(each.removeprefix(OLD).split(":")[1]) for each in capsys.readouterr().out.splitlines()[:-1]]
    assert lines == sorted(lines)


def test_an_unreadable_file_does_not_hide_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lint", "none.eds", OLD]) == 2
    captured = capsys.readouterr()
    assert "E202" in captured.out
    assert captured.err == "eurobot-od: none.eds: No such file or directory\n"


def test_findings_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    main(["lint", OLD, "--json", "--select", "E308"])
    assert json.loads(capsys.readouterr().out) == {
        "findings": [
            {
                "file": OLD,
                "line": 31,
                "column": 1,
                "code": "E308",
                "message": "0x1018 is missing, which every device has",
                "severity": "error",
            }
        ],
        "counts": {"error": 1, "warning": 0, "info": 0},
    }


def test_a_network_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    main(["lint", "--network", *OWN, "--json"])
    rows = {each["identifier"]: each for each in json.loads(capsys.readouterr().out)["identifiers"]}
    assert rows["0x483"] == {
        "identifier": "0x483",
        "name": "Order Confirm",
        "producers": ["lift", "scale"],
        "consumers": ["panel"],
    }


def test_differences_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    main(["diff", OWN[0], OWN[0].replace("/plain/", "/packed/"), "--json"])
    found = json.loads(capsys.readouterr().out)
    mapping = {
        "where": "0x1018 sub 3",
        "aspect": "value",
        "left": "0x00010000",
        "right": "0x00020000",
        "name": "Identity object.Revision number",
    }
    assert mapping in found


def test_a_check_imports_nothing_heavy() -> None:
    code = (
        "import sys; from eurobot_od.cli import main; main(sys.argv[1:]); print(*sorted(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code, "lint", CLEAN], capture_output=True, text=True, check=True)
    heavy = {
        "canopen",
        "can",
        "yaml",
        "eurobot_od.lint.network",
        "eurobot_od.od.dictionary",
    }
    assert heavy & set(done.stderr.split()) == set()


def test_sarif_has_each_finding_once(capsys: pytest.CaptureFixture[str]) -> None:
    def results(*more: str) -> list[str]:
        main(["lint", *OWN, "--format", "sarif", *more])
        return [each["ruleId"] for each in json.loads(capsys.readouterr().out)["runs"][0]["results"]]

    assert len(results()) < len(results("-v")) == 90


@pytest.mark.parametrize("text", ["(1.5) can0 123#00\n(1.6) can0 124#01\n", "[FileInfo]\nFileName=a.eds\n", ""])
def test_fix_leaves_a_file_that_is_no_eds(capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str) -> None:
    file = tmp_path / "candump.log"
    file.write_text(text)
    assert main(["lint", "--fix", str(file)]) == 2
    assert capsys.readouterr() == ("", f"eurobot-od: {file}: not an EDS: it describes no object\n")
    assert file.read_text() == text


@pytest.fixture
def motor(tmp_path: Path) -> Path:
    return Path(shutil.copy(DOCS / "motor.eds", tmp_path))


def test_a_changed_value_prints_nothing(motor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "edit", str(motor), "set", "1017", "DefaultValue=250") == (0, "", "")
    assert motor.read_text() == (DOCS / "motor.eds").read_text().replace("DefaultValue=500", "DefaultValue=250")


def test_an_object_is_made_mapped_renamed_and_removed(motor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = motor.read_bytes()
    for words in (
        ("add", "2103", "Filter time", "type=UNSIGNED16", "access=rwr", "default=20", "map=1"),
        ("map", "TPDO1", "Filter time"),
        ("rename", "2103", "Time", "constant"),
    ):
        assert run(capsys, "edit", str(motor), *words) == (0, "", "")
    made = Dictionary.load(motor, 5)
    assert [each.variable.name for pdo in made.pdos for each in pdo.mapping if pdo.title == "TPDO 1"] == [
        "Time constant"
    ]
    assert run(capsys, "edit", str(motor), "remove", "2103").complaint.startswith("eurobot-od: not changed: ")
    assert run(capsys, "edit", str(motor), "map", "TPDO1", "6064").status == 0
    assert run(capsys, "edit", str(motor), "remove", "2103") == (0, "", "")
    assert b"2103" not in motor.read_bytes()
    assert len(motor.read_bytes().splitlines()) == len(before.splitlines())


def test_a_record_is_made_with_its_sub_indices(motor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "edit", str(motor), "add", "2104", "Lamps", "kind=RECORD").status == 0
    assert run(capsys, "edit", str(motor), "add", "2104:1", "Left", "type=BOOLEAN").status == 0
    assert Dictionary.load(motor, 5).members[0x2104].keys() == {0, 1}


def test_a_profile_is_inserted(motor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "+[6040]" in run(capsys, "edit", str(motor), "insert", "profile", "402", "--dry-run").out


def test_a_dry_run_shows_the_difference_and_writes_nothing(motor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = motor.read_bytes()
    said = run(capsys, "edit", str(motor), "set", "1017", "DefaultValue=250", "--dry-run")
    assert (said.status, said.err) == (0, "")
    assert "-DefaultValue=500\n+DefaultValue=250\n" in said.out
    assert motor.read_bytes() == before


def test_warnings_of_lint_are_printed(motor: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "edit", str(motor), "set", "2100", "HighLimit=100")
    assert said.status == 1
    assert "W442 HighLimit 100 is a REAL32" in said.out


MISTAKES = [
    (["set", "1017", "DefaultValue=70000"], "DefaultValue '70000': expected UNSIGNED16, 0..65535"),
    (["set", "1017"], "write set OBJECT KEY=VALUE..."),
    (["set", "1017", "5"], "5: write KEY=VALUE"),
    (["map", "TPDO1", "2100"], "not changed: {file}:322:14: E637 TPDO 1 maps 0x2100 sub 0, whose PDOMapping is not 1"),
    (["insert", "profile", "999"], "unknown profile '999'; known: 301, 401, 402"),
    (["insert", "402", "now"], "insert 402: write insert profile and one of 301, 401, 402"),
    (["change", "1017"], "change"),
]


@pytest.mark.parametrize(("words", "part"), MISTAKES, ids=[" ".join(each[0]) for each in MISTAKES])
def test_a_mistake_is_one_line_and_changes_nothing(
    words: list[str], part: str, motor: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = motor.read_bytes()
    said = run(capsys, "edit", str(motor), *words)
    assert said.status == 2
    assert part.format(file=motor) in said.complaint
    assert motor.read_bytes() == before


ALONE = "--robot", "none"


@pytest.fixture(autouse=True)
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a library of two files for one product, one for another, and a damaged one."""
    texts = {"axis": device_text(), "axis-old": device_text(revision=0x20001), "broken": "no EDS"}
    other = device_text(product=OTHER_PRODUCT, name="Level")
    monkeypatch.chdir(tmp_path)
    return library_of(tmp_path / "makers", other=other, **texts)


@pytest.fixture
def bus() -> Iterator[tuple[str, ...]]:
    """Two nodes of one product, one of another, and one without a file; yields the options of their bus."""
    channel = new_channel()
    texts = {5: device_text(), 6: device_text(), 7: device_text(product=OTHER_PRODUCT, name="Level")}
    texts[8] = device_text(product=0x9999)
    with ExitStack() as stack:
        for node_id, text in texts.items():
            device = SimulatedDevice(Dictionary.read(text.encode(), Path(f"{node_id}.eds"), node_id))
            stack.enter_context(Live.node(open_bus(channel), device))
        yield "-i", "virtual", "-c", channel


# devices


def test_devices_lists_the_files_and_complains_of_damaged_ones(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "devices", "--library", "makers")
    assert said.status == 0
    assert said.out.splitlines()[:2] == [
        "vendor      product     revision    type        maker    device  file",
        "0x0000029C  0x00001001  0x00020001  0x00020192  A Maker  Axis    axis-old.eds",
    ]
    assert said.complaint.endswith("broken.eds: not a readable EDS (`lint` says more)")
    data = json.loads(run(capsys, "devices", "--library", "makers", "--json").out)
    assert [(Path(each["path"]).name, each["revision"]) for each in data][:2] == [
        ("axis-old.eds", 0x20001),
        ("axis.eds", 0x20003),
    ]


def test_an_empty_library_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert run(capsys, "devices", "--library", "empty").out == "no device files in empty\n"


def test_add_puts_a_file_below_its_maker_with_what_the_maker_says(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "makers" / "device.yaml").write_text("emcy: {}\n")
    said = run(capsys, "devices", "add", "makers/axis.eds", "--library", "own")
    assert said.status == 0
    assert said.out.startswith("own/A-Maker/axis.eds: 0x0000029C:0x00001001:0x00020003 A Maker Axis")
    assert (tmp_path / "own/A-Maker/axis.eds").read_bytes() == (tmp_path / "makers/axis.eds").read_bytes()
    assert (tmp_path / "own/A-Maker/axis.device.yaml").is_file()


def test_add_names_the_other_files_of_a_product(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    said = run(capsys, "devices", "add", "makers/axis.eds", "makers/axis-old.eds", "--library", "own")
    assert [line for line in said.out.splitlines() if "also" in line] == [
        "own/A-Maker/axis.eds: also of this product: axis-old.eds",
        "own/A-Maker/axis-old.eds: also of this product: axis.eds",
    ]


def test_add_makes_the_users_own_library(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.library.library.users_folder", lambda: Path("mine/devices"))
    assert run(capsys, "devices", "add", "makers/axis.eds").status == 0
    assert Path("mine/devices/A-Maker/axis.eds").is_file()


def test_add_repairs_on_request(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "axis.eds").write_text(device_text().replace(LISTS, ""))
    said = run(capsys, "devices", "add", "axis.eds", "--fix", "--library", "own")
    assert said.status == 0
    fixed = run(capsys, "lint", "--fix", "axis.eds", "-o", "fixed.eds")
    assert said.out.startswith(fixed.out)
    assert fixed.out.startswith("axis.eds:1: ")
    assert (tmp_path / "own/A-Maker/axis.eds").read_bytes() == (tmp_path / "fixed.eds").read_bytes()


WRONG = [
    (["devices", "makers/axis.eds"], "unknown value 'makers/axis.eds'; known: add"),
    (["devices", "add"], "add which files? Name EDS, DCF, XDD or XDC files"),
    (["devices", "--fix"], "--fix is for `devices add`"),
    (["devices", "add", "makers/axis.eds", "makers/broken.eds"], "broken.eds: not a readable EDS (`lint` says more)"),
    (["devices", "add", "nowhere.eds"], "nowhere.eds: No such file or directory"),
    (["devices", "add", "changed/axis.eds"], "axis.eds: another file of this name is there; --replace replaces it"),
    (["devices", "--library", "nowhere"], "library nowhere: no such folder"),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG)
def test_what_cannot_be_added_is_one_line_and_nothing_is_added(
    capsys: pytest.CaptureFixture[str], words: list[str], complaint: str
) -> None:
    own = Path("own")
    library_of(own / "A-Maker", axis=device_text())
    library_of(Path("changed"), axis=device_text(revision=1))
    before = {file: file.read_bytes() for file in own.rglob("*.eds")}
    said = run(capsys, *words, *([] if "--library" in words else ["--library", "own"]))
    assert (said.status, len(said.err.splitlines())) == (2, 1)
    assert complaint in said.complaint
    assert {file: file.read_bytes() for file in own.rglob("*.eds")} == before


# A live bus


def scanned(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], *words: str) -> Said:
    return run(capsys, "scan", "--listen", "300 ms", *words, *bus)


def test_scan_says_which_file_fits_each_node(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> None:
    said = scanned(capsys, bus, *ALONE, "--library", "makers")
    lines = said.out.splitlines()
    assert [line.split()[-1] for line in lines[:5]] == ["file", "axis.eds", "axis.eds", "other.eds", "-"]
    assert lines[5:] == ["node 5: also of this product: axis-old.eds", "node 6: also of this product: axis-old.eds"]
    data = json.loads(scanned(capsys, bus, *ALONE, "--library", "makers", "--json").out)
    assert [each["file"] and Path(each["file"]).name for each in data] == ["axis.eds", "axis.eds", "other.eds", None]


def test_scan_without_a_library_has_no_column_of_files(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]
) -> None:
    assert scanned(capsys, bus, *ALONE).out.splitlines()[0].split()[-1] == "serial"


def test_scan_complains_of_a_file_for_another_device(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> None:
    said = scanned(capsys, bus, *ALONE, "--library", "makers", "--eds", "5=makers/other.eds")
    assert said.complaint.endswith("makers/other.eds is for another device: node 5 has product code 0x1001, not 0x1002")
    assert said.err.count("another device") == 1


# Who is another device, or not there, is said before all else


ASKING = ("scan --listen 300ms", "check --conformance --step Identity", "dump")


@pytest.mark.parametrize("words", ASKING)
def test_a_file_of_another_device_is_told_first(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: str
) -> None:
    node = ["5"] * (words == "dump")
    said = run(capsys, *words.split(), *node, *ALONE, "--eds", "5=makers/other.eds", *bus)
    assert "is for another device: node 5 has product code 0x1001, not 0x1002" in said.err.splitlines()[0]


@pytest.mark.parametrize("words", ["scan --listen 300ms", "check --conformance --step Identity"])
def test_a_node_that_is_not_there_is_told_with_those_that_are(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: str
) -> None:
    said = run(capsys, *words.split(), *ALONE, "--eds", "9=makers/axis.eds", *bus)
    assert "nodes 5, 6, 7, 8 are on this bus, node 9 is not" in said.err


def test_lss_says_which_file_fits_a_device_without_a_node_id(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = LssStation(Identity(0x29C, 0x1001, 0x20003, 7)), LssStation(Identity(1, 2, 3, 4))
    monkeypatch.setattr("eurobot_od.cli.options.BusOptions.open", lambda _: WiredBus(*devices))
    said = run(capsys, "lss", "find", "--timeout", "1 ms", "--library", "makers")
    assert sorted(said.out.splitlines()) == [
        "0x00000001:0x00000002:0x00000003:0x00000004  no node-ID",
        "0x0000029C:0x00001001:0x00020003:0x00000007  no node-ID  axis.eds",
    ]


# A command, and what it prints that only a file knows.
BY_NAME = [
    (["read", "5", "Speed"], "0x2000:0  Speed  7"),
    (["dump", "7"], "Level"),
    (["pdo", "6"], "Speed 16"),
    (["write", "5", "Speed", "9"], "node 5: 0x2000:0 Speed = 9"),
]


@pytest.mark.parametrize(("words", "printed"), BY_NAME)
def test_objects_of_a_node_have_the_names_of_its_library_file(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: list[str], printed: str
) -> None:
    said = run(capsys, *words, *ALONE, "--library", "makers", *bus)
    assert printed in said.out


@pytest.mark.parametrize("configured", ["typed", "variable", "network file"])
def test_a_library_is_named_once(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, configured: str
) -> None:
    words = ["--library", "makers"] if configured == "typed" else []
    monkeypatch.delenv("EUROBOT_OD_LIBRARY", raising=False)
    Path("eurobot-od.yaml").unlink(missing_ok=True)
    if configured == "variable":
        monkeypatch.setenv("EUROBOT_OD_LIBRARY", "makers")
    if configured == "network file":
        Path("eurobot-od.yaml").write_text("library: makers\n")
    assert "Speed" in run(capsys, "read", "5", "Speed", *ALONE, *words, *bus).out


def test_a_named_file_wins(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "mine.eds").write_text(device_text(name="Own speed"))
    said = run(capsys, "read", "5", "Own speed", *ALONE, "--library", "makers", "--eds", "5=mine.eds", *bus)
    assert said.out == "0x2000:0  Own speed  7\n"


SPOKEN_TO = {
    "restore": ("restore", "5"),
    "store": ("store", "5"),
    "program": ("program", "5", "new.bin"),
    "drive": ("drive", "5", "status"),
}


@pytest.mark.parametrize("words", SPOKEN_TO.values(), ids=SPOKEN_TO)
def test_a_command_uses_the_library_file_for_types_too(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    Path("new.bin").write_bytes(b"program")
    followed = list[str]()
    monkeypatch.setattr(Master, "follow", lambda _, device: followed.append(device.file.name))
    run(capsys, *words, *ALONE, *bus)
    assert followed == []
    run(capsys, *words, *ALONE, "--library", "makers", *bus)
    assert followed == ["axis.eds"]


OF_A_NODE = {
    "read": ("read", "5", "Level"),
    "write": ("write", "5", "Level limit", "9"),
    "dump": ("dump", "5"),
    "pdo": ("pdo", "5"),
    "dump -o": ("dump", "5", "-o", "five.dcf"),
    "emcy": ("emcy", "5"),
    "restore": ("restore", "5"),
    "store": ("store", "5"),
}


@pytest.mark.parametrize("words", OF_A_NODE.values(), ids=OF_A_NODE)
def test_a_command_for_a_node_says_that_its_named_file_is_for_another_device(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], words: tuple[str, ...]
) -> None:
    said = run(capsys, *words, *ALONE, "--library", "makers", "--eds", "5=makers/other.eds", *bus)
    told = [line for line in said.err.splitlines() if "another device" in line]
    assert told == ["eurobot-od: makers/other.eds is for another device: node 5 has product code 0x1001, not 0x1002"]
    right = run(capsys, *words[:2], *words[2:], *ALONE, "--library", "makers", "--eds", "7=makers/other.eds", *bus)
    assert "another device" not in right.err


def test_conformance_of_the_devices_on_the_bus(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> None:
    words = ["check", "--conformance", "--tag", "objects", "--step", "Device type", *ALONE, "--library", "makers"]
    said = run(capsys, *words, "--json", *bus)
    assert {each["file"] for each in json.loads(said.out)} == {"axis_5.yaml", "axis_6.yaml", "other.yaml"}


# Logs

IDENTITY = (0x29C, 0x1001, 0x20003)
SCAN = "".join(
    f"({sub}.0) can0 605#401810{sub:02X}00000000\n"
    f"({sub}.1) can0 585#431810{sub:02X}{number.to_bytes(4, 'little').hex()}\n"
    for sub, number in enumerate(IDENTITY, 1)
)
LOG = f"(0.5) can0 185#0700\n{SCAN}(4.0) can0 185#FEFF\n"

OF_LOGS = [
    (["decode"], "axis_5.TPDO1                  speed=-2"),
    (["decode", "--json"], '"fields": {"speed": -2}'),
    (["decode", "--message", "axis_5.TPDO1"], "speed=-2"),
    (["decode", "--csv"], "axis_5.TPDO1"),
    (["monitor", "--plain", "--speed", "max"], "speed=-2"),
    (["diagnose", "--json"], "verdict"),
    (["compare", "scan.log"], "no difference"),
]


@pytest.mark.parametrize(("words", "printed"), OF_LOGS)
def test_a_log_that_begins_with_a_scan_is_decoded_by_the_library(
    capsys: pytest.CaptureFixture[str], words: list[str], printed: str
) -> None:
    Path("scan.log").write_text(LOG)
    said = run(capsys, *words, "scan.log", *ALONE, "--library", "makers")
    assert printed in said.out
    assert said.err == ""


def test_a_pipe_is_decoded_from_the_answers_on(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("eurobot_od.traffic.identities.shown_in", lambda *_: {})  # nothing is read ahead
    Path("scan.log").write_text(LOG)
    said = run(capsys, "decode", "scan.log", *ALONE, "--library", "makers")
    first, *_, last = said.out.splitlines()
    assert "speed" not in first
    assert "axis_5.TPDO1                  speed=-2" in last


def test_a_log_of_another_device_than_its_file_is_one_complaint(capsys: pytest.CaptureFixture[str]) -> None:
    Path("scan.log").write_text(LOG)
    said = run(capsys, "decode", "scan.log", *ALONE, "--library", "makers", "--eds", "5=makers/other.eds")
    assert [line for line in said.err.splitlines() if "another device" in line] == [
        "eurobot-od: makers/other.eds is for another device: node 5 has product code 0x1001, not 0x1002"
    ]
    assert "level=-2" in said.out


# Clones


def configured(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...], *words: str) -> Said:
    return run(capsys, "configure", "6", "five.dcf", "--library", "makers", *ALONE, *words, *bus)


@pytest.fixture
def five(capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]) -> tuple[str, ...]:
    """Node 5 as somebody has set it, in five.dcf; gives the bus."""
    for name, value in (("Speed limit", "9"), ("0x1800:5", "250")):
        assert run(capsys, "write", "5", name, value, "--library", "makers", *ALONE, *bus).status == 0
    run(capsys, "dump", "5", "-o", "five.dcf", "--library", "makers", *ALONE, *bus)
    return bus


def test_a_node_becomes_a_clone_of_another(capsys: pytest.CaptureFixture[str], five: tuple[str, ...]) -> None:
    assert "ParameterValue=$NODEID+0x180" in Path("five.dcf").read_text()
    said = configured(capsys, five)
    assert said.status == 0
    assert "written and read back" in said.out
    assert [line.split()[0] for line in said.out.splitlines()[1:-1]] == ["0x1800:5", "0x2001:0"]
    assert run(capsys, "read", "6", "0x1800:1", *ALONE, "--library", "makers", *five).out.split()[-1] == "0x00000186"
    run(capsys, "dump", "6", "-o", "six.dcf", "--library", "makers", *ALONE, *five)
    assert run(capsys, "diff", "five.dcf", "six.dcf") == (0, "", "")
    assert run(capsys, "diff", "five.dcf", "--node", "6", *five) == (0, "", "")


def test_a_clone_asks_about_a_changed_cob_id(capsys: pytest.CaptureFixture[str], five: tuple[str, ...]) -> None:
    text = Path("five.dcf").read_text()
    Path("five.dcf").write_text(text.replace("ParameterValue=$NODEID+0x180", "ParameterValue=0x391"))
    said = configured(capsys, five)
    assert said.status == 2
    assert "0x1800:1 TPDO1 0x391; for node 6 keep them (--keep-cob-ids), or move them by 1" in said.complaint
    read = "read", "6", "0x1800:1", *ALONE, "--library", "makers", *five
    assert run(capsys, *read).out.split()[-1] == "0x00000186"  # nothing was written
    assert configured(capsys, five, "--move-cob-ids").status == 0
    assert run(capsys, *read).out.split()[-1] == "0x00000392"
    assert configured(capsys, five, "--keep-cob-ids").status == 0
    assert run(capsys, *read).out.split()[-1] == "0x00000391"


def test_a_clone_of_another_product_is_refused(capsys: pytest.CaptureFixture[str], five: tuple[str, ...]) -> None:
    said = run(capsys, "configure", "7", "five.dcf", "--library", "makers", *ALONE, *five)
    assert said.status == 2
    assert said.complaint.endswith("is for another device: node 7 has product code 0x1002, not 0x1001")


CONCISE = [([], "", 2), (["--keep-cob-ids"], "0x00000391", 0), (["--move-cob-ids"], "0x00000392", 0)]


@pytest.mark.parametrize(("words", "cob_id", "status"), CONCISE)
def test_a_concise_dcf_is_made_for_another_node(
    capsys: pytest.CaptureFixture[str], words: list[str], cob_id: str, status: int
) -> None:
    commissioned = f"{device_text()}[DeviceComissioning]\nNodeID=5\n"
    chosen = commissioned.replace("[1800sub1]\n", "[1800sub1]\nParameterValue=0x391\n")
    Path("five.dcf").write_text(chosen)
    said = run(capsys, "export", "cdcf", "6=five.dcf", *words)
    assert said.status == status
    assert cob_id in said.out


# Nodes of a network file without a file

NAMED = (
    "library: makers\nnodes: {lift: {node_id: 5, units: {Speed: rpm}}, door: {file: makers/other.eds, node_id: 7}}\n"
)


def test_a_node_without_a_file_is_described_by_the_library_under_its_own_name(
    capsys: pytest.CaptureFixture[str], bus: tuple[str, ...]
) -> None:
    Path("net.yaml").write_text(NAMED)
    said = run(capsys, "dump", "5", "--network", "net.yaml", *ALONE, *bus)
    assert "0x2000:0  Speed                  7 rpm" in said.out
    Path("run.log").write_text(SCAN + "(4.0) can0 185#0500\n(4.1) can0 187#0500\n")
    said = run(capsys, "decode", "run.log", "--network", "net.yaml", *ALONE)
    assert "lift.TPDO1" in said.out
    assert "speed=5 rpm" in said.out
    assert "door.TPDO1" in said.out


def test_a_folder_of_eds_files_is_suggested_as_a_library(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "decode", "run.log", "--network", "makers", *ALONE)
    assert said.status == 2
    assert said.complaint.endswith("they are a library: --library makers")


def test_emcy_has_the_error_names_of_the_library_file(capsys: pytest.CaptureFixture[str], library: Path) -> None:
    servo = (DOCS / "servo.eds").read_bytes()
    (library / "servo.eds").write_bytes(servo)
    (library / "servo.device.yaml").write_text("emcy: {0xFF01: gearbox jammed}\n")
    device = SimulatedDevice(Dictionary.read(servo, Path("servo.eds"), 9))
    channel = new_channel()
    device.raise_error(0xFF01, "gearbox")
    with Live.node(open_bus(channel), device):
        said = run(capsys, "emcy", "9", "--library", "makers", *ALONE, "-i", "virtual", "-c", channel)
    assert "0xFF01  gearbox jammed" in said.out
