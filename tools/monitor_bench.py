"""Measures what watching a full bus costs: our monitor, python-can's viewer and a bare notifier, one after the other.

Rule of this file: each reader is the real program on a terminal of its own, in a process of its own, with the same
frames from a thread beside it; the CPU time of that thread is taken off.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from environment import ensure

ensure("can", "test")

import can  # noqa: E402

from eurobot_od import dialects  # noqa: E402
from eurobot_od.protocol import Protocol  # noqa: E402

RATE = 9000
"""Frames in a second: 8 bytes of data each at 100 % of 1 Mbit/s."""

CHANNEL = "monitor bench"

AFTER = 0.5
"""Seconds that a reader has for what is still in its queue."""

ESCAPE = 27
"""The key that ends python-can's viewer."""


def frames() -> list[can.Message]:
    """Make a second's frames: all messages of the protocol, with any data."""
    chance = random.Random(1)
    bindings = Protocol.load().bindings
    chosen = [chance.choice(bindings) for _ in range(RATE)]
    return [
        can.Message(arbitration_id=b.cob_id, data=chance.randbytes(b.layout.length), is_extended_id=False)
        for b in chosen
    ]


class Sender(threading.Thread):
    """Sends at the rate for some seconds; then `sent` frames and `cpu` seconds are known."""

    def __init__(self, seconds: float) -> None:
        super().__init__(daemon=True)
        self.seconds, self.sent, self.cpu = seconds, 0, 0.0

    def run(self) -> None:
        """Send what is due, every millisecond or so."""
        with can.Bus(interface="virtual", channel=CHANNEL) as bus:
            messages, begin = frames(), time.monotonic()
            while (passed := time.monotonic() - begin) < self.seconds:
                for _ in range(int(passed * RATE) - self.sent):
                    bus.send(messages[self.sent % RATE])
                    self.sent += 1
                time.sleep(0.001)
        self.cpu = time.thread_time()

    def then(self, end: Callable[[], object]) -> None:
        """Have `end` called when all is sent and read."""

        def wait() -> None:
            self.join()
            time.sleep(AFTER)
            end()

        threading.Thread(target=wait, daemon=True).start()


def monitor(sender: Sender) -> int:
    """Run our monitor on the terminal and return how many frames it counted."""
    from eurobot_od.cli import monitor as command
    from eurobot_od.cli.sources import BusSource
    from eurobot_od.logs.meaning import Decoder
    from eurobot_od.view.controls import Controls
    from eurobot_od.view.traffic import Traffic

    source = BusSource(can.Bus(interface="virtual", channel=CHANNEL))
    watch = command.Watch(Traffic(Decoder(dialects.load_all()), 1_000_000), Controls("identifier", ""), source)
    sender.start()
    sender.then(lambda: watch.controls.key("q"))
    with command.on_screen(watch) as (took, refresh):
        watch.run(took, refresh)
    source.close()
    return sum(row.count for row in watch.traffic.rows.values())


def viewer(sender: Sender) -> int:
    """Run python-can's viewer on the terminal; how many frames it lost it does not say."""
    import curses

    from can.viewer import CanViewer

    with can.Bus(interface="virtual", channel=CHANNEL) as bus:
        sender.start()
        sender.then(lambda: curses.ungetch(ESCAPE))
        curses.wrapper(lambda screen: CanViewer(screen, bus, {}))  # type: ignore[no-untyped-call]
    return sender.sent


def notifier(sender: Sender) -> int:
    """Let python-can's notifier count the frames."""
    came: list[None] = []
    with can.Bus(interface="virtual", channel=CHANNEL) as bus, can.Notifier(bus, [lambda _: came.append(None)]):
        sender.start()
        sender.join()
        time.sleep(AFTER)
    return len(came)


READERS: dict[str, Callable[[Sender], int]] = {"monitor": monitor, "python-can viewer": viewer, "notifier": notifier}


def measure(reader: str, seconds: float) -> dict[str, float]:
    """Run a reader here and return what it took."""
    sender = Sender(seconds)
    begin = time.process_time()
    counted = READERS[reader](sender)
    share = (time.process_time() - begin - sender.cpu) / seconds
    return {"share": share, "sent": sender.sent, "counted": counted}


def on_terminal(reader: str, seconds: float) -> dict[str, float]:
    """Run a reader in a process on a terminal of its own."""
    control, terminal = pty.openpty()
    result, report = os.pipe()
    options = {"--reader": reader, "--seconds": str(seconds), "--report": str(report)}
    command = [sys.executable, str(Path(__file__)), *(word for option in options.items() for word in option)]
    environment = os.environ | {"TERM": "xterm-256color", "LINES": "50", "COLUMNS": "160"}
    with subprocess.Popen(command, stdin=terminal, stdout=terminal, pass_fds=[report], env=environment):
        os.close(terminal)
        os.close(report)
        threading.Thread(target=_swallow, args=[control], daemon=True).start()
        with os.fdopen(result) as answer:
            measured: dict[str, float] = json.loads(answer.read())
    return measured


def _swallow(control: int) -> None:
    """Read what a program writes to its terminal, so that it can go on."""
    try:
        while os.read(control, 65536):
            pass
    except OSError:  # the program has ended
        return


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for each reader; 1 if the monitor lost a frame."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=5.0, help="how long each reader watches (default: 5)")
    parser.add_argument("--reader", choices=READERS, help=argparse.SUPPRESS)
    parser.add_argument("--report", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.reader:
        os.write(options.report, json.dumps(measure(options.reader, options.seconds)).encode())
        return 0
    lost = 0.0
    for reader in READERS:
        told = on_terminal(reader, options.seconds)
        missing, rate = told["sent"] - told["counted"], told["sent"] / options.seconds
        lost += missing
        print(f"{reader:<18} {told['share']:6.1%} of a CPU at {rate:.0f} frames/s, {missing:.0f} lost")
    return int(bool(lost))


if __name__ == "__main__":
    sys.exit(main())
