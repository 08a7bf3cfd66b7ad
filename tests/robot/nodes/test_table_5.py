"""Every row of the document's Table 5: its sender sends it, and each of its receivers acts on it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest

from eurobot_od.pdo.message import Message
from eurobot_od.robot.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionRequest,
    ConfederatePositionResponse,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    Enemy2PositionResponse,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionRequest,
    NaviPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.nodes import ROLES, Core, Drive, Navigation
from eurobot_od.robot.values import Obstacle, Source
from tests.robot.nodes.harness import PROTOCOL, RED, Bench

GOTO = GotoXY(1500, 1000, 90, 80)
PLACE = (1234, 567, 89)

# Who sends


class Sends(NamedTuple):
    """A sender, its message, and what makes it send: a call on the core, and what it hears after that."""

    sender: str
    message: type[Message]
    call: Callable[[Core], object] | None = None
    hears: tuple[Message, ...] = ()


def _goto(core: Core) -> object:
    return core.goto(*GOTO)


def _configure(core: Core) -> object:
    return core.configure_start(*RED)


CONFIRMED = (StartConfigurationConfirm(),)

SENDS = (
    Sends("core", EmergencyShutdown, Core.emergency_shutdown),
    Sends("core", EmergencyStop, lambda core: core.emergency_stop(Obstacle.ENEMY)),
    Sends("core", StopDrive, Core.stop),
    Sends("core", GotoXY, _goto),
    Sends("drive", GotoConfirm, hears=(RED, GOTO)),
    Sends("core", GotoStateRequest, _goto, (GotoConfirm(),)),
    Sends("drive", GotoStateResponse, hears=(GotoStateRequest(),)),
    Sends("core", NaviPositionRequest, _configure, CONFIRMED),
    Sends("navigation", NaviPositionResponse, hears=(NaviPositionRequest(),)),
    Sends("core", KalmanPositionRequest, _configure, CONFIRMED),
    Sends("drive", KalmanPositionResponse, hears=(KalmanPositionRequest(),)),
    Sends("core", Enemy1PositionRequest, _configure, CONFIRMED),
    Sends("navigation", Enemy1PositionResponse, hears=(Enemy1PositionRequest(),)),
    Sends("core", Enemy2PositionRequest, _configure, CONFIRMED),
    Sends("navigation", Enemy2PositionResponse, hears=(Enemy2PositionRequest(),)),
    Sends("core", ConfederatePositionRequest, _configure, CONFIRMED),
    Sends("navigation", ConfederatePositionResponse, hears=(ConfederatePositionRequest(),)),
    Sends("core", StartConfigurationSet, _configure),
    Sends("drive", StartConfigurationConfirm, hears=(RED,)),
    Sends("navigation", StartConfigurationConfirm, hears=(RED,)),
    Sends("core", CheckNaviRequest, Core.check_nodes, (CheckDriveResponse(),)),
    Sends("navigation", CheckNaviResponse, hears=(CheckNaviRequest(),)),
    Sends("core", CheckDriveRequest, Core.check_nodes),
    Sends("drive", CheckDriveResponse, hears=(CheckDriveRequest(),)),
)


def _alone(node: str) -> tuple[Bench, str]:
    """Return a bench on which only one node is real, and the name of a stand-in."""
    peers = [name for name in ROLES if name != node]
    return Bench(*peers), peers[0]


@pytest.mark.parametrize("row", SENDS, ids=lambda row: f"{row.sender}-{row.message.__name__}")
def test_the_sender_sends_it(row: Sends) -> None:
    bench, peer = _alone(row.sender)
    if row.call:
        row.call(bench.core)
        bench.run(0.01)
    bench.say(peer, *row.hears, within=3.0)
    assert bench.sent(row.message)


# Who receives


class Receives(NamedTuple):
    """A receiver, what it hears, and how to see that it acted.

    Before that, `call` is made if it is the core, and it hears `before`.
    """

    receiver: str
    message: Message
    acted: Callable[[Bench], object]
    before: tuple[Message, ...] = ()
    call: Callable[[Core], object] | None = None


def _answers(message_type: type[Message]) -> Callable[[Bench], object]:
    return lambda bench: bench.sent(message_type)


def _knows(response: Message) -> Callable[[Bench], object]:
    return lambda bench: [seen.position for seen in bench.core.positions.values()] == [response]


def _asks_no_more(bench: Bench) -> object:
    asked = len(bench.log)
    bench.run(3.0)
    return len(bench.log) == asked


def _drive(acted: Callable[[Drive], object]) -> Callable[[Bench], object]:
    return lambda bench: acted(bench.drive)


def _navigation(acted: Callable[[Navigation], object]) -> Callable[[Bench], object]:
    return lambda bench: acted(bench.navigation)


EMERGENCY_STOP = EmergencyStop(Obstacle.ENEMY)
ENEMY_1 = Enemy1PositionResponse(*PLACE, Source.ENEMY_1)
ENEMY_2 = Enemy2PositionResponse(*PLACE, Source.ENEMY_2)
CONFEDERATE = ConfederatePositionResponse(*PLACE, Source.CONFEDERATE)
KALMAN = KalmanPositionResponse(*PLACE, Source.INTERNAL)
NAVI = NaviPositionResponse(*PLACE, Source.INTERNAL)

RECEIVES = (
    Receives("drive", EmergencyShutdown(), _drive(lambda drive: drive.safe)),
    Receives("navigation", EmergencyShutdown(), _navigation(lambda navigation: navigation.safe)),
    Receives("drive", EMERGENCY_STOP, _drive(lambda drive: drive.stopped_by == EMERGENCY_STOP), (RED, GOTO)),
    Receives("drive", StopDrive(), _drive(lambda drive: drive.goto is None), (RED, GOTO)),
    Receives("drive", GOTO, _drive(lambda drive: drive.goto == GOTO and drive.moving), (RED,)),
    Receives("core", GotoConfirm(), _answers(GotoStateRequest), call=_goto),
    Receives("drive", GotoStateRequest(), _answers(GotoStateResponse)),
    Receives("core", GotoStateResponse(0), _asks_no_more, (GotoConfirm(),), _goto),
    Receives("navigation", NaviPositionRequest(), _answers(NaviPositionResponse)),
    Receives("drive", NAVI, _drive(lambda drive: drive.estimate.pose == PLACE)),
    Receives("drive", KalmanPositionRequest(), _answers(KalmanPositionResponse)),
    Receives("core", KALMAN, _knows(KALMAN)),
    Receives("navigation", Enemy1PositionRequest(), _answers(Enemy1PositionResponse)),
    Receives("core", ENEMY_1, _knows(ENEMY_1)),
    Receives("navigation", Enemy2PositionRequest(), _answers(Enemy2PositionResponse)),
    Receives("core", ENEMY_2, _knows(ENEMY_2)),
    Receives("navigation", ConfederatePositionRequest(), _answers(ConfederatePositionResponse)),
    Receives("core", CONFEDERATE, _knows(CONFEDERATE)),
    Receives("drive", RED, _drive(lambda drive: drive.configuration == RED)),
    Receives("navigation", RED, _navigation(lambda navigation: navigation.configuration == RED)),
    Receives("core", StartConfigurationConfirm(), lambda bench: bench.core.configuration == RED, call=_configure),
    Receives("navigation", CheckNaviRequest(), _answers(CheckNaviResponse)),
    Receives("core", CheckNaviResponse(), _asks_no_more, (CheckDriveResponse(),), Core.check_nodes),
    Receives("drive", CheckDriveRequest(), _answers(CheckDriveResponse)),
    Receives("core", CheckDriveResponse(), _answers(CheckNaviRequest), call=Core.check_nodes),
)


@pytest.mark.parametrize("row", RECEIVES, ids=lambda row: f"{row.receiver}-{type(row.message).__name__}")
def test_each_receiver_acts_on_it(row: Receives) -> None:
    bench, peer = _alone(row.receiver)
    if row.call:
        row.call(bench.core)
        bench.run(0.01)
    bench.say(peer, *row.before, within=0.3)
    assert not row.acted(bench)
    bench.say(peer, row.message, within=0.3)
    assert row.acted(bench)


def test_the_rows_are_those_of_the_eds_files() -> None:
    senders = {(binding.type, sender) for binding in PROTOCOL.bindings for sender in binding.senders}
    receivers = {(binding.type, receiver) for binding in PROTOCOL.bindings for receiver in binding.receivers}
    assert {(row.message, row.sender) for row in SENDS} == senders
    assert {(type(row.message), row.receiver) for row in RECEIVES} == receivers
