"""The devices of a network: files with node-IDs, a folder of files, or a network file; and their dictionaries.

Every device gets a unique node-ID and name; otherwise loading raises an error that names the file.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path, PurePath, PureWindowsPath
from types import MappingProxyType
from typing import Annotated, NamedTuple

from eurobot_od.errors import DictionaryError, FileError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import parse, read_bytes
from eurobot_od.od.formats import files_in
from eurobot_od.od.maker import MakersUnit, MakersWords, ObjectWords, plain_shapes
from eurobot_od.od.patches import BUS_FILES, NODE_OF_BUS
from eurobot_od.od.standard import UNCONFIGURED
from eurobot_od.od.values import NODE_IDS, Number, parse_number, plain_number
from eurobot_od.support.declared import ByName, OneOrMore, Within
from eurobot_od.support.files import read_whole


def node_file(text: str) -> NodeFile:
    """Parse `FILE` or `NODE-ID=FILE`; raises DictionaryError for an invalid node-ID.

    255 is a device without a node-ID, which only a simulated one can be.
    """
    head, equals, file = text.partition("=")
    number = parse_number(head) if equals else None
    if not Path(text).exists():
        if parse_number(text):
            raise DictionaryError(text, None, f"a node-ID without its file; write {text}=motor.eds")
        if number is None and parse_number(file) and Path(head).is_file():
            raise DictionaryError(text, None, f"the node-ID comes first; write {file}={head}")
    if number is None and (Path(text).exists() or not Path(file).is_file()):
        return NodeFile(text)  # a path may contain an equals sign
    if number is None or number.value not in (*NODE_IDS, UNCONFIGURED):
        raise DictionaryError(file, None, f"node-ID {head} is not in {NODE_IDS[0]}..{NODE_IDS[-1]}")
    return NodeFile(file, number.value)


def read_network(path: str | Path) -> NetworkFile:
    """Read a network: a folder of EDS and DCF files, `nodelist.cpj`, or a YAML file; raises FileError."""
    if Path(path).is_dir():
        # By stem, so that a DCF, which is later, replaces its EDS.
        return NetworkFile([NodeFile(str(each)) for each in {each.stem: each for each in files_in(path)}.values()])
    read = READERS.get(Path(path).suffix.lower())
    if read is None:
        raise FileError(path, f"not a network: neither a folder nor one of {', '.join(READERS)}")
    found = read(read_bytes(path).decode("utf-8", "replace"), str(path))
    if len(found.nodes) > len(NODE_IDS):
        raise FileError(path, f"{len(found.nodes)} nodes, and a network has {len(NODE_IDS)} at most")
    first: dict[int, NodeFile] = {}
    for each in found.nodes:
        if each.node_id is not None and first.setdefault(each.node_id, each) is not each:
            line = getattr(getattr(each.name, "place", None), "line", None)
            said = f"nodes {first[each.node_id].name} and {each.name} both have node-ID {each.node_id}"
            raise FileError(f"{path}:{line}" if line else path, said)
    return found


def is_network(path: str | Path) -> bool:
    """Return whether a path is a network, by its type or suffix."""
    return Path(path).is_dir() or Path(path).suffix.lower() in READERS


def load(nodes: Iterable[NodeFile]) -> tuple[Dictionary, ...]:
    """Load the devices' files, ordered by node-ID; devices with the same name get their node-ID as a suffix.

    Raises DictionaryError as `Dictionary.load`, and for a repeated node-ID.
    """
    files = list(nodes)
    taken = dict[int | None, NodeFile]()
    for each in files:
        if not each.file:
            raise DictionaryError(each.name or f"node {each.node_id}", None, "no file is named for this node")
        first = taken.setdefault(each.node_id, each)
        if first is not each and each.node_id is not None:
            said = f"{first.name}, {Path(first.file).name}" if first.name else Path(first.file).name
            whose = f"{each.name}: " if each.name else ""
            raise DictionaryError(each.file, None, f"{whose}node-ID {each.node_id} is taken by {said}")
    loaded = sorted((each.load() for each in files), key=lambda each: each.node_id)
    # Sorted, so that equal node-IDs are adjacent.
    for one, other in pairwise(loaded):
        if one.node_id == other.node_id:
            raise DictionaryError(other.file, None, f"node-ID {other.node_id} is taken by {one.file.name}")
    counts = Counter(each.name for each in loaded)
    # All devices with the name get a suffix, so that names do not depend on the order of files.
    return tuple(each.named(f"{each.name}_{each.node_id}") if counts[each.name] > 1 else each for each in loaded)


class NodeFile(NamedTuple):
    """A node: its EDS or DCF and, if given, node-ID, name and modules.

    `patch` are files with patches, `emcy` files with texts for its error codes. `units` and `words` are as in a
    device.yaml (see `maker`). In a network file, a node with a node-ID may lack `file`: then the library finds it by
    the node's identity.
    """

    file: str = ""
    node_id: Annotated[int, Within(NODE_IDS[0], NODE_IDS[-1])] | None = None
    name: str = ""
    modules: Sequence[str] | None = None
    patch: Annotated[Sequence[str], OneOrMore()] = ()
    emcy: Annotated[Sequence[str], OneOrMore()] = ()
    units: Mapping[str, MakersUnit] = {}
    words: Mapping[str, ObjectWords] = {}

    def load(self, node_id: int | None = None) -> Dictionary:
        """Load the dictionary, for another node-ID if given; raises as `Dictionary.load`."""
        name = str(self.name)  # without its place in the network file: PyYAML writes no subclasses of str
        with self.told():
            return self.described(Dictionary.load(self.file, node_id or self.node_id, name, self.modules, self.patch))

    @contextmanager
    def told(self) -> Iterator[None]:
        """Add to an error of the file where the network file names it."""
        try:
            yield
        except FileError as error:
            if line := getattr(getattr(self.name, "place", None), "line", None):
                error.add_note(f"it is the file of {self.name}, line {line} of the network file")
            raise

    def described(self, dictionary: Dictionary) -> Dictionary:
        """Return a dictionary with this node's units and texts."""
        if not (self.units or self.words):
            return dictionary
        return dictionary.described_by(MakersWords("network file", {}, self.units, self.words))


