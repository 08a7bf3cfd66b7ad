"""Objects of a dictionary by the names and texts that people use: look-up, labels, parsing, encoding, limits.

They are canopen's variables; one without a file is only an address and bytes. With a file, a value outside the object's
limits is refused before it is sent.
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
"""Pattern of an object's number: `1017`, `0x1017` or `1017h`, always hexadecimal.

The sub-index is decimal or `0x..` after a colon, and hexadecimal after `sub`, as in the sections of an EDS.
"""

RAW_INTEGER = (1, 2, 4, 8)
"""Lengths of values of unknown type that are shown as numbers, in bytes."""

LONGEST_SHOWN = 100
"""Longest value that is shown in a line, in bytes."""


class ValueForm(NamedTuple):
    """Parser of a value, and the description of allowed texts."""

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
"""Forms of data types other than integers and bytes."""

# Properties of a variable


def address_of(variable: ODVariable) -> Address:
    """Return index and sub-index."""
    return variable.index, variable.subindex


def data_type(variable: ODVariable) -> DataType:
    """Return a variable's data type; DOMAIN, which is bytes, if it is unknown."""
    return DATA_TYPES.get(variable.data_type or 0, DOMAIN)


def is_described(variable: ODVariable) -> bool:
    """Return whether a variable comes from a file."""
    return variable.data_type is not None


def label(variable: ODVariable) -> str:
    """Format address and name: `0x1018:1 Identity object.Vendor-ID`."""
    return values.label(address_of(variable), variable.qualname)


def default_of(variable: ODVariable) -> Value:
    """Return the ParameterValue (DCF), else the DefaultValue, or None."""
    value: Value = variable.default if variable.value is None else variable.value
    return value


def value_text(variable: ODVariable) -> str:
    """Return the ParameterValue as in the file, even if it does not fit the type; empty without one."""
    text: str = getattr(variable, "value_raw", "")
    return text


def form_of(variable: ODVariable) -> ValueForm:
    """Return the form of a variable's value."""
    type_ = data_type(variable)
    return INTEGER if not is_described(variable) or type_.is_integer else FORMS.get(type_, BYTES)


class Range(NamedTuple):
    """Lowest and highest allowed value, both inclusive."""

    low: int | float
    high: int | float


def limits(variable: ODVariable) -> Range | None:
    """Return the range of a numeric variable: its limits within its type's; None if it is not a number.

    Limits that exclude every value, such as a HighLimit below the LowLimit, are ignored.
    """
    type_ = data_type(variable)
    if not type_.is_integer and type_ not in REALS:
        return None
    lowest, highest = (type_.low, type_.high) if type_.is_integer else (-inf, inf)
    # The file's limits may be wider than the type.
    low = lowest if variable.min is None else max(lowest, variable.min)
    high = highest if variable.max is None else min(highest, variable.max)
    return Range(low, high) if low <= high else Range(lowest, highest)


def allowed_range(variable: ODVariable, range_: Range) -> str:
    """Format a range of raw values, as physical values if the variable has a scale."""
    scale = scale_of(variable)
    low, high = sorted(map(scale.physical, range_)) if not scale.is_raw else range_
    return f"{digits(low)}..{digits(high)} {scale.unit}".rstrip() if not scale.is_raw else f"{low}..{high}"


def in_limits(variable: ODVariable, value: Value) -> bool:
    """Return whether a value is within the limits; values that are not numbers always are."""
    range_ = limits(variable)
    outside = isinstance(value, Real) and range_ and (value < range_.low or value > range_.high)
    return not outside


def initial(variable: ODVariable) -> bytes | None:
    """Return the initial bytes of a number without a default: 0, or the nearest limit; None if it is not a number."""
    range_ = limits(variable)
    return None if range_ is None else data_type(variable).write(min(max(0, range_.low), range_.high))


def default_bytes(variable: ODVariable) -> bytes | None:
    """Return the default as bytes; None if there is none, or if it does not fit the type."""
    value = default_of(variable)
    try:
        return None if value is None else data_type(variable).write(value)
    except (ValueError, OverflowError):
        return None


# Look-up


def members_of(entry: ODVariable | ODArray | ODRecord) -> dict[int, ODVariable]:
    """Return the variables of one object by sub-index; canopen's arrays would add non-existing ones."""
    subs: dict[int, ODVariable] | None = getattr(entry, "subindices", None)
    return {0: cast("ODVariable", entry)} if subs is None else subs


