"""The network view: the files of all nodes together, every identifier with its producers and consumers.

A network is data (nodes, declared shares, declared order of priorities); its rules are a table like those for one file.
The place of a finding is the PDO or value that has to change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, TypeAlias

from eurobot_od.lint.file_rules import bit_rates
from eurobot_od.lint.findings import Finding, Located, Rule, Rules
from eurobot_od.lint.model import TOP, LintedDevice
from eurobot_od.lint.object_rules import heartbeats
from eurobot_od.od import values
from eurobot_od.od.description import DescribedRecords
from eurobot_od.od.document import BIT_RATES
from eurobot_od.od.standard import SYNC, SYNC_PRODUCER
from eurobot_od.od.values import Number, PdoDirection, owner

RULES = Rules()

DEFAULT_PDOS = tuple(each for each in values.PREDEFINED if "PDO" in each.owner)
"""The ranges of the PDOs in the pre-defined connection set."""


class NetworkNode(NamedTuple):
    """A device in the network: its name, file and node-ID (0: not known), and whether that is only a guess."""

    name: str
    file: str
    device: LintedDevice
    node_id: int = 0
    is_guess: bool = False

    def spot(self, at: Located = TOP) -> Spot:
        """Return a place of its file."""
        return Spot(self.file, at.line or TOP.line, at.column)  # what a patch adds has no line in the file

    def services(self) -> Iterator[tuple[int, str, Spot]]:
        """Yield the identifiers of its services other than PDOs; SYNC and TIME are the network's."""
        top = self.spot()
        for each in (each for each in values.RESTRICTED if each.is_per_node):
            yield each.low + self.node_id - 1, f"{each.owner.removeprefix('the ')} of {self.name}", top
        for index, name in ((0x1005, "SYNC"), (0x1012, "TIME"), (0x1014, f"EMCY of {self.name}")):
            variable = self.device.variable(index)
            value = variable.value.at(self.node_id) if variable and variable.value else None
            # Bit 31 of 0x1014 is "not valid"; in 0x1005 it means nothing, in 0x1012 "consumes TIME".
            if variable and value is not None and (index != 0x1014 or not value & values.NOT_VALID):
                yield value & values.BASE_IDENTIFIER, name, self.spot(variable.place)
        section = self.device.section("deviceinfo")
        if section and section.text("lss_supported") == "1":
            yield from ((each, "LSS", self.spot(section.at("lss_supported"))) for each in values.LSS_COB_IDS)


class Spot(NamedTuple):
    """A place in one of the files, both numbers from 1."""

    file: str
    line: int
    column: int


Conflicts: TypeAlias = Iterator[tuple[Spot, str]]
"""Places where a rule of the network does not hold, and what is wrong there in one sentence."""


class Endpoint(NamedTuple):
    """One end of a PDO in a network: the node, its records, and the identifier that they give."""

    node: NetworkNode
    pdo: DescribedRecords
    identifier: int

    @property
    def name(self) -> str:
        """Name it: core TPDO 3."""
        return f"{self.node.name} {self.pdo.title}"

    @property
    def size(self) -> int:
        """Return how many bytes it carries."""
        return (self.pdo.bits + 7) // 8

    @property
    def is_predefined(self) -> bool:
        """Whether its identifier is made from the node-ID, or is just its own default one."""
        value = self.pdo.value(1)
        return (value is not None and value.relative) or self.identifier - self.node.node_id == self.pdo.default_base

    @property
    def spot(self) -> Spot:
        """Return where its identifier stands."""
        return _spot(self.node, self.pdo, 1)

    @property
    def mapping_spot(self) -> Spot:
        """Return where its number of mapped objects stands."""
        zero = self.pdo.entry(0)
        return self.node.spot(zero.place) if zero else self.spot

    @property
    def layout(self) -> tuple[tuple[str, int], ...]:
        """Return the name (empty for padding) and the bits of every mapped object."""
        found = ((each, self.node.device.variable(*each.address)) for each, _ in self.pdo.mapped())
        return tuple((variable.name if variable else "", each.bits) for each, variable in found)


