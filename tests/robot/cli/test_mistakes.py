"""What people get wrong with the robot's commands, and exactly what is printed then."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.console import Said, run


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run in an empty folder, without a configuration of python-can's."""
    monkeypatch.chdir(tmp_path)
    for name in ("CAN_INTERFACE", "CAN_CHANNEL", "CAN_CONFIG"):
        monkeypatch.delenv(name, raising=False)


# The command line: words, exit status, and the one line that is printed


MISTAKES = {
    "a bus for a simulated match": (
        "match|-i|socketcan|-c|can0",
        2,
        "--interface socketcan goes with --speed real only: in simulated time there is no such bus",
    ),
    "a picture in no folder": (
        "match|--field|nowhere/x.svg",
        3,
        "nowhere/x.svg: No such file or directory; make its folder first: nowhere",
    ),
    "a suite with a slip": ("check|drve|--simulate", 2, "unknown suite 'drve'; did you mean drive?"),
    "a suite of the robot for another device": (
        "check|drive|--eds|5=servo.eds|--simulate",
        2,
        "drive is a suite of eurobot2014, for its own nodes: --robot eurobot2014 without --eds and --network; "
        "for other devices: a suite of your own, --conformance, --profile",
    ),
    "a fault with a slip": (
        "check|drive|--simulate|--fault|stop-ignord",
        2,
        "unknown fault 'stop-ignord'; did you mean stop-ignored or nmt-stop-ignored or quick-stop-ignored?",
    ),
}


@pytest.mark.parametrize(("words", "status", "printed"), MISTAKES.values())
def test_a_mistake_on_the_command_line(
    words: str, status: int, printed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, *words.split("|")) == Said(status, "", f"eurobot-od: {printed}\n")


# YAML: a suite's text, and all that is printed; steps stand below HEAD, from line 5 on


def test_a_number_in_words_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "match", "--seed", "one")
    assert said.err == (
        "eurobot-od match: error: argument --seed: one is not a whole number; see eurobot-od match --help\n"
    )
