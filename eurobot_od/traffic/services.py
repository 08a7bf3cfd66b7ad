"""The CANopen services besides the messages, and what their frames say (CiA 301, 7.3.3; CiA 302-2, 304, 305).

First what the frame of a service says by itself: SDO (CiA 301, 7.2.4.3), NMT, SYNC, TIME, EMCY, error control, LSS. A
frame of a valid length goes in, words come out. Then which identifier is whose. What only the frames before it tell is
in `transfers`: here a log may start anywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache, partial
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.device.nmt import COMMAND_NAMES, STATE_NAMES, TOGGLE
from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type, measured, physical
from eurobot_od.od.profiles import dictionary_of
from eurobot_od.od.sdo_channels import sdo_channels
from eurobot_od.od.standard import LSS_IDENTITY, Lss, LssState
from eurobot_od.od.units import RAW, scale_of
from eurobot_od.od.values import ALL_NODES, Address, Value
from eurobot_od.od.values import text as time_text
from eurobot_od.od.words import with_words, words
from eurobot_od.pdo.protocol import ErrorWords
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import Block, ClientCommand, Initiate, ServerCommand
from eurobot_od.traffic.entries import MASTER


def object_words(dictionary: Dictionary | None, address: Address) -> str:
    """Format an object with its name, if the device's file has one."""
    index, subindex = address
    where = f"0x{index:04X}:{subindex:02X}"
    variable = dictionary.variable(address) if dictionary else None
    return where if variable is None else f"{where} {variable.qualname.replace('.', ', ')}"


def value_of(dictionary: Dictionary | None, address: Address, octets: bytes) -> Value:
    """Return a value by its object's type; the bytes if the type is unknown or the length is wrong."""
    variable = dictionary.variable(address) if dictionary else None
    try:
        return octets if variable is None else data_type(variable).read(octets)
    except ValueError:  # a length that the type does not have
        return octets


def value_words(dictionary: Dictionary | None, address: Address, octets: bytes) -> str:
    """Format a value by its object's type; as bytes if the type is unknown or the length is wrong."""
    value = value_of(dictionary, address, octets)
    variable = dictionary.variable(address) if dictionary and value is not octets else None
    if variable is None or isinstance(value, bytes):
        return value.hex(" ") if isinstance(value, bytes) else str(value)
    is_scaled = isinstance(value, (int, float)) and scale_of(variable) != RAW
    return with_words(measured(variable, value) if is_scaled else str(value), words(variable, value))


READ, WRITE = "read", "write"


class SdoCommand(NamedTuple):
    """A kind of SDO frame: its text, READ or WRITE, and whether it names the object."""

    words: str | Callable[[bytes], str]
    direction: str
    names_object: bool = False


def _segment(data: bytes) -> str:
    last = ", the last" if data[0] & wire.LAST else ""
    return f"segment of {len(wire.part_in(data))} bytes{last}"


def _acknowledged(data: bytes) -> str:
    return f"block taken up to segment {data[1]}"


