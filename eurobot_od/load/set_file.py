"""A set of messages in YAML, for `eurobot-od load MESSAGES.yaml`.

    bit_rate: 250                             # kbit/s; -b counts before it
    mailboxes: {motor: 3}                     # transmit mailboxes without abort; a node that is not named has enough
    errors: {number: 1, within: 10 ms}        # at most so many bit errors in any such time
    messages:
      Brake:                                  # needed: identifier, length, every or answers
        {identifier: 0x010, length: 2, every: 10 ms, jitter: 500 us, deadline: 5 ms, sender: panel, reason: the pedal}
      Braked: {identifier: 0x011, length: 1, answers: Brake, jitter: 1 ms, sender: motor}
      State: {identifier: 0x18FF0001, length: 8, every: 100 ms, extended: yes, sender: motor}

Without a deadline it is the period. The `jitter` of an answer is what its node takes to make it, its deadline counts
from when the request falls due. All problems are told at once, each with file, line and column.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import yaml

from eurobot_od.errors import EurobotError
from eurobot_od.load.frames import HIGHEST_BASE, HIGHEST_EXTENDED, MOST_BYTES, longest_frame
from eurobot_od.load.message_set import MICROSECONDS, ErrorRate, MessageSet, SentMessage, by_urgency
from eurobot_od.support import durations
from eurobot_od.support.yaml_places import (
    PlacedNumber,
    Problem,
    Problems,
    ReadError,
    Text,
    any_text,
    mapping,
    number,
    read_yaml,
    record,
    refuse,
    scalar,
    shown,
)

HIGHEST_BIT_RATE = 1000
"""kbit/s of classic CAN (ISO 11898-1)."""

TRUTH = {"yes": True, "no": False, "true": True, "false": False}


class SetError(EurobotError):
    """A file that is not a set of messages: a line for each of its `problems`, in the file's order."""

    def __init__(self, file: str | Path, problems: list[Problem]) -> None:
        self.problems = sorted(set(problems))
        super().__init__("\n".join(f"{file}:{line}:{column}: {what}" for (line, column), what in self.problems))


def duration(node: yaml.Node, problems: Problems) -> PlacedNumber:
    """Read a duration, such as `10 ms`, as whole microseconds."""
    text = scalar(node, problems)
    try:
        return PlacedNumber(durations.microseconds(text), text.place)
    except durations.DurationError as error:
        refuse(node, problems, str(error))


def some_time(node: yaml.Node, problems: Problems) -> PlacedNumber:
    """Read a duration of at least a microsecond."""
    found = duration(node, problems)
    return found if found > 0 else refuse(node, problems, f"expected a time over 0, found {shown(node)}")


def truth(node: yaml.Node, problems: Problems) -> bool:
    """Read yes or no."""
    text = scalar(node, problems)
    if text not in TRUTH:
        refuse(node, problems, f"expected yes or no, found {str(text)!r}")
    return TRUTH[text]


class Row(NamedTuple):
    """A message as the file has it; times in us."""

    identifier: PlacedNumber
    length: PlacedNumber
    every: PlacedNumber | None = None
    answers: Text | None = None
    jitter: PlacedNumber | None = None
    deadline: PlacedNumber | None = None
    sender: str = ""
    extended: bool = False
    reason: str = ""


class SetFile(NamedTuple):
    """What the file says."""

    messages: dict[Text, Row]
    mailboxes: Mapping[Text, PlacedNumber] = MappingProxyType({})
    errors: ErrorRate = ErrorRate()
    bit_rate: PlacedNumber | None = None


FORM = record(
    SetFile,
    {
        "messages": mapping(
            record(
                Row,
                {"identifier": number, "length": number},
                {
                    "every": some_time,
                    "answers": any_text,
                    "jitter": duration,
                    "deadline": duration,
                    "sender": any_text,
                    "extended": truth,
                    "reason": any_text,
                },
            ),
            any_text,
        )
    },
    {
        "mailboxes": mapping(number, any_text),
        "errors": record(ErrorRate, {"number": number, "within": some_time}, {}),
        "bit_rate": number,
    },
)


def is_message_set(text: str) -> bool:
    """Tell whether a YAML text is a set of messages, and no network file: by what it lists."""
    try:
        root = yaml.compose(text, yaml.SafeLoader)
    except yaml.YAMLError:
        return False
    return isinstance(root, yaml.MappingNode) and any(key.value == "messages" for key, _ in root.value)


