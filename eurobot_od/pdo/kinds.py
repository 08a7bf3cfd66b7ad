"""Kinds of fields: the two-way conversion between a field's raw value and its meaning.

A kind converts raw values to meanings and back, parses and formats them, and knows which are allowed. Special behaviour
of a field is a method of its kind: no other code tests which kind a field has. Widths and limits come from the EDS, as
arguments; so do units, ranges, steps and codes, by `Kind.of`.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from enum import Enum, IntEnum
from functools import cache, partial
from math import isfinite
from numbers import Integral
from numbers import Real as RealNumber
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self, TypeAlias, TypeVar, cast, get_type_hints

from eurobot_od.od import values
from eurobot_od.od.meanings import NO_MEANING, ObjectMeaning
from eurobot_od.od.objects import RAW_VALUE
from eurobot_od.od.units import RAW, UnitScale, digits, scale_of
from eurobot_od.od.values import DataType, Limits, typed_number, typed_real
from eurobot_od.od.words import meaning_of, with_words, words

if TYPE_CHECKING:
    from pathlib import Path

    from canopen.objectdictionary import ODVariable


class OutOfRange(int):
    """A received raw value outside its range; it is kept, marked by this type, and must not be acted on."""

    def __repr__(self) -> str:
        return f"OutOfRange({int(self)})"


UNKNOWN = "unknown"
"""The text for a value that its sender does not know, and for one whose object is unknown."""


class ColumnForm(Enum):
    """Form of a field's values in a column of a table; a value of another form is null there, and marked."""

    NUMBER = "number"
    BITS = "bits"
    BOOLEAN = "boolean"
    WORD = "word"
    SCALED = "scaled"
    REAL = "real"
    TEXT = "text"
    OCTETS = "octets"
    NOTHING = "nothing"


class KeyedForm(NamedTuple):
    """Form of a value that YAML writes as a mapping; `key` and `word` name its keys and its words in errors."""

    key: str
    keys: tuple[str, ...]
    word: str
    words: tuple[str, ...]


WHOLE = {"mm": "millimetres", "deg": "degrees"}
"""Plural of a unit, for errors about fractions."""


class MeaningError(Exception):
    """A message type and a table that disagree on a field; the text completes a sentence about the field."""


