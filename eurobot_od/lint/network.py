"""The network view: the files of all nodes together, every identifier with its producers and consumers.

Rule of this file: a network is data (nodes, declared shares, declared order of priorities); its rules are a table like
those for one file, and each finding stands where the PDO or value is written that has to change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

from eurobot_od.lint.file_rules import BIT_RATES, bit_rates
from eurobot_od.lint.findings import Finding, Located, Rule
from eurobot_od.lint.model import LintedDevice, LintedPdo
from eurobot_od.lint.object_rules import heartbeats
from eurobot_od.lint.pdo_rules import SYNCHRONOUS
from eurobot_od.od.document import Entry, Section
from eurobot_od.od.values import (
    BASE_IDENTIFIER,
    DEFAULT_PDO_BASES,
    ERROR_CONTROL_BASE,
    LSS_COB_IDS,
    NODE_IDS,
    NOT_VALID,
    PREDEFINED,
    RESERVED,
    SDO_REQUEST_BASE,
    SDO_RESPONSE_BASE,
    IdentifierRange,
    Number,
    PdoDirection,
    owner,
    parse_number,
)

DEFAULT_PDOS = tuple(each for each in PREDEFINED if "PDO" in each.owner)
"""The ranges of the PDOs in the pre-defined connection set."""


SERVICE_BASES = {SDO_REQUEST_BASE: "SDO request", SDO_RESPONSE_BASE: "SDO answer", ERROR_CONTROL_BASE: "heartbeat"}
"""Services that every node has, under these identifiers plus its node-ID."""


class NetworkNode(NamedTuple):
    """A device in the network: its name, file and node-ID, and whether that is only a guess."""

    name: str
    file: str
    device: LintedDevice
    node_id: int
    is_guess: bool


class Spot(NamedTuple):
    """A place in one of the files, both numbers from 1."""

    file: str
    line: int
    column: int


class Conflict(NamedTuple):
    """One place where a rule of the network does not hold, and what is wrong there in one sentence."""

    at: Spot
    text: str


class Port(NamedTuple):
    """A valid PDO of a node, and its identifier."""

    node: NetworkNode
    pdo: LintedPdo
    identifier: int

    @property
    def name(self) -> str:
        """Name it: core TPDO 3."""
        return f"{self.node.name} {self.pdo.name}"

    @property
    def spot(self) -> Spot:
        """Return where its identifier stands."""
        return _spot(self.node, self.pdo, 1)

    @property
    def mapping_spot(self) -> Spot:
        """Return where its number of mapped objects stands."""
        variable = self.pdo.mapping.variable(0) if self.pdo.mapping else None
        return spot(self.node, variable.place) if variable else self.spot

    @property
    def layout(self) -> tuple[tuple[str, int], ...]:
        """Return the name (empty for padding) and the bits of every mapped object."""
        found = ((each, self.node.device.variable(each.index, each.sub)) for each in self.pdo.mapped())
        return tuple((variable.name if variable else "", each.bits) for each, variable in found)


def spot(node: NetworkNode, at: Located) -> Spot:
    """Return a place of a node's file."""
    return Spot(node.file, at.line, at.column)


def _spot(node: NetworkNode, pdo: LintedPdo, sub: int) -> Spot:
    variable = pdo.setting(sub)
    place: Entry | Section | None = variable.place if variable else None
    whole = pdo.communication or pdo.mapping
    return spot(node, place or (whole.place if whole else Entry("", "", 1, 1)))


