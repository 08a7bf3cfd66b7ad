"""Values as suites write them: `1200`, `1200 +- 15`, `88..92`, `< 500`, `not red`, `unknown`, `"{t}"`.

What a value means, and which are allowed, is known by its kind (`pdo.kinds`); here is how a received value may relate
to a written one. Everything is checked while the suite is read, except for what a variable holds.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Kind, OutOfRange

Variables: TypeAlias = Mapping[str, Any]

VARIABLE = re.compile(r"\{\s*(?P<name>[A-Za-z_][A-Za-z0-9_]*)\s*\}")


class ValueProblem(LocalError):
    """A text that is not a value of its kind, or not in its range; the message says what is allowed."""


class NotSaved(LocalError):
    """A variable that no step has given a value yet."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no step before has saved {name!r}")


class Scale(NamedTuple):
    """What a value is measured on: its kind, its limits in the EDS, and the variables that there are.

    `constants` are the variables that have their value from the start, `saved` those that get it from a step.
    """

    kind: Kind
    limits: Limits
    constants: Variables
    saved: frozenset[str]

    def operand(self, text: str) -> Operand:
        """Read one value or variable; raises ValueProblem, UnknownName."""
        match = VARIABLE.fullmatch(text)
        if match is None:
            return Operand(self._checked(text), None, self.kind)
        name = match["name"]
        if name in self.constants:
            return Operand(self._checked(str(self.constants[name])), None, self.kind)
        if name not in self.saved:
            raise UnknownName("variable", name, sorted({*self.constants, *self.saved}))
        return Operand(None, name, self.kind)

    def _checked(self, text: str) -> Any:
        """Return the meaning of a text; what could not be sent cannot be expected either."""
        try:
            value = self.kind.parse(self._without_unit(text))
            if value is None:
                return None
            raw = self.kind.write(value, self.limits)
        except (ValueError, KeyError, TypeError):
            # a suite has `unknown` where a program has None
            allowed = self.kind.allowed(self.limits).replace("None for unknown", "unknown")
            raise ValueProblem(f"{text!r} is not allowed; allowed: {allowed}") from None
        return raw if self.kind.modulus is not None else value

    def _without_unit(self, text: str) -> str:
        unit = self.kind.unit
        return text[: -len(unit)].rstrip() if unit and text.endswith(unit) and text[:1].isdigit() else text


class Operand(NamedTuple):
    """A value, or the variable that will have it, of a kind."""

    value: Any
    variable: str | None
    kind: Kind

    def resolve(self, variables: Variables) -> Any:
        """Return the value now; raises NotSaved."""
        if self.variable is None:
            return self.value
        if self.variable not in variables:
            raise NotSaved(self.variable)
        return variables[self.variable]

    def text(self, variables: Variables) -> str:
        """Write the value for a person, with the variable it came from."""
        if self.variable is None:
            return self.kind.text(self.value)
        return f"{{{self.variable}}} = {self.kind.text(self.resolve(variables))}"


# How a received value may relate to the written ones

Test: TypeAlias = "Callable[..., bool]"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, (Enum, OutOfRange))


def _equal(_: Kind, value: Any, wanted: Any) -> bool:
    return type(value) is not OutOfRange and bool(value == wanted)


def _near(kind: Kind, value: Any, middle: Any, tolerance: Any) -> bool:
    """Compare with a tolerance; a value with a modulus goes round."""
    distance = abs(value - middle)
    return bool((distance if kind.modulus is None else min(distance, kind.modulus - distance)) <= tolerance)


def _between(kind: Kind, value: Any, low: Any, high: Any) -> bool:
    """Compare with a range, both ends included; one of a value with a modulus may go through 0."""
    if kind.modulus is not None:
        return bool((value - low) % kind.modulus <= (high - low) % kind.modulus)
    return bool(low <= value <= high)


def _ordering(compare: Callable[[Any, Any], bool]) -> Test:
    return lambda _, value, bound: compare(value, bound)


class Notation(NamedTuple):
    """A way to write an expectation: what it looks like, how it is shown, and when a value fulfils it.

    A form that is `ordered` is fulfilled only by plain numbers in their range, never by `unknown` or by a name.
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
    Notation(re.compile(r"(.+)", re.DOTALL), "{}", _equal, ordered=False),
)
"""The forms in the order in which they are tried; `not possible` is a value's name (see GotoFault)."""

LONGEST_NOTATION = 200
"""Characters up to which a text is looked at for a notation: to find none takes a time that grows with their square."""


class Expected(NamedTuple):
    """What a received value has to be."""

    form: Notation
    operands: tuple[Operand, ...]
    kind: Kind

    def fits(self, value: Any, variables: Variables) -> bool:
        """Tell whether a value is as expected; raises NotSaved."""
        operands = [operand.resolve(variables) for operand in self.operands]
        if self.form.ordered and not all(map(_is_number, (value, *operands))):
            return False
        return self.form.test(self.kind, value, *operands)

    def text(self, variables: Variables) -> str:
        """Write the expectation for a person, variables with their values."""
        return self.form.shown.format(*(operand.text(variables) for operand in self.operands))

    def shown(self, value: Any) -> str:
        """Write a received value for a person."""
        return self.kind.text(value)


class ExpectedBytes(NamedTuple):
    """The bytes that an object has to have; `encode` gives them. Values are written as hexadecimal digits."""

    encode: Callable[[Variables], bytes]

    def fits(self, value: str, variables: Variables) -> bool:
        """Tell whether the bytes are as expected; raises NotSaved."""
        return value == self.encode(variables).hex()

    def text(self, variables: Variables) -> str:
        """Write the expectation for a person."""
        return self.shown(self.encode(variables).hex())

    def shown(self, value: str) -> str:
        """Write bytes for a person."""
        return " ".join(f"{each:02X}" for each in bytes.fromhex(value)) or "no bytes"


def expectation(text: str, scale: Scale) -> Expected:
    """Read an expectation; raises ValueProblem, UnknownName."""
    written = text.strip() or "''"
    forms = NOTATIONS if len(written) <= LONGEST_NOTATION else NOTATIONS[-1:]
    form, match = next((form, match) for form in forms if (match := form.pattern.fullmatch(written)))
    return Expected(form, tuple(map(scale.operand, match.groups())), scale.kind)