class Kind:
    """A number in `unit` whose raw value is its meaning, except for `codes`; the EDS limits are its range.

    Units, steps and codes come from a table in the file (see `od.meanings`); `of` returns the kind with those. A
    message class declares what it requires: `Kind("mm")` the unit mm, `Kind("mm", Reading)` also a code for each member
    of the enum Reading, by name. The table's unit may have a step: raw 123 of `0.1 mm` is 12.3.
    """

    scale: UnitScale
    """One step of the raw value, in the unit."""

    modulus: int | None = None
    """The number at which the value wraps around, or None."""

    unknown_as_a_whole: int | None = None
    """Raw value for "unknown", or None; it is valid only when every such field of the message has its own.

    The meaning is None, which a person writes as `unknown`.
    """

    keyed_form: KeyedForm | None = None
    """Form of the value as a mapping in YAML; `parse` then accepts `key:word,key:word`, or `none`."""

    says_more: ClassVar = False
    """Whether `text` adds words to a number and its unit."""

    column_form: ColumnForm = ColumnForm.NUMBER
    """Form of the values in a column."""

    _within: Limits | None = None

    def __init__(self, unit: str = "", codes: type[Enum] | Mapping[str, Any] = MappingProxyType({})) -> None:
        self.unit = unit
        self.scale = UnitScale(unit)
        self._needed: Mapping[str, Any] = (
            codes if isinstance(codes, Mapping) else {words_of(member): member for member in codes}
        )
        self._words: Mapping[int, str] = {}
        self._meanings: dict[int, Any] = {}
        self._raws: dict[tuple[type, Any], int] = {}
        # The numbers of an IntEnum are for a device without a table.
        self._number({name: each.value for name, each in self._needed.items() if isinstance(each, IntEnum)})

    def _number(self, codes: Mapping[str, int]) -> None:
        """Set the numbers of the codes, given by the kind's names."""
        self._words = {raw: name for name, raw in codes.items()}
        self._meanings = {raw: self._needed[name] for name, raw in codes.items()}
        self._raws = {(type(meaning), meaning): raw for raw, meaning in self._meanings.items()}

    # From the file's table

    def of(self, said: ObjectMeaning) -> Self:
        """Return the kind with a table's unit, range and codes; raises MeaningError if they do not fit."""
        if said == NO_MEANING and not self._needed.keys() - self._words.values():
            return self
        if self.unit and said.unit_alone not in ("", self.unit):
            raise MeaningError(f"is in {self.unit}, and in {said.unit_alone} in the table")
        if self.scale.factor not in (1, said.step):
            raise MeaningError(f"has steps of {self.scale.step}, and of {said.unit} in the table")
        made = copy(self)
        made.unit = self.unit or said.unit_alone
        made.scale = UnitScale(made.unit, said.step, self.scale.offset)
        if not made.scale.is_raw and self.column_form is ColumnForm.NUMBER:
            made.column_form = ColumnForm.SCALED
        if not self._needed and type(self).read is not Kind.read:  # a class with its own numbers
            self._refuse_others(said.codes)
            return made
        made._within = said.plain
        made._number(self._fitting(said.codes))
        return made

    def beside(self, file: Path) -> Kind:
        """Return the kind with what else lies beside the device's file, such as the names of a field's things."""
        return self

    def _refuse_others(self, codes: Mapping[str, int]) -> None:
        """Check that each code of the table is the kind's own, with the same number; raises MeaningError."""
        own = {plain_name(name): raw for raw, name in self.named_values().items()}
        if self.unknown_as_a_whole is not None:
            own[UNKNOWN] = self.unknown_as_a_whole
        for name, raw in codes.items():
            if own.get(plain_name(name)) != raw:
                raise MeaningError(f"knows no code '{name}' of {raw}, which the table has")

    def _fitting(self, codes: Mapping[str, int]) -> dict[str, int]:
        """Return a table's codes by the kind's names; raises MeaningError if a code is missing or unknown."""
        if not self._needed:
            self._refuse_others(codes)
            return {}
        known = {plain_name(name): name for name in self._needed}
        found = {known.get(plain_name(name), name): raw for name, raw in codes.items()}
        for name in found.keys() - self._needed.keys():
            raise MeaningError(f"knows no code '{name}', which the table has")
        for name in self._needed.keys() - found.keys():
            raise MeaningError(f"needs the code '{name}', which the table does not have")
        for name, raw in found.items():
            own = self._needed[name]
            if isinstance(own, IntEnum) and own != raw:
                raise MeaningError(f"says {int(own)} for '{name}', and the table says {raw}")
        return found

    # From raw values and back

    def read(self, raw: int, limits: Limits) -> Any:
        """Return the meaning of a raw value, or OutOfRange."""
        if raw in self._meanings:
            return self._meanings[raw]
        plain = self.measured(limits)
        # A number that stands for a code cannot be a plain value.
        if not plain.low <= raw <= plain.high or (int, raw) in self._raws:
            return OutOfRange(raw)
        return self.scale.physical(raw)

    def write(self, value: Any, limits: Limits) -> int:
        """Return the raw value; raises ValueError or TypeError if the value has none."""
        if value is None or isinstance(value, Enum):
            return self._raw_of(value)
        raw = whole_number(value) if self.scale.is_raw else self._steps(value)
        if (int, raw) in self._raws:
            return self._raws[int, raw]
        plain = self.measured(limits)
        if not plain.low <= raw <= plain.high or raw in self._meanings:
            raise ValueError(value)
        return raw

    def _raw_of(self, meaning: Any) -> int:
        """Return the number of a code; raises ValueError for an unknown one."""
        try:
            return self._raws[type(meaning), meaning]
        except KeyError:
            raise ValueError(meaning) from None

    def _steps(self, value: Any) -> int:
        try:
            return round(self.scale.raw(real_number(value)))
        except (ValueError, OverflowError):
            raise ValueError(value) from None

    def numbers(self, limits: Limits) -> range:
        """Return the raw values that are plain numbers, so that `text` writes the number and the unit."""
        if self.column_form is not ColumnForm.NUMBER:
            return range(0)
        plain = self.measured(limits)
        taken = {raw for raw, meaning in self._meanings.items() if meaning is None or meaning != raw}
        taken |= {meaning for raw, meaning in self._meanings.items() if isinstance(meaning, int) and meaning != raw}
        # Numbers below a code within the range are not included.
        return range(max([plain.low, *(raw + 1 for raw in taken if plain.low <= raw <= plain.high)]), plain.high + 1)

    def measured(self, limits: Limits) -> Limits:
        """Return the lowest and highest raw value that is a measured one, for an object with these limits."""
        return self._within or limits

    @property
    def raw_unit(self) -> str:
        """One step of the raw value with its unit, such as 0.1 mm."""
        return self.scale.step

    @property
    def distances(self) -> Kind:
        """Kind of the difference between two values."""
        return Quantity(self.unit, abs(self.scale.factor)) if self.scale.offset else self

    def sendable(self, limits: Limits) -> range:
        """Return the values that equal their raw value, so that `write` need not be called."""
        return self.numbers(limits)

    def extremes(self, limits: Limits) -> Limits:
        """Return the lowest and the highest raw value that may be sent."""
        raws = (*self.measured(limits), *self._meanings)
        return Limits(min(raws), max(raws))

    def named_values(self) -> Mapping[int, str]:
        """Return the raw values with a name of their own, independent of other fields."""
        return self._words

    # As text

    def parse(self, text: str) -> Any:
        """Parse a value; raises ValueError."""
        if text in self._needed:
            return self._needed[text]
        if text == UNKNOWN and self.unknown_as_a_whole is not None:
            return None
        number = text.removesuffix(self.unit).rstrip()  # as `text` writes it
        if number.startswith(RAW_VALUE):
            return self.scale.physical(typed_number(number.removeprefix(RAW_VALUE)))
        return typed_number(number) if self.scale.is_raw else typed_real(number)

    def text(self, value: Any) -> str:
        """Format a value: the name of an enum's member, or a number with its unit."""
        if isinstance(value, Enum):
            return words_of(value)
        if value is None:
            return UNKNOWN
        if not self.scale.is_raw and isinstance(value, OutOfRange):  # OutOfRange is always a raw value
            return f"{int(value)} x {self.raw_unit} (out of range)"
        number = str(int(value)) if self.scale.is_raw else digits(value)
        return f"{number} {self.unit}".rstrip() + (" (out of range)" if isinstance(value, OutOfRange) else "")

    def plain(self, value: Any) -> Any:
        """Return the value for JSON and CSV: a number, None for unknown, or the text."""
        return words_of(value) if isinstance(value, Enum) else value

    def allowed(self, limits: Limits) -> str:
        """Describe the allowed values."""
        step = abs(self.scale.factor)
        low, high = self.measured(limits)
        high = next((each for each in range(high, low, -1) if each not in self._words), high)  # those have names
        ends = "..".join(digits(each) for each in sorted(map(self.scale.physical, (low, high))))
        steps = "" if step == 1 else f"in steps of {digits(step)}"
        return ", ".join([" ".join(filter(None, (ends, self.unit, steps))), *self._allowed_codes()])

    def _allowed_codes(self) -> Iterator[str]:
        for raw, name in self._words.items():
            yield f"{'None for ' if self._meanings.get(raw, name) is None else ''}{name} ({raw})"

    def wanted(self, value: Any, limits: Limits) -> str:
        """Describe the allowed values, for the error about a rejected one."""
        # For 12.5, a range of 0 to 3000 would not explain the error.
        is_number = type(self).write is Kind.write and self.scale.is_raw and isinstance(value, RealNumber)
        if is_number and float(value) % 1 != 0:
            return f"whole {WHOLE.get(self.unit, 'numbers')}, {self.allowed(limits)}"
        return self.allowed(limits)