def _spot(node: NetworkNode, pdo: DescribedRecords, sub: int) -> Spot:
    where = pdo.setting(sub) or pdo.communication or pdo.mapping
    return node.spot(where.place if where else TOP)


@dataclass(frozen=True)
class LintedNetwork:
    """All nodes, and what is declared for them: messages with several senders, priorities, the bit rate."""

    nodes: Sequence[NetworkNode]
    shared: Sequence[str] = ()
    order: Sequence[str] = ()
    bit_rate: int | None = None
    master: str = ""

    @property
    def has_foreign_master(self) -> bool:
        """Whether the network's master is not one of its nodes but, say, a PC: no file says what it sends."""
        return bool(self.master) and self.master not in {each.name for each in self.nodes}

    @cached_property
    def node_ids(self) -> dict[int, NetworkNode]:
        """The nodes by node-ID; of two with one node-ID the first."""
        return {each.node_id: each for each in reversed(self.nodes)}

    @cached_property
    def producers(self) -> dict[int, list[Endpoint]]:
        """The valid TPDOs by identifier."""
        return self._ports(PdoDirection.TPDO)

    @cached_property
    def consumers(self) -> dict[int, list[Endpoint]]:
        """The valid RPDOs by identifier."""
        return self._ports(PdoDirection.RPDO)

    def _ports(self, direction: PdoDirection) -> dict[int, list[Endpoint]]:
        found: dict[int, list[Endpoint]] = {}
        for node in self.nodes:
            for pdo in node.device.pdos:
                identifier = pdo.identifier(node.node_id) if pdo.direction is direction else None
                if identifier is not None:
                    found.setdefault(identifier, []).append(Endpoint(node, pdo, identifier))
        return found

    @cached_property
    def identifiers(self) -> list[int]:
        """All identifiers that PDOs have, the highest priority first."""
        return sorted({*self.producers, *self.consumers})

    def ports(self, identifier: int) -> list[Endpoint]:
        """Return producers, then consumers of an identifier."""
        return self.producers.get(identifier, []) + self.consumers.get(identifier, [])

    def title(self, identifier: int) -> str:
        """Return what the PDOs of an identifier are called, all names if they differ."""
        return " / ".join(dict.fromkeys(each.pdo.name for each in self.ports(identifier) if each.pdo.name))

    def is_shared(self, identifier: int) -> bool:
        """Return whether an identifier may have several producers.

        That is declared in the network file, by name; or by the EDS files themselves: each producer and each consumer
        calls it by the same name, and it carries no data, so that equal frames merge instead of destroying each other.
        """
        ports = self.ports(identifier)
        names = {each.pdo.name for each in ports}
        if names.intersection(self.shared):
            return True
        is_heard = len(self.consumers.get(identifier, ())) > 0
        return is_heard and len(names) == 1 and "" not in names and all(each.pdo.bits == 0 for each in ports)

    @cached_property
    def services(self) -> dict[int, list[tuple[str, Spot]]]:
        """Identifiers of other services than PDOs in use, with what they are and where that is said."""
        found: dict[int, list[tuple[str, Spot]]] = {0: [("NMT", self.nodes[0].spot())]} if self.nodes else {}
        for node in self.nodes:
            for identifier, name, place in node.services():
                found.setdefault(identifier, []).append((name, place))
        return found


def nodes_of(nodes: Sequence[NetworkNode]) -> list[NetworkNode]:
    """Give nodes without a node-ID that of their files, or else the next free one."""
    declared = [each.node_id or own_node_id(each.device) for each in nodes]
    # With more than 127 devices the numbers run out: then all of the rest get 1, and E816 says so.
    free = iter(number for number in values.NODE_IDS if number not in declared)
    return [
        each._replace(node_id=number or next(free, values.NODE_IDS[0]), is_guess=number is None)
        for each, number in zip(nodes, declared)
    ]


