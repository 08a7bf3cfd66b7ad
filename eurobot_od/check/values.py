"""Values as suites write them: `1200`, `1200 +- 15`, `88..92`, `< 500`, `not red`, `unknown`, `"{t}"`.

What a value means, and which are allowed, is known by the kind of a message's field (`pdo.kinds`) or by an object
(`od.objects`); here is how a received value may relate to a written one. Everything is checked while the suite is read,
except for what a variable holds.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, NamedTuple, TypeAlias

from canopen.objectdictionary import ODVariable

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.od import objects
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Kind, OutOfRange

Variables: TypeAlias = Mapping[str, Any]

VARIABLE = re.compile(r"\{\s*(?P<name>[A-Za-z_][A-Za-z0-9_]*)\s*(?:\|\s*0[xX](?P<bits>[0-9A-Fa-f]{1,8})\s*)?\}")


class ValueProblem(LocalError):
    """A text that is not a value of its kind, or not in its range; the message says what is allowed."""


class NotSaved(LocalError):
    """A variable that no step has given a value yet."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no step before has saved {name!r}")


class FieldValues(NamedTuple):
    """The values of a message's field: its kind, and its limits in the EDS."""

    kind: Kind
    limits: Limits

    @property
    def modulus(self) -> int | None:
        """What they wrap around at, None if they do not."""
        return self.kind.modulus

    @property
    def are_ordered(self) -> bool:
        """Whether one may be less than another: `Expected` looks at the values, as numbers may have names, too."""
        return True

    @property
    def distances(self) -> FieldValues:
        """What tolerances are: they need not be in the range that values have to be in, up to the whole of it."""
        return FieldValues(self.kind.distances, Limits(0, self.limits.high - self.limits.low))

    def parse(self, text: str) -> Any:
        """Read a value; raises ValueProblem."""
        try:
            # `1200 mm` as well as `1200`; the digit keeps a name that happens to end like the unit (`mm`) whole
            unit = self.kind.unit
            has_unit = bool(unit) and text.endswith(unit) and text.removeprefix("-")[:1].isdigit()
            value = self.kind.parse(text[: -len(unit)].rstrip() if has_unit else text)
            if value is None:
                return None
            raw = self.kind.write(value, self.limits)  # refuses what no sender could send
        except (ValueError, KeyError, TypeError):
            # a suite has `unknown` where a program has None
            allowed = self.kind.allowed(self.limits).replace("None for unknown", "unknown")
            raise ValueProblem(f"{text!r} is not allowed; allowed: {allowed}") from None
        # An angle of 450 or -10 can be written; what comes is 90 or 350, so that is what it is compared with.
        return raw if self.kind.modulus is not None else value

    def text(self, value: Any) -> str:
        """Write a value for a person."""
        return self.kind.text(value)


class ObjectValues(NamedTuple):
    """The values of an object, in the words of the commands `read` and `write`."""

    variable: ODVariable

    @property
    def modulus(self) -> None:
        """They wrap around nowhere."""

    @property
    def are_ordered(self) -> bool:
        """Whether they are numbers."""
        return objects.limits(self.variable) is not None

    @property
    def distances(self) -> ObjectValues:
        """What tolerances are: numbers of its type."""
        return ObjectValues(objects.changed(self.variable, min=0, max=None, offset=0))

    def parse(self, text: str) -> Any:
        """Read a value as the object holds it, so that what is written 0.1 equals what comes as 0.1.

        Raises FieldError.
        """
        return objects.decode(self.variable, objects.encode(self.variable, objects.parse(self.variable, text)))

    def text(self, value: Any) -> str:
        """Write a value for a person, a text with its quotes."""
        return repr(value) if isinstance(value, str) else objects.measured(self.variable, value)


Values: TypeAlias = "FieldValues | ObjectValues"
"""The values of something that can be compared: how a person writes them, and how far they are from each other.

`parse` raises LocalError for one that could not be sent, so that it cannot be expected either.
"""


