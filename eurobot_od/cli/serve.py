"""`serve` shows a bus, or logs, in a browser: messages, plots, nodes, object dictionaries, events.

By default, only this machine can open the page, and it changes nothing on the bus.
"""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

from eurobot_od.bus import live
from eurobot_od.bus.live import BITRATE
from eurobot_od.cli import complain, version
from eurobot_od.cli.decode import Log, Reading, check_source, decoder_for, entries
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BusOptions, FrameNames, whole
from eurobot_od.cli.signature import Option
from eurobot_od.client.lifeline import OWN_ID
from eurobot_od.errors import EurobotError, LocalError
from eurobot_od.od import DEFAULT, network
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import read_bytes
from eurobot_od.od.editing import readable
from eurobot_od.od.network import NetworkBus
from eurobot_od.support import extras
from eurobot_od.support.connections import Address
from eurobot_od.support.connections import parse as parse_address
from eurobot_od.support.files import read_whole, write_whole
from eurobot_od.traffic.compare import ComparedEntry, Tolerances, compare
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.formats.index import LogIndex
from eurobot_od.traffic.meaning import DamageCounts, Decoder
from eurobot_od.web.access import AccessRules
from eurobot_od.web.editor import SUFFIXES, EditableFile, FileEditor
from eurobot_od.web.longlog import LONG, LongLog, LongLogs
from eurobot_od.web.page import Columns, Panel, page, stop_message

if TYPE_CHECKING:  # with aiohttp, which an extra brings
    from eurobot_od.web.requests import Requests
    from eurobot_od.web.server import Post
    from eurobot_od.web.start import BusChoice, Choice, SimulatedChoice

HERE = Address("127.0.0.1", 8014)
"""Default address of the page."""

ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals that end a server, besides Ctrl-C; a closed terminal sends SIGHUP."""

MOST_LOGS = 4

COMPARED = 2
"""Logs that are compared: the second against the first."""

MOST_DIFFERENCES = 5000
"""Maximum number of differences of two logs on a page."""


SHORTEST_TOKEN = 16
"""Minimum length of a user's token."""


def _origin(text: str) -> str:
    """Parse an origin; raises LocalError."""
    found = urlsplit(text)
    if found.scheme not in ("http", "https") or not found.hostname or f"{found.scheme}://{found.netloc}" != text:
        raise LocalError(f"{text} is not an origin, such as https://bench.example")
    return text


def _token(file: Path) -> str:
    """Read a token; raises FileError, LocalError."""
    token = read_whole(file).decode("utf-8", "replace").strip()
    if len(token) < SHORTEST_TOKEN or not token.isascii() or not token.replace("-", "").replace("_", "").isalnum():
        raise LocalError(f"{file}: a token has at least {SHORTEST_TOKEN} letters, digits, - and _")
    return token


def serve(
    logs: Sequence[Log] = (),
    *,
    reading: Reading,
    control: bool = False,
    listen: Annotated[Address, Option(metavar="HOST:PORT", read=parse_address)] = HERE,
    origin: Annotated[str, Option(metavar="URL", read=_origin)] = "",
    token_file: Annotated[Path | None, Option(metavar="FILE")] = None,
    own_id: Annotated[int, Option(metavar="N", read=whole(1, 127, what="a node-ID"))] = OWN_ID,
    devices: Devices,
    names: FrameNames,
    bus: BusOptions,
) -> None:
    """Show the bus in a browser, or logs: messages, plots, nodes, object dictionaries, settings, checks, events.

    Without a log or a bus the page begins with what is here: adapters, a simulated bus, logs. It goes on until Ctrl-C;
    drives that turn by the page's order are halted first.

    logs: up to four logs side by side, or a folder: the workspace of what is recorded and reported (default: the bus);
        EDS and DCF files to be edited, which need no bus
    control: let the page send, write objects, command nodes and save files
    own_id: node-ID of the heartbeat that drives watch (127, or the next lower one that is not heard)
    listen: address of the page (default: 127.0.0.1:8014); from other machines it takes a token, printed once
    origin: what browsers call it behind a proxy, such as https://bench.example; takes a token
    token_file: file with the token, of at least 16 characters (default: a new one at each start)

    $ serve --control
    $ serve run.log --eds 5=motor.eds
    $ serve --control --eds 5=motor.eds -i socketcan -c can0
    $ serve --control motor.eds
    """
    with extras.needed("web"):  # here, so that a missing package is reported before a log is read
        import aiohttp  # noqa: F401
    named = [each for each in logs if Path(each).suffix.lower() in SUFFIXES]
    for each in named:
        readable(read_bytes(each), each)
    logs = [each for each in logs if each not in named]
    if len(logs) > MOST_LOGS:
        raise LocalError(f"a page shows up to {MOST_LOGS} logs side by side, not {len(logs)}")
    folder = Path(logs[0]) if len(logs) == 1 and Path(logs[0]).is_dir() else None
    if folder:
        logs = ()
        devices = replace(devices, network=str(workspace(folder)))
    check_source(logs, bus, of_a_bus={}, of_a_log={})
    if logs and control:
        missing = next((each for each in logs if not Path(each).suffix and not Path(each).exists()), None)
        raise LocalError(
            f"{missing}: there is no such folder; make it first"
            if missing
            else "--control is for a bus: a log cannot be changed"
        )
    rules = AccessRules.at(listen.host, origin, _token(token_file) if token_file else "")
    bit_rate = bus.bitrate or BITRATE
    server = PageServer(rules, listen.port)
    page = ServedPage(reading, devices, names, control, own_id, bit_rate, folder, server, named)
    with suppress(KeyboardInterrupt):  # the usual way to end it
        if logs:
            asyncio.run(page.show_logs(logs))
        elif named and bus == BusOptions():  # even if python-can has a configured bus
            if asyncio.run(page.show_files()):
                page.begin()
        elif live.is_named(bus.interface):
            asyncio.run(page.show_bus(bus, devices))
        else:
            if devices.files():
                devices.load_and_complain()  # so that their problems are reported now
            page.begin()


