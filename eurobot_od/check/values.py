"""Values as suites write them: `1200`, `1200 +- 15`, `88..92`, `< 500`, `not red`, `unknown`, `"{t}"`.

The kind of a message's field (`pdo.kinds`) or an object (`od.objects`) says what a value means and which are allowed.
This module compares a received value with a written one. Everything is checked while the suite is read, except the
values of variables.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any, NamedTuple, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.errors import FieldError, LocalError, UnknownName
from eurobot_od.od import objects
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Kind, OutOfRange

Variables: TypeAlias = Mapping[str, Any]

VARIABLE = re.compile(r"\{\s*(?P<name>[A-Za-z_][A-Za-z0-9_]*)\s*(?:\|\s*0[xX](?P<bits>[0-9A-Fa-f]{1,8})\s*)?\}")


class ValueProblem(LocalError):
    """A text that is not an allowed value; the message says what is allowed."""


class NotSaved(LocalError):
    """A variable that no step has set yet."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no step before has saved {name!r}")


NOTATIONS_HINT = "; also 20 +- 1, 15..25, > 15, not 3, any"
"""What to write for more than one value."""

A_UNIT = re.compile(r"-?[0-9.]+\s*[A-Za-z%]+")
OTHER_NOTATION = re.compile(r".*(?:\+|[<>%]|\.\.|/-|\band\b).*")
"""Texts that were meant as a number with a unit, and as an expectation of several values."""


def _hint(text: str) -> str:
    """Return what is probably wrong in a text that is no value; empty if nothing is known."""
    if A_UNIT.fullmatch(text):
        return "; the unit is not known here"
    return NOTATIONS_HINT if OTHER_NOTATION.fullmatch(text) else ""


class FieldValues(NamedTuple):
    """The values of a message's field: its kind, and its limits in the EDS."""

    kind: Kind
    limits: Limits

    @property
    def modulus(self) -> int | None:
        """Number at which the values wrap around, None if they do not."""
        return self.kind.modulus

    @property
    def are_ordered(self) -> bool:
        """Whether values can be compared by size; always true, as `Expected` tells numbers from names itself."""
        return True

    @property
    def distances(self) -> FieldValues:
        """The values of a tolerance: from 0 to the width of the field's range."""
        return FieldValues(self.kind.distances, Limits(0, self.limits.high - self.limits.low))

    def parse(self, text: str) -> Any:
        """Parse a value; raises ValueProblem."""
        try:
            # `1200 mm` as well as `1200`; the digit keeps a name that happens to end like the unit (`mm`) whole
            unit = self.kind.unit
            has_unit = bool(unit) and text.endswith(unit) and text.removeprefix("-")[:1].isdigit()
            value = self.kind.parse(text[: -len(unit)].rstrip() if has_unit else text)
            if value is None:
                return None
            raw = self.kind.write(value, self.limits)  # raises for a value that cannot be sent
        except UnknownName:
            raise
        except (ValueError, KeyError, TypeError):
            # a suite has `unknown` where a program has None
            allowed = self.kind.allowed(self.limits).replace("None for unknown", "unknown")
            raise ValueProblem(f"{text!r} is not allowed; allowed: {allowed}{_hint(text)}") from None
        # An angle of 450 or -10 can be written, but is received as 90 or 350.
        return raw if self.kind.modulus is not None else value

    def text(self, value: Any) -> str:
        """Format a value."""
        return self.kind.text(value)


class ObjectValues(NamedTuple):
    """The values of an object, written as for the commands `read` and `write`."""

    variable: ODVariable

    @property
    def modulus(self) -> None:
        """None: objects do not wrap around."""

    @property
    def are_ordered(self) -> bool:
        """Whether they are numbers."""
        return objects.limits(self.variable) is not None

    @property
    def distances(self) -> ObjectValues:
        """The values of a tolerance: numbers of the object's type."""
        return ObjectValues(objects.changed(self.variable, min=0, max=None, offset=0))

    def parse(self, text: str) -> Any:
        """Parse a value and round it as the object does, so that a written 0.1 equals a received 0.1.

        Raises FieldError.
        """
        return objects.decode(self.variable, objects.encode(self.variable, objects.parse(self.variable, text)))

    def text(self, value: Any) -> str:
        """Format a value, a text with its quotes."""
        return repr(value) if isinstance(value, str) else objects.measured(self.variable, value)


Values: TypeAlias = "FieldValues | ObjectValues"
"""The values of a field or object.

`parse` raises LocalError for a value that cannot be sent, as it cannot be received either.
"""


class Scale(NamedTuple):
    """What a written value is read with: the values of a field or object, and the variables.

    `constants` are the variables of the suite's head with their values, `saved` those that a step sets.
    """

    values: Values
    constants: Variables
    saved: frozenset[str]

    def operand(self, text: str) -> Operand:
        """Parse one value or variable; raises LocalError."""
        match = VARIABLE.fullmatch(text)
        if match is None:
            return Operand(self.values.parse(text), None, self.values)
        name = match["name"]
        if name in self.constants:
            return Operand(self.values.parse(str(self.constants[name])), None, self.values)
        if name not in self.saved:
            raise unknown_variable(name, sorted({*self.constants, *self.saved}))
        return Operand(None, name, self.values, int(match["bits"] or "0", 16))


def unknown_variable(name: str, known: Sequence[str]) -> LocalError:
    """Return the error about a variable that nothing has saved."""
    unknown = UnknownName("variable", name, known)
    how = f"a step before it saves one, `save: {name}`, or the head has `variables:`"
    return unknown if known else LocalError(f"{unknown}; {how}")


