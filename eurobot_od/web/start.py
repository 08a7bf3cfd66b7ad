"""The page that begins with nothing: the adapters of this machine, a simulated bus, a log; one choice ends it.

Whoever serves it carries the choice out, and serves the page of a bus or a log at the same address.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from eurobot_od.bus import live
from eurobot_od.bus.live.adapters import BIT_RATES, check_silent, frames_at
from eurobot_od.errors import LocalError, look_up
from eurobot_od.library.library import Library, LibraryEntry
from eurobot_od.od.values import NODE_IDS
from eurobot_od.support.files import write_whole
from eurobot_od.web import page
from eurobot_od.web.asking import Arguments, answered, text_of, whole_of
from eurobot_od.web.views import files

LOGS = (".log", ".asc", ".blf", ".trc", ".csv", ".pcap", ".pcapng", ".txt", ".mf4", ".db")
"""Suffixes of files that are offered as logs."""

MOST_DEVICES = 32


class BusChoice(NamedTuple):
    """A bus of an adapter; `bit_rate` in bit/s, None for what is configured."""

    interface: str
    channel: str
    bit_rate: int | None


class SimulatedChoice(NamedTuple):
    """A simulated bus with devices: their files with node-IDs."""

    devices: Sequence[tuple[Path, int]]


class LogChoice(NamedTuple):
    """A log."""

    file: Path


class FilesChoice(NamedTuple):
    """The view of files, which needs no bus."""


Choice = BusChoice | SimulatedChoice | LogChoice | FilesChoice


class StartPage:
    """The page and its requests; `library` has the devices, `folder` what is kept.

    `try_bus` opens a bus and lets go of it; raises BusError. `try_log` reads the beginning of a log; raises LocalError.
    `last` is the bus of the last time, which is offered.
    Only if it `may_act` is anything done for a browser.
    """

    def __init__(
        self,
        library: Library,
        folder: Path,
        may_act: bool,
        try_bus: Callable[[BusChoice], None],
        try_log: Callable[[Path], None],
        last: BusChoice | None = None,
    ) -> None:
        self.library = library
        self.folder = folder
        self._may_act = may_act
        self._try_bus = try_bus
        self._try_log = try_log
        self._last = last
        self.uploads: dict[object, dict[str, bytearray]] = defaultdict(dict)
        self.choice: Choice | None = None
        self.chosen = asyncio.Event()

    def page(self) -> str:
        """Return the page."""
        known: dict[str, Any] = {"folder": str(self.folder.resolve()), "rates": BIT_RATES, "act": self._may_act}
        if self._last is not None:
            known["last"] = self._last._asdict()
        return page.page("CANopen", [], scripts=page.START_SCRIPTS, start=known)

    async def answer(self, text: str) -> str:
        """Answer a request, both as JSON."""
        try:
            return await asyncio.to_thread(answered, text, self._do)
        finally:
            if self.choice is not None:
                self.chosen.set()

    def _do(self, said: Arguments) -> Any:
        if not self._may_act:
            raise LocalError("this page is read-only: start the server with --control")
        return look_up("request", str(said.get("do"))[:40], REQUESTS)(self, {**said, "who": None})


# What is here


def adapters(_: StartPage, __: Arguments) -> list[dict[str, Any]]:
    """List the adapters that python-can finds, and whether their drivers can listen silently."""
    return [{"interface": each.interface, "channel": each.channel, "is": each.is_} for each in live.here()]


def devices(start: StartPage, _: Arguments) -> list[dict[str, str]]:
    """List the devices of the library."""
    entries = (each for each in start.library.entries if not each.problem)
    return [{"file": str(each.path), "name": _title(each)} for each in entries]


def _title(entry: LibraryEntry) -> str:
    return " ".join(filter(None, (entry.vendor_name, entry.product_name))) or entry.path.stem


def logs(start: StartPage, _: Arguments) -> list[str]:
    """List the logs that lie in the folder, newest first."""
    found = [each for each in start.folder.iterdir() if each.suffix.lower() in LOGS and each.is_file()]
    return [each.name for each in sorted(found, key=lambda each: each.stat().st_mtime, reverse=True)]


# What is chosen


def listen(_: StartPage, said: Arguments) -> int:
    """Listen at a bit rate without sending; returns how many frames came."""
    interface = text_of(said, "interface")
    check_silent(interface)
    return frames_at(interface, text_of(said, "channel"), whole_of(said, "bit_rate"))


def connect(start: StartPage, said: Arguments) -> None:
    """Choose a bus; raises BusError if it cannot be opened."""
    rate = said.get("bit_rate")
    choice = BusChoice(text_of(said, "interface"), text_of(said, "channel"), rate if isinstance(rate, int) else None)
    start._try_bus(choice)
    start.choice = choice


def simulate(start: StartPage, said: Arguments) -> None:
    """Choose a simulated bus with devices of the library, numbered from 1 on unless said otherwise."""
    wanted = said.get("devices")
    known = {str(each.path): each for each in start.library.entries}
    if not isinstance(wanted, list) or not 1 <= len(wanted) <= MOST_DEVICES:
        raise LocalError(f"choose 1 to {MOST_DEVICES} devices")
    chosen: dict[int, Path] = {}
    for each in wanted:
        if not isinstance(each, dict) or (node_id := whole_of(each, "node_id")) not in NODE_IDS:
            raise LocalError("each device has a file and a node-ID 1..127")
        if node_id in chosen:
            raise LocalError(f"two devices have the node-ID {node_id}")
        chosen[node_id] = look_up("device", text_of(each, "file"), known).path
    start.choice = SimulatedChoice([(path, node_id) for node_id, path in chosen.items()])


def open_log(start: StartPage, said: Arguments) -> None:
    """Choose a log: one that was sent, or one of the folder; raises LocalError if it is none."""
    if "file" in said:
        name, content = files.sent_file(start, said)
        file = start.folder / name
        is_new = not file.exists()
        if not is_new and file.read_bytes() != content:
            raise LocalError(f"{name} is in the folder already, with another content: rename one of them")
        write_whole(file, content)
    else:
        name = look_up("log", text_of(said, "log"), dict.fromkeys(logs(start, said), text_of(said, "log")))
        file, is_new = start.folder / name, False
    try:
        start._try_log(file)
    except LocalError:
        if is_new:
            file.unlink()
        raise
    start.choice = LogChoice(file)


def edit(start: StartPage, _: Arguments) -> None:
    """Choose the view of files."""
    start.choice = FilesChoice()


REQUESTS: Mapping[str, Callable[[StartPage, Arguments], Any]] = {
    "adapters": adapters,
    "devices": devices,
    "logs": logs,
    "listen": listen,
    "connect": connect,
    "simulate": simulate,
    "open": open_log,
    "edit": edit,
    "file": files.upload,
    "add to library": files.add_to_library,
}
