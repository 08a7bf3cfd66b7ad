"""The network view: the files of all nodes together, and every identifier with its producers and consumers.

A network is data (nodes, declared shared messages, declared priorities); its rules are a table like those for one file.
A finding's place is the PDO or value to be changed.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
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
"""Identifier ranges of PDOs in the pre-defined connection set."""


class NetworkNode(NamedTuple):
    """A device in the network: name, file, node-ID (0: unknown), and whether the node-ID is a guess."""

    name: str
    file: str
    device: LintedDevice
    node_id: int = 0
    is_guess: bool = False

    def location(self, at: Located = TOP) -> Location:
        """Return a place in the node's file."""
        return Location(self.file, at.line or TOP.line, at.column)  # an entry from a patch has no line

    def services(self) -> Iterator[tuple[int, str, Location]]:
        """Yield the identifiers of the node's services other than PDOs: identifier, name, location."""
        top = self.location()
        for each in (each for each in values.RESTRICTED if each.is_per_node):
            yield each.low + self.node_id - 1, f"{each.owner.removeprefix('the ')} of {self.name}", top
        for index, name in ((0x1005, "SYNC"), (0x1012, "TIME"), (0x1014, f"EMCY of {self.name}")):
            variable = self.device.variable(index)
            value = variable.value.at(self.node_id) if variable and variable.value else None
            # Bit 31 of 0x1014 is "not valid"; in 0x1005 it means nothing, in 0x1012 "consumes TIME".
            if variable and value is not None and (index != 0x1014 or not value & values.NOT_VALID):
                yield value & values.BASE_IDENTIFIER, name, self.location(variable.place)
        section = self.device.section("deviceinfo")
        if section and section.text("lss_supported") == "1":
            yield from ((each, "LSS", self.location(section.at("lss_supported"))) for each in values.LSS_COB_IDS)


class Location(NamedTuple):
    """A place in one of the files; line and column from 1."""

    file: str
    line: int
    column: int


Conflicts: TypeAlias = Iterator[tuple[Location, str]]
"""Places that break a rule of the network, each with a sentence about what is wrong."""


class Endpoint(NamedTuple):
    """One end of a PDO in a network: node, records, and COB-ID."""

    node: NetworkNode
    pdo: DescribedRecords
    identifier: int

    @property
    def name(self) -> str:
        """Name such as `core TPDO 3`."""
        return f"{self.node.name} {self.pdo.title}"

    @property
    def size(self) -> int:
        """Length of the data in bytes."""
        return (self.pdo.bits + 7) // 8

    @property
    def is_predefined(self) -> bool:
        """Whether the identifier follows the node-ID, or equals the default one."""
        value = self.pdo.value(1)
        return (value is not None and value.relative) or self.identifier - self.node.node_id == self.pdo.default_base

    @property
    def location(self) -> Location:
        """Place of the identifier."""
        return _location(self.node, self.pdo, 1)

    @property
    def mapping_location(self) -> Location:
        """Place of the number of mapped objects."""
        zero = self.pdo.entry(0)
        return self.node.location(zero.place) if zero else self.location

    @property
    def layout(self) -> tuple[tuple[str, int], ...]:
        """Name (empty for a dummy) and length in bits of every mapped object."""
        found = ((each, self.node.device.variable(*each.address)) for each, _ in self.pdo.mapped())
        return tuple((variable.name if variable else "", each.bits) for each, variable in found)


def _location(node: NetworkNode, pdo: DescribedRecords, sub: int) -> Location:
    where = pdo.setting(sub) or pdo.communication or pdo.mapping
    return node.location(where.place if where else TOP)


