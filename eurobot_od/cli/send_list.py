"""A list of frames, sent by the command `send`."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from eurobot_od.bus.live import transmit
from eurobot_od.check.sending import RunningList, read_list
from eurobot_od.cli.options import BusOptions
from eurobot_od.client.master import Master
from eurobot_od.frame import Frame
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.files import read_whole

LOOK = 0.1
"""Longest time in s between two looks at a list that waits."""


def send_list(file: str, protocol: Protocol, bus: BusOptions) -> int:
    """Send a list until nothing of it is left, or Ctrl-C; return the number of frames sent.

    Raises LocalError for a wrong list, before the bus is opened, and BusError.
    """
    rows = read_list(read_whole(Path(file)).decode("utf-8", "replace"), file, protocol)
    with Master(bus.open()) as master:
        running = RunningList(rows, protocol, master.clock())

        def hear(cob_id: int, data: bytes, _: float) -> None:
            running.take(master.clock(), Frame(cob_id, data))

        with master.observed(hear), suppress(KeyboardInterrupt):
            while not running.is_over:
                master.pump(min(running.next - master.clock(), LOOK), lambda: running.next <= master.clock())
                for frame in running.due(master.clock()):
                    transmit(master.bus, frame)
                    running.take(master.clock(), frame)  # the driver does not give it back
    return running.sent
