"""Show the bus in a browser, or logs: messages, plots, nodes, object dictionaries, events.

Rule of this file: a page is for this machine only, and changes nothing on the bus, unless options allow more.
"""

from __future__ import annotations

import asyncio
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

from eurobot_od.bus.live import BITRATE
from eurobot_od.cli import complain
from eurobot_od.cli.decode import Log, Reading, decoder_for, entries
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BusOptions, FrameNames, whole
from eurobot_od.cli.signature import Option
from eurobot_od.client.lifeline import OWN_ID
from eurobot_od.errors import EurobotError, LocalError
from eurobot_od.support import extras
from eurobot_od.support.connections import Address
from eurobot_od.support.connections import parse as parse_address
from eurobot_od.traffic.compare import ComparedEntry, Tolerances, compare
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.meaning import DamageCounts, Decoder
from eurobot_od.web.access import AccessRules
from eurobot_od.web.page import Columns, Panel, page, stop_message

if TYPE_CHECKING:  # with aiohttp, which an extra brings
    from eurobot_od.web.requests import Requests
    from eurobot_od.web.session import Session

HERE = Address("127.0.0.1", 8014)
"""Where the page is, unless another address is asked for."""

ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""What ends a server beside Ctrl-C; a terminal that is closed sends SIGHUP."""

MOST_LOGS = 2

MOST_DIFFERENCES = 5000
"""Most differences of two logs that a page lists."""


def serve(
    logs: Sequence[Log] = (),
    *,
    reading: Reading,
    control: bool = False,
    listen: Annotated[Address, Option(metavar="HOST:PORT", read=parse_address)] = HERE,
    own_id: Annotated[int, Option(metavar="N", read=whole(1, 127, what="a node-ID"))] = OWN_ID,
    devices: Devices,
    names: FrameNames,
    bus: BusOptions,
) -> None:
    """Show the bus in a browser, or logs: messages, plots, nodes, object dictionaries, events.

    It goes on until Ctrl-C; drives that turn by the page's order are halted first.

    logs: one log, or two side by side (default: the bus)
    control: let the page send, write objects and command nodes
    own_id: node-ID of the heartbeat that drives watch (127, or the next lower one that is not heard)
    listen: address of the page (default: 127.0.0.1:8014); from other machines it takes a token, printed once

    $ serve run.log --eds 5=motor.eds
    $ serve --control --eds 5=motor.eds -i socketcan -c can0
    """
    with extras.needed("web"):  # asked here, so that no log is read before the package is found missing
        import aiohttp  # noqa: F401
    if len(logs) > MOST_LOGS:
        raise LocalError(f"a page shows one log, or two side by side, not {len(logs)}")
    if logs and control:
        raise LocalError("--control is for a bus: a log cannot be changed")
    if control:  # a page that may send may ask, too
        devices = devices.found_on(bus)
    decoder = decoder_for(logs, reading, devices, names)
    bitrate = bus.bitrate or BITRATE
    diagnosis = partial(Diagnosis, decoder, devices.watchers, bitrate, devices.promised(decoder))
    with suppress(KeyboardInterrupt):  # the usual way to end it
        if logs:
            panels = devices.panels(decoder)
            titles, kept = told_apart(logs), [list[ComparedEntry]() for _ in logs]
            sources = [
                _source(log, reading, Columns(name, decoder, bitrate, panels), diagnosis(), panels, own)
                for log, name, own in zip(logs, titles, kept)
            ]
            text = page(" and ".join(titles), sources, panels, **_compared(kept, decoder))
            asyncio.run(_serve(lambda: text, listen))
        else:
            from eurobot_od.web.session import Session

            session = Session(bus.open, decoder, bitrate, devices.panels, diagnosis=diagnosis())
            asyncio.run(_show_bus(session, bus_name(bus.interface, bus.channel), control, listen, own_id))


async def _serve(text: Callable[[], str], listen: Address, requests: Requests | None = None) -> None:
    """Serve a page until a signal of `ENDING`; Ctrl-C, which a program in the background may ignore, cancels it."""
    from eurobot_od.web.server import served  # with aiohttp

    ended = asyncio.Event()
    for number in ENDING:  # before a page may order anything
        with suppress(NotImplementedError):  # on Windows
            asyncio.get_running_loop().add_signal_handler(number, ended.set)
    async with served(text, AccessRules.at(listen.host), listen.port, requests) as address:
        print(f"{address}  (Ctrl-C ends it)", flush=True)
        await ended.wait()


# Logs


def told_apart(logs: Sequence[str]) -> list[str]:
    """Return what a page calls some logs: by their files' names, or the shortest ends of their paths that differ."""
    parts = [Path(each).parts for each in logs]
    for length in range(1, max(map(len, parts)) + 1):
        names = [str(Path(*each[-length:])) for each in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{each[-1]} ({number})" for number, each in enumerate(parts, 1)]


def _compared(logs: Sequence[Sequence[ComparedEntry]], decoder: Decoder) -> dict[str, Any]:
    """Return how the second log differs from the first as `compare` says it; nothing for one log."""
    if len(logs) < MOST_LOGS:
        return {}
    first, second = logs
    found = compare(first, second, decoder, Tolerances())
    kept = [each._asdict() | {"kind": each.kind.value} for each in found[:MOST_DIFFERENCES]]
    return {"comparison": {"count": len(found), "differences": kept}}


def _source(
    log: str,
    reading: Reading,
    columns: Columns,
    diagnosis: Diagnosis,
    panels: Sequence[type[Panel]],
    kept: list[ComparedEntry],
) -> dict[str, Any]:
    """Read a log as a source of the page, with what is kept beside it; its entries are `kept` to be compared."""
    damage = DamageCounts()
    diagnosis.begin(columns.name)
    # No bar: it would share the terminal with the address and with what is wrong in the log.
    for _, (line, time, channel, raw) in entries([log], reading, is_watched=False):
        meaning = diagnosis.take(time, channel, raw, line)
        damage.add(log, line, meaning.defects)
        columns.take(time, meaning)
        kept.append(ComparedEntry(time, raw))
    diagnosis.end()
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    if columns.left_out:
        complain(f"{log}: {columns.left_out} frames are left out: a page cannot hold them all")
    rows: list[dict[str, Any]] = []
    for panel in panels:
        try:
            beside = panel.beside(Path(log))
        except EurobotError as error:
            complain(str(error))
        else:
            columns.add(beside.events)
            rows += beside.rows
    return columns.data(rows) | {"diagnosis": diagnosis.as_data(0.0)}


# The bus


def bus_name(interface: str | None, channel: str | None) -> str:
    """Return what a page calls a bus: `Bus can0 (socketcan)`, and one on the network by where it is."""
    place = urlsplit(channel or "").netloc
    if place:
        return f"Bus at {place.rpartition('@')[2]}"
    return f"Bus {channel or ''}".strip() + (f" ({interface})" if interface else "")


async def _show_bus(session: Session, name: str, control: bool, listen: Address, own_id: int) -> None:
    from eurobot_od.web.requests import Requests  # with aiohttp

    try:
        # What the page records lies there, and is gone with the page.
        with tempfile.TemporaryDirectory(prefix="eurobot-od-") as folder:
            stop = stop_message(list(map(type, session.panels)))
            requests = Requests(session, Path(folder), control, stop, own_id)
            await _serve(partial(session.page, name), listen, requests)
    finally:
        session.close()
