"""Objects of a dictionary as a person names and writes them: found, labelled, read from text, encoded, limited.

They are canopen's variables. One that no file describes is just a number and its bytes, without a name and a type. With
a file, a value outside the object's limits is refused before it is sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from copy import copy
from math import inf
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple, cast
from zlib import crc32

from eurobot_od.errors import FieldError, LocalError, UnknownName
from eurobot_od.od import values
from eurobot_od.od.units import RAW, UnitScale, digits, scale_of
from eurobot_od.od.values import DATA_TYPES, DOMAIN, REALS, Address, DataType, Value
from eurobot_od.support.texts import amount

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable

NUMBER = re.compile(
    r"(?:0x(?P<any>[0-9a-f]{1,4})|(?P<four>[0-9a-f]{4})h?)(?:(?::|sub)(?P<sub>0x[0-9a-f]{1,2}|[0-9a-f]{1,3}))?", re.I
)
"""`1017`, `0x1017` or `1017h`, an index being always hexadecimal; the sub-index after a colon is decimal or `0x..`, and
after `sub` hexadecimal, as the sections of an EDS have it."""

RAW_INTEGER = (1, 2, 4, 8)
"""Lengths in bytes of what is shown as a number although its type is not known."""

LONGEST_SHOWN = 100
"""Bytes of a value that are written out where a line is to show it."""


class ValueForm(NamedTuple):
    """How a text becomes a value, and what a person may write."""

    parse: Callable[[str], Value]
    allowed: str


INTEGER = ValueForm(values.typed_number, "an integer")
TEXT = ValueForm(str, "ASCII text")
BYTES = ValueForm(bytes.fromhex, "bytes in hexadecimal digits")

FORMS = {
    **dict.fromkeys(REALS, ValueForm(values.typed_real, "a number")),
    values.VISIBLE_STRING: TEXT,
    values.UNICODE_STRING: ValueForm(str, "text"),
    values.TIME_OF_DAY: ValueForm(str, "a time such as 2014-05-28 12:00:00.000"),
    values.TIME_DIFFERENCE: ValueForm(str, "a time span such as 1d 02:03:04.567"),
}
"""The form of each data type that has neither integers nor bytes."""

# What a variable is


def address_of(variable: ODVariable) -> Address:
    """Return index and sub-index."""
    return variable.index, variable.subindex


def data_type(variable: ODVariable) -> DataType:
    """Return the data type of a variable; DOMAIN, which is bytes, if it is not known."""
    return DATA_TYPES.get(variable.data_type or 0, DOMAIN)


def is_described(variable: ODVariable) -> bool:
    """Return whether a file describes a variable."""
    return variable.data_type is not None


def label(variable: ODVariable) -> str:
    """Write address and name for a person: `0x1018:1 Identity object.Vendor-ID`."""
    return values.label(address_of(variable), variable.qualname)


def default_of(variable: ODVariable) -> Value:
    """Return its ParameterValue (DCF) or else its DefaultValue; None if it has neither."""
    value: Value = variable.default if variable.value is None else variable.value
    return value


def value_text(variable: ODVariable) -> str:
    """Return its ParameterValue as the file writes it, even if it does not fit the type; empty without one."""
    text: str = getattr(variable, "value_raw", "")
    return text


def form_of(variable: ODVariable) -> ValueForm:
    """Return how a person writes its value."""
    type_ = data_type(variable)
    return INTEGER if not is_described(variable) or type_.is_integer else FORMS.get(type_, BYTES)


class Range(NamedTuple):
    """The least and the greatest value that a number may have, both inclusive."""

    low: int | float
    high: int | float


def limits(variable: ODVariable) -> Range | None:
    """Return the range of a numeric variable: its limits inside of its type's; None for what is not a number.

    Limits that leave no value, such as a HighLimit below the LowLimit, are an editor's accident and count as none.
    """
    type_ = data_type(variable)
    if not type_.is_integer and type_ not in REALS:
        return None
    lowest, highest = (type_.low, type_.high) if type_.is_integer else (-inf, inf)
    # canopen has the limits as the file says them, which may be wider than the type.
    low = lowest if variable.min is None else max(lowest, variable.min)
    high = highest if variable.max is None else min(highest, variable.max)
    return Range(low, high) if low <= high else Range(lowest, highest)


def allowed_range(variable: ODVariable, range_: Range) -> str:
    """Return a range of raw values for a person, as physical values where the variable has a scale."""
    scale = scale_of(variable)
    low, high = sorted(map(scale.physical, range_)) if not scale.is_raw else range_
    return f"{digits(low)}..{digits(high)} {scale.unit}".rstrip() if not scale.is_raw else f"{low}..{high}"


def in_limits(variable: ODVariable, value: Value) -> bool:
    """Return whether a value is within the limits, as everything is that is not a number."""
    range_ = limits(variable)
    outside = isinstance(value, Real) and range_ and (value < range_.low or value > range_.high)
    return not outside


def initial(variable: ODVariable) -> bytes | None:
    """Return what a number without a default has to begin with, as an SDO carries it: 0, or the limit next to it."""
    range_ = limits(variable)
    return None if range_ is None else data_type(variable).write(min(max(0, range_.low), range_.high))


def default_bytes(variable: ODVariable) -> bytes | None:
    """Return the default as an SDO carries it, None if there is none, or none of its type."""
    value = default_of(variable)
    try:
        return None if value is None else data_type(variable).write(value)
    except (ValueError, OverflowError):
        return None


# Listed and found


def members_of(entry: ODVariable | ODArray | ODRecord) -> dict[int, ODVariable]:
    """Return the variables of one object by sub-index; canopen's arrays would invent some that are not there."""
    subs: dict[int, ODVariable] | None = getattr(entry, "subindices", None)
    return {0: cast("ODVariable", entry)} if subs is None else subs


