"""Where the bits of each field lie in a PDO, for any mapping of 1 to 64 bits at any offset (CiA 301, 7.4.8.2).

The first mapped object has the least significant bits, and bytes follow in little-endian order. A value may also be
mapped in slices, `X position (11:4)` and so on, at any places: some controllers send the most significant bit first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple

from eurobot_od.od.values import MAX_BITS, SLICE


class LayoutError(ValueError):
    """Mapping entries that do not make a layout: a gap, an overlap, a wrong length, or more than 64 bits."""


class Slot(NamedTuple):
    """One mapping entry: `bits` bits of `field` (None: padding), the lowest being the value's bit `shift`.

    The highest bit of a `signed` field is its sign (two's complement, CiA 301, 7.1.4.4).
    """

    field: str | None
    shift: int
    bits: int
    signed: bool = False


def slot(name: str, bits: int, to_field: Callable[[str], str], signed: bool = False) -> Slot:
    """Return the slot of a mapping entry from its ParameterName and mapped length.

    Raises LayoutError if a slice's name and its mapped length contradict each other.
    """
    match = SLICE.match(name)
    if match is None:
        return Slot(to_field(name), 0, bits, signed)
    high, low = int(match["high"]), int(match["low"])
    # Which of the two is wrong cannot be seen, and a wrong guess would shift every field behind it.
    if high - low + 1 != bits:
        raise LayoutError(f"{name} is mapped with {bits} bits")
    return Slot(to_field(match["name"]), low, bits, signed)


class Run(NamedTuple):
    """Bits side by side in value and word alike: value bit `shift` is word bit `offset`, for `bits` bits."""

    shift: int
    offset: int
    bits: int

    @property
    def mask(self) -> int:
        return (1 << self.bits) - 1

    def place(self, value: int) -> int:
        """Return this run's part of a value, at its place in the word."""
        return (value >> self.shift & self.mask) << self.offset


ByteOrder = Literal["little", "big"]


class Layout:
    """Where each field's bits lie in a PDO: `fields` in wire order, `widths` in bits, `length` in bytes.

    `raws` are the raw values that the bits of each field can hold.

    The frame is read as one integer, in the byte order that leaves the fewest runs: a value whose slices are stored
    most significant first is in one piece again when the frame is read as big-endian. `runs_in` has each field's runs
    for either order, `runs` for that one.
    Raises LayoutError for over 64 bits, and for parts of a field that overlap or leave a gap.
    """

    def __init__(self, slots: Iterable[Slot]) -> None:
        self.slots = tuple(slots)
        self.bits = sum(slot.bits for slot in self.slots)
        if self.bits > MAX_BITS:
            raise LayoutError(f"{self.bits} bits are mapped, a PDO has at most {MAX_BITS}")
        self.length = (self.bits + 7) // 8
        # Bit by bit first, as slices may come in any order; runs, which cost a shift and a mask each, are made of that.
        self._places = {field: _whole(field, places) for field, places in self._collect().items()}
        self.fields = tuple(self._places)
        self.widths = {field: len(places) for field, places in self._places.items()}
        self.signed = frozenset(slot.field for slot in self.slots if slot.signed)
        # Two's complement: half of the values of a signed field are below 0 (CiA 301, 7.1.4.4).
        below = {field: (1 << width) // 2 * (field in self.signed) for field, width in self.widths.items()}
        self.raws = {field: range(-low, (1 << self.widths[field]) - low) for field, low in below.items()}
        orders: tuple[ByteOrder, ...] = ("little", "big")
        self.runs_in = {order: self._runs_in(order) for order in orders}
        # With as many runs either way it is little-endian, CANopen's own order: `min` takes the first of equals.
        self.byte_order: ByteOrder = min(orders, key=lambda order: sum(map(len, self.runs_in[order].values())))
        self.runs = self.runs_in[self.byte_order]

    def _collect(self) -> dict[str, list[tuple[int, int]]]:
        """Return for each field its pairs of value bit and frame bit."""
        found: dict[str, list[tuple[int, int]]] = {}
        offset = 0
        for field, shift, bits, _ in self.slots:
            if field is not None:  # padding only moves what follows
                found.setdefault(field, []).extend((shift + bit, offset + bit) for bit in range(bits))
            offset += bits
        return found

    def _runs_in(self, order: ByteOrder) -> dict[str, tuple[Run, ...]]:
        # Read as big-endian, the first byte is the word's highest; the bits within a byte stay where they are.
        flip = 8 * (self.length - 1) if order == "big" else 0
        return {
            field: _merge([abs(flip - place // 8 * 8) + place % 8 for place in places])
            for field, places in self._places.items()
        }

    def places(self, field: str) -> list[int]:
        """Return the frame bits (8 times the byte plus the bit in it) of a field's bits 0, 1, 2, ..."""
        return list(self._places[field])

    def shortest(self, needed: Iterable[str]) -> int:
        """Return the number of bytes that hold all `needed` fields: a frame without the others may end there."""
        return max((max(self._places[field]) // 8 + 1 for field in needed), default=0)

    def place(self, field: str, raw: int) -> int:
        """Return a raw value's bits at their places in the word."""
        return sum(run.place(raw) for run in self.runs[field])


def _whole(field: str, pairs: list[tuple[int, int]]) -> list[int]:
    """Return the frame bits of a value's bits 0, 1, 2, ...; each must be there exactly once."""
    value_bits = [value_bit for value_bit, _ in pairs]
    for bit in range(max(value_bits)):
        if bit not in value_bits:
            raise LayoutError(f"{field}: bit {bit} is mapped nowhere")
    # The frame would say the same bit twice, and could contradict itself.
    if len(set(value_bits)) != len(pairs):
        raise LayoutError(f"{field}: bits are mapped twice")
    return [place for _, place in sorted(pairs)]


def _merge(places: list[int]) -> tuple[Run, ...]:
    """Return the runs of a value whose bits 0, 1, 2, ... are the word's bits `places`."""
    runs: list[Run] = []
    for bit, place in enumerate(places):
        if runs and place == runs[-1].offset + runs[-1].bits:
            runs[-1] = runs[-1]._replace(bits=runs[-1].bits + 1)
        else:
            runs.append(Run(bit, place, 1))
    return tuple(runs)
