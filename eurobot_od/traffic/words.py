"""What the frame of a service says by itself: SDO (CiA 301, 7.2.4.3), NMT, SYNC, TIME, EMCY, error control, LSS.

A frame of a valid length goes in, words come out. What only the frames before it tell is in `transfers`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

from eurobot_od.device.nmt import ALL_NODES, COMMAND_NAMES, STATE_NAMES, TOGGLE
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.standard import (
    ANY_BIT,
    AUTOMATIC,
    BIT_RATES,
    IDENTITY_RANGE,
    LSS_IDENTITY,
    UNCONFIGURED,
    Lss,
    LssState,
    refusal_words,
)
from eurobot_od.od.values import Address
from eurobot_od.od.values import text as time_text
from eurobot_od.od.words import with_words, words
from eurobot_od.sdo.wire import (
    ANSWER_SUB_COMMAND,
    BLOCK_SIZE_GIVEN,
    EXPEDITED,
    LAST,
    REQUEST_SUB_COMMAND,
    Block,
    ClientCommand,
    Initiate,
    ServerCommand,
    code_and_reason,
    part_in,
)

SdoText: TypeAlias = Callable[["Dictionary | None", bytes], str]
Commands: TypeAlias = Mapping[int, SdoText]


def frame_words(commands: Commands, dictionary: Dictionary | None, data: bytes) -> str:
    """Say what an SDO frame asks or answers; `commands` are those of its direction."""
    text = commands.get(data[0] >> 5)
    return text(dictionary, data) if text else f"command {data[0] >> 5}"


def object_words(dictionary: Dictionary | None, address: Address) -> str:
    """Write an object with its name, if the device's file has it."""
    index, subindex = address
    where = f"0x{index:04X}:{subindex:02X}"
    variable = dictionary.variable(address) if dictionary else None
    return where if variable is None else f"{where} {variable.qualname.replace('.', ', ')}"


def value_words(dictionary: Dictionary | None, address: Address, octets: bytes) -> str:
    """Write a value by its object's type; as bytes if that is not known, or has another length."""
    variable = dictionary.variable(address) if dictionary else None
    if variable is None:
        return octets.hex(" ")
    try:
        value = data_type(variable).read(octets)
    except ValueError:  # a length that the type does not have
        return octets.hex(" ")
    return with_words(value.hex(" ") if isinstance(value, bytes) else str(value), words(variable, value))


def _segment(_: Dictionary | None, data: bytes) -> str:
    return f"segment of {len(part_in(data))} bytes" + ", the last" * (data[0] & LAST)


def _abort(dictionary: Dictionary | None, data: bytes) -> str:
    _, address, _ = abort = Initiate.of(data)
    return f"abort {object_words(dictionary, address)}: {code_and_reason(abort.number)}"


def _of_object(what: str, value: bool = False) -> SdoText:
    def text(dictionary: Dictionary | None, data: bytes) -> str:
        initiate = Initiate.of(data)
        said = f"{what} {object_words(dictionary, initiate.address)}"
        if not value:
            return said
        if not initiate.command & EXPEDITED:
            return said if initiate.size is None else f"{said}, {initiate.size} bytes"
        return f"{said} = {value_words(dictionary, initiate.address, initiate.rest[: initiate.size])}"

    return text


def _plainly(what: str) -> SdoText:
    return lambda _dictionary, _data: what


def _block(mask: int, words: Mapping[int, SdoText]) -> SdoText:
    """Return the words of a block transfer by its sub-command."""

    def text(dictionary: Dictionary | None, data: bytes) -> str:
        found = words.get(data[0] & mask)
        return found(dictionary, data) if found else f"block command 0x{data[0]:02X}"

    return text


def _begun(what: str, with_size: bool = False) -> SdoText:
    def text(dictionary: Dictionary | None, data: bytes) -> str:
        initiate = Initiate.of(data)
        size = f", {initiate.number} bytes" * bool(with_size and initiate.command & BLOCK_SIZE_GIVEN)
        return f"{what} {object_words(dictionary, initiate.address)} in blocks{size}"

    return text


_ACKNOWLEDGED: SdoText = lambda _, data: f"block taken up to segment {data[1]}"  # noqa: E731 (a row of the tables)

