"""How the matrix judges and prints answers, with small questions of our own."""

from __future__ import annotations

from pathlib import Path

import interop
import pytest
from interop_rows.row import Answer, Judgement, Row, agree, judge
from interop_rows.tools import CANOPEN

ABSENT = CANOPEN._replace(name="nosuch", present=lambda: False, remedy="pip install nosuch")


def agrees(_: Path) -> Answer:
    return Answer("all fine")


def agrees_but(_: Path) -> Answer:
    return Answer("fine", "not | on Sundays")


def differs(_: Path) -> Answer:
    agree("the answer", 41, 42)
    return Answer("fine")


def breaks(_: Path) -> Answer:
    raise OSError("no\nbus")


ROWS = [
    (Row(CANOPEN, "one", agrees), Judgement.AGREES, "all fine"),
    (Row(CANOPEN, "two", agrees_but), Judgement.LIMIT, "fine. Limit: not | on Sundays"),
    (Row(CANOPEN, "three", differs), Judgement.DIFFERS, "Differs: the answer: the tool has 41, we have 42"),
    (Row(CANOPEN, "four", breaks), Judgement.DIFFERS, "OSError: no bus"),
    (Row(ABSENT, "five", differs), Judgement.ABSENT, "nosuch is not here: pip install nosuch"),
]


@pytest.mark.parametrize(("row", "judgement", "said"), ROWS)
def test_judges(row: Row, judgement: Judgement, said: str, tmp_path: Path) -> None:
    assert judge(row, tmp_path) == (row, judgement, said)


def test_the_page_is_a_table(tmp_path: Path) -> None:
    lines = interop.page([judge(row, tmp_path) for row, *_ in ROWS]).splitlines()
    version = CANOPEN.version()
    assert lines[-4] == rf"| canopen (pip) | {version} | two | agrees with a limit | fine. Limit: not \| on Sundays |"
    assert lines[-1] == "| nosuch (pip) | - | five | not asked: absent | nosuch is not here: pip install nosuch |"


@pytest.mark.parametrize(("rows", "status"), [(ROWS[:2], 0), (ROWS[4:], 0), (ROWS, 1)])
def test_the_status_says_whether_a_row_differs(
    rows: list[tuple[Row, Judgement, str]],
    status: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(interop, "ROWS", [row for row, *_ in rows])
    assert interop.main(["--local"]) == status
    assert capsys.readouterr().out.count("\n") == len(rows)
