"""Show the bus in a browser, or logs: messages, plots, nodes, object dictionaries, events.

Rule of this file: a page is for this machine only, and changes nothing on the bus, unless it was asked for otherwise.
"""

from __future__ import annotations

import argparse
import asyncio
import secrets
import signal
import sys
import tempfile
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import options
from eurobot_od.cli.logs import add_reading, entries
from eurobot_od.errors import LocalError
from eurobot_od.support import extras

if TYPE_CHECKING:
    from eurobot_od.logs.meaning import Decoder
    from eurobot_od.web.access import AccessRules
    from eurobot_od.web.columns import Columns
    from eurobot_od.web.panel import Panel

PORT = 8014
"""Where the page is, unless another port is asked for."""

MOST_LOGS = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("logs", nargs="*", metavar="LOG", help="one log, or two side by side; left out: the bus")
    add_reading(parser)
    parser.add_argument("--control", action="store_true", help="let the page send, write objects and command nodes")
    parser.add_argument(
        "--listen",
        type=options.address,
        default=f"127.0.0.1:{PORT}",
        metavar="HOST:PORT",
        help="where browsers find it (default: 127.0.0.1:8014); any but this machine takes a token, printed once",
    )
    options.add_network(parser)
    options.add_bus(parser)


def run(arguments: argparse.Namespace) -> None:
    """Serve until Ctrl-C."""
    with extras.needed("web"):
        import aiohttp  # noqa: F401
    if len(arguments.logs) > MOST_LOGS:
        raise LocalError(f"{len(arguments.logs)} logs do not go side by side: name one or two")
    if arguments.logs and arguments.control:
        raise LocalError("--control is for a bus: in a log there is nothing to be changed")
    decoder = options.decoder(arguments)
    show = _show_logs if arguments.logs else _show_bus
    with suppress(KeyboardInterrupt):  # the usual way to end it
        panels = [
            each.of(decoder.protocol) for each in options.robot(arguments).panels() if each.fits(decoder.protocol)
        ]
        asyncio.run(show(arguments, decoder, panels))


def _access(arguments: argparse.Namespace) -> AccessRules:
    from eurobot_od.web.access import AccessRules, is_local

    host = arguments.listen.host
    return AccessRules(host, "" if is_local(host) else secrets.token_urlsafe(24))


async def _forever(address: str) -> None:
    """Wait for SIGTERM; Ctrl-C, which a shell may have a program in the background ignore, cancels it."""
    told = asyncio.Event()
    with suppress(NotImplementedError):  # on Windows, which has no SIGTERM
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, told.set)
    print(f"{address}  (Ctrl-C ends it)", flush=True)
    await told.wait()


# Logs


async def _show_logs(arguments: argparse.Namespace, decoder: Decoder, panels: list[type[Panel]]) -> None:
    from eurobot_od.web.page import page
    from eurobot_od.web.server import served

    columns = [_columns(log, arguments, decoder, panels) for log in arguments.logs]
    title = " and ".join(each.name for each in columns)
    text = page(title, [each.data() for each in columns], panels)
    async with served(text, _access(arguments), arguments.listen.port) as address:
        await _forever(address)


def _columns(log: str, arguments: argparse.Namespace, decoder: Decoder, panels: list[type[Panel]]) -> Columns:
    from eurobot_od.live import BITRATE
    from eurobot_od.logs.entries import REMEMBERED
    from eurobot_od.logs.statistics import DamageCounts
    from eurobot_od.web.columns import Columns

    columns, damage = Columns(Path(log).stem, decoder, arguments.bitrate or BITRATE, panels), DamageCounts()
    decode = lru_cache(REMEMBERED)(decoder)
    for name, (line, time, _, raw) in entries([log], arguments, is_watched=False):
        meaning = decode(raw)
        damage.add(name, line, meaning.defects)
        columns.take(time, meaning)
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    if columns.left_out:
        print(f"eurobot-od: {log}: {columns.left_out} frames are too much for a page and left out", file=sys.stderr)
    return columns


# The bus


async def _show_bus(arguments: argparse.Namespace, decoder: Decoder, panels: list[type[Panel]]) -> None:
    from eurobot_od.live import BITRATE
    from eurobot_od.web.content import described, stop_message
    from eurobot_od.web.page import page
    from eurobot_od.web.requests import Requests
    from eurobot_od.web.server import served
    from eurobot_od.web.session import Session

    bitrate = arguments.bitrate or BITRATE
    session = Session(partial(options.open_bus, arguments), decoder, bitrate, panels)
    name = f"{arguments.interface or 'bus'} {arguments.channel or ''}".strip()
    text = page(name, [{"name": name, "bitrate": bitrate, **described(decoder)}], panels, live=True)
    try:
        with tempfile.TemporaryDirectory(prefix="eurobot-od-") as folder:
            requests = Requests(session, Path(folder), arguments.control, stop_message(panels))
            async with served(text, _access(arguments), arguments.listen.port, requests) as address:
                await _forever(address)
    finally:
        session.close()
