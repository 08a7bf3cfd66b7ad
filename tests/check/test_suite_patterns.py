"""Each pattern fits what it describes, says in what anything else differs, and tells whether that ends the waiting."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.check.suite import (
    EMCY,
    HEARTBEAT,
    FramePattern,
    MessagePattern,
    Pattern,
    SentFrame,
    SentMessage,
    ServicePattern,
    is_final,
)
from eurobot_od.check.values import FieldValues, NotSaved, Scale, expectation
from eurobot_od.device.nmt import NmtState
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Kind
from eurobot_od.pdo.protocol import Protocol
from tests.eds_text import DEVICE_TYPE, pdo, variable

TEXT = (
    DEVICE_TYPE
    + variable("2000", "Level", "UNSIGNED8", more="HighLimit=100\n")
    + variable("2001", "Speed", "UNSIGNED16")
    + pdo(0x1800, "0x20000008", "0x20010010", cob_id="0x185", name="State")
)
ARM = Protocol(
    [
        (dictionary, dictionary.read_pdos(dictionary.default))
        for dictionary in [Dictionary.read(TEXT.encode(), Path("arm.eds"), 5)]
    ]
)
"""A device that sends a level, 0 to 100, and a speed."""

STATE = ARM.binding("State")
SCALE = Scale(FieldValues(Kind(), Limits(0, 0xFFFF)), {}, frozenset({"seen"}))


def state(**fields: str) -> MessagePattern:
    return MessagePattern(ARM, STATE, {field: expectation(text, SCALE) for field, text in fields.items()})


def heartbeat(expected: NmtState | None) -> ServicePattern:
    return ServicePattern(HEARTBEAT, "arm", 0x705, expected)


def emergency(code: int | None) -> ServicePattern:
    return ServicePattern(EMCY, "arm", 0x85, code)


EMERGENCY = Frame(0x85, bytes.fromhex("1082110000000000"))


@pytest.mark.parametrize(
    ("pattern", "data", "differs"),
    [
        # digits, and ? for any of them
        (FramePattern(0x123, "0A1F"), "0A1F", []),
        (FramePattern(0x123, "0A1F"), "0A1E", ["data: expected 0A1F, came 0A1E"]),
        (FramePattern(0x123, "0A??"), "0AFF", []),
        (FramePattern(0x123, "?A?F"), "1A2F", []),
        (FramePattern(0x123, "?A?F"), "1B2F", ["data: expected ?A?F, came 1B2F"]),
        (FramePattern(0x123, "0A"), "0A1F", ["data: expected 0A, came 0A1F"]),
        (FramePattern(0x123, "??"), "", ["data: expected ??, came none"]),
        (FramePattern(0x123, ""), "", []),
        (FramePattern(0x123, ""), "00", ["data: expected none, came 00"]),
        # a message: the named fields, and no other outside its limits
        (state(), "64FFFF", []),
        (state(speed="258"), "000201", []),
        (state(speed="258"), "000101", ["speed: expected 258, came 257"]),
        (state(speed="258", level="1"), "000101", ["speed: expected 258, came 257", "level: expected 1, came 0"]),
        (state(speed="258"), "650201", ["level: expected 0..100, came 101 (out of range)"]),
        (state(level="any"), "650201", []),
        (state(), "6402", ["length: expected 3 bytes, came 2 bytes"]),
        (state(), "64020100", ["length: expected 3 bytes, came 4 bytes"]),
        # heartbeats
        (heartbeat(None), "05", []),
        (heartbeat(None), "33", []),
        (heartbeat(None), "", ["length: expected 1 byte, came 0 bytes"]),
        (heartbeat(None), "0505", ["length: expected 1 byte, came 2 bytes"]),
        (heartbeat(NmtState.OPERATIONAL), "05", []),
        (heartbeat(NmtState.OPERATIONAL), "7F", ["state: expected operational, came pre-operational"]),
        (heartbeat(NmtState.INITIALISING), "33", ["state: expected boot-up, came 0x33"]),
        # emergencies
        (emergency(None), "0081010000000000", []),
        (emergency(0x8100), "0081010000000000", []),
        (emergency(0x8100), "1082110000000000", ["code: expected 0x8100, came 0x8210"]),
        (emergency(0x0000), "0010000000000000", ["code: expected 0x0000, came 0x1000"]),
        (emergency(None), "00810100000000", ["length: expected 8 bytes, came 7 bytes"]),
    ],
)
def test_a_pattern_names_the_differences_of_a_frame(pattern: Pattern, data: str, differs: list[str]) -> None:
    off = pattern.mismatches(Frame(pattern.cob_id, bytes.fromhex(data)), {})
    assert [f"{each.what}: {each.words}" for each in off] == differs


def test_a_field_may_be_compared_with_a_saved_value() -> None:
    pattern = state(speed="{seen}")
    frame = Frame(STATE.cob_id, bytes.fromhex("000201"))
    assert pattern.mismatches(frame, {"seen": 258}) == []
    assert [f"{each.what}: {each.words}" for each in pattern.mismatches(frame, {"seen": 1})] == [
        "speed: expected {seen} = 1, came 258"
    ]
    with pytest.raises(NotSaved, match="seen"):
        pattern.mismatches(frame, {})


@pytest.mark.parametrize(
    ("pattern", "name", "text", "final"),
    [
        (state(), "State", "State", True),
        (state(speed="{seen}", level="< 5"), "State", "State: speed {seen} = 7, level < 5", True),
        (FramePattern(0x023, "0A?F"), "023#0A?F", "023#0A?F", True),
        (emergency(0x0081), "EMCY of arm", "EMCY of arm: 0x0081", True),
        (emergency(None), "EMCY of arm", "EMCY of arm: any", True),
        # a node may be on its way to the state
        (heartbeat(NmtState.STOPPED), "heartbeat of arm", "heartbeat of arm: stopped", False),
        (heartbeat(None), "heartbeat of arm", "heartbeat of arm: any", False),
    ],
)
def test_which_patterns_end_the_waiting_with_a_different_frame(
    pattern: Pattern, name: str, text: str, final: bool
) -> None:
    assert (str(pattern), pattern.text({"seen": 7}), is_final(pattern, EMERGENCY)) == (name, text, final)


def test_an_emcy_that_resets_an_error_does_not_end_the_waiting_for_another() -> None:
    assert not is_final(emergency(0x8130), Frame(0x85, bytes(8)))


def test_a_step_sends_a_message_of_values_and_variables_or_a_raw_frame() -> None:
    sent = SentMessage(ARM, STATE, {"level": SCALE.operand("100"), "speed": SCALE.operand("{seen}")})
    assert (str(sent), sent.frame({"seen": 258})) == ("State", Frame(0x185, bytes.fromhex("640201")))
    frame = Frame(0x123, b"\x0a")
    assert (str(SentFrame(frame)), SentFrame(frame).frame({})) == ("123#0A", frame)