COMMANDS: tuple[Mapping[tuple[int, int], SdoCommand], ...] = (
    {
        (ClientCommand.DOWNLOAD_SEGMENT, 0): SdoCommand(_segment, WRITE),
        (ClientCommand.DOWNLOAD, 0): SdoCommand("write", WRITE, names_object=True),
        (ClientCommand.UPLOAD, 0): SdoCommand("read", READ, names_object=True),
        (ClientCommand.UPLOAD_SEGMENT, 0): SdoCommand("next segment", READ),
        (ClientCommand.BLOCK_UPLOAD, Block.INITIATE): SdoCommand("read", READ, names_object=True),
        (ClientCommand.BLOCK_UPLOAD, Block.END): SdoCommand("end of blocks taken", READ),
        (ClientCommand.BLOCK_UPLOAD, Block.ACKNOWLEDGE): SdoCommand(_acknowledged, READ),
        (ClientCommand.BLOCK_UPLOAD, Block.START): SdoCommand("start of blocks", READ),
        (ClientCommand.BLOCK_DOWNLOAD, Block.INITIATE): SdoCommand("write", WRITE, names_object=True),
        (ClientCommand.BLOCK_DOWNLOAD, Block.END): SdoCommand("end of blocks", WRITE),
    },
    {
        (ServerCommand.UPLOAD_SEGMENT, 0): SdoCommand(_segment, READ),
        (ServerCommand.DOWNLOAD_SEGMENT, 0): SdoCommand("segment taken", WRITE),
        (ServerCommand.UPLOAD, 0): SdoCommand("value of", READ, names_object=True),
        (ServerCommand.DOWNLOAD, 0): SdoCommand("written", WRITE, names_object=True),
        (ServerCommand.BLOCK_DOWNLOAD, Block.INITIATE): SdoCommand("ready for", WRITE, names_object=True),
        (ServerCommand.BLOCK_DOWNLOAD, Block.END): SdoCommand("end of blocks taken", WRITE),
        (ServerCommand.BLOCK_DOWNLOAD, Block.ACKNOWLEDGE): SdoCommand(_acknowledged, WRITE),
        (ServerCommand.BLOCK_UPLOAD, Block.INITIATE): SdoCommand("value of", READ, names_object=True),
        (ServerCommand.BLOCK_UPLOAD, Block.END): SdoCommand("end of blocks", READ),
    },
)
"""Requests and answers by command specifier and sub-command, without aborts."""


def command_of(is_answer: bool, data: bytes) -> tuple[int, int]:
    """Return the command specifier of a request or answer, and its sub-command (0 without one)."""
    masks = wire.ANSWER_SUB_COMMAND if is_answer else wire.REQUEST_SUB_COMMAND
    return data[0] >> 5, data[0] & masks.get(data[0] >> 5, 0)


class SdoEnd(NamedTuple):
    """An end of an SDO channel, by the identifier it sends; `channel` is the identifier of requests.

    `server` is the node-ID of the one with the objects.
    """

    channel: int
    is_answer: bool
    dictionary: Dictionary | None
    server: int

    def command(self, data: bytes) -> SdoCommand | None:
        """Return the kind of a frame, None for an abort or an undefined command."""
        return COMMANDS[self.is_answer].get(command_of(self.is_answer, data))

    def is_in_blocks(self, data: bytes) -> bool:
        """Return whether a frame belongs to a block transfer."""
        return data[0] >> 5 in (wire.ANSWER_SUB_COMMAND if self.is_answer else wire.REQUEST_SUB_COMMAND)

    def content(self, direction: str, data: bytes) -> tuple[bytes | None, int | None]:
        """Return the content and size of the object that a frame names, as far as the frame has them."""
        initiate = Initiate.of(data)
        if self.is_answer is not (direction == READ):  # the other end has the content
            return None, None
        if self.is_in_blocks(data):
            return None, initiate.number if data[0] & wire.BLOCK_SIZE_GIVEN else None
        if data[0] & wire.EXPEDITED:
            return initiate.rest[: initiate.size], initiate.size
        return None, initiate.size


def sdo_words(end: SdoEnd, data: bytes) -> str:
    """Format an SDO frame."""
    initiate, command = Initiate.of(data), end.command(data)
    is_abort = data[0] >> 5 == ClientCommand.ABORT
    if command is None and not is_abort:
        return f"block command 0x{data[0]:02X}" if end.is_in_blocks(data) else f"command {data[0] >> 5}"
    if command and not command.names_object:
        return command.words if isinstance(command.words, str) else command.words(data)
    named = object_words(end.dictionary, initiate.address)
    if command is None:
        return f"abort {named}: {wire.code_and_reason(initiate.number)}"
    content, size = end.content(command.direction, data)
    said = f"{command.words} {named}{' in blocks' if end.is_in_blocks(data) else ''}"
    if content is not None:
        return f"{said} = {value_words(end.dictionary, initiate.address, content)}"
    return said if size is None else f"{said}, {size} bytes"


# NMT, SYNC, TIME, EMCY, error control, flying masters


def nmt_words(names: Mapping[int, str], data: bytes) -> str:
    """Format an NMT command and its node (CiA 301, 7.2.8.3.1)."""
    command, node_id = data
    name = COMMAND_NAMES.get(command, f"command {command}")
    return f"{name}, {'all nodes' if node_id == ALL_NODES else names.get(node_id, f'node {node_id}')}"