def members(objects: ObjectDictionary, index: int) -> list[ODVariable]:
    """Return the variables at an index, by sub-index."""
    entry = objects.indices.get(index)
    found = {} if entry is None else members_of(entry)
    return [found[sub] for sub in sorted(found)]


def all_objects(objects: ObjectDictionary) -> Iterator[ODVariable]:
    """Yield every variable by address; what is below 0x1000 describes data types."""
    for index in sorted(index for index in objects.indices if index >= values.FIRST):
        yield from members(objects, index)


def variable_at(objects: ObjectDictionary, address: Address) -> ODVariable | None:
    """Return the variable at an index and sub-index, None if there is none."""
    entry = objects.indices.get(address[0])
    return None if entry is None else members_of(entry).get(address[1])


def at(address: Address, objects: ObjectDictionary | None) -> ODVariable:
    """Return the variable at an address, as far as anybody describes it."""
    return (variable_at(objects, address) if objects is not None else None) or undescribed(address)


def undescribed(address: Address) -> ODVariable:
    """Return a variable of which only the address is known."""
    from canopen.objectdictionary import ODVariable  # only for those who ask a device without its file

    return ODVariable("", *address)


def changed(variable: ODVariable, **attributes: object) -> ODVariable:
    """Return a variable like another, with some attributes of its own."""
    other = copy(variable)
    for name, value in attributes.items():
        setattr(other, name, value)
    return other


def unlimited(variable: ODVariable) -> ODVariable:
    """Return a variable like another, without limits but those of its type."""
    return changed(variable, min=None, max=None)


def find(text: str, objects: ObjectDictionary | None) -> list[ODVariable]:
    """Return the variables that a person names: one with `INDEX:SUB`, else all members of what stands at that index.

    Names are ParameterNames in any letter case, `Motion.Speed` or `Motion`; an index that the dictionary does not
    have is sub-index 0 of it. Raises UnknownName for a name that no object has, LocalError for one of several.
    """
    number = numbered(text)
    if number is None:
        return _named(text, objects)
    index, sub = number
    # Without a sub-index all members are meant; what the file does not know is asked for as sub-index 0, a VAR's place.
    if sub is None and objects is not None and index in objects.indices:
        return members(objects, index)
    return [at((index, sub or 0), objects)]


