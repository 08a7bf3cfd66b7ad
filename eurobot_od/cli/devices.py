"""The devices of a command line, otherwise the robot's: their files, messages, and problems."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, TypeAlias

from eurobot_od import loading
from eurobot_od.cli import ExitStatus, RobotName, complain, is_alone
from eurobot_od.cli.options import NOTHING_NAMED, BusOptions, FrameNames, Wait, whole
from eurobot_od.cli.signature import DEVICE_FILES, HelpGroup, Option
from eurobot_od.errors import DictionaryError, FileError, LocalError, MappingError, RemoteError, look_up
from eurobot_od.library.library import VARIABLE, Library, LibraryDevices, Numbers, folders
from eurobot_od.loading import DEVICES
from eurobot_od.od import DEFAULT, DIALECT_VARIABLE, network
from eurobot_od.od.dictionary import NO_NODE_ID, Dictionary
from eurobot_od.od.maker import read_maker
from eurobot_od.od.network import NetworkFile, NodeFile
from eurobot_od.od.objects import all_objects
from eurobot_od.od.pdos import OnRefused
from eurobot_od.od.sdo_channels import SdoChannel, moved_server
from eurobot_od.od.standard import DEVICE_TYPE
from eurobot_od.od.values import check_node_id, parse_number
from eurobot_od.pdo.in_force import Describe, nothing_known
from eurobot_od.pdo.protocol import ErrorWords, Protocol
from eurobot_od.plugin import NOTHING, Plugin, Plugins
from eurobot_od.support.texts import amount

if TYPE_CHECKING:
    from eurobot_od.client.description import Found
    from eurobot_od.client.master import Master, RemoteNode
    from eurobot_od.season.events import LogEvent
    from eurobot_od.traffic.dbc import ForeignMessage
    from eurobot_od.traffic.diagnosis.incidents import Watcher
    from eurobot_od.traffic.load import MessageSet
    from eurobot_od.traffic.meaning import Decoder
    from eurobot_od.web.page import Panel


Dialect: TypeAlias = Annotated[
    str | None,
    Option(metavar="NAME", suggest=lambda plugins: plugins.robot.dialects.names()),
    f"name of a robot's dialect, or a folder of EDS files (default: the variable {DIALECT_VARIABLE})",
]

LibraryFolders: TypeAlias = Annotated[
    Sequence[str],
    Option(metavar="FOLDER", is_file=True),
    f"folder of device files; repeatable (default: the variable {VARIABLE}, `library:` of {DEFAULT}, or your own)",
]


PackagePaths: TypeAlias = Annotated[
    Sequence[str],
    Option(metavar="PATH", is_file=True),
    f"device package: a folder with {DEVICES.file}, a file, or an installed one's name; repeatable (default: the "
    f"variable {DEVICES.variable}, and those that are installed)",
]


@dataclass(frozen=True, kw_only=True)
class Devices:
    """The devices of --eds, --network and --dialect, otherwise of the folder's network file, otherwise the robot's.

    eds: EDS, DCF, XDD or XDC of a device, with a node-ID if the file has none; repeatable
    network: network file (YAML, or nodelist.cpj of CiA 306-3), or a folder of EDS files
    module: modules that are plugged into a device, in their order: numbers or names, such as 1,1,3; repeatable
    patch: patch over a device's file: objects in YAML, or a DCF's values; repeatable
    library: folder of device files, for nodes whose file is not named (default: your own, see `devices`); repeatable
    """

    GROUP = HelpGroup("devices", f"default: {DEFAULT} in this folder, else the robot's")

    eds: Annotated[Sequence[str], Option(metavar="[NODE-ID=]FILE", is_file=True)] = ()
    network: Annotated[str | None, Option(metavar="PATH", is_file=True)] = None
    module: Annotated[Sequence[str], Option(metavar="[NODE=]MODULES")] = ()
    patch: Annotated[Sequence[str], Option(metavar="[NODE=]FILE", is_file=True)] = ()
    library: LibraryFolders = ()
    package: PackagePaths = ()
    dialect: Dialect = None
    robot_name: RobotName = None

    @property
    def robot(self) -> Plugin:
        """The robot that is named, also by the network file; otherwise, without devices, the installed one.

        Raises as `loading.find`.
        """
        found = loading.named(self.robot_name, self._file)
        return found or (NOTHING if is_alone() or self.eds or self._described.nodes else loading.the_installed())

    @cached_property
    def plugins(self) -> Plugins:
        """The plug-ins to use: the robot, and the device packages. Raises as `robot`."""
        return Plugins(self.robot, loading.packages(self.package))

    @property
    def _file(self) -> str:
        """The network file; the command line's replaces the folder's, they are never merged."""
        return self.network or ("" if self.eds else DEFAULT)

    @cached_property
    def _described(self) -> NetworkFile:
        """The content of the network file, empty if there is none; raises FileError."""
        if not self.network and (self.dialect or not os.path.isfile(self._file)):  # noqa: PTH113
            return NetworkFile()
        return network.read_network(self._file)

    @cached_property
    def known_library(self) -> Library:
        """The library for nodes without a named file; raises LocalError, FileError."""
        written = self._described.library
        if not written and self._file != DEFAULT and os.path.isfile(DEFAULT):  # noqa: PTH113
            written = network.read_network(DEFAULT).library  # it is for the whole folder
        return Library(folders(self.library, written))

    def describer(self, known: Iterable[Dictionary]) -> LibraryDevices:
        """Return what describes nodes by their identity; unnamed `known` devices may be replaced."""
        implied = () if self.files() else [each.node_id for each in known]
        return LibraryDevices(self.known_library, complain, implied, self._without_file, self.worded)

    @property
    def master(self) -> str:
        """Name of the network's master, if its file has one; raises FileError."""
        return self._described.master

    def files(self) -> list[NodeFile]:
        """Return the named files, none for a dialect; raises LocalError, FileError."""
        if self.dialect and (self.eds or self.network):
            raise LocalError("--dialect is a network of its own: leave out --eds and --network, or leave it out")
        typed = map(network.node_file, self.eds)
        without = self._without_file
        named = [without[each.node_id]._replace(file=each.file) if each.node_id in without else each for each in typed]
        written = [each for each in self._described.nodes if each.file]
        return with_patches(with_modules([*named, *written], self.module), self.patch)

    @property
    def are_listed(self) -> bool:
        """Whether the command line or the network file names devices, so that each of them ought to be there."""
        return bool(self.eds or self._described.nodes)

    @property
    def network_file(self) -> str:
        """The network file of the command line, otherwise the folder's; empty if there is none."""
        return self.network or (DEFAULT if not self.eds and self._described.nodes else "")

    def names(self) -> dict[str, int]:
        """Return the node-IDs by name, also of nodes whose file is not named; raises as `load`."""
        unnamed = {each.name: each.node_id or 0 for each in self._without_file.values()}
        loaded = self.load() if self.are_known else ()
        return {each.name: each.node_id for each in loaded} | {
            name: number for name, number in unnamed.items() if number not in {each.node_id for each in loaded}
        }

    def unnamed(self) -> str:
        """Return a line about nodes without a named file, for a command that does not ask the bus; empty if none."""
        typed = {network.node_file(text).node_id for text in self.eds}
        lacking = [each for number, each in self._without_file.items() if number not in typed]
        said = ", ".join(f"{each.name} ({each.node_id})" for each in lacking)
        return said and (
            f"no file is named for {said}: only the bus tells which of the library's it is; "
            f"name one by --eds {lacking[0].node_id}=FILE"
        )

    def check_named(self) -> None:
        """Report nodes without a named file; raises LocalError if there is no other."""
        said = self.unnamed()
        if said and not self.files():
            raise LocalError(said)
        if said:
            complain(said)

    @property
    def _without_file(self) -> dict[int, NodeFile]:
        """The nodes of the network file without a file, by node-ID; raises FileError."""
        return {each.node_id: each for each in self._described.nodes if each.node_id and not each.file}

    def load(self) -> tuple[Dictionary, ...]:
        """Load the named files, otherwise the dialect's; raises LocalError, FileError, UnknownName."""
        files = self.files()
        if not files and (said := self.unnamed()):
            raise LocalError(said)
        if self.network and os.path.isdir(self.network) and any(is_without_node_id(each) for each in files):  # noqa: PTH112
            raise LocalError(
                f"{self.network}: files without a node-ID are no network; as makers' files for the devices of a bus or "
                f"log they are a library: --library {self.network}"
            )
        return self.with_words(network.load(files)) if files else self.robot.dialects.load_all(self.dialect)

    def with_words(self, known: Iterable[Dictionary]) -> tuple[Dictionary, ...]:
        """Return devices with the errors, units and values of their packages."""
        return tuple(map(self.worded, known))

    def worded(self, device: Dictionary) -> Dictionary:
        """Return a device with the errors, units and values of its package."""
        words = self.plugins.of(device).words
        return device.described_by(read_maker(words), over=False) if words else device

    @property
    def are_known(self) -> bool:
        """Whether there are any devices; a bus or log can be read without. Raises as `load`."""
        is_of_robot = self.robot.dialects.root is not None and not self._without_file
        return bool(self.files() or self.dialect or is_of_robot)

    def load_and_complain(self, files: Iterable[NodeFile] | None = None) -> tuple[Dictionary, ...]:
        """Load the devices, or those of `files`, and report which named files had to be repaired."""
        loaded = self.load() if files is None else self.with_words(network.load(files))
        if self.files():  # the dialects' files need no repair, and checking takes as long as loading
            if self.network:
                for line in network.not_understood(self._file):
                    complain(line)
            complain_of_repairs(loaded)
        return loaded

    def protocol(self, known: Iterable[Dictionary] = ()) -> Protocol:
        """Return the messages of these devices, or of `known`; reports PDOs that are left out. Raises as `load`."""
        if not known:
            self.check_named()
        with left_out() as refused:
            return Protocol.of_devices(known or self.load_and_complain(), self.robot.catalogue(), refused)

    def decoder(
        self, names: FrameNames = NOTHING_NAMED, shown: Mapping[int, Numbers] = MappingProxyType({})
    ) -> Decoder:
        """Return the decoder of these devices' frames, without devices that of CiA 301; reports PDOs that are left out.

        `shown` are the identities of nodes, which the library describes. Raises as `load`.
        """
        known = self.load_and_complain() if self.are_known else ()
        describe = self.describer(known)
        devices = {each.node_id: each for each in known}
        for node_id, numbers in shown.items():
            if found := describe(node_id, numbers, devices.get(node_id)):
                devices[node_id] = found
        return self._decoder_of(devices.values(), names, describe=describe)

    def _decoder_of(
        self,
        known: Iterable[Dictionary],
        names: FrameNames,
        learned: Iterable[Dictionary] = (),
        describe: Describe = nothing_known,
    ) -> Decoder:
        """Return the decoder of devices; reports PDOs that are left out."""
        make = self.decoder_with(names)
        with left_out() as refused:
            return make(known, self.robot.catalogue(), refused, learned=learned, describe=describe)

    def decoder_with(self, names: FrameNames) -> Callable[..., Decoder]:
        """Return a function that makes a decoder with the names of files and packages; raises as `read_dbc`."""
        from eurobot_od.traffic.dbc import read_dbc  # here, as showing and exporting files does not need it
        from eurobot_od.traffic.meaning import Decoder

        errors = self.error_words(names.emcy)
        others = read_dbc(self.dbc_files(names))
        return partial(Decoder, errors=errors, master=self.master, others=others, frames=self.frames_of)

    def dbc_files(self, names: FrameNames) -> list[str]:
        """Return the files that describe other protocols: the network file's, then those of the command line."""
        return [*self._described.dbc, *names.dbc]

    def frames_of(self, device: Dictionary) -> Mapping[int, ForeignMessage]:
        """Return a device's non-CANopen frames, as its package describes them, by COB-ID."""
        return self.plugins.of(device).frames(device)

    def events_of(self, log: Path) -> Sequence[LogEvent]:
        """Return the events of a log that its frames do not show, as the robot's plug-in knows them."""
        return self.plugins.robot.beside(log)

    def watchers(self, decoder: Decoder) -> list[type[Watcher]]:
        """Return the plug-ins' rules of `diagnose` for the devices of a decoder."""
        return [each for plugin in self.plugins.present(decoder.dictionaries) for each in plugin.watchers()]

    def panels(self, decoder: Decoder) -> list[type[Panel]]:
        """Return the plug-ins' views of the page for the devices of a decoder."""
        protocol = decoder.protocol
        plugins = self.plugins.present(decoder.dictionaries)
        return [panel.of(protocol) for each in plugins for panel in each.panels() if panel.fits(protocol)]

    def error_words(self, emcy: Iterable[str]) -> dict[int, dict[int, str]]:
        """Return texts of error codes by node-ID, 0 for all: the network file's, overridden by those of `emcy`."""
        nodes = (*self._described.nodes, *self.files())
        said = dict.fromkeys(f"{each.node_id}={file}" if each.node_id else file for each in nodes for file in each.emcy)
        return read_words((*self._described.emcy, *said, *emcy))

    def errors(self, emcy: Iterable[str] = (), found: Dictionary | None = None) -> ErrorWords:
        """Return the texts of these devices' EMCY codes, without devices those of CiA 301; raises as `load`.

        A device that was `found` on the bus replaces the named one with its node-ID.
        """
        loaded = self.load() if self.are_known else ()
        devices = {each.node_id: each for each in loaded}
        if found:
            devices[found.node_id] = found
        return ErrorWords.of_devices(devices.values(), self.robot.catalogue(), self.error_words(emcy))

    def asking_decoder(self, bus: BusOptions, names: FrameNames = NOTHING_NAMED) -> Decoder:
        """Return a decoder for the current PDOs of the devices on the bus; reports those that do not answer.

        Without files, all devices that answer are asked. Raises as `load`, BusError.
        """
        from eurobot_od.client.configure import all_pdo_parameters
        from eurobot_od.client.description import scan
        from eurobot_od.client.master import Master
        from eurobot_od.od.profiles import profile_shown
        from eurobot_od.pdo.in_force import made

        asked, learned = list[Dictionary](), list[Dictionary]()
        with Master(bus.open()) as master:
            on_bus = scan(master) if self._are_sought else ()
            for found in on_bus:
                if self.are_known and found.node_id not in self._without_file:
                    continue
                try:
                    if described := self.found_description(found):
                        asked.append(described)
                    else:
                        parameters = all_pdo_parameters(master.node(found.node_id))
                        learned += made(found.node_id, parameters, profile_shown(found.device_type or 0, ()))
                except RemoteError as error:
                    complain(f"node {found.node_id}: {error}")
            known = (*(self.load_and_complain() if self.are_known else ()), *asked)
            present = [self._configured(master, each) for each in known]
        return self._decoder_of(present, names, learned, self.describer(known))

    def _configured(self, master: Master, dictionary: Dictionary) -> Dictionary:
        """Return a device with its current PDOs; if it does not answer, report that and return it as in its file."""
        from eurobot_od.client.configure import pdo_parameters

        master.follow(dictionary)
        try:
            return dictionary.configured(pdo_parameters(master.node(dictionary.node_id), dictionary))
        except RemoteError as error:  # the others are decoded even if one node is off
            complain(f"{dictionary.name}: PDOs as in {dictionary.file}: {error}")
            return dictionary

    @property
    def _are_sought(self) -> bool:
        """Whether some nodes have no named file."""
        return not self.are_known or bool(self._without_file)

    def found_on(self, bus: BusOptions) -> Devices:
        """Return the devices with those of the bus that have a file in the library but no named one.

        Raises LocalError, BusError.
        """
        if not self._are_sought or not self.known_library.entries:
            return self
        from eurobot_od.client.description import scan
        from eurobot_od.client.master import Master

        with Master(bus.open()) as master:
            found = {each.node_id: self.found_description(each) for each in scan(master)}
        wanted = self._without_file or found
        eds = [f"{node_id}={each.file}" for node_id, each in found.items() if each and node_id in wanted]
        written = self._file if self._described.nodes else None
        return replace(self, eds=[*self.eds, *eds], network=self.network or written)

    def found_description(self, found: Found) -> Dictionary | None:
        """Return the library's description of a node, None if there is none; reports problems as `describer`."""
        return self.describer(())(found.node_id, found.numbers)

    def promised(self, decoder: Decoder) -> MessageSet:
        """Return which messages a decoder's devices send, and how often; nothing if a period is missing."""
        from eurobot_od.traffic.load import network_set  # most commands need no analysis
        from eurobot_od.traffic.statistics import NOTHING

        try:
            file = self.network or DEFAULT if self.files() else str(self.robot.dialects.network_file())
            rows = network.read_network(file) if os.path.exists(file) else NetworkFile()  # noqa: PTH110
            names = {each.cob_id: each.name for each in decoder.protocol.bindings}
            return network_set(decoder.dictionaries, names, rows, file)
        except (FileError, LocalError):  # a bus can be watched without periods
            return NOTHING


