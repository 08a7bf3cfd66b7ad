"""Lists of frames: what is sent when, what sets a row off, and what is refused."""

from __future__ import annotations

import pytest

from eurobot_od.check.sending import RunningList, read_list
from eurobot_od.errors import EurobotError
from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Catalogue
from eurobot_od.pdo.protocol import Protocol
from tests.kit.devices import MOTOR

PROTOCOL = Protocol.of_devices([Dictionary.load(MOTOR, 5)], Catalogue())
TICK = 0.001


def speed(value: int) -> Frame:
    """Return the frame of motor.TPDO1 with a speed."""
    return Frame(0x185, value.to_bytes(2, "little", signed=True) + bytes(6))


def sent(text: str, until: float, *heard: tuple[float, Frame], look: float = TICK) -> list[tuple[float, str]]:
    """Return what a list sends in a time in which frames are heard, with the times."""
    running, found, waiting = RunningList(read_list(text, "list.yaml", PROTOCOL), PROTOCOL, 0.0), [], list(heard)
    for step in range(round(until / look) + 1):
        now = round(step * look, 6)
        while waiting and waiting[0][0] <= now:
            running.take(now, waiting.pop(0)[1])
        found += [(now, str(each)) for each in running.due(now)]
    return found


@pytest.mark.parametrize(
    ("text", "times"),
    [
        ("- {send: 185#01}", [0]),
        ("- {send: 185#01, period: 20 ms}", [0, 20, 40, 60]),
        ("- {send: 185#01, burst: 3}", [0, 0, 0]),
        ("- {send: 185#01, burst: 3, gap: 5 ms}", [0, 5, 10]),
        ("- {send: 185#01, burst: 2, gap: 5 ms, period: 30 ms}", [0, 5, 30, 35, 60]),
    ],
    ids=["once", "period", "burst at once", "burst with a gap", "burst and period"],
)
def test_a_row_without_a_trigger_begins_at_once(text: str, times: list[int]) -> None:
    assert [round(1000 * now) for now, _ in sent(text, 0.06)] == times


HEARD = [(0.010, speed(50)), (0.020, speed(200)), (0.030, speed(300)), (0.040, speed(0)), (0.050, speed(101))]


@pytest.mark.parametrize(
    ("trigger", "times"),
    [
        ("185", [10, 20, 30, 40, 50]),
        ("motor.TPDO1", [10, 20, 30, 40, 50]),
        ("186", []),
        ("motor.TPDO1.speed > 100", [20, 30, 50]),
        ("motor.TPDO1.speed becomes > 100", [20, 50]),
        ("motor.TPDO1.speed 200", [20]),
        ("motor.TPDO1.speed 40..60", [10]),
        ("motor.TPDO1.speed becomes not 50", [20]),
    ],
)
def test_a_row_is_sent_when_its_trigger_is_seen(trigger: str, times: list[int]) -> None:
    assert [round(1000 * now) for now, _ in sent(f"- {{send: 100#01, trigger: {trigger}}}", 0.06, *HEARD)] == times


def test_a_trigger_begins_a_period_and_counts_once() -> None:
    found = sent("- {send: 100#01, period: 20 ms, trigger: 185}", 0.06, *HEARD)
    assert [round(1000 * now) for now, _ in found] == [10, 30, 50]


def test_a_frame_that_is_too_short_or_remote_sets_nothing_off() -> None:
    heard = [(0.01, Frame(0x185, b"\xff")), (0.02, RemoteFrame(0x185, bytes(8)))]
    assert sent("- {send: 100#01, trigger: motor.TPDO1.speed any}", 0.03, *heard) == []


def test_messages_and_remote_frames_are_sent_together() -> None:
    text = "- {send: motor.RPDO1, fields: {target_speed: -2}}\n- {send: 705#R1}\n"
    assert [frame for _, frame in sent(text, 0)] == ["205#FEFF", "705#R1"]


def test_periods_that_are_missed_are_left_out_and_the_next_is_on_time() -> None:
    running = RunningList(read_list("- {send: 185#01, period: 20 ms}", "list.yaml", PROTOCOL), PROTOCOL, 0.0)
    assert [len(running.due(now)) for now in (0.0, 0.055, 0.056, 0.060)] == [1, 1, 0, 1]


@pytest.mark.parametrize(
    ("text", "is_over"),
    [
        ("- {send: 185#01}", True),
        ("- {send: 185#01, period: 1 s}", False),
        ("- {send: 100#01, trigger: 185}", False),
    ],
)
def test_a_list_is_over_once_nothing_more_can_be_sent(text: str, is_over: bool) -> None:
    running = RunningList(read_list(text, "list.yaml", PROTOCOL), PROTOCOL, 0.0)
    running.due(0.0)
    assert running.is_over is is_over


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("5", r"list.yaml:1:1: expected a list"),
        ("[]", "a list has 1 to 100 rows, not 0"),
        ("- {send: 185#01}\n- {send: 185#0}", r"list.yaml:2:3: '185#0' is not a frame"),
        ("- {send: 185#01, fields: {a: 1}}", "the frame 185#01 has no fields"),
        ("- {send: motor.RPDO1}", "motor.RPDO1: target_speed missing"),
        ("- {send: motor.RPDO1, fields: {target_speed: 9999}}", "-3000..3000"),
        ("- {send: 185#01, period: 1 ms}", r"period = '1 ms' is not allowed; allowed: 0.005..60 s"),
        ("- {send: 185#01, burst: 0}", "allowed: whole numbers 1..1000"),
        ("- {send: 185#01, burst: 3, gap: 10 ms, period: 20 ms}", "not shorter than the period of 0.02 s"),
        ("- {send: 100#01, trigger: 800}", "unknown message '800'"),
        ("- {send: 100#01, trigger: motor.TPDO1.slowness > 5}", "unknown field of motor.TPDO1 'slowness'"),
        ("- {send: 100#01, trigger: motor.TPDO1.speed > 9999}", "'9999' is not allowed; allowed: -3000..3000"),
        ("- {send: 185#01, trigger: 185}", "row 1: it would set itself off for ever"),
        ("- {send: 100#, trigger: 101}\n- {send: 101#, trigger: 100}", "row 1, 2: it would set itself off"),
    ],
)
def test_a_row_that_cannot_be_sent_is_refused_with_its_place(text: str, error: str) -> None:
    with pytest.raises(EurobotError, match=error):
        read_list(text, "list.yaml", PROTOCOL)
