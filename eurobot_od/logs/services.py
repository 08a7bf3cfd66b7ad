"""The CANopen services beside the messages: NMT, EMCY, SDO, boot-up and heartbeat (CiA 301, 7.2 and 7.3.3).

Rule of this file: one frame at a time. What a frame means is said without the frames before it, so that a log may
begin anywhere; the middle of a segmented or block transfer is therefore only named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

from eurobot_od.device.emergency import error_words
from eurobot_od.device.nmt import ALL_NODES, NmtCommand, NmtState
from eurobot_od.od.outline import Outline
from eurobot_od.od.values import (
    EMCY_BASE,
    ERROR_CONTROL_BASE,
    NMT_COB_ID,
    NODE_IDS,
    NOT_VALID,
    SDO_REQUEST_BASE,
    SDO_RESPONSE_BASE,
    Address,
)

EMCY_ENTRY: Address = (0x1014, 0)
SDO_REQUEST_ENTRY: Address = (0x1200, 1)
SDO_ANSWER_ENTRY: Address = (0x1200, 2)


class Service(NamedTuple):
    """What an identifier is for: the service's name, its node, the frame's length, and how it is read."""

    name: str
    node: str
    length: int
    text: Callable[[bytes], str]


class Known(NamedTuple):
    """What is known of the node that a frame is from or for: its name, and the outline of its EDS if there is one."""

    name: str
    outline: Outline | None = None


def services(outlines: Iterable[Outline], errors: Mapping[int, str] = MappingProxyType({})) -> dict[int, Service]:
    """Return the services by identifier: the predefined ones of all node-IDs, then what the EDS files say.

    `errors` are words for the error codes that are the devices' own.
    """
    known = {each.node_id: Known(each.name, each) for each in outlines}
    found = {NMT_COB_ID: Service("NMT", "", 2, partial(nmt_text, {n: k.name for n, k in known.items()}))}
    for node_id in NODE_IDS:
        found |= dict(_predefined(node_id, known.get(node_id, Known(f"node {node_id}")), errors))
    for each in known.values():
        found |= dict(_configured(each, errors))
    return found


def _predefined(node_id: int, node: Known, errors: Mapping[int, str]) -> Iterator[tuple[int, Service]]:
    yield EMCY_BASE + node_id, _emcy(node, errors)
    yield SDO_REQUEST_BASE + node_id, _sdo(node, REQUESTS)
    yield SDO_RESPONSE_BASE + node_id, _sdo(node, ANSWERS)
    yield ERROR_CONTROL_BASE + node_id, Service("Heartbeat", node.name, 1, heartbeat_text)


def _configured(node: Known, errors: Mapping[int, str]) -> Iterator[tuple[int, Service]]:
    services = _emcy(node, errors), _sdo(node, REQUESTS), _sdo(node, ANSWERS)
    for address, service in zip((EMCY_ENTRY, SDO_REQUEST_ENTRY, SDO_ANSWER_ENTRY), services):
        value = node.outline.number(address) if node.outline else None
        if value is not None and not value & NOT_VALID:
            yield value, service


def _emcy(node: Known, errors: Mapping[int, str]) -> Service:
    return Service("EMCY", node.name, 8, partial(emcy_text, errors))


def _sdo(node: Known, table: Commands) -> Service:
    return Service("SDO", node.name, 8, partial(sdo_text, table, node.outline))


# NMT, heartbeat, EMCY


def nmt_text(names: Mapping[int, str], data: bytes) -> str:
    """Say what an NMT command tells whom (CiA 301, 7.2.8.3.1)."""
    command, node_id = data
    name = _plain(NmtCommand(command)) if command in set(NmtCommand) else f"command {command}"
    return f"{name}, {'all nodes' if node_id == ALL_NODES else names.get(node_id, f'node {node_id}')}"


def heartbeat_text(data: bytes) -> str:
    """Say a node's state; a boot-up message is a heartbeat of state 0 (CiA 301, 7.2.8.3.2.2, 7.2.8.3.3)."""
    if data[0] == NmtState.INITIALISING:
        return "boot-up"
    return _plain(NmtState(data[0])) if data[0] in set(NmtState) else f"state {data[0]}"


def emcy_text(errors: Mapping[int, str], data: bytes) -> str:
    """Say error code, error register and the manufacturer's bytes (CiA 301, 7.2.7.3.1)."""
    code, register, info = int.from_bytes(data[:2], "little"), data[2], data[3:].hex(" ")
    return f"0x{code:04X} {error_words(code, errors)}, register 0x{register:02X}, {info}"


def _plain(member: NmtCommand | NmtState) -> str:
    return member.name.lower().replace("_", " ")


# SDO (CiA 301, 7.2.4.3)

SdoText: TypeAlias = Callable[["Outline | None", bytes], str]
Commands: TypeAlias = Mapping[int, SdoText]

EXPEDITED, SIZED, LAST = 1 << 1, 1 << 0, 1 << 0
"""Bits of a command byte: data in the frame itself, its size is given, last segment."""


def sdo_text(commands: Commands, outline: Outline | None, data: bytes) -> str:
    """Say what an SDO frame asks or answers; `commands` are those of its direction."""
    text = commands.get(data[0] >> 5)
    return text(outline, data) if text else f"command {data[0] >> 5}"


def _address(data: bytes) -> Address:
    return int.from_bytes(data[1:3], "little"), data[3]


def _object(outline: Outline | None, data: bytes) -> str:
    index, subindex = address = _address(data)
    where = f"0x{index:04X}:{subindex:02X}"
    described = outline.described(address) if outline else None
    return where if described is None else f"{where} {described.name.replace('.', ', ')}"


def _expedited(outline: Outline | None, data: bytes) -> str:
    command, content = data[0], data[4:]
    if not command & EXPEDITED:
        return f", {int.from_bytes(content, 'little')} bytes" if command & SIZED else ""
    value = content[: 4 - (command >> 2 & 3)] if command & SIZED else content
    return f" = {_value(outline, _address(data), value)}"


def _value(outline: Outline | None, address: Address, value: bytes) -> str:
    described = outline.described(address) if outline else None
    try:
        return str(described.type.read(value)) if described else value.hex(" ")
    except ValueError:  # a length that the type does not have
        return value.hex(" ")


def _segment(_: Outline | None, data: bytes) -> str:
    return f"segment of {7 - (data[0] >> 1 & 7)} bytes" + ", the last" * (data[0] & LAST)


def _abort(outline: Outline | None, data: bytes) -> str:
    from canopen.sdo.exceptions import SdoAbortedError

    code = int.from_bytes(data[4:], "little")
    reason = SdoAbortedError.CODES.get(code, "unknown code")
    return f"abort {_object(outline, data)}: 0x{code:08X} {reason}"


def _of_object(what: str, value: bool = False) -> SdoText:
    return lambda outline, data: f"{what} {_object(outline, data)}{_expedited(outline, data) if value else ''}"


def _plainly(what: str) -> SdoText:
    return lambda _outline, _data: what


REQUESTS: Commands = {
    0: _segment,
    1: _of_object("write", value=True),
    2: _of_object("read"),
    3: _plainly("next segment"),
    4: _abort,
    5: _plainly("block upload"),
    6: _plainly("block download"),
}
"""Client command specifiers."""

ANSWERS: Commands = {
    0: _segment,
    1: _plainly("segment taken"),
    2: _of_object("value of", value=True),
    3: _of_object("written"),
    4: _abort,
    5: _plainly("block download"),
    6: _plainly("block upload"),
}
"""Server command specifiers."""
