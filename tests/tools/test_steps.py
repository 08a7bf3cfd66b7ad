"""Steps: what comes of each, that they go on behind a red one, and that a hanging one is ended with its children."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from select import select

import nightly
import pytest
import ready
import steps
from environment import ROOT
from steps import Result, Step, Verdict


@pytest.fixture(autouse=True)
def prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment is the one that runs the tests."""
    monkeypatch.setattr(steps, "prepare", lambda _: Path(sys.executable))


def python(text: str) -> tuple[str, ...]:
    return sys.executable, "-c", text


FINE, RED, BROKEN = python("pass"), python("raise SystemExit(1)"), python("raise SystemExit(3)")
STEPS = [
    # (a step, what comes of it)
    (Step("fine", FINE), Verdict.PASSED, ""),
    (Step("red", RED), Verdict.FAILED, "exit status 1"),
    (Step("red, then fine", RED, FINE), Verdict.PASSED, "what failed at first passed alone"),
    (Step("red twice", RED, RED), Verdict.FAILED, "exit status 1"),
    (Step("did not come to its tests", BROKEN, FINE), Verdict.FAILED, "exit status 3"),
    (Step("not here", BROKEN, absent="no vcan0"), Verdict.SKIPPED, "no vcan0"),
]


def test_the_result_of_a_step() -> None:
    for step, verdict, note in STEPS:
        assert steps.done(step)[:2] + steps.done(step)[3:] == (step.name, verdict, note)


@pytest.mark.posix
def test_a_step_that_hangs_fails_and_is_ended_with_its_children(tmp_path: Path) -> None:
    os.mkfifo(held := tmp_path / "held by what it has started")
    reader = os.open(held, os.O_RDONLY | os.O_NONBLOCK)
    hanging = Step("hangs", ("sh", "-c", f"sleep 60 > '{held}' & sleep 60"), FINE, longest=1.0)
    assert steps.done(hanging)[1::2] == (Verdict.FAILED, "not ended within 1 s")
    assert select([reader], [], [], 30)[0], "nobody has it open any more"
    assert os.read(reader, 1) == b""
    os.close(reader)


def test_steps_go_on_after_a_failure_and_end_with_a_table(capfd: pytest.CaptureFixture[str]) -> None:
    assert steps.run([Step("red", RED), Step("last", python("print('here')"))]) == steps.RED
    out = capfd.readouterr().out
    assert "here\n" in out
    said = [line.split(maxsplit=2) for line in out.partition("\nstep ")[2].splitlines()[1:]]
    assert [(name, verdict) for name, _, verdict in said] == [
        ("set-up", "passed"),
        ("red", "FAILED: exit status 1"),
        ("last", "passed"),
        ("total", "1 of 3 failed"),
    ]
    assert steps.run([Step("fine", FINE), Step("not here", FINE, absent="no vcan0")]) == steps.FINE


def test_the_table_adds_up() -> None:
    results = [Result("ruff", Verdict.PASSED, 1.25), Result("the whole suite", Verdict.FAILED, 200.5, "exit status 2")]
    assert steps.table(results) == (
        "\nstep             seconds\n"
        "ruff                 1.2  passed\n"
        "the whole suite    200.5  FAILED: exit status 2\n"
        "total              201.8  1 of 2 failed"
    )


def test_nightly_rows_are_chosen_by_parts_of_their_names(capsys: pytest.CaptureFixture[str]) -> None:
    assert nightly.main(["--list", "broken", "fuzz"]) == 0
    names = [line[:16].strip() for line in capsys.readouterr().out.splitlines()]
    assert names == ["broken", "fuzz files", "fuzz frames", "fuzz sdo", "fuzz lint"]
    with pytest.raises(SystemExit) as ended:
        nightly.main(["teleport"])
    assert ended.value.code == 2
    assert "no row is called 'teleport'; rows: long tests, " in capsys.readouterr().err


def test_every_nightly_row_starts_an_existing_tool() -> None:
    for row in nightly.rows():
        own = [word for word in row.command if word.startswith("tools/")]
        assert all((ROOT / word).exists() for word in own), row.name


MIRRORS = [
    ("eurobot_od/sdo/wire.py", ["tests/sdo/test_wire.py"]),
    ("eurobot_od/errors.py", ["tests/test_errors.py"]),
    ("tools/steps.py", ["tests/tools/test_steps.py"]),
    ("eurobot_od/od/document.py", ["tests/od/test_document.py", "tests/od/test_document_writing.py"]),
]


def test_tests_mirror_modules() -> None:
    assert [(each, ready.mirrors(each)) for each, _ in MIRRORS] == MIRRORS
    files = ["docs/eds.md", "eurobot_od/od/__init__.py", "tests/conftest.py", "tests/test_frame.py", "tools/steps.py"]
    assert ready.tests_of(files) == ("tests/test_frame.py", "tests/tools/test_steps.py")
