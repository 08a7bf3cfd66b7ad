"""The objects of a device as its profile sees them: by index within an axis, and only those that its file has."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from eurobot_od.od.values import Address


class ProfileValues(Protocol):
    """The values of a running device."""

    def has(self, address: Address) -> bool:
        """Tell whether the file has an object."""

    def get(self, address: Address) -> int | None:
        """Return its value, None if it has none, or one that is not a number."""

    def put(self, address: Address, value: int) -> None:
        """Keep a value."""

    def unit(self, address: Address) -> str:
        """Return the unit that the file gives it; empty without one."""


class AxisValues(NamedTuple):
    """The objects of one axis; `offset` is added to the indices of the first one."""

    values: ProfileValues
    offset: int = 0

    def has(self, index: int, sub: int = 0) -> bool:
        """Tell whether the axis has an object."""
        return self.values.has((index + self.offset, sub))

    def find(self, index: int, sub: int = 0) -> int | None:
        """Return an object's value; None if the axis does not have it, or if it has no value."""
        address = index + self.offset, sub
        return self.values.get(address) if self.values.has(address) else None

    def get(self, index: int, sub: int = 0, default: int = 0) -> int:
        """Return an object's value; `default` if the axis does not have it, or if it has no value."""
        value = self.find(index, sub)
        return default if value is None else value

    def put(self, index: int, value: int) -> None:
        """Give an object a value, if the axis has it."""
        address = index + self.offset, 0
        if self.values.has(address) and self.values.get(address) != value:
            self.values.put(address, value)

    def unit(self, index: int) -> str:
        """Return the unit of an object in the file."""
        return self.values.unit((index + self.offset, 0))
