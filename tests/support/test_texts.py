"""Texts stay in their place on every way out (terminal, CSV, JUnit, SVG, DCF), and in their columns and lines."""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from eurobot_od import cli
from eurobot_od.check import report
from eurobot_od.check.report import Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.controller import Event, Report
from eurobot_od.device.objects import FileStore
from eurobot_od.lint.diff import EdsDifference
from eurobot_od.lint.findings import Finding
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import parse
from eurobot_od.support import svg
from eurobot_od.support.texts import (
    DurationError,
    amount,
    cell,
    columns,
    first_free,
    is_duration,
    microseconds,
    one_line,
    parameters,
    seconds,
    text,
)
from eurobot_od.support.yaml_places import Place
from tests.kit.devices import MOTOR

EVIL = "a\x1b[31m\nnot ok 1\r\x07\x9b\u202e\u2028\udc80"
SHOWN = r"a\x1b[31m\nnot ok 1\r\x07\x9b\u202e\u2028\udc80"

TEXTS = [
    ("plain text, 5 µm", "plain text, 5 µm", "nothing to escape"),
    (EVIL, SHOWN, "escapes, line ends, bells, C1, text direction, a surrogate of a file name"),
    *((chr(code), ascii(chr(code))[1:-1], "a control of C1 alone") for code in (0x80, 0x85, 0x9B, 0x9D, 0x9F)),
    *(
        (chr(code), ascii(chr(code))[1:-1], "a text direction alone")
        for code in (0x61C, 0x200E, 0x202A, 0x202E, 0x2069)
    ),
    (r"C:\new", r"C:\new", "a backslash is printable"),
    ("", "", "nothing"),
]


@pytest.mark.parametrize(("text", "shown", "why"), TEXTS)
def test_control_characters_are_escaped(text: str, shown: str, why: str) -> None:
    assert one_line(text) == shown, why


CELLS = [
    ("=1+2", "'=1+2"),
    ("@SUM(A1)", "'@SUM(A1)"),
    ("+49", "'+49"),
    ("-x", "'-x"),
    *((f"{sign}1+2", f"'{sign}1+2") for sign in "\uff1d\uff0b\uff0d\uff20"),  # the same in full width
    ("a=1", "a=1"),
    ("\t=1", "\\t=1"),
    (-5, -5),
    (None, None),
]


@pytest.mark.parametrize(("value", "written"), CELLS)
def test_no_cell_is_a_formula(value: Any, written: Any) -> None:
    assert cell(value) == written