def own_node_id(device: LintedDevice) -> int | None:
    """Return the node-ID a DCF commissions, or the value of the device's own setting of that name; None without."""
    if device.node_id:
        return device.node_id
    own = device.own_node_id
    number = own.value if own else None
    return number.value if number and not number.relative and number.value in values.NODE_IDS else None


# Producers and consumers


@RULES.rule("E801", "CiA 301, PDO")
def two_producers(network: LintedNetwork) -> Conflicts:
    """An identifier has one producer, unless it is declared as shared."""
    for identifier, (first, *others) in network.producers.items():
        for each in others if not network.is_shared(identifier) else ():
            yield each.spot, f"{each.name} sends 0x{identifier:03X}, which {first.name} sends too"


@RULES.rule("I802", "declared in the network file, or by the EDS files' names")
def declared_producers(network: LintedNetwork) -> Conflicts:
    """A shared identifier is declared."""
    for identifier, (first, *others) in network.producers.items():
        if others and network.is_shared(identifier):
            names = " and ".join(each.name for each in (first, *others))
            how = "the network file" if first.pdo.name in network.shared else "one name everywhere and no data"
            yield first.spot, f"0x{identifier:03X} {first.pdo.name}: sent by {names}, declared by {how}"


MASTER_HINT = "; if a PC does, say so: `master: PC` in the network file"


@RULES.rule("W803", "CiA 301, PDO")
def without_producer(network: LintedNetwork) -> Conflicts:
    """A message that is received is sent by a node, or by a master without a file (`master:` of the network file)."""
    for identifier, ports in network.consumers.items() if not network.has_foreign_master else ():
        for each in ports if identifier not in network.producers else ():
            yield each.spot, f"{each.name} waits for 0x{identifier:03X}, which no node sends{MASTER_HINT}"


@RULES.rule("W804", "CiA 301, PDO")
def without_consumer(network: LintedNetwork) -> Conflicts:
    """A message that is sent is received by a node, or by a master without a file (`master:` of the network file)."""
    for identifier, ports in network.producers.items() if not network.has_foreign_master else ():
        for each in ports if identifier not in network.consumers else ():
            yield each.spot, f"{each.name} sends 0x{identifier:03X}, which no node receives{MASTER_HINT}"


@RULES.rule("I805", "CiA 301, object 0x1400 sub 1, bit 31")
def switched_off(network: LintedNetwork) -> Conflicts:
    """An RPDO for a message that is sent is valid."""
    for node in network.nodes:
        for pdo in node.device.pdos:
            value = pdo.value(1)
            identifier = value.at(node.node_id) & values.BASE_IDENTIFIER if value else 0
            is_off = pdo.direction is PdoDirection.RPDO and value and value.value & values.NOT_VALID
            if is_off and identifier in network.producers:
                text = f"{node.name} {pdo.title} could receive 0x{identifier:03X}, but is not valid until configured"
                yield _spot(node, pdo, 1), text


def _pairs(network: LintedNetwork) -> Iterator[tuple[Endpoint, Endpoint]]:
    """Yield every producer with every consumer of its identifier."""
    for identifier, ports in network.producers.items():
        for producer in ports:
            yield from ((producer, consumer) for consumer in network.consumers.get(identifier, ()))


@RULES.rule("E806", "CiA 301, RPDO length (EMCY 8210)")
def too_short(network: LintedNetwork) -> Conflicts:
    """A consumer expects no more bytes than are sent."""
    for producer, consumer in _pairs(network):
        if producer.size < consumer.size:
            yield consumer.mapping_spot, f"{_lengths(producer, consumer)}: not processed (EMCY 8210)"


