"""A node at its gatekeeper: received frames to the node, the node's frames to the mailboxes.

Still no bus and no thread: `live` and `simulation` both drive stations. Whichever thread calls, the node's `guard` is
held while the node works and until its frames are in the mailboxes, so that frames leave in the order in which the node
made them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from eurobot_od.device.emergency import ErrorCode
from eurobot_od.device.node import Node
from eurobot_od.errors import DictionaryError
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Event, Gatekeeper, Report


class Station:
    """One node with its own gatekeeper, to which more listeners may be added.

    Its `plan` tells whether the node has planned anything sooner than when `next_wakeup` was asked for last.
    `has_failed` takes an exception that `tick` or `requested` has raised, and when: it counts and is reported like one
    that the node raises when it gets a frame.
    """

    def __init__(
        self,
        node: Node,
        *,
        report: Callable[[Report], object] | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.node, self.plan = node, node.device.plan
        self.gatekeeper = Gatekeeper(
            node.device.protocol,
            report=report,
            clock=clock,
            **_sizes(node),
        )
        self._identifiers = node.device.identifiers
        node.alarm = self._report_alarm
        self.has_failed = self.gatekeeper.add_node(lambda: self._identifiers, self._received, node.name).has_failed

    def start(self, now: float) -> None:
        """Switch the node on."""
        with self.node.guard:
            self._submit(self.node.start(now), now)

    def tick(self, now: float) -> None:
        """Let the node do what is due."""
        with self.node.guard:
            self._submit(self.node.tick(now), now)

    def requested(self, cob_id: int, now: float) -> None:
        """Hand the node a remote frame: no listener hears those, but a node may be asked by them."""
        with self.node.guard:
            self._submit(self.node.requested(cob_id, now), now)

    @property
    def next_wakeup(self) -> float:
        """When to call `tick`, in the node's time; infinite if nothing is planned."""
        with self.node.guard:
            wakeup = self.plan.soonest = self.node.next_wakeup
            return wakeup

    def bus_error(self, code: ErrorCode, now: float) -> None:
        """Tell the node what the CAN controller reports."""
        with self.node.guard:
            self.node.bus_error(code, now)

    def bus_lost(self, now: float) -> None:
        """Tell the node that the bus is lost."""
        with self.node.guard:
            self.gatekeeper.mailboxes.withdraw(self.node.device.sdo_answers)
            self._submit(self.node.bus_lost(now), now)

    def _report_alarm(self, text: str) -> None:
        self.gatekeeper.report(Report(Event.NODE_ALARM, self.node.name, text, self.node.now))

    def _received(self, frame: Frame, now: float) -> None:
        with self.node.guard:
            self._submit(self.node.receive(frame, now), now)
            if self.node.device.identifiers is not self._identifiers:  # a master has changed them with this frame
                self._identifiers = self.node.device.identifiers
                self.gatekeeper.reroute(self.node.device.protocol)

    def _submit(self, frames: list[Frame], now: float) -> None:
        mailboxes, device = self.gatekeeper.mailboxes, self.node.device
        for frame in frames:
            stop = frame.cob_id in device.always_sent
            # A stop waits as long as it takes. It is repeated, too: one of a kind that waits is enough.
            if not (stop and mailboxes.holds(frame)):
                mailboxes.submit(frame, now, lasting=stop or frame.cob_id == device.sdo_answers)


def _sizes(node: Node) -> dict[str, Any]:
    """Return the sizes in a node's Transmit settings; nothing for a device that has none: the gatekeeper's own do."""
    try:
        return {
            "table_size": node.setting("Transmit.Listener table size"),
            "mailboxes": node.setting("Transmit.Mailboxes"),
            "mailbox_wait": node.seconds("Transmit.Mailbox wait"),
        }
    except DictionaryError:
        return {}
