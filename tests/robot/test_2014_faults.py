"""Faults of the 2014 robot that must not return: those that take a whole node or several to show.

The others stand where they happen:

- a dataless message handed its listener the previous message's data: test_gatekeeper
- listener 21 and later lost without a word: test_gatekeeper
- queues dropped the newer message without a word: test_gatekeeper
- urgent frames left in reverse order: test_gatekeeper_mailboxes
- transmit wait shrank to zero after idle time: test_gatekeeper_mailboxes
- unmasked obstacle byte, and the length never looked at, as far as a codec goes: test_protocol
"""

from __future__ import annotations

import pytest

from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    SOURCES,
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    EmergencyStop,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionResponse,
    PositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
)
from eurobot_od.robot.model.values import Obstacle, Outcome
from tests.robot.nodes.harness import PROTOCOL, RED, Bench, as_if_started

GOTO = GotoXY(1500, 1000, 90, 100)


@pytest.mark.parametrize(
    ("wrong", "answered", "asked"),
    [
        (CheckNaviResponse(), 0, CheckDriveRequest()),
        (CheckDriveResponse(), 1, CheckNaviRequest()),
    ],
)
def test_2014_either_nodes_check_answer_satisfied_either_check(wrong: Message, answered: int, asked: Message) -> None:
    bench = Bench("drive", "navigation")
    call = bench.core.check_nodes()
    bench.run(0.01)
    for right in [CheckDriveResponse()][:answered]:
        bench.say("drive", right)
    assert bench.messages()[-1] == asked
    bench.say("drive", wrong, within=0.5)
    assert not call.done()
    assert bench.messages()[-1] == wrong


@pytest.mark.parametrize("length", [0, 1, 5, 7])
def test_2014_length_never_looked_at_short_frames_read_left_over_bytes(length: int) -> None:
    bench = Bench("core")
    full = PROTOCOL.encode(GOTO)
    bench.say("core", RED, full, within=1.0)
    bench.say("core", Frame(full.cob_id, full.data[:length]))
    assert bench.drive.goto == GOTO  # the one before: the short one is neither read nor filled up
    assert [frame.data[:2] for _, frame in bench.others if frame.cob_id == 0x082] == [b"\x10\x82"]


def test_2014_length_never_looked_at_in_an_answer() -> None:
    bench = Bench("drive", "navigation")
    as_if_started(bench.core)
    call = bench.core.goto(*GOTO)
    bench.run(0.01)
    bench.say("drive", Frame(PROTOCOL.cob_id("Goto Confirm")), within=0.25)
    bench.say("drive", Frame(PROTOCOL.cob_id(GotoStateResponse), b"\0\0"))  # would read "arrived"
    assert not call.done()


def test_2014_start_configuration_sent_once_its_confirm_never_awaited() -> None:
    bench = Bench("drive", "navigation")
    call = bench.core.configure_start(*RED)
    bench.run(1.1)
    assert bench.sent(StartConfigurationSet) == [RED, RED, RED]
    assert not call.done()
    assert bench.core.configuration is None
    bench.say("drive", StartConfigurationConfirm())
    bench.check()
    assert call.done()
    assert bench.core.configuration == RED


@pytest.mark.long
def test_2014_position_periods_other_than_configured_because_a_counter_wrapped() -> None:
    bench = Bench()
    bench.configure()
    start = bench.times(StartConfigurationConfirm)[0] + 2.0
    bench.run(302.0)  # longer than any counter of 8 bits lasts, in whole or in half periods
    for request, offset in ((KalmanPositionRequest, 0.1), (Enemy1PositionRequest, 0.5)):
        times = bench.times(request)
        assert times == pytest.approx([start + offset + 0.6 * number for number in range(500)], abs=0.001)


def test_2014_emergency_stop_delayed_behind_a_running_drive() -> None:
    bench = Bench()
    bench.configure()
    driving = bench.core.goto(2800, 200, 0, 100)
    bench.run(2.0)
    assert bench.drive.moving
    now = bench.now
    bench.core.emergency_stop(Obstacle.ENEMY)
    bench.run(0.4)
    assert bench.times(EmergencyStop)[0] - now < 0.001
    assert bench.drive.stopped_by == EmergencyStop(Obstacle.ENEMY)
    assert not bench.drive.moving
    assert driving.result(0).outcome is Outcome.STOPPED


@pytest.mark.parametrize("response", [KalmanPositionResponse, Enemy1PositionResponse])
@pytest.mark.parametrize(
    ("x", "y", "angle"),
    [(3001, 1000, 0), (1000, 2001, 0), (4095, 4095, 0), (1000, 1000, 360), (1000, 1000, 1022)],
)
def test_2014_positions_outside_the_field_stored_unchecked(
    response: type[PositionResponse], x: int, y: int, angle: int
) -> None:
    bench = Bench("drive", "navigation")
    good = response(1000, 1000, 0, SOURCES[response])
    _, raw = PROTOCOL.unpack(*PROTOCOL.encode(good))
    bad = PROTOCOL.pack(PROTOCOL.name(response), **raw | {"x": x, "y": y, "angle": angle})
    bench.say("drive", good, Frame(PROTOCOL.cob_id(response), bad))
    assert [sighting.position for sighting in bench.core.positions.values()] == [good]
    assert bench.core.ignored == 1


def test_2014_positions_outside_the_field_taken_into_the_estimate() -> None:
    bench = Bench("core")
    bad = PROTOCOL.pack("Navi Position Response", x=210, y=2047, angle=0, source=0)
    bench.say("core", RED, Frame(PROTOCOL.cob_id(NaviPositionResponse), bad))
    assert bench.pose() == (200, 1800, 0)
    assert bench.drive.ignored == 1


@pytest.mark.parametrize("raw", [0x02, 0xFE])
def test_2014_unmasked_obstacle_byte(raw: int) -> None:
    bench = Bench("core")
    bench.say("core", RED, GOTO, Frame(PROTOCOL.cob_id(EmergencyStop), bytes([raw])), within=1.0)
    assert bench.drive.obstacle is Obstacle.OBJECT  # bit 0 is the obstacle, the others are none of its business
    assert not bench.drive.moving