@RULES.rule("W807", "CiA 301, RPDO length (EMCY 8220)")
def too_long(network: LintedNetwork) -> Conflicts:
    """A consumer expects all bytes that are sent."""
    for producer, consumer in _pairs(network):
        if producer.size > consumer.size:
            yield consumer.mapping_spot, f"{_lengths(producer, consumer)}: the rest is lost (EMCY 8220)"


def _lengths(producer: Endpoint, consumer: Endpoint) -> str:
    return f"{consumer.name} expects {consumer.size} bytes, {producer.name} sends {producer.size}"


@RULES.rule("E810", "CiA 301, PDO mapping")
def other_order(network: LintedNetwork) -> Conflicts:
    """Producer and consumer map objects of the same names in the same order."""
    for producer, consumer in _pairs(network):
        names = [[name for name, _ in port.layout if name] for port in (producer, consumer)]
        # Only of the same names: another maker's device may call the same values by other ones.
        if names[0] != names[1] and sorted(names[0]) == sorted(names[1]):
            yield consumer.mapping_spot, f"{consumer.name} maps the objects in another order than {producer.name}"


@RULES.rule("W811", "CiA 301, PDO mapping")
def other_bits(network: LintedNetwork) -> Conflicts:
    """Producer and consumer cut the data at the same bits."""
    for producer, consumer in _pairs(network):
        bits = [[length for _, length in port.layout] for port in (producer, consumer)]
        if bits[0] != bits[1] and producer.size == consumer.size:  # else E806 or W807 has said it
            yield consumer.mapping_spot, f"{consumer.name} takes {bits[1]} bits, {producer.name} sends {bits[0]}"


# Identifiers and priorities


@RULES.rule("E808", "CiA 301, pre-defined connection set")
def service_identifiers(network: LintedNetwork) -> Conflicts:
    """No PDO has the identifier of another service in use."""
    for identifier in network.identifiers:
        for name, _ in network.services.get(identifier, [])[:1]:
            ports = network.ports(identifier)
            yield from ((each.spot, f"{each.name} has 0x{identifier:03X}, the {name}") for each in ports)


@RULES.rule("I809", "CiA 301, pre-defined connection set and restricted CAN-IDs")
def unused_service_identifiers(network: LintedNetwork) -> Conflicts:
    """A custom identifier is outside the ranges of other services."""
    for identifier, ports in network.producers.items():
        found = owner(identifier, values.RESERVED + values.PREDEFINED)
        is_free = identifier not in network.services and not any(each.is_predefined for each in ports)
        # W827 says it if the node is in the network that has this identifier by default
        if found and is_free and found.node_id(identifier) not in network.node_ids:
            what = f"0x{identifier:03X} {ports[0].pdo.name} belongs to {found.whose(identifier)}"
            yield ports[0].spot, f"{what}, which is not in the network"


@RULES.rule("W827", "CiA 301, pre-defined connection set")
def default_of_other_node(network: LintedNetwork) -> Conflicts:
    """A custom identifier is not a default PDO of a node in the network."""
    for identifier, ports in network.producers.items():
        found = owner(identifier, DEFAULT_PDOS)
        node = network.node_ids.get(found.node_id(identifier) or 0) if found else None
        if found and node and not any(each.is_predefined for each in ports):
            text = f"{ports[0].name} has 0x{identifier:03X}, {found.owner} of {node.name} before it is configured"
            yield ports[0].spot, text


@RULES.rule("E812", "CiA 301, pre-defined connection set")
def double_services(network: LintedNetwork) -> Conflicts:
    """Different services have different identifiers."""
    for identifier, entries in network.services.items():
        names = dict.fromkeys(name for name, _ in entries)
        if len(names) > 1:
            yield entries[-1][1], f"0x{identifier:03X} is {' and '.join(names)} at once"


