"""Mailboxes: what leaves when, in which order, and what becomes of a frame that finds none free."""

from __future__ import annotations

from math import inf

import pytest

from eurobot_od.controller import Report, Stay, TransmitStatistics
from eurobot_od.frame import Frame
from eurobot_od.robot.gatekeeper import Mailboxes
from tests.bus.live.sender import FRAMES, interrupt_at_any_line

WAIT = 0.050


def frames(*texts: str) -> list[Frame]:
    """Return frames from candump's writing, `008#01`."""
    return [Frame(int(cob_id, 16), bytes.fromhex(data)) for cob_id, _, data in (text.partition("#") for text in texts)]


def mailboxes(count: int = 3, wait: float = WAIT) -> tuple[Mailboxes, list[Report]]:
    reports: list[Report] = []
    return Mailboxes(reports.append, count, wait), reports


def submit(boxes: Mailboxes, now: float, *texts: str, stay: Stay = Stay.SHORT) -> None:
    for frame in frames(*texts):
        boxes.submit(frame, now, stay)


def sent(boxes: Mailboxes, now: float) -> list[str]:
    """Send all frames of the controller, one at a time, and return them in the order on the wire."""
    order: list[str] = []
    boxes.load(now)
    while (frame := boxes.urgent()) is not None:
        order.append(str(frame))
        assert boxes.complete(frame)
        boxes.load(now)
    return order


ORDERS = {
    "nothing": ([], []),
    "the lowest identifier first": (["400#", "008#", "001#"], ["001#", "008#", "400#"]),
    "equal identifiers as submitted": (["008#03", "008#01", "008#02"], ["008#03", "008#01", "008#02"]),
    "equal frames twice": (["008#01", "008#01"], ["008#01", "008#01"]),
    "more than there are mailboxes": (
        ["400#", "3C0#", "010#01", "008#", "010#02", "001#", "010#03"],
        ["001#", "008#", "010#01", "010#02", "010#03", "3C0#", "400#"],
    ),
}


@pytest.mark.parametrize(("submitted", "expected"), ORDERS.values())
@pytest.mark.parametrize("count", [1, 2, 3, 32])
def test_order_on_the_wire(count: int, submitted: list[str], expected: list[str]) -> None:
    boxes, _ = mailboxes(count)
    submit(boxes, 0.0, *submitted)
    assert sent(boxes, 0.0) == expected


def test_2014_urgent_frames_do_not_leave_in_reverse_order() -> None:
    boxes, _ = mailboxes()
    submit(boxes, 0.0, "3C0#01", "3C0#02", "3C0#03")
    boxes.load(0.0)
    submit(boxes, 0.0, "002#00", "004#", "008#01", "008#02")
    assert sent(boxes, 0.0) == ["3C0#01", "002#00", "004#", "008#01", "008#02", "3C0#02", "3C0#03"]


def test_loaded_frames_are_returned_once_and_most_urgent_first() -> None:
    boxes, _ = mailboxes(2)
    submit(boxes, 0.0, "400#", "008#", "010#")
    assert boxes.load(0.0) == frames("008#", "010#")
    assert boxes.load(0.0) == []


def test_a_frame_in_a_mailbox_stays_there_for_a_more_urgent_one() -> None:
    boxes, _ = mailboxes(1)
    submit(boxes, 0.0, "400#")
    boxes.load(0.0)
    submit(boxes, 0.0, "001#")
    assert boxes.load(0.0) == []
    assert boxes.urgent() == Frame(0x400)


def test_transmit_complete_frees_the_mailbox() -> None:
    boxes, _ = mailboxes(1)
    submit(boxes, 0.0, "008#01", "008#02")
    [first] = boxes.load(0.0)
    assert boxes.complete(first)
    assert boxes.load(0.0) == frames("008#02")


@pytest.mark.parametrize("text", ["008#02", "009#01", "008#"])
def test_transmit_complete_of_a_frame_in_no_mailbox_frees_none(text: str) -> None:
    boxes, _ = mailboxes(1)
    submit(boxes, 0.0, "008#01")
    boxes.load(0.0)
    [frame] = frames(text)
    assert not boxes.complete(frame)
    assert boxes.statistics() == TransmitStatistics(submitted=1, completed=0, dropped=0, waiting=0, loaded=1)


# Waiting too long


def test_a_frame_without_a_mailbox_is_dropped_after_its_wait_counted_and_reported() -> None:
    boxes, reports = mailboxes(1)
    submit(boxes, 0.0, "001#")
    boxes.load(0.0)
    submit(boxes, 1.0, "008#01")
    boxes.expire(1.049)
    assert reports == []
    boxes.expire(1.0 + WAIT)
    assert [str(each) for each in reports] == [
        "frame dropped: 0x008: 008#01 found no mailbox for 50 ms, 1 dropped so far"
    ]
    assert boxes.statistics() == TransmitStatistics(submitted=2, completed=0, dropped=1, waiting=0, loaded=1)


def test_a_frame_that_has_waited_too_long_is_not_loaded_any_more() -> None:
    boxes, _ = mailboxes(1)
    submit(boxes, 0.0, "001#")
    [first] = boxes.load(0.0)
    submit(boxes, 0.0, "008#01")
    submit(boxes, 0.020, "400#")
    boxes.complete(first)
    assert boxes.load(0.060) == frames("400#")


def test_a_frame_is_not_dropped_because_its_bus_was_served_late_while_a_mailbox_was_free() -> None:
    boxes, reports = mailboxes(1)
    submit(boxes, 0.0, "008#01")
    assert (boxes.load(10 * WAIT), reports) == (frames("008#01"), [])