@dataclass(frozen=True)
class LintedNetwork:
    """All nodes, and the network file's declarations: shared messages, priorities, bit rate, master."""

    nodes: Sequence[NetworkNode]
    shared: Sequence[str] = ()
    order: Sequence[str] = ()
    bit_rate: int | None = None
    master: str = ""

    @property
    def has_foreign_master(self) -> bool:
        """Whether the master is not one of the nodes but, say, a PC, whose PDOs no file describes."""
        return bool(self.master) and self.master not in {each.name for each in self.nodes}

    @cached_property
    def node_ids(self) -> dict[int, NetworkNode]:
        """Nodes by node-ID; the first of several with the same one."""
        return {each.node_id: each for each in reversed(self.nodes)}

    @cached_property
    def producers(self) -> dict[int, list[Endpoint]]:
        """Valid TPDOs by identifier."""
        return self._endpoints(PdoDirection.TPDO)

    @cached_property
    def consumers(self) -> dict[int, list[Endpoint]]:
        """Valid RPDOs by identifier."""
        return self._endpoints(PdoDirection.RPDO)

    def _endpoints(self, direction: PdoDirection) -> dict[int, list[Endpoint]]:
        found: dict[int, list[Endpoint]] = {}
        for node in self.nodes:
            for pdo in node.device.pdos:
                identifier = pdo.identifier(node.node_id) if pdo.direction is direction else None
                if identifier is not None:
                    found.setdefault(identifier, []).append(Endpoint(node, pdo, identifier))
        return found

    @cached_property
    def identifiers(self) -> list[int]:
        """All identifiers of PDOs, highest priority first."""
        return sorted({*self.producers, *self.consumers})

    def endpoints(self, identifier: int) -> list[Endpoint]:
        """Return the producers, then the consumers, of an identifier."""
        return self.producers.get(identifier, []) + self.consumers.get(identifier, [])

    def title(self, identifier: int) -> str:
        """Return the name of an identifier's PDOs; all names if they differ."""
        return " / ".join(dict.fromkeys(each.pdo.name for each in self.endpoints(identifier) if each.pdo.name))

    def is_shared(self, identifier: int) -> bool:
        """Return whether an identifier may have several producers.

        Either the network file declares the name, or all producers and consumers use the same name and the PDO has no
        data: simultaneous frames are then equal, and do not destroy each other.
        """
        endpoints = self.endpoints(identifier)
        names = {each.pdo.name for each in endpoints}
        if names.intersection(self.shared):
            return True
        is_heard = len(self.consumers.get(identifier, ())) > 0
        return is_heard and len(names) == 1 and "" not in names and all(each.pdo.bits == 0 for each in endpoints)

    @cached_property
    def services(self) -> dict[int, list[tuple[str, Location]]]:
        """Identifiers of services other than PDOs, with name and location of each use."""
        found: dict[int, list[tuple[str, Location]]] = {0: [("NMT", self.nodes[0].location())]} if self.nodes else {}
        for node in self.nodes:
            for identifier, name, place in node.services():
                found.setdefault(identifier, []).append((name, place))
        return found


def nodes_of(nodes: Sequence[NetworkNode]) -> list[NetworkNode]:
    """Return the nodes with node-IDs: as given, from their files, or the next free one as a guess."""
    declared = [each.node_id or own_node_id(each.device) for each in nodes]
    # After 127 devices all others get node-ID 1, which E816 reports.
    free = iter(number for number in values.NODE_IDS if number not in declared)
    return [
        each._replace(node_id=number or next(free, values.NODE_IDS[0]), is_guess=number is None)
        for each, number in zip(nodes, declared)
    ]


def own_node_id(device: LintedDevice) -> int | None:
    """Return the node-ID from a DCF, or the default of the device's own node-ID object; None without one."""
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
        if not network.is_shared(identifier):
            for each in others:
                yield each.location, f"{each.name} sends 0x{identifier:03X}, which {first.name} sends too"


@RULES.rule("I802", "declared in the network file, or by the EDS files' names")
def declared_producers(network: LintedNetwork) -> Conflicts:
    """A shared identifier is declared."""
    for identifier, (first, *others) in network.producers.items():
        if others and network.is_shared(identifier):
            names = " and ".join(each.name for each in (first, *others))
            how = "the network file" if first.pdo.name in network.shared else "one name everywhere and no data"
            yield first.location, f"0x{identifier:03X} {first.pdo.name}: sent by {names}, declared by {how}"