@RULES.rule("W813", "CAN: the lower identifier wins")
def declared_order(network: LintedNetwork) -> Conflicts:
    """Identifiers follow the declared order of priorities."""
    known = {each.pdo.name: each for ports in network.producers.values() for each in ports}
    for before, after in pairwise([known[name] for name in network.order if name in known]):
        if after.identifier < before.identifier:
            yield after.spot, f"{after.pdo.name} (0x{after.identifier:03X}) wins against {before.pdo.name}"


@RULES.rule("W814", "the network file")
def not_in_order(network: LintedNetwork) -> Conflicts:
    """The declared order of priorities names messages that are sent."""
    known = {each.pdo.name for ports in network.producers.values() for each in ports}
    for name in network.order:
        if name not in known:
            yield network.nodes[0].spot(), f"{name} is in the order of priorities, but nobody sends it"


@RULES.rule("I815", "custom")
def numbering(network: LintedNetwork) -> Conflicts:
    """A node's TPDOs are numbered in the order of their priorities."""
    for node in network.nodes:
        own = [each for ports in network.producers.values() for each in ports if each.node is node]
        for before, after in pairwise(sorted(own, key=lambda each: each.pdo.number)):
            if after.identifier < before.identifier:
                yield after.spot, f"{after.name} has a higher priority than {before.pdo.title} before it"


# Nodes, error control, SYNC, bit rate


@RULES.rule("E816", "CiA 301, node-ID")
def same_node_id(network: LintedNetwork) -> Conflicts:
    """Every node has a node-ID of its own."""
    for each in network.nodes:
        first = network.node_ids[each.node_id]
        if first is not each:
            yield each.spot(), f"{each.name} has node-ID {each.node_id}, as {first.name} has"


@RULES.rule("I817", "CiA 306, [DeviceComissioning]")
def guessed_node_id(network: LintedNetwork) -> Conflicts:
    """The file or the network file says the node-ID."""
    for each in network.nodes:
        if each.is_guess:
            yield each.spot(), f"nothing says the node-ID of {each.name}; taken as {each.node_id}"


def _watches(network: LintedNetwork) -> Iterator[tuple[Spot, str, int, int, NetworkNode | None]]:
    """Yield every consumer heartbeat time: its place, whose it is, the node-ID watched, the time in ms, that node."""
    for node in network.nodes:
        for variable, node_id, time in heartbeats(node.device):
            yield node.spot(variable.place), node.name, node_id, time, network.node_ids.get(node_id)


def _heartbeat(node: NetworkNode) -> int:
    return (node.device.value(0x1017) or Number(0)).value


@RULES.rule("E818", "CiA 301, objects 0x1016 and 0x1017")
def impatient(network: LintedNetwork) -> Conflicts:
    """A heartbeat consumer waits longer than the producer's period."""
    for place, name, _, time, watched in _watches(network):
        # Equal is too short as well: the next heartbeat may come a little late.
        if watched and time <= _heartbeat(watched):
            yield place, f"{name} waits {time} ms for {watched.name}, which sends every {_heartbeat(watched)} ms"


@RULES.rule("W819", "CiA 301, object 0x1016")
def nobody_to_watch(network: LintedNetwork) -> Conflicts:
    """A heartbeat consumer waits for a node of the network."""
    for place, name, node_id, _, watched in _watches(network):
        if watched is None:
            yield place, f"{name} waits for the heartbeat of node {node_id}, which is not in the network"


@RULES.rule("W820", "CiA 301, objects 0x1016 and 0x1017")
def silent(network: LintedNetwork) -> Conflicts:
    """A heartbeat consumer waits for a heartbeat that is sent."""
    for place, name, _, _, watched in _watches(network):
        if watched and not _heartbeat(watched):
            yield place, f"{name} waits for the heartbeat of {watched.name}, which sends none"