class Network:
    """All nodes, and what is declared of them: messages with several senders, the order of priorities, the bit rate."""

    def __init__(
        self,
        nodes: Sequence[NetworkNode],
        shared: Iterable[str] = (),
        order: Sequence[str] = (),
        bit_rate: int | None = None,
    ) -> None:
        self.nodes, self.shared, self.order, self.bit_rate = tuple(nodes), frozenset(shared), tuple(order), bit_rate

    @cached_property
    def node_ids(self) -> dict[int, NetworkNode]:
        """The nodes by node-ID; of two with one node-ID the first."""
        return {each.node_id: each for each in reversed(self.nodes)}

    @cached_property
    def producers(self) -> dict[int, list[Port]]:
        """The valid TPDOs by identifier."""
        return self._ports(PdoDirection.TPDO)

    @cached_property
    def consumers(self) -> dict[int, list[Port]]:
        """The valid RPDOs by identifier."""
        return self._ports(PdoDirection.RPDO)

    def _ports(self, direction: PdoDirection) -> dict[int, list[Port]]:
        found: dict[int, list[Port]] = {}
        for node in self.nodes:
            for pdo in node.device.pdos:
                identifier = pdo.identifier(node.node_id) if pdo.direction is direction else None
                if identifier is not None:
                    found.setdefault(identifier, []).append(Port(node, pdo, identifier))
        return found

    @cached_property
    def identifiers(self) -> list[int]:
        """All identifiers that PDOs have, the highest priority first."""
        return sorted({*self.producers, *self.consumers})

    def ports(self, identifier: int) -> list[Port]:
        """Return producers, then consumers of an identifier."""
        return self.producers.get(identifier, []) + self.consumers.get(identifier, [])

    def title(self, identifier: int) -> str:
        """Return what the PDOs of an identifier are called, all names if they differ."""
        return " / ".join(dict.fromkeys(each.pdo.title for each in self.ports(identifier) if each.pdo.title))

    def is_shared(self, identifier: int) -> bool:
        """Whether an identifier may have several producers.

        That is declared in the network file, by name; or by the EDS files themselves: each producer and each consumer
        calls it by the same name, and it carries no data, so that equal frames merge instead of destroying each other.
        """
        ports = self.ports(identifier)
        names = {each.pdo.title for each in ports}
        if names & self.shared:
            return True
        is_heard = len(self.consumers.get(identifier, ())) > 0
        return is_heard and len(names) == 1 and "" not in names and all(each.pdo.bits == 0 for each in ports)

    @cached_property
    def services(self) -> dict[int, list[tuple[str, Spot]]]:
        """Identifiers of other services than PDOs in use, with what they are and where that is said."""
        found: dict[int, list[tuple[str, Spot]]] = {0: [("NMT", Spot(self.nodes[0].file, 1, 1))]} if self.nodes else {}
        for node in self.nodes:
            for identifier, name, place in _services(node):
                found.setdefault(identifier, []).append((name, place))
        return found


def _services(node: NetworkNode) -> Iterator[tuple[int, str, Spot]]:
    """Give the identifiers of a node's services other than PDOs; SYNC and TIME are the network's."""
    top = Spot(node.file, 1, 1)
    for base, name in SERVICE_BASES.items():
        yield base + node.node_id, f"{name} of {node.name}", top
    for index, name in ((0x1005, "SYNC"), (0x1012, "TIME"), (0x1014, f"EMCY of {node.name}")):
        variable = node.device.variable(index)
        value = variable.value.at(node.node_id) if variable and variable.value else None
        if variable and value is not None and (index != 0x1014 or not value & NOT_VALID):
            yield value & BASE_IDENTIFIER, name, spot(node, variable.place)
    section = node.device.section("deviceinfo")
    if section and section.text("lss_supported") == "1":
        yield from ((identifier, "LSS", spot(node, section.at("lss_supported"))) for identifier in LSS_COB_IDS)


class Member(NamedTuple):
    """A device that is to be in the network; without node-ID its file's own one is taken, or the next free one."""

    name: str
    file: str
    device: LintedDevice
    node_id: int | None = None


def nodes_of(members: Sequence[Member]) -> list[NetworkNode]:
    """Make nodes of devices."""
    said = [each.node_id or own_node_id(each.device) for each in members]
    free = iter(number for number in NODE_IDS if number not in said)
    return [
        NetworkNode(each.name, each.file, each.device, number or next(free, NODE_IDS[0]), number is None)
        for each, number in zip(members, said)
    ]


def own_node_id(device: LintedDevice) -> int | None:
    """Return the node-ID a DCF commissions, or the value of the device's own setting of that name; None without."""
    if device.node_id:
        return device.node_id
    own = device.own_node_id
    number = own.value if own else None
    return number.value if number and not number.relative and number.value in NODE_IDS else None


# Producers and consumers


def two_producers(network: Network) -> Iterator[Conflict]:
    """Yield identifiers with several producers that nobody declared."""
    for identifier, (first, *others) in network.producers.items():
        for each in others if not network.is_shared(identifier) else ():
            yield Conflict(each.spot, f"{each.name} sends 0x{identifier:03X}, which {first.name} sends too")


