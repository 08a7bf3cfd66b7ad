"""PDOs as an object dictionary describes them: communication parameters and what is mapped (CiA 301, 7.5.2.35)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, NoReturn, TypeAlias

from eurobot_od.errors import MappingError
from eurobot_od.od.values import (
    DUMMIES,
    MAPPING_OFFSET,
    SYNCHRONOUS,
    UNSIGNED64,
    Address,
    DataType,
    Limits,
    PdoDirection,
)

PADDING = "Padding"
"""ParameterName, with or without a number after it, of a mapped object that fills bits nobody uses."""


class MappedObject(NamedTuple):
    """One entry of a mapping: the object, its mapped length in bits, its ParameterName, limits and data type.

    A slice has the limits and the type of the value that it is a part of.
    """

    index: int  # type: ignore[assignment]  # CANopen's term; nobody searches the tuple
    subindex: int
    bits: int
    name: str
    limits: Limits
    type: DataType = UNSIGNED64

    @property
    def is_padding(self) -> bool:
        """Whether these bits carry nothing."""
        return self.index in DUMMIES or self.name.startswith(PADDING)


class Pdo(NamedTuple):
    """A PDO of a device: communication record `index`, its ParameterName, COB-ID and mapping.

    `inhibit_time` is in 100 us, `event_timer` in ms: the longest time between two TPDOs, or the deadline of an RPDO; 0
    for none (CiA 301, Tables 66 and 70).
    """

    direction: PdoDirection
    index: int  # type: ignore[assignment]  # as above
    name: str
    cob_id: int
    valid: bool
    transmission_type: int
    mapping: tuple[MappedObject, ...]
    inhibit_time: int = 0
    event_timer: int = 0

    @property
    def is_synchronous(self) -> bool:
        """Whether it is sent, or takes effect, with a SYNC."""
        return self.transmission_type in SYNCHRONOUS

    @property
    def mapping_index(self) -> int:
        """Index of the mapping record."""
        return self.index + MAPPING_OFFSET

    @property
    def number(self) -> int:
        """Number of the PDO in its direction, from 1 (CiA 301: TPDO 1 has its records at 0x1800 and 0x1A00)."""
        return self.index - self.direction.value + 1


class Part(NamedTuple):
    """What a slice is: `bits` bits of the object at `whole`, from its bit `low` on."""

    whole: Address
    low: int
    bits: int

    @property
    def _mask(self) -> int:
        return (1 << self.bits) - 1

    def of(self, whole: int) -> int:
        """Return the part of a whole value."""
        return whole >> self.low & self._mask

    def put(self, whole: int, value: int) -> int:
        """Return the whole with another value of the part."""
        return whole & ~(self._mask << self.low) | (value & self._mask) << self.low


OnRefused: TypeAlias = Callable[[MappingError], object]
"""What is done about a PDO that does not hold, which is then left out."""


def fatal(error: MappingError) -> NoReturn:
    """Let no PDO be left out: raise the error."""
    raise error
