"""Objects of a dictionary as a person names and writes them: by number or by ParameterName, values as text.

Without a dictionary an object is its number and its bytes. With one it has a name, a type and limits, and a value
outside of them is refused before it is sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from typing import Any, NamedTuple, cast

from canopen.objectdictionary import ODVariable, datatypes

from eurobot_od.errors import FieldError, LocalError, UnknownName
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value

NUMBER = re.compile(r"(0x)?(?P<index>[0-9a-f]{4})h?(:(?P<sub>0x[0-9a-f]{1,2}|[0-9]{1,3}))?", re.IGNORECASE)
"""`1017`, `0x1017` or `1017h`, an index being always hexadecimal; the sub-index after a colon is decimal or `0x..`."""

RAW_INTEGER = (1, 2, 4, 8)
"""Lengths in bytes of what is shown as a number although its type is not known."""


class ValueForm(NamedTuple):
    """A kind of value: the Python `types` it has, how a text becomes one, and its name for a person."""

    types: tuple[type, ...]
    parse: Callable[[str], Value]
    allowed: str


INTEGER = ValueForm((int,), lambda text: int(text, 0), "an integer")
REAL = ValueForm((int, float), float, "a number")
TEXT = ValueForm((str,), str, "ASCII text")
BYTES = ValueForm((bytes,), bytes.fromhex, "bytes in hexadecimal digits")

FORMS: dict[int | None, ValueForm] = {
    **dict.fromkeys((datatypes.BOOLEAN, *datatypes.INTEGER_TYPES), INTEGER),
    **dict.fromkeys(datatypes.FLOAT_TYPES, REAL),
    **dict.fromkeys((datatypes.VISIBLE_STRING, datatypes.UNICODE_STRING), TEXT),
}
"""The form of each CiA 301 data type; the others are bytes."""

TYPE_NAMES = {value: name for name, value in vars(datatypes).items() if isinstance(value, int)}
"""Name of each CiA 301 data type by its number."""


class NamedObject(NamedTuple):
    """One object: its address, its full name (`` if nobody knows it) and canopen's variable (None likewise)."""

    address: Address
    name: str = ""
    variable: ODVariable | None = None

    @property
    def type_name(self) -> str:
        """The CiA 301 name of its type, `` if it is not known."""
        return "" if self.variable is None else TYPE_NAMES.get(self.variable.data_type or 0, "")


def described(variable: ODVariable) -> NamedObject:
    """Return the object of a variable."""
    return NamedObject((variable.index, variable.subindex), variable.qualname, variable)


def all_objects(dictionary: Dictionary) -> Iterator[NamedObject]:
    """Give every object that a dictionary describes, by address; what is below 0x1000 describes data types."""
    for index in sorted(index for index in dictionary.objects if index >= 0x1000):
        yield from members(dictionary, index)


def members(dictionary: Dictionary, index: int) -> list[NamedObject]:
    """Return the objects at an index: the members of a record or array, or the one variable."""
    entry = dictionary.objects[index]
    variables = [entry] if isinstance(entry, ODVariable) else [entry[sub] for sub in entry]
    return [described(variable) for variable in variables]


def find(text: str, dictionary: Dictionary | None) -> list[NamedObject]:
    """Return the objects that a person names: one with `INDEX:SUB`, else all members of what stands at that index.

    Names are ParameterNames in any letter case, `Motion.Speed` or `Motion`; an index that the dictionary does not
    have is sub-index 0 of it. Raises UnknownName for a name that no object has, LocalError for one of several.
    """
    number = NUMBER.fullmatch(text.strip())
    if number is None:
        return _named(text, dictionary)
    index, sub = int(number["index"], 16), number["sub"]
    if sub is None and dictionary is not None and index in dictionary.objects:
        return members(dictionary, index)
    return [at((index, int(sub or "0", 0)), dictionary)]


def find_one(text: str, dictionary: Dictionary | None) -> NamedObject:
    """Return the one object that a person names; raises LocalError if it is a record."""
    found = find(text, dictionary)
    if len(found) > 1:
        members_text = ", ".join(f"0x{a[0]:04X}:{a[1]} {name}" for a, name, _ in found)
        raise LocalError(f"{text!r} is not one object but a record of {members_text}")
    return found[0]


def at(address: Address, dictionary: Dictionary | None) -> NamedObject:
    """Return the object at an address, as far as a dictionary describes it."""
    variable = dictionary.variable(address) if dictionary is not None else None
    return NamedObject(address) if variable is None else described(variable)