def declared_producers(network: Network) -> Iterator[Conflict]:
    """Yield identifiers that several nodes may send."""
    for identifier, (first, *others) in network.producers.items():
        if others and network.is_shared(identifier):
            names = " and ".join(each.name for each in (first, *others))
            how = "the network file" if first.pdo.title in network.shared else "one name everywhere and no data"
            yield Conflict(first.spot, f"0x{identifier:03X} {first.pdo.title}: sent by {names}, declared by {how}")


def without_producer(network: Network) -> Iterator[Conflict]:
    """Yield RPDOs that nobody sends."""
    for identifier, ports in network.consumers.items():
        for each in ports if identifier not in network.producers else ():
            yield Conflict(each.spot, f"{each.name} waits for 0x{identifier:03X}, which nobody sends")


def without_consumer(network: Network) -> Iterator[Conflict]:
    """Yield TPDOs that nobody receives."""
    for identifier, ports in network.producers.items():
        for each in ports if identifier not in network.consumers else ():
            yield Conflict(each.spot, f"{each.name} sends 0x{identifier:03X}, which nobody receives")


def switched_off(network: Network) -> Iterator[Conflict]:
    """Yield RPDOs that are not valid, but have the identifier of a message that is sent."""
    for node in network.nodes:
        for pdo in node.device.pdos:
            value = pdo.value(1)
            identifier = value.at(node.node_id) & BASE_IDENTIFIER if value else 0
            if (
                value
                and value.value & NOT_VALID
                and pdo.direction is PdoDirection.RPDO
                and identifier in network.producers
            ):
                text = f"{node.name} {pdo.name} could receive 0x{identifier:03X}, but is not valid until configured"
                yield Conflict(_spot(node, pdo, 1), text)


def _pairs(network: Network) -> Iterator[tuple[Port, Port]]:
    """Give every producer with every consumer of its identifier."""
    for identifier, ports in network.producers.items():
        for producer in ports:
            yield from ((producer, consumer) for consumer in network.consumers.get(identifier, ()))


def too_short(network: Network) -> Iterator[Conflict]:
    """Yield consumers that expect more bytes than are sent."""
    for producer, consumer in _pairs(network):
        if _bytes(producer) < _bytes(consumer):
            text = f"{_lengths(producer, consumer)}: not processed (EMCY 8210)"
            yield Conflict(consumer.mapping_spot, text)


def too_long(network: Network) -> Iterator[Conflict]:
    """Yield consumers that expect fewer bytes than are sent."""
    for producer, consumer in _pairs(network):
        if _bytes(producer) > _bytes(consumer):
            text = f"{_lengths(producer, consumer)}: the rest is lost (EMCY 8220)"
            yield Conflict(consumer.mapping_spot, text)


def _lengths(producer: Port, consumer: Port) -> str:
    return f"{consumer.name} expects {_bytes(consumer)} bytes, {producer.name} sends {_bytes(producer)}"


def _bytes(port: Port) -> int:
    return (port.pdo.bits + 7) // 8


def other_order(network: Network) -> Iterator[Conflict]:
    """Yield consumers that map the same objects in another order."""
    for producer, consumer in _pairs(network):
        names = [[name for name, _ in port.layout if name] for port in (producer, consumer)]
        if names[0] != names[1] and sorted(names[0]) == sorted(names[1]):
            yield Conflict(
                consumer.mapping_spot, f"{consumer.name} maps the objects in another order than {producer.name}"
            )


def other_bits(network: Network) -> Iterator[Conflict]:
    """Yield consumers that cut the same bytes at other bits."""
    for producer, consumer in _pairs(network):
        bits = [[length for _, length in port.layout] for port in (producer, consumer)]
        if bits[0] != bits[1] and _bytes(producer) == _bytes(consumer):
            text = f"{consumer.name} takes {bits[1]} bits, {producer.name} sends {bits[0]}"
            yield Conflict(consumer.mapping_spot, text)


# Identifiers and priorities


def service_identifiers(network: Network) -> Iterator[Conflict]:
    """Yield PDOs on an identifier that another service of the network has."""
    for identifier in network.identifiers:
        for name, _ in network.services.get(identifier, [])[:1]:
            ports = network.ports(identifier)
            yield from (Conflict(each.spot, f"{each.name} has 0x{identifier:03X}, the {name}") for each in ports)


