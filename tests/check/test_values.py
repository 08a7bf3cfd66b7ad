"""Expected values: what is written fits what it should, and what is not a value is reported."""

from __future__ import annotations

from typing import Any

import pytest

from eurobot_od.check.values import LONGEST_NOTATION, FieldValues, NotSaved, Scale, ValueProblem, expectation
from eurobot_od.errors import UnknownName
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Choice, Kind, OutOfRange, Quantity
from tests.kit.plant import messages as m


def scale(kind: Kind, high: int = 3000) -> Scale:
    return Scale(FieldValues(kind, Limits(0, high)), {"speed": "60"}, frozenset({"t"}))


X, HEADING, TIME, SOURCE = m.Coordinate("mm"), m.Heading("deg"), m.Remaining("ms"), Choice(m.Source)
TENTHS = Quantity("mm", step=0.1, within=(-20, 150))
PERCENT, FLAGS = Kind("%"), m.Gates()
GATE_2 = 2 << 2

FITTING: list[tuple[Kind, str, Any]] = [
    # one value
    (X, "1200", 1200),
    (X, "0x4B0", 1200),
    (X, "1200 mm", 1200),
    (TENTHS, "-1.5 mm", -1.5),
    (X, "unknown", None),
    (SOURCE, "encoder", m.Source.ENCODER),
    (SOURCE, "laser", m.Source.LASER),
    (SOURCE, "2", m.Source.LASER),
    (TIME, "not possible", m.Fault.NOT_POSSIBLE),
    (FLAGS, "gate 2:locked", GATE_2),
    (FLAGS, "none", 0),
    # near a value, ends included
    (X, "1200 +- 15", 1185),
    (X, "1200+-15", 1215),
    (X, "1200 ± 15", 1200),
    # in a range, ends included
    (X, "88..92", 88),
    (X, "88 .. 92", 92),
    # angles go round
    (HEADING, "0 +- 5", 357),
    (HEADING, "358 +- 5", 2),
    (HEADING, "350..10", 0),
    (m.Angle("deg"), "-90", 270),
    # order
    (PERCENT, "< 50", 49),
    (PERCENT, "<= 50", 50),
    (PERCENT, "> 50", 51),
    (PERCENT, ">= 50", 50),
    # anything but
    (X, "not 1200", 1201),
    (X, "not unknown", 0),
    (SOURCE, "not encoder", OutOfRange(9)),
    (TIME, "not possible", m.Fault.NOT_POSSIBLE),
    (X, "any", None),
    (X, "any", OutOfRange(4000)),
    # variables
    (PERCENT, "{speed}", 60),
    (X, "{t}", 1000),
    (X, "< {t}", 999),
    (X, "{t} +- 5", 1004),
    (X, "7" + f"{'+- 3':>{LONGEST_NOTATION - 1}}", 10),  # the longest text that may be a notation
]

UNFIT: list[tuple[Kind, str, Any]] = [
    (X, "1200", 1201),
    (X, "1200", None),
    (X, "unknown", 0),
    (SOURCE, "encoder", OutOfRange(9)),
    (FLAGS, "gate 2:locked", 0),
    (X, "1200 +- 15", 1216),
    (X, "1200 +- 15", None),  # unknown is near nothing
    (HEADING, "0 +- 5", 6),
    (HEADING, "350..10", 11),
    (X, "88..92", 93),
    (TIME, "> 0", m.Fault.BLOCKED),  # a code is no time
    (TIME, "< 500", None),
    (X, "> 0", OutOfRange(4000)),
    (X, "not 1200", 1200),
    (X, "not unknown", None),
    (X, "< {t}", 1000),
]

NO_VALUES = [
    (X, "3001", "over the EDS's limit"),
    (X, "-1", "under it"),
    (X, "010", "an octal number in YAML 1.1"),
    (X, "1.5", "no whole number"),
    (X, "twelve", "no number"),
    (X, "", "nothing"),
    (X, "1200 cm", "another unit"),
    (X, "1200 +- much", "no tolerance"),
    (X, "< ", "no bound"),
    (SOURCE, "radar", "no member"),
    (SOURCE, "7", "a reserved number"),
    (FLAGS, "gate 2:perhaps", "no state"),
    (PERCENT, "unknown", "a field that is always known"),
    (X, "7" + f"{'+- 3':>{LONGEST_NOTATION}}", "too long for a notation"),
]


@pytest.mark.parametrize(("kind", "text", "value"), FITTING)
def test_fits(kind: Kind, text: str, value: Any) -> None:
    assert expectation(text, scale(kind)).fits(value, {"t": 1000})


@pytest.mark.parametrize(("kind", "text", "value"), UNFIT)
def test_does_not_fit(kind: Kind, text: str, value: Any) -> None:
    assert not expectation(text, scale(kind)).fits(value, {"t": 1000})


@pytest.mark.parametrize(("kind", "text"), [row[:2] for row in NO_VALUES])
def test_refuses(kind: Kind, text: str) -> None:
    with pytest.raises(ValueProblem, match="is not allowed; allowed: "):
        expectation(text, scale(kind))


def test_refuses_a_key_that_is_not_there() -> None:
    with pytest.raises(UnknownName, match="unknown gate 'gate 9'"):
        expectation("gate 9:locked", scale(FLAGS))


def test_refuses_a_variable_that_nobody_saves() -> None:
    with pytest.raises(UnknownName, match="unknown variable 'tt'"):
        expectation("{tt}", scale(X))


def test_refuses_a_constant_that_is_not_allowed_there() -> None:
    with pytest.raises(ValueProblem, match=r"'60' is not allowed; allowed: 0\.\.50 %"):
        expectation("{speed}", scale(PERCENT, 50))


def test_says_what_may_be_written() -> None:
    with pytest.raises(ValueProblem, match=r"allowed: any whole angle in degrees, unknown$"):
        expectation("None", scale(HEADING))


def test_needs_the_variable_to_be_saved_by_then() -> None:
    with pytest.raises(NotSaved, match="no step before has saved 't'"):
        expectation("{t}", scale(X)).fits(1, {})


SHOWN = [
    ("1200+-15", "1200 mm +- 15 mm"),
    ("<5", "< 5 mm"),
    ("{t}..{t}", "{t} = 7 mm .. {t} = 7 mm"),
    ("any", "anything"),
]


@pytest.mark.parametrize(("text", "shown"), SHOWN)
def test_shows_itself(text: str, shown: str) -> None:
    assert expectation(text, scale(X)).text({"t": 7}) == shown
