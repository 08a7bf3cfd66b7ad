"""Faults made from a table: each row becomes a fault that says in words what it does, and does it."""

from __future__ import annotations

import pytest

from eurobot_od.device.faults import (
    MOVED,
    NOT_ANSWERED,
    NOT_SENT,
    READ_REVERSED,
    REVERSED,
    TWICE,
    Caught,
    Wrong,
    sent_late,
)
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot import dialects
from eurobot_od.robot.faults import message_faults
from eurobot_od.robot.model.messages import CheckNaviResponse, GotoConfirm, GotoStateRequest, GotoStateResponse, GotoXY
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.protocol import EurobotProtocol
from tests.robot.faults import replaced_by

PROTOCOL = EurobotProtocol.load()
DICTIONARY = dialects.load("drive")
STATE = PROTOCOL.encode(GotoStateResponse(None))
CHECKED = PROTOCOL.encode(CheckNaviResponse())


@pytest.mark.parametrize(
    ("wrong", "message", "text", "left"),
    [
        (NOT_SENT, GotoStateResponse, "sends no Goto State Response", []),
        (NOT_ANSWERED, GotoStateRequest, "answers no Goto State Request", []),
        (TWICE, GotoStateResponse, "sends Goto State Response twice", [STATE, STATE]),
        (
            MOVED,
            GotoStateResponse,
            "sends Goto State Response one identifier too high",
            [Frame(STATE.cob_id + 1, STATE.data)],
        ),
        (
            REVERSED,
            GotoStateResponse,
            "sends the bytes of Goto State Response the wrong way round",
            [Frame(STATE.cob_id, STATE.data[::-1])],
        ),
        (READ_REVERSED, GotoXY, "reads the bytes of Goto XY the wrong way round", [STATE]),
        (sent_late(0.3), GotoStateResponse, "sends Goto State Response 300 ms late", []),
        (
            replaced_by(CheckNaviResponse()),
            GotoStateResponse,
            "sends Check Navi Response for Goto State Response",
            [CHECKED],
        ),
        (NOT_SENT, GotoConfirm, "sends no Goto Confirm", [STATE]),
    ],
)
def test_a_row_becomes_a_fault(wrong: Wrong, message: type[Message], text: str, left: list[Frame]) -> None:
    ((name, fault),) = message_faults("drive", ("a-name", wrong, message, "a step")).items()
    assert (name, fault.text, fault.caught_by) == ("a-name", text, Caught("drive", "a step"))
    node: Drive = type("Faulty", (fault.mixin, Drive), {})(DICTIONARY)
    node.start(0.0)
    assert node.receive(PROTOCOL.encode(GotoStateRequest()), 0.0) == left
