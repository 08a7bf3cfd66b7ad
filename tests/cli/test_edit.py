"""`edit`: what its words mean, what is refused with a reason, and what a file is after each of them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from eurobot_od.od.dictionary import Dictionary
from tests.cli.console import run

DOCS = Path(__file__).parents[2] / "docs"


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
