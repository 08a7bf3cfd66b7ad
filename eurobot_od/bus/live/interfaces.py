"""Which CAN interfaces this machine has: SocketCAN's, and what the drivers of python-can find."""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from eurobot_od.bus.live.buses import SOCKETCAN, silence_logs
from eurobot_od.bus.live.links import links

NOT_ASKED = ("virtual", "udp_multicast", "socketcand", SOCKETCAN)
"""What python-can finds anywhere, what it listens for in the network for seconds, and what `links` describes better."""


class Attached(NamedTuple):
    """An interface of python-can, its channel, and how it `is`, as far as that is known."""

    interface: str
    channel: str
    is_: str = ""

    def __str__(self) -> str:
        how = f" ({self.is_})" if self.is_ else ""
        return f"-i {self.interface} -c {self.channel}{how}"


PORTS = ("ttyUSB*", "ttyACM*")
"""Serial ports, as slcan adapters have."""


def refused(folder: Path = Path("/dev")) -> list[str]:
    """Return the serial ports that this user may not open."""
    ports = sorted(port for pattern in PORTS for port in folder.glob(pattern))
    return [str(port) for port in ports if not os.access(port, os.R_OK | os.W_OK)]


def drivers() -> dict[str, bool]:
    """Return whether the driver of each interface of python-can can be loaded; what it drives may still be missing."""
    from can.interfaces import BACKENDS

    silence_logs()
    loaded = {}
    for interface, (module, _) in sorted(BACKENDS.items()):
        try:
            import_module(module)
            loaded[interface] = True
        except Exception:  # whatever a driver raises while it looks for its library
            loaded[interface] = False
    return loaded


def here() -> list[Attached]:
    """Return the interfaces of this machine; what a driver that is not installed would find is not among them."""
    import can
    from can.interfaces import BACKENDS

    silence_logs()
    ours = [Attached(SOCKETCAN, link.name, str(link)) for link in links()]
    found = can.detect_available_configs([each for each in BACKENDS if each not in NOT_ASKED])
    return ours + [Attached(str(each["interface"]), str(each["channel"])) for each in found]
