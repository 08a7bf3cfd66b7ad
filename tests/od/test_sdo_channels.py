"""Where a device's SDO server is: one rule, whoever asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.sdo_channels import SdoChannel, moved_server
from tests.eds_text import DEVICE_TYPE, record, variable

USUAL, OF_NODE_5, AT_650 = SdoChannel(0x606, 0x586), SdoChannel(0x605, 0x585), SdoChannel(0x650, 0x5D5)
DEFAULTS = {"$NODEID": ("$NODEID+0x600", "$NODEID+0x580"), "node 5": ("0x605", "0x585"), "0x650": ("0x650", "0x5D5")}

PLACES = [
    # defaults, ParameterValues, where node 6 is asked, and why
    ("$NODEID", None, USUAL, "the usual file"),
    ("0x650", None, AT_650, "identifiers of nobody's are meant"),
    ("node 5", None, USUAL, "a file that was written for node 5, and copied"),
    ("$NODEID", "node 5", OF_NODE_5, "what was set for this device is meant"),
    ("node 5", "0x650", AT_650, "and counts before a default"),
]


def device(default: str, value: str | None) -> Dictionary:
    more = [f"ParameterValue={each}\n" for each in DEFAULTS[value]] if value else ["", ""]
    subs = (
        variable(f"1200sub{sub}", f"COB-ID {sub}", "UNSIGNED32", DEFAULTS[default][sub - 1], more[sub - 1])
        for sub in (1, 2)
    )
    head = record(0x1200, "SDO server", (0, "UNSIGNED8", "2"))
    return Dictionary.read((DEVICE_TYPE + head + "".join(subs)).encode(), Path("device.eds"), 6)


@pytest.mark.parametrize(("default", "value", "place", "why"), PLACES, ids=[each[-1] for each in PLACES])
def test_where_it_is(default: str, value: str | None, place: SdoChannel, why: str) -> None:
    assert SdoChannel.of(device(default, value)) == place, why


def test_without_0x1200_it_is_at_the_default_identifiers() -> None:
    assert SdoChannel.of(Dictionary.read(DEVICE_TYPE.encode(), Path("device.eds"), 6)) == USUAL


SAID = [
    ("$NODEID", None, ""),
    ("0x650", None, "its SDO server is at 0x650, answers at 0x5D5, as its file says (0x1200)"),
    (
        "$NODEID",
        "node 5",
        "its SDO server is at 0x605, answers at 0x585, as its file says (0x1200): there node 5 has its own by default",
    ),
]


@pytest.mark.parametrize(("default", "value", "words"), SAID)
def test_a_moved_sdo_server_is_described(default: str, value: str | None, words: str) -> None:
    assert moved_server(device(default, value)) == words
