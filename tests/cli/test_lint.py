"""The commands `lint`, `diff` and `edit`: their output, their options and their exit status."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from eurobot_od.cli import main
from eurobot_od.od.dictionary import Dictionary
from tests.cli.console import run
from tests.kit import plant
from tests.kit.devices import DOCS

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