def unused_service_identifiers(network: Network) -> Iterator[Conflict]:
    """Yield custom identifiers in the range of a service, which nobody in this network uses."""
    for identifier, ports in network.producers.items():
        found = owner(identifier, RESERVED + PREDEFINED)
        is_free = identifier not in network.services and not any(_is_predefined(each) for each in ports)
        if found and is_free and not _is_used(network, found, identifier):
            whose = found.whose(identifier)
            text = f"0x{identifier:03X} {ports[0].pdo.title} belongs to {whose}, which is not in the network"
            yield Conflict(ports[0].spot, text)


def _is_used(network: Network, found: IdentifierRange, identifier: int) -> bool:
    """Whether the node is in the network whose default an identifier is (W827 says that)."""
    return found.is_per_node and identifier - found.low + 1 in network.node_ids


def _is_predefined(port: Port) -> bool:
    value = port.pdo.value(1)
    return (value is not None and value.relative) or _is_default(port)


def _is_default(port: Port) -> bool:
    """Whether a PDO has just its own default identifier for its node-ID."""
    bases = DEFAULT_PDO_BASES[port.pdo.direction]
    return port.pdo.number <= len(bases) and port.identifier == bases[port.pdo.number - 1] + port.node.node_id


def default_of_other_node(network: Network) -> Iterator[Conflict]:
    """Yield custom identifiers that are the default PDO of a node of the network, which it has changed itself."""
    for identifier, ports in network.producers.items():
        found = owner(identifier, DEFAULT_PDOS)
        node = network.node_ids.get(identifier - found.low + 1) if found else None
        if found and node and not any(_is_predefined(each) for each in ports):
            text = f"{ports[0].name} has 0x{identifier:03X}, {found.owner} of {node.name} before it is configured"
            yield Conflict(ports[0].spot, text)


def double_services(network: Network) -> Iterator[Conflict]:
    """Yield identifiers that two different services have."""
    for identifier, entries in network.services.items():
        names = dict.fromkeys(name for name, _ in entries)
        if len(names) > 1:
            yield Conflict(entries[-1][1], f"0x{identifier:03X} is {' and '.join(names)} at once")


def declared_order(network: Network) -> Iterator[Conflict]:
    """Yield messages whose identifier puts them before one that is declared more urgent."""
    known = {each.pdo.title: each for ports in network.producers.values() for each in ports}
    for before, after in pairwise([known[name] for name in network.order if name in known]):
        if after.identifier < before.identifier:
            text = f"{after.pdo.title} (0x{after.identifier:03X}) wins against {before.pdo.title}"
            yield Conflict(after.spot, text)


def not_in_order(network: Network) -> Iterator[Conflict]:
    """Yield names of the declared order that no node sends."""
    known = {each.pdo.title for ports in network.producers.values() for each in ports}
    for name in network.order:
        if name not in known:
            yield Conflict(
                Spot(network.nodes[0].file, 1, 1), f"{name} is in the order of priorities, but nobody sends it"
            )


def numbering(network: Network) -> Iterator[Conflict]:
    """Yield TPDOs of a node that are numbered against their priorities."""
    for node in network.nodes:
        own = [each for ports in network.producers.values() for each in ports if each.node is node]
        for before, after in pairwise(sorted(own, key=lambda each: each.pdo.number)):
            if after.identifier < before.identifier:
                yield Conflict(after.spot, f"{after.name} has a higher priority than {before.pdo.name} before it")


# Nodes, error control, SYNC, bit rate


def same_node_id(network: Network) -> Iterator[Conflict]:
    """Yield nodes with the node-ID of another one."""
    for each in network.nodes:
        first = network.node_ids[each.node_id]
        if first is not each:
            yield Conflict(Spot(each.file, 1, 1), f"{each.name} has node-ID {each.node_id}, as {first.name} has")


def guessed_node_id(network: Network) -> Iterator[Conflict]:
    """Yield nodes whose node-ID nothing says."""
    for each in network.nodes:
        if each.is_guess:
            yield Conflict(Spot(each.file, 1, 1), f"nothing says the node-ID of {each.name}; taken as {each.node_id}")


