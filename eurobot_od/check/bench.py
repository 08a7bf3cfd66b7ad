"""What a runner needs of a bus, be it real or simulated."""

from __future__ import annotations

from typing import Protocol

from eurobot_od.check.trace import Trace
from eurobot_od.frame import Frame


class Bench(Protocol):
    """A bus with the nodes under test; the tester is another participant, with no node of its own."""

    trace: Trace
    """Every frame of the others, once the bench has begun."""

    async def begin(self) -> None:
        """Return when the nodes are up; called once."""

    async def send(self, frame: Frame) -> float:
        """Send a frame and return, once it is on its way, its time by the loop's clock; raises BusError."""

    async def recover(self) -> bool:
        """Open a bus that has failed again; return whether it works before all patience is at an end."""
