"""The messages as a C99 header without dependencies: identifiers, lengths, structs, and functions that pack and unpack.

Each message with data has a struct of its fields, `NAME_MESSAGE_pack` and `NAME_MESSAGE_unpack`; named values, limits,
identifier and length are macros. Goto XY in a network called `robot` becomes, shortened to one field:

    #define ROBOT_GOTO_XY_COB_ID 0x008u
    #define ROBOT_GOTO_XY_LENGTH 8u

    typedef struct {
        uint16_t x; /* 0..3000 mm */
    } robot_goto_xy_t;

    static inline size_t robot_goto_xy_pack(uint8_t *data, size_t size, const robot_goto_xy_t *message)
    static inline bool robot_goto_xy_unpack(robot_goto_xy_t *message, const uint8_t *data, size_t length)

The C code depends neither on byte order nor on the size of int, and compiles without warnings. Bits are moved byte by
byte, in unsigned types as wide as the field, so that an 8-bit controller needs no 64-bit shifts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from textwrap import TextWrapper
from typing import NamedTuple

from eurobot_od.export import description
from eurobot_od.pdo.protocol import Protocol

WORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
 register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true
 false asm fortran errno linux unix i386 near far interrupt alignas alignof and and_eq atomic bitand bitor catch class
 compl concept const_cast constexpr decltype delete dynamic_cast explicit export friend mutable namespace new noexcept
 not not_eq nullptr operator or or_eq private protected public reinterpret_cast requires static_assert static_cast
 template this thread_local throw try typeid typename using virtual wchar_t xor xor_eq"""
"""Keywords of C and C++, and macros of compilers and headers, which cannot be names of members."""

PARTS = 4
"""Number of names in a macro: network, message, field, value."""

LONGEST_TEXT = 32
"""Longest unit in characters."""

STRUCT_REALS = {32: "float", 64: "double"}


WIDE = TextWrapper(110, subsequent_indent=" * ")
"""Wraps the text of a message into a comment of several lines."""


class Member(NamedTuple):
    """A field and its name in the struct."""

    name: str
    field: description.DescribedField

    @property
    def bits(self) -> int:
        """Bits of the C type: 8, 16, 32 or 64."""
        return next(bits for bits in (8, 16, 32, 64) if bits >= self.field.width)

    @property
    def raw_type(self) -> str:
        """Unsigned C type of the raw value."""
        return f"uint{self.bits}_t"

    @property
    def is_real(self) -> bool:
        """Whether the value is a floating-point number."""
        return self.field.numeral is description.Numeral.REAL

    @property
    def type(self) -> str:
        """C type of the value."""
        if self.is_real:
            return STRUCT_REALS[self.field.width]
        if self.field.numeral is description.Numeral.SIGNED:
            return f"int{self.bits}_t"
        return "bool" if self.field.width == 1 else self.raw_type

    def number(self, value: int) -> str:
        """Return a number of its type as C."""
        if self.field.numeral is description.Numeral.SIGNED:
            return signed(value, self.bits)
        # An int has at least 16 bits; a wider constant needs the macro of its type (C99, 7.18.4).
        return f"{value}u" if self.bits <= 16 else f"UINT{self.bits}_C({value})"

    @property
    def too_wide(self) -> str:
        """Condition in C that a value does not fit its field; empty if every value of the type fits."""
        width = self.field.width
        value = f"message->{self.name}"
        # A comparison that is always false would cause a warning.
        if width == self.bits or self.type == "bool":
            return ""
        if self.field.numeral is description.Numeral.SIGNED:
            sign = 1 << (width - 1)
            return f"{value} < {signed(-sign, self.bits)} || {value} > {signed(sign - 1, self.bits)}"
        return f"{value} > {unsigned((1 << width) - 1, self.bits)}"

    @property
    def meaning(self) -> str:
        """Expression in C for the value of the raw bits."""
        raw = f"raw_{self.name}"
        if self.type == "bool":
            return f"{raw} != 0u"
        if self.field.numeral is not description.Numeral.SIGNED:
            return raw
        # Converting an unsigned number that the signed type cannot hold is implementation-defined (C99, 6.3.1.3).
        sign_bit = 1 << (self.field.width - 1)
        low = f"({self.type})({raw} & {unsigned(sign_bit - 1, self.bits)})"
        negative = f"{low} - {signed(sign_bit - 1, self.bits)} - 1"
        return f"({self.type})(({raw} & {unsigned(sign_bit, self.bits)}) != 0u ? {negative} : {low})"


class MessageBlock(NamedTuple):
    """A message, its identifier in lower case with the network's prefix, and the members of its struct."""

    name: str
    message: description.DescribedMessage
    members: list[Member]

    @property
    def is_cut(self) -> bool:
        """Whether a frame may be shorter than the mapping."""
        return self.message.shortest < self.message.length


