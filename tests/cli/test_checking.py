"""`check --profile`: suites by CiA 401 and 402, what each tier needs, and options that do not fit."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.console import run
from tests.client.servo import DOCS
from tests.rows import rows

IO, SERVO = f"5={DOCS / 'io.eds'}", f"5={DOCS / 'servo.eds'}"


def test_a_module_whose_outputs_are_switched_is_green(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", "--profile", "401", "--eds", IO, "--simulate", "--outputs")
    assert (said.status, said.err) == (0, "")
    assert "CiA 401, I/O module" in said.out


@rows("profile", ["401", "402"])
def test_without_an_option_a_suite_only_reads(profile: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    suite = tmp_path / "suite.yaml"
    run(capsys, "check", "--profile", profile, "--eds", {"401": IO, "402": SERVO}[profile], "-o", str(suite))
    text = suite.read_text(encoding="utf-8")
    assert "read:" in text
    assert not any(word in text for word in ("write:", "nmt:"))


REFUSED = [
    (("--profile", "401", "--motion", "1@1"), "--motion needs --profile 402"),
    (("--profile", "402", "--outputs"), "--outputs needs --profile 401"),
    (("--profile", "402", "--motion", "100"), "'100': a distance and a velocity above 0, such as 2000@100"),
]


@rows("words, complaint", REFUSED)
def test_what_does_not_fit_is_one_line(
    words: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "check", *words, "--eds", IO, "--simulate")
    assert (said.status, said.out) == (2, "")
    assert complaint in said.err
    assert "Traceback" not in said.err
