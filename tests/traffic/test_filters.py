"""Filters by message, node, field value and time; and names and values that cannot be."""

from __future__ import annotations

import pytest

from eurobot_od.errors import EurobotError, FieldError, LocalError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.traffic.filters import Wanted, Window, by_name, by_node, by_value
from eurobot_od.traffic.meaning import Decoder
from tests.kit import plant
from tests.kit.plant import messages as m

MESSAGES: dict[str, Message] = {
    "stop": m.HaltCause(m.Cause.CURTAIN),
    "move": m.MoveTo(1200, 900, 90, 80, m.Gates().parse("gate-2:locked")),
    "arrived": m.MoveStateResponse(0),
    "moving": m.MoveStateResponse(1500),
    "jammed": m.MoveStateResponse(m.Fault.BLOCKED),
    "lost": m.MoveStateResponse(None),
    "here": m.PlaceResponse(500, 600, 10, m.Source.ENCODER),
    "somewhere": m.PlaceResponse(None, None, None, m.Source.ENCODER),
    "heavy": m.WeightResponse(412.5, 21.5),
    "too much": m.WeightResponse(m.Reading.OVERLOAD, -3.5),
    "order": m.OrderSet(m.Colour.BLUE, 12, 2),
    "check": m.CheckScaleRequest(),
}


@pytest.fixture(scope="module")
def decoder() -> Decoder:
    return plant.decoder()


def passed(decoder: Decoder, wanted: Wanted) -> set[str]:
    """Return the names of the messages above, and of a heartbeat of the lift, that a filter lets pass."""
    frames = {name: decoder.protocol.encode(message) for name, message in MESSAGES.items()}
    frames["beat"] = Frame(0x702, b"\5")
    frames["strange"] = Frame(0x123)
    return {name for name, frame in frames.items() if wanted(decoder(frame))}


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["Move To"], {"move"}),
        (["move-to", "HALT_CAUSE"], {"move", "stop"}),
        (["moves"], {"stop", "move", "arrived", "moving", "jammed", "lost"}),
        (["PLACES"], {"here", "somewhere", "heavy", "too much"}),
        (["SET-UP"], {"order", "check"}),
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
        (["scale"], {"order", "check", "heavy", "too much"}),
        (
            ["Lift"],
            {
                "stop",
                "move",
                "arrived",
                "moving",
                "jammed",
                "lost",
                "here",
                "somewhere",
                "order",
                "beat",
                "heavy",
                "too much",
            },
        ),
    ],
)
def test_by_node(decoder: Decoder, nodes: list[str], expected: set[str]) -> None:
    assert passed(decoder, by_node(nodes, [each.name for each in decoder.dictionaries])) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x>1000", {"move"}),
        ("x >= 500", {"move", "here"}),
        ("x<501", {"here"}),
        ("weight>400", {"heavy"}),
        ("weight=overload", {"too much"}),
        ("temperature<0", {"too much"}),
        ("Move To.x!=5", {"move"}),
        ("move-to.speed<=80", {"move"}),
        ("x=unknown", {"somewhere"}),
        ("Place Response.x!=unknown", {"here"}),
        ("time=unknown", {"lost"}),
        ("time=blocked", {"jammed"}),
        ("time>0", {"moving"}),  # and not "jammed", whose code is a number beyond all times,
        ("colour=blue", {"order"}),
        ("colour=1", {"order"}),
        ("cause=operator", set()),
        ("gates=gate-2:locked", {"move"}),
        ("source=encoder", {"here", "somewhere"}),
    ],
)
def test_by_value(decoder: Decoder, text: str, expected: set[str]) -> None:
    assert passed(decoder, by_value(text, decoder.protocol)) == expected


@pytest.mark.parametrize(
    ("text", "error"),
    [("x", LocalError), ("x>", LocalError), ("z>1", UnknownName), ("Move.x>1", UnknownName), ("x>much", FieldError)],
)
def test_no_condition(decoder: Decoder, text: str, error: type[EurobotError]) -> None:
    with pytest.raises(error):
        by_value(text, decoder.protocol)


def test_no_name(decoder: Decoder) -> None:
    with pytest.raises(UnknownName, match="unknown message 'Move'"):
        by_name(["Move"], decoder)
    with pytest.raises(UnknownName, match="unknown node 'Hoist'; known: panel, lift, scale"):
        by_node(["Hoist"], ["panel", "lift", "scale"])


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