def c_header(protocol: Protocol, name: str) -> str:
    """Return the header of a protocol; its identifiers begin with `name`. Raises LocalError without messages."""
    return header_of(description.described(protocol), name)


def header_of(messages: Iterable[description.DescribedMessage], name: str) -> str:
    """Return the header of messages."""
    prefix = prefix_of(name)
    blocks = blocks_of(messages, name)
    # One namespace for all macros, because `GOTO` + `XY_MIN` and `GOTO_XY` + `MIN` are equal.
    macros = description.Identifiers(longest=PARTS * (description.LONGEST_IDENTIFIER + 1))
    lines = [*_head(prefix, blocks), *(line for each in blocks for line in _block(each, macros)), "", "#endif"]
    return "\n".join(lines) + "\n"


def prefix_of(name: str) -> str:
    """Return the prefix of the identifiers of a network."""
    return description.Identifiers(WORDS).new(name).lower()


def blocks_of(messages: Iterable[description.DescribedMessage], name: str) -> list[MessageBlock]:
    """Return the messages with the identifiers of messages and fields."""
    of_messages = description.Identifiers()
    prefix = prefix_of(name)
    blocks = []
    for each in messages:
        names = description.Identifiers(WORDS)  # each struct has its own namespace
        members = [Member(names.new(field.name).lower(), field) for field in each.fields]
        blocks.append(MessageBlock(f"{prefix}_{of_messages.new(each.name).lower()}", each, members))
    return blocks


def _head(prefix: str, blocks: Iterable[MessageBlock]) -> Iterator[str]:
    files = dict.fromkeys(each.message.file.name for each in blocks)
    yield f"/* Messages of {comment(', '.join(files))}, made by `eurobot-od export c`; do not edit."
    yield " *"
    yield " * pack: puts a message into `data`, which holds `size` bytes; returns the frame's length, 0 if it does not"
    yield " * fit or if a value is too wide for its field. unpack: takes a message out of a frame's data; returns false"
    yield " * and leaves the message unchanged if the frame is too short, as CiA 301 says; a longer one is read."
    yield " *"
    yield " * A value counts in its UNIT: one step of it is one of that. MIN and MAX are what may be sent, other macros"
    yield " * the values that have a name. is_unknown: all fields that have an UNKNOWN say so, and only together. */"
    yield f"#ifndef {prefix.upper()}_H"
    yield f"#define {prefix.upper()}_H"
    yield ""
    yield from (f"#include <{each}.h>" for each in ("stdbool", "stddef", "stdint", "string"))
    for bits, real in STRUCT_REALS.items():
        if any(member.type == real for block in blocks for member in block.members):
            yield ""
            yield f"/* If {real} does not have {bits} bits, as on some 8-bit controllers, this does not compile. */"
            # C99 has no static_assert; an array of -1 elements does the same.
            yield f"typedef char {prefix}_{real}_has_{bits}_bits[sizeof({real}) == {bits // 8} ? 1 : -1];"


def comment(text: str) -> str:
    """Return a text for a comment in C; `??` could begin a trigraph."""
    return description.printable(text).replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")


# A message


def _block(block: MessageBlock, macros: description.Identifiers) -> Iterator[str]:
    message = block.message
    about = f"{message.name}: {message.path}" + (f". {message.text}" if message.text else "")
    yield ""
    yield f"/* {WIDE.fill(comment(about))} */"
    yield ""
    yield f"#define {_macro(macros, block.name, 'cob_id')} 0x{message.cob_id:03X}u"
    yield f"#define {_macro(macros, block.name, 'length')} {message.length}u"
    if block.is_cut:
        yield f"#define {_macro(macros, block.name, 'shortest')} {message.shortest}u"
    for member in block.members:
        yield from _macros(block, member, macros)
    if block.members:  # C has no struct without members
        yield ""
        yield "typedef struct {"
        for member in block.members:
            yield f"    {member.type} {member.name}; /* {comment(member.field.allowed)} */"
        yield f"}} {block.name}_t;"
        yield from _pack(block)
        yield from _unpack(block)
        yield from _is_unknown(block)


def _macro(macros: description.Identifiers, *parts: str) -> str:
    return macros.new("_".join(parts)).upper()


def _macros(block: MessageBlock, member: Member, macros: description.Identifiers) -> Iterator[str]:
    """Yield macros for a field's limits and named values; an enum's constants would have to fit an int."""
    field = member.field
    of_values = description.Identifiers()
    if not member.is_real:
        for word, value in zip(("min", "max"), field.limits):
            yield f"#define {_macro(macros, block.name, member.name, word)} {member.number(value)}"
    if field.unit:
        # Without backslash and quote, the literal cannot end early.
        unit = comment(field.unit).replace("\\", "/").replace('"', "'")[:LONGEST_TEXT]
        yield f'#define {_macro(macros, block.name, member.name, "unit")} "{unit}"'
    if field.unknown is not None and field.unknown not in field.named:
        yield f"#define {_macro(macros, block.name, member.name, 'unknown')} {member.number(field.unknown)}"
    for value, text in field.named.items():
        yield f"#define {_macro(macros, block.name, member.name, of_values.new(text))} {member.number(value)}"


