"""What the tests of the page look at: nodes on an in-process bus, and the server in a thread of its own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from types import MappingProxyType

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.client.master import ANSWER_WAIT
from eurobot_od.traffic.meaning import Decoder
from eurobot_od.web.access import AccessRules
from eurobot_od.web.desk import NO_EQUIPMENT, Desk, Equipment
from eurobot_od.web.editor import EditableFile, FileEditor
from eurobot_od.web.page import Panel, stop_message
from eurobot_od.web.requests import Requests
from eurobot_od.web.server import Post, served
from eurobot_od.web.session import Session
from tests.kit import plant

LONG = 60.0
"""Longest time for which a test waits, in s."""

NUMBERS = count(1)

LOCAL = AccessRules()


def channel() -> str:
    """Return the name of an in-process bus that nobody else is on."""
    return f"page {next(NUMBERS)}"


@dataclass
class Served:
    """A page that is served: its address, and the session behind it, None for a log."""

    address: str
    session: Session | None


@contextmanager
def serving(
    text: Callable[[], str],
    access: AccessRules = LOCAL,
    requests: Requests | None = None,
    port: int = 0,
    editor: FileEditor | None = None,
    posts: Mapping[str, Post] = MappingProxyType({}),
) -> Iterator[str]:
    """Serve a page in a thread; gives its address."""
    loop, stop, ready = asyncio.new_event_loop(), asyncio.Event(), threading.Event()
    addresses: list[str] = []

    async def run() -> None:
        every = {**posts, **({"/files": editor.post} if editor else {})}
        async with served(text, access, port, requests, every) as address:
            addresses.append(address)
            ready.set()
            await stop.wait()

    thread = threading.Thread(target=lambda: loop.run_until_complete(run()), daemon=True)
    thread.start()
    assert ready.wait(LONG)
    try:
        yield addresses[0]
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join(LONG)
        loop.close()


@contextmanager
def live_page(
    channel: str,
    folder: Path,
    control: bool = True,
    access: AccessRules = LOCAL,
    network: Decoder | None = None,
    panels: tuple[type[Panel], ...] = (),
    port: int = 0,
    equipment: Equipment = NO_EQUIPMENT,
    answer_wait: float = ANSWER_WAIT,
) -> Iterator[Served]:
    """Serve the page of an in-process bus, whose masters wait so many seconds for an answer."""
    known = network or plant.decoder()
    session = Session(partial(open_bus, "virtual", channel), known, 500_000, lambda _: panels)
    try:
        desk = Desk(session, folder, control, stop_message(panels), equipment=equipment)
        for each in (desk.master, desk.polling, desk.orders):
            each.answer_wait = answer_wait
        requests = Requests(desk)
        editor = FileEditor(
            lambda: [EditableFile(each.file, "network") for each in session.decoder.dictionaries], control
        )
        with serving(partial(session.page, channel, editor=True), access, requests, port, editor) as address:
            yield Served(address, session)
    finally:
        session.close()


@contextmanager
def line(channel: str) -> Iterator[None]:
    """Run the three nodes of the packaging line on a bus."""
    with ExitStack() as stack:
        for dictionary in plant.load_all():
            stack.enter_context(Live.node(open_bus("virtual", channel), plant.NODES[dictionary.name](dictionary)))
        yield