def _watches(network: Network) -> Iterator[tuple[Spot, str, int, int, NetworkNode | None]]:
    """Give every consumer heartbeat time: its place, whose it is, the node-ID watched, the time in ms, that node."""
    for node in network.nodes:
        for variable, node_id, time in heartbeats(node.device):
            place = spot(node, variable.place)
            yield place, node.name, node_id, time, network.node_ids.get(node_id)


def _heartbeat(node: NetworkNode) -> int:
    return (node.device.value(0x1017) or Number(0)).value


def impatient(network: Network) -> Iterator[Conflict]:
    """Yield consumers that wait no longer than the producer's period."""
    for place, name, _, time, watched in _watches(network):
        if watched and 0 < time <= _heartbeat(watched):
            yield Conflict(
                place, f"{name} waits {time} ms for {watched.name}, which sends every {_heartbeat(watched)} ms"
            )


def nobody_to_watch(network: Network) -> Iterator[Conflict]:
    """Yield consumers of heartbeats that no node of the network has."""
    for place, name, node_id, _, watched in _watches(network):
        if watched is None:
            yield Conflict(place, f"{name} waits for the heartbeat of node {node_id}, which is not in the network")


def silent(network: Network) -> Iterator[Conflict]:
    """Yield consumers of heartbeats that are not sent."""
    for place, name, _, _, watched in _watches(network):
        if watched and not _heartbeat(watched):
            yield Conflict(place, f"{name} waits for the heartbeat of {watched.name}, which sends none")


def no_common_bit_rate(network: Network) -> Iterator[Conflict]:
    """Yield a network whose nodes have no bit rate in common."""
    rates = [bit_rates(each.device) for each in network.nodes]
    if rates and not set(BIT_RATES).intersection(*rates):
        yield Conflict(_rate_spot(network.nodes[-1]), "no bit rate is common to all nodes")


def unsupported_bit_rate(network: Network) -> Iterator[Conflict]:
    """Yield nodes that do not support the network's bit rate."""
    for each in network.nodes:
        if network.bit_rate and network.bit_rate not in bit_rates(each.device):
            yield Conflict(_rate_spot(each), f"{each.name} does not support the network's {network.bit_rate} kbit/s")


def different_bit_rates(network: Network) -> Iterator[Conflict]:
    """Yield nodes commissioned for another bit rate than the first one."""
    said = [(node, rate) for node in network.nodes for rate in [_commissioned_rate(node)] if rate]
    for node, rate in said[1:]:
        if rate != said[0][1] and node.device.commissioning:
            at = spot(node, node.device.commissioning.at("baudrate"))
            yield Conflict(at, f"{node.name} is set to {rate} kbit/s, {said[0][0].name} to {said[0][1]}")


def _rate_spot(node: NetworkNode) -> Spot:
    section = node.device.section("deviceinfo")
    return spot(node, section.at("baudrate_10")) if section else Spot(node.file, 1, 1)


def _commissioned_rate(node: NetworkNode) -> int | None:
    section = node.device.commissioning
    number = parse_number(section.text("baudrate")) if section else None
    return number.value if number else None


def _with_bit(network: Network, index: int, bit: int) -> list[NetworkNode]:
    """Return the nodes whose object has a bit set."""
    return [each for each in network.nodes if (each.device.value(index) or Number(0)).value & bit]


def one_of(index: int, bit: int, what: str) -> Callable[[Network], Iterator[Conflict]]:
    """Make the rule that only one node has a bit set in an object."""

    def check(network: Network) -> Iterator[Conflict]:
        nodes = _with_bit(network, index, bit)
        for each in nodes[1:]:
            place = spot(each, each.device.objects[index].place)
            yield Conflict(place, f"{each.name} is {what}, as {nodes[0].name} is")

    return check


def nobody_sends_sync(network: Network) -> Iterator[Conflict]:
    """Yield synchronous PDOs where no node sends SYNC."""
    ports = [each for identifier in network.identifiers for each in network.ports(identifier)]
    for each in ports if not _with_bit(network, 0x1005, SYNC_PRODUCER) else ():
        type_ = each.pdo.value(2)
        if type_ and type_.value in SYNCHRONOUS:
            yield Conflict(_spot(each.node, each.pdo, 2), f"{each.name} is synchronous, but no node sends SYNC")


SYNC_PRODUCER, NMT_MASTER = 1 << 30, 1