class Quantity(Kind):
    """A number of steps in `unit`, for a device without a table.

    `Quantity("mm", step=0.1, within=(-20, 150), codes=Reading)`: raw 123 is 12.3 mm, a number of the enum Reading is
    its member, any other is OutOfRange. A value to send is rounded to the nearest step; without step and offset it must
    be a whole number.

    Args:
        unit: unit of the value
        step: value of one raw step, in the unit; not 0
        within: lowest and highest value in the unit; default: the limits of the EDS
        codes: enum of raw values outside the range
        offset: added to the steps, in the unit

    Raises:
        ValueError: the step is 0 or not finite, or codes lie within the range or come without one
    """

    def __init__(
        self,
        unit: str = "",
        step: float = 1,
        within: tuple[float, float] | None = None,
        codes: type[Enum] | None = None,
        offset: float = 0,
    ) -> None:
        super().__init__(unit, codes or {})
        if not step or not isfinite(step):
            raise ValueError(f"a step of {step}")
        self.scale = UnitScale(unit, step, offset)
        self.column_form = ColumnForm.NUMBER if self.scale.is_raw else ColumnForm.SCALED
        self._within = within and Limits(*sorted(round(self.scale.raw(each)) for each in within))
        low, high = self._within or (0, 0)
        if any(low <= raw <= high or not self._within for raw in self._meanings):
            raise ValueError(f"codes need a range, and lie outside it: {codes}")