def heartbeat_words(data: bytes) -> str:
    """Format a node's state; a boot-up message has state 0 (CiA 301, 7.2.8.3.2.2, 7.2.8.3.3)."""
    return STATE_NAMES.get(data[0], f"state {data[0]}")


def guarding_words(data: bytes) -> str:
    """Format an answer to node guarding (CiA 301, 7.2.8.3.2.1)."""
    state = data[0] & ~TOGGLE
    return f"{STATE_NAMES.get(state, f'state {state}')}, toggle {data[0] // TOGGLE}"


def sync_words(data: bytes) -> str:
    """Format the counter, if there is one (CiA 301, 7.2.5.3)."""
    return f"counter {data[0]}" if data else ""


def time_words(data: bytes) -> str:
    """Format date and time; milliseconds beyond a day are invalid (CiA 301, 7.2.6.3)."""
    # The four highest bits of the milliseconds are reserved (CiA 301, 7.1.6.6).
    said = time_text(data[:3] + bytes([data[3] & 0x0F]) + data[4:6], is_moment=True)
    return said if isinstance(said, str) else f"no time: {data.hex(' ')}"


def emcy_words(words: Callable[[int], str], data: bytes) -> str:
    """Format error code, error register and the manufacturer's bytes (CiA 301, 7.2.7.3.1)."""
    code = int.from_bytes(data[:2], "little")
    register = data[2]
    info = data[3:].hex(" ")
    return f"0x{code:04X} {words(code)}, register 0x{register:02X}, {info}"


def plain(data: bytes) -> str:
    """Format bytes that no EDS describes."""
    return data.hex(" ")


def inverted(data: bytes) -> str:
    """Format the second frame of an SRDO, whose bits are inverted (CiA 304)."""
    return f"inverted {bytes(each ^ 0xFF for each in data).hex(' ')}"


def active_master(names: Mapping[int, str], data: bytes) -> str:
    """Format the announcement of the active master (CiA 302-2)."""
    priority, node_id = data
    return f"the active master is {names.get(node_id, f'node {node_id}')}, priority {priority}"


def said_plainly(what: str) -> Callable[[bytes], str]:
    """Return a formatter for services whose frames normally carry no data."""
    return lambda data: f"{what}, {data.hex(' ')}" if data else what


# LSS (CiA 305)


def _number(data: bytes) -> str:
    return f"0x{int.from_bytes(data[1:5], 'little'):08X}"


def _node_id(number: int) -> str:
    return "no node-ID" if number == standard.UNCONFIGURED else f"node-ID {number}"


def _state(data: bytes) -> str:
    name = LssState(data[1]).name.lower() if data[1] in set(LssState) else str(data[1])
    return f"all devices into state {name}"


def _bit_rate(data: bytes) -> str:
    table, index = data[1], data[2]
    rates = {index: f"{kbit} kbit/s" for kbit, index in standard.BIT_RATES.items()} | {
        standard.AUTOMATIC: "found by the device"
    }
    known = rates.get(index, f"index {index}") if table == 0 else f"index {index} of table {table}"
    return f"set bit rate: {known}"


def _fastscan(data: bytes) -> str:
    bit, part, then = data[5], data[6], data[7]
    if bit == standard.ANY_BIT:
        return "fastscan: is a device without a node-ID there?"
    name, following = (LSS_IDENTITY[each] if each < len(LSS_IDENTITY) else f"part {each}" for each in (part, then))
    return f"fastscan: {name} {_number(data)} down to bit {bit}, then {following}"


DONE = {Lss.CONFIGURE_NODE_ID: "set node-ID", Lss.CONFIGURE_BIT_TIMING: "set bit rate", Lss.STORE: "store"}


def _done(command: Lss, data: bytes) -> str:
    refused = standard.refusal_words(command, data[1], data[2]) if data[1] else "done"
    return f"{DONE[command]}: {refused}"


LssWords: TypeAlias = Mapping[int, Callable[[bytes], str]]