REQUESTS: Commands = {
    ClientCommand.DOWNLOAD_SEGMENT: _segment,
    ClientCommand.DOWNLOAD: _of_object("write", value=True),
    ClientCommand.UPLOAD: _of_object("read"),
    ClientCommand.UPLOAD_SEGMENT: _plainly("next segment"),
    ClientCommand.ABORT: _abort,
    ClientCommand.BLOCK_UPLOAD: _block(
        REQUEST_SUB_COMMAND[ClientCommand.BLOCK_UPLOAD],
        {
            Block.INITIATE: _begun("read"),
            Block.END: _plainly("end of blocks taken"),
            Block.ACKNOWLEDGE: _ACKNOWLEDGED,
            Block.START: _plainly("start of blocks"),
        },
    ),
    ClientCommand.BLOCK_DOWNLOAD: _block(
        REQUEST_SUB_COMMAND[ClientCommand.BLOCK_DOWNLOAD],
        {Block.INITIATE: _begun("write", with_size=True), Block.END: _plainly("end of blocks")},
    ),
}

ANSWERS: Commands = {
    ServerCommand.UPLOAD_SEGMENT: _segment,
    ServerCommand.DOWNLOAD_SEGMENT: _plainly("segment taken"),
    ServerCommand.UPLOAD: _of_object("value of", value=True),
    ServerCommand.DOWNLOAD: _of_object("written"),
    ServerCommand.ABORT: _abort,
    ServerCommand.BLOCK_DOWNLOAD: _block(
        ANSWER_SUB_COMMAND[ServerCommand.BLOCK_DOWNLOAD],
        {
            Block.INITIATE: _begun("ready for"),
            Block.END: _plainly("end of blocks taken"),
            Block.ACKNOWLEDGE: _ACKNOWLEDGED,
        },
    ),
    ServerCommand.BLOCK_UPLOAD: _block(
        ANSWER_SUB_COMMAND[ServerCommand.BLOCK_UPLOAD],
        {Block.INITIATE: _begun("value of", with_size=True), Block.END: _plainly("end of blocks")},
    ),
}


# NMT, SYNC, TIME, EMCY, error control, flying masters


def nmt(names: Mapping[int, str], data: bytes) -> str:
    """Say which NMT command goes to which node (CiA 301, 7.2.8.3.1)."""
    command, node_id = data
    name = COMMAND_NAMES.get(command, f"command {command}")
    return f"{name}, {'all nodes' if node_id == ALL_NODES else names.get(node_id, f'node {node_id}')}"


def heartbeat(data: bytes) -> str:
    """Say a node's state; a boot-up message is a heartbeat of state 0 (CiA 301, 7.2.8.3.2.2, 7.2.8.3.3)."""
    return STATE_NAMES.get(data[0], f"state {data[0]}")


def guarding(data: bytes) -> str:
    """Say what a node answers to a guarding master (CiA 301, 7.2.8.3.2.1)."""
    state = data[0] & ~TOGGLE
    return f"{STATE_NAMES.get(state, f'state {state}')}, toggle {data[0] // TOGGLE}"


def sync(data: bytes) -> str:
    """Say the counter, if there is one (CiA 301, 7.2.5.3)."""
    return f"counter {data[0]}" if data else ""


def time(data: bytes) -> str:
    """Say date and time; milliseconds beyond a day are not a time (CiA 301, 7.2.6.3)."""
    # The four highest bits of the milliseconds are reserved (CiA 301, 7.1.6.6).
    said = time_text(data[:3] + bytes([data[3] & 0x0F]) + data[4:], is_moment=True)
    return said if isinstance(said, str) else f"no time: {data.hex(' ')}"


def emcy(words: Callable[[int], str], data: bytes) -> str:
    """Say error code, error register and the manufacturer's bytes (CiA 301, 7.2.7.3.1)."""
    code, register, info = int.from_bytes(data[:2], "little"), data[2], data[3:].hex(" ")
    return f"0x{code:04X} {words(code)}, register 0x{register:02X}, {info}"


def plain(data: bytes) -> str:
    """Write bytes of which no file says more."""
    return data.hex(" ")


def inverted(data: bytes) -> str:
    """Write the second frame of an SRDO as the first one, whose bits it has inverted (CiA 304)."""
    return f"inverted {bytes(each ^ 0xFF for each in data).hex(' ')}"


def active_master(names: Mapping[int, str], data: bytes) -> str:
    """Say who is the active master (CiA 302-2)."""
    priority, node_id = data
    return f"the active master is {names.get(node_id, f'node {node_id}')}, priority {priority}"


