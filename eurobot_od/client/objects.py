"""Objects of a dictionary as a person names and writes them: by number or by ParameterName, values as text.

Without a dictionary an object is its number and its bytes. With one it has a name, a type and limits, and a value
outside of them is refused before it is sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from typing import TYPE_CHECKING, NamedTuple, cast
from zlib import crc32

from eurobot_od.amounts import amount
from eurobot_od.errors import LONGEST_NAME, FieldError, LocalError, UnknownName
from eurobot_od.od.dictionary import Dictionary, data_type
from eurobot_od.od.values import REALS, UNICODE_STRING, VISIBLE_STRING, Address, DataType, Limits, Value, label
from eurobot_od.pdo.kinds import parsed_number

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

NUMBER = re.compile(r"(0x)?(?P<index>[0-9a-f]{4})h?(:(?P<sub>0x[0-9a-f]{1,2}|[0-9]{1,3}))?", re.IGNORECASE)
"""`1017`, `0x1017` or `1017h`, an index being always hexadecimal; the sub-index after a colon is decimal or `0x..`."""

RAW_INTEGER = (1, 2, 4, 8)
"""Lengths in bytes of what is shown as a number although its type is not known."""

LONGEST_SHOWN = 100
"""Bytes of a value that are written out where a line is to show it."""


class ValueForm(NamedTuple):
    """How a text becomes a value, and what a person may write."""

    parse: Callable[[str], Value]
    allowed: str


INTEGER = ValueForm(parsed_number, "an integer")
TEXT = ValueForm(str, "ASCII text")
BYTES = ValueForm(bytes.fromhex, "bytes in hexadecimal digits")

FORMS = dict.fromkeys(REALS, ValueForm(float, "a number")) | {VISIBLE_STRING: TEXT, UNICODE_STRING: TEXT}
"""The form of each data type that has neither integers nor bytes."""


class NamedObject(NamedTuple):
    """One object: its address, its full name (`` if nobody knows it) and canopen's variable (None likewise)."""

    address: Address
    name: str = ""
    variable: ODVariable | None = None

    @property
    def type(self) -> DataType | None:
        """Its data type, None if nobody knows it."""
        return None if self.variable is None else data_type(self.variable)

    @property
    def form(self) -> ValueForm:
        """How a person writes its value."""
        if self.type is None or self.type.is_integer:
            return INTEGER
        return FORMS.get(self.type, BYTES)

    def not_allowed(self, value: object, allowed: str) -> FieldError:
        """Return the error that it cannot have a value."""
        return FieldError(label(self.address), self.name or "value", value, allowed)


def all_objects(dictionary: Dictionary) -> Iterator[NamedObject]:
    """Give every object that a dictionary describes, by address; what is below 0x1000 describes data types."""
    for index in sorted(index for index in dictionary.members if index >= 0x1000):
        yield from members(dictionary, index)


def members(dictionary: Dictionary, index: int) -> list[NamedObject]:
    """Return the objects at an index: the members of a record or array, or the one variable."""
    return [at((index, subindex), dictionary) for subindex in sorted(dictionary.members.get(index, ()))]


def find(text: str, dictionary: Dictionary | None) -> list[NamedObject]:
    """Return the objects that a person names: one with `INDEX:SUB`, else all members of what stands at that index.

    Names are ParameterNames in any letter case, `Motion.Speed` or `Motion`; an index that the dictionary does not
    have is sub-index 0 of it. Raises UnknownName for a name that no object has, LocalError for one of several.
    """
    number = NUMBER.fullmatch(text.strip())
    if number is None:
        return _named(text, dictionary)
    index, sub = int(number["index"], 16), number["sub"]
    if sub is None and dictionary is not None and index in dictionary.members:
        return members(dictionary, index)
    return [at((index, int(sub or "0", 0)), dictionary)]


def find_one(text: str, dictionary: Dictionary | None) -> NamedObject:
    """Return the one object that a person names; raises LocalError if it is a record."""
    found = find(text, dictionary)
    if len(found) > 1:
        members_text = ", ".join(label(address, name) for address, name, _ in found)
        raise LocalError(f"{text!r} is not one object but a record of {members_text}")
    return found[0]


def at(address: Address, dictionary: Dictionary | None) -> NamedObject:
    """Return the object at an address, as far as a dictionary describes it."""
    variable = dictionary.variable(address) if dictionary is not None else None
    return NamedObject(address, "" if variable is None else variable.qualname, variable)


