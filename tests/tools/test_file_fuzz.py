"""Mutated files: a few of every kind through the commands, and that the tool sees a command that fails."""

from __future__ import annotations

import random

import file_fuzz
import pytest

from eurobot_od.errors import LocalError

PLACE = "/tmp/input.yaml:3:5: "


@pytest.mark.parametrize("number", range(2 * len(file_fuzz.KINDS)))
def test_every_command_ends_with_its_result_or_with_a_line(number: int) -> None:
    assert file_fuzz.check(number) == []


def test_an_input_follows_from_its_number() -> None:
    numbers = range(len(file_fuzz.KINDS))
    assert [file_fuzz.make_input(n) for n in numbers] == [file_fuzz.make_input(n) for n in numbers]


@pytest.mark.parametrize("mutation", file_fuzz.MUTATIONS)
@pytest.mark.parametrize("data", [b"x", b"1\n", b"[a]\nb=0x10\n" * 20])
def test_a_mutation_takes_any_file(mutation: file_fuzz.Mutation, data: bytes) -> None:
    made = {mutation(random.Random(seed), data) for seed in range(20)}
    assert made != {data}


def fails(error: BaseException) -> object:
    def run() -> None:
        raise error

    return run


ENDS = {
    "an exception": (ZeroDivisionError("float division by zero"), ["ZeroDivisionError: float division by zero"]),
    "a status of nobody's": (SystemExit(9), ["exit status 9"]),
    "an error": (LocalError("no such thing"), []),
    "an error without a word": (SystemExit(2), ["says nothing"]),
}


@pytest.mark.parametrize(("error", "wrong"), ENDS.values(), ids=ENDS)
def test_judge_finds_each_wrong_end_of_a_command(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, wrong: list[str]
) -> None:
    monkeypatch.setattr("eurobot_od.cli.installation.doctor", fails(error))
    assert file_fuzz.judge(["doctor"]) == wrong


@pytest.mark.parametrize(
    ("line", "is_said"),
    [
        ("eurobot-od: a.eds: line 3: no", True),
        (f"{PLACE}unknown key", True),
        ("  2 x unknown identifier first at a.log:1", True),
        ("Traceback (most recent call last):", False),
        ("Transfer aborted by client", False),
    ],
)
def test_which_lines_of_standard_error_are_messages(line: str, is_said: bool) -> None:
    assert bool(file_fuzz.SAID.match(line)) is is_said
