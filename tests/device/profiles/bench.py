"""One axis on a bench: its objects in a dict, its time in the test's hand, no device and no bus."""

from __future__ import annotations

from collections.abc import Mapping

from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.device.profiles.motion import AxisValues, Plant
from eurobot_od.od.cia402 import CONTROLWORD, State, state_of
from eurobot_od.od.values import Address

TURN = 1000
"""Position units of a turn; velocities are in position units/s."""

OBJECTS: Mapping[Address, int] = {
    (0x603F, 0): 0,
    (0x6040, 0): 0,
    (0x6041, 0): 0,
    (0x6060, 0): 1,
    (0x6061, 0): 0,
    (0x6064, 0): 0,
    (0x6067, 0): 2,
    (0x606C, 0): 0,
    (0x6071, 0): 0,
    (0x6074, 0): 0,
    (0x6077, 0): 0,
    (0x607A, 0): 0,
    (0x607C, 0): 0,
    (0x6081, 0): 1000,
    (0x6083, 0): 10_000,
    (0x6084, 0): 10_000,
    (0x6085, 0): 50_000,
    (0x6087, 0): 1000,
    (0x608F, 1): TURN,
    (0x608F, 2): 1,
    (0x6098, 0): 35,
    (0x6099, 1): 3000,
    (0x6099, 2): 500,
    (0x609A, 0): 50_000,
    (0x60C2, 1): 10,
    (0x60C2, 2): -3,
    (0x60F4, 0): 0,
    (0x60FD, 0): 0,
    (0x60FF, 0): 0,
    (0x6502, 0): 0x3AD,
}
"""A drive with the modes that are simulated; what is not here the axis does not have."""


ROUND_TABLE = Plant()
"""The axis without ends."""


class Shelf(AxisValues):
    """Values in a dict."""

    def __init__(self, values: Mapping[Address, int], offset: int = 0) -> None:
        self.values, self._offset = dict(values), offset

    def _address(self, index: int, sub: int) -> Address | None:
        address = index + self._offset, sub
        return address if address in self.values else None

    def _value(self, address: Address) -> int:
        return self.values[address]

    def _keep(self, address: Address, value: int) -> None:
        self.values[address] = value

    def unit(self, index: int) -> str:
        return ""


class Bench:
    """An axis that has just been switched on; `faults` are the codes that it has reported, None: it was reset."""

    def __init__(
        self,
        objects: Mapping[Address, int] | None = None,
        *,
        plant: Plant = ROUND_TABLE,
        kind: type[DriveAxis] = DriveAxis,
        without: tuple[int, ...] = (),
    ) -> None:
        values = {a: value for a, value in {**OBJECTS, **(objects or {})}.items() if a[0] not in without}
        self.shelf, self.now = Shelf(values), 0.0
        self.faults: list[int | None] = []
        self.axis = kind(self.shelf, plant, self.faults.append)
        self.axis.control(0.0)

    def __getitem__(self, index: int) -> int:
        return self.shelf.values[index, 0]

    def write(self, index: int, value: int, sub: int = 0) -> None:
        """Write an object, as an SDO does."""
        if index == CONTROLWORD:
            self.axis.commanded()
        self.shelf.values[index, sub] = value
        self.axis.control(self.now)

    def run(self, seconds: float, step: float = 0.001) -> None:
        """Advance the time in steps of `step` seconds."""
        for _ in range(round(seconds / step)):
            self.now += step
            self.axis.advance(self.now)

    def rest(self) -> None:
        """Advance the time until nothing moves, two minutes at most."""
        while self.axis.busy and self.now < 120:
            self.run(0.1, 0.1)

    def command(self, *words: int) -> None:
        """Write controlwords one after the other."""
        for word in words:
            self.write(0x6040, word)

    def enable(self, mode: int = 1) -> Bench:
        """Enable operation in a mode."""
        self.write(0x6060, mode)
        self.command(0x06, 0x07, 0x0F)
        assert self.state is State.ENABLED
        return self

    @property
    def state(self) -> State | None:
        """The state that the statusword says."""
        return state_of(self[0x6041])

    @property
    def position(self) -> int:
        return self[0x6064]

    def is_set(self, bit: int) -> bool:
        """Return whether a bit of the statusword is set."""
        return bool(self[0x6041] >> bit & 1)