def numbered(text: str) -> tuple[int, int | None] | None:
    """Return the index that a text names by its number, and the sub-index (None: without); None for a name.

    Raises LocalError for a number that cannot be.
    """
    number = NUMBER.fullmatch(text.strip())
    if number is None:
        if text.strip()[:2].lower() == "0x":
            raise LocalError(f"{text!r} is not an index; write INDEX[:SUB], such as 0x1018 or 0x1018:1")
        return None
    index, sub = int(number["any"] or number["four"], 16), number["sub"]
    if sub is None:
        return index, None
    try:
        subindex = int(sub, 0 if ":" in text else 16)
    except ValueError:  # `08`: Python takes a leading zero neither for octal nor for decimal
        subindex = -1
    if subindex not in range(0x100):
        raise LocalError(f"{text!r}: sub-index {sub} is not in 0..255")
    return index, subindex


def find_one(text: str, objects: ObjectDictionary | None) -> ODVariable:
    """Return the one variable that a person names; raises as `find`, and LocalError if it is a record."""
    found = find(text, objects)
    if len(found) > 1:
        raise LocalError(f"{text!r} is not one object but a record of {', '.join(map(label, found))}")
    return found[0]


def _named(text: str, objects: ObjectDictionary | None) -> list[ODVariable]:
    if objects is None:
        raise LocalError(f"without an EDS no object is known as {text!r}; give its number")
    wanted = text.strip().lower()
    whole = [index for index, entry in objects.indices.items() if entry.name.lower() == wanted]
    # A variable is in both, a record in the first, a member of one in the second.
    found = [members(objects, index) for index in whole]
    found = found or [[each] for each in all_objects(objects) if each.qualname.lower() == wanted]
    if not found:
        raise UnknownName("object", text, [*objects.names, *(each.qualname for each in all_objects(objects))])
    if len(found) > 1:
        indices = ", ".join(f"0x{index:04X}" for index in sorted(each[0].index for each in found))
        raise LocalError(f"several objects are called {text!r}: {indices}; give the number of one")
    return found[0]


# Text to value, value to bytes, and back


RAW_VALUE = "raw:"
"""Before a raw value where an object has a unit, factor or offset."""


def parse(variable: ODVariable, text: str) -> Value:
    """Turn what a person writes into a raw value of a variable's type, a number if the type is not known.

    A number of an object that has a scale is a physical one, with or without its unit, unless `raw:` is before it. A
    word that the maker has for a value stands for it. Raises FieldError.
    """
    by_word = {word.casefold(): raw for raw, word in variable.value_descriptions.items()}
    raw: int | None = by_word.get(text.strip().casefold())
    if raw is not None:
        return raw
    form, scale = form_of(variable), scale_of(variable)
    is_number = form is INTEGER or data_type(variable) in REALS
    try:
        if is_number and text.startswith(RAW_VALUE):
            return form.parse(text.removeprefix(RAW_VALUE))
        if not is_number or scale == RAW:
            return form.parse(text)
        return _raw_of(variable, scale, text.strip().removesuffix(scale.unit).strip())
    except (ValueError, OverflowError):
        raise not_allowed(variable, text, f"{form.allowed}{f' in {scale.unit}' if scale.unit else ''}") from None


def _raw_of(variable: ODVariable, scale: UnitScale, text: str) -> Value:
    """Return the raw value of a physical one, rounded to what the type can hold; raises ValueError, OverflowError."""
    if scale.is_raw:
        return form_of(variable).parse(text)
    raw = scale.raw(values.typed_real(text))
    return round(raw) if data_type(variable).is_integer else raw


def physical(variable: ODVariable, raw: Value) -> Value:
    """Return the physical value of a raw one; what is not a number stays as it is."""
    is_number = isinstance(raw, (int, float)) and not isinstance(raw, bool)
    return scale_of(variable).physical(raw) if is_number else raw  # type: ignore[arg-type]


def measured(variable: ODVariable, raw: Value) -> str:
    """Write a raw value for a person as a physical one with its unit; as `written` does where there is no scale."""
    scale = scale_of(variable)
    if scale.is_raw or not isinstance(raw, (int, float)):
        return f"{written(variable, raw)} {scale.unit if isinstance(raw, (int, float)) else ''}".rstrip()
    return scale.text(raw)


