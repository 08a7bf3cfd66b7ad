"""Command-line options that several commands share."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from eurobot_od import plugin
from eurobot_od.cli import Parser, complain, is_alone
from eurobot_od.errors import FileError, LocalError, MappingError, RemoteError
from eurobot_od.od import network
from eurobot_od.od.dialects import DIALECT_VARIABLE
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network_file import NetworkFile, NodeFile
from eurobot_od.od.values import NODE_IDS
from eurobot_od.plugin import Plugin
from eurobot_od.season import MOST_JOBS
from eurobot_od.support.connections import parse
from eurobot_od.traffic.recorder import END, GO_ON

if TYPE_CHECKING:
    import can

    from eurobot_od.bus.live.connection import Opener
    from eurobot_od.client.master import Guard, Master
    from eurobot_od.device.emergency import ErrorWords
    from eurobot_od.od.pdos import OnRefused
    from eurobot_od.pdo.protocol import Protocol
    from eurobot_od.traffic.load.analysis import MessageSet
    from eurobot_od.traffic.meaning import Decoder


T = TypeVar("T")


def add_bus(parser: argparse.ArgumentParser, else_: str = "") -> None:
    """Add -i, -c and -b; what is left out comes from python-can's own configuration, or is `else_`."""
    group = parser.add_argument_group("bus", f"default: python-can's configuration{else_}")
    group.add_argument("-i", "--interface", help="python-can interface, such as socketcan, pcan, slcan, remote")
    group.add_argument("-c", "--channel", help="channel of the interface, such as can0")
    group.add_argument("-b", "--bitrate", type=bit_rate, help="bit/s, 500000 if nothing else is configured")


def positive(text: str, of: str = "") -> float:
    """Read a positive number, `of` what if it is not one."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number{of}")
    return value


def whole(low: int, high: float = inf, what: str = "") -> Callable[[str], int]:
    """Return the reader of a whole number in a range, which is `what` the complaint of another one asks for."""

    def read(text: str) -> int:
        # Of 16 digits and more no option knows what to do; of thousands `int` itself raises, in words of its own.
        number = int(text) if text.isdecimal() and len(text) < 16 else -1
        if not low <= number <= high:
            raise argparse.ArgumentTypeError(f"{text} is not {what or f'in {low}..{high}'}")
        return number

    return read


bit_rate = whole(1000, 1_000_000, "in 1000..1000000 bit/s")
jobs = whole(1, MOST_JOBS, f"a number from 1 to {MOST_JOBS}")


def argument_of(read: Callable[[str], T]) -> Callable[[str], T]:
    """Return a reader whose LocalError is reported with the name of the option that it reads."""

    def told(text: str) -> T:
        try:
            return read(text)
        except LocalError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return told


address = argument_of(parse)


def open_bus(arguments: argparse.Namespace) -> can.BusABC:
    """Open the bus that the options, or python-can's configuration, name; raises LocalError, BusError."""
    from eurobot_od.bus import live as runtime

    # Asked first: without a name python-can would complain of its configuration file, of which few users know.
    if not runtime.is_named(arguments.interface):
        here = ", ".join(map(str, runtime.here())) or "none (`doctor` says more)"
        raise LocalError(f"which bus? Name it by -i and -c, such as -i socketcan -c can0; here: {here}")
    return runtime.open_bus(arguments.interface, arguments.channel, arguments.bitrate)


def add_log(parser: argparse.ArgumentParser) -> None:
    """Add the log to write, and what happens when that fails."""
    parser.add_argument(
        "--log",
        type=Path,
        metavar="FILE",
        help="write all frames there, in the format of its suffix; with --seeds {seed} stands for each seed",
    )
    parser.add_argument(
        "--log-failure",
        choices=(GO_ON, END),
        default=GO_ON,
        help="what to do when the log cannot be written (default: %(default)s); the exit status is 3 in any case",
    )


def add_reconnect(parser: argparse.ArgumentParser) -> None:
    """Add --no-reconnect, for commands that stay on a bus."""
    parser.add_argument(
        "--no-reconnect", action="store_true", help="end when the bus is lost, instead of opening it again"
    )


def opener(arguments: argparse.Namespace) -> Opener:
    """Return what opens the bus as `open_bus` does."""
    return partial(open_bus, arguments)


def reopener(arguments: argparse.Namespace) -> Opener | None:
    """Return what opens the bus again when it is lost, None with --no-reconnect."""
    return None if arguments.no_reconnect else opener(arguments)


