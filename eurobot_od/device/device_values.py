"""The objects of a simulated device as its profile sees them."""

from __future__ import annotations

from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.values import Address


class DeviceValues:
    """The objects of a node for its profile; whatever a reset has made of them."""

    def __init__(self, node: SimulatedDevice) -> None:
        self._node = node
        self._known: dict[Address, bool] = {}

    def has(self, address: Address) -> bool:
        """Tell whether the file has an object."""
        if address not in self._known:
            self._known[address] = self._node.dictionary.variable(address) is not None
        return self._known[address]

    def get(self, address: Address) -> int | None:
        """Return its value, None if it has none, or one that is no number."""
        value = self._node.device.objects.kept(address)
        return value if isinstance(value, int) else None

    def put(self, address: Address, value: int) -> None:
        """Keep a value."""
        self._node.device.objects.put(address, value)

    def unit(self, address: Address) -> str:
        """Return the unit that the file gives it; empty without one."""
        variable = self._node.dictionary.variable(address)
        return "" if variable is None else str(variable.unit)