def _named(text: str, dictionary: Dictionary | None) -> list[NamedObject]:
    if dictionary is None:
        raise LocalError(f"without an EDS no object is known as {text!r}; give its number")
    wanted = text.strip().lower()
    records = [index for index in dictionary.objects if dictionary.objects[index].name.lower() == wanted]
    single = [each for each in all_objects(dictionary) if each.name.lower() == wanted]
    # A variable is in both lists, a record in the first, a member of one in the second.
    found = [members(dictionary, index) for index in records] or [[each] for each in single]
    if not found:
        names = [*dictionary.objects.names, *(each.name for each in all_objects(dictionary))]
        raise UnknownName("object", text, get_close_matches(text, names))
    if len(found) > 1:
        indices = ", ".join(f"0x{index:04X}" for index in sorted(each[0].address[0] for each in found))
        raise LocalError(f"several objects are called {text!r}: {indices}; give the number of one")
    return found[0]


def decode(thing: NamedObject, data: bytes) -> Value:
    """Turn an object's bytes into its value; bytes that do not fit its type stay bytes.

    A number sent with more bytes than its type has is taken from the first of them: some devices send 4 always.
    """
    variable = thing.variable
    if variable is None:
        return int.from_bytes(data, "little") if len(data) in RAW_INTEGER else data
    if variable.data_type in variable.STRUCT_TYPES:
        size = len(variable) // 8
        return _plain(variable.decode_raw(data[:size])) if len(data) >= size else data
    return _plain(variable.decode_raw(data))


def _plain(value: int | float | str | bytes | bytearray) -> Value:
    """Make a number of a bool, bytes of a bytearray."""
    if isinstance(value, int):
        return int(value)
    return bytes(value) if isinstance(value, bytearray) else value


def parse(thing: NamedObject, text: str) -> Value:
    """Turn what a person writes into a value of an object's type, a number if the type is not known.

    Raises FieldError.
    """
    form = _form(thing)
    try:
        return form.parse(text)
    except ValueError:
        raise _not_allowed(thing, text, form.allowed) from None


def encode(thing: NamedObject, value: Value, size: int = 0) -> bytes:
    """Turn a value into an object's bytes, `size` of them if its type is not known.

    Raises FieldError for a value that the object's type or limits do not allow.
    """
    allowed = wrong(thing, value)
    if allowed is not None:
        raise _not_allowed(thing, value, allowed)
    try:
        if thing.variable is None:
            return cast(int, value).to_bytes(size, "little")
        return bytes(thing.variable.encode_raw(cast(Any, value)))
    except (ValueError, OverflowError):
        raise _not_allowed(thing, value, _form(thing).allowed if thing.variable else f"{size} bytes") from None


def wrong(thing: NamedObject, value: Value) -> str | None:
    """Return None for a value that an object can have, else what it could have."""
    form = _form(thing)
    if not isinstance(value, form.types):
        return form.allowed
    if form is not INTEGER or thing.variable is None:
        return None
    low, high = integer_range(thing.variable)
    return None if low <= cast(int, value) <= high else f"{low}..{high}"


def integer_range(variable: ODVariable) -> tuple[int, int]:
    """Return the least and the greatest value of an integer object: its limits inside of its type's."""
    bits = 1 if variable.data_type == datatypes.BOOLEAN else len(variable)
    signed = variable.data_type in datatypes.SIGNED_TYPES
    low, high = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
    return (
        low if variable.min is None else max(low, variable.min),
        high if variable.max is None else min(high, variable.max),
    )


def written(thing: NamedObject, value: Value) -> str:
    """Write a value for a person: numbers in the form of the object's DefaultValue, bytes in hexadecimal digits."""
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    if isinstance(value, int) and value >= 0 and _is_hexadecimal(thing):
        digits = 2 if thing.variable is None else len(thing.variable) // 4
        return f"0x{value:0{digits}X}"
    return str(value)


def _is_hexadecimal(thing: NamedObject) -> bool:
    like: str = getattr(thing.variable, "default_raw", "")
    return thing.variable is None or like.lower().startswith(("0x", "$nodeid"))


def _form(thing: NamedObject) -> ValueForm:
    return INTEGER if thing.variable is None else FORMS.get(thing.variable.data_type, BYTES)


def _not_allowed(thing: NamedObject, value: object, allowed: str) -> FieldError:
    return FieldError(f"0x{thing.address[0]:04X}:{thing.address[1]}", thing.name or "value", value, allowed)