def encode(variable: ODVariable, value: Value, size: int = 0) -> bytes:
    """Turn a value into a variable's bytes, `size` of them if its type is not known.

    Raises FieldError for a value that the variable's type or limits do not allow.
    """
    allowed, range_ = form_of(variable).allowed, limits(variable)
    try:
        if not is_described(variable):
            allowed = f"{size} bytes"  # if the number does not fit, this is what the error says
            return cast(int, value).to_bytes(size, "little")
        if range_ is not None and isinstance(value, Real):
            is_within = in_limits(variable, value)
            if not is_within and (data_type(variable).is_integer or (variable.min, variable.max) != (None, None)):
                allowed = allowed_range(variable, range_)
            if not is_within or (isinstance(value, bool) and data_type(variable).bits != 1):
                raise ValueError
        return data_type(variable).write(value)
    except (ValueError, OverflowError):
        raise not_allowed(variable, value, allowed) from None


def decode(variable: ODVariable, data: bytes) -> Value:
    """Turn a variable's bytes into its value; bytes that do not fit its type stay bytes.

    A number sent with more bytes than its type has is taken from the first of them: some devices send 4 always.
    """
    if not is_described(variable):
        return int.from_bytes(data, "little") if len(data) in RAW_INTEGER else data
    type_ = data_type(variable)
    if len(data) < type_.size:  # never filled up: nobody knows what the missing bytes would be
        return data
    value = type_.read(data[: type_.size or None])
    if isinstance(value, str):
        return value.rstrip("\0")  # which C programs fill texts up with
    return int(value) if isinstance(value, bool) else value


def given(name: str, text: str, objects: ObjectDictionary) -> tuple[Address, Value]:
    """Return the address and the value of a variable, both as a person writes them.

    Raises UnknownName, LocalError for a record, FieldError for a value that the variable does not allow.
    """
    variable = find_one(name, objects)
    value = parse(variable, text)
    encode(variable, value)  # says what the variable allows
    return address_of(variable), value


def not_allowed(variable: ODVariable, value: object, allowed: str) -> FieldError:
    """Return the error that a variable cannot have a value."""
    return FieldError(values.label(address_of(variable)), variable.qualname or "value", value, allowed)


def written(variable: ODVariable, value: Value) -> str:
    """Write a value for a person: numbers in the form of the variable's DefaultValue, bytes in hexadecimal digits.

    So are COB-IDs and mapped objects of PDOs, whatever their DefaultValue: nobody knows 0x60770010 as 1618411536.
    """
    type_ = data_type(variable)
    if isinstance(value, bytes) and type_ == values.VISIBLE_STRING:
        value = value.decode(errors="backslashreplace").rstrip("\0")
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    like: str = getattr(variable, "default_raw", "")
    known = is_described(variable)
    if isinstance(value, float) and type_ == values.REAL32:
        return repr(_shortest(value))
    is_of_pdo = type_ == values.UNSIGNED32 and variable.index in values.PDO_PARAMETERS
    is_hex = is_of_pdo or like.lower().startswith(("0x", "$nodeid"))
    if isinstance(value, int) and value >= 0 and (not known or is_hex):
        return f"0x{value:0{2 * type_.size if known else 2}X}"
    return str(value)


def _shortest(value: float) -> float:
    """Return the number with the fewest digits that is the same REAL32: what was written 21.3, and not 21.299999237."""
    # A REAL32 holds six decimal digits for certain; with nine, any two of them differ.
    nearest = (float(f"{value:.{digits}g}") for digits in range(6, 9))
    return next((each for each in nearest if values.REAL32.write(each) == values.REAL32.write(value)), value)


def as_data(variable: ODVariable, value: Value) -> dict[str, Any]:
    """Return a raw value as data: the physical one and its unit apart, and the raw one where that is another."""
    scale = scale_of(variable)
    data: dict[str, Any] = {"value": value.hex() if isinstance(value, bytes) else physical(variable, value)}
    data |= {"unit": scale.unit} if scale.unit else {}
    return data if scale.is_raw or not isinstance(value, (int, float)) else {**data, "raw": value}


def shown(variable: ODVariable, data: bytes) -> str:
    """Write a variable's bytes for a person on one line, long ones by their number and CRC."""
    if len(data) > LONGEST_SHOWN:  # a DOMAIN may be a firmware; the CRC still tells whether two are the same
        return f"{amount(len(data), 'byte')} (CRC-32 0x{crc32(data):08X})"
    text = measured(variable, decode(variable, data))
    return text if text.isprintable() else data.hex(" ").upper()