# Numbers


def unsigned(value: int, bits: int) -> str:
    """Return a hexadecimal constant of an unsigned type with `bits` bits."""
    # int has at least 16 bits (C99, 5.2.4.2.1).
    return f"0x{value:X}u" if bits <= 16 else f"UINT{bits}_C(0x{value:X})"


def signed(value: int, bits: int) -> str:
    """Return a constant of a signed type; the lowest number has no literal, because minus is an operator."""
    if value == -1 << (bits - 1):
        return f"({signed(value + 1, bits)} - 1)"
    text = str(value) if bits <= 16 else f"INT{bits}_C({abs(value)})"
    if value >= 0:
        return text
    return f"(-{text})" if bits > 16 else f"({text})"


# Functions


def _pack(block: MessageBlock) -> Iterator[str]:
    length = block.message.length
    yield ""
    # static inline, so that any number of source files may include the header.
    yield f"static inline size_t {block.name}_pack(uint8_t *data, size_t size, const {block.name}_t *message)"
    yield "{"
    for each in block.members:
        if each.is_real:
            # memcpy, because a union or a cast of pointers is undefined behaviour in C++ (strict aliasing).
            yield f"    {each.raw_type} raw_{each.name};"
            yield f"    memcpy(&raw_{each.name}, &message->{each.name}, sizeof raw_{each.name});"
        else:
            yield f"    const {each.raw_type} raw_{each.name} = ({each.raw_type})message->{each.name};"
    # All conditions are checked first, so that a message that does not fit leaves `data` unchanged.
    for condition in (f"size < {length}u", *filter(None, (each.too_wide for each in block.members))):
        yield f"    if ({condition}) return 0;"
    for byte in range(length):
        parts = [
            _moved(f"raw_{each.name}", chunk.shift, chunk.mask, chunk.offset % 8)
            for each in block.members
            for chunk in each.field.chunks
            if chunk.offset // 8 == byte
        ]
        # Without the cast, -Wconversion warns, because C computes in int. Unused bits are 0.
        yield f"    data[{byte}] = (uint8_t)({' | '.join(parts) or '0u'});"
    yield f"    return {length}u;"
    yield "}"


def _moved(source: str, start: int, mask: int, to: int, cast: str = "") -> str:
    """Return the C expression that moves the masked bits of a number from bit `start` to bit `to`."""
    taken = f"({source} >> {start})" if start else source
    part = f"{cast}({taken} & 0x{mask:X}u)"
    return f"({part} << {to})" if to else part


def _unpack(block: MessageBlock) -> Iterator[str]:
    length = block.message.length
    source = "all" if block.is_cut else "data"
    yield ""
    yield f"static inline bool {block.name}_unpack({block.name}_t *message, const uint8_t *data, size_t length)"
    yield "{"
    if block.is_cut:  # padded with zeros, so that no field is read after the frame's end
        yield f"    uint8_t all[{length}] = {{0}};"
        yield f"    if (length < {length}u && length != {block.message.shortest}u) return false;"
        yield f"    memcpy(all, data, length < {length}u ? length : {length}u);"
    else:
        yield f"    if (length < {length}u) return false;"
    for member in block.members:
        raw = f"raw_{member.name}"
        kind = member.raw_type
        default = member.field.default
        # Cast before shifting, because a byte becomes an int, which may be too small.
        bits = (
            _moved(f"{source}[{c.offset // 8}]", c.offset % 8, c.mask, c.shift, f"({kind})")
            for c in member.field.chunks
        )
        taken = f"({kind})({' | '.join(bits)})"
        if default is not None:
            taken = f"({kind})(length < {length}u ? {unsigned(default, member.bits)} : {taken})"
        yield f"    const {kind} {raw} = {taken};"
        if member.is_real:
            yield f"    memcpy(&message->{member.name}, &{raw}, sizeof {raw});"
        else:
            yield f"    message->{member.name} = {member.meaning};"
    yield "    return true;"
    yield "}"


def _is_unknown(block: MessageBlock) -> Iterator[str]:
    together = [each for each in block.members if each.field.unknown is not None]
    if len(together) > 1:  # a single field is compared with its macro UNKNOWN
        tests = (f"message->{each.name} == {each.number(each.field.unknown or 0)}" for each in together)
        yield ""
        yield f"static inline bool {block.name}_is_unknown(const {block.name}_t *message)"
        yield "{"
        yield f"    return {' && '.join(tests)};"
        yield "}"
