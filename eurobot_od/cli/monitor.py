"""`monitor` shows a bus, or logs at any speed, as a live table of messages; without a terminal or rich, as lines.

One loop in the main thread polls the source, draws, and waits for a key.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, redirect_stderr, suppress
from importlib.util import find_spec
from math import inf
from pathlib import Path
from typing import Annotated, NamedTuple, TypeAlias

from eurobot_od.bus.live import BITRATE
from eurobot_od.cli import complain
from eurobot_od.cli.decode import Log, Reading, check_source, decoder_for, entries
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BusOptions, FrameNames, NoReconnect, Seconds, positive
from eurobot_od.cli.signature import Option
from eurobot_od.frame import Frame
from eurobot_od.support import extras
from eurobot_od.support.progress import redraws
from eurobot_od.traffic.decoding import TextOutput
from eurobot_od.traffic.meaning import Meaning
from eurobot_od.traffic.monitor import SORTS, BusSource, Controls, LogSource, Traffic, named, plain_table, selected
from eurobot_od.traffic.recorder import recording
from eurobot_od.traffic.statistics import NOTHING, tables

Source: TypeAlias = BusSource | LogSource
Took: TypeAlias = Callable[[float, Meaning], None]
Refresh: TypeAlias = Callable[[], None]

REFRESH = 0.2
"""Time between two refreshes of the screen, in s."""


def _speed(text: str) -> float:
    """Parse the speed of a log; raises LocalError."""
    return inf if text == "max" else positive(text, " nor max")


def monitor(
    logs: Sequence[Log] = (),
    *,
    reading: Reading,
    speed: Annotated[float, Option(read=_speed)] = 1.0,
    filter: Annotated[str, Option(metavar="TEXT")] = "",
    sort: Annotated[str, Option(choices=SORTS.keys())] = "identifier",
    plain: bool = False,
    statistics: bool = False,
    ask: bool = False,
    log: Annotated[Path | None, Option(metavar="FILE", is_output=True)] = None,
    duration: Annotated[Seconds, Option("--for")] = inf,
    no_reconnect: NoReconnect = False,
    devices: Devices,
    names: FrameNames,
    bus: BusOptions,
) -> None:
    """Watch or record a bus, or play logs, as a live table of messages; without a terminal or rich, as plain lines.

    It goes on until the logs or the user end it, and prints the table once more.

    logs: logs to play (default: watch a bus)
    speed: how many times faster to play a log, or max
    filter: show only messages with this in their name, or their protocol's or a node's, or an identifier: 705
    sort: order of the table
    plain: print lines as decode does, and the table at the end
    statistics: also print load, gaps, response times and bounds at the end
    ask: read the devices' present PDO parameters by SDO; without files, of all that answer
    log: write all frames there, in the format of its suffix
    duration: how long to watch a bus (default: until Ctrl-C)

    $ monitor run.log --eds 5=motor.eds
    $ monitor --plain --eds 5=motor.eds -i socketcan -c can0
    $ monitor --log bus.log -i socketcan -c can0
    """
    of_a_bus = {"for": duration < inf, "ask": ask, "no-reconnect": no_reconnect}
    check_source(logs, bus, of_a_bus=of_a_bus, of_a_log={"speed": speed != 1, **reading.given})
    decoder = devices.asking_decoder(bus, names) if ask else decoder_for(logs, reading, devices, names)
    traffic = Traffic(decoder, bus.bitrate or BITRATE, devices.promised(decoder) if statistics else NOTHING)
    controls = Controls(sort, filter)
    rich = redraws(sys.stdout) and not plain
    if rich and find_spec("rich") is None:
        rich = False
        complain(f"plain lines: {extras.missing('rich', 'monitor')}")
    with ExitStack() as stack:
        source: Source
        if logs:
            source = LogSource(entries(logs, reading, is_watched=False), speed)
        else:
            source = BusSource(bus.open(), opener=bus.reopener(no_reconnect))
        stack.enter_context(closing(source))
        session = Monitor(traffic, controls, source)
        record = stack.enter_context(recording(log, tell=complain))
        took, refresh = stack.enter_context((on_screen if rich else _lines)(session))
        with suppress(KeyboardInterrupt):  # the usual way to end it
            session.run(took, refresh, record, inf if logs else duration)
    if absent := traffic.presence.note:
        complain(absent)
    rows = selected(traffic.rows.values(), controls.sort, controls.part)
    print("\n".join(plain_table(rows, source.now)))
    if statistics:
        print("\n".join(tables(traffic.buses)))
    sys.stderr.writelines(f"{line}\n" for line in (*traffic.damage.report(), *traffic.following.notes(), *source.notes))


class Monitor(NamedTuple):
    """One session: the source of frames, what is counted, and the user's settings."""

    traffic: Traffic
    controls: Controls
    source: Source

    def run(self, took: Took, refresh: Refresh, record: Callable[[float, Frame], None], duration: float = inf) -> None:
        """Count and record frames, and refresh the display, until the source, the user or `duration` s end it.

        While it is paused, frames are still counted, but only a key changes the display.
        """
        pressed = ""
        end = time.monotonic() + duration
        with keys() as wait:
            while self.controls.running and not self.source.ended and time.monotonic() < end:
                for seen, raw in self.source.poll():
                    if isinstance(raw, Frame):
                        record(seen, raw)
                    took(seen, self.traffic.take(seen, raw, self.source.place, self.source.channel))
                # In a pause, a key may end it or scroll.
                if pressed or not self.controls.paused:
                    refresh()
                pressed = wait(self.source.pause(REFRESH))
                for key in pressed:
                    self.controls.key(key)
                if self.controls.clear:
                    self.controls.clear = False
                    self.traffic.clear()


