"""What the frames of network services say: NMT, SYNC, TIME, EMCY, error control, flying masters, LSS.

Rule of this file: data of a length that the service has, in; words out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from eurobot_od.device.nmt import ALL_NODES, COMMAND_NAMES, STATE_NAMES, TOGGLE
from eurobot_od.od.lss import (
    ANY_BIT,
    AUTOMATIC,
    BIT_RATES,
    IDENTITY,
    IDENTITY_RANGE,
    UNCONFIGURED,
    Lss,
    LssState,
    refusal_words,
)
from eurobot_od.od.time_of_day import text as time_text


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
    """Say date and time; milliseconds beyond a day are no time (CiA 301, 7.2.6.3)."""
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
    name, following = (IDENTITY[each] if each < len(IDENTITY) else f"part {each}" for each in (part, then))
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
        for n, name in enumerate(IDENTITY)
    },
    **{
        Lss.IDENTIFY + n: lambda data, name=name: f"identify {name} {_number(data)}"  # type: ignore[misc]
        for n, name in enumerate(IDENTITY_RANGE)
    },
    Lss.IDENTIFY_UNCONFIGURED: lambda _: "identify devices without a node-ID",
    Lss.FASTSCAN: _fastscan,
    **{
        Lss.INQUIRE + n: lambda _, name=name: f"inquire {name}"  # type: ignore[misc]
        for n, name in enumerate(IDENTITY)
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
        for n, name in enumerate(IDENTITY)
    },
    Lss.INQUIRE_NODE_ID: lambda data: _node_id(data[1]),
}