RULES: tuple[Rule, ...] = (
    Rule("E801", "An identifier has one producer, unless it is declared as shared.", "CiA 301, PDO", two_producers),
    Rule("I802", "A shared identifier is declared.", "declared in the network file, or by the EDS files' names",
         declared_producers),
    Rule("W803", "What is received is sent.", "CiA 301, PDO", without_producer),
    Rule("W804", "What is sent is received.", "CiA 301, PDO", without_consumer),
    Rule("I805", "A receiver of a message that is sent is valid.", "CiA 301, object 0x1400 sub 1, bit 31",
         switched_off),
    Rule("E806", "A consumer expects no more bytes than are sent.", "CiA 301, RPDO length (EMCY 8210)", too_short),
    Rule("W807", "A consumer expects all bytes that are sent.", "CiA 301, RPDO length (EMCY 8220)", too_long),
    Rule("E808", "No PDO has the identifier of another service in use.", "CiA 301, pre-defined connection set",
         service_identifiers),
    Rule("I809", "A custom identifier is outside the ranges of other services.",
         "CiA 301, pre-defined connection set and restricted CAN-IDs", unused_service_identifiers),
    Rule("E810", "Producer and consumer map objects of the same names in the same order.", "CiA 301, PDO mapping",
         other_order),
    Rule("W811", "Producer and consumer cut the data at the same bits.", "CiA 301, PDO mapping", other_bits),
    Rule("E812", "Different services have different identifiers.", "CiA 301, pre-defined connection set",
         double_services),
    Rule("W813", "Identifiers follow the declared order of priorities.", "CAN: the lower identifier wins",
         declared_order),
    Rule("W814", "The declared order of priorities names messages that are sent.", "the network file", not_in_order),
    Rule("I815", "A node's TPDOs are numbered in the order of their priorities.", "custom", numbering),
    Rule("E816", "Every node has a node-ID of its own.", "CiA 301, node-ID", same_node_id),
    Rule("I817", "The file or the network file says the node-ID.", "CiA 306, [DeviceComissioning]", guessed_node_id),
    Rule("E818", "A heartbeat consumer waits longer than the producer's period.", "CiA 301, objects 0x1016 and 0x1017",
         impatient),
    Rule("W819", "A heartbeat consumer waits for a node of the network.", "CiA 301, object 0x1016", nobody_to_watch),
    Rule("W820", "A heartbeat consumer waits for a heartbeat that is sent.", "CiA 301, objects 0x1016 and 0x1017",
         silent),
    Rule("E821", "All nodes have a bit rate in common.", "CiA 306, [DeviceInfo]", no_common_bit_rate),
    Rule("E822", "All nodes support the network's bit rate.", "CiA 306, [DeviceInfo]", unsupported_bit_rate),
    Rule("E823", "All nodes are set to one bit rate.", "CiA 306, [DeviceComissioning]", different_bit_rates),
    Rule("E824", "One node sends SYNC.", "CiA 301, object 0x1005, bit 30",
         one_of(0x1005, SYNC_PRODUCER, "SYNC producer")),
    Rule("E825", "One node is NMT master.", "CiA 302-2, object 0x1F80, bit 0",
         one_of(0x1F80, NMT_MASTER, "NMT master")),
    Rule("W826", "Synchronous PDOs have a node that sends SYNC.", "CiA 301, object 0x1005", nobody_sends_sync),
    Rule("W827", "A custom identifier is not a default PDO of a node in the network.",
         "CiA 301, pre-defined connection set", default_of_other_node),
)  # fmt: skip


def lint_network(network: Network) -> list[Finding]:
    """Check a network; findings are ordered by file and place."""
    found = {
        Finding(at.file, at.line, at.column, rule.code, text) for rule in RULES for at, text in rule.check(network)
    }
    files = {each.file: number for number, each in enumerate(network.nodes)}
    return sorted(found, key=lambda each: (files[each.file], each.line, each.column, each.code))


def overview(network: Network) -> list[tuple[str, str, str, str]]:
    """Return one row for each identifier: itself, its name, its producers, its consumers."""
    return [
        (
            f"0x{identifier:03X}",
            network.title(identifier),
            _names(network.producers.get(identifier, ())),
            _names(network.consumers.get(identifier, ())),
        )
        for identifier in network.identifiers
    ]


def _names(ports: Iterable[Port]) -> str:
    return ", ".join(each.node.name for each in ports)