def is_without_node_id(node: NodeFile) -> bool:
    """Return whether a file can be loaded only with a given node-ID."""
    try:
        node.load()
    except DictionaryError as error:
        return error.what.startswith(NO_NODE_ID)
    return False


def read_words(files: Iterable[str]) -> dict[int, dict[int, str]]:
    """Return texts of error codes by node-ID, 0 for all nodes; raises FileError."""
    found: dict[int, dict[int, str]] = {}
    for file, node_id in (network.node_file(text)[:2] for text in files):
        from eurobot_od.od.maker import read_error_words  # here, as most commands need no YAML

        found.setdefault(node_id or 0, {}).update(read_error_words(file))
    return found


def with_modules(files: list[NodeFile], texts: Iterable[str]) -> list[NodeFile]:
    """Return files with the modules of `--module`; raises LocalError."""
    plugged: dict[int, list[str]] = {}
    for text in texts:
        node, _, listed = text.rpartition("=")
        device = _the_device(files, node, f"--module {text}: say into which device")
        plugged.setdefault(device, []).extend(each.strip() for each in listed.split(","))
    return [each._replace(modules=plugged[n]) if n in plugged else each for n, each in enumerate(files)]


def with_patches(files: list[NodeFile], texts: Iterable[str]) -> list[NodeFile]:
    """Return files with the patches of `--patch`, after those of a network file; raises LocalError."""
    over: dict[int, list[str]] = {}
    for text in texts:
        node, equals, file = text.partition("=")
        if not equals or not _fitting(files, node):  # a path may contain an equals sign
            node = ""
            file = text
        over.setdefault(_the_device(files, node, f"--patch {text}: say of which device"), []).append(file)
    return [each._replace(patch=[*each.patch, *over.get(n, ())]) for n, each in enumerate(files)]