def guard(reopen: Opener | None, master: Master) -> Guard:
    """Return what opens a master's bus again by `reopen` when it is lost; without that, a lost bus ends the command."""
    from eurobot_od.client.master import Reconnecting, unguarded

    # `complain` writes to standard error: what is printed may be JSON for another program.
    return Reconnecting(master, reopen, complain) if reopen else unguarded


def add_dialect(parser: argparse._ActionsContainer) -> None:
    """Add --dialect: a folder of EDS files."""
    parser.add_argument(
        "--dialect",
        metavar="NAME",
        help=f"name of a robot's dialect, or a folder of EDS files (default: the variable {DIALECT_VARIABLE})",
    )


def robot(arguments: argparse.Namespace, network: str | None = None) -> Plugin:
    """Return the robot that a command is about which takes no devices but a network; raises as `plugin.find`."""
    return Devices(network=network, robot_name=arguments.robot, alone=is_alone()).robot


def robot_meant(parser: argparse.ArgumentParser) -> Plugin:
    """Return the robot that a command line will mean once it is read, for options that only the robot has.

    Raises as `plugin.find`.
    """
    early = Parser(parser.prog, add_help=False)
    add_network(early)
    arguments, _ = early.parse_known_args(getattr(parser, "words", ()))
    arguments.robot = getattr(parser, "robot", None)
    return Devices.of(arguments).robot


def assignments(option: str, form: str, texts: Iterable[str]) -> list[tuple[str, str]]:
    """Split the values of an option, in the `form` NAME=VALUE, at their first equals signs; raises LocalError."""
    given = []
    for text in texts:
        name, equals, value = text.partition("=")  # the first: a value may have some itself, a name has none
        if not equals:
            raise LocalError(f"{option} {text}: write {form}")
        given.append((name, value))
    return given


# Devices


def add_network(parser: argparse.ArgumentParser) -> None:
    """Add --eds, --network and --dialect: whose EDS and DCF files are loaded."""
    group = parser.add_argument_group("devices", f"default: {network.DEFAULT} in this folder, else the robot's")
    group.add_argument(
        "--eds",
        action="append",
        default=[],
        metavar="[NODE-ID=]FILE",
        help="EDS, DCF, XDD or XDC of a device, with a node-ID if the file has none; repeatable",
    )
    group.add_argument(
        "--network",
        metavar="PATH",
        help="network file (YAML, or nodelist.cpj of CiA 306-3), or a folder of EDS files",
    )
    group.add_argument(
        "--module",
        action="append",
        default=[],
        metavar="[NODE=]MODULES",
        help="modules that are plugged into a device, in their order: numbers or names, such as 1,1,3; repeatable",
    )
    group.add_argument(
        "--patch",
        action="append",
        default=[],
        metavar="[NODE=]FILE",
        help="patch over a device's file: objects in YAML, or a DCF's values; repeatable",
    )
    add_dialect(group)


def add_emcy(parser: argparse.ArgumentParser) -> None:
    """Add --emcy: makers' words for emergency error codes."""
    parser.add_argument(
        "--emcy",
        action="append",
        default=[],
        metavar="[NODE-ID=]FILE",
        help="a maker's words for emergency error codes (YAML), of one node or of all; repeatable",
    )


def check_node_id(number: int) -> int:
    """Return a node-ID; raises LocalError if it is not one."""
    if number not in NODE_IDS:
        raise LocalError(f"node-ID {number} is not in 1..127")
    return number


