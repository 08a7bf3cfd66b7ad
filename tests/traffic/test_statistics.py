"""What was seen beside what is promised."""

from __future__ import annotations

import pytest

from eurobot_od.bus import frame_bits
from eurobot_od.frame import Frame
from eurobot_od.traffic.load import MessageSet, PeriodicMessage, load_report
from eurobot_od.traffic.statistics import SeenTraffic, table

RATE = 125_000
ASK, ANSWER = Frame(0x010), Frame(0x011, bytes(8))
PROMISED = MessageSet(
    (
        PeriodicMessage.of("Ask", 0x010, 0, "a").every(100_000),
        PeriodicMessage.of("Answer", 0x011, 8, "b", "Ask").every(100_000)._replace(jitter=1_000),
    )
)


@pytest.fixture
def seen() -> SeenTraffic:
    """Two requests; the second one comes late, and its answer is slow."""
    seen = SeenTraffic(RATE, PROMISED)
    for time, frame in ((1.0, ASK), (1.002, ANSWER), (1.13, ASK), (1.1345, ANSWER), (2.0, Frame(0x100))):
        seen.take(time, frame, f"name {frame.cob_id}", "whoever")
    return seen


def test_gaps_and_jitter_against_the_promised_period(seen: SeenTraffic) -> None:
    ask = seen.messages[0x010, False]
    assert (ask.count, ask.node, ask.period) == (2, "a", 0.1)
    assert [ask.longest, ask.jitter] == pytest.approx([0.13, 0.03])


def test_a_gap_that_is_too_short_is_jitter_too(seen: SeenTraffic) -> None:
    seen.take(1.14, ASK, "", "")
    assert seen.messages[0x010, False].jitter == pytest.approx(0.09)


def test_the_worst_response_beside_its_bound(seen: SeenTraffic) -> None:
    ask, answer = seen.messages[0x010, False], seen.messages[0x011, False]
    assert (ask.answered, ask.bound) == (None, None)
    assert answer.answered == pytest.approx(0.0045)
    assert answer.bound == (load_report(PROMISED, RATE).rows[1].response or 0) / 1_000_000


def test_an_answer_that_was_lost_is_not_taken_for_a_late_one(seen: SeenTraffic) -> None:
    for time, frame in ((3.0, ASK), (4.0, ASK), (4.001, ANSWER)):
        seen.take(time, frame, "", "")
    assert seen.messages[0x011, False].answered == pytest.approx(0.0045)


def test_unpromised_messages_are_counted(seen: SeenTraffic) -> None:
    other = seen.messages[0x100, False]
    assert (other.name, other.node, other.period, other.longest, other.jitter) == (
        "name 256",
        "whoever",
        None,
        None,
        None,
    )


def test_load_has_the_stuff_bits(seen: SeenTraffic) -> None:
    bits = 2 * frame_bits(ASK) + 2 * frame_bits(ANSWER) + frame_bits(Frame(0x100))
    assert seen.load(sum(each.bits for each in seen.messages.values())) == pytest.approx(bits / RATE)


def test_load_without_frames_is_zero() -> None:
    assert SeenTraffic(RATE).load(0) == 0.0


def test_table(seen: SeenTraffic) -> None:
    heading, ask, answer, other, load = table(seen)
    assert heading.endswith("count   load  worst gap, ms  period, ms  jitter, ms  response, ms  bound, ms")
    assert ask.split()[2:] == ["16", "a", "2", "0.08%", "130.00", "100.00", "30.00"]
    assert answer.split()[-2:] == ["4.50", "4.04"]  # 135 bits block, 55, 1 ms, 55 of the next request, 135
    assert other.split()[-2:] == ["1", "0.04%"]
    assert load.startswith("load of 125 kbit/s: a 0.08%, b ")


def test_of_two_senders_of_one_identifier_the_one_that_may_be_later_counts() -> None:
    later = PROMISED.messages[1]._replace(name="Answer too", node="c", jitter=5_000)
    seen = SeenTraffic(RATE, PROMISED._replace(messages=(*PROMISED.messages, later)))
    seen.take(1.0, ANSWER, "", "")
    assert seen.messages[0x011, False].node == "c"


def test_a_time_before_the_last_one_is_not_a_gap() -> None:
    seen = SeenTraffic(RATE)
    for time in (2.0, 1.0, 1.1, 0.5):
        seen.take(time, ASK, "Ask", "a")
    ask = seen.messages[0x010, False]
    assert (ask.backwards, ask.count) == (2, 4)
    assert ask.longest == pytest.approx(0.1)
    assert "time runs backwards: 2 frames with a time before the last one's; not in the gaps" in table(seen)
    assert 0 < seen.load(ask.bits) < 1
