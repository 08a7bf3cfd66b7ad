"""Kinds of fields: the two-way conversion between a field's raw value and its meaning.

A kind says what a raw value means, which raw value a meaning has, how a person writes it, and what is allowed. Whatever
is special about a field is a method of its kind: no other code asks which kind a field has. Widths and limits come from
the EDS, as arguments; units, plain ranges, steps and codes as well, by `Kind.of`.
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
    from canopen.objectdictionary import ODVariable


class OutOfRange(int):
    """A received raw value outside its range: kept as it came, flagged by its type, not to be acted on."""

    def __repr__(self) -> str:
        return f"OutOfRange({int(self)})"


UNKNOWN = "unknown"
"""The word for a value that its sender does not know, and for one of which nobody knows what it is."""


class ColumnForm(Enum):
    """The form of a field's values in a column of a table; anything else is null there, with a flag beside it."""

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
    """How a value is written in YAML as a mapping; `key` and `word` say what its keys and its words stand for."""

    key: str
    keys: tuple[str, ...]
    word: str
    words: tuple[str, ...]


WHOLE = {"mm": "millimetres", "deg": "degrees"}
"""What a unit is called where only whole ones are allowed."""


class MeaningError(Exception):
    """A message type and a table that cannot agree on a field: what the field `is`, or needs, in words."""