@RULES.rule("E821", "CiA 306, [DeviceInfo]")
def no_common_bit_rate(network: LintedNetwork) -> Conflicts:
    """All nodes have a bit rate in common."""
    rates = [bit_rates(each.device) for each in network.nodes]
    if rates and not set(BIT_RATES).intersection(*rates):
        last = network.nodes[-1]
        yield last.spot(last.device.at("deviceinfo", "baudrate_10")), "no bit rate is common to all nodes"


@RULES.rule("E822", "CiA 306, [DeviceInfo]")
def unsupported_bit_rate(network: LintedNetwork) -> Conflicts:
    """All nodes support the network's bit rate."""
    for each in network.nodes:
        if network.bit_rate and network.bit_rate not in bit_rates(each.device):
            at = each.spot(each.device.at("deviceinfo", "baudrate_10"))
            yield at, f"{each.name} does not support the network's {network.bit_rate} kbit/s"


@RULES.rule("E823", "CiA 306, [DeviceComissioning]")
def different_bit_rates(network: LintedNetwork) -> Conflicts:
    """All nodes are set to one bit rate."""
    rates = [(node, node.device.commissioned("baudrate")) for node in network.nodes]
    declared = [(node, rate.value) for node, rate in rates if rate and rate.value]  # 0 is E704's
    for node, rate in declared[1:]:
        if rate != declared[0][1] and node.device.commissioning:
            at = node.spot(node.device.commissioning.at("baudrate"))
            yield at, f"{node.name} is set to {rate} kbit/s, {declared[0][0].name} to {declared[0][1]}"


def _with_bit(network: LintedNetwork, index: int, bit: int) -> list[NetworkNode]:
    """Return the nodes whose object has a bit set."""
    return [each for each in network.nodes if (each.device.value(index) or Number(0)).value & bit]


def one_of(index: int, bit: int, what: str) -> Callable[[LintedNetwork], Conflicts]:
    """Make the rule that only one node has a bit set in an object."""

    def check(network: LintedNetwork) -> Conflicts:
        nodes = _with_bit(network, index, bit)
        for each in nodes[1:]:
            yield each.spot(each.device.objects[index].place), f"{each.name} is {what}, as {nodes[0].name} is"

    return check


@RULES.rule("W826", "CiA 301, object 0x1005")
def nobody_sends_sync(network: LintedNetwork) -> Conflicts:
    """Synchronous PDOs have a node that sends SYNC."""
    ports = [each for identifier in network.identifiers for each in network.ports(identifier)]
    is_sent = network.has_foreign_master or _with_bit(network, SYNC[0], SYNC_PRODUCER)
    for each in ports if not is_sent else ():
        type_ = each.pdo.value(2)
        if type_ and type_.value in values.SYNCHRONOUS:
            yield _spot(each.node, each.pdo, 2), f"{each.name} is synchronous, but no node sends SYNC"


NMT_MASTER = 1

RULES += (
    Rule("E824", "One node sends SYNC.", "CiA 301, object 0x1005, bit 30",
         one_of(SYNC[0], SYNC_PRODUCER, "SYNC producer")),
    Rule("E825", "One node is NMT master.", "CiA 302-2, object 0x1F80, bit 0",
         one_of(0x1F80, NMT_MASTER, "NMT master")),
)  # fmt: skip


def lint_network(network: LintedNetwork) -> list[Finding]:
    """Check a network; findings are ordered by file and place."""
    said = ((rule.code, at, text) for rule in RULES for at, text in rule.check(network))
    found = {Finding(at.file, at.line, at.column, code, text) for code, at, text in said}
    files = {each.file: number for number, each in enumerate(network.nodes)}
    return sorted(found, key=lambda each: (files[each.file], each.line, each.column, each.code))


def overview(network: LintedNetwork) -> list[tuple[str, ...]]:
    """Return one row for each identifier: itself, its name, its producers, its consumers."""
    sides = (network.producers, network.consumers)
    return [
        (f"0x{each:03X}", network.title(each), *(", ".join(p.node.name for p in side.get(each, ())) for side in sides))
        for each in network.identifiers
    ]
