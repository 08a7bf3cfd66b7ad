"""Every row of the document's Table 5: its sender sends it, and each of its receivers acts on it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest

from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
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
    StopDrive,
)
from eurobot_od.robot.model.values import Obstacle, Source
from eurobot_od.robot.nodes import ROLES, Core, Drive, Navigation
from tests.robot.nodes.harness import PROTOCOL, RED, Bench, as_if_started

GOTO = GotoXY(1500, 1000, 90, 80)
PLACE = (1234, 567, 89)

EMERGENCY_STOP = EmergencyStop(Obstacle.ENEMY)
ENEMY_1 = Enemy1PositionResponse(*PLACE, Source.ENEMY_1)
ENEMY_2 = Enemy2PositionResponse(*PLACE, Source.ENEMY_2)
CONFEDERATE = ConfederatePositionResponse(*PLACE, Source.CONFEDERATE)
KALMAN = KalmanPositionResponse(*PLACE, Source.INTERNAL)
NAVI = NaviPositionResponse(*PLACE, Source.INTERNAL)


class Cause(NamedTuple):
    """What makes a node send: a call on the core, and what it hears after that."""

    call: Callable[[Core], object] | None = None
    hears: tuple[Message, ...] = ()


class Effect(NamedTuple):
    """How to see that a node acted on what it heard.

    Before that, `call` is made if it is the core, and it hears `before`.
    """

    acted: Callable[[Bench], object]
    before: tuple[Message, ...] = ()
    call: Callable[[Core], object] | None = None


class Row(NamedTuple):
    """A message, what makes its senders send it, and what it does to its receivers."""

    message: Message
    senders: dict[str, Cause]
    receivers: dict[str, Effect]


def _goto(core: Core) -> object:
    as_if_started(core)
    return core.goto(*GOTO)


def _configure(core: Core) -> object:
    return core.configure_start(*RED)


def _asks_no_more(bench: Bench) -> object:
    asked = len(bench.sent(CheckNaviRequest))
    bench.run(3.0)
    return len(bench.sent(CheckNaviRequest)) == asked


def _drive(acted: Callable[[Drive], object]) -> Callable[[Bench], object]:
    return lambda bench: acted(bench.drive)


def _navigation(acted: Callable[[Navigation], object]) -> Callable[[Bench], object]:
    return lambda bench: acted(bench.navigation)


def _request(message: Message, sender: Cause, receiver: str, answer: type[Message]) -> Row:
    """Return the row of a request of the core: its receiver answers it."""
    return Row(message, {"core": sender}, {receiver: Effect(lambda bench: bench.sent(answer))})


def _position(message: Message, sender: str, request: Message) -> Row:
    """Return the row of a position that the core asks for, and knows then."""

    def is_known(bench: Bench) -> object:
        return [seen.position for seen in bench.core.positions.values()] == [message]

    return Row(message, {sender: Cause(hears=(request,))}, {"core": Effect(is_known)})


CONFIGURED = (StartConfigurationConfirm(), CheckDriveResponse(), CheckNaviResponse())
POLL = Cause(_configure, CONFIGURED)
"""A configured core asks for all positions."""

TABLE_5 = (
    Row(
        EmergencyShutdown(),
        {"core": Cause(Core.emergency_shutdown)},
        {
            "drive": Effect(_drive(lambda drive: drive.safe)),
            "navigation": Effect(_navigation(lambda navigation: navigation.safe)),
        },
    ),
    Row(
        EMERGENCY_STOP,
        {"core": Cause(lambda core: core.emergency_stop(Obstacle.ENEMY))},
        {"drive": Effect(_drive(lambda drive: drive.stopped_by == EMERGENCY_STOP), (RED, GOTO))},
    ),
    Row(
        StopDrive(),
        {"core": Cause(Core.stop)},
        {"drive": Effect(_drive(lambda drive: drive.goto is None), (RED, GOTO))},
    ),
    Row(
        GOTO,
        {"core": Cause(_goto)},
        {"drive": Effect(_drive(lambda drive: drive.goto == GOTO and drive.moving), (RED,))},
    ),
    Row(
        GotoConfirm(),
        {"drive": Cause(hears=(RED, GOTO))},
        {"core": Effect(lambda bench: bench.sent(GotoStateRequest), call=_goto)},
    ),
    _request(GotoStateRequest(), Cause(_goto, (GotoConfirm(),)), "drive", GotoStateResponse),
    Row(
        GotoStateResponse(0),
        {"drive": Cause(hears=(GotoStateRequest(),))},
        {"core": Effect(lambda bench: bench.sent(KalmanPositionRequest), (GotoConfirm(),), _goto)},
    ),
    _request(NaviPositionRequest(), POLL, "navigation", NaviPositionResponse),
    Row(
        NAVI,
        {"navigation": Cause(hears=(NaviPositionRequest(),))},
        {"drive": Effect(_drive(lambda drive: drive.estimate.pose == PLACE))},
    ),
    _request(KalmanPositionRequest(), POLL, "drive", KalmanPositionResponse),
    _position(KALMAN, "drive", KalmanPositionRequest()),
    _request(Enemy1PositionRequest(), POLL, "navigation", Enemy1PositionResponse),
    _position(ENEMY_1, "navigation", Enemy1PositionRequest()),
    _request(Enemy2PositionRequest(), POLL, "navigation", Enemy2PositionResponse),
    _position(ENEMY_2, "navigation", Enemy2PositionRequest()),
    _request(ConfederatePositionRequest(), POLL, "navigation", ConfederatePositionResponse),
    _position(CONFEDERATE, "navigation", ConfederatePositionRequest()),
    Row(
        RED,
        {"core": Cause(_configure)},
        {
            "drive": Effect(_drive(lambda drive: drive.configuration == RED)),
            "navigation": Effect(_navigation(lambda navigation: navigation.configuration == RED)),
        },
    ),
    Row(
        StartConfigurationConfirm(),
        {"drive": Cause(hears=(RED,)), "navigation": Cause(hears=(RED,))},
        {"core": Effect(lambda bench: bench.sent(CheckDriveRequest), call=_configure)},
    ),
    _request(CheckNaviRequest(), Cause(Core.check_nodes, (CheckDriveResponse(),)), "navigation", CheckNaviResponse),
    Row(
        CheckNaviResponse(),
        {"navigation": Cause(hears=(CheckNaviRequest(),))},
        {"core": Effect(_asks_no_more, (CheckDriveResponse(),), Core.check_nodes)},
    ),
    _request(CheckDriveRequest(), Cause(Core.check_nodes), "drive", CheckDriveResponse),
    Row(
        CheckDriveResponse(),
        {"drive": Cause(hears=(CheckDriveRequest(),))},
        {"core": Effect(lambda bench: bench.sent(CheckNaviRequest), call=Core.check_nodes)},
    ),
)

SENDERS = [(row.message, *each) for row in TABLE_5 for each in row.senders.items()]
RECEIVERS = [(row.message, *each) for row in TABLE_5 for each in row.receivers.items()]


def _alone(node: str) -> tuple[Bench, str]:
    """Return a bench on which only one node is real, and the name of a stand-in."""
    peers = [name for name in ROLES if name != node]
    return Bench(*peers), peers[0]


@pytest.mark.parametrize(("message", "sender", "cause"), SENDERS)
def test_the_sender_of_a_row_sends_its_message(message: Message, sender: str, cause: Cause) -> None:
    bench, peer = _alone(sender)
    if cause.call:
        cause.call(bench.core)
        bench.run(0.01)
    bench.say(peer, *cause.hears, within=3.0)
    assert bench.sent(type(message))


@pytest.mark.parametrize(("message", "receiver", "effect"), RECEIVERS)
def test_each_receiver_of_a_row_acts_on_its_message(message: Message, receiver: str, effect: Effect) -> None:
    bench, peer = _alone(receiver)
    if effect.call:
        effect.call(bench.core)
        bench.run(0.01)
    bench.say(peer, *effect.before, within=0.3)
    assert not effect.acted(bench)
    bench.say(peer, message, within=0.3)
    assert effect.acted(bench)


def test_the_rows_are_those_of_the_eds_files() -> None:
    rows = {(type(row.message), frozenset(row.senders), frozenset(row.receivers)) for row in TABLE_5}
    assert rows == {(each.type, frozenset(each.senders), frozenset(each.receivers)) for each in PROTOCOL.bindings}