class Kind:
    """A number in `unit`; raw value and meaning are the same, the EDS limits are the range, and `codes` mean something.

    What a number means is the table's, which a file says (see `od.meanings`): `of` makes the kind that has it. A class
    of messages names what it needs: `Kind("mm")` that the unit is mm, `Kind("mm", Reading)` that the table has a code
    for each member of the enum Reading, by its name. The table's unit may have a step: raw 123 of `0.1 mm` is 12.3.
    """

    scale: UnitScale
    """What one step of the raw value is, in the unit."""

    modulus: int | None = None
    """What the value wraps around at, None for a value that does not."""

    unknown_as_a_whole: int | None = None
    """The raw value that means "unknown" if all such fields of the message have theirs, None without one.

    Such a field may also be None as a meaning, which a person writes `unknown`.
    """

    keyed_form: KeyedForm | None = None
    """How people may write the value in YAML as a mapping; `parse` then takes `key:word,key:word`, or `none`."""

    says_more: ClassVar = False
    """Whether `text` writes more of a plain number than the number and its unit."""

    column_form: ColumnForm = ColumnForm.NUMBER
    """What the values are in a column: the raw values in `numbers`, all raw BITS, or what the form says."""

    _within: Limits | None = None

    def __init__(self, unit: str = "", codes: type[Enum] | Mapping[str, Any] = MappingProxyType({})) -> None:
        self.unit, self.scale = unit, UnitScale(unit)
        self._needed: Mapping[str, Any] = (
            codes if isinstance(codes, Mapping) else {words_of(member): member for member in codes}
        )
        self._words: Mapping[int, str] = {}
        self._meanings: dict[int, Any] = {}
        self._raws: dict[tuple[type, Any], int] = {}
        # an IntEnum has its numbers with it: for a device without a table
        self._number({name: each.value for name, each in self._needed.items() if isinstance(each, IntEnum)})

    def _number(self, codes: Mapping[str, int]) -> None:
        """Take over the numbers of codes, by the names that the kind has for them."""
        self._words = {raw: name for name, raw in codes.items()}
        self._meanings = {raw: self._needed[name] for name, raw in codes.items()}
        self._raws = {(type(meaning), meaning): raw for raw, meaning in self._meanings.items()}

    # What the table says

    def of(self, said: ObjectMeaning) -> Self:
        """Return the kind with the unit, range and codes that a table says; raises MeaningError if they do not fit."""
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
        if not self._needed and type(self).read is not Kind.read:  # a class that has its numbers itself
            self._refuse_others(said.codes)
            return made
        made._within = said.plain
        made._number(self._fitting(said.codes))
        return made

    def _refuse_others(self, codes: Mapping[str, int]) -> None:
        """Raise MeaningError for a code of the table that is none of the kind's own, or has another number there."""
        own = {plain_name(name): raw for raw, name in self.named_values().items()}
        if self.unknown_as_a_whole is not None:
            own[UNKNOWN] = self.unknown_as_a_whole
        for name, raw in codes.items():
            if own.get(plain_name(name)) != raw:
                raise MeaningError(f"knows no code '{name}' of {raw}, which the table has")

    def _fitting(self, codes: Mapping[str, int]) -> dict[str, int]:
        """Return a table's codes by the names that the kind has for them; raises MeaningError if they are not those."""
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
        # a number that a code stands for is that code's: as a plain one it would be taken for it
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
        """Return the number of a code; raises ValueError for what is none of this kind's."""
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
        """Return the raw values that mean their own number, so that `text` writes that and the unit."""
        if self.column_form is not ColumnForm.NUMBER:
            return range(0)
        plain = self.measured(limits)
        taken = {raw for raw, meaning in self._meanings.items() if meaning is None or meaning != raw}
        taken |= {meaning for raw, meaning in self._meanings.items() if isinstance(meaning, int) and meaning != raw}
        # a code within the range would cut it in two: what is below it is read one by one
        return range(max([plain.low, *(raw + 1 for raw in taken if plain.low <= raw <= plain.high)]), plain.high + 1)

    def measured(self, limits: Limits) -> Limits:
        """Return the lowest and the highest raw value that is a plain one, in an object of these limits."""
        return self._within or limits

    @property
    def raw_unit(self) -> str:
        """What one step of the raw values is, such as 0.1 mm."""
        return self.scale.step

    @property
    def distances(self) -> Kind:
        """The kind of the distance between two values."""
        return Quantity(self.unit, abs(self.scale.factor)) if self.scale.offset else self

    def sendable(self, limits: Limits) -> range:
        """Return the values that are their own raw value, which `write` need not be asked about."""
        return self.numbers(limits)

    def extremes(self, limits: Limits) -> Limits:
        """Return the lowest and the highest raw value that there is to be sent."""
        raws = (*self.measured(limits), *self._meanings)
        return Limits(min(raws), max(raws))

    def named_values(self) -> Mapping[int, str]:
        """Return the raw values that have a name of their own, whatever the other fields of the message are."""
        return self._words

    # As a person writes it

    def parse(self, text: str) -> Any:
        """Read what a person wrote; raises ValueError."""
        if text in self._needed:
            return self._needed[text]
        if text == UNKNOWN and self.unknown_as_a_whole is not None:
            return None
        number = text.removesuffix(self.unit).rstrip()  # as `text` writes it
        if number.startswith(RAW_VALUE):
            return self.scale.physical(typed_number(number.removeprefix(RAW_VALUE)))
        return typed_number(number) if self.scale.is_raw else typed_real(number)

    def text(self, value: Any) -> str:
        """Write the value for a person: the name of an enum's member, or a number with its unit."""
        if isinstance(value, Enum):
            return words_of(value)
        if value is None:
            return UNKNOWN
        if not self.scale.is_raw and isinstance(value, OutOfRange):  # raw, as everywhere
            return f"{int(value)} x {self.raw_unit} (out of range)"
        number = str(int(value)) if self.scale.is_raw else digits(value)
        return f"{number} {self.unit}".rstrip() + (" (out of range)" if isinstance(value, OutOfRange) else "")

    def plain(self, value: Any) -> Any:
        """Return the value for JSON and CSV: a number, None for unknown, or the words that a person writes."""
        return words_of(value) if isinstance(value, Enum) else value

    def allowed(self, limits: Limits) -> str:
        """Say what may be sent."""
        step = abs(self.scale.factor)
        ends = "..".join(digits(each) for each in sorted(map(self.scale.physical, self.measured(limits))))
        steps = "" if step == 1 else f"in steps of {digits(step)}"
        return ", ".join([" ".join(filter(None, (ends, self.unit, steps))), *self._allowed_codes()])

    def _allowed_codes(self) -> Iterator[str]:
        for raw, name in self._words.items():
            yield f"{'None for ' if self._meanings.get(raw, name) is None else ''}{name} ({raw})"

    def wanted(self, value: Any, limits: Limits) -> str:
        """Say what may be sent to somebody who wanted to send a value that may not."""
        # 12.5 is between 0 and 3000: the range alone would not tell what is wrong with it.
        is_number = type(self).write is Kind.write and self.scale.is_raw and isinstance(value, RealNumber)
        if is_number and float(value) % 1 != 0:
            return f"whole {WHOLE.get(self.unit, 'numbers')}, {self.allowed(limits)}"
        return self.allowed(limits)


