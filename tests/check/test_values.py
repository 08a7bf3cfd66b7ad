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
def test_values_that_meet_an_expectation(kind: Kind, text: str, value: Any) -> None:
    assert expectation(text, scale(kind)).fits(value, {"t": 1000})


@pytest.mark.parametrize(("kind", "text", "value"), UNFIT)
def test_values_that_do_not_meet_an_expectation(kind: Kind, text: str, value: Any) -> None:
    assert not expectation(text, scale(kind)).fits(value, {"t": 1000})


@pytest.mark.parametrize(("kind", "text"), [row[:2] for row in NO_VALUES])
def test_a_wrong_value_is_refused(kind: Kind, text: str) -> None:
    with pytest.raises(ValueProblem, match="is not allowed; allowed: "):
        expectation(text, scale(kind))


def test_an_unknown_key_is_refused() -> None:
    with pytest.raises(UnknownName, match="unknown gate 'gate 9'"):
        expectation("gate 9:locked", scale(FLAGS))


def test_a_variable_that_no_step_saves_is_refused() -> None:
    with pytest.raises(UnknownName, match="unknown variable 'tt'"):
        expectation("{tt}", scale(X))


def test_a_constant_with_a_forbidden_value_is_refused() -> None:
    with pytest.raises(ValueProblem, match=r"'60' is not allowed; allowed: 0\.\.50 %"):
        expectation("{speed}", scale(PERCENT, 50))


def test_an_error_lists_the_allowed_values() -> None:
    with pytest.raises(ValueProblem, match=r"allowed: any whole angle in degrees, unknown$"):
        expectation("None", scale(HEADING))


def test_a_variable_without_a_value_raises_not_saved() -> None:
    with pytest.raises(NotSaved, match="no step before has saved 't'"):
        expectation("{t}", scale(X)).fits(1, {})


SHOWN = [
    ("1200+-15", "1200 mm +- 15 mm"),
    ("<5", "< 5 mm"),
    ("{t}..{t}", "{t} = 7 mm .. {t} = 7 mm"),
    ("any", "anything"),
]


@pytest.mark.parametrize(("text", "shown"), SHOWN)
def test_an_expectation_is_formatted(text: str, shown: str) -> None:
    assert expectation(text, scale(X)).text({"t": 7}) == shown