WORKSPACE = "library: [devices]\n"
"""Content of the network file of a new workspace."""


def workspace(folder: Path) -> Path:
    """Return the network file of a workspace; if there is none, it is made, with a folder for device files."""
    file, library = folder / DEFAULT, folder / "devices"
    if not file.exists():
        library.mkdir(exist_ok=True)
        write_whole(file, WORKSPACE.encode())
    return file


class PageServer:
    """Serves one page after another at the same address, which is printed once."""

    def __init__(self, rules: AccessRules, port: int) -> None:
        self.rules = rules
        self._port = port
        self._is_told = False

    async def serve(
        self,
        text: Callable[[], str],
        requests: Requests | None = None,
        posts: Mapping[str, Post] = MappingProxyType({}),
        until: asyncio.Event | None = None,
    ) -> bool:
        """Serve a page; return True at the event `until`, False at a signal of `ENDING`.

        Ctrl-C, which a background process may ignore, cancels it.
        """
        from eurobot_od.web.server import served  # with aiohttp

        ended = asyncio.Event()
        left = until or asyncio.Event()
        for number in ENDING:  # before the page can command anything
            with suppress(NotImplementedError):  # on Windows
                asyncio.get_running_loop().add_signal_handler(number, ended.set)
        async with served(text, self.rules, self._port, requests, posts) as address:
            self._port = self._port or urlsplit(address).port or 0
            if not self._is_told:
                print(f"{address}  (Ctrl-C ends it)", flush=True)
            self._is_told = True
            waiting = [asyncio.create_task(each.wait()) for each in (ended, left)]
            await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
            for each in waiting:
                each.cancel()
        return not ended.is_set()


