"""Faults of the navigation: positions, node check, start configuration."""

from __future__ import annotations

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import NOT_ANSWERED, NOT_SENT, REVERSED, TWICE, Caught, sent_late
from eurobot_od.robot.faults.core import message_faults, replaced_by
from eurobot_od.robot.model.messages import (
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
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes import Navigation

SCATTER = 150
"""How far a bad beacon is off, mm."""

LOCATION = "2.2 Estimated Location response"
NODE_CHECK = "2.3 Node Check Response"
"""Groups of steps."""

OUR_PLACE = f"{LOCATION}: our robot's place"
NAVIGATION_THERE = f"{NODE_CHECK}: the navigation is there"
CONFIRMED = "2.3 Start Configuration Confirm: the navigation confirms"
"""Steps that find several faults: the first ones that look at an answer at all."""


class NavigationTakesAnyStart(Navigation):
    """Takes any start configuration."""

    def check_configuration(self, configuration: StartConfigurationSet) -> None:
        """Find nothing wrong."""


FAULTS = {
    **message_faults(
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
    "navi-swapped": Caught("navigation", OUR_PLACE).fault(
        "sends x as y and y as x", hooks.leaving(NaviPositionResponse, hooks.exchanged("x", "y"))
    ),
    "navi-in-centimetres": Caught("navigation", OUR_PLACE).fault(
        "sends our robot's place in centimetres",
        hooks.leaving(NaviPositionResponse, hooks.raw(x=lambda x: x // 10, y=lambda y: y // 10)),
    ),
    "navi-short": Caught("navigation", OUR_PLACE).fault(
        "sends our robot's place without the byte with the source",
        hooks.leaving(NaviPositionResponse, hooks.data(lambda data: data[:4])),
    ),
    "navi-angle-clockwise": Caught("flows", "1 Navigation: angles count counter-clockwise").fault(
        "sends our robot's angle clockwise",
        hooks.leaving(NaviPositionResponse, hooks.field("angle", lambda angle: -angle)),
    ),
    "navi-source-wrong": Caught("navigation", "Table 2: the source of our robot's place is our robot itself").fault(
        "says that our robot's place comes from enemy 1",
        hooks.leaving(NaviPositionResponse, hooks.field("source", lambda _: Source.ENEMY_1)),
    ),
    "navi-scattered": Caught("navigation", OUR_PLACE).fault(
        "measures our robot's place 150 mm off, here or there",
        # To either side, by the noise in the last bit: a single offset would only be a bias, and with a random
        # generator the frames would not follow from the match's seed alone.
        hooks.leaving(
            NaviPositionResponse,
            hooks.meaning(lambda p: p if p.x is None else p._replace(x=p.x + (SCATTER if p.x % 2 else -SCATTER))),
        ),
    ),
    "navi-frozen": Caught("flows", "4.2.2 Navigation: the navigation follows our robot").fault(
        "goes on saying the first place that it saw", hooks.frozen(NaviPositionResponse, StartConfigurationSet)
    ),
    "enemy-source-wrong": Caught("navigation", "Table 2: the source of enemy 1's place is enemy 1").fault(
        "says that enemy 1's place is our robot's",
        hooks.leaving(Enemy1PositionResponse, hooks.field("source", lambda _: Source.INTERNAL)),
    ),
    "enemies-mixed-up": Caught("navigation", f"{LOCATION}: enemy 1").fault(
        "answers for enemy 1 under the identifier of enemy 2",
        hooks.handling(
            Enemy1PositionRequest,
            lambda navigation, request, _: navigation.offer(Enemy2PositionResponse(*navigation.answer_to(request))),
        ),
    ),
    "enemy-unknown-as-zero": Caught("navigation", "Table 2: an enemy that is not there is unknown").fault(
        "says 0, 0 for an enemy that is not there", hooks.leaving(Enemy2PositionResponse, hooks.unknown_as(0))
    ),
    "enemy-invented": Caught("navigation", "Table 2: an enemy that is not there is unknown").fault(
        "finds an enemy that the start configuration does not have",
        hooks.arriving(StartConfigurationSet, hooks.raw(enemies=lambda _: 2, confederates=lambda _: 1)),
    ),
    "enemy-angle-invented": Caught("navigation", "Table 2: an angle that is not measured is unknown").fault(
        "says 0 degrees for an enemy's angle, which it cannot measure",
        hooks.leaving(Enemy1PositionResponse, hooks.meaning(lambda p: p._replace(angle=0) if p.x is not None else p)),
    ),
    "navi-configuration-not-applied": Caught("navigation", "Table 2: an enemy that is not there is unknown").fault(
        "confirms the start configuration and forgets it",
        hooks.handling(StartConfigurationSet, lambda navigation, *_: navigation.offer(StartConfigurationConfirm())),
    ),
    "navi-contradictions-taken": Caught("navigation", "Table 3: no enemy, but a diameter, is reported by EMCY").fault(
        "takes a start configuration that contradicts itself", NavigationTakesAnyStart
    ),
    "navi-mute-after-shutdown": Caught(
        "navigation", "4.2.2 Emergency mushroom: the navigation still answers node checks"
    ).fault(
        "answers no node check after an Emergency Shutdown",
        hooks.handling(CheckNaviRequest, lambda node, request, healthy: None if node.safe else healthy(request)),
    ),
}
