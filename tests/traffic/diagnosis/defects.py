"""For each rule of `diagnose` a log with the defect that it must find, and a near miss that it must not.

A log is frames with their times in s, in candump's form; `at` is when the incident is seen first.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.traffic.diagnosis.incidents import IncidentRule
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.load import MessageSet, PeriodicMessage
from tests.eds_text import DEVICE_TYPE, pdo, record, variable

Log = list[tuple[float, str]]


class RuleDefect(NamedTuple):
    """A log that breaks a rule, when it does first, and one that nearly does; `devices` have files in DEVICES.

    `promised` is what the network file says. `near_devices` are those of the near miss, if it has others.
    """

    rule: IncidentRule
    broken: Log
    at: float
    near: Log
    devices: tuple[str, ...] = ()
    promised: MessageSet | None = None
    near_devices: tuple[str, ...] | None = None
    near_promised: MessageSet | None = None


# The devices


def _device(node_id: int, name: str, *sections: str, heartbeat: str = "100", dcf: bool = False) -> Dictionary:
    beat = variable("1017", "Heartbeat", "UNSIGNED16", heartbeat)
    data = variable("2000", "Speed", "INTEGER16", None, "LowLimit=-100\nHighLimit=100\n")
    suffix = "dcf" if dcf else "eds"
    text = "".join((DEVICE_TYPE, beat, data, *sections))
    return Dictionary.read(text.encode(), Path(f"{name}.{suffix}"), node_id, name)


def _sends(cob_id: str, **settings: str) -> str:
    named = {"type": 2, "inhibit": 3, "timer": 5}
    return pdo(0x1800, "0x20000010", cob_id=cob_id, settings={named[key]: value for key, value in settings.items()})


def _takes(cob_id: str) -> str:
    return pdo(0x1400, "0x20000010", cob_id=cob_id, settings={2: "255"})


DEVICES = {
    "arm": _device(5, "arm"),
    "quiet": _device(5, "quiet", heartbeat="0"),
    "leg": _device(6, "leg", heartbeat="0"),
    "watcher": _device(
        6, "watcher", record(0x1016, "Consumers", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "0x000500C8"))
    ),
    "short": _device(6, "short", record(0x1016, "Consumers", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "0x00050064"))),
    "inhibited": _device(5, "inhibited", _sends("0x185", type="255", inhibit="100"), heartbeat="0"),
    "timed": _device(5, "timed", _sends("0x185", type="255", timer="100"), heartbeat="0"),
    "seldom": _device(5, "seldom", _sends("0x185", type="255", timer="1500"), heartbeat="0"),
    "synchronous": _device(5, "synchronous", _sends("0x185", type="1")),
    "event": _device(5, "event", _sends("0x185", type="255")),
    "waiter": _device(5, "waiter", _takes("0x205")),
    "numbered": _device(
        5,
        "numbered",
        record(
            0x1018,
            "Identity",
            (0, "UNSIGNED8", "4"),
            (1, "UNSIGNED32", "0"),
            (2, "UNSIGNED32", "0"),
            (3, "UNSIGNED32", "0x00020001"),
            (4, "UNSIGNED32", "0\nParameterValue=7"),
        ),
        dcf=True,
    ),
    "off": _device(5, "off", _sends("0x80000185", type="255")),
    "copy": _device(6, "copy", _sends("0x185", type="255"), heartbeat="0"),
    "taker": _device(6, "taker", _takes("0x185"), heartbeat="0"),
    "clock": _device(
        7,
        "clock",
        variable("1005", "SYNC", "UNSIGNED32", "0x40000080"),
        variable("1006", "Period", "UNSIGNED32", "100000"),
        heartbeat="0",
    ),
    "clock2": _device(8, "clock2", variable("1005", "SYNC", "UNSIGNED32", "0x40000080"), heartbeat="0"),
    "set": _device(
        5, "set", variable("2001", "Limit", "UNSIGNED8", "1", "ParameterValue=7\n"), heartbeat="0", dcf=True
    ),
}


def _drive() -> Dictionary:
    """Return a drive of one axis: TPDO1 has statusword and mode, TPDO2 the position, RPDO1 controlword and mode."""
    objects = (
        variable("6040", "Controlword", "UNSIGNED16", "0"),
        variable("6041", "Statusword", "UNSIGNED16", "0"),
        variable("6060", "Mode", "INTEGER8", "0"),
        variable("6061", "Mode display", "INTEGER8", "0"),
        variable("6064", "Position", "INTEGER32", "0"),
    )
    pdos = (
        pdo(0x1800, "0x60410010", "0x60610008", cob_id="0x185", settings={2: "255"}),
        pdo(0x1801, "0x60640020", cob_id="0x285", settings={2: "255"}),
        pdo(0x1400, "0x60400010", "0x60600008", cob_id="0x205", settings={2: "255"}),
    )
    text = "".join((variable("1000", "Device type", "UNSIGNED32", "0x20192"), *objects, *pdos))
    return Dictionary.read(text.encode(), Path("drive.eds"), 5, "drive")


DEVICES["drive"] = _drive()


def _module() -> Dictionary:
    """Return an I/O module: TPDO1 has digital inputs, TPDO2 analogue ones, which are switched off."""
    inputs = record(0x6000, "Inputs", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "0"))
    analogue = record(0x6401, "Analogue inputs", (0, "UNSIGNED8", "1"), (1, "INTEGER16", "0"))
    enable = variable("6423", "Analogue input global interrupt enable", "BOOLEAN", "0")
    pdos = (
        pdo(0x1800, "0x60000108", cob_id="0x185", settings={2: "255"}),
        pdo(0x1801, "0x64010110", cob_id="0x285", settings={2: "255"}),
    )
    text = "".join((variable("1000", "Device type", "UNSIGNED32", "0x50191"), inputs, analogue, enable, *pdos))
    return Dictionary.read(text.encode(), Path("module.eds"), 5, "module")


DEVICES["module"] = _module()

# Parts of logs


def every(period: float, frame: str, until: float = 2.0, start: float = 0.0) -> Log:
    """Return a log of one periodic frame."""
    number = round((until - start) / period)
    return [(round(start + n * period, 6), frame) for n in range(number + 1)]


def beats(state: int = 5, node: int = 5, until: float = 2.0, start: float = 0.0, period: float = 0.1) -> Log:
    """Return a log of a node's heartbeats."""
    return every(period, f"{0x700 + node:03X}#{state:02X}", until, start)