def said_plainly(what: str) -> Callable[[bytes], str]:
    """Return the words for a service that says nothing but that it is there; with its data, if it has some."""
    return lambda data: f"{what}, {data.hex(' ')}" if data else what


# LSS (CiA 305)


def lss_request(data: bytes) -> str:
    """Say what a master asks."""
    words = LSS_REQUESTS.get(data[0])
    return words(data) if words else f"request 0x{data[0]:02X}, {data[1:].hex(' ')}"


def lss_answer(data: bytes) -> str:
    """Say what a device answers."""
    words = LSS_ANSWERS.get(data[0])
    return words(data) if words else f"answer 0x{data[0]:02X}, {data[1:].hex(' ')}"


def _number(data: bytes) -> str:
    return f"0x{int.from_bytes(data[1:5], 'little'):08X}"


def _node_id(number: int) -> str:
    return "no node-ID" if number == UNCONFIGURED else f"node-ID {number}"


def _state(data: bytes) -> str:
    name = LssState(data[1]).name.lower() if data[1] in set(LssState) else str(data[1])
    return f"all devices into state {name}"


def _bit_rate(data: bytes) -> str:
    table, index = data[1], data[2]
    rates = {index: f"{kbit} kbit/s" for kbit, index in BIT_RATES.items()} | {AUTOMATIC: "found by the device"}
    known = rates.get(index, f"index {index}") if table == 0 else f"index {index} of table {table}"
    return f"set bit rate: {known}"


def _fastscan(data: bytes) -> str:
    bit, part, then = data[5], data[6], data[7]
    if bit == ANY_BIT:
        return "fastscan: is a device without a node-ID there?"
    name, following = (LSS_IDENTITY[each] if each < len(LSS_IDENTITY) else f"part {each}" for each in (part, then))
    return f"fastscan: {name} {_number(data)} down to bit {bit}, then {following}"


def _done(command: Lss) -> Callable[[bytes], str]:
    name = {
        Lss.CONFIGURE_NODE_ID: "set node-ID",
        Lss.CONFIGURE_BIT_TIMING: "set bit rate",
        Lss.STORE: "store",
    }[command]
    return lambda data: f"{name}: {refusal_words(command, data[1], data[2]) if data[1] else 'done'}"


LSS_REQUESTS: Mapping[int, Callable[[bytes], str]] = {
    Lss.SWITCH_GLOBAL: _state,
    Lss.CONFIGURE_NODE_ID: lambda data: f"set {_node_id(data[1])}",
    Lss.CONFIGURE_BIT_TIMING: _bit_rate,
    Lss.ACTIVATE_BIT_TIMING: lambda data: f"change the bit rate in {int.from_bytes(data[1:3], 'little')} ms",
    Lss.STORE: lambda _: "store",
    **{
        Lss.SELECT + n: lambda data, name=name: f"select {name} {_number(data)}"  # type: ignore[misc]
        for n, name in enumerate(LSS_IDENTITY)
    },
    **{
        Lss.IDENTIFY + n: lambda data, name=name: f"identify {name} {_number(data)}"  # type: ignore[misc]
        for n, name in enumerate(IDENTITY_RANGE)
    },
    Lss.IDENTIFY_UNCONFIGURED: lambda _: "identify devices without a node-ID",
    Lss.FASTSCAN: _fastscan,
    **{
        Lss.INQUIRE + n: lambda _, name=name: f"inquire {name}"  # type: ignore[misc]
        for n, name in enumerate(LSS_IDENTITY)
    },
    Lss.INQUIRE_NODE_ID: lambda _: "inquire node-ID",
}

LSS_ANSWERS: Mapping[int, Callable[[bytes], str]] = {
    **{each: _done(each) for each in (Lss.CONFIGURE_NODE_ID, Lss.CONFIGURE_BIT_TIMING, Lss.STORE)},
    Lss.SELECTED: lambda _: "selected",
    Lss.IDENTIFY_SLAVE: lambda _: "a device is there",
    Lss.UNCONFIGURED_SLAVE: lambda _: "a device without a node-ID is there",
    **{
        Lss.INQUIRE + n: lambda data, name=name: f"{name} {_number(data)}"  # type: ignore[misc]
        for n, name in enumerate(LSS_IDENTITY)
    },
    Lss.INQUIRE_NODE_ID: lambda data: _node_id(data[1]),
}