def _of_identity(what: str, first: Lss, parts: Iterable[str], with_number: bool = True) -> LssWords:
    """Return the formatters of the commands for each part of an identity, from the first one on."""

    def words(part: str, data: bytes) -> str:
        return f"{what} {part} {_number(data)}".lstrip() if with_number else f"{what} {part}"

    return {first + number: partial(words, part) for number, part in enumerate(parts)}


LSS_REQUESTS: LssWords = {
    Lss.SWITCH_GLOBAL: _state,
    Lss.CONFIGURE_NODE_ID: lambda data: f"set {_node_id(data[1])}",
    Lss.CONFIGURE_BIT_TIMING: _bit_rate,
    Lss.ACTIVATE_BIT_TIMING: lambda data: f"change the bit rate in {int.from_bytes(data[1:3], 'little')} ms",
    Lss.STORE: lambda _: "store",
    **_of_identity("select", Lss.SELECT, LSS_IDENTITY),
    **_of_identity("identify", Lss.IDENTIFY, standard.IDENTITY_RANGE),
    Lss.IDENTIFY_UNCONFIGURED: lambda _: "identify devices without a node-ID",
    Lss.FASTSCAN: _fastscan,
    **_of_identity("inquire", Lss.INQUIRE, LSS_IDENTITY, with_number=False),
    Lss.INQUIRE_NODE_ID: lambda _: "inquire node-ID",
}

LSS_ANSWERS: LssWords = {
    **{command: partial(_done, command) for command in DONE},
    Lss.SELECTED: lambda _: "selected",
    Lss.IDENTIFY_SLAVE: lambda _: "a device is there",
    Lss.UNCONFIGURED_SLAVE: lambda _: "a device without a node-ID is there",
    **_of_identity("", Lss.INQUIRE, LSS_IDENTITY),
    Lss.INQUIRE_NODE_ID: lambda data: _node_id(data[1]),
}


def lss_words(what: str, known: LssWords, data: bytes) -> str:
    """Format an LSS request or answer."""
    words = known.get(data[0])
    return words(data) if words else f"{what} 0x{data[0]:02X}, {data[1:].hex(' ')}"


# Fields of services by name

Fields: TypeAlias = dict[str, Any]
"""Fields of a frame: numbers, texts, bytes; absent ones are left out."""


def content_fields(dictionary: Dictionary | None, address: Address, octets: bytes) -> Fields:
    """Return an object's content as fields, with its value unless that is only bytes."""
    value = value_of(dictionary, address, octets)
    known: Fields = {} if isinstance(value, bytes) else {"value": value}
    variable = dictionary.variable(address) if dictionary and isinstance(value, (int, float)) else None
    if variable is not None and (unit := scale_of(variable).unit):
        known = {"value": physical(variable, value), "unit": unit}
    if variable is not None and (said := words(variable, value)):
        known["words"] = said
    return known | {"content": octets, "size": len(octets)}


def abort_fields(code: int) -> Fields:
    """Return an abort code as fields."""
    return {"abort": code, "abort_name": wire.reason(code)}


def sdo_fields(end: SdoEnd, data: bytes) -> Fields:
    """Return the fields of an SDO frame: the node, and the object with its value if it names one."""
    initiate, command = Initiate.of(data), end.command(data)
    said: Fields = {"node": end.server}
    named = {"index": initiate.address[0], "subindex": initiate.address[1]}
    if data[0] == wire.ABORT:
        return said | named | abort_fields(initiate.number)
    if command is None or not command.names_object:
        return said
    said |= {"direction": command.direction} | named
    content, size = end.content(command.direction, data)
    if content is not None:
        return said | content_fields(end.dictionary, initiate.address, content)
    return said if size is None else said | {"size": size}


def emcy_fields(words: Callable[[int], str], node_id: int, data: bytes) -> Fields:
    """Return the fields of an emergency."""
    code = int.from_bytes(data[:2], "little")
    return {"node": node_id, "code": code, "register": data[2], "words": words(code), "info": data[3:]}


def heartbeat_fields(node_id: int, data: bytes) -> Fields:
    """Return a node's state as fields, without the toggle bit of node guarding."""
    return {"node": node_id, "state": heartbeat_words(bytes([data[0] & ~TOGGLE]))}


