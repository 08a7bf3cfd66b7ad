"""Watch a bus, or logs at any speed, as a live table of messages; without a terminal or rich, as plain lines.

The loop here is the only one: it polls the source, draws, and waits for a key, all in the main thread.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from importlib.util import find_spec
from math import inf
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from eurobot_od.cli import complain, options
from eurobot_od.cli.keyboard import keys
from eurobot_od.cli.logs import ReadOptions, add_reading, entries
from eurobot_od.errors import LocalError
from eurobot_od.support import extras
from eurobot_od.support.terminal import redraws

if TYPE_CHECKING:
    from eurobot_od.traffic.meaning import Meaning
    from eurobot_od.traffic.monitor.sources import BusSource, LogSource
    from eurobot_od.traffic.monitor.traffic import Controls, Traffic

    Source: TypeAlias = BusSource | LogSource
    Took: TypeAlias = Callable[[float, Meaning], None]
    Refresh: TypeAlias = Callable[[], None]

REFRESH = 0.2
"""Seconds between two refreshes of the screen."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    from eurobot_od.traffic.monitor.traffic import SORTS

    parser.add_argument("logs", nargs="*", metavar="LOG", help="logs to play (default: watch a bus)")
    add_reading(parser)
    parser.add_argument(
        "--speed",
        type=lambda text: inf if text == "max" else options.positive(text, " nor max"),
        default=1.0,
        help="how many times faster to play a log, or max",
    )
    parser.add_argument(
        "--filter",
        default="",
        metavar="TEXT",
        help="show only messages with this in their name, or their protocol's or a node's",
    )
    parser.add_argument("--sort", choices=SORTS, default="identifier", help="order of the table")
    parser.add_argument("--plain", action="store_true", help="print lines as decode does, and the table at the end")
    parser.add_argument(
        "--statistics", action="store_true", help="also print load, gaps, response times and bounds at the end"
    )
    parser.add_argument("--ask", action="store_true", help="read the devices' present PDO parameters by SDO")
    options.add_network(parser)
    options.add_emcy(parser)
    options.add_bus(parser)
    options.add_reconnect(parser)


def run(arguments: argparse.Namespace) -> None:
    """Watch until the logs or the user end it; print the table once more."""
    from eurobot_od.bus import live as runtime
    from eurobot_od.traffic.load.seen import NOTHING, table
    from eurobot_od.traffic.monitor.sources import BusSource, LogSource
    from eurobot_od.traffic.monitor.traffic import Controls, Traffic, plain_table, selected

    if arguments.ask and arguments.logs:
        raise LocalError("--ask is for a bus: a log has no devices to ask")
    devices, open_bus = options.Devices.of(arguments), options.opener(arguments)
    decoder = devices.asking_decoder(open_bus) if arguments.ask else devices.decoder()
    promised = devices.promised(decoder) if arguments.statistics else NOTHING
    traffic = Traffic(decoder, arguments.bitrate or runtime.BITRATE, promised)
    controls = Controls(arguments.sort, arguments.filter)
    rich = redraws(sys.stdout) and not arguments.plain
    if rich and find_spec("rich") is None:
        rich = False
        complain(f"plain lines: {extras.missing('rich', 'monitor')}")
    with ExitStack() as stack:
        source: Source
        if arguments.logs:
            read = entries(arguments.logs, ReadOptions.of(arguments), is_watched=False)
            source = LogSource(read, arguments.speed)
        else:
            source = BusSource(open_bus(), opener=options.reopener(arguments))
        stack.enter_context(closing(source))
        monitor = Monitor(traffic, controls, source)
        took, refresh = stack.enter_context((on_screen if rich else _lines)(monitor))
        with suppress(KeyboardInterrupt):  # the usual way to end it
            monitor.run(took, refresh)
    rows = selected(traffic.rows.values(), controls.sort, controls.part)
    print("\n".join(plain_table(rows, source.now)))
    if arguments.statistics:
        print("\n".join(table(traffic.seen)))
    sys.stderr.writelines(f"{line}\n" for line in (*traffic.damage.report(), *source.notes))


class Monitor(NamedTuple):
    """One session: where frames come from, what is counted of them, and what the user has set."""

    traffic: Traffic
    controls: Controls
    source: Source

    def run(self, took: Took, refresh: Refresh) -> None:
        """Take in frames and refresh what is shown until the source or the user ends it.

        While it is paused, frames are still taken in, but only a key changes what is shown.
        """
        pressed = ""
        with keys() as wait:
            while self.controls.running and not self.source.ended:
                for time, raw in self.source.poll():
                    took(time, self.traffic.take(time, raw, self.source.place))
                # A key may be the one that ends the pause, or that scrolls in it.
                if pressed or not self.controls.paused:
                    refresh()
                pressed = wait(self.source.pause(REFRESH))
                for key in pressed:
                    self.controls.key(key)
                if self.controls.clear:
                    self.controls.clear = False
                    self.traffic.clear()


# What is shown


@contextmanager
def _lines(monitor: Monitor) -> Iterator[tuple[Took, Refresh]]:
    """Print each frame as a line."""
    from eurobot_od.traffic.monitor.traffic import named
    from eurobot_od.traffic.output import TextOutput

    output = TextOutput()
    write = output.writer("")

    def took(time: float, meaning: Meaning) -> None:
        if not monitor.controls.paused and named(meaning, monitor.controls.part):
            sys.stdout.write(write(0, time, "", output.row(meaning)))

    printed = 0

    def refresh() -> None:
        nonlocal printed
        for note in monitor.source.notes[printed:]:
            print(f"# {note}")
            printed += 1
        sys.stdout.flush()

    yield took, refresh


@contextmanager
def on_screen(monitor: Monitor) -> Iterator[tuple[Took, Refresh]]:
    """Show the table on the whole screen."""
    from rich.live import Live

    from eurobot_od.traffic.monitor.screen import Size, screen

    with Live(screen=True, auto_refresh=False) as live:  # without its thread: the loop above refreshes

        def refresh() -> None:
            now, size = monitor.source.now, Size(*shutil.get_terminal_size())
            load, notes = monitor.traffic.load(now), monitor.source.notes
            live.update(screen(monitor.traffic, monitor.controls, now, load, size, notes), refresh=True)

        yield lambda *_: None, refresh
