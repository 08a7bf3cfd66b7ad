"""A set of messages in YAML: what it says, and every mistake by its place."""

from __future__ import annotations

import pytest

from eurobot_od.load.message_set import ErrorRate, SentMessage
from eurobot_od.load.set_file import SetError, is_message_set, read_set
from tests.marks import marked

SET = """\
bit_rate: 250
mailboxes: {motor: 3}
errors: {number: 1, within: 10 ms}
messages:
  State: {identifier: 0x18FF0001, length: 8, every: 100 ms, extended: yes, sender: motor}
  Braked: {identifier: 0x11, length: 1, answers: Brake, jitter: 1 ms, sender: motor}
  Brake: {identifier: 0x10, length: 2, every: 10 ms, jitter: 500 us, deadline: 5 ms, sender: panel, reason: the pedal}
"""


def test_a_set() -> None:
    found = read_set(SET, "set.yaml")
    assert found.messages == (  # the most urgent first
        SentMessage("Brake", 0x10, 2, 10_000, 5_000, "panel", 500, reason="the pedal"),
        SentMessage("Braked", 0x11, 1, 10_000, 10_000, "motor", 1_000, answers="Brake"),
        SentMessage("State", 0x18FF0001, 8, 100_000, 100_000, "motor", extended=True),
    )
    assert (found.mailboxes, found.errors, found.bit_rate) == ({"motor": 3}, ErrorRate(1, 10_000), 250_000)


def test_the_bit_rate_that_is_asked_for_counts() -> None:
    assert read_set(SET, "set.yaml", 125_000).bit_rate == 125_000


def test_the_least() -> None:
    found = read_set("messages: {A: {identifier: 1, length: 0, every: 1 s}}", "set.yaml")
    assert found.messages == (SentMessage("A", 1, 0, 1_000_000, 1_000_000),)
    assert (found.mailboxes, found.errors, found.bit_rate) == ({}, ErrorRate(), None)


KINDS = [(SET, True), ("nodes: {}", False), ("[messages]", False), ("messages: [", False), ("", False)]


@pytest.mark.parametrize(("text", "expected"), KINDS)
def test_a_set_is_known_by_what_it_lists(text: str, expected: bool) -> None:
    assert is_message_set(text) is expected


# Each row: a text of the set, what replaces it (with ^ before the place of the problem), what is said of it.
INVALID = {
    "identifier twice": ("0x10,", "^0x11,", "identifier 0x11 is that of 'Braked', line 6, too"),
    "no such base identifier": ("0x10,", "^0x800,", "identifier 0x800 is not in 0x0..0x7FF"),
    "no such identifier": ("0x18FF0001", "^0x20000000", "identifier 0x20000000 is not in 0x0..0x1FFFFFFF"),
    "nine bytes": ("length: 2", "length: ^9", "length 9 is not in 0..8"),
    "no period": ("every: 10 ms", "every: ^0 ms", "expected a time over 0, found '0 ms'"),
    "no time": (
        "jitter: 1 ms",
        "jitter: ^1",
        "'1' is not a duration; write a number and one of us, ms, s, min, such as",
    ),
    "neither every nor answers": (
        "Braked: {identifier: 0x11, length: 1, answers: Brake,",
        "^Braked: {identifier: 0x11, length: 1,",
        "'Braked' needs either every or answers",
    ),
    "both": ("Braked: {", "^Braked: {every: 1 s, ", "'Braked' needs either every or answers"),
    "answer to nothing": ("answers: Brake,", "answers: ^Break,", "unknown message 'Break'"),
    "answer to itself": ("answers: Brake,", "answers: ^Braked,", "'Braked' answers itself"),
    "a deadline that no frame meets": (
        "deadline: 5 ms",
        "deadline: ^299 us",
        "'Brake' takes 300 us for 75 bits at 250 kbit/s, longer than its deadline of 0.299 ms",
    ),
    "a period that no frame meets": (
        "every: 100 ms",
        "every: ^600 us",
        "'State' takes 640 us for 160 bits at 250 kbit/s, longer than its deadline of 0.6 ms",
    ),
    "no mailbox": ("motor: 3", "motor: ^0", "mailboxes 0 is not in 1..255"),
    "no errors": ("within: 10 ms", "within: ^0 s", "expected a time over 0, found '0 s'"),
    "no classic CAN": ("bit_rate: 250", "bit_rate: ^5000", "bit_rate 5000 is not in 1..1000"),
    "maybe": ("extended: yes", "extended: ^maybe", "expected yes or no, found 'maybe'"),
    "unknown key": ("sender: panel", "^from: panel", "unknown key 'from'"),
}


@pytest.mark.parametrize(("old", "new", "what"), INVALID.values(), ids=INVALID)
def test_a_mistake_is_one_line_with_its_place(old: str, new: str, what: str) -> None:
    assert old in SET
    text, place = marked(SET.replace(old, new, 1))
    with pytest.raises(SetError) as error:
        read_set(text, "set.yaml")
    (line,) = str(error.value).split("\n")
    assert line.startswith(f"set.yaml:{place}: {what}")


def test_all_mistakes_are_told_at_once() -> None:
    with pytest.raises(SetError) as error:
        read_set(SET.replace("length: 8", "length: 64").replace("0x11,", "0x10,"), "set.yaml")
    assert [problem.place.line for problem in error.value.problems] == [5, 7]


def test_a_deadline_that_only_a_faster_bus_meets() -> None:
    assert read_set(SET, "set.yaml", 20_000).bit_rate == 20_000
    with pytest.raises(SetError, match="'Brake' takes 7500 us for 75 bits at 10 kbit/s"):
        read_set(SET, "set.yaml", 10_000)
