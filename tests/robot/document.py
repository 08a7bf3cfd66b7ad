"""The protocol document's Tables 4 and 5, as the tests' own transcription: what the robot of 2014 had on its bus.

The protocol may have more messages than the document; those are in `eds/protocol.yaml` and in no table of the tests but
that of who sends and who acts.
"""

from __future__ import annotations

from typing import NamedTuple


class Row(NamedTuple):
    """A message: identifier, name, protocol, senders, receivers."""

    cob_id: int
    name: str
    protocol: str
    senders: list[str]
    receivers: list[str]


EVERYBODY, CORE, DRIVE, NAVIGATION = ["drive", "navigation"], ["core"], ["drive"], ["navigation"]
TABLES_4_AND_5 = (
    Row(0x001, "Emergency Shutdown", "GTP", CORE, EVERYBODY),
    Row(0x002, "Emergency Stop", "GTP", CORE, DRIVE),
    Row(0x004, "Stop Drive", "GTP", CORE, DRIVE),
    Row(0x008, "Goto XY", "GTP", CORE, DRIVE),
    Row(0x00C, "Goto Confirm", "GTP", DRIVE, CORE),
    Row(0x010, "Goto State Request", "GTP", CORE, DRIVE),
    Row(0x014, "Goto State Response", "GTP", DRIVE, CORE),
    Row(0x040, "Navi Position Request", "ELP", CORE, NAVIGATION),
    Row(0x080, "Navi Position Response", "ELP", NAVIGATION, DRIVE),
    Row(0x0C0, "Kalman Position Request", "ELP", CORE, DRIVE),
    Row(0x100, "Kalman Position Response", "ELP", DRIVE, CORE),
    Row(0x140, "Enemy 1 Position Request", "ELP", CORE, NAVIGATION),
    Row(0x180, "Enemy 1 Position Response", "ELP", NAVIGATION, CORE),
    Row(0x1C0, "Enemy 2 Position Request", "ELP", CORE, NAVIGATION),
    Row(0x200, "Enemy 2 Position Response", "ELP", NAVIGATION, CORE),
    Row(0x240, "Confederate Position Request", "ELP", CORE, NAVIGATION),
    Row(0x280, "Confederate Position Response", "ELP", NAVIGATION, CORE),
    Row(0x2C0, "Start Configuration Set", "GIP", CORE, EVERYBODY),
    Row(0x300, "Start Configuration Confirm", "GIP", EVERYBODY, CORE),
    Row(0x340, "Check Navi Request", "GIP", CORE, NAVIGATION),
    Row(0x380, "Check Navi Response", "GIP", NAVIGATION, CORE),
    Row(0x3C0, "Check Drive Request", "GIP", CORE, DRIVE),
    Row(0x400, "Check Drive Response", "GIP", DRIVE, CORE),
)
NAMES = [row.name for row in TABLES_4_AND_5]
