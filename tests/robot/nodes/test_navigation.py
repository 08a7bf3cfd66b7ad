"""The navigation node: what it says of places it sees, does not see, or cannot say on the wire."""

from __future__ import annotations

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionRequest,
    ConfederatePositionResponse,
    EmergencyShutdown,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    Enemy2PositionResponse,
    NaviPositionRequest,
    NaviPositionResponse,
    PositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
)
from eurobot_od.robot.model.values import Source, TeamColour
from eurobot_od.robot.nodes.navigation import Beacons, Fix, Navigation
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Seen

EVERYONE = Seen(
    internal=Fix(1000.4, 500.6, 45.5), enemy_1=Fix(2000, 1000), enemy_2=Fix(2500, 300), confederate=Fix(300, 300)
)

ASKED: dict[type[PositionResponse], Message] = {
    NaviPositionResponse: NaviPositionRequest(),
    Enemy1PositionResponse: Enemy1PositionRequest(),
    Enemy2PositionResponse: Enemy2PositionRequest(),
    ConfederatePositionResponse: ConfederatePositionRequest(),
}


def navigation(beacons: Beacons | None = None, *configurations: StartConfigurationSet) -> Navigation:
    """Return a navigation that has been switched on and configured."""
    node = Navigation(DICTIONARIES["navigation"], beacons)
    node.start(0.0)
    for each in configurations:
        ask(node, each)
    return node


def ask(node: Navigation, question: Message, now: float = 1.0) -> Message:
    """Ask, and return the answer, which has to be the only frame that the question brings."""
    (frame,) = node.receive(PROTOCOL.encode(question), now)
    return PROTOCOL.decode(*frame)


@pytest.mark.parametrize(
    "expected",
    [
        NaviPositionResponse(1000, 501, 46, Source.INTERNAL),  # whole millimetres and degrees
        Enemy1PositionResponse(2000, 1000, None, Source.ENEMY_1),  # a heading that nobody can see
        Enemy2PositionResponse(2500, 300, None, Source.ENEMY_2),
        ConfederatePositionResponse(300, 300, None, Source.CONFEDERATE),
    ],
)
def test_a_seen_robot_is_answered_with_its_source(expected: PositionResponse) -> None:
    assert ask(navigation(EVERYONE, RED), ASKED[type(expected)]) == expected


@pytest.mark.parametrize(
    "expected",
    [
        NaviPositionResponse(None, None, None, Source.INTERNAL),
        Enemy1PositionResponse(None, None, None, Source.ENEMY_1),
        Enemy2PositionResponse(None, None, None, Source.ENEMY_2),
        ConfederatePositionResponse(None, None, None, Source.CONFEDERATE),
    ],
)
@pytest.mark.parametrize("beacons", [None, Seen()])
def test_a_robot_that_is_not_seen_is_unknown(beacons: Beacons | None, expected: PositionResponse) -> None:
    assert ask(navigation(beacons, RED), ASKED[type(expected)]) == expected


def test_a_place_that_is_no_longer_seen_is_unknown_again() -> None:
    beacons = Seen(enemy_1=Fix(2000, 1000))
    node = navigation(beacons, RED)
    ask(node, Enemy1PositionRequest())
    beacons.fixes.clear()
    assert ask(node, Enemy1PositionRequest(), 2.0) == Enemy1PositionResponse(None, None, None, Source.ENEMY_1)


@pytest.mark.parametrize(
    ("enemies", "confederates", "known"),
    [
        (0, 0, {NaviPositionResponse}),
        (1, 0, {NaviPositionResponse, Enemy1PositionResponse}),
        (2, 0, {NaviPositionResponse, Enemy1PositionResponse, Enemy2PositionResponse}),
        (0, 1, {NaviPositionResponse, ConfederatePositionResponse}),
    ],
)
def test_a_robot_that_does_not_take_part_is_unknown_whatever_the_beacons_see(
    enemies: int, confederates: int, known: set[type[PositionResponse]]
) -> None:
    node = navigation(EVERYONE, StartConfigurationSet(TeamColour.RED, enemies, confederates, 0, 0))
    answers = (ask(node, question) for question in ASKED.values())
    assert {type(each) for each in answers if isinstance(each, PositionResponse) and each.x is not None} == known


def test_before_the_start_configuration_anyone_may_be_there() -> None:
    assert ask(navigation(EVERYONE), Enemy2PositionRequest()) == Enemy2PositionResponse(2500, 300, None, Source.ENEMY_2)


@pytest.mark.parametrize(
    ("fix", "place", "why"),
    [
        (Fix(0, 0, 0), (0, 0, 0), "the corners are on the field"),
        (Fix(3000, 2000, 359), (3000, 2000, 359), "both of them"),
        (Fix(3000.4, 1000, 0), (None, None, None), "beyond the border: not seen rather than a lie"),
        (Fix(-0.1, 1000, 0), (None, None, None), "on the other side as well"),
        (Fix(1000, 2000.5, 0), (None, None, None), "and above"),
        (Fix(1000, 1000, 359.6), (1000, 1000, 0), "rounds to 360, which is 0"),
        (Fix(1000, 1000, -90), (1000, 1000, 270), "any angle, on the unit circle"),
        (Fix(255, 255, 10), (255, 255, 10), "a real place, as the angle is known"),
        (Fix(255, 255, None), (256, 255, None), "without an angle it would read unknown"),
        (Fix(255, 254, None), (255, 254, None), "only both coordinates together do"),
    ],
)
def test_a_place_on_the_wire(fix: Fix, place: tuple[int | None, int | None, int | None], why: str) -> None:
    answer = ask(navigation(Seen(internal=fix)), NaviPositionRequest())
    assert answer == NaviPositionResponse(*place, Source.INTERNAL), why


def test_the_start_configuration_is_confirmed_and_kept() -> None:
    node = navigation()
    assert ask(node, RED) == StartConfigurationConfirm()
    assert node.configuration == RED


# After an Emergency Shutdown


def shut_down() -> Navigation:
    """Return a navigation after an emergency shutdown."""
    node = navigation(EVERYONE, RED)
    node.receive(PROTOCOL.encode(EmergencyShutdown()), 1.0)
    assert node.safe
    return node


def test_after_a_shutdown_checks_and_positions_are_still_answered() -> None:
    node = shut_down()
    assert ask(node, CheckNaviRequest()) == CheckNaviResponse()
    assert ask(node, NaviPositionRequest()) == NaviPositionResponse(1000, 501, 46, Source.INTERNAL)


@pytest.mark.parametrize(
    ("frame", "safe", "why"),
    [
        (PROTOCOL.encode(RED), False, "a new start configuration ends it"),
        (Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 3])), False, "an NMT reset ends it"),
        (Frame(NMT_COB_ID, bytes([NmtCommand.START, 3])), True, "starting the node does not"),
        (Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 2])), True, "nor does the reset of another node"),
        (PROTOCOL.encode(CheckNaviRequest()), True, "nor does a check"),
    ],
)
def test_the_safe_state_lasts_until_a_reset_or_a_start_configuration(frame: Frame, safe: bool, why: str) -> None:
    node = shut_down()
    node.receive(frame, 2.0)
    assert node.safe is safe, why


def test_an_nmt_reset_forgets_the_start_configuration() -> None:
    node = navigation(EVERYONE, RED)
    node.receive(Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 3])), 1.0)
    assert node.configuration is None
