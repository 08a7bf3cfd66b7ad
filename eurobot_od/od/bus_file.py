"""Bus files, `bus.yml` of dcfgen (dcf-tools) and ros2_canopen: the nodes of a network and their configuration.

    master: {node_id: 1, sync_period: 10000}
    drive: {node_id: 2, dcf: drive.eds, heartbeat_producer: 500, sdo: [{index: 0x6081, sub_index: 0, value: 1000}]}

A node's entries become a patch of its file: the values that dcfgen's master would write, in its order, so that the last
one of an object applies. As in ros2_canopen, `defaults` override the entries of nodes below `nodes`. Keys about a
program, such as a node's driver, are ignored; `unread` lists keys that neither program documents.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import yaml

from eurobot_od.errors import DictionaryError, LocalError, YamlError
from eurobot_od.od import standard, values
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.document import read_bytes
from eurobot_od.od.formats import completed, read
from eurobot_od.od.values import Address, PdoDirection, label, parse_number
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_places import START, PlacedText, Problem, Problems, compose, place_of, telling
from eurobot_od.support.yaml_shapes import SCALAR

Tree: TypeAlias = "PlacedText | list[Any] | dict[PlacedText, Any]"

FOLDER = "@BUS_CONFIG_PATH@"
"""ros2_canopen's placeholder for the file's folder."""

OPTIONS, MASTER, DEFAULTS, NODES = "options", "master", "defaults", "nodes"

OBJECTS = {
    "time_cob_id": standard.TIME,
    "heartbeat_producer": standard.HEARTBEAT_TIME,
    "guard_time": standard.GUARD_TIME,
    "life_time_factor": standard.LIFE_TIME_FACTOR,
}
"""Keys of a node for the value of one object."""

PDO_KEYS: Mapping[str, int] = {
    "transmission": values.TRANSMISSION_TYPE,
    "inhibit_time": values.INHIBIT_TIME,
    "event_timer": values.EVENT_TIMER,
    "event_deadline": values.EVENT_TIMER,
    "sync_start": 6,
}
"""Sub-indices of the communication record by the keys of a PDO."""

FREE_COB_IDS = 0x680
"""First identifier that `auto` assigns to PDOs from the fifth on."""

HEARTBEAT_MULTIPLIER = 3.0

ELSEWHERE = frozenset((
    "dcf_path", "revision_number", "serial_number", "heartbeat_multiplier", "heartbeat_consumer", "retry_factor",
    "boot", "mandatory", "reset_communication", "software_file", "software_version", "restore_configuration",
    "configuration_file", "driver", "package", "namespace", "period", "enable_lazy_load", "polling", "diagnostics",
    "boot_timeout", "boot_timeout_ms", "sdo_timeout_ms", "vendor_id", "product_code", "baudrate", "baud_rate",
    "sync_period", "sync_window", "sync_overflow", "emcy_inhibit_time", "error_behavior", "nmt_inhibit_time",
    "start", "start_nodes", "start_all_nodes", "reset_all_nodes", "stop_all_nodes", "boot_time", "container_name",
    "position_mode", "velocity_mode", "scale_pos_to_dev", "scale_pos_from_dev", "scale_vel_to_dev",
    "scale_vel_from_dev", "offset_pos_to_dev", "offset_pos_from_dev", "switching_state", "homing_timeout_seconds",
    "options",
))  # fmt: skip
"""Keys for the master or a driver, which do not affect the device."""

READ = frozenset({"node_id", "dcf", "sdo", "tpdo", "rpdo", *OBJECTS})


class BusWrite(NamedTuple):
    """A value that the master writes, and its line in the file."""

    address: Address
    value: int
    line: int


class BusNode(NamedTuple):
    """A node: its `name`, its entries, and its `file`."""

    name: PlacedText
    said: Mapping[str, Any]
    file: Path

    @property
    def node_id(self) -> int:
        """The node-ID."""
        return number(self.said["node_id"])


class BusFile(NamedTuple):
    """A bus file: entries of the master, options, nodes, and lines about unknown keys in `unread`."""

    file: str
    master: Mapping[str, Any]
    options: Mapping[str, Any]
    nodes: tuple[BusNode, ...]
    unread: tuple[str, ...]

    @property
    def bit_rate(self) -> int | None:
        """Bit rate in kbit/s, None if it is not given."""
        said = self.master.get("baudrate", self.master.get("baud_rate"))
        return None if said is None else number(said)

    def writes(self, name: str) -> tuple[BusNode, list[BusWrite]]:
        """Return a node and the values that the master writes to it; raises LocalError, DictionaryError."""
        free = count(FREE_COB_IDS)
        for node in self.nodes:
            found = list(_Configuration(self, node, free).writes())
            if node.name == name:
                return node, found
        raise LocalError(f"{self.file}: no node {name}")


def number(said: Tree) -> int:
    """Parse a whole number; raises LocalError."""
    found = parse_number(said) if isinstance(said, str) else None
    if found is None or found.relative:
        raise LocalError(f"{said if isinstance(said, str) else 'a list or mapping'!r} is not a whole number")
    return found.value


def is_bus(text: str) -> bool:
    """Return whether YAML is a bus file; unlike in our network file, its master is a mapping."""
    with suppress(YamlError), telling("") as problems:
        root = compose(text, problems)
        pairs = root.value if isinstance(root, yaml.MappingNode) else ()
        return any(key.value == MASTER and isinstance(value, yaml.MappingNode) for key, value in pairs)
    return False


def read_bus(text: str, file: str) -> BusFile:
    """Parse a bus file; raises YamlError."""
    with telling(file) as problems:
        tree = _tree(compose(text, problems), problems)
        return _bus(tree if isinstance(tree, dict) else {}, file, problems)


def load_bus(file: str | Path) -> BusFile:
    """Read a bus file; raises FileError, YamlError."""
    return read_bus(read_whole(file).decode("utf-8", "replace"), str(file))


def _tree(node: yaml.Node, problems: Problems) -> Tree:
    """Return a node as mappings, lists and texts; `<<` merges another mapping, as in YAML 1.1."""
    if isinstance(node, yaml.SequenceNode):
        return [_tree(each, problems) for each in node.value]
    if not isinstance(node, yaml.MappingNode):
        is_text = isinstance(node, yaml.ScalarNode) and node.value
        return SCALAR.read(node, problems) if is_text else PlacedText("", place_of(node.start_mark))
    merged: dict[PlacedText, Any] = {}
    own: dict[PlacedText, Any] = {}
    for key, value in node.value:
        if key.value == "<<":
            several = value.value if isinstance(value, yaml.SequenceNode) else [value]
            for each in (_tree(one, problems) for one in reversed(several)):
                merged |= each if isinstance(each, dict) else {}
            continue
        name = PlacedText(str(key.value), place_of(key.start_mark))
        if name in own:
            problems.append(Problem(name.place, f"key {name!s} is given twice"))
        own[name] = _tree(value, problems)
    return merged | own


def _bus(tree: Mapping[Any, Any], file: str, problems: Problems) -> BusFile:
    folder = Path(file).parent
    nodes: list[BusNode] = []
    unread: list[str] = []
    options, master, defaults = (_mapping(tree.get(each, {})) for each in (OPTIONS, MASTER, DEFAULTS))
    below = _mapping(tree.get(NODES, {}))
    beside = {name: said for name, said in tree.items() if name not in (OPTIONS, MASTER, DEFAULTS, NODES)}
    for name, own in [*beside.items(), *below.items()]:
        if name.startswith("."):  # dcfgen's keys for anchors
            continue
        said = {**_mapping(own), **(defaults if name in below else {})}
        for key in ("node_id", "dcf"):
            if key not in said:
                problems.append(Problem(name.place, f"{name} has no {key}"))
        path = str(said.get("dcf", "")).replace(FOLDER, str(folder))
        nodes.append(BusNode(name, said, folder / path))
    for each in (master, defaults, *(_mapping(node) for node in (*beside.values(), *below.values()))):
        unread += (f"{file}:{key.place.line}: {key} is not understood" for key in each if key not in READ | ELSEWHERE)
    if not nodes:
        problems.append(Problem(START, "it names no nodes"))
    return BusFile(file, master, options, tuple(nodes), tuple(unread))


def _mapping(said: Tree) -> dict[Any, Any]:
    return said if isinstance(said, dict) else {}


def bus_text(nodes: Mapping[str, tuple[int, str, Sequence[tuple[Address, int]]]], bit_rate: int | None) -> str:
    """Return a bus file for dcfgen: each node by name, with node-ID, file and values to write.

    The master gets the highest free node-ID.
    """
    taken = {node_id for node_id, _, _ in nodes.values()}
    free = next(each for each in reversed(values.NODE_IDS) if each not in taken)
    rate = f"  baudrate: {bit_rate}\n" if bit_rate else ""
    parts = [f"{MASTER}:\n  node_id: {free}\n{rate}"]
    for name, (node_id, file, writes) in nodes.items():
        quoted = file.replace("'", "''")
        entries = "".join(
            f"    - {{index: 0x{index:04X}, sub_index: {sub}, value: {value}}}\n" for (index, sub), value in writes
        )
        sdo = f"  sdo:\n{entries}" if entries else ""
        parts.append(f"{name}:\n  node_id: {node_id}\n  dcf: '{quoted}'\n{sdo}")
    return "\n".join(parts)


class _Configuration:
    """The configuration of one node."""

    def __init__(self, bus: BusFile, node: BusNode, free: Iterator[int]) -> None:
        self._bus, self._node, self._free = bus, node, free
        self._device = DescribedDevice(completed(read(read_bytes(node.file))))

    def writes(self) -> Iterator[BusWrite]:
        """Yield the values to write in dcfgen's order."""
        said = self._node.said
        yield from self._heartbeat_of_the_master()
        for key, address in OBJECTS.items():
            if key in said:
                yield BusWrite(address, number(said[key]), said[key].place.line)
        for sub, value in _mapping(said.get("error_behavior", {})).items():
            yield BusWrite((0x1029, number(sub)), number(value), value.place.line)
        for key, direction in (("rpdo", PdoDirection.RPDO), ("tpdo", PdoDirection.TPDO)):
            for each, settings in _mapping(said.get(key, {})).items():
                yield from self._pdo(direction, number(each) - 1, _mapping(settings), each.place.line)
        for entry in said.get("sdo", ()):
            value = entry.get("value", PlacedText("0", self._node.name.place))
            yield BusWrite(self._address(entry), number(value), value.place.line)

    def _heartbeat_of_the_master(self) -> Iterator[BusWrite]:
        """Yield the entry of 0x1016 for the master's heartbeat, if both sides ask for it: an old one, or a free one."""
        said, master = self._node.said, self._bus.master
        multiplier = master.get("heartbeat_multiplier", self._bus.options.get("heartbeat_multiplier"))
        factor = HEARTBEAT_MULTIPLIER if multiplier is None else float(multiplier)
        period = int(number(master["heartbeat_producer"]) * factor) if "heartbeat_producer" in master else 0
        if said.get("heartbeat_consumer", "false").lower() not in ("true", "yes", "on", "1") or not period:
            return
        own = number(master["node_id"]) if "node_id" in master else 0xFF
        entries = self._device.objects.get(0x1016)
        variables = entries.variables() if entries else ()
        subs = [(each.sub, each.value.value if each.value else 0) for each in variables]
        mine = [sub for sub, value in subs if sub and value >> 16 & 0xFF == own]
        free = [sub for sub, value in subs if sub and (not value & 0xFFFF or not 0 < value >> 16 & 0xFF < 0x80)]
        for sub in (mine or free)[:1]:
            yield BusWrite((0x1016, sub), own << 16 | period & 0xFFFF, said["heartbeat_consumer"].place.line)

    def _pdo(self, direction: PdoDirection, place: int, said: Mapping[str, Any], line: int) -> Iterator[BusWrite]:
        index = direction.value + place
        cob_id = self._cob_id(direction, index, place, said)
        yield BusWrite((index, values.COB_ID), cob_id | values.NOT_VALID, line)
        if cob_id & values.NOT_VALID:
            return
        for key, sub in PDO_KEYS.items():
            if key in said:
                yield BusWrite((index, sub), number(said[key]), said[key].place.line)
        mapping = index + values.MAPPING_OFFSET
        for sub, each in enumerate(said.get("mapping", ()), start=1):
            address = self._address(each)
            variable = self._device.variable(*address)
            bits = variable.type.bits if variable and variable.type else 0
            if not bits:
                what = f"{label(address)} is not an object of {self._node.file.name} that can be mapped"
                raise DictionaryError(f"{self._bus.file}:{each['index'].place.line}", None, what)
            yield BusWrite((mapping, sub), values.MappingEntry(*address, bits).number, each["index"].place.line)
        if "mapping" in said:
            yield BusWrite((mapping, 0), len(said["mapping"]), line)
        if said.get("enabled", "true").lower() not in ("false", "no", "off"):
            yield BusWrite((index, values.COB_ID), cob_id, line)

    def _cob_id(self, direction: PdoDirection, index: int, place: int, said: Mapping[str, Any]) -> int:
        wanted = said.get("cob_id")
        if wanted is None:
            default = self._device.value(index, values.COB_ID)
            return default.at(self._node.node_id) if default else values.NOT_VALID
        if wanted != "auto":
            return number(wanted)
        bases = values.DEFAULT_PDO_BASES[direction]
        return bases[place] + self._node.node_id if place < len(bases) else next(self._free)

    def _address(self, entry: Mapping[str, Any]) -> Address:
        return number(entry.get("index", PlacedText("", self._node.name.place))), number(entry.get("sub_index", "0"))
