"""Faults of the navigation: positions, node check, start configuration."""

from __future__ import annotations

from typing import Any

from eurobot_od.robot.faults.fault import Caught, Fault
from eurobot_od.robot.faults.hooks import (
    arriving,
    data,
    exchanged,
    field,
    frozen,
    handling,
    leaving,
    meaning,
    raw,
)
from eurobot_od.robot.faults.message_faults import (
    NOT_ANSWERED,
    NOT_SENT,
    REVERSED,
    TWICE,
    message_faults,
    replaced_by,
    sent_late,
)
from eurobot_od.robot.messages import (
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionRequest,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    Enemy2PositionResponse,
    NaviPositionRequest,
    NaviPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
)
from eurobot_od.robot.nodes import Navigation
from eurobot_od.robot.values import Source

SCATTER = 150
"""How far a bad beacon is off, mm."""


LOCATION = "2.2 Estimated Location response"
NODE_CHECK = "2.3 Node Check Response"
"""Groups of steps."""

OUR_PLACE = f"{LOCATION}: our robot's place"
NAVIGATION_THERE = f"{NODE_CHECK}: the navigation is there"
CONFIRMED = "2.3 Start Configuration Confirm: the navigation confirms"
"""Steps that find several faults: the first ones that look at an answer at all."""


def _scattered(position: NaviPositionResponse) -> NaviPositionResponse:
    """Move a place to either side, by the noise in its last bit."""
    if position.x is None:
        return position
    return position._replace(x=position.x + (SCATTER if position.x % 2 else -SCATTER))


def _under_enemy_2(navigation: Navigation, *_: object) -> None:
    answer: Any = navigation.answer_to(Enemy1PositionRequest())
    navigation.offer(Enemy2PositionResponse(*answer))


FAULTS = (
    *message_faults(
        "navigation",
        ("navi-not-answered", NOT_ANSWERED, NaviPositionRequest, OUR_PLACE),
        ("navi-answered-late", sent_late(0.3), NaviPositionResponse, f"{LOCATION}: follows directly"),
        ("navi-answered-twice", TWICE, NaviPositionResponse, f"{LOCATION}: one answer for one request"),
        ("navi-byte-order", REVERSED, NaviPositionResponse, OUR_PLACE),
        ("enemy-not-answered", NOT_ANSWERED, Enemy2PositionRequest, f"{LOCATION}: enemy 2"),
        ("confederate-not-answered", NOT_ANSWERED, ConfederatePositionRequest, f"{LOCATION}: the confederate"),
        ("navi-check-not-answered", NOT_ANSWERED, CheckNaviRequest, NAVIGATION_THERE),
        ("navi-check-answered-for-drive", replaced_by(CheckDriveResponse()), CheckNaviResponse, NAVIGATION_THERE),
        ("navi-check-answered-twice", TWICE, CheckNaviResponse, f"{NODE_CHECK}: one answer for one request"),
        ("navi-configuration-not-confirmed", NOT_SENT, StartConfigurationConfirm, CONFIRMED),
    ),
    Fault(
        "navi-swapped",
        "sends x as y and y as x",
        leaving(NaviPositionResponse, exchanged("x", "y")),
        Caught("navigation", OUR_PLACE),
    ),
    Fault(
        "navi-in-centimetres",
        "sends our robot's place in centimetres",
        leaving(NaviPositionResponse, raw(x=lambda x: x // 10, y=lambda y: y // 10)),
        Caught("navigation", OUR_PLACE),
    ),
    Fault(
        "navi-short",
        "sends our robot's place without the byte with the source",
        leaving(NaviPositionResponse, data(lambda data: data[:4])),
        Caught("navigation", OUR_PLACE),
    ),
    Fault(
        "navi-angle-clockwise",
        "sends our robot's angle clockwise",
        leaving(NaviPositionResponse, field("angle", lambda angle: -angle)),
        Caught("flows", "1 Navigation: angles count counter-clockwise"),
    ),
    Fault(
        "navi-source-wrong",
        "says that our robot's place comes from enemy 1",
        leaving(NaviPositionResponse, field("source", lambda _: Source.ENEMY_1)),
        Caught("navigation", "Table 2: the source of our robot's place is our robot itself"),
    ),
    Fault(
        "navi-scattered",
        "measures our robot's place 150 mm off, here or there",
        leaving(NaviPositionResponse, meaning(_scattered)),
        Caught("navigation", OUR_PLACE),
    ),
    Fault(
        "navi-frozen",
        "goes on saying the first place that it saw",
        frozen(NaviPositionResponse, StartConfigurationSet),
        Caught("flows", "4.2.2 Navigation: the navigation follows our robot"),
    ),
    Fault(
        "enemy-source-wrong",
        "says that enemy 1's place is our robot's",
        leaving(Enemy1PositionResponse, field("source", lambda _: Source.INTERNAL)),
        Caught("navigation", "Table 2: the source of enemy 1's place is enemy 1"),
    ),
    Fault(
        "enemies-mixed-up",
        "answers for enemy 1 under the identifier of enemy 2",
        handling(Enemy1PositionRequest, _under_enemy_2),
        Caught("navigation", f"{LOCATION}: enemy 1"),
    ),
    Fault(
        "enemy-unknown-as-zero",
        "says 0, 0 for an enemy that is not there",
        leaving(Enemy2PositionResponse, meaning(lambda p: p if p.x is not None else p._replace(x=0, y=0, angle=0))),
        Caught("navigation", "Table 2: an enemy that is not there is unknown"),
    ),
    Fault(
        "enemy-invented",
        "finds an enemy that the start configuration does not have",
        arriving(StartConfigurationSet, raw(enemies=lambda _: 2, confederates=lambda _: 1)),
        Caught("navigation", "Table 2: an enemy that is not there is unknown"),
    ),
    Fault(
        "enemy-angle-invented",
        "says 0 degrees for an enemy's angle, which it cannot measure",
        leaving(Enemy1PositionResponse, meaning(lambda p: p._replace(angle=0) if p.x is not None else p)),
        Caught("navigation", "Table 2: an angle that is not measured is unknown"),
    ),
    Fault(
        "navi-configuration-not-applied",
        "confirms the start configuration and forgets it",
        handling(StartConfigurationSet, lambda navigation, *_: navigation.offer(StartConfigurationConfirm())),
        Caught("navigation", "Table 2: an enemy that is not there is unknown"),
    ),
    Fault(
        "navi-mute-after-shutdown",
        "answers no node check after an Emergency Shutdown",
        handling(CheckNaviRequest, lambda node, request, healthy: None if node.safe else healthy(request)),
        Caught("navigation", "4.2.2 Emergency mushroom: the navigation still answers node checks"),
    ),
)
