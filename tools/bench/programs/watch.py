"""Runs one program that watches a full bus, on the terminal it was started on: `watch.py READER SECONDS DESCRIPTOR`.

The readers are the real programs, with frames from a thread of the same process, whose CPU time is subtracted. The
figures are written to the descriptor as JSON.
"""

from __future__ import annotations

import json
import os
import random
import sys
import threading
import time
from collections.abc import Callable

import can

from eurobot_od.robot.protocol import EurobotProtocol, decoder

RATE = 9000
"""Frames a second: with 8 bytes of data each, 100 % of 1 Mbit/s."""

CHANNEL = "bench"

AFTER = 0.3
"""Time for a reader to empty its queue, in s."""

ESCAPE = 27
"""The key that ends python-can's viewer."""


def frames() -> list[can.Message]:
    """Make a second's frames: all messages of the protocol, with any data."""
    chance = random.Random(1)
    bindings = EurobotProtocol.load().bindings
    chosen = [chance.choice(bindings) for _ in range(RATE)]
    return [
        can.Message(arbitration_id=b.cob_id, data=chance.randbytes(b.layout.length), is_extended_id=False)
        for b in chosen
    ]


class Sender(threading.Thread):
    """Sends at the rate for some seconds; then `sent` frames and `cpu` seconds are known."""

    def __init__(self, seconds: float) -> None:
        super().__init__(daemon=True)
        self.seconds = seconds
        self.sent = 0
        self.cpu = 0.0

    def run(self) -> None:
        """Send what is due, every millisecond or so."""
        with can.Bus(interface="virtual", channel=CHANNEL) as bus:
            messages = frames()
            begin = time.monotonic()
            while (passed := time.monotonic() - begin) < self.seconds:
                for _ in range(int(passed * RATE) - self.sent):
                    bus.send(messages[self.sent % RATE])
                    self.sent += 1
                time.sleep(0.001)
        self.cpu = time.thread_time()

    def then(self, end: Callable[[], object]) -> None:
        """Call `end` when all is sent and read."""

        def wait() -> None:
            self.join()
            time.sleep(AFTER)
            end()

        threading.Thread(target=wait, daemon=True).start()


def monitor(sender: Sender) -> int:
    """Run our monitor on the terminal and return how many frames it counted."""
    from eurobot_od.cli import monitor as command
    from eurobot_od.traffic.monitor import BusSource, Controls, Traffic

    source = BusSource(can.Bus(interface="virtual", channel=CHANNEL))
    watched = command.Monitor(Traffic(decoder(), 1_000_000), Controls("identifier", ""), source)
    sender.start()
    sender.then(lambda: watched.controls.key("q"))
    with command.on_screen(watched) as (took, refresh):
        watched.run(took, refresh, lambda *_: None)
    source.close()
    return sum(row.count for row in watched.traffic.rows.values())


def viewer(sender: Sender) -> int:
    """Run python-can's viewer on the terminal; it does not say how many frames it lost."""
    import curses

    from can.viewer import CanViewer

    with can.Bus(interface="virtual", channel=CHANNEL) as bus:
        sender.start()
        sender.then(lambda: curses.ungetch(ESCAPE))
        curses.wrapper(lambda screen: CanViewer(screen, bus, {}))  # type: ignore[no-untyped-call]
    return sender.sent


def notifier(sender: Sender) -> int:
    """Count the frames with python-can's notifier."""
    came: list[None] = []
    with can.Bus(interface="virtual", channel=CHANNEL) as bus, can.Notifier(bus, [lambda _: came.append(None)]):
        sender.start()
        sender.join()
        time.sleep(AFTER)
    return len(came)


READERS: dict[str, Callable[[Sender], int]] = {"monitor": monitor, "viewer": viewer, "notifier": notifier}


def main() -> None:
    """Run a reader and report its figures."""
    reader, seconds, report = sys.argv[1:]
    sender = Sender(float(seconds))
    begin = time.process_time()
    counted = READERS[reader](sender)
    share = (time.process_time() - begin - sender.cpu) / sender.seconds
    os.write(int(report), json.dumps({"share": share, "lost": sender.sent - counted}).encode())


if __name__ == "__main__":
    main()