# Displays


@contextmanager
def _lines(monitor: Monitor) -> Iterator[tuple[Took, Refresh]]:
    """Provide a display that prints each frame as a line, and differences from the files as comments."""
    output = TextOutput()
    write = output.line_writer("")

    def took(time: float, meaning: Meaning) -> None:
        if not monitor.controls.paused and named(meaning, monitor.controls.part):
            sys.stdout.write(write(0, time, "", output.row(meaning)))

    printed = 0
    absent = ""

    def refresh() -> None:
        nonlocal printed, absent
        news = monitor.source.notes[printed:]
        printed += len(news)
        if (now := monitor.traffic.presence.note) != absent:
            absent = now
            news = [*filter(None, [absent]), *news]
        sys.stdout.writelines(f"# {note}\n" for note in news)
        sys.stdout.flush()

    yield took, refresh


@contextmanager
def on_screen(monitor: Monitor) -> Iterator[tuple[Took, Refresh]]:
    """Provide a display of the table on the whole screen; what is complained of meanwhile is a note."""
    from rich.live import Live

    from eurobot_od.traffic.monitor import Size, screen  # here, as it needs rich

    complaints = io.StringIO()
    with (
        _told_later(complaints),
        Live(screen=True, auto_refresh=False, redirect_stderr=False) as live,  # without a thread of its own
        redirect_stderr(complaints),
    ):

        def refresh() -> None:
            now = monitor.source.now
            size = Size(*shutil.get_terminal_size())
            load = monitor.traffic.load(now)
            notes = [*complaints.getvalue().splitlines(), *monitor.source.notes]
            live.update(screen(monitor.traffic, monitor.controls, now, load, size, notes), refresh=True)

        yield lambda *_: None, refresh


@contextmanager
def _told_later(complaints: io.StringIO) -> Iterator[None]:
    try:
        yield
    finally:
        sys.stderr.write(complaints.getvalue())


# Single keys from a terminal

UP, DOWN = "\x10", "\x0e"
"""The keys up and down, as Control-P and Control-N, which no text contains."""

PAGE = 10
"""Number of lines of a page."""

MOVING = {"\x1b[A": UP, "\x1b[B": DOWN, "\x1b[5~": PAGE * UP, "\x1b[6~": PAGE * DOWN}
"""What terminals send for the keys up, down, page up and page down."""

WaitForKey = Callable[[float], str]
"""Waits for a time in s, or until a key is pressed, and returns the keys pressed."""


@contextmanager
def keys() -> Iterator[WaitForKey]:
    """Provide a function that waits for keys."""
    if not sys.stdin.isatty():
        yield _no_keys
    elif os.name == "nt":
        yield _windows_keys
    else:
        with _posix_keys() as wait:
            yield wait


def _no_keys(pause: float) -> str:
    time.sleep(pause)
    return ""


@contextmanager
def _posix_keys() -> Iterator[WaitForKey]:
    import select
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)

    def wait(pause: float) -> str:
        ready, _, _ = select.select([descriptor], [], [], pause)  # also the pause between two refreshes
        # By `os`, as `sys.stdin` would read ahead, which `select` does not see.
        pressed = os.read(descriptor, 64).decode(errors="ignore") if ready else ""
        for sequence, meant in MOVING.items():
            pressed = pressed.replace(sequence, meant)
        return pressed

    try:
        tty.setcbreak(descriptor)  # not raw mode, so that Ctrl-C interrupts
        yield wait
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _windows_keys(pause: float) -> str:
    import msvcrt

    time.sleep(pause)  # on Windows `select` works on sockets only
    pressed = ""
    while msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
        pressed += msvcrt.getwch()  # type: ignore[attr-defined,unused-ignore]
    return pressed
