"""Which CAN interfaces this machine has: SocketCAN's, and what the drivers of python-can find."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.live.buses import SOCKETCAN, silence_logs
from eurobot_od.live.links import links

WITHOUT_WIRES = ("virtual", "udp_multicast", SOCKETCAN)
"""What python-can finds anywhere, and what `links` tells better."""


class Attached(NamedTuple):
    """An interface of python-can, its channel, and how it `is`, as far as that is known."""

    interface: str
    channel: str
    is_: str = ""

    def __str__(self) -> str:
        how = f" ({self.is_})" if self.is_ else ""
        return f"-i {self.interface} -c {self.channel}{how}"


def here() -> list[Attached]:
    """Return the interfaces of this machine; what a driver that is not installed would find is not among them."""
    return [*(Attached(SOCKETCAN, link.name, str(link)) for link in links()), *_found()]


def _found() -> list[Attached]:
    """Ask the drivers of python-can."""
    import can

    silence_logs()
    found = can.detect_available_configs()
    return [
        Attached(str(each["interface"]), str(each["channel"]))
        for each in found
        if each["interface"] not in WITHOUT_WIRES
    ]