MASTER_HINT = "; if a PC does, say so: `master: PC` in the network file"


@RULES.rule("W803", "CiA 301, PDO")
def without_producer(network: LintedNetwork) -> Conflicts:
    """A message that is received is sent by a node, or by a master without a file (`master:` of the network file)."""
    return _unmatched(network, network.consumers, network.producers, "waits for {}, which no node sends")


@RULES.rule("W804", "CiA 301, PDO")
def without_consumer(network: LintedNetwork) -> Conflicts:
    """A message that is sent is received by a node, or by a master without a file (`master:` of the network file)."""
    return _unmatched(network, network.producers, network.consumers, "sends {}, which no node receives")


def _unmatched(
    network: LintedNetwork, endpoints: Mapping[int, Sequence[Endpoint]], others: Container[int], sentence: str
) -> Conflicts:
    """Yield the endpoints of messages that are not in `others`; a master without a file may have any message."""
    if network.has_foreign_master:
        return
    for identifier, found in endpoints.items():
        if identifier not in others:
            for each in found:
                yield each.location, f"{each.name} {sentence.format(f'0x{identifier:03X}')}{MASTER_HINT}"


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
                yield _location(node, pdo, 1), text


def _pairs(network: LintedNetwork) -> Iterator[tuple[Endpoint, Endpoint]]:
    """Yield every producer with every consumer of its identifier."""
    for identifier, endpoints in network.producers.items():
        for producer in endpoints:
            yield from ((producer, consumer) for consumer in network.consumers.get(identifier, ()))


@RULES.rule("E806", "CiA 301, RPDO length (EMCY 8210)")
def too_short(network: LintedNetwork) -> Conflicts:
    """A consumer expects no more bytes than are sent."""
    for producer, consumer in _pairs(network):
        if producer.size < consumer.size:
            yield consumer.mapping_location, f"{_lengths(producer, consumer)}: not processed (EMCY 8210)"


@RULES.rule("W807", "CiA 301, RPDO length (EMCY 8220)")
def too_long(network: LintedNetwork) -> Conflicts:
    """A consumer expects all bytes that are sent."""
    for producer, consumer in _pairs(network):
        if producer.size > consumer.size:
            yield consumer.mapping_location, f"{_lengths(producer, consumer)}: the rest is lost (EMCY 8220)"


def _lengths(producer: Endpoint, consumer: Endpoint) -> str:
    return f"{consumer.name} expects {consumer.size} bytes, {producer.name} sends {producer.size}"


@RULES.rule("E810", "CiA 301, PDO mapping")
def other_order(network: LintedNetwork) -> Conflicts:
    """Producer and consumer map objects of the same names in the same order."""
    for producer, consumer in _pairs(network):
        names = [[name for name, _ in port.layout if name] for port in (producer, consumer)]
        # Devices of different makers may use different names for the same values.
        if names[0] != names[1] and sorted(names[0]) == sorted(names[1]):
            yield consumer.mapping_location, f"{consumer.name} maps the objects in another order than {producer.name}"


@RULES.rule("W811", "CiA 301, PDO mapping")
def other_bits(network: LintedNetwork) -> Conflicts:
    """Producer and consumer cut the data at the same bits."""
    for producer, consumer in _pairs(network):
        bits = [[length for _, length in port.layout] for port in (producer, consumer)]
        if bits[0] != bits[1] and producer.size == consumer.size:  # E806 or W807 reports different sizes
            yield consumer.mapping_location, f"{consumer.name} takes {bits[1]} bits, {producer.name} sends {bits[0]}"


# Identifiers and priorities


@RULES.rule("E808", "CiA 301, pre-defined connection set")
def service_identifiers(network: LintedNetwork) -> Conflicts:
    """No PDO has the identifier of another service in use."""
    for identifier in network.identifiers:
        for name, _ in network.services.get(identifier, [])[:1]:
            endpoints = network.endpoints(identifier)
            yield from ((each.location, f"{each.name} has 0x{identifier:03X}, the {name}") for each in endpoints)