class Devices(NamedTuple):
    """The devices that --eds, --network and --dialect name, or the network file of this folder, or else the robot's.

    `alone`: only a robot that is named counts, as for devices that are.
    """

    eds: Sequence[str] = ()
    network: str | None = None
    dialect: str | None = None
    robot_name: str | None = None
    emcy: Sequence[str] = ()
    modules: Sequence[str] = ()
    patches: Sequence[str] = ()
    alone: bool = False

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> Devices:
        """Take them from a command line."""
        emcy = vars(arguments).get("emcy", ())  # of commands that say error codes
        over = arguments.module, arguments.patch
        return cls(arguments.eds, arguments.network, arguments.dialect, arguments.robot, emcy, *over, is_alone())

    @property
    def robot(self) -> Plugin:
        """The robot that is named, also by the network file, or else, without devices, the installed one.

        Raises as `plugin.find`.
        """
        found = plugin.named(self.robot_name, self._file)
        return found or (plugin.NO_ROBOT if self.alone or self.files() else plugin.the_installed())

    @property
    def _file(self) -> str:
        """The network file: what is named on the command line replaces the folder's own; the two are never mixed."""
        return self.network or ("" if self.eds else network.DEFAULT)

    @property
    def _described(self) -> NetworkFile:
        """What the network file says, if there is one; raises FileError."""
        if not self.network and (self.dialect or not os.path.isfile(self._file)):  # noqa: PTH113
            return NetworkFile()
        return network.read_network(self._file)

    @property
    def master(self) -> str:
        """Who leads the network, if its file says it; raises FileError."""
        return self._described.master

    def files(self) -> list[NodeFile]:
        """Return the files that are named, none for a dialect; raises LocalError, FileError."""
        if self.dialect and (self.eds or self.network):
            raise LocalError("--dialect is a network of its own: leave out --eds and --network, or leave it out")
        named = [*map(network.node_file, self.eds), *self._described.nodes]
        return with_patches(with_modules(named, self.modules), self.patches)

    def load(self) -> tuple[Dictionary, ...]:
        """Load the files that are named, or else the dialect's; raises LocalError, FileError, UnknownName."""
        files = self.files()
        return network.load(files) if files else self.robot.dialects.load_all(self.dialect)

    @property
    def are_known(self) -> bool:
        """Whether there are any: a bus, and a log, can be read without. Raises as `load`."""
        return bool(self.files() or self.dialect or self.robot.dialects.root)

    def load_and_complain(self) -> tuple[Dictionary, ...]:
        """Load the devices, and say which of the files that are named had to be repaired to be read."""
        loaded = self.load()
        if self.files():  # the dialects' files need no repair, and to look for one takes as long as loading
            complain_of_repairs(loaded)
        return loaded

    def protocol(self) -> Protocol:
        """Return the messages of these devices; complains of PDOs that are left out. Raises as `load`."""
        from eurobot_od.pdo.protocol import Protocol

        with left_out() as refused:
            return Protocol.of_devices(self.load_and_complain(), self.robot.catalogue(), refused)

    def decoder(self) -> Decoder:
        """Return the decoder of these devices' frames, of CiA 301's without any; complains of PDOs that are left out.

        Raises as `load`.
        """
        known = self.load_and_complain() if self.are_known else ()
        return decoder_of(known, self.robot, self.own_errors(), self.master)

    def own_errors(self) -> dict[int, dict[int, str]]:
        """Return the words of --emcy by node-ID, 0 for all nodes; raises FileError."""
        if not self.emcy:
            return {}  # most commands start without YAML
        from eurobot_od.od.yaml_files import read_error_words

        found: dict[int, dict[int, str]] = {}
        for file, node_id in (network.node_file(text)[:2] for text in self.emcy):
            found.setdefault(node_id or 0, {}).update(read_error_words(file))
        return found

    def errors(self) -> ErrorWords:
        """Return the words for these devices' emergency error codes, CiA 301's if there are none; raises as `load`."""
        from eurobot_od.device.emergency import ErrorWords

        known = self.load() if self.are_known else ()
        return ErrorWords.of_devices(known, self.robot.catalogue(), self.own_errors())

    def asking_decoder(self, open_bus: Opener) -> Decoder:
        """Return a decoder for the PDOs as the devices on the bus are set now; complains of those that do not answer.

        Raises as `load`, BusError.
        """
        from eurobot_od.client.master import Master
        from eurobot_od.client.remote_pdos import pdo_parameters

        asked = []
        with Master(open_bus()) as master:
            for dictionary in self.load_and_complain():
                master.follow(dictionary)
                try:
                    asked.append(dictionary.configured(pdo_parameters(master.node(dictionary.node_id), dictionary)))
                except RemoteError as error:  # one node that is off must not keep the others from being decoded
                    complain(f"{dictionary.name}: PDOs as in {dictionary.file}: {error}")
                    asked.append(dictionary)
        return decoder_of(asked, self.robot, self.own_errors(), self.master)

    def promised(self, decoder: Decoder) -> MessageSet:
        """Return what a decoder's devices send, and how often; nothing if a period is missing."""
        from eurobot_od.traffic.load.network_set import network_set
        from eurobot_od.traffic.load.seen import NOTHING

        try:
            file = self.network or network.DEFAULT if self.files() else str(self.robot.dialects.network_file())
            rows = network.read_network(file) if os.path.exists(file) else NetworkFile()  # noqa: PTH110
            names = {each.cob_id: each.name for each in decoder.protocol.bindings}
            return network_set(decoder.dictionaries, names, rows, file)
        except (FileError, LocalError):  # a bus can be watched without knowing how often a message is to come
            return NOTHING