class Quantity(Kind):
    """A number of steps of a `unit`, from `within[0]` to `within[1]` units; raw values of `codes` mean something else.

    It is for a device without a table.

    `Quantity("mm", step=0.1, within=(-20, 150), codes=Reading)`: raw 123 is 12.3 mm, a raw value of the enum Reading is
    its member, any other is OutOfRange. An `offset` in units is added to the steps. What is sent is rounded to the
    nearest step; without a step and an offset it is a whole number. Raises ValueError for a step that is 0 or not
    finite, and for codes without a range or within it.
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
    """One of the members of an enum; a reserved number is read as OutOfRange."""

    column_form = ColumnForm.WORD

    def __init__(self, enum: type[Enum]) -> None:
        super().__init__(codes=enum)
        self.enum = enum

    def read(self, raw: int, limits: Limits) -> Any:
        # Not by calling the enum and catching its error: a node may send a reserved number in every frame.
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


# What is known of an object by its data type alone


class Worded(Quantity):
    """A number in a `scale` that somebody has words for: `says` has those of a raw value, `codes` is a list of them."""

    says_more = True

    def __init__(
        self, says: Callable[[int], str], codes: Mapping[int, str] = MappingProxyType({}), scale: UnitScale = RAW
    ) -> None:
        super().__init__(scale.unit, scale.factor, offset=scale.offset)
        self._says, self._words = says, codes

    def text(self, value: Any) -> str:
        return with_words(super().text(value), self.words(value))

    def words(self, value: Any) -> str:
        """Return what a value says; empty if nobody says anything of it."""
        return self._says(int(value if isinstance(value, OutOfRange) else round(self.scale.raw(value))))

    def named_values(self) -> Mapping[int, str]:
        return self._words


class Boolean(Kind):
    """A BOOLEAN; mapped with more than its one bit, any other number than 0 and 1 is out of range."""

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
    """Bits of an object that nobody knows: whatever they are, the value is unknown."""

    column_form = ColumnForm.NOTHING

    def read(self, raw: int, limits: Limits) -> Any:
        return None

    def write(self, value: Any, limits: Limits) -> int:
        raise ValueError(value)

    def parse(self, text: str) -> Any:
        if text != UNKNOWN:
            raise ValueError(text)

    def allowed(self, limits: Limits) -> str:
        return "nothing, as it is not known which object is mapped"


class Real(Kind):
    """A floating-point number in `unit`: REAL32 or REAL64. An EDS's limits of one are not looked at."""

    column_form = ColumnForm.REAL

    def __init__(self, type_: DataType, unit: str = "", factor: float = 1, offset: float = 0) -> None:
        super().__init__(unit)
        self.type, self.scale = type_, UnitScale(unit, factor, offset)

    def read(self, raw: int, limits: Limits) -> Any:
        return self.scale.physical(self.type.read(raw.to_bytes(self.type.size, "little")))  # type: ignore[arg-type]

    def write(self, value: Any, limits: Limits) -> int:
        try:
            return int.from_bytes(self.type.write(self.scale.raw(real_number(value))), "little")
        except OverflowError as error:
            raise ValueError(value) from error

    def parse(self, text: str) -> Any:
        """Read a number as the type holds it, so that what is written 0.1 equals what is received as 0.1."""
        return self.read(self.write(typed_real(text), NO_LIMITS), NO_LIMITS)

    def text(self, value: Any) -> str:
        # A REAL32 has seven digits; the rest of what Python shows of it (0.10000000149) is the conversion's.
        number = f"{value:.7g}" if self.type is values.REAL32 else repr(value)
        return f"{number} {self.unit}".rstrip()

    def plain(self, value: Any) -> Any:
        return value if isfinite(value) else str(value)  # JSON has neither NaN nor infinity

    def allowed(self, limits: Limits) -> str:
        return f"any {self.type.name}"


class Text(Kind):
    """A VISIBLE_STRING of whole bytes, without the zeros that fill it up; any byte is a character of Latin-1."""

    column_form = ColumnForm.TEXT

    def __init__(self, length: int) -> None:
        super().__init__()
        self.length = length

    def read(self, raw: int, limits: Limits) -> Any:
        # CiA 301 has ASCII here, but devices send what they like: Latin-1 has a character for any byte.
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
    """An OCTET_STRING of whole bytes; a person writes two hexadecimal digits for each."""

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
"""For a kind that looks at none."""