def nmt_fields(data: bytes) -> Fields:
    """Return a command and its node (0 for all) as fields."""
    return {"node": data[1], "command": COMMAND_NAMES.get(data[0], f"command {data[0]}")}


NMT, GFC, FLYING_MASTER, SYNC_NAME, TIME_NAME = "NMT", "GFC", "Flying master", "SYNC", "TIME"
EMCY_NAME, SRDO, SDO, HEARTBEAT, GUARDING, LSS = "EMCY", "SRDO", "SDO", "Heartbeat", "Node guarding", "LSS"

NAMES = (NMT, GFC, FLYING_MASTER, SYNC_NAME, TIME_NAME, EMCY_NAME, SRDO, SDO, HEARTBEAT, GUARDING, LSS)
"""Names of all services."""

FOLLOWED = (SDO, HEARTBEAT, GUARDING, NMT, LSS)
"""Services whose frames depend on earlier ones."""

NO_WORDS = ErrorWords({}, {}, {})
"""Only the words of CiA 301."""

ANY_LENGTH: tuple[int, ...] = ()

TIME_LENGTHS = (6, 8)
"""Lengths of TIME in bytes: 6 (CiA 301, 7.2.6.3), or 8 as some devices pad it."""

SENT = 1
"""Direction of an SRDO that its device sends (CiA 304); 2 is received."""


class CanopenService(NamedTuple):
    """Service of an identifier: its name, node, `lengths` of frames (none: any), and formatter.

    `sender` is who sends it; empty if that cannot be known. `fields` returns what a frame says as data.
    """

    name: str
    node: str
    lengths: tuple[int, ...]
    text: Callable[[bytes], str]
    sender: str = ""
    end: SdoEnd | None = None
    fields: Callable[[bytes], Fields] = lambda _: {}

    @property
    def expected(self) -> str:
        """Lengths as text."""
        return " or ".join(map(str, self.lengths))


class KnownNode(NamedTuple):
    """A node that a frame is from or for: its name, and its dictionary if there is one."""

    node_id: int
    name: str
    dictionary: Dictionary | None = None

    @classmethod
    def unnamed(cls, node_id: int, profile: int = 0) -> KnownNode:
        """Return a node without a file, with the objects of its `profile` (0: unknown)."""
        return cls(node_id, f"node {node_id}", dictionary_of(profile))


Services = dict[int, CanopenService]


def services(
    dictionaries: Iterable[Dictionary],
    errors: ErrorWords = NO_WORDS,
    master: str = MASTER,
    learned: Iterable[Dictionary] = (),
) -> Services:
    """Return the services by identifier: the predefined ones of all node-IDs, then those of the EDS files.

    `errors` are the words for the devices' emergency error codes; they know their profiles, by which objects of devices
    without files have names. `master` is the name of who leads the network. What is `learned` of devices without files
    says where their services are.
    """
    known = {each.node_id: KnownNode(each.node_id, each.name, each) for each in dictionaries}
    found = _broadcast({node_id: node.name for node_id, node in known.items()}, master)
    emcy = {}
    for node_id in values.NODE_IDS:
        node = known.get(node_id) or KnownNode.unnamed(node_id, errors.profiles.get(node_id, 0))
        said = errors.of(node_id)
        words = partial(emcy_words, said)
        fields = partial(emcy_fields, said, node_id)
        emcy[node_id] = CanopenService(EMCY_NAME, node.name, (8,), words, node.name, fields=fields)
        found[values.EMCY_BASE + node_id] = emcy[node_id]
        found |= _sdo(node, values.SDO_REQUEST_BASE + node_id, values.SDO_RESPONSE_BASE + node_id, master)
        fields = partial(heartbeat_fields, node_id)
        state = CanopenService(HEARTBEAT, node.name, (1,), heartbeat_words, node.name, fields=fields)
        found[values.ERROR_CONTROL_BASE + node_id] = state
    devices = [*(each.dictionary for each in known.values() if each.dictionary), *learned]
    for device in devices:  # after the predefined ones, as a node's file takes precedence
        found |= _moved(device, found, emcy[device.node_id]) | _safety(device)
    for device in devices:  # after all COB-IDs of SYNC and TIME are known
        found |= _produced(device, found)
        for server, client, request, answer in sdo_channels(device):
            asks = known.get(client, KnownNode.unnamed(client)).name if client else master
            node = known.get(server) or KnownNode.unnamed(server, errors.profiles.get(server, 0))
            found |= _sdo(node, request, answer, asks)
    return found