def members(objects: ObjectDictionary, index: int) -> list[ODVariable]:
    """Return the variables at an index, ordered by sub-index."""
    entry = objects.indices.get(index)
    found = {} if entry is None else members_of(entry)
    return [found[sub] for sub in sorted(found)]


def all_objects(objects: ObjectDictionary) -> Iterator[ODVariable]:
    """Yield all variables, ordered by address; indices below 0x1000 are data types."""
    for index in sorted(index for index in objects.indices if index >= values.FIRST):
        yield from members(objects, index)


def variable_at(objects: ObjectDictionary, address: Address) -> ODVariable | None:
    """Return the variable at an index and sub-index, or None."""
    entry = objects.indices.get(address[0])
    return None if entry is None else members_of(entry).get(address[1])


def at(address: Address, objects: ObjectDictionary | None) -> ODVariable:
    """Return the variable at an address, without a description if there is none."""
    return (variable_at(objects, address) if objects is not None else None) or undescribed(address)


def undescribed(address: Address) -> ODVariable:
    """Return a variable with an address only."""
    from canopen.objectdictionary import ODVariable  # only for those who ask a device without its file

    return ODVariable("", *address)


def changed(variable: ODVariable, **attributes: object) -> ODVariable:
    """Return a copy of a variable with other attributes."""
    other = copy(variable)
    for name, value in attributes.items():
        setattr(other, name, value)
    return other


def unlimited(variable: ODVariable) -> ODVariable:
    """Return a copy of a variable with only its type's limits."""
    return changed(variable, min=None, max=None)


def find(text: str, objects: ObjectDictionary | None) -> list[ODVariable]:
    """Return the variables for a text: one for `INDEX:SUB`, all members for an index or a record's name.

    Names are ParameterNames in any letter case, `Motion.Speed` or `Motion`; an unknown index stands for its sub-index
    0. Raises UnknownName for an unknown name, LocalError for an ambiguous one.
    """
    number = numbered(text)
    if number is None:
        return _named(text, objects)
    index, sub = number
    # Sub-index 0 of an unknown index, because it may be a VAR.
    if sub is None and objects is not None and index in objects.indices:
        return members(objects, index)
    return [at((index, sub or 0), objects)]


def numbered(text: str) -> tuple[int, int | None] | None:
    """Return index and sub-index (None: without) for an object's number; None if the text is a name.

    Raises LocalError for an invalid number.
    """
    number = NUMBER.fullmatch(text.strip())
    if number is None:
        if text.strip()[:2].lower() == "0x":
            raise LocalError(f"{text!r} is not an index; write INDEX[:SUB], such as 0x1018 or 0x1018:1")
        return None
    index = int(number["any"] or number["four"], 16)
    sub = number["sub"]
    if sub is None:
        return index, None
    try:
        subindex = int(sub, 0 if ":" in text else 16)
    except ValueError:  # such as `08`, which Python refuses
        subindex = -1
    if subindex not in range(0x100):
        raise LocalError(f"{text!r}: sub-index {sub} is not in 0..255")
    return index, subindex


def find_one(text: str, objects: ObjectDictionary | None) -> ODVariable:
    """Return the only variable for a text; raises as `find`, and LocalError for a record."""
    found = find(text, objects)
    if len(found) > 1:
        raise LocalError(f"{text!r} is not one object but a record of {', '.join(map(label, found))}")
    return found[0]


def _named(text: str, objects: ObjectDictionary | None) -> list[ODVariable]:
    if objects is None:
        raise LocalError(f"without an EDS no object is known as {text!r}; give its number, such as 0x1018:1")
    wanted = text.strip().lower()
    whole = [index for index, entry in objects.indices.items() if entry.name.lower() == wanted]
    # A record is only in the first list, a member of a record only in the second.
    found = [members(objects, index) for index in whole]
    found = found or [[each] for each in all_objects(objects) if each.qualname.lower() == wanted]
    if not found:
        raise UnknownName("object", text, [*objects.names, *(each.qualname for each in all_objects(objects))])
    if len(found) > 1:
        indices = ", ".join(f"0x{index:04X}" for index in sorted(each[0].index for each in found))
        raise LocalError(f"several objects are called {text!r}: {indices}; give the number of one")
    return found[0]


# Texts, values and bytes


RAW_VALUE = "raw:"
"""Prefix of a raw value of an object with a unit, factor or offset."""


WITH_UNIT = re.compile(r"\s*-?\d[\d.]*\s*[^\W\d]+\s*")
"""A number with a unit."""