@RULES.rule("I809", "CiA 301, pre-defined connection set and restricted CAN-IDs")
def unused_service_identifiers(network: LintedNetwork) -> Conflicts:
    """A custom identifier is outside the ranges of other services."""
    for identifier, endpoints in network.producers.items():
        found = owner(identifier, values.RESERVED + values.PREDEFINED)
        is_free = identifier not in network.services and not any(each.is_predefined for each in endpoints)
        # W827 reports it if the node with this default identifier is in the network
        if found and is_free and found.node_id(identifier) not in network.node_ids:
            what = f"0x{identifier:03X} {endpoints[0].pdo.name} belongs to {found.whose(identifier)}"
            yield endpoints[0].location, f"{what}, which is not in the network"


@RULES.rule("W827", "CiA 301, pre-defined connection set")
def default_of_other_node(network: LintedNetwork) -> Conflicts:
    """A custom identifier is not a default PDO of a node in the network."""
    for identifier, endpoints in network.producers.items():
        found = owner(identifier, DEFAULT_PDOS)
        node = network.node_ids.get(found.node_id(identifier) or 0) if found else None
        if found and node and not any(each.is_predefined for each in endpoints):
            text = f"{endpoints[0].name} has 0x{identifier:03X}, {found.owner} of {node.name} before it is configured"
            yield endpoints[0].location, text


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
    known = {each.pdo.name: each for endpoints in network.producers.values() for each in endpoints}
    for before, after in pairwise([known[name] for name in network.order if name in known]):
        if after.identifier < before.identifier:
            yield after.location, f"{after.pdo.name} (0x{after.identifier:03X}) wins against {before.pdo.name}"


@RULES.rule("W814", "the network file")
def not_in_order(network: LintedNetwork) -> Conflicts:
    """The declared order of priorities names messages that are sent."""
    known = {each.pdo.name for endpoints in network.producers.values() for each in endpoints}
    for name in network.order:
        if name not in known:
            yield network.nodes[0].location(), f"{name} is in the order of priorities, but nobody sends it"


@RULES.rule("I815", "custom")
def numbering(network: LintedNetwork) -> Conflicts:
    """A node's TPDOs are numbered in the order of their priorities."""
    for node in network.nodes:
        own = [each for endpoints in network.producers.values() for each in endpoints if each.node is node]
        for before, after in pairwise(sorted(own, key=lambda each: each.pdo.number)):
            if after.identifier < before.identifier:
                yield after.location, f"{after.name} has a higher priority than {before.pdo.title} before it"


# Nodes, error control, SYNC, bit rate


@RULES.rule("E816", "CiA 301, node-ID")
def same_node_id(network: LintedNetwork) -> Conflicts:
    """Every node has a node-ID of its own."""
    for each in network.nodes:
        first = network.node_ids[each.node_id]
        if first is not each:
            yield each.location(), f"{each.name} has node-ID {each.node_id}, as {first.name} has"


@RULES.rule("I817", "CiA 306, [DeviceComissioning]")
def guessed_node_id(network: LintedNetwork) -> Conflicts:
    """The file or the network file says the node-ID."""
    for each in network.nodes:
        if each.is_guess:
            yield each.location(), f"nothing says the node-ID of {each.name}; taken as {each.node_id}"


def _watches(network: LintedNetwork) -> Iterator[tuple[Location, str, int, int, NetworkNode | None]]:
    """Yield every consumer heartbeat time: location, consumer's name, watched node-ID, time in ms, watched node."""
    for node in network.nodes:
        for variable, node_id, time in heartbeats(node.device):
            yield node.location(variable.place), node.name, node_id, time, network.node_ids.get(node_id)


def _heartbeat(node: NetworkNode) -> int:
    return (node.device.value(0x1017) or Number(0)).value


