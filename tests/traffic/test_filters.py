"""Filters by message, node, field value and time; and names and values that cannot be."""

from __future__ import annotations

import pytest

from eurobot_od.errors import EurobotError, FieldError, LocalError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CheckNaviRequest,
    EmergencyStop,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StartConfigurationSet,
)
from eurobot_od.robot.model.values import Barriers, Obstacle, Passage, Source, TeamColour
from eurobot_od.robot.protocol import decoder as robot_decoder
from eurobot_od.traffic.filters import Wanted, Window, by_name, by_node, by_value
from eurobot_od.traffic.meaning import Decoder
from tests.rows import rows

MESSAGES: dict[str, Message] = {
    "stop": EmergencyStop(Obstacle.ENEMY),
    "goto": GotoXY(1200, 900, 90, 80, Barriers.of({2: Passage.FORCED})),
    "arrived": GotoStateResponse(0),
    "driving": GotoStateResponse(1500),
    "lost": GotoStateResponse(None),
    "here": KalmanPositionResponse(500, 600, 10, Source.INTERNAL),
    "somewhere": KalmanPositionResponse(None, None, None, Source.INTERNAL),
    "start": StartConfigurationSet(TeamColour.RED, 2, 1, 30, 25),
    "check": CheckNaviRequest(),
}


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return robot_decoder(dialects.DEFAULT)


def passed(decoder: Decoder, wanted: Wanted) -> set[str]:
    """Return the names of the messages above, and of a heartbeat of the drive, that a filter lets pass."""
    frames = {name: decoder.protocol.encode(message) for name, message in MESSAGES.items()}
    frames["beat"] = Frame(0x702, b"\5")
    frames["strange"] = Frame(0x123)
    return {name for name, frame in frames.items() if wanted(decoder(frame))}


@rows(
    "names, expected",
    [
        (["Goto XY"], {"goto"}),
        (["goto-xy", "EMERGENCY_STOP"], {"goto", "stop"}),
        (["gtp"], {"stop", "goto", "arrived", "driving", "lost"}),
        (["ELP"], {"here", "somewhere"}),
        (["GIP"], {"start", "check"}),
        (["CANopen"], {"beat"}),
        (["heartbeat"], {"beat"}),
        (["SDO"], set()),
    ],
)
def test_by_name(decoder: Decoder, names: list[str], expected: set[str]) -> None:
    assert passed(decoder, by_name(names, decoder)) == expected


@pytest.mark.parametrize(
    ("nodes", "expected"),
    [
        (["navigation"], {"start", "check"}),
        (["Drive"], {"stop", "goto", "arrived", "driving", "lost", "here", "somewhere", "start", "beat"}),
    ],
)
def test_by_node(decoder: Decoder, nodes: list[str], expected: set[str]) -> None:
    assert passed(decoder, by_node(nodes, [each.name for each in decoder.dictionaries])) == expected


@rows(
    "text, expected",
    [
        ("x>1000", {"goto"}),
        ("x >= 500", {"goto", "here"}),
        ("x<501", {"here"}),
        ("Goto XY.x!=5", {"goto"}),
        ("goto-xy.speed<=80", {"goto"}),
        ("x=unknown", {"somewhere"}),
        ("Kalman Position Response.x!=unknown", {"here"}),
        ("time=unknown", {"lost"}),
        ("time>0", {"driving"}),
        ("team_colour=red", {"start"}),
        ("team_colour=1", {"start"}),
        ("obstacle=object", set()),
        ("barriers=fire-2:forced", {"goto"}),
        ("source=internal", {"here", "somewhere"}),
    ],
)
def test_by_value(decoder: Decoder, text: str, expected: set[str]) -> None:
    assert passed(decoder, by_value(text, decoder.protocol)) == expected


@pytest.mark.parametrize(
    ("text", "error"),
    [("x", LocalError), ("x>", LocalError), ("z>1", UnknownName), ("Goto.x>1", UnknownName), ("x>much", FieldError)],
)
def test_no_condition(decoder: Decoder, text: str, error: type[EurobotError]) -> None:
    with pytest.raises(error):
        by_value(text, decoder.protocol)


def test_no_name(decoder: Decoder) -> None:
    with pytest.raises(UnknownName, match="unknown message 'Goto'"):
        by_name(["Goto"], decoder)
    with pytest.raises(UnknownName, match="unknown node 'Antrieb'; known: core, drive, navigation"):
        by_node(["Antrieb"], ["core", "drive", "navigation"])


@pytest.mark.parametrize(
    ("window", "expected"),
    [
        (Window(), [100.0, 101.0, 102.0]),
        (Window(101, 101.5), [101.0]),
        (Window(relative=True), [0.0, 1.0, 2.0]),
        (Window(1, 5, relative=True), [1.0, 2.0]),
    ],
)
def test_window(window: Window, expected: list[float]) -> None:
    clock = window.clock()
    assert [shown for time in (100.0, 101.0, 102.0) if (shown := clock(time)) is not None] == expected