def at(*frames: str, start: float = 0.0, gap: float = 0.001) -> Log:
    """Return a log of successive frames."""
    return [(round(start + n * gap, 6), frame) for n, frame in enumerate(frames)]


def log(*parts: Log) -> Log:
    """Put parts together in the order of time."""
    return sorted((each for part in parts for each in part), key=lambda each: each[0])


def without(whole: Log, since: float, until: float) -> Log:
    """Leave a time out."""
    return [each for each in whole if not since <= each[0] < until]


def kept(frames: Iterable[tuple[float, str]]) -> Log:
    """Keep the order of the file, whatever the times."""
    return list(frames)


READ, VALUE, ABSENT = "605#4018100100000000", "585#4318100101000000", "585#8018100100000206"
DENIED = "585#8001200022000008"
ASK_TYPE, OTHER_TYPE = "605#4000100000000000", "585#4300100091019901"
ASKS_REVISION, ASKS_SERIAL = ("605#4018100300000000",), ("605#4018100400000000",)
ITS_TYPE = "585#4300100092010200"
VALUE_B = "585#4318100102000000"
READ_2 = "605#4018100200000000"
VALUE_2 = "585#4318100202000000"
SET_7, SET_8, DONE = "605#2F01200007000000", "605#2F01200008000000", "585#6001200000000000"
START, STOP, RESET, TO_PRE = "000#0105", "000#0205", "000#8105", "000#8005"
EMERGENCY, CLEARED = "085#1081110000000000", "085#0000000000000000"
SEGMENTED = ("605#4008100000000000", "585#410810000E000000", "605#6000000000000000", "585#0061626364656667")
DRIVE = ("drive",)
ASK_2, IS_ENABLED_2, IS_FAULT_2 = "605#4041680000000000", "585#4B41680037060000", "585#4B41680018020000"

POLLS_2 = log(
    at("605#403F680000000000", "585#4B3F680000000000", start=0.05),
    every(0.1, ASK_2, 1.0),
    every(0.1, IS_ENABLED_2, 1.0, 0.001),
)
"""A device without a file is asked for error code and statusword of its second axis."""


def status(word: int, start: float, until: float, mode: int = 1) -> Log:
    """Return the frames in which the drive shows its statusword, and its mode."""
    return every(0.1, f"185#{word.to_bytes(2, 'little').hex().upper()}{mode:02X}", until, start)


SENDS_185 = at("605#2300180185010000", "585#6000180100000000")
TOO = at("609#2300180185010000", "589#6000180100000000", start=0.03)
AT_OFF = at("609#2300180185010080", "589#6000180100000000", start=0.03)
PRODUCES = at("605#23061000A0860100", "585#6006100000000000", "605#2305100080000040", "585#6005100000000000", start=0.5)
TIMER = "605#2B00140564000000"
IS_MODULE = at(ASK_TYPE, "585#4300100091010100")
RUNS = status(0x0637, 0.0, 2.0)
MOVES = [(4.0, "285#09000000")]
WAITS_50 = at("609#2316100132000500", "589#6016100100000000", start=0.05)
WAITS_200 = at("609#23161001C8000500", "589#6016100100000000", start=0.05)
FULL = every(0.00025, "123#FFFFFFFFFFFFFFFF", 1.2)
TOO_FULL = every(0.0002, "123#FFFFFFFFFFFFFFFF", 1.2)
NEARLY_FULL = every(0.0003, "123#FFFFFFFFFFFFFFFF", 1.2)
FULL_FOR_LONG = every(0.0002, "123#FFFFFFFFFFFFFFFF", 2.5)
STARVING = MessageSet((PeriodicMessage(0x185, 135, 1000, 1000, node="timed", name="A"),) * 5)
ANSWERS = MessageSet(
    (
        PeriodicMessage(0x185, 135, 100_000, 100_000, node="event", name="A"),
        PeriodicMessage(0x186, 135, 100_000, 100_000, node="copy2", name="B", answers="A"),
    )
)