class Operand(NamedTuple):
    """A value, or a variable that will hold it; `bits` are set in an integer."""

    value: Any
    variable: str | None
    values: Values
    bits: int = 0

    def resolve(self, variables: Variables) -> Any:
        """Return the current value; raises NotSaved."""
        if self.variable is None:
            return self.value
        if self.variable not in variables:
            raise NotSaved(self.variable)
        value = variables[self.variable]
        return value | self.bits if self.bits and isinstance(value, int) else value

    def text(self, variables: Variables) -> str:
        """Format the value, with the variable it came from."""
        if self.variable is None:
            return self.values.text(self.value)
        return f"{{{self.variable}}} = {self.values.text(self.resolve(variables))}"


# How a received value may relate to the written ones

Test: TypeAlias = "Callable[..., bool]"


def _equal(_: Values, value: Any, wanted: Any) -> bool:
    # OutOfRange is an int: without this a variable that saved one, or a raw number, would equal it.
    return type(value) is not OutOfRange and bool(value == wanted)


def _near(values: Values, value: Any, middle: Any, tolerance: Any) -> bool:
    """Return whether a value is within a tolerance of another; with a modulus, distances wrap around."""
    distance = abs(value - middle)
    return bool((distance if values.modulus is None else min(distance, values.modulus - distance)) <= tolerance)


def _between(values: Values, value: Any, low: Any, high: Any) -> bool:
    """Return whether a value is in a range, ends included; with a modulus, the range may wrap around 0."""
    if values.modulus is not None:
        return bool((value - low) % values.modulus <= (high - low) % values.modulus)
    return bool(low <= value <= high)


def _ordering(compare: Callable[[Any, Any], bool]) -> Test:
    return lambda _, value, bound: compare(value, bound)


class Notation(NamedTuple):
    """A way to write an expectation: its pattern, its display format, and the test of a value.

    An `ordered` notation accepts only plain numbers in their range, never `unknown` or a name.
    """

    pattern: re.Pattern[str]
    shown: str
    test: Test
    ordered: bool = True


NOTATIONS = (
    Notation(re.compile(r"any"), "anything", lambda *_: True, ordered=False),
    Notation(re.compile(r"(.+?)\s*(?:\+-|±)\s*(.+)"), "{} +- {}", _near),
    Notation(re.compile(r"(.+?)\s*\.\.\s*(.+)"), "{} .. {}", _between),
    Notation(re.compile(r"<=\s*(.+)"), "<= {}", _ordering(operator.le)),
    Notation(re.compile(r">=\s*(.+)"), ">= {}", _ordering(operator.ge)),
    Notation(re.compile(r"<\s*(.+)"), "< {}", _ordering(operator.lt)),
    Notation(re.compile(r">\s*(.+)"), "> {}", _ordering(operator.gt)),
    Notation(re.compile(r"not\s+(?!possible)(.+)"), "not {}", lambda *a: not _equal(*a), ordered=False),
    Notation(re.compile(r"(.*)", re.DOTALL), "{}", _equal, ordered=False),
)
"""Notations in the order in which they are tried; `not possible` is a value (see GotoFault), not a negation."""

LONGEST_NOTATION = 200
"""Longest text, in characters, that is searched for a notation: the search takes quadratic time."""


class Expected(NamedTuple):
    """An expectation of a received value."""

    form: Notation
    operands: tuple[Operand, ...]
    values: Values

    def fits(self, value: Any, variables: Variables) -> bool:
        """Return whether a value meets the expectation; raises NotSaved."""
        operands = [operand.resolve(variables) for operand in self.operands]
        # A name such as `blocked` is a number in the frame, but must not count as more than 500.
        numbers = (
            isinstance(each, (int, float)) and not isinstance(each, (Enum, OutOfRange)) for each in (value, *operands)
        )
        if self.form.ordered and not all(numbers):
            return False
        return self.form.test(self.values, value, *operands)

    def text(self, variables: Variables) -> str:
        """Format the expectation, variables with their values."""
        return self.form.shown.format(*(operand.text(variables) for operand in self.operands))

    def shown(self, value: Any) -> str:
        """Format a received value."""
        return self.values.text(value)


def expectation(text: str, scale: Scale) -> Expected:
    """Parse an expectation; raises LocalError."""
    ordered = scale.values.are_ordered
    # An object's text is compared literally: it may hold `< 5`, `not x` or spaces.
    written = text.strip() if ordered else text
    forms = NOTATIONS if len(written) <= LONGEST_NOTATION else NOTATIONS[-1:]
    may = ((each, each.pattern.fullmatch(written)) for each in forms if ordered or not each.ordered)
    form, operands = next((form, match.groups()) for form, match in may if match)
    # The second operand of `1200 +- 15` is a distance: 15 need not be a value that the field may have.
    scales = (scale, scale._replace(values=scale.values.distances) if form.test is _near else scale)
    try:
        expected = tuple(each.operand(operand) for each, operand in zip(scales, operands))
    except (ValueProblem, FieldError) as error:
        said = str(error)
        raise ValueProblem(said if NOTATIONS_HINT in said else f"{said}{_hint(written)}") from None
    if form.test is _between and all(each.variable is None for each in expected):
        _check_range(written, scale.values, *(each.value for each in expected))
    return Expected(form, expected, scale.values)


def _check_range(written: str, values: Values, low: Any, high: Any) -> None:
    """Check that a range is one of numbers, and has some; raises ValueProblem."""
    if not all(isinstance(each, (int, float)) and not isinstance(each, Enum) for each in (low, high)):
        raise ValueProblem(f"{written!r} is not a range of numbers")
    if values.modulus is None and low > high:
        raise ValueProblem(f"{written!r} has no value: the smaller number stands first")