class Choice(Kind):
    """A member of an enum; a reserved number is read as OutOfRange."""

    column_form = ColumnForm.WORD

    def __init__(self, enum: type[Enum]) -> None:
        super().__init__(codes=enum)
        self.enum = enum

    def read(self, raw: int, limits: Limits) -> Any:
        # Not by the enum's ValueError, which is slow if a node sends a reserved number in every frame.
        return self._meanings[raw] if raw in self._meanings else OutOfRange(raw)

    def extremes(self, limits: Limits) -> Limits:
        return Limits(min(self._meanings), max(self._meanings))

    def write(self, value: Any, limits: Limits) -> int:
        if isinstance(value, Enum):
            return self._raw_of(value)
        if (raw := whole_number(value)) not in self._meanings:
            raise ValueError(value)
        return raw

    def parse(self, text: str) -> Any:
        if text in self._needed:
            return self._needed[text]
        if (raw := typed_number(text)) not in self._meanings:
            raise ValueError(text)
        return self._meanings[raw]

    def allowed(self, limits: Limits) -> str:
        return ", ".join(f"{name} ({raw})" for raw, name in self._words.items())

    def wanted(self, value: Any, limits: Limits) -> str:
        members = [f"{type(each).__name__}.{each.name}" for each in self._meanings.values() if isinstance(each, Enum)]
        return ", ".join(members) if isinstance(value, str) and members else self.allowed(limits)


# Kinds by data type


class Worded(Quantity):
    """A number in a `scale` with words: `says` returns those of a raw value, `codes` lists them."""

    says_more = True

    def __init__(
        self, says: Callable[[int], str], codes: Mapping[int, str] = MappingProxyType({}), scale: UnitScale = RAW
    ) -> None:
        super().__init__(scale.unit, scale.factor, offset=scale.offset)
        self._says, self._words = says, codes

    def text(self, value: Any) -> str:
        return with_words(super().text(value), self.words(value))

    def words(self, value: Any) -> str:
        """Return the words for a value; empty if there are none."""
        return self._says(int(value if isinstance(value, OutOfRange) else round(self.scale.raw(value))))

    def named_values(self) -> Mapping[int, str]:
        return self._words


class Boolean(Kind):
    """A BOOLEAN; if it is mapped with more than one bit, numbers other than 0 and 1 are out of range."""

    column_form = ColumnForm.BOOLEAN

    WORDS: ClassVar = {"false": False, "true": True, "0": False, "1": True}

    def read(self, raw: int, limits: Limits) -> Any:
        return bool(raw) if raw in (0, 1) else OutOfRange(raw)

    def write(self, value: Any, limits: Limits) -> int:
        return super().write(value, Limits(0, 1))

    def parse(self, text: str) -> Any:
        return self.WORDS[text.lower()]

    def text(self, value: Any) -> str:
        return super().text(value) if isinstance(value, OutOfRange) else str(bool(value)).lower()

    def allowed(self, limits: Limits) -> str:
        return "false, true"

    def named_values(self) -> Mapping[int, str]:
        return {0: "false", 1: "true"}