def _the_device(files: Sequence[NodeFile], node: str, question: str) -> int:
    """Return the index of the file with this node-ID, name or stem; raises LocalError if not exactly one fits."""
    fitting = _fitting(files, node)
    if len(fitting) != 1:
        known = ", ".join(f"{each.node_id or each.name or Path(each.file).stem}=" for each in files)
        raise LocalError(f"{question}: {known or 'none is named by --eds or --network'}")
    return fitting[0]


def _fitting(files: Sequence[NodeFile], node: str) -> list[int]:
    return [n for n, each in enumerate(files) if node in ("", str(each.node_id), each.name, Path(each.file).stem)]


def complain_of_repairs(dictionaries: Iterable[Dictionary]) -> None:
    """Report, on one line per file, what had to be repaired, what is left out, and what looks like a copy."""
    # By file, as two nodes may share one.
    for file, each in {each.file: each for each in dictionaries}.items():
        # Guesses first, as the others may be hidden behind "and 4 more".
        changes = sorted(each.normal.deviations, key=lambda change: not change.guessed)
        repaired = [f"line {change.line}: {change.what}" for change in changes]
        lost = [str(refusal) for refusal in each.normal.refusals]
        for done, found, lister in (
            ("repaired to be read", repaired, "lint --fix"),
            (f"{amount(len(lost), 'object')} left out" if len(lost) > 1 else "left out", lost, "lint"),
        ):
            more = f", and {len(found) - 1} more (`{lister}` lists them)" if len(found) > 1 else ""
            if found:
                complain(f"{file}: {done}: {found[0]}{more}")
        if SdoChannel.of(each).usual_for not in (None, each.node_id):  # requests go to another node's SDO server
            complain(f"{file}: {moved_server(each)}")
        if each.idle_modules:
            complain(
                f"{file}: none of its modules is connected; --module takes {', '.join(map(str, each.idle_modules))}"
            )