class TrafficEntry(NamedTuple):
    """When a message is sent, and its timing requirements, in a network file; empty if not given.

    `every`, `jitter` and `deadline` are durations, or the name of a setting in ms.
    """

    every: str = ""
    answers: str = ""
    jitter: str = ""
    deadline: str = ""
    reason: str = ""


class NetworkBus(NamedTuple):
    """The bus that a network is on: python-can's interface and channel, and the bit rate if it is said."""

    interface: str
    channel: str = ""
    bit_rate: Annotated[int, Within(1, 1000, "kbit/s")] | None = None


class NetworkFile(NamedTuple):
    """A network file: nodes, shared messages, messages by priority, bit rate, periods.

    `robot` is the name of an installed robot (see `plugin`); such a file need not have nodes. `master` is the name of
    the NMT master, a node or a device without a file, such as a PC. `library` are folders of device files for other
    nodes; `emcy` are files with texts for error codes, `dbc` files with names of frames of other protocols. `bus` is
    the bus that the page offers: the last one that it was connected to.
    """

    nodes: Annotated[Sequence[NodeFile], ByName()] = ()
    shared: Sequence[str] = ()
    order: Sequence[str] = ()
    bit_rate: Annotated[int, Within(1, 1000, "kbit/s")] | None = None
    traffic: Mapping[str, TrafficEntry] = MappingProxyType({})
    robot: str = ""
    master: str = ""
    library: Annotated[Sequence[str], OneOrMore()] = ()
    emcy: Annotated[Sequence[str], OneOrMore()] = ()
    dbc: Annotated[Sequence[str], OneOrMore()] = ()
    bus: NetworkBus | None = None

    def beside(self, file: str) -> NetworkFile:
        """Return the network with all paths relative to the folder of the network file."""
        folder = PurePath(file).parent

        def there(paths: Iterable[str]) -> tuple[str, ...]:
            return tuple(str(folder / each) for each in paths)

        nodes = [
            each._replace(
                file=str(folder / each.file) if each.file else "", patch=there(each.patch), emcy=there(each.emcy)
            )
            for each in self.nodes
        ]
        library, emcy, dbc = map(there, (self.library, self.emcy, self.dbc))
        return self._replace(nodes=nodes, library=library, emcy=emcy, dbc=dbc)