def _broadcast(names: Mapping[int, str], master: str) -> Services:
    """Return the services without a node."""
    return {
        values.NMT_COB_ID: CanopenService(NMT, "", (2,), partial(nmt_words, names), master, fields=nmt_fields),
        0x001: CanopenService(GFC, "", (0,), said_plainly("all devices into their safe state")),
        0x071: CanopenService(FLYING_MASTER, "", (2,), partial(active_master, names), master),
        0x072: CanopenService(FLYING_MASTER, "", ANY_LENGTH, said_plainly("negotiation of a new master")),
        0x073: CanopenService(FLYING_MASTER, "", ANY_LENGTH, said_plainly("who is the active master?")),
        0x074: CanopenService(FLYING_MASTER, "", ANY_LENGTH, said_plainly("a device that can be master is there")),
        0x075: CanopenService(FLYING_MASTER, "", ANY_LENGTH, said_plainly("who can be master?")),
        0x076: CanopenService(FLYING_MASTER, "", ANY_LENGTH, said_plainly("negotiation of a new master is forced")),
        values.SYNC_COB_ID: CanopenService(SYNC_NAME, "", (0, 1), sync_words, master),
        values.TIME_COB_ID: CanopenService(TIME_NAME, "", TIME_LENGTHS, time_words, master),
        standard.REQUESTS: CanopenService(LSS, "", (8,), partial(lss_words, "request", LSS_REQUESTS), master),
        standard.ANSWERS: CanopenService(LSS, "", (8,), partial(lss_words, "answer", LSS_ANSWERS)),
    }


@lru_cache(1 << 9)
def _sdo(node: KnownNode, request: int, answer: int, client: str) -> Services:
    found = {}
    for is_answer, (cob_id, sender) in enumerate(((request, client), (answer, node.name))):
        end = SdoEnd(request, bool(is_answer), node.dictionary, node.node_id)
        words, fields = partial(sdo_words, end), partial(sdo_fields, end)
        found[cob_id] = CanopenService(SDO, node.name, (wire.LENGTH,), words, sender, end, fields)
    return found


def _moved(dictionary: Dictionary, predefined: Services, emcy: CanopenService) -> Services:
    """Return the services whose COB-ID the file moves from the default."""
    sync, time = predefined[values.SYNC_COB_ID], predefined[values.TIME_COB_ID]
    entries = {standard.SYNC: sync, standard.TIME: time, standard.EMCY: emcy}
    found = {address: dictionary.number(address) for address in entries}
    # The highest bit means "not valid" only for EMCY; for TIME it is "consumed", for SYNC it has no meaning.
    return {
        values.identifier(entry): entries[address]
        for address, entry in found.items()
        if entry is not None and not (address == standard.EMCY and entry & values.NOT_VALID)
    }


def _produced(dictionary: Dictionary, known: Services) -> Services:
    """Return SYNC and TIME if the device's file makes it their producer."""
    entries = (dictionary.number(each) or 0 for each in (standard.SYNC, standard.TIME))
    produced = [
        values.identifier(entry) for entry in entries if entry & standard.SYNC_PRODUCER
    ]  # the same bit for TIME
    return {cob_id: known[cob_id]._replace(sender=dictionary.name) for cob_id in produced}


def _safety(dictionary: Dictionary) -> Services:
    """Return the SRDOs of a device: data, and the same with inverted bits (CiA 304)."""
    found = {}
    for index in (each for each in standard.SRDOS if each in dictionary.members):
        if direction := dictionary.number((index, standard.SRDO_DIRECTION)):  # 0: it is not valid
            for sub, text in ((standard.SRDO_DATA, plain), (standard.SRDO_INVERTED, inverted)):
                if entry := dictionary.number((index, sub)):
                    found[values.identifier(entry)] = CanopenService(
                        SRDO, dictionary.name, ANY_LENGTH, text, dictionary.name if direction == SENT else ""
                    )
    return found
