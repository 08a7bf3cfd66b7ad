"""Faults of the navigation: positions, node check, start configuration.

Rule of this file: a row says what is wrong, how, and which step of which suite finds it. The faulty navigation is the
navigation with one thing changed.
"""

from __future__ import annotations

import random
from typing import Any

from eurobot_od.robot.faults.fault import Caught, Fault
from eurobot_od.robot.faults.hooks import (
    arriving,
    data,
    exchanged,
    field,
    foreign,
    handling,
    late,
    leaving,
    lost,
    meaning,
    raw,
    twice,
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
    PositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
)
from eurobot_od.robot.nodes import Navigation
from eurobot_od.robot.values import Source

SCATTER = 150
"""How far a bad beacon is off, mm."""


class Scattered(Navigation):
    """Measures every position anew and badly."""

    def _position(self, response: type[PositionResponse], whom: Source) -> PositionResponse:
        position = super()._position(response, whom)
        if position.x is None:
            return position
        chance = random.Random(f"{self.now} {whom}")
        return position._replace(x=position.x + chance.choice((-SCATTER, SCATTER)))


class LastSeen(Navigation):
    """Goes on saying the first place that it saw."""

    _seen: PositionResponse | None = None

    def _position(self, response: type[PositionResponse], whom: Source) -> PositionResponse:
        if whom is not Source.INTERNAL:
            return super()._position(response, whom)
        self._seen = self._seen or super()._position(response, whom)
        return self._seen


class SeesThings(Navigation):
    """Finds robots that the start configuration does not have."""

    def _present(self, whom: Source) -> bool:
        return True


def _unapplied(navigation: Navigation, _: StartConfigurationSet, __: Any) -> None:
    navigation.offer(StartConfigurationConfirm())


def _mute_in_safe_state(navigation: Navigation, request: CheckNaviRequest, healthy: Any) -> None:
    if not navigation.safe:
        healthy(request)


def _under_enemy_2(navigation: Navigation, *_: object) -> None:
    navigation.offer(navigation._position(Enemy2PositionResponse, Source.ENEMY_1))


def _zero(position: Any) -> Any:
    return position if position.x is not None else position._replace(x=0, y=0, angle=0)


FAULTS = (
    Fault(
        "navi-not-answered",
        "answers no Navi Position Request",
        arriving(NaviPositionRequest, lost),
        Caught("navigation", "2.2 Estimated Location response: our robot's place"),
    ),
    Fault(
        "navi-answered-late",
        "takes 300 ms to answer a Navi Position Request",
        late(NaviPositionResponse, 0.3),
        Caught("navigation", "2.2 Estimated Location response: follows directly"),
    ),
    Fault(
        "navi-answered-twice",
        "sends Navi Position Response two times for one request",
        leaving(NaviPositionResponse, twice),
        Caught("navigation", "2.2 Estimated Location response: one answer for one request"),
    ),
    Fault(
        "navi-swapped",
        "sends x as y and y as x",
        leaving(NaviPositionResponse, exchanged("x", "y")),
        Caught("navigation", "2.2 Estimated Location response: our robot's place"),
    ),
    Fault(
        "navi-in-centimetres",
        "sends our robot's place in centimetres",
        leaving(NaviPositionResponse, raw(x=lambda x: x // 10, y=lambda y: y // 10)),
        Caught("navigation", "2.2 Estimated Location response: our robot's place"),
    ),
    Fault(
        "navi-byte-order",
        "sends the bytes of our robot's place the wrong way round",
        leaving(NaviPositionResponse, data(lambda data: data[::-1])),
        Caught("navigation", "2.2 Estimated Location response: our robot's place"),
    ),
    Fault(
        "navi-short",
        "sends our robot's place without the byte with the source",
        leaving(NaviPositionResponse, data(lambda data: data[:4])),
        Caught("navigation", "2.2 Estimated Location response: our robot's place"),
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
        Scattered,
        Caught("navigation", "2.2 Estimated Location response: our robot's place"),
    ),
    Fault(
        "navi-frozen",
        "goes on saying the first place that it saw",
        LastSeen,
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
        Caught("navigation", "2.2 Estimated Location response: enemy 1"),
    ),
    Fault(
        "enemy-not-answered",
        "answers no Enemy 2 Position Request",
        arriving(Enemy2PositionRequest, lost),
        Caught("navigation", "2.2 Estimated Location response: enemy 2"),
    ),
    Fault(
        "confederate-not-answered",
        "answers no Confederate Position Request",
        arriving(ConfederatePositionRequest, lost),
        Caught("navigation", "2.2 Estimated Location response: the confederate"),
    ),
    Fault(
        "enemy-unknown-as-zero",
        "says 0, 0 for an enemy that is not there",
        leaving(Enemy2PositionResponse, meaning(_zero)),
        Caught("navigation", "Table 2: an enemy that is not there is unknown"),
    ),
    Fault(
        "enemy-invented",
        "finds an enemy that the start configuration does not have",
        SeesThings,
        Caught("navigation", "Table 2: an enemy that is not there is unknown"),
    ),
    Fault(
        "enemy-angle-invented",
        "says 0 degrees for an enemy's angle, which it cannot measure",
        leaving(Enemy1PositionResponse, meaning(lambda p: p._replace(angle=0) if p.x is not None else p)),
        Caught("navigation", "Table 2: an angle that is not measured is unknown"),
    ),
    Fault(
        "navi-check-not-answered",
        "answers no Check Navi Request",
        arriving(CheckNaviRequest, lost),
        Caught("navigation", "2.3 Node Check Response: the navigation is there"),
    ),
    Fault(
        "navi-check-answered-for-drive",
        "answers Check Navi Request with Check Drive Response",
        leaving(CheckNaviResponse, foreign(CheckDriveResponse())),
        Caught("navigation", "2.3 Node Check Response: the navigation is there"),
    ),
    Fault(
        "navi-check-answered-twice",
        "sends Check Navi Response two times for one request",
        leaving(CheckNaviResponse, twice),
        Caught("navigation", "2.3 Node Check Response: one answer for one request"),
    ),
    Fault(
        "navi-configuration-not-confirmed",
        "takes the start configuration and does not confirm it",
        leaving(StartConfigurationConfirm, lost),
        Caught("navigation", "2.3 Start Configuration Confirm: the navigation confirms"),
    ),
    Fault(
        "navi-configuration-not-applied",
        "confirms the start configuration and forgets it",
        handling(StartConfigurationSet, _unapplied),
        Caught("navigation", "Table 2: an enemy that is not there is unknown"),
    ),
    Fault(
        "navi-mute-after-shutdown",
        "answers no node check after an Emergency Shutdown",
        handling(CheckNaviRequest, _mute_in_safe_state),
        Caught("navigation", "4.2.2 Emergency mushroom: the navigation still answers node checks"),
    ),
)
