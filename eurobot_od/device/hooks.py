"""What a node is told besides its messages: a subclass overrides what it wants to know.

All of them are called with the node's guard held, from `receive`, `tick` or `restart`, except where it is said.
"""

from __future__ import annotations

from typing import Any

from eurobot_od.device.timers import Call
from eurobot_od.frame import Frame


class NodeHooks:
    """What can happen to a node; by default nothing comes of it."""

    def halted(self) -> None:
        """The node is no longer OPERATIONAL."""

    def cut_off(self) -> None:
        """The bus is lost, so nobody can command the node: by default the same as `halted`."""
        self.halted()

    def heartbeat_lost(self, node_id: int) -> None:
        """Another node has fallen silent."""

    def booted(self, node_id: int) -> None:
        """A watched node has booted and so has forgotten everything."""

    def answered(self, frame: Frame) -> None:
        """Another node has answered one of our SDO requests."""

    def leave(self) -> Call[Any] | None:
        """Begin what has to be done before the node is switched off; return its call, None if there is nothing to do.

        Whoever runs the node waits for the call before they end it. It may be called from any thread.
        """
        return None

    def switched_off(self) -> None:
        """Give up whatever anybody still waits for: `receive` and `tick` will not be called again."""