def with_modules(files: list[NodeFile], texts: Iterable[str]) -> list[NodeFile]:
    """Return files with the modules that `--module` plugs into their devices; raises LocalError."""
    plugged: dict[int, list[str]] = {}
    for text in texts:
        node, _, listed = text.rpartition("=")
        device = _the_device(files, node, f"--module {text}: say into which device")
        plugged.setdefault(device, []).extend(each.strip() for each in listed.split(","))
    return [each._replace(modules=plugged[n]) if n in plugged else each for n, each in enumerate(files)]


def with_patches(files: list[NodeFile], texts: Iterable[str]) -> list[NodeFile]:
    """Return files with those that `--patch` lays over them, after a network file's own; raises LocalError."""
    over: dict[int, list[str]] = {}
    for text in texts:
        node, equals, file = text.partition("=")
        if not equals or not _fitting(files, node):  # a path may have an equals sign, too
            node, file = "", text
        over.setdefault(_the_device(files, node, f"--patch {text}: say of which device"), []).append(file)
    return [each._replace(patch=[*each.patch, *over.get(n, ())]) for n, each in enumerate(files)]


def _the_device(files: Sequence[NodeFile], node: str, question: str) -> int:
    """Return which of the files is the one device that is meant by node-ID, name or stem; raises LocalError."""
    fitting = _fitting(files, node)
    if len(fitting) != 1:
        known = ", ".join(f"{each.node_id or each.name or Path(each.file).stem}=" for each in files)
        raise LocalError(f"{question}: {known or 'none is named by --eds or --network'}")
    return fitting[0]


def _fitting(files: Sequence[NodeFile], node: str) -> list[int]:
    return [n for n, each in enumerate(files) if node in ("", str(each.node_id), each.name, Path(each.file).stem)]


def complain_of_repairs(dictionaries: Iterable[Dictionary]) -> None:
    """Say in a line for each file what had to be repaired to read it, what is left out, and what looks like a copy."""
    from eurobot_od.od.dictionary import SdoChannel, moved_server

    # By file: two nodes may share one, and it was repaired once.
    for file, each in {each.file: each for each in dictionaries}.items():
        # A guess first: what follows may be hidden behind "and 4 more".
        changes = sorted(each.changes, key=lambda change: not change.guessed)
        repaired = [f"line {change.line}: {change.what}" for change in changes]
        for done, found, lister in (
            ("repaired to be read", repaired, "lint --fix"),
            ("left out", [str(refusal) for refusal in each.left_out], "lint"),
        ):
            more = f", and {len(found) - 1} more (`{lister}` lists them)" if len(found) > 1 else ""
            if found:
                complain(f"{file}: {done}: {found[0]}{more}")
        if SdoChannel.of(each).usual_for not in (None, each.node_id):  # whoever is there is spoken to
            complain(f"{file}: {moved_server(each)}")
        if each.idle_modules:
            complain(
                f"{file}: none of its modules is connected; --module takes {', '.join(map(str, each.idle_modules))}"
            )


def decoder_of(
    dictionaries: Iterable[Dictionary],
    robot: Plugin,
    errors: Mapping[int, Mapping[int, str]] = MappingProxyType({}),
    master: str = "",
) -> Decoder:
    """Return the decoder of some devices' frames; complains of PDOs that are left out.

    `errors` are words for emergency error codes, by node-ID; `master` is who leads the network, if a file says it.
    """
    from eurobot_od.traffic.meaning import Decoder

    with left_out() as refused:
        return Decoder(dictionaries, robot.catalogue(), refused, errors, master)


@contextmanager
def left_out() -> Iterator[OnRefused]:
    """Collect PDOs that cannot be used, and say which, in one line for each reason in a file."""
    errors: dict[tuple[str, str], list[MappingError]] = {}
    yield lambda error: errors.setdefault((error.file, error.what), []).append(error)
    # What is wrong with one PDO is often wrong with all of them.
    for (file, what), found in errors.items():
        indices = ", ".join(dict.fromkeys(f"0x{each.index:04X}" for each in found if each.index is not None))
        complain(f"PDO left out: {file}: {f'{indices}: ' if indices else ''}{what}")