@RULES.rule("E818", "CiA 301, objects 0x1016 and 0x1017")
def impatient(network: LintedNetwork) -> Conflicts:
    """A heartbeat consumer waits longer than the producer's period."""
    for place, name, _, time, watched in _watches(network):
        # An equal time is also too short, because the next heartbeat may be a little late.
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
        yield last.location(last.device.at("deviceinfo", "baudrate_10")), "no bit rate is common to all nodes"


@RULES.rule("E822", "CiA 306, [DeviceInfo]")
def unsupported_bit_rate(network: LintedNetwork) -> Conflicts:
    """All nodes support the network's bit rate."""
    for each in network.nodes:
        if network.bit_rate and network.bit_rate not in bit_rates(each.device):
            at = each.location(each.device.at("deviceinfo", "baudrate_10"))
            yield at, f"{each.name} does not support the network's {network.bit_rate} kbit/s"


@RULES.rule("E823", "CiA 306, [DeviceComissioning]")
def different_bit_rates(network: LintedNetwork) -> Conflicts:
    """All nodes are set to one bit rate."""
    rates = [(node, node.device.commissioned("baudrate")) for node in network.nodes]
    declared = [(node, rate.value) for node, rate in rates if rate and rate.value]  # E704 reports 0
    for node, rate in declared[1:]:
        if rate != declared[0][1] and node.device.commissioning:
            at = node.location(node.device.commissioning.at("baudrate"))
            yield at, f"{node.name} is set to {rate} kbit/s, {declared[0][0].name} to {declared[0][1]}"


def _with_bit(network: LintedNetwork, index: int, bit: int) -> list[NetworkNode]:
    """Return the nodes with a bit set in an object."""
    return [each for each in network.nodes if (each.device.value(index) or Number(0)).value & bit]


def one_of(index: int, bit: int, what: str) -> Callable[[LintedNetwork], Conflicts]:
    """Return the check that only one node has a bit set in an object."""

    def check(network: LintedNetwork) -> Conflicts:
        nodes = _with_bit(network, index, bit)
        for each in nodes[1:]:
            yield each.location(each.device.objects[index].place), f"{each.name} is {what}, as {nodes[0].name} is"

    return check


@RULES.rule("W826", "CiA 301, object 0x1005")
def nobody_sends_sync(network: LintedNetwork) -> Conflicts:
    """Synchronous PDOs have a node that sends SYNC."""
    endpoints = [each for identifier in network.identifiers for each in network.endpoints(identifier)]
    if network.has_foreign_master or _with_bit(network, SYNC[0], SYNC_PRODUCER):
        return
    for each in endpoints:
        type_ = each.pdo.value(2)
        if type_ and type_.value in values.SYNCHRONOUS:
            yield _location(each.node, each.pdo, 2), f"{each.name} is synchronous, but no node sends SYNC"


NMT_MASTER = 1

RULES += (
    Rule("E824", "One node sends SYNC.", "CiA 301, object 0x1005, bit 30",
         one_of(SYNC[0], SYNC_PRODUCER, "SYNC producer")),
    Rule("E825", "One node is NMT master.", "CiA 302-2, object 0x1F80, bit 0",
         one_of(0x1F80, NMT_MASTER, "NMT master")),
)  # fmt: skip


def lint_network(network: LintedNetwork) -> list[Finding]:
    """Check a network and return the findings, ordered by file and place."""
    said = ((rule.code, at, text) for rule in RULES for at, text in rule.check(network))
    found = {Finding(at.file, at.line, at.column, code, text) for code, at, text in said}
    files = {each.file: number for number, each in enumerate(network.nodes)}
    return sorted(found, key=lambda each: (files[each.file], each.line, each.column, each.code))


def overview(network: LintedNetwork) -> list[tuple[str, ...]]:
    """Return a row for each identifier: identifier, name, producers, consumers."""
    sides = (network.producers, network.consumers)
    return [
        (f"0x{each:03X}", network.title(each), *(", ".join(p.node.name for p in side.get(each, ())) for side in sides))
        for each in network.identifiers
    ]