@dataclass
class ServedPage:
    """The pages to serve, by the options of `serve`.

    `folder` is the workspace, None if there is none; `named` are the files to be edited.
    """

    reading: Reading
    devices: Devices
    names: FrameNames
    control: bool
    own_id: int
    bit_rate: int
    folder: Path | None
    server: PageServer
    named: Sequence[str] = ()

    def begin(self) -> None:
        """Serve the start page, then what was chosen there, repeatedly; a choice that fails leads back to it."""
        while (choice := asyncio.run(self._chosen())) is not None:
            try:
                goes_on = asyncio.run(self._show(choice))
            except (EurobotError, OSError) as error:
                goes_on = True
                complain(str(error))
            if not goes_on:
                return

    async def _chosen(self) -> Choice | None:
        """Serve the start page; return what was chosen, None at the end."""
        from eurobot_od.web.start import StartPage

        def try_bus(choice: BusChoice) -> None:
            BusOptions(interface=choice.interface, channel=choice.channel, bitrate=choice.bit_rate).open().shutdown()

        def try_log(file: Path) -> None:
            next(entries([str(file)], self.reading, is_watched=False), None)

        # A user of this machine's own address could run the command as well.
        may_act = self.control or not self.server.rules.token
        known, folder = self.devices.known_library, self.folder or Path()
        start = StartPage(known, folder, may_act, try_bus, try_log, self._last_bus())
        await self.server.serve(start.page, posts={"/start": start.answer}, until=start.chosen)
        return start.choice

    async def _show(self, choice: Choice) -> bool:
        """Show what was chosen; return whether the user went back to the start page."""
        from eurobot_od.web.start import BusChoice, FilesChoice, LogChoice

        if isinstance(choice, LogChoice):
            return await self.show_logs([str(choice.file)], can_leave=True)
        if isinstance(choice, FilesChoice):
            return await self.show_files()
        if isinstance(choice, BusChoice):
            self._keep_bus(choice)
            chosen = BusOptions(interface=choice.interface, channel=choice.channel, bitrate=choice.bit_rate)
            return await self.show_bus(chosen, self.devices, can_leave=True)
        eds = [f"{node_id}={path}" for path, node_id in choice.devices]
        with _simulated(self.devices, choice) as simulated:
            return await self.show_bus(simulated, replace(self.devices, eds=[*self.devices.eds, *eds]), can_leave=True)

    def _last_bus(self) -> BusChoice | None:
        """Return the bus that the workspace says, None without one; raises FileError."""
        from eurobot_od.web.start import BusChoice

        bus = network.read_network(self.folder / DEFAULT).bus if self.folder else None
        return bus and BusChoice(bus.interface, bus.channel, bus.bit_rate and 1000 * bus.bit_rate)

    def _keep_bus(self, choice: BusChoice) -> None:
        """Write the bus into the workspace, if there is one."""
        if self.folder:
            file = self.folder / DEFAULT
            rate = choice.bit_rate and choice.bit_rate // 1000
            text = network.with_bus(read_whole(file).decode("utf-8", "replace"), NetworkBus(*choice[:2], rate))
            write_whole(file, text.encode())

    async def show_logs(self, logs: Sequence[str], can_leave: bool = False) -> bool:
        """Serve the page of logs; return whether the user left it."""
        decoder = decoder_for(logs, self.reading, self.devices, self.names)
        panels = self.devices.panels(decoder)
        titles = told_apart(logs)
        kept = [list[ComparedEntry]() for _ in logs]
        diagnosis = partial(self._diagnosis, decoder)
        longs = [self._long(log, name, decoder, diagnosis) for log, name in zip(logs, titles)]

        def source(place: int, long: LongLog | None) -> dict[str, Any]:
            columns = Columns(titles[place], decoder, self.bit_rate, panels)
            own = kept[place] if len(logs) == COMPARED else None
            return long.data() if long else _source(logs[place], self.reading, columns, diagnosis(), panels, own)

        sources = [source(*each) for each in enumerate(longs)]
        compared = {} if any(longs) else _compared(kept, decoder)
        text = page(" and ".join(titles), sources, panels, leave=can_leave, editor=True, **compared)
        left, posts = _leaving(can_leave)
        asked = LongLogs(longs)
        posts = {**posts, **self._editing(partial(files_of, decoder)), "/log": asked.post}
        async with asked.building():
            return await self.server.serve(lambda: text, None, posts, left)

    def _long(self, log: str, name: str, decoder: Decoder, diagnosis: Callable[[], Diagnosis]) -> LongLog | None:
        """Return a log that is too long to be on the page as a whole; None for any other, or without places."""
        if not Path(log).is_file() or Path(log).stat().st_size < LONG:
            return None
        index = LogIndex.of(Path(log), self.reading.format, self.reading.largest)
        return None if index is None else LongLog(name, index, decoder, self.bit_rate, diagnosis)

    async def show_files(self) -> bool:
        """Serve the page of the files to be edited; return whether it was left."""
        text = page(" and ".join(told_apart(self.named)) if self.named else "Files", [], editor=True, leave=True)
        described = [Path(each.file) for each in self.devices.files()]
        left, posts = _leaving(True)
        return await self.server.serve(lambda: text, None, {**posts, **self._editing(lambda: described)}, left)

    def _editing(self, described: Callable[[], Sequence[Path]]) -> Mapping[str, Post]:
        """Return the request handler of the view of files: the named ones, those of the devices, and the library's."""

        def files() -> Iterator[EditableFile]:
            library = [each.path for each in self.devices.known_library.entries]
            found = {"named": map(Path, self.named), "network": described(), "library": library}
            every = (EditableFile(each.absolute(), origin) for origin, paths in found.items() for each in paths)
            yield from (each for each in every if each.path.is_file())

        return {"/files": FileEditor(files, self.control).post}

    def _diagnosis(self, decoder: Decoder) -> Diagnosis:
        return Diagnosis(decoder, self.devices.watchers, self.bit_rate, self.devices.promised(decoder))

    async def show_bus(self, bus: BusOptions, devices: Devices, can_leave: bool = False) -> bool:
        """Serve the page of a bus; return whether the user left it."""
        from eurobot_od.web.desk import Desk, Equipment
        from eurobot_od.web.requests import Requests
        from eurobot_od.web.session import Session

        # With control, nodes may be asked for their identity.
        devices = devices.found_on(bus) if self.control else devices
        decoder = decoder_for((), self.reading, devices, self.names)
        bitrate = bus.bitrate or self.bit_rate
        session = Session(bus.open, decoder, bitrate, devices.panels, diagnosis=self._diagnosis(decoder))
        networks = devices.plugins.networks()._replace(decoder=devices.decoder_with(self.names))
        plugins = devices.plugins
        equipment = Equipment(
            devices.known_library,
            networks,
            version(),
            "simulated by the page" if bus == SIMULATED else bus.words,
            plugins.procedure,
            lambda each: plugins.for_identity(each).address,
        )
        stop = stop_message(list(map(type, session.panels)))
        name = bus_name(bus.interface, bus.channel)
        left, posts = _leaving(can_leave)
        with ExitStack() as stack:
            stack.callback(session.close)
            # Without a workspace, recordings are deleted with the page.
            folder = self.folder or Path(stack.enter_context(TemporaryDirectory(prefix="eurobot-od-")))
            desk = Desk(session, folder, self.control, stop, self.own_id, equipment)
            text = partial(session.page, name, can_leave, editor=True)
            editing = self._editing(lambda: files_of(session.decoder))
            return await self.server.serve(text, Requests(desk), {**posts, **editing}, left)