DEFECTS = [
    RuleDefect(BusRule.OTHER_DEVICE, at(ASK_TYPE, OTHER_TYPE), 0.001, at(ASK_TYPE, ITS_TYPE), ("drive",)),
    RuleDefect(
        BusRule.OTHER_DEVICE,
        at(*ASKS_REVISION, "585#4318100300000300"),
        0.001,
        at(*ASKS_REVISION, "585#4318100309000200"),
        ("numbered",),
    ),
    RuleDefect(
        BusRule.OTHER_DEVICE,
        at(*ASKS_SERIAL, "585#4318100408000000"),
        0.001,
        at(*ASKS_SERIAL, "585#4318100407000000"),
        ("numbered",),
    ),
    # The wire and the log
    RuleDefect(BusRule.BUS_OFF, at("20000040#0000000000000000"), 0.0, at("20000080#0000000000000000")),
    RuleDefect(BusRule.ERROR_FRAME, at("705#05", "20000080#0000000000000000"), 0.001, at("705#05", "080#00")),
    RuleDefect(
        BusRule.LOG_GAP,
        without(log(beats(until=6), beats(node=6, until=6)), 2.05, 4.95),
        5.0,
        without(log(beats(until=6), beats(node=6, until=6)), 2.05, 2.95),
    ),
    RuleDefect(
        BusRule.LOG_DELTAS,
        kept([(0.3, "705#05"), (0.1, "706#05"), (0.05, "705#05"), (0.2, "706#05")]),
        0.1,
        kept([(0.3, "705#05"), (0.1, "706#05"), (0.2, "705#05"), (0.3, "706#05")]),
    ),
    RuleDefect(BusRule.LOG_BACKWARDS, kept([(5.0, "705#05"), (1.0, "705#05")]), 1.0, kept([(1.0, "705#05")] * 2)),
    RuleDefect(BusRule.LOG_UNREADABLE, at("705#05", "what is this"), 0.0, at("705#05", "705#05")),
    RuleDefect(BusRule.LOAD_BURST, FULL_FOR_LONG, 0.0, every(0.0004, "123#FFFFFFFFFFFFFFFF", 1.2)),
    RuleDefect(BusRule.LOAD_FULL, FULL, 0.0, NEARLY_FULL),
    RuleDefect(BusRule.LOAD_FULL, FULL, 0.0, TOO_FULL),
    RuleDefect(BusRule.LOAD_HIGH, NEARLY_FULL, 0.0, every(0.0004, "123#FFFFFFFFFFFFFFFF", 1.2)),
    RuleDefect(
        BusRule.LOAD_BURST,
        log(every(0.0002, "123#FFFFFFFFFFFFFFFF", 0.06), beats()),
        0.0,
        log(every(0.0004, "123#FFFFFFFFFFFFFFFF", 0.06), beats()),
    ),
    RuleDefect(BusRule.CAN_STARVE, at("185#0000"), 0.0, at("185#0000"), (), STARVING),
    # Nodes
    RuleDefect(
        BusRule.TWO_NODES, log(beats(), beats(127, start=0.03)), 0.2, log(beats(until=1), beats(127, start=1.03))
    ),
    RuleDefect(
        BusRule.TWO_NODES,
        log(at(RESET), at("705#00", start=0.2), at("705#00", start=0.3)),
        0.3,
        log(at(RESET), at("705#00", start=0.2), at("705#7F", start=0.3)),
    ),
    RuleDefect(BusRule.TWO_NODES, log(beats(), beats(start=0.03)), 0.3, log(beats(), beats(start=1.95)), ("arm",)),
    RuleDefect(BusRule.TWO_NODES, log(beats(), beats(start=0.03)), 0.4, log(beats(), beats(start=1.95))),
    RuleDefect(
        BusRule.TWO_NODES,
        log(beats(until=1), at("705#00", start=1.05), beats(start=1.1)),
        1.05,
        log(beats(until=1), at("705#00", start=1.05), beats(127, start=1.15)),
    ),
    RuleDefect(
        BusRule.TWO_NODES,
        log(beats(until=1), at("705#00", start=1.012), beats(start=1.1)),
        1.012,
        log(beats(until=1), at("705#00", start=1.012), beats(start=1.112)),
    ),
    RuleDefect(
        BusRule.BOOTS_OPERATIONAL,
        log(beats(until=1), at("705#00", start=1.05), beats(127, start=1.15)),
        1.05,
        log(beats(until=1), at("705#00", start=1.05), beats(start=1.1)),
    ),
    RuleDefect(
        BusRule.NEVER_HEARD, beats(node=6, until=3), 3.0, log(beats(node=6, until=3), at("185#0000")), ("event", "leg")
    ),
    RuleDefect(
        BusRule.NO_BOOT,
        log(at("705#7F", RESET), beats(node=6, until=7)),
        5.1,
        log(at("705#7F", RESET), at("705#00", start=3.0), beats(node=6, until=7)),
    ),
    RuleDefect(
        BusRule.BOOTS_OPERATIONAL,
        log(beats(until=1), at("705#00", start=1.05)),
        1.05,
        log(beats(until=1), at(RESET, "705#00", start=1.05)),
    ),
    RuleDefect(
        BusRule.BOOTS_AGAIN,
        log(at("705#00"), at("705#00", start=1.0)),
        1.0,
        log(at("705#00"), at(RESET, "705#00", start=1.0)),
    ),
    RuleDefect(
        BusRule.NOT_FOLLOWED,
        log(beats(127), at(START, start=0.55)),
        1.1,
        log(beats(127, until=0.95), at(START, start=0.55), beats(5, start=1.0)),
    ),
    RuleDefect(
        BusRule.STATE_UNTOLD,
        log(beats(until=0.95), beats(127, start=1)),
        1.0,
        log(beats(until=0.95), at("000#8005", start=0.97), beats(start=1, until=1.1), beats(127, start=1.2)),
    ),
    RuleDefect(BusRule.STATE_UNTOLD, log(at("705#00"), beats(start=0.1)), 0.1, log(beats(start=0.1)), ("arm",)),
    RuleDefect(BusRule.NOT_STARTED, beats(127, until=7), 0.0, log(beats(127, until=4), beats(5, start=4.1, until=7))),
    # Error control
    RuleDefect(
        BusRule.HEARTBEAT_LOST,
        log(beats(until=1), beats(node=6, until=3)),
        1.3,
        log(beats(until=2.9), beats(node=6, until=3)),
        ("arm",),
    ),
    RuleDefect(  # the bit rate changes: nothing comes for twice the delay, and no longer
        BusRule.HEARTBEAT_LOST,
        log(beats(until=1), at("7E5#1564000000000000", start=1.05), every(0.1, "080#", until=3.5)),
        2.3,
        log(
            beats(until=1),
            at("7E5#15E8030000000000", start=1.05),
            beats(start=3.0, until=3.5),
            every(0.1, "080#", until=3.5),
        ),
        ("arm",),
    ),
    RuleDefect(
        BusRule.HEARTBEAT_LATE,
        without(beats(), 1.0, 1.05),
        1.1,
        log(without(beats(), 1.0, 1.05), at("705#05", start=1.03)),
        ("arm",),
    ),
    RuleDefect(BusRule.HEARTBEAT_CHANGED, beats(period=0.06), 0.36, beats(period=0.11), ("arm",)),
    RuleDefect(BusRule.HEARTBEAT_CHANGED, beats(period=0.14), 0.84, beats(period=0.11), ("arm",)),
    RuleDefect(BusRule.HEARTBEAT_CHANGED, every(0.1, "185#0000"), 2.0, every(0.1, "185#0000", until=0.9), ("event",)),
    RuleDefect(BusRule.HEARTBEAT_CHANGED, beats(period=0.06), 0.36, at(*["705#05"] * 8, gap=0), ("arm",)),  # no times
    RuleDefect(BusRule.CONSUMER_UNFED, beats(node=6), 2.0, log(beats(), beats(node=6)), ("watcher",)),
    RuleDefect(BusRule.CONSUMER_SHORT, log(beats(), WAITS_50), 2.0, log(beats(), WAITS_200)),
    RuleDefect(BusRule.CONSUMER_SHORT, log(beats(), beats(node=6)), 2.0, log(beats(), beats(node=7)), ("arm", "short")),
    RuleDefect(
        BusRule.GUARD_TOGGLE,
        at("705#R1", "705#85", "705#R1", "705#85"),
        0.003,
        at("705#R1", "705#05", "705#R1", "705#85", "705#R1", "705#05"),
    ),
    RuleDefect(BusRule.GUARD_UNANSWERED, every(0.1, "705#R1", 0.4), 0.2, at("705#R1", "705#05", "705#R1", "705#85")),
    RuleDefect(
        BusRule.GUARD_UNANSWERED,
        log(beats(), every(0.07, "705#R", 1.0, 0.55)),
        0.69,
        log(beats(), at("705#R", start=0.55)),
    ),
    RuleDefect(
        BusRule.GUARD_TOGGLE,
        at("705#R1", "705#85", "705#R1", "705#85"),
        0.003,
        log(beats(), every(0.07, "705#R", 1.0, 0.55)),
    ),
    RuleDefect(
        BusRule.HEARTBEAT_LOST,
        log(beats(until=1), every(0.07, "705#R", 2.0, 0.55)),
        1.25,
        log(beats(), every(0.07, "705#R", 2.0, 0.55)),
    ),
    # EMCY
    RuleDefect(BusRule.EMCY_RAISED, at(EMERGENCY), 0.0, at(EMERGENCY, CLEARED)),
    RuleDefect(BusRule.EMCY_STORM, every(0.01, EMERGENCY, 0.2), 0.1, every(0.2, EMERGENCY, 4.0)),
    RuleDefect(BusRule.EMCY_REGISTER, at("085#1081000000000000"), 0.0, at(EMERGENCY)),
    RuleDefect(BusRule.EMCY_CLEARED, at(EMERGENCY, CLEARED), 0.0, at(EMERGENCY, "085#0000110000000000")),
    # SDO
    RuleDefect(BusRule.TWO_CLIENTS, at(READ, READ_2, VALUE, VALUE_2), 0.0, log(at(READ), at(READ, VALUE, start=0.5))),
    RuleDefect(
        BusRule.SDO_UNANSWERED, log(at(READ), beats(node=6)), 0.0, log(at(READ), at(VALUE, start=0.3), beats(node=6))
    ),
    RuleDefect(BusRule.SDO_UNANSWERED, at(READ, READ, gap=0.5), 0.0, at(READ, VALUE, gap=0.5)),
    RuleDefect(BusRule.ONE_DIRECTION, at(READ, READ_2, READ), 0.0, at(READ, VALUE, READ_2, VALUE_2)),
    RuleDefect(BusRule.ONE_DIRECTION, at("705#05", VALUE, VALUE_2), 0.002, at("705#05", READ, VALUE, READ_2, VALUE_2)),
    RuleDefect(
        BusRule.SDO_BROKEN,
        log(at(*SEGMENTED), at(READ, VALUE, start=0.5)),
        0.5,
        at(*SEGMENTED, "605#7000000000000000", "585#1161626364656667"),
    ),
    RuleDefect(
        BusRule.SDO_TOGGLE,
        at(*SEGMENTED, "605#7000000000000000", "585#0061626364656667"),
        0.005,
        at(*SEGMENTED, "605#7000000000000000", "585#1161626364656667"),
    ),
    RuleDefect(
        BusRule.SDO_TOGGLE, at(*SEGMENTED, "585#8008100000000305"), 0.004, at(*SEGMENTED, "585#8008100000000006")
    ),
    RuleDefect(BusRule.SDO_UNASKED, log(at(READ, VALUE), at(VALUE, start=0.5)), 0.5, at(VALUE, READ, VALUE)),
    RuleDefect(BusRule.TWO_NODES, at(READ, VALUE, VALUE_B), 0.002, log(at(READ, VALUE), at(VALUE_B, start=0.5))),
    RuleDefect(BusRule.TWO_NODES, at(READ, VALUE, READ, VALUE_B), 0.003, at(READ, VALUE, "705#00", READ, VALUE_B)),
    RuleDefect(
        BusRule.TWO_CLIENTS,
        log(at(READ), at(READ_2, start=0.1), at(VALUE, VALUE_2, start=0.15)),
        0.0,
        log(at(READ), at(READ_2, start=0.3), at(VALUE, VALUE_2, start=0.35)),
    ),
    RuleDefect(
        BusRule.TWO_CLIENTS,
        at(*SEGMENTED, READ, VALUE, "605#7000000000000000"),
        0.004,
        log(at(*SEGMENTED), at(READ, VALUE, start=0.5)),
    ),
    RuleDefect(BusRule.SDO_ABORT, at("585#8000200003000405"), 0.0, at("585#8000200000000206")),
    RuleDefect(
        BusRule.SDO_SCAN, at(*(f"{0x600 + n:03X}#4000100000000000" for n in range(1, 9)), gap=0.2), 0.0, at(READ, READ)
    ),
    RuleDefect(BusRule.SDO_ABORT, at(SET_7, DENIED), 0.001, at(READ, ABSENT)),
    RuleDefect(BusRule.SDO_PROBED, at(READ, ABSENT), 0.001, at(SET_7, DENIED)),
    # Configuration
    RuleDefect(
        BusRule.NOT_CONFIGURED,
        at("705#00", "605#2B17100064000000", "585#6017100000000000", START),
        0.003,
        at("705#00", SET_7, DONE, START),
        ("set",),
    ),
    RuleDefect(BusRule.CONFIGURED_OTHERWISE, at("705#00", SET_8, DONE), 0.002, at("705#00", SET_7, DONE), ("set",)),
    RuleDefect(BusRule.LSS_LEFT, at("7E5#0401000000000000"), 0.0, at("7E5#0401000000000000", "7E5#0400000000000000")),
    # PDO
    RuleDefect(BusRule.COB_ID_SHARED, at("185#0000"), 0.0, at("185#0000"), ("event", "copy"), None, ("event", "taker")),
    RuleDefect(BusRule.COB_ID_SHARED, log(SENDS_185, TOO), 0.031, log(SENDS_185, AT_OFF)),
    RuleDefect(BusRule.PDO_LENGTH, at("185#00"), 0.0, at("185#0000"), ("event",)),
    RuleDefect(
        BusRule.PDO_STATE,
        log(beats(127, until=0.3), at("185#0000", start=0.15)),
        0.15,
        log(beats(127, until=0.1), at("185#0000", start=0.18), beats(5, start=0.2, until=0.4)),
        ("event",),
    ),
    RuleDefect(
        BusRule.PDO_INHIBIT,
        at("185#0000", "185#0000", gap=0.005),
        0.005,
        at("185#0000", "185#0000", gap=0.01),
        ("inhibited",),
    ),
    RuleDefect(
        BusRule.PDO_TIMER, at("185#0000", "185#0000", gap=0.2), 0.2, at("185#0000", "185#0000", gap=0.12), ("timed",)
    ),
    RuleDefect(BusRule.PDO_TIMER, beats(), 2.0, log(beats(), every(0.1, "185#0000")), ("timed",)),
    RuleDefect(BusRule.PDO_TIMER, beats(until=3), 3.0, beats(), ("seldom",)),
    RuleDefect(
        BusRule.PDO_STOPS,
        log(beats(until=4), every(0.05, "205#0000", 1.0)),
        2.1,
        log(beats(until=4), every(0.05, "205#0000", 1.0), at("000#8005", start=1.05)),
    ),
    RuleDefect(
        BusRule.PDO_NO_SYNC,
        beats(until=3),
        3.0,
        log(beats(until=3), every(0.1, "080#"), at("185#0000")),
        ("synchronous",),
    ),
    RuleDefect(
        BusRule.PDO_NOT_SENT,
        log(beats(until=3), every(0.1, "080#")),
        3.0,
        log(beats(until=3), every(0.1, "080#"), at("185#0000")),
        ("synchronous",),
    ),
    RuleDefect(BusRule.PDO_WITHOUT_FILE, at("186#00"), 0.0, at("185#0000"), ("event",)),
    RuleDefect(
        BusRule.PDO_DEADLINE,
        log(beats(until=4), at(TIMER, "585#6000140500000000"), every(0.05, "205#0000", 2.0)),
        3.0,
        log(beats(until=4), at(TIMER, "585#6000140500000000"), every(0.05, "205#0000", 4.0)),
        ("waiter",),
    ),
    RuleDefect(
        BusRule.PDO_DEADLINE,
        log(beats(), every(0.05, "205#0000", 1.0), at("085#5082110000000000", start=1.25)),
        1.25,
        log(beats(), every(0.05, "205#0000", 2.0), at("085#5082110000000000", start=1.23)),
    ),
    RuleDefect(BusRule.PDO_UNKNOWN, at("123#00"), 0.0, at("185#0000"), ("event",)),
    RuleDefect(BusRule.PDO_OFF, at("185#0000"), 0.0, at("705#05"), ("off",)),
    RuleDefect(
        BusRule.PDO_MAPPING_UNKNOWN,
        at("585#60001A0100000000", "185#0000"),
        0.001,
        at("605#23001A0110000020", "585#60001A0100000000", "605#2F001A0001000000", "585#60001A0000000000", "185#0000"),
        ("event",),
    ),
    RuleDefect(BusRule.OUT_OF_RANGE, at("185#6500"), 0.0, at("185#6400"), ("event",)),
    RuleDefect(
        BusRule.NO_CANOPEN,
        log(beats(), every(0.05, "72A#0102030405060708", 2)),
        0.0,
        log(beats(), every(0.05, "72A#05", 2), every(0.1, "72A#0102", 1)),
    ),
    RuleDefect(BusRule.FRAME_LENGTH, at("705#0505"), 0.0, at("705#05")),
    RuleDefect(
        BusRule.PDO_MAPPED_OTHERWISE,
        at("605#23001A0108000020", "585#60001A0100000000", "605#2F001A0001000000", "585#60001A0000000000", "185#00"),
        0.004,
        at("605#23001A0110000020", "585#60001A0100000000", "605#2F001A0001000000", "585#60001A0000000000", "185#0000"),
        ("event",),
    ),
    RuleDefect(BusRule.PDO_UNHEARD, at("185#0000"), 0.0, at("185#0000"), ("event", "leg"), None, ("event", "taker")),
    RuleDefect(
        BusRule.ANSWER_MISSING,
        log(at("185#0000"), beats(node=6)),
        0.0,
        log(at("185#0000"), at("186#", start=0.3), beats(node=6)),
        ("event",),
        ANSWERS,
        None,
        ANSWERS,
    ),
    RuleDefect(
        BusRule.ANSWER_LATE,
        at("185#0000", "186#", gap=0.4),
        0.4,
        at("185#0000", "186#", gap=0.0002),
        ("event",),
        ANSWERS,
        None,
        ANSWERS,
    ),
    # Drives
    RuleDefect(BusRule.DRIVE_FAULT, log(RUNS, status(0x0218, 1.0, 1.5)), 1.0, log(RUNS, at("185#000000")), DRIVE),
    RuleDefect(
        BusRule.DRIVE_FAULT,
        log(POLLS_2, at(ASK_2, IS_FAULT_2, start=1.05)),
        1.051,
        log(POLLS_2, at(ASK_2, IS_ENABLED_2, start=1.05)),
    ),
    RuleDefect(BusRule.DRIVE_FAULT_RESET, log(status(0x0218, 0, 1), status(0x0250, 1.1, 2)), 0.0, RUNS, DRIVE),
    RuleDefect(
        BusRule.DRIVE_NOT_ENABLED,
        log(status(0x0250, 0, 3), at("605#2B4060000F000000", "585#6040600000000000", start=0.5)),
        0.501,
        log(
            status(0x0250, 0, 3),
            at("605#2B4060000F000000", "585#8040600022000008", start=0.5),
            at(
                "605#4040600000000000",
                "585#4140600009000000",
                "605#7000000000000000",
                "585#1B0F000000000000",
                start=1.0,
            ),
        ),
        DRIVE,
    ),
    RuleDefect(
        BusRule.DRIVE_NOT_ENABLED,
        log(status(0x0250, 0, 3), at("205#0F0001", start=0.5)),
        0.5,
        log(status(0x0250, 0, 1.2), at("205#0F0001", start=0.5), status(0x0637, 1.3, 3)),
        DRIVE,
    ),
    RuleDefect(
        BusRule.DRIVE_DISABLED,
        log(RUNS, at("205#0F0001", start=0.55), status(0x0250, 2.1, 3)),
        2.1,
        log(RUNS, at("205#0F0001", start=0.55), at("205#000001", start=2.05), status(0x0250, 2.1, 3)),
        DRIVE,
    ),
    RuleDefect(
        BusRule.DRIVE_QUICK_STOP,
        log(RUNS, at("205#0F0001", start=0.55), status(0x0217, 2.1, 3)),
        2.1,
        log(RUNS, at("205#0F0001", start=0.55), at("205#020001", start=2.05), status(0x0217, 2.1, 3)),
        DRIVE,
    ),
    RuleDefect(
        BusRule.DRIVE_STOPPED,
        log(RUNS, at("205#020001", start=2.05), status(0x0217, 2.1, 3)),
        2.1,
        log(RUNS, at("205#0F0001", start=2.05), status(0x0217, 2.1, 3)),
        DRIVE,
    ),
    RuleDefect(BusRule.DRIVE_FOLLOWING, status(0x2237, 0.1, 1), 0.1, status(0x2237, 0.1, 1, mode=3), DRIVE),
    RuleDefect(BusRule.DRIVE_HOMING, status(0x2237, 0.1, 1, mode=6), 0.1, status(0x2237, 0.1, 1), DRIVE),
    RuleDefect(BusRule.DRIVE_LIMIT, status(0x0A37, 0, 2), 0.0, log(RUNS, status(0x0A37, 1.01, 1.01)), DRIVE),
    RuleDefect(BusRule.DRIVE_WARNING, status(0x02B7, 0, 2), 0.0, log(RUNS, status(0x02B7, 1.01, 1.01)), DRIVE),
    RuleDefect(
        BusRule.DRIVE_MODE,
        log(at("205#0F0008", start=0.05), status(0x0637, 0.1, 2)),
        2.0,
        log(at("205#0F0001", start=0.05), status(0x0637, 0.1, 2)),
        DRIVE,
    ),
    RuleDefect(
        BusRule.DRIVE_HALTED, log(RUNS, at("205#0F0101"), beats(until=5)), 0.0, log(RUNS, beats(until=5)), DRIVE
    ),
    RuleDefect(
        BusRule.DRIVE_HELD,
        log(status(0x0237, 0, 5), at("205#0F0001", "205#1F0101", start=0.5)),
        0.501,
        log(status(0x0237, 0, 5), at("205#0F0001", "205#1F0101", start=0.5), at("205#1F0001", start=4.9)),
        DRIVE,
    ),
    RuleDefect(
        BusRule.DRIVE_TARGET,
        log(status(0x0237, 0, 5), at("205#0F0001", "205#1F0001", start=0.5), at("285#05000000", start=0.6)),
        0.501,
        log(status(0x0237, 0, 5), at("205#0F0001", "205#1F0001", start=0.5), every(0.5, "285#05000000", 5), MOVES),
        DRIVE,
    ),
    # I/O modules
    RuleDefect(
        BusRule.INPUT_FLUTTERS,
        log(IS_MODULE, every(0.04, "185#01", start=0.02), every(0.04, "185#00", start=0.04)),
        0.44,
        log(IS_MODULE, every(0.2, "185#01", start=0.02), every(0.2, "185#00", start=0.12)),
    ),
    RuleDefect(
        BusRule.INPUT_FLUTTERS,
        log(every(0.04, "185#01", start=0.02), every(0.04, "185#00", start=0.04)),
        0.44,
        log(every(0.2, "185#01", start=0.02), every(0.2, "185#00", start=0.12)),
        ("module",),
    ),
    RuleDefect(
        BusRule.INPUT_AT_END,
        log(IS_MODULE, at("285#0000FF7F", start=0.5), beats()),
        0.5,
        log(IS_MODULE, at("285#0000FF7F", start=0.5), at("285#0000FE7F", start=1.0), beats()),
    ),
    RuleDefect(
        BusRule.INPUTS_OFF,
        log(beats(), at("185#00")),
        2.0,
        log(beats(), at("605#2F23640001000000", "585#6023640000000000", "185#00")),
        ("module",),
    ),
    # SYNC and TIME
    RuleDefect(BusRule.SYNC_STOPS, log(beats(until=4), every(0.1, "080#")), 3.0, beats(until=4)),
    RuleDefect(
        BusRule.SYNC_STOPS,
        log(beats(until=4), every(0.1, "080#")),
        3.0,
        log(beats(until=4), every(0.1, "080#"), at("000#0205", start=1.95)),
    ),
    RuleDefect(
        BusRule.SYNC_TWO,
        log(every(0.1, "080#"), every(0.1, "080#", start=0.03)),
        0.13,
        log(every(0.1, "080#"), at("080#", start=0.53)),
        ("clock",),
    ),
    RuleDefect(BusRule.SYNC_TWO, at("080#01", "080#", gap=0.1), 0.1, at("080#01", "080#02", gap=0.1)),
    RuleDefect(BusRule.SYNC_TWO, at("080#01", "080#01", gap=0.1), 0.1, at("080#01", "080#02", gap=0.1)),
    RuleDefect(BusRule.SYNC_TWO, at("080#"), 0.0, at("080#"), ("clock", "clock2"), None, ("clock", "arm")),
    RuleDefect(
        BusRule.SYNC_TWO, at("080#01", "080#05", "080#02", "080#06", gap=0.1), 0.1, at("080#04", "080#05", "080#01")
    ),
    RuleDefect(
        BusRule.SYNC_TWO,
        log(every(0.1, "080#", 3), every(0.1005, "080#", 3, 0.02)),
        0.5,
        log(every(0.1, "080#", 3), every(0.1, "080#", 3, 0.02)),
    ),
    RuleDefect(
        BusRule.SYNC_JITTER,
        log(every(0.04, "080#", 3), every(0.04, "080#", 3, 0.012)),
        0.2,
        log(every(0.04, "080#", 3), every(0.04, "080#", 3, 0.016)),
    ),
    RuleDefect(BusRule.SYNC_COUNTER, at("080#01", "080#03", gap=0.1), 0.1, at("080#04", "080#05", "080#01", gap=0.1)),
    RuleDefect(
        BusRule.SYNC_JITTER,
        log(every(0.1, "080#", 0.4), at("080#", start=0.55)),
        0.55,
        log(every(0.1, "080#", 0.4), at("080#", start=0.52)),
        ("clock",),
    ),
    RuleDefect(
        BusRule.SYNC_TWO,
        log(every(0.1, "080#"), [(1.005, "080#"), (1.305, "080#"), (1.705, "080#")]),
        1.005,
        log(every(0.1, "080#"), [(1.005, "080#"), (1.305, "080#")]),
    ),
    RuleDefect(
        BusRule.SYNC_TWO,
        log(every(0.04, "080#"), PRODUCES),
        0.6,
        log(every(0.1, "080#"), PRODUCES),
    ),
    RuleDefect(
        BusRule.TIME_STOPS,
        log(beats(until=8), every(0.5, "100#000000000010", 4)),
        5.5,
        log(beats(until=8), every(0.5, "100#000000000010", 4), at("000#0205", start=3.9)),
    ),
    RuleDefect(
        BusRule.TIME_JUMPS,
        at("100#000000000010", "100#100E00000010", gap=1.0),
        1.0,
        at("100#000000000010", "100#E80300000010", gap=1.0),
    ),
]
