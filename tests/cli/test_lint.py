"""The commands `lint` and `diff`: their output, their options and their exit status."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from eurobot_od.cli import main
from tests.kit import plant

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
    (["lint", "--network", OLD], 1, f"{OLD}:1:1: E202 EDSVersion is missing"),
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


def test_fix_says_what_it_has_added_to_a_file_without_mistakes(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bare = tmp_path / "bare.eds"
    bare.write_text(re.sub(r"\[Comments\][^\[]*", "", Path(CLEAN).read_text()))
    assert main(["lint", "--fix", str(bare)]) == 0
    assert capsys.readouterr().out == f"{bare}: added: [Comments]\n"


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
    out, err = capsys.readouterr()
    assert (out, err.startswith(f"eurobot-od: {file}: not an EDS: it describes no object")) == ("", True)
    assert file.read_text() == text


def test_a_file_that_ends_in_the_middle_of_a_line_is_told_to_be_cut_off(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "cut.eds"
    file.write_text("[FileInfo]\nFileName=cut.eds\n[1000]\nParamet")
    assert main(["lint", str(file), "--select", "E106"]) == 1
    assert "nor ;comment: Paramet; the file ends here: it is cut off" in capsys.readouterr().out