_OF_TYPE: Mapping[DataType, Callable[[int, UnitScale], Kind]] = {
    values.BOOLEAN: lambda *_: Boolean(),
    values.REAL32: lambda _, scale: Real(values.REAL32, *scale.parts),
    values.REAL64: lambda _, scale: Real(values.REAL64, *scale.parts),
    values.VISIBLE_STRING: lambda bits, _: Text(bits // 8),
    values.OCTET_STRING: lambda bits, _: Octets(bits // 8),
}


def kind_of(type_: DataType, bits: int, variable: ODVariable | None = None) -> Kind:
    """Return the kind of a field of a data type that has `bits` bits, those of a `variable` if it is known.

    Integers, and what is mapped in part only (16 bits of a REAL32, 12 bits of a text), are numbers; they have the unit
    of the variable, and the words of its maker or of the device's profile, if the whole variable is mapped.
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
    """Return a whole number as int; raises ValueError for 1.5, infinity, what is not a number and what is flagged."""
    # What came flagged must not be sent on as if it were a value. `% 1` of infinity is NaN, which is not 0 either.
    if isinstance(value, OutOfRange) or not isinstance(value, RealNumber) or value % 1 != 0:
        raise ValueError(value)
    return int(value) if isinstance(value, Integral) else int(float(value))


def real_number(value: Any) -> float:
    """Return a number, also one of NumPy's, as float; raises ValueError for anything else and for what is flagged."""
    if isinstance(value, OutOfRange) or not isinstance(value, RealNumber):
        raise ValueError(value)
    return float(value)


def words_of(member: Enum) -> str:
    """Return an enum's member as people write it: `NOT_POSSIBLE` is `not possible`."""
    return member.name.lower().replace("_", " ")


# The catalogue: which message type stands for a PDO, by the PDO's name, and what a message type is.
#
# The decorator `Catalogue.message` enters a message class. A PDO without a class gets a named tuple made from its
# mapping.


Message: TypeAlias = NamedTuple
"""Any message."""

MessageT = TypeVar("MessageT", bound=Message)


def _equal(self: object, other: object) -> bool:
    return type(self) is type(other) and tuple.__eq__(self, other)  # type: ignore[operator]


def told_apart(message_type: _Class) -> _Class:
    """Make equality depend on the type: as mere tuples a Goto Confirm and a Stop Drive, both empty, would be equal."""
    message_type.__eq__ = _equal  # type: ignore[method-assign, assignment]
    # object's `!=` asks `__eq__`; tuple's own would go on comparing the fields only.
    message_type.__ne__ = object.__ne__  # type: ignore[method-assign, assignment]
    return message_type


@cache
def kinds(message_type: type[Message]) -> Mapping[str, Kind]:
    """Return the kind of every field of a message type, in their order."""
    hints = get_type_hints(message_type, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in message_type._fields}


@cache
def units(message_type: type[Message]) -> Mapping[str, str]:
    """Return the unit of every field of a message type that has one."""
    return {name: kind.unit for name, kind in kinds(message_type).items() if kind.unit}


def is_flagged(message: Message) -> bool:
    """Return whether any value of a received message is out of range."""
    return OutOfRange in map(type, message)


def flagged_fields(message: Message) -> list[str]:
    """Return the fields of a received message whose value is out of range; empty if all may be acted on."""
    return [name for name, value in zip(message._fields, message) if isinstance(value, OutOfRange)]


def plain(message: Message) -> dict[str, Any]:
    """Return a message's fields as numbers, None (unknown), or the words that a person writes."""
    fields = zip(kinds(type(message)).items(), message)
    return {name: None if value is None else kind.plain(value) for (name, kind), value in fields}


@cache
def _worded(message_type: type[Message]) -> Mapping[str, Worded]:
    return {name: kind for name, kind in kinds(message_type).items() if isinstance(kind, Worded)}


def worded(message: Message) -> dict[str, str]:
    """Return what the values of a message's fields say, where its maker or its device's profile has words for them."""
    values = ((name, kind, getattr(message, name)) for name, kind in _worded(type(message)).items())
    said = ((name, kind.words(value)) for name, kind, value in values if value is not None)
    return {name: words for name, words in said if words}


def describe(message: Message, own: Mapping[str, Kind]) -> str:
    """Write a message's fields for a person, without those that have their default: `x=1200 mm, angle=90 deg`.

    `own` are the kinds of its binding, which know the table's units.
    """
    defaults = message._field_defaults
    fields = ((name, kind, value) for (name, kind), value in zip(own.items(), message))
    said = ((name, kind.text(value)) for name, kind, value in fields if name not in defaults or value != defaults[name])
    return ", ".join(f"{name}={text}" for name, text in said)


_Class = TypeVar("_Class", bound=type)

NO_GROUP = ""


class CatalogueEntry(NamedTuple):
    """A message type, the `group` of messages that it is one of, and whether it acts `always`: in every NMT state."""

    type: type[Message]
    group: str = NO_GROUP
    always: bool = False


class Catalogue:
    """Message types by the names of their PDOs; case, spaces, hyphens and underscores in a name do not matter.

    `errors` are the words for the emergency error codes that are the devices' own (CiA 301, Table 26: 0xFF00 and up).
    """

    def __init__(self, errors: Mapping[int, str] = MappingProxyType({})) -> None:
        self.errors = dict(errors)
        self._entries: dict[str, CatalogueEntry] = {}

    def message(self, group: str = NO_GROUP, *, always: bool = False) -> Callable[[_Class], _Class]:
        """Return the decorator that enters a message class; its name is the PDO's in CamelCase."""

        def enter(message_type: _Class) -> _Class:
            self._entries[plain_name(message_type.__name__)] = CatalogueEntry(told_apart(message_type), group, always)
            return message_type

        return enter

    def copy(self) -> Catalogue:
        """Return a catalogue with the same types, for others to be entered beside them."""
        made = Catalogue(self.errors)
        made._entries = dict(self._entries)
        return made

    def find(self, name: str) -> CatalogueEntry | None:
        """Return the entry for a PDO's name; None if there is none."""
        return self._entries.get(plain_name(name))

    @property
    def types(self) -> tuple[type[Message], ...]:
        """All message types in the order in which they were entered."""
        return tuple(entry.type for entry in self._entries.values())

    @property
    def always(self) -> frozenset[type[Message]]:
        """The message types that act in every NMT state."""
        return frozenset(entry.type for entry in self._entries.values() if entry.always)

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups in the order of their first message."""
        return tuple(dict.fromkeys(entry.group for entry in self._entries.values() if entry.group))


LONGEST_NAME = 60
"""Most characters of a file's name that a line for a person has room for."""

NOTHING = Catalogue()
"""The empty catalogue, for devices of which only the EDS is known."""


def plain_name(name: str) -> str:
    """Return a name as it is looked up: `Goto XY`, `goto-xy` and `GotoXY` are one."""
    return re.sub(r"[ _-]", "", name).casefold()


def readable_name(name: str) -> str:
    """Return a name that fits in a line: no control characters, not longer than `LONGEST_NAME`."""
    words = "".join(each if each.isprintable() else " " for each in name).split()
    return " ".join(words)[:LONGEST_NAME].rstrip()


def field_name(parameter_name: str) -> str:
    """Return the field for an EDS ParameterName: `X position` is `x`, `Enemy 1 diameter` is `enemy_1_diameter`.

    What Python does not take as a name is changed until it does: `Status (raw)` is `status_raw`, `class` is `class_`,
    `2nd axis` is `field_2nd_axis`.
    """
    words = parameter_name.lower().removesuffix(" position")
    name = re.sub(r"\W+", "_", words, flags=re.ASCII).strip("_")[:LONGEST_NAME].rstrip("_") or "field"
    if keyword.iskeyword(name):
        return f"{name}_"
    return f"field_{name}" if name[0].isdigit() else name


def made_type(name: str, kinds: Mapping[str, Kind]) -> type[Message]:
    """Return a message type for a PDO that no catalogue has, by its fields' names and kinds.

    Python generates code for a named tuple; of what a file says, only fields' names go into it, and those as
    `field_name` makes them: letters, digits and underscores.
    """
    annotated: Any = [(field, Annotated[Any, kind]) for field, kind in kinds.items()]
    made: Any = NamedTuple("Message", annotated)  # type: ignore[misc]  # made at run time
    made.__name__ = made.__qualname__ = name
    made.__doc__ = ""  # what Python writes there says no more than the fields
    return cast("type[Message]", told_apart(made))