def files_of(decoder: Decoder) -> list[Path]:
    """Return the files that describe a decoder's devices."""
    return [each.file for each in decoder.dictionaries]


def _leaving(can_leave: bool) -> tuple[asyncio.Event, Mapping[str, Post]]:
    """Return the event of leaving a page, and the handler of the request for it."""
    left = asyncio.Event()

    async def leave(_: str) -> str:
        left.set()
        return "{}"

    return left, {"/leave": leave} if can_leave else {}


SIMULATED = BusOptions(interface="virtual", channel="simulated")
"""The bus of simulated devices."""


@contextmanager
def _simulated(devices: Devices, choice: SimulatedChoice) -> Iterator[BusOptions]:
    """Run simulated devices of the library on a bus of this process, and yield the bus."""
    from eurobot_od.bus.live import Live, open_bus
    from eurobot_od.device.profiles import simulated_kind

    with ExitStack() as stack:
        for path, node_id in choice.devices:
            device = devices.worded(Dictionary.load(path, node_id))
            kind = devices.plugins.kind(device, otherwise=simulated_kind(device))
            stack.enter_context(Live.node(open_bus(SIMULATED.interface, SIMULATED.channel), kind(device)))
        yield SIMULATED


# Logs


def told_apart(logs: Sequence[str]) -> list[str]:
    """Return different names for logs: their files' names, or the shortest ends of their paths that differ."""
    parts = [Path(each).parts for each in logs]
    for length in range(1, max(map(len, parts)) + 1):
        names = [str(Path(*each[-length:])) for each in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{each[-1]} ({number})" for number, each in enumerate(parts, 1)]


def _compared(logs: Sequence[Sequence[ComparedEntry]], decoder: Decoder) -> dict[str, Any]:
    """Return the differences of the second log from the first, as `compare` finds them; nothing for one log."""
    if len(logs) != COMPARED:
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
    kept: list[ComparedEntry] | None,
) -> dict[str, Any]:
    """Read a log as a source of the page, with the files of plug-ins beside it; `kept` collects its entries."""
    damage = DamageCounts()
    diagnosis.begin(columns.name)
    # No progress bar, as the terminal shows the address and the log's defects.
    for _, (line, time, channel, raw) in entries([log], reading, is_watched=False):
        meaning = diagnosis.take(time, channel, raw, line)
        damage.add(log, line, meaning.defects)
        columns.take(time, meaning)
        if kept is not None:
            kept.append(ComparedEntry(time, raw))
    diagnosis.end()
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    if columns.left_out:
        complain(f"{log}: {columns.left_out} frames are left out: only logs of lines, not packed, are shown whole")
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
    """Return the page's name of a bus: `Bus can0 (socketcan)`, or the host of a remote one."""
    place = urlsplit(channel or "").netloc
    if place:
        return f"Bus at {place.rpartition('@')[2]}"
    return f"Bus {channel or ''}".strip() + (f" ({interface})" if interface else "")