def read_set(text: str, file: str | Path, bit_rate: int | None = None) -> MessageSet:
    """Read the text of `file`; raises SetError with all problems, if there are any.

    `bit_rate` in bit/s counts before the file's.
    """
    problems: Problems = []
    try:
        found = read_yaml(text, FORM, problems)
    except ReadError:
        raise SetError(file, problems) from None
    problems += [problem for check in CHECKS for problem in check(found)]
    rate = bit_rate or (found.bit_rate or HIGHEST_BIT_RATE) * 1000
    problems += short_deadlines(found, rate)
    if problems:
        raise SetError(file, problems)
    messages = by_urgency(_sent(name, row, found.messages) for name, row in found.messages.items())
    mailboxes = {str(name): int(count) for name, count in found.mailboxes.items()}
    return MessageSet(messages, mailboxes, found.errors, rate if bit_rate or found.bit_rate else None)


def _sent(name: Text, row: Row, rows: Mapping[Text, Row]) -> SentMessage:
    period = _period(row, rows)
    return SentMessage(
        name=str(name),
        identifier=int(row.identifier),
        length=int(row.length),
        period=period,
        deadline=period if row.deadline is None else int(row.deadline),
        node=str(row.sender),
        jitter=int(row.jitter or 0),
        extended=row.extended,
        answers=str(row.answers or ""),
        reason=str(row.reason),
    )


def _period(row: Row, rows: Mapping[Text, Row]) -> int:
    """Return a message's own period, or that of the message that begins its chain of answers."""
    while row.every is None and row.answers is not None:
        row = rows[row.answers]
    return int(row.every or 0)


# What must hold


def wrong_numbers(found: SetFile) -> Iterator[Problem]:
    """Check what a frame, a node and a bus can be."""
    for row in found.messages.values():
        highest = HIGHEST_EXTENDED if row.extended else HIGHEST_BASE
        yield from outside("identifier", row.identifier, 0, highest, "0x{:X}")
        yield from outside("length", row.length, 0, MOST_BYTES)
    for count in found.mailboxes.values():
        yield from outside("mailboxes", count, 1, 255)
    if found.bit_rate is not None:
        yield from outside("bit_rate", found.bit_rate, 1, HIGHEST_BIT_RATE)


def outside(kind: str, value: PlacedNumber, low: int, high: int, form: str = "{}") -> Iterator[Problem]:
    """Yield a problem if a value is not in `low`..`high`."""
    if not low <= value <= high:
        yield Problem(value.place, f"{kind} {form.format(value)} is not in {form.format(low)}..{form.format(high)}")


def repeated_identifiers(found: SetFile) -> Iterator[Problem]:
    """Check that two messages are told apart: two frames of one identifier that differ destroy each other."""
    first: dict[tuple[bool, int], Text] = {}
    for name, row in found.messages.items():
        other = first.setdefault((row.extended, row.identifier), name)
        if other is not name:
            what = f"identifier 0x{row.identifier:X} is that of '{other}', line {other.place.line}, too"
            yield Problem(row.identifier.place, what)


def wrong_periods(found: SetFile) -> Iterator[Problem]:
    """Check that every message falls due again and again: by its own period, or by what it answers."""
    for name, row in found.messages.items():
        if (row.every is None) == (row.answers is None):
            yield Problem(name.place, f"'{name}' needs either every or answers")
        elif row.answers is not None and row.answers not in found.messages:
            yield Problem(row.answers.place, f"unknown message '{row.answers}'")
        elif row.answers is not None and _circular(name, found.messages):
            yield Problem(row.answers.place, f"'{name}' answers itself")


def _circular(name: Text, rows: Mapping[Text, Row]) -> bool:
    met, following = {name}, rows[name].answers
    while following is not None and following in rows and following not in met:
        met.add(following)
        following = rows[following].answers
    return following in met


CHECKS = (wrong_numbers, repeated_identifiers, wrong_periods)


def short_deadlines(found: SetFile, rate: int) -> Iterator[Problem]:
    """Check that no deadline is over before the frame can be, on a bus of `rate` bit/s."""
    for name, row in found.messages.items():
        bits = longest_frame(min(row.length, MOST_BYTES), row.extended)
        deadline = row.every if row.deadline is None else row.deadline
        if deadline is not None and deadline * rate < bits * MICROSECONDS:
            takes = f"'{name}' takes {bits * MICROSECONDS / rate:g} us for {bits} bits at {rate // 1000} kbit/s"
            yield Problem(
                deadline.place, f"{takes}, longer than its deadline of {durations.text(deadline / MICROSECONDS)}"
            )
