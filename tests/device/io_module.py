"""A device that nobody here wrote, as text: values of all kinds, PDOs of all transmission types, every service."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from tests.device.master import NodeWire
from tests.eds_text import DEVICE_TYPE, pdo, record, variable

NODE_ID = 5
TEMPERATURE, PRESSURE, VALVE, LABEL = 0x20000110, 0x20000220, 0x20000308, 0x20000440
SET_POINT = 0x21000010
ON_CHANGE, CYCLIC, ON_REQUEST, COMMAND = 0x1800, 0x1801, 0x1802, 0x1400
"""Communication records: three TPDOs and an RPDO."""

BIG = bytes(range(256)) * 3

TEXT = (
    DEVICE_TYPE
    + variable("1005", "COB-ID SYNC", "UNSIGNED32", "0x80")
    + variable("1006", "Communication cycle period", "UNSIGNED32", "0")
    + variable("100C", "Guard time", "UNSIGNED16", "100")
    + variable("100D", "Life time factor", "UNSIGNED8", "3")
    + variable("1012", "COB-ID TIME", "UNSIGNED32", "0x80000100")
    + variable("1014", "COB-ID EMCY", "UNSIGNED32")  # by default the predefined one
    + variable("1017", "Producer heartbeat time", "UNSIGNED16", "0")
    + record(0x1018, "Identity", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "0x1234"), (2, "UNSIGNED32", "7"))
    + variable("1019", "Synchronous counter overflow", "UNSIGNED8", "0")
    + record(
        0x2000,
        "Channel",
        (0, "UNSIGNED8", "4"),
        (1, "INTEGER16", "-5"),
        (2, "REAL32", "1.5"),
        (3, "BOOLEAN", "1"),
        (4, "VISIBLE_STRING", "valve A"),
    )
    + variable("2100", "Set point", "INTEGER16", "0")
    + variable("2200", "Firmware", "DOMAIN", BIG.hex())
    + variable("2201", "Date of birth", "TIME_OF_DAY", "7")
    + pdo(COMMAND, hex(SET_POINT), settings={2: "255", 5: "200"})
    + pdo(ON_CHANGE, hex(TEMPERATURE), hex(SET_POINT), settings={2: "255", 3: "0", 5: "0"})
    + pdo(CYCLIC, hex(PRESSURE), hex(VALVE), settings={2: "1"})
    + pdo(ON_REQUEST, hex(LABEL), settings={2: "253"})
)


def dictionary(text: str = TEXT) -> Dictionary:
    """Return the module's dictionary."""
    return Dictionary.read(text.encode(), Path("module.eds"), NODE_ID)


def module(kind: type[SimulatedDevice] = SimulatedDevice, text: str = TEXT, **options: Any) -> NodeWire:
    """Return a master and a module that has just booted."""
    return NodeWire(kind(dictionary(text), **options))