class UnknownKind(Kind):
    """Bits of an unknown object; the value is always unknown."""

    column_form = ColumnForm.NOTHING

    def read(self, raw: int, limits: Limits) -> Any:
        return None

    def write(self, value: Any, limits: Limits) -> int:
        raise ValueError(value)

    def parse(self, text: str) -> Any:
        if text != UNKNOWN:
            raise ValueError(text)

    def allowed(self, limits: Limits) -> str:
        return "nothing, because the mapped object is unknown"


class Real(Kind):
    """A floating-point number in `unit`: REAL32 or REAL64; limits in the EDS are ignored."""

    column_form = ColumnForm.REAL

    def __init__(self, type_: DataType, unit: str = "", factor: float = 1, offset: float = 0) -> None:
        super().__init__(unit)
        self.type = type_
        self.scale = UnitScale(unit, factor, offset)

    def read(self, raw: int, limits: Limits) -> Any:
        return self.scale.physical(self.type.read(raw.to_bytes(self.type.size, "little")))  # type: ignore[arg-type]

    def write(self, value: Any, limits: Limits) -> int:
        try:
            return int.from_bytes(self.type.write(self.scale.raw(real_number(value))), "little")
        except OverflowError as error:
            raise ValueError(value) from error

    def parse(self, text: str) -> Any:
        """Parse a number and round it as the type does, so that 0.1 equals a received 0.1."""
        return self.read(self.write(typed_real(text), NO_LIMITS), NO_LIMITS)

    def text(self, value: Any) -> str:
        # A REAL32 has seven significant digits; further ones (0.10000000149) come from the conversion.
        number = f"{value:.7g}" if self.type is values.REAL32 else repr(value)
        return f"{number} {self.unit}".rstrip()

    def plain(self, value: Any) -> Any:
        return value if isfinite(value) else str(value)  # JSON has neither NaN nor infinity

    def allowed(self, limits: Limits) -> str:
        return f"any {self.type.name}"


class Text(Kind):
    """A VISIBLE_STRING of whole bytes, without trailing zeros; bytes are read as Latin-1."""

    column_form = ColumnForm.TEXT

    def __init__(self, length: int) -> None:
        super().__init__()
        self.length = length

    def read(self, raw: int, limits: Limits) -> Any:
        # CiA 301 demands ASCII, but devices send other bytes, too; Latin-1 has a character for each.
        return raw.to_bytes(self.length, "little").rstrip(b"\0").decode("latin-1")

    def write(self, value: Any, limits: Limits) -> int:
        if not isinstance(value, str) or len(value) > self.length:
            raise ValueError(value)
        return int.from_bytes(value.encode("latin-1"), "little")

    def parse(self, text: str) -> Any:
        return text

    def text(self, value: Any) -> str:
        return repr(value)

    def allowed(self, limits: Limits) -> str:
        return f"up to {self.length} characters"


class Octets(Text):
    """An OCTET_STRING of whole bytes, written as two hexadecimal digits each."""

    column_form = ColumnForm.OCTETS

    def read(self, raw: int, limits: Limits) -> Any:
        return raw.to_bytes(self.length, "little")

    def write(self, value: Any, limits: Limits) -> int:
        if not isinstance(value, bytes) or len(value) != self.length:
            raise ValueError(value)
        return int.from_bytes(value, "little")

    def parse(self, text: str) -> Any:
        return bytes.fromhex(text)

    def text(self, value: Any) -> str:
        return str(value.hex().upper())

    def plain(self, value: Any) -> Any:
        return self.text(value)

    def allowed(self, limits: Limits) -> str:
        return f"{self.length} bytes as hexadecimal digits"


NO_LIMITS = Limits(0, 0)
"""Limits for a kind that ignores them."""