@pytest.mark.parametrize("stay", [Stay.LASTING, Stay.TRANSFER, Stay.PERIODIC])
def test_a_lasting_frame_waits_without_limit(stay: Stay) -> None:
    boxes, reports = mailboxes(1)
    submit(boxes, 0.0, "001#")
    [first] = boxes.load(0.0)
    [part] = frames("582#01")
    boxes.submit(part, 0.0, stay)
    boxes.load(20 * WAIT)
    boxes.complete(first)
    assert (boxes.load(40 * WAIT), reports) == ([part], [])


def test_a_periodic_frame_takes_the_place_of_its_older_self_and_of_nothing_else() -> None:
    boxes, reports = mailboxes(1)
    submit(boxes, 0.0, "001#")
    boxes.load(0.0)
    for text, stay in (("702#00", Stay.LASTING), ("702#7F", Stay.PERIODIC), ("080#", Stay.PERIODIC)):
        submit(boxes, 0.0, text, stay=stay)
    submit(boxes, 1.0, "702#05", stay=Stay.PERIODIC)
    assert sent(boxes, 1.0) == ["001#", "080#", "702#00", "702#05"]
    assert (boxes.statistics().dropped, reports) == (1, [])


def test_a_heartbeat_goes_before_what_a_transfer_still_has_to_send() -> None:
    boxes, _ = mailboxes(3)
    for number in range(6):
        boxes.submit(Frame(0x582, bytes([number])), 0.0, Stay.TRANSFER)
    boxes.load(0.0)
    submit(boxes, 0.0, "702#05", stay=Stay.PERIODIC)
    submit(boxes, 0.0, "004#")
    assert sent(boxes, 0.0) == ["582#00", "004#", "582#01", "582#02", "702#05", "582#03", "582#04", "582#05"]


def test_a_frame_in_a_mailbox_is_never_dropped() -> None:
    boxes, reports = mailboxes(1)
    submit(boxes, 0.0, "008#01")
    boxes.load(0.0)
    boxes.expire(1000.0)
    assert (boxes.urgent(), reports) == (Frame(0x008, b"\x01"), [])


def test_2014_the_wait_does_not_shrink_after_idle_time() -> None:
    boxes, reports = mailboxes(1)
    submit(boxes, 0.0, "001#")
    [first] = boxes.load(0.0)
    boxes.complete(first)
    submit(boxes, 3600.0, "002#", "004#")
    boxes.load(3600.0)
    submit(boxes, 3600.030, "008#")
    boxes.expire(3600.049)
    assert reports == []
    boxes.expire(3600.051)
    assert [each.name for each in reports] == ["0x004"]
    boxes.expire(3600.079)
    assert [each.name for each in reports] == ["0x004"]


def test_the_next_expiry_is_that_of_the_frame_that_waits_longest() -> None:
    boxes, _ = mailboxes(1)
    assert boxes.next_expiry == inf
    submit(boxes, 0.0, "001#")
    boxes.load(0.0)
    submit(boxes, 1.0, "400#")
    submit(boxes, 2.0, "008#")
    assert boxes.next_expiry == 1.0 + WAIT
    boxes.load(1.0)
    assert boxes.next_expiry == 1.0 + WAIT
    boxes.expire(1.0 + WAIT)
    assert boxes.next_expiry == inf


def test_mailboxes_hold_a_frame_from_its_submission_until_it_was_sent() -> None:
    boxes, _ = mailboxes(count=1)
    (frame,) = frames("008#01")
    held = [boxes.holds(frame)]
    for step in (
        lambda: submit(boxes, 0.0, "008#02", "008#01"),  # the other one gets the mailbox
        lambda: boxes.load(0.0),
        lambda: boxes.complete(Frame(0x008, b"\x02")),
        lambda: boxes.load(0.0),
        lambda: boxes.complete(frame),
    ):
        step()
        held.append(boxes.holds(frame))
    assert held == [False, True, True, True, True, False]


def test_while_the_bus_is_lost_only_lasting_frames_are_kept_and_others_counted() -> None:
    boxes, reports = mailboxes(2)
    stop, goto = frames("004#", "008#01")
    boxes.submit(goto, 0.0)
    boxes.submit(stop, 0.0, Stay.LASTING)
    submit(boxes, 0.0, "00C#", "340#")
    submit(boxes, 0.0, "582#", stay=Stay.TRANSFER)
    boxes.load(0.0)  # the stop and the goto are in mailboxes
    boxes.leave()
    submit(boxes, 5.0, "701#05", "008#02")
    boxes.leave()  # noticed once more
    assert boxes.come_back() == 6
    assert boxes.load(6.0) == []
    assert boxes.urgent() == stop
    assert boxes.statistics() == TransmitStatistics(submitted=7, completed=0, dropped=6, waiting=0, loaded=1)
    assert reports == []
    submit(boxes, 6.0, "008#03")
    assert boxes.load(6.0) == frames("008#03")


def test_only_waiting_frames_are_withdrawn() -> None:
    boxes, _ = mailboxes(1)
    submit(boxes, 0.0, "582#01", "582#02", "582#03", "701#05")
    boxes.load(0.0)
    boxes.withdraw(0x582)
    assert boxes.statistics() == TransmitStatistics(submitted=4, completed=0, dropped=2, waiting=1, loaded=1)
    assert boxes.urgent() == Frame(0x582, b"\x01")


def test_an_interrupt_of_the_sender_at_any_line_loses_no_frame() -> None:
    assert interrupt_at_any_line(lambda: Mailboxes(lambda _: None)) > len(FRAMES)