class Scale(NamedTuple):
    """What a value is measured on: the values there are, and the variables.

    `constants` are the variables that have their value from the start, `saved` those that get it from a step.
    """

    values: Values
    constants: Variables
    saved: frozenset[str]

    def operand(self, text: str) -> Operand:
        """Read one value or variable; raises LocalError."""
        match = VARIABLE.fullmatch(text)
        if match is None:
            return Operand(self.values.parse(text), None, self.values)
        name = match["name"]
        if name in self.constants:
            return Operand(self.values.parse(str(self.constants[name])), None, self.values)
        if name not in self.saved:
            raise UnknownName("variable", name, sorted({*self.constants, *self.saved}))
        return Operand(None, name, self.values, int(match["bits"] or "0", 16))


class Operand(NamedTuple):
    """A value, or the variable that will have it; of a whole number some `bits` are set."""

    value: Any
    variable: str | None
    values: Values
    bits: int = 0

    def resolve(self, variables: Variables) -> Any:
        """Return the value now; raises NotSaved."""
        if self.variable is None:
            return self.value
        if self.variable not in variables:
            raise NotSaved(self.variable)
        value = variables[self.variable]
        return value | self.bits if self.bits and isinstance(value, int) else value

    def text(self, variables: Variables) -> str:
        """Write the value for a person, with the variable it came from."""
        if self.variable is None:
            return self.values.text(self.value)
        return f"{{{self.variable}}} = {self.values.text(self.resolve(variables))}"


# How a received value may relate to the written ones

Test: TypeAlias = "Callable[..., bool]"


def _equal(_: Values, value: Any, wanted: Any) -> bool:
    # OutOfRange is an int: without this a variable that saved one, or a raw number, would equal it.
    return type(value) is not OutOfRange and bool(value == wanted)


def _near(values: Values, value: Any, middle: Any, tolerance: Any) -> bool:
    """Compare with a tolerance; a value with a modulus goes round."""
    distance = abs(value - middle)
    return bool((distance if values.modulus is None else min(distance, values.modulus - distance)) <= tolerance)


def _between(values: Values, value: Any, low: Any, high: Any) -> bool:
    """Compare with a range, both ends included; one of a value with a modulus may go through 0."""
    if values.modulus is not None:
        return bool((value - low) % values.modulus <= (high - low) % values.modulus)
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
    Notation(re.compile(r"(.*)", re.DOTALL), "{}", _equal, ordered=False),
)
"""The forms in the order in which they are tried; `not possible` is a value's name (see GotoFault)."""

LONGEST_NOTATION = 200
"""Characters up to which a text is looked at for a notation: to find none takes a time that grows with their square."""


class Expected(NamedTuple):
    """What a received value has to be."""

    form: Notation
    operands: tuple[Operand, ...]
    values: Values

    def fits(self, value: Any, variables: Variables) -> bool:
        """Return whether a value is as expected; raises NotSaved."""
        operands = [operand.resolve(variables) for operand in self.operands]
        # A name such as `blocked` is a number on the wire, too, but it is not more than 500.
        numbers = (
            isinstance(each, (int, float)) and not isinstance(each, (Enum, OutOfRange)) for each in (value, *operands)
        )
        if self.form.ordered and not all(numbers):
            return False
        return self.form.test(self.values, value, *operands)

    def text(self, variables: Variables) -> str:
        """Write the expectation for a person, variables with their values."""
        return self.form.shown.format(*(operand.text(variables) for operand in self.operands))

    def shown(self, value: Any) -> str:
        """Write a received value for a person."""
        return self.values.text(value)


def expectation(text: str, scale: Scale) -> Expected:
    """Read an expectation; raises LocalError."""
    ordered = scale.values.are_ordered
    # A text is compared as it stands, spaces and all; `< 5` or `not x` may be what the object holds.
    written = text.strip() if ordered else text
    forms = NOTATIONS if len(written) <= LONGEST_NOTATION else NOTATIONS[-1:]
    may = ((each, each.pattern.fullmatch(written)) for each in forms if ordered or not each.ordered)
    form, operands = next((form, match.groups()) for form, match in may if match)
    # The second operand of `1200 +- 15` is a distance: 15 need not be a value that the field may have.
    scales = (scale, scale._replace(values=scale.values.distances) if form.test is _near else scale)
    return Expected(form, tuple(each.operand(operand) for each, operand in zip(scales, operands)), scale.values)
