"""The CANopen services besides the messages: NMT, EMCY, SDO, boot-up and heartbeat (CiA 301, 7.2 and 7.3.3).

Rule of this file: one frame at a time. What a frame means is said without the frames before it, so that a log may
start anywhere; the middle of a segmented or block transfer is therefore only named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

from eurobot_od.device.emergency import error_words
from eurobot_od.device.nmt import ALL_NODES, COMMAND_NAMES, STATE_NAMES
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.standard import EMCY, SDO_ANSWERS, SDO_REQUESTS
from eurobot_od.profiles.words import with_words, words
from eurobot_od.sdo.wire import EXPEDITED, LAST, ClientCommand, Initiate, ServerCommand, code_and_reason, part_in


class CanopenService(NamedTuple):
    """What an identifier is for: the service's name, its node, the frame's length, and how it is read."""

    name: str
    node: str
    length: int
    text: Callable[[bytes], str]


class KnownNode(NamedTuple):
    """What is known of the node that a frame is from or for: its name, and its dictionary if there is one."""

    name: str
    dictionary: Dictionary | None = None


def services(
    dictionaries: Iterable[Dictionary], errors: Mapping[int, str] = MappingProxyType({})
) -> dict[int, CanopenService]:
    """Return the services by identifier: the predefined ones of all node-IDs, then what the EDS files say.

    `errors` are words for the error codes that are the devices' own.
    """
    known = {each.node_id: KnownNode(each.name, each) for each in dictionaries}
    found = {values.NMT_COB_ID: CanopenService("NMT", "", 2, partial(nmt_text, {n: k.name for n, k in known.items()}))}
    for node_id in values.NODE_IDS:
        node = known.get(node_id, KnownNode(f"node {node_id}"))
        bases = values.EMCY_BASE, values.SDO_REQUEST_BASE, values.SDO_RESPONSE_BASE
        found |= {base + node_id: service for base, service in zip(bases, _of_node(node, errors))}
        found[values.ERROR_CONTROL_BASE + node_id] = CanopenService("Heartbeat", node.name, 1, heartbeat_text)
    for node in known.values():  # after the predefined ones: what a node's file says is what it does
        for address, service in zip((EMCY, SDO_REQUESTS, SDO_ANSWERS), _of_node(node, errors)):
            cob_id = node.dictionary.number(address) if node.dictionary else None
            if cob_id is not None and not cob_id & values.NOT_VALID:
                found[cob_id] = service
    return found


def _of_node(node: KnownNode, errors: Mapping[int, str]) -> Iterator[CanopenService]:
    """Yield EMCY, SDO requests and SDO answers."""
    yield CanopenService("EMCY", node.name, 8, partial(emcy_text, errors))
    for commands in (REQUESTS, ANSWERS):
        yield CanopenService("SDO", node.name, 8, partial(sdo_text, commands, node.dictionary))


# NMT, heartbeat, EMCY


def nmt_text(names: Mapping[int, str], data: bytes) -> str:
    """Say which NMT command goes to which node (CiA 301, 7.2.8.3.1)."""
    command, node_id = data
    name = COMMAND_NAMES.get(command, f"command {command}")
    return f"{name}, {'all nodes' if node_id == ALL_NODES else names.get(node_id, f'node {node_id}')}"


def heartbeat_text(data: bytes) -> str:
    """Say a node's state; a boot-up message is a heartbeat of state 0 (CiA 301, 7.2.8.3.2.2, 7.2.8.3.3)."""
    return STATE_NAMES.get(data[0], f"state {data[0]}")


def emcy_text(errors: Mapping[int, str], data: bytes) -> str:
    """Say error code, error register and the manufacturer's bytes (CiA 301, 7.2.7.3.1)."""
    code, register, info = int.from_bytes(data[:2], "little"), data[2], data[3:].hex(" ")
    return f"0x{code:04X} {error_words(code, errors)}, register 0x{register:02X}, {info}"


# SDO (CiA 301, 7.2.4.3)

SdoText: TypeAlias = Callable[["Dictionary | None", bytes], str]
Commands: TypeAlias = Mapping[int, SdoText]


def sdo_text(commands: Commands, dictionary: Dictionary | None, data: bytes) -> str:
    """Say what an SDO frame asks or answers; `commands` are those of its direction."""
    text = commands.get(data[0] >> 5)
    return text(dictionary, data) if text else f"command {data[0] >> 5}"


def _object(dictionary: Dictionary | None, address: values.Address) -> str:
    index, subindex = address
    where = f"0x{index:04X}:{subindex:02X}"
    variable = dictionary.variable(address) if dictionary else None
    return where if variable is None else f"{where} {variable.qualname.replace('.', ', ')}"


def _segment(_: Dictionary | None, data: bytes) -> str:
    return f"segment of {len(part_in(data))} bytes" + ", the last" * (data[0] & LAST)


def _abort(dictionary: Dictionary | None, data: bytes) -> str:
    _, address, _ = abort = Initiate.of(data)
    return f"abort {_object(dictionary, address)}: {code_and_reason(abort.number)}"


def _of_object(what: str, value: bool = False) -> SdoText:
    def text(dictionary: Dictionary | None, data: bytes) -> str:
        initiate = Initiate.of(data)
        said = f"{what} {_object(dictionary, initiate.address)}"
        if not value:
            return said
        if not initiate.command & EXPEDITED:
            return said if initiate.size is None else f"{said}, {initiate.size} bytes"
        octets, variable = initiate.rest[: initiate.size], dictionary.variable(initiate.address) if dictionary else None
        try:
            if variable is None:
                return f"{said} = {octets.hex(' ')}"
            meant = data_type(variable).read(octets)
            return f"{said} = {with_words(str(meant), words(variable, meant))}"
        except ValueError:  # a length that the type does not have
            return f"{said} = {octets.hex(' ')}"

    return text


def _plainly(what: str) -> SdoText:
    return lambda _dictionary, _data: what


REQUESTS: Commands = {
    ClientCommand.DOWNLOAD_SEGMENT: _segment,
    ClientCommand.DOWNLOAD: _of_object("write", value=True),
    ClientCommand.UPLOAD: _of_object("read"),
    ClientCommand.UPLOAD_SEGMENT: _plainly("next segment"),
    ClientCommand.ABORT: _abort,
    ClientCommand.BLOCK_UPLOAD: _plainly("block upload"),
    ClientCommand.BLOCK_DOWNLOAD: _plainly("block download"),
}

ANSWERS: Commands = {
    ServerCommand.UPLOAD_SEGMENT: _segment,
    ServerCommand.DOWNLOAD_SEGMENT: _plainly("segment taken"),
    ServerCommand.UPLOAD: _of_object("value of", value=True),
    ServerCommand.DOWNLOAD: _of_object("written"),
    ServerCommand.ABORT: _abort,
    ServerCommand.BLOCK_DOWNLOAD: _plainly("block download"),
    ServerCommand.BLOCK_UPLOAD: _plainly("block upload"),
}