def completeness(dictionaries: Iterable[Dictionary]) -> ExitStatus:
    """Return FOUND if objects of a file are left out, as the output does not cover the whole device."""
    return ExitStatus.FOUND if any(each.normal.refusals for each in dictionaries) else ExitStatus.FINE


@contextmanager
def left_out() -> Iterator[OnRefused]:
    """Collect PDOs that cannot be used, and report them at the end, one line per file and reason."""
    errors: dict[tuple[str, str], list[MappingError]] = {}

    def collect(error: MappingError) -> None:
        errors.setdefault((error.file, error.what), []).append(error)

    yield collect
    # Several PDOs often have the same problem.
    for (file, what), found in errors.items():
        indices = ", ".join(dict.fromkeys(f"0x{each.index:04X}" for each in found if each.index is not None))
        complain(f"PDO left out: {file}: {f'{indices}: ' if indices else ''}{what}")


def object_names(plugins: Plugins) -> Iterable[str]:
    """Yield the indices of the robot's objects, and those of their names that need no quotes in a shell."""
    dialects = plugins.robot.dialects
    known = dialects.load_all() if dialects.names() else ()
    for each in (each for node in known for each in all_objects(node.objects)):
        yield f"0x{each.index:04X}"
        if re.fullmatch(r"[\w.-]+", each.qualname):
            yield each.qualname