NODE_KEY = re.compile(r"node(\d{1,3})(?:present|name|dcfname)")


def read_nodelist(text: str, file: str) -> NetworkFile:
    """Parse the first network in a nodelist; `file` is its path. Raises DictionaryError."""
    topology = parse(text).sections.get("topology")
    if topology is None:
        raise DictionaryError(file, None, "not a nodelist: it has no [Topology]")
    # A node may have any of its keys; without `present` it is present.
    numbers = dict.fromkeys(int(match[1]) for key in topology.entries if (match := NODE_KEY.fullmatch(key)))
    nodes = []
    for number in numbers:
        if parse_number(topology.text(f"node{number}present")) == Number(0):
            continue
        dcf = topology.text(f"node{number}dcfname")
        eds = topology.text("edsbasename")
        if not dcf and not eds:
            raise DictionaryError(file, None, f"line {topology.line}: node {number} has no Node{number}DCFName")
        path = PurePath(file).parent / PureWindowsPath(dcf)  # both kinds of slashes occur
        if eds and not (dcf and Path(path).is_file()):
            # CanFestival and Beremiz have the node's EDS in a folder of all EDS files.
            path = PurePath(file).parent / PureWindowsPath(eds) / (dcf or f"{topology.text(f'node{number}name')}.eds")
        nodes.append(NodeFile(str(path), number, topology.text(f"node{number}name")))
    return NetworkFile(nodes)


def not_understood(path: str | Path) -> Sequence[str]:
    """Return a line for each unknown key of a bus file; raises as `read_network`."""
    if Path(path).suffix.lower() not in BUS_FILES:
        return ()
    from eurobot_od.od import bus_file  # most start without YAML

    text = read_whole(path).decode("utf-8", "replace")
    return bus_file.read_bus(text, str(path)).unread if bus_file.is_bus(text) else ()


def read_network_file(text: str, file: str) -> NetworkFile:
    """Parse a network file; `file` is its path. Raises YamlError, or FileError if it has no nodes.

    It may also be a bus file of dcfgen or ros2_canopen (see `bus_file`).
    """
    from eurobot_od.od import bus_file  # most start without YAML
    from eurobot_od.support.yaml_shapes import PLAIN, SCALAR, converted, read_yaml, shape_of

    if bus_file.is_bus(text):
        bus = bus_file.read_bus(text, file)
        named = ((each, f"{file}{NODE_OF_BUS}{each.name}") for each in bus.nodes)
        nodes = [NodeFile(str(each.file), each.node_id, each.name, patch=(patch,)) for each, patch in named]
        return NetworkFile(nodes, bit_rate=bus.bit_rate, master=bus_file.MASTER)
    number = replace(converted(SCALAR, plain_number), whole=True)
    network: NetworkFile = read_yaml(
        text, shape_of(NetworkFile, {**PLAIN, **plain_shapes(), str: SCALAR, int: number}), file
    )
    if not (network.nodes or network.robot or network.library):
        raise FileError(file, "it names no nodes")
    unclear = [each.name for each in network.nodes if not each.file and each.node_id is None]
    if unclear:
        raise FileError(file, f"node {unclear[0]} has neither `file` nor `node_id`")
    return network.beside(file)


BUS_KEY = re.compile(r"^bus:.*\n?(?:[ \t]+.*\n?)*", re.MULTILINE)


def with_bus(text: str, bus: NetworkBus) -> str:
    """Return the text of a network file that says a bus, in one line; all else stays as it is written."""
    said = {name: value for name, value in bus._asdict().items() if value}
    line = f"bus: {json.dumps(said, ensure_ascii=False)}\n"
    if BUS_KEY.search(text):
        return BUS_KEY.sub(lambda _: line, text, count=1)
    return f"{text}{'' if text.endswith(chr(10)) or not text else chr(10)}{line}"


READERS = {**dict.fromkeys(BUS_FILES, read_network_file), ".cpj": read_nodelist}
"""Parsers of network files by suffix."""