def _named(text: str, dictionary: Dictionary | None) -> list[NamedObject]:
    if dictionary is None:
        raise LocalError(f"without an EDS no object is known as {text!r}; give its number")
    wanted = text.strip().lower()
    records = [index for index in dictionary.members if dictionary.objects[index].name.lower() == wanted]
    single = [each for each in all_objects(dictionary) if each.name.lower() == wanted]
    # A variable is in both lists, a record in the first, a member of one in the second.
    found = [members(dictionary, index) for index in records] or [[each] for each in single]
    if not found:
        names = [*dictionary.objects.names, *(each.name for each in all_objects(dictionary))]
        raise UnknownName("object", text, get_close_matches(text[:LONGEST_NAME], names))
    if len(found) > 1:
        indices = ", ".join(f"0x{index:04X}" for index in sorted(each[0].address[0] for each in found))
        raise LocalError(f"several objects are called {text!r}: {indices}; give the number of one")
    return found[0]


def decode(thing: NamedObject, data: bytes) -> Value:
    """Turn an object's bytes into its value; bytes that do not fit its type stay bytes.

    A number sent with more bytes than its type has is taken from the first of them: some devices send 4 always.
    """
    if thing.type is None:
        return int.from_bytes(data, "little") if len(data) in RAW_INTEGER else data
    if len(data) < thing.type.size:
        return data
    value = thing.type.read(data[: thing.type.size or None])
    if isinstance(value, str):
        return value.rstrip("\0")  # which C programs fill texts up with
    return int(value) if isinstance(value, bool) else value


def parse(thing: NamedObject, text: str) -> Value:
    """Turn what a person writes into a value of an object's type, a number if the type is not known.

    Raises FieldError.
    """
    try:
        return thing.form.parse(text)
    except ValueError:
        raise thing.not_allowed(text, thing.form.allowed) from None


def encode(thing: NamedObject, value: Value, size: int = 0) -> bytes:
    """Turn a value into an object's bytes, `size` of them if its type is not known.

    Raises FieldError for a value that the object's type or limits do not allow.
    """
    allowed = thing.form.allowed
    try:
        if thing.type is None:
            allowed = f"{size} bytes"
            return cast(int, value).to_bytes(size, "little")
        if thing.variable is not None and thing.type.is_integer and isinstance(value, int):
            low, high = integer_range(thing.variable)
            allowed = f"{low}..{high}"
            if not low <= value <= high:
                raise ValueError
        return thing.type.write(value)
    except (ValueError, OverflowError):
        raise thing.not_allowed(value, allowed) from None


def given(name: str, text: str, dictionary: Dictionary) -> tuple[Address, Value]:
    """Return the address and the value of an object, both as a person writes them.

    Raises UnknownName, LocalError for a record, FieldError for a value that the object does not allow.
    """
    thing = find_one(name, dictionary)
    value = parse(thing, text)
    encode(thing, value)  # says what the object allows
    return thing.address, value


def integer_range(variable: ODVariable) -> Limits:
    """Return the least and the greatest value of an integer object: its limits inside of its type's."""
    type_ = data_type(variable)
    return Limits(
        type_.low if variable.min is None else max(type_.low, variable.min),
        type_.high if variable.max is None else min(type_.high, variable.max),
    )


def written(thing: NamedObject, value: Value) -> str:
    """Write a value for a person: numbers in the form of the object's DefaultValue, bytes in hexadecimal digits."""
    if isinstance(value, bytes) and thing.type == VISIBLE_STRING:
        value = value.decode(errors="backslashreplace").rstrip("\0")
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    like: str = getattr(thing.variable, "default_raw", "")
    if isinstance(value, int) and value >= 0 and (thing.type is None or like.lower().startswith(("0x", "$nodeid"))):
        digits = 2 if thing.type is None else 2 * thing.type.size
        return f"0x{value:0{digits}X}"
    return str(value)


def shown(thing: NamedObject, data: bytes) -> str:
    """Write an object's bytes for a person on one line, long ones by their number and CRC."""
    if len(data) > LONGEST_SHOWN:
        return f"{amount(len(data), 'byte')} (CRC-32 0x{crc32(data):08X})"
    value = decode(thing, data)
    text = written(thing, value)
    return text if text.isprintable() else data.hex(" ").upper()
