"""Show the bus in a browser, or logs: messages, plots, nodes, object dictionaries, events.

Rule of this file: a page is for this machine only, and changes nothing on the bus, unless options allow more.
"""

from __future__ import annotations

import argparse
import asyncio
import secrets
import signal
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from eurobot_od.cli import complain, options
from eurobot_od.cli.logs import ReadOptions, add_reading, meanings
from eurobot_od.errors import EurobotError, LocalError
from eurobot_od.support import extras

if TYPE_CHECKING:
    from eurobot_od.support.connections import Address
    from eurobot_od.traffic.meaning import Decoder
    from eurobot_od.web.panel import Panel
    from eurobot_od.web.requests import Requests
    from eurobot_od.web.session import Session

PORT = 8014
"""Where the page is, unless another port is asked for."""

MOST_LOGS = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("logs", nargs="*", metavar="LOG", help="one log, or two side by side (default: the bus)")
    add_reading(parser)
    parser.add_argument("--control", action="store_true", help="let the page send, write objects and command nodes")
    parser.add_argument(
        "--listen",
        type=options.address,
        default=f"127.0.0.1:{PORT}",
        metavar="HOST:PORT",
        help="address of the page (default: 127.0.0.1:8014); from other machines it takes a token, printed once",
    )
    options.add_network(parser)
    options.add_emcy(parser)
    options.add_bus(parser)


def run(arguments: argparse.Namespace) -> None:
    """Serve until Ctrl-C."""
    with extras.needed("web"):  # asked here, so that no log is read before the package is found missing
        import aiohttp  # noqa: F401
    from eurobot_od.bus.live import BITRATE

    logs: list[str] = arguments.logs
    if len(logs) > MOST_LOGS:
        raise LocalError(f"a page shows one log, or two side by side, not {len(logs)}")
    if logs and arguments.control:
        raise LocalError("--control is for a bus: a log cannot be changed")
    devices, bitrate = options.Devices.of(arguments), arguments.bitrate or BITRATE
    decoder = devices.decoder()
    panels = [each.of(decoder.protocol) for each in devices.robot.panels() if each.fits(decoder.protocol)]
    with suppress(KeyboardInterrupt):  # the usual way to end it
        if logs:
            from eurobot_od.web.page import page

            sources = [_source(log, ReadOptions.of(arguments), decoder, bitrate, panels) for log in logs]
            text = page(" and ".join(each["name"] for each in sources), sources, panels)
            asyncio.run(_serve(text, arguments.listen))
        else:
            from eurobot_od.web.session import Session

            session = Session(options.opener(arguments), decoder, bitrate, panels)
            name = bus_name(arguments.interface, arguments.channel)
            asyncio.run(_show_bus(session, panels, name, arguments.control, arguments.listen))


async def _serve(text: str, listen: Address, requests: Requests | None = None) -> None:
    """Serve a page until SIGTERM; Ctrl-C, which a shell may have a program in the background ignore, cancels it."""
    from eurobot_od.web.access import AccessRules, is_local
    from eurobot_od.web.server import served

    ended = asyncio.Event()
    # Whoever can reach this machine's loopback address could run the command as well; others need the token.
    access = AccessRules(listen.host, "" if is_local(listen.host) else secrets.token_urlsafe(24))
    async with served(text, access, listen.port, requests) as address:
        with suppress(NotImplementedError):  # on Windows, which has no SIGTERM
            asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
        print(f"{address}  (Ctrl-C ends it)", flush=True)
        await ended.wait()


# Logs


def _source(
    log: str, reading: ReadOptions, decoder: Decoder, bitrate: int, panels: Sequence[type[Panel]]
) -> dict[str, Any]:
    """Read a log as a source of the page, with what is kept beside it."""
    from eurobot_od.traffic.meaning import DamageCounts
    from eurobot_od.web.page import Columns

    # No bar: it would share the terminal with the address and with what is wrong in the log.
    columns, damage = Columns(Path(log).name, decoder, bitrate, panels), DamageCounts()
    for time, meaning in meanings([log], reading, decoder, damage, is_watched=False):
        columns.take(time, meaning)
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
    return columns.data(rows)


# The bus


def bus_name(interface: str | None, channel: str | None) -> str:
    """Return what a page calls a bus: `Bus can0 (socketcan)`, and one on the network by where it is."""
    place = urlsplit(channel or "").netloc
    if place:
        return f"Bus at {place.rpartition('@')[2]}"
    return f"Bus {channel or ''}".strip() + (f" ({interface})" if interface else "")


async def _show_bus(session: Session, panels: Sequence[type[Panel]], name: str, control: bool, listen: Address) -> None:
    from eurobot_od.web.page import described, page, stop_message
    from eurobot_od.web.requests import Requests

    about = {"name": name, "bitrate": session.bitrate, **described(session.decoder)}
    text = page(name, [about], panels, live=True)
    try:
        # What the page records lies there, and is gone with the page.
        with tempfile.TemporaryDirectory(prefix="eurobot-od-") as folder:
            await _serve(text, listen, Requests(session, Path(folder), control, stop_message(panels)))
    finally:
        session.close()
