"""A simulated device with a profile: its objects as the profile sees them, and when nobody commands it any more."""

from __future__ import annotations

from eurobot_od.device.nmt import NmtState
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
        """Return its value, None if it has none, or one that is not a number."""
        value = self._node.device.objects.kept(address)
        return value if isinstance(value, int) else None

    def put(self, address: Address, value: int) -> None:
        """Keep a value."""
        self._node.device.objects.put(address, value)

    def unit(self, address: Address) -> str:
        """Return the unit that the file gives it; empty without one."""
        variable = self._node.dictionary.variable(address)
        return "" if variable is None else str(variable.unit)


class ProfileDevice(SimulatedDevice):
    """A device whose profile says what it does when nobody can command it any more."""

    def _connection_lost(self) -> None:
        """Do what the profile says about a lost heartbeat, a lost bus, and the state Stopped."""

    def halted(self) -> None:
        super().halted()
        # In Pre-operational a master still reaches it by SDO; in Stopped nobody does.
        if self.device.state is NmtState.STOPPED:
            self._connection_lost()

    def heartbeat_lost(self, node_id: int) -> None:
        super().heartbeat_lost(node_id)
        self._connection_lost()

    def cut_off(self) -> None:
        super().cut_off()
        self._connection_lost()