_OF_TYPE: Mapping[DataType, Callable[[int, UnitScale], Kind]] = {
    values.BOOLEAN: lambda *_: Boolean(),
    values.REAL32: lambda _, scale: Real(values.REAL32, *scale.parts),
    values.REAL64: lambda _, scale: Real(values.REAL64, *scale.parts),
    values.VISIBLE_STRING: lambda bits, _: Text(bits // 8),
    values.OCTET_STRING: lambda bits, _: Octets(bits // 8),
}


def kind_of(type_: DataType, bits: int, variable: ODVariable | None = None) -> Kind:
    """Return the kind of a field by its data type, its `bits`, and the mapped `variable` if it is known.

    Integers and partly mapped values (16 bits of a REAL32, 12 bits of a text) are numbers. If the whole variable is
    mapped, they have its unit, and the words of its manufacturer or of the device's profile.
    """
    known = variable if bits == type_.bits else None
    meaning, scale = (meaning_of(known), scale_of(known)) if known is not None else (None, RAW)
    if meaning and known is not None and type_.is_integer:
        return Worded(partial(words, known), meaning.codes, scale)
    whole = type_ is values.BOOLEAN or (bits == type_.bits if type_.bits else bits % 8 == 0)
    make = _OF_TYPE.get(type_)
    if make and whole:
        return make(bits, scale)
    return Kind(scale.unit) if scale.is_raw else Quantity(scale.unit, scale.factor, offset=scale.offset)


def whole_number(value: Any) -> int:
    """Return a whole number as int; raises ValueError for anything else, and for OutOfRange."""
    # `% 1` of infinity is NaN, which is not 0.
    if isinstance(value, OutOfRange) or not isinstance(value, RealNumber) or value % 1 != 0:
        raise ValueError(value)
    return int(value) if isinstance(value, Integral) else int(float(value))


def real_number(value: Any) -> float:
    """Return a number, also one of NumPy's, as float; raises ValueError for anything else, and for OutOfRange."""
    if isinstance(value, OutOfRange) or not isinstance(value, RealNumber):
        raise ValueError(value)
    return float(value)


def words_of(member: Enum) -> str:
    """Return the text for an enum's member: `not possible` for `NOT_POSSIBLE`."""
    return member.name.lower().replace("_", " ")


# The catalogue: message types by the names of their PDOs.
#
# The decorator `Catalogue.message` adds a message class. For a PDO without a class, a named tuple is made from its
# mapping.


Message: TypeAlias = NamedTuple
"""Any message."""

MessageT = TypeVar("MessageT", bound=Message)


def _equal(self: object, other: object) -> bool:
    return type(self) is type(other) and tuple.__eq__(self, other)  # type: ignore[operator]


def told_apart(message_type: _Class) -> _Class:
    """Make equality depend on the type: as plain tuples, two empty messages of different types would be equal."""
    message_type.__eq__ = _equal  # type: ignore[method-assign, assignment]
    # `object.__ne__` calls `__eq__`; tuple's own compares only the fields.
    message_type.__ne__ = object.__ne__  # type: ignore[method-assign, assignment]
    return message_type


@cache
def kinds(message_type: type[Message]) -> Mapping[str, Kind]:
    """Return the kind of every field of a message type, in order."""
    hints = get_type_hints(message_type, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in message_type._fields}


@cache
def units(message_type: type[Message]) -> Mapping[str, str]:
    """Return the units of a message type's fields that have one."""
    return {name: kind.unit for name, kind in kinds(message_type).items() if kind.unit}


def is_flagged(message: Message) -> bool:
    """Return whether any value of a received message is OutOfRange."""
    return OutOfRange in map(type, message)


def flagged_fields(message: Message) -> list[str]:
    """Return the fields of a received message whose value is OutOfRange."""
    return [name for name, value in zip(message._fields, message) if isinstance(value, OutOfRange)]


def plain(message: Message, own: Mapping[str, Kind] | None = None) -> dict[str, Any]:
    """Return a message's fields as numbers, texts, or None for unknown; by their `own` kinds or those of its type."""
    fields = zip((own or kinds(type(message))).items(), message)
    return {name: None if value is None else kind.plain(value) for (name, kind), value in fields}


@cache
def _worded(message_type: type[Message]) -> Mapping[str, Worded]:
    return {name: kind for name, kind in kinds(message_type).items() if isinstance(kind, Worded)}


def worded(message: Message) -> dict[str, str]:
    """Return the words for a message's values, where the manufacturer or the device's profile has some."""
    values = ((name, kind, getattr(message, name)) for name, kind in _worded(type(message)).items())
    said = ((name, kind.words(value)) for name, kind, value in values if value is not None)
    return {name: words for name, words in said if words}


def describe(message: Message, own: Mapping[str, Kind]) -> str:
    """Format a message's fields, without those that have their default: `x=1200 mm, angle=90 deg`.

    `own` are the kinds of its binding, with the units from the file.
    """
    defaults = message._field_defaults
    fields = ((name, kind, value) for (name, kind), value in zip(own.items(), message))
    said = ((name, kind.text(value)) for name, kind, value in fields if name not in defaults or value != defaults[name])
    return ", ".join(f"{name}={text}" for name, text in said)


_Class = TypeVar("_Class", bound=type)

NO_GROUP = ""


class CatalogueEntry(NamedTuple):
    """A message type, its `group`, and whether it is handled `always`, in every NMT state."""

    type: type[Message]
    group: str = NO_GROUP
    always: bool = False


class Catalogue:
    """Message types by the names of their PDOs; case, spaces, hyphens and underscores in a name are ignored.

    `errors` has the texts for device-specific emergency error codes (CiA 301, Table 26: 0xFF00 and up).
    """

    def __init__(self, errors: Mapping[int, str] = MappingProxyType({})) -> None:
        self.errors = dict(errors)
        self._entries: dict[str, CatalogueEntry] = {}

    def message(self, group: str = NO_GROUP, *, always: bool = False) -> Callable[[_Class], _Class]:
        """Return the decorator that adds a message class; its name is the PDO's in CamelCase."""

        def enter(message_type: _Class) -> _Class:
            self._entries[plain_name(message_type.__name__)] = CatalogueEntry(told_apart(message_type), group, always)
            return message_type

        return enter

    def copy(self) -> Catalogue:
        """Return a copy of the catalogue, to which types can be added."""
        made = Catalogue(self.errors)
        made._entries = dict(self._entries)
        return made

    def find(self, name: str) -> CatalogueEntry | None:
        """Return the entry for a PDO's name, or None."""
        return self._entries.get(plain_name(name))

    @property
    def types(self) -> tuple[type[Message], ...]:
        """All message types, in the order in which they were added."""
        return tuple(entry.type for entry in self._entries.values())

    @property
    def always(self) -> frozenset[type[Message]]:
        """Message types that are handled in every NMT state."""
        return frozenset(entry.type for entry in self._entries.values() if entry.always)

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups, in the order of their first message."""
        return tuple(dict.fromkeys(entry.group for entry in self._entries.values() if entry.group))


LONGEST_NAME = 60
"""Longest name from a file that is shown in a line, in characters."""

NOTHING = Catalogue()
"""The empty catalogue, for devices without message classes."""


def plain_name(name: str) -> str:
    """Return a name for look-up: the same for `Goto XY`, `goto-xy` and `GotoXY`."""
    return re.sub(r"[ _-]", "", name).casefold()


def readable_name(name: str) -> str:
    """Return a name without control characters and at most `LONGEST_NAME` long."""
    words = "".join(each if each.isprintable() else " " for each in name).split()
    return " ".join(words)[:LONGEST_NAME].rstrip()


def field_name(parameter_name: str) -> str:
    """Return the field name for a ParameterName: `x` for `X position`, `enemy_1_diameter` for `Enemy 1 diameter`.

    The result is always a valid name in Python: `status_raw` for `Status (raw)`, `class_` for `class`, `field_2nd_axis`
    for `2nd axis`.
    """
    words = parameter_name.lower().removesuffix(" position")
    name = re.sub(r"\W+", "_", words, flags=re.ASCII).strip("_")[:LONGEST_NAME].rstrip("_") or "field"
    if keyword.iskeyword(name):
        return f"{name}_"
    return f"field_{name}" if name[0].isdigit() else name


def made_type(name: str, kinds: Mapping[str, Kind]) -> type[Message]:
    """Return a message type for a PDO that is in no catalogue, from its fields' names and kinds.

    Python generates code for a named tuple. Only the field names come from a file, and `field_name` has reduced them to
    letters, digits and underscores.
    """
    annotated: Any = [(field, Annotated[Any, kind]) for field, kind in kinds.items()]
    made: Any = NamedTuple("Message", annotated)  # type: ignore[misc]  # made at run time
    made.__name__ = made.__qualname__ = name
    made.__doc__ = ""  # Python's default only repeats the fields
    return cast("type[Message]", told_apart(made))