HEARTBEAT_WAIT = 1.2
"""Time to wait for a node's heartbeat, in s; our nodes send one per second."""


@dataclass(frozen=True, kw_only=True)
class Access:
    """How to talk to nodes; `timeout` is in s, `largest` in bytes.

    timeout: longest wait for an answer (500 ms)
    largest: most to read of an object whose size the node does not announce (1048576)
    """

    devices: Devices
    timeout: Wait = 0.5
    largest: Annotated[int, Option(metavar="BYTES", read=whole(1, what="a number of bytes"))] = 1 << 20
    bus: BusOptions

    def master(self) -> Master:
        """Open the bus; the context closes it. Raises LocalError, BusError."""
        from eurobot_od.client.master import Master

        return Master(self.bus.open(), self.timeout, unannounced=self.largest)


INDEX = re.compile(r"0[xX][0-9a-fA-F]{3,}(?::\w+)?")
"""An object's index, with or without its sub-index, where a node stands."""


def hexadecimal_node_id(text: str) -> int | None:
    """Return a node-ID that is written as 0x5 or 5h, None for any other text."""
    number = parse_number(text) if re.fullmatch(r"0[xX][0-9a-fA-F]{1,2}|[0-9][0-9a-fA-F]?[hH]", text) else None
    return number and number.value


