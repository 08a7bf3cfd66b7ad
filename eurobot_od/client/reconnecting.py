"""Lets a periodic task of a master continue when its bus is lost and comes back.

A bus that has never worked is raised as an error; only one that has worked is opened again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from eurobot_od.bus.live import Driver, Opener
from eurobot_od.bus.live.connection import Connection
from eurobot_od.errors import BusError

if TYPE_CHECKING:
    from eurobot_od.client.master import Master

Guard: TypeAlias = Callable[[Callable[[], object]], None]
"""Takes one step; raises BusError if the bus has failed and is not to be opened again."""


def unguarded(step: Callable[[], object]) -> None:
    """Take a step, and let a failing bus end everything."""
    step()


class Reconnecting:
    """A guard that opens a master's bus again, by `opener`, when a step fails; that step is not taken again.

    `tell` gets a line when the bus is lost and when it is back.
    """

    def __init__(self, master: Master, opener: Opener, tell: Callable[[str], object]) -> None:
        def lost(why: BusError, _: bool) -> None:
            tell(f"{why}; it is opened again")

        def back(gap: float) -> None:
            tell(f"the bus is back after a gap of {gap:.1f} s")

        self._master, self._has_worked = master, False
        self._connection = Connection(Driver(master.bus), opener, master.clock, lost, lambda: None, back)

    def __call__(self, step: Callable[[], object]) -> None:
        """Take a step."""
        try:
            step()
        except BusError as error:
            if not self._has_worked:
                raise
            self._connection.fail(error)
            self._connection.reopen()
            self._master.bus = self._connection.driver.bus
        else:
            self._has_worked = True
            self._connection.works()