def parse(variable: ODVariable, text: str) -> Value:
    """Parse a text into a raw value of a variable's type; a number if the type is unknown.

    If the object has a scale, a number is a physical value, with or without its unit, unless it begins with `raw:`. A
    manufacturer's word for a value stands for it. Raises FieldError.
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
        unit = f" in {scale.unit}" if scale.unit else ""
        if not unit and is_number and WITH_UNIT.fullmatch(text):
            unit = " without a unit"
        raise not_allowed(variable, text, f"{form.allowed}{unit}") from None


def _raw_of(variable: ODVariable, scale: UnitScale, text: str) -> Value:
    """Return the raw value of a physical one, rounded for integers; raises ValueError, OverflowError."""
    if scale.is_raw:
        return form_of(variable).parse(text)
    raw = scale.raw(values.typed_real(text))
    return round(raw) if data_type(variable).is_integer else raw


def physical(variable: ODVariable, raw: Value) -> Value:
    """Return the physical value of a raw one; values that are not numbers are returned unchanged."""
    is_number = isinstance(raw, (int, float)) and not isinstance(raw, bool)
    return scale_of(variable).physical(raw) if is_number else raw  # type: ignore[arg-type]


def measured(variable: ODVariable, raw: Value) -> str:
    """Format a raw value as a physical one with its unit; as `written` without a scale."""
    scale = scale_of(variable)
    if scale.is_raw or not isinstance(raw, (int, float)):
        return f"{written(variable, raw)} {scale.unit if isinstance(raw, (int, float)) else ''}".rstrip()
    return scale.text(raw)


def encode(variable: ODVariable, value: Value, size: int = 0) -> bytes:
    """Encode a value as a variable's bytes, `size` of them if its type is unknown.

    Raises FieldError for a value that the variable's type or limits do not allow.
    """
    allowed = form_of(variable).allowed
    range_ = limits(variable)
    try:
        if not is_described(variable):
            allowed = f"{size} bytes"
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
    """Decode a variable's bytes; bytes that do not fit its type are returned unchanged.

    Extra bytes of a number are ignored, because some devices always send 4.
    """
    if not is_described(variable):
        return int.from_bytes(data, "little") if len(data) in RAW_INTEGER else data
    type_ = data_type(variable)
    if len(data) < type_.size:  # not padded, because the missing bytes are unknown
        return data
    value = type_.read(data[: type_.size or None])
    if isinstance(value, str):
        return value.rstrip("\0")  # padding of C programs
    return int(value) if isinstance(value, bool) else value


def given(name: str, text: str, objects: ObjectDictionary) -> tuple[Address, Value]:
    """Return address and value for an object's name and a value, both as text.

    Raises UnknownName, LocalError for a record, FieldError for a value that the variable does not allow.
    """
    variable = find_one(name, objects)
    value = parse(variable, text)
    encode(variable, value)  # raises for a value that is not allowed
    return address_of(variable), value


def not_allowed(variable: ODVariable, value: object, allowed: str) -> FieldError:
    """Return the error about a value that a variable does not allow."""
    return FieldError(values.label(address_of(variable)), variable.qualname or "value", value, allowed)


def written(variable: ODVariable, value: Value) -> str:
    """Format a raw value: numbers in the form of the variable's DefaultValue, bytes in hexadecimal.

    COB-IDs and mapping entries of PDOs are always hexadecimal.
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
    """Return the number with the fewest digits that is the same REAL32: 21.3 for 21.299999237."""
    # A REAL32 has at least six significant digits, and at most nine.
    nearest = (float(f"{value:.{digits}g}") for digits in range(6, 9))
    return next((each for each in nearest if values.REAL32.write(each) == values.REAL32.write(value)), value)


def as_data(variable: ODVariable, value: Value) -> dict[str, Any]:
    """Return a raw value for JSON: physical value and unit, and the raw value if it differs."""
    scale = scale_of(variable)
    data: dict[str, Any] = {"value": value.hex() if isinstance(value, bytes) else physical(variable, value)}
    data |= {"unit": scale.unit} if scale.unit else {}
    return data if scale.is_raw or not isinstance(value, (int, float)) else {**data, "raw": value}


def shown(variable: ODVariable, data: bytes) -> str:
    """Format a variable's bytes in one line; long ones as length and CRC."""
    if len(data) > LONGEST_SHOWN:  # such as a firmware in a DOMAIN
        return f"{amount(len(data), 'byte')} (CRC-32 0x{crc32(data):08X})"
    text = measured(variable, decode(variable, data))
    return text if text.isprintable() else data.hex(" ").upper()
