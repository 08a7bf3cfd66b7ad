"""`check --profile`: suites by CiA 401 and 402, what each tier needs, and options that do not fit."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.console import run
from tests.client.servo import DOCS

IO, SERVO = f"5={DOCS / 'io.eds'}", f"5={DOCS / 'servo.eds'}"
WIRE = "0x6200:1=0x6000:1"


def test_a_module_with_a_wire_is_green(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "check", "--profile", "401", "--eds", IO, "--simulate", "--outputs", "--wired", WIRE)
    assert (said.status, said.err) == (0, "")
    assert "CiA 401, I/O module" in said.out


def test_a_fault_of_a_module_is_red(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--simulate", "--outputs", "--wired", WIRE, "--fault", "output-stuck")
    said = run(capsys, "check", "--profile", "401", "--eds", IO, *words)
    assert said.status == 1
    assert "0x6200 Outputs at the terminals: 0x6200:1 at 0x6000:1 [outputs]: bit 2 alone" in said.out


@pytest.mark.parametrize("profile", ["401", "402"])
def test_without_an_option_a_suite_only_reads(profile: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    suite = tmp_path / "suite.yaml"
    run(capsys, "check", "--profile", profile, "--eds", {"401": IO, "402": SERVO}[profile], "-o", str(suite))
    text = suite.read_text(encoding="utf-8")
    assert "read:" in text
    assert not any(word in text for word in ("write:", "nmt:"))


REFUSED = [
    (("--profile", "401", "--motion", "1@1"), "--motion needs --profile 402"),
    (("--profile", "402", "--outputs"), "--outputs needs --profile 401"),
    (("--profile", "401", "--wired", WIRE), "--wired needs --outputs"),
    (("--profile", "401", "--outputs", "--wired", "0x6200:1"), "an output and an input by number"),
    (("--profile", "401", "--outputs", "--wired", "0x6200:1=0x6000"), "an output and an input by number"),
    (("--profile", "401", "--outputs", "--wired", "0x6200:08=0x6000:1"), "an output and an input by number"),
    (("--profile", "401", "--outputs", "--wired", "0x6200:1=0x6401:1"), "no wire can lead from 0x6200:1 to 0x6401:1"),
]


@pytest.mark.parametrize(("words", "complaint"), REFUSED)
def test_what_does_not_fit_is_one_line(
    words: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "check", *words, "--eds", IO, "--simulate")
    assert (said.status, said.out) == (2, "")
    assert complaint in said.err
    assert "Traceback" not in said.err
