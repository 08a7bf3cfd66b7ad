"""Events of a node other than messages, as methods for subclasses.

All of them are called with the node's guard held, from `receive`, `tick` or `restart`, unless stated otherwise.
"""

from __future__ import annotations

from typing import Any

from eurobot_od.device.timers import Call
from eurobot_od.frame import Frame


class NodeHooks:
    """Methods for events of a node; by default they do nothing."""

    def halted(self) -> None:
        """The node is no longer OPERATIONAL."""

    def cut_off(self) -> None:
        """The bus is lost, so that nobody can command the node; by default the same as `halted`."""
        self.halted()

    def heartbeat_lost(self, node_id: int) -> None:
        """The heartbeat of another node is lost."""

    def booted(self, node_id: int) -> None:
        """A watched node has booted, and so has lost its state."""

    def answered(self, frame: Frame) -> None:
        """Another node has answered one of our SDO requests."""

    def leave(self) -> Call[Any] | None:
        """Start the last actions before the node is switched off; return their call, or None.

        The caller waits for the call before it ends the node. It may be called from any thread.
        """
        return None

    def switched_off(self) -> None:
        """Cancel all pending calls: `receive` and `tick` will not be called again."""