def decoded(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert cli.main(["decode", "--eds", f"5={MOTOR}", *arguments]) == 0
    said = capsys.readouterr()
    return said.out + said.err


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Return a log whose channel and name contain control characters."""
    file = tmp_path / "=a\x1b[31m\nb.log"
    file.write_text("(1.000000) =c\x1b[2Jan0 185#0000000000000000\n(2.000000) can0 185#FF\x1b\n")
    return file


@pytest.mark.parametrize("form", [[], ["--json"], ["--csv"], ["--statistics"]])
def test_channels_and_file_names_are_escaped(log: Path, form: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    said = decoded(capsys, *form, str(log), str(log))
    assert all(line.isprintable() for line in said.split("\n"))


def test_a_log_with_a_name_that_is_not_utf_8_is_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    log = Path(os.fsdecode(b"a\xff.log"))
    log.write_text("(1.000000) can0 185#D27423592C01C3A5\n")
    assert cli.main(["archive", "-o", "season", "--eds", f"5={MOTOR}", str(log)]) == 0
    assert "\udcff" not in capsys.readouterr().err


def test_csv_cells_are_escaped(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    row = next(csv.DictReader(decoded(capsys, "--csv", str(log)).splitlines()))
    assert (row["channel"], row["line"]) == (r"'=c\x1b[2Jan0", "1")


def test_errors_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["decode", "no\x1b[31m\nfile.log"]) == 2
    assert capsys.readouterr().err == "eurobot-od: no\\x1b[31m\\nfile.log: No such file or directory\n"


STEP = StepResult(SuitePart.STEPS, EVIL, Place(1, 1), Status.FAILED, 0.0, 0.0, StepReason(EVIL, EVIL, EVIL))
SKIPPED = STEP._replace(status=Status.SKIPPED)
RESULT = SuiteResult(Path(f"{EVIL}.yaml"), EVIL, "simulated", (STEP, SKIPPED))
LEFT_OUT = SuiteResult(Path("x.yaml"), EVIL, "simulated", skipped=EVIL)

LINES = {
    "step": report.step_line(STEP),
    "reason": "\n".join(report.reason_lines(STEP.reason or StepReason(""))),
    "finding": str(Finding(EVIL, 1, 1, "E001", EVIL)),
    "difference": str(EdsDifference((0x1000, 0), "name", EVIL, EVIL)),
    "node strings": "\n".join(columns([("1", EVIL), ("2", "b")])),
    "report": str(Report(Event.NODE_ALARM, EVIL, EVIL, 0.0)),
}


@pytest.mark.parametrize("text", LINES.values(), ids=LINES)
def test_names_and_strings_are_escaped_in_output(text: str) -> None:
    assert all(line.isprintable() for line in text.split("\n"))


def test_junit_is_valid_xml_with_escaped_names() -> None:
    root = ElementTree.fromstring(report.junit([RESULT, LEFT_OUT]))
    assert [case.get("name") for case in root.iter("testcase")] == [SHOWN] * 3


def test_svg_is_valid_xml() -> None:
    drawn = svg.element("svg", svg.text((0.0, 0.0), EVIL), svg.title(EVIL), id=EVIL)
    root = ElementTree.fromstring(drawn)
    assert [each.text for each in root] == [SHOWN, SHOWN]
    assert root.get("id") == SHOWN


def test_a_device_name_with_line_ends_injects_no_section_into_a_dcf(tmp_path: Path) -> None:
    named = Dictionary.load(MOTOR, 5, "x\n[2000sub3]\nParameterValue=0")
    FileStore(tmp_path / "stored.dcf", named).save({}, 2)
    written = parse((tmp_path / "stored.dcf").read_text("latin-1"))
    assert written.text("devicecomissioning", "nodename") == ""
    assert "parametervalue" not in written.sections["2000sub3"].entries


# Amounts


def test_an_amount_of_one_is_singular() -> None:
    assert [amount(number, "frame") for number in range(3)] == ["0 frames", "1 frame", "2 frames"]
    assert [amount(number, "enemy", "enemies") for number in (1, 2)] == ["1 enemy", "2 enemies"]


# Columns


ROWS = [("ID", "count", "from"), ("1", "7", "drive"), ("0200", "12", "core")]


@pytest.mark.parametrize(
    ("align", "lines"),
    [
        ("", ["ID    count  from", "1     7      drive", "0200  12     core"]),
        ("rr", ["  ID  count  from", "   1      7  drive", "0200     12  core"]),
        ("llr", ["ID    count   from", "1     7      drive", "0200  12      core"]),
    ],
)
def test_a_column_is_as_wide_as_its_longest_text(align: str, lines: list[str]) -> None:
    assert list(columns(ROWS, align)) == lines


def test_a_row_is_one_line_and_ends_with_its_last_text() -> None:
    assert list(columns([("a\nb", ""), ("c", "")])) == ["a\\nb", "c"]


def test_no_rows_are_no_lines() -> None:
    assert list(columns([])) == []


VALID = [
    ("500ms", 0.5),
    ("500 ms", 0.5),
    ("  2s ", 2.0),
    ("1.5 min", 90.0),
    ("250 us", 0.00025),
    ("0 s", 0.0),
]

INVALID = [
    "500",  # no unit: seconds or milliseconds?
    "ms",  # no number
    "",
    "5 h",  # no unit of ours
    "5 S",  # siemens
    "-1 s",  # the past
    "1e3 ms",
    ".5 s",
    "1, 5 s",
    "5 ms 3",
]


@pytest.mark.parametrize(("written", "expected"), VALID)
def test_durations_are_parsed(written: str, expected: float) -> None:
    assert seconds(written) == pytest.approx(expected)
    assert microseconds(written) == round(expected * 1_000_000)
    assert is_duration(written)


@pytest.mark.parametrize("written", INVALID)
def test_texts_that_are_no_durations_are_refused(written: str) -> None:
    with pytest.raises(DurationError) as error:
        seconds(written)
    expected = f"{written!r} is not a duration; write a number and one of us, ms, s, min, such as 500 ms"
    assert str(error.value) == expected
    assert not is_duration(written)


@pytest.mark.parametrize(
    ("duration", "shown"), [(0.0, "0 ms"), (0.00025, "0.25 ms"), (0.1, "100 ms"), (1.0, "1 s"), (90.5, "90.5 s")]
)
def test_durations_are_formatted(duration: float, shown: str) -> None:
    assert text(duration) == shown


def test_the_first_free_name_is_numbered_from_2_on() -> None:
    assert [first_free("a", taken) for taken in ((), {"a"}, {"a", "a_2"})] == ["a", "a_2", "a_3"]


def test_the_parameters_of_a_function_are_written_as_a_program_writes_them() -> None:
    def match(core: object, seed: int = 1, *, status: Status = Status.PASSED, log: str | None = None) -> None: ...

    assert parameters(match) == "(core, seed=1, *, status=Status.PASSED, log=None)"
    assert parameters(match, 1) == "(seed=1, *, status=Status.PASSED, log=None)"