@dataclass(frozen=True)
class Target(Access):
    """The node that a command is for.

    node: node-ID 1..127, or a device's name
    """

    node: Annotated[str, Option(metavar="NODE", suggest=lambda plugins: plugins.robot.nodes)]

    @property
    def node_id(self) -> int:
        """The node-ID; raises LocalError, UnknownName."""
        text = self.node
        if (number := hexadecimal_node_id(text)) is not None:
            return check_node_id(number)
        if not text.isdecimal():
            if text.lower().endswith(DEVICE_FILES):
                raise LocalError(
                    f"{text} is a file, not a node: a node-ID 1..127 goes there; --eds names a device's file"
                )
            named = {} if INDEX.fullmatch(text) else self.devices.names()
            if not named:
                raise LocalError(
                    f"{text!r} is not a node-ID 1..127, which comes first, as in `read 5 0x1018`; "
                    "for names there are --eds, --network and --robot"
                )
            return look_up("node", text, named)
        return check_node_id(int((text.lstrip("0") or "0")[:4]))  # `int` raises for thousands of digits

    @contextmanager
    def opened(self) -> Iterator[RemoteNode]:
        """Open the bus and yield the node."""
        number = self.node_id  # first, so that an unknown name opens no bus
        with self.master() as master:
            yield master.node(number)

    def description(self, node: RemoteNode) -> Dictionary | None:
        """Return the node's EDS, None if there is none.

        It is the named file, otherwise a known one for its identity, otherwise the node's own. A file named without a
        node-ID is for this node. The node's own EDS is the last choice, as it has to be uploaded, tens of thousands of
        bytes.
        """
        from eurobot_od.client import description

        named = self.named_description(node)
        if named is not None:
            return named
        dialects = self.devices.robot.dialects
        names = [self.devices.dialect] if self.devices.dialect else dialects.names()
        known = (each for name in names for each in dialects.load_all(name))
        found = description.fitting(node, known) or self._library_description(node) or description.uploaded(node)
        return self.devices.worded(found) if found else None

    def _library_description(self, node: RemoteNode) -> Dictionary | None:
        """Return the library's description of the node; its identity is read only if the library has files."""
        from eurobot_od.client.description import read_numbers

        devices = self.devices
        if not devices.known_library.entries:
            return None
        found = devices.describer(())(node.node_id, read_numbers(node))
        if found is not None:
            complain_of_repairs([found] if found.normal.refusals else ())  # `devices` and `lint` report repairs
            node.master.follow(found)
        return found

    def known_description(self, node: RemoteNode) -> Dictionary | None:
        """Return the named EDS for the node, otherwise the library's; None if there is neither."""
        return self.named_description(node) or self._library_description(node)

    def named_description(self, node: RemoteNode) -> Dictionary | None:
        """Return the EDS that the user has named for the node; None if there is none.

        From then on its file decides on the COB-IDs of its SDO server. If the node's identity is not that of the file,
        this is reported.
        """
        from eurobot_od.client.description import read_numbers
        from eurobot_od.library.library import identity_of

        files = self.devices.files()
        named = files[: len(self.devices.eds)]
        mine = next((each for each in named if each.node_id in (None, node.node_id)), None)
        if mine is None:  # the network's files have to be loaded to know their node-IDs
            mine = next((each for each in files if each.load().node_id == node.node_id), None)
        if mine is None:
            if named:
                others = ", ".join(f"{each.file} is for node {each.node_id}" for each in named)
                complain(f"{others}; node {node.node_id} is read without it")
            return None
        dictionary = self.devices.worded(mine.load(node.node_id))
        complain_of_repairs([dictionary])
        node.master.follow(dictionary)
        with suppress(RemoteError):  # if the node does not answer, the command reports that
            numbers = read_numbers(node)
            self.devices.describer(()).check(node.node_id, identity_of(numbers), dictionary, numbers.get(DEVICE_TYPE))
        return dictionary

    def needed_description(self, node: RemoteNode) -> Dictionary:
        """Return the EDS of the node; raises LocalError if there is none."""
        found = self.description(node)
        if found is None:
            raise LocalError(
                f"no EDS has the identity of node {node.node_id}, and it keeps none itself: name one by --eds, "
                "or put it into your library (`devices add FILE`)"
            )
        return found
