"""A node that shows trouble is asked what it says of itself: one object at a time, and never beside another client."""

from __future__ import annotations

from collections.abc import Mapping

from eurobot_od.frame import Frame
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.diagnosis.incidents import Incident
from eurobot_od.traffic.diagnosis.questions import AGAIN, ANSWER_WAIT, GIVEN_UP, Questions
from eurobot_od.traffic.diagnosis.rules import BusRule
from eurobot_od.traffic.meaning import Decoder

ABSENT = bytes.fromhex("00000206")

DRIVE = {
    (0x1001, 0): b"\x21", (0x1003, 0): b"\1", (0x1003, 1): bytes.fromhex("20320000"),
    **{(0x1018, sub): bytes([sub, 0, 0, 0]) for sub in range(1, 5)},
    (0x1000, 0): bytes.fromhex("92010200"),
    (0x1016, 0): b"\1", (0x1016, 1): bytes.fromhex("C8000700"), (0x1017, 0): b"\xf4\1",
    (0x6041, 0): b"\x18\2", (0x603F, 0): b"\x20\x32",
}  # fmt: skip
"""What a drive in Fault has."""

SAID = [
    "0x1001:0 error register 0x21 (generic error, device profile)",
    "0x1003:0 1 remembered error",
    "0x1003:1 0x3220 voltage inside the device",  # it has not said that it is a drive by then
    "0x1018:1 vendor-ID 0x00000001",
    "0x1018:2 product code 0x00000002",
    "0x1018:3 revision number 0x00000003",
    "0x1018:4 serial number 0x00000004",
    "0x1000:0 device type 0x00020192, profile 402",
    "0x1016:0 1 entry of consumers",
    "0x1016:1 waits 200 ms for node-ID 7",
    "0x1017:0 heartbeat time 500 ms",
    "0x6041:0 Statusword 536 (Fault)",
    "0x603F:0 Error code 12832 (0x3220 DC link undervoltage)",
]

OF_DRIVE = {BusRule.DRIVE_FAULT, BusRule.CONSUMER_UNFED}
"""What its answers show."""


class AskedBus:
    """A bus in steps of 20 ms, with a node that has some objects, a diagnosis, and its questions."""

    def __init__(self, objects: Mapping[tuple[int, int], bytes] = DRIVE) -> None:
        self.diagnosis, self.time, self.sent, self.answers = Diagnosis(Decoder([])), 0.0, list[Frame](), True
        self._objects = objects
        self.take(Frame(0x085, bytes.fromhex("2032210000000000")))
        questions = self.diagnosis.questions("")
        assert questions
        self.questions: Questions = questions

    def take(self, frame: Frame) -> None:
        """Take in a frame of the bus."""
        meaning = self.diagnosis.take(self.time, "", frame)
        if hasattr(self, "questions"):
            self.questions.take(self.time, meaning)

    def answer(self, request: Frame) -> None:
        """Answer as the node does."""
        address, data = request.data[1:4], request.data
        if data[0] == 0x40:
            content = self._objects.get((address[0] | address[1] << 8, address[2]))
            head = b"\x80" if content is None else bytes([0x43 | 4 - len(content) << 2])
            self.take(Frame(request.cob_id - 0x80, head + address + (content or ABSENT).ljust(4, b"\0")))

    def step(self, seconds: float = 0.02) -> None:
        """Advance the time, and process incidents as the command does."""
        for _ in range(round(seconds / 0.02)):
            self.time += 0.02
            self.diagnosis.tick(self.time)
            self.questions.look(self.time, self.diagnosis.so_far(self.time))
            for frame in self.questions.due(self.time):
                self.sent.append(frame)
                self.take(frame)
                if self.answers:
                    self.answer(frame)

    def found(self) -> list[Incident]:
        self.diagnosis.end(self.time)
        return list(self.questions.answered(self.diagnosis.incidents.sorted()))

    @property
    def said(self) -> tuple[str, ...]:
        return next(each.asked for each in self.found() if each.asked)


def test_a_node_in_trouble_is_asked_for_all_that_says_why() -> None:
    bus = AskedBus()
    bus.step(1.0)
    assert list(bus.said) == SAID
    assert {each.rule for each in bus.found()} == OF_DRIVE
    assert not bus.questions.is_busy


def test_a_refused_question_is_reported_without_an_incident() -> None:
    bus = AskedBus({(0x1001, 0): b"\x21"})
    bus.step(1.0)
    refusal = "the node aborts: Object does not exist (0x06020000)"
    assert f"0x1003:0 {refusal}" in bus.said
    assert len(bus.said) == 9  # no drive, and no entries
    assert [each.rule for each in bus.found()] == [BusRule.EMCY_RAISED]


def test_a_node_that_does_not_answer_is_asked_once() -> None:
    bus = AskedBus()
    bus.answers = False
    bus.step(3.0)
    assert bus.said == ("0x1001:0 no answer in its time",)
    assert [each.data[0] for each in bus.sent] == [0x40, 0x80]
    assert [each.rule for each in bus.found()] == [BusRule.EMCY_RAISED]


def test_a_node_without_trouble_is_not_asked() -> None:
    bus = AskedBus()
    bus.take(Frame(0x706, b"\5"))
    bus.step(1.0)
    assert {each.cob_id for each in bus.sent} == {0x605}


def test_questions_are_asked_one_at_a_time() -> None:
    bus = AskedBus()
    bus.take(Frame(0x086, bytes.fromhex("2032210000000000")))
    bus.answers = False
    bus.step(ANSWER_WAIT - 0.1)
    assert len(bus.sent) == 1


READ = Frame(0x606, bytes.fromhex("4008100000000000"))
SEGMENTED = Frame(0x586, bytes.fromhex("410810000E000000"))
ENDS = [
    Frame(0x606, bytes.fromhex("6000000000000000")), Frame(0x586, bytes.fromhex("0061626364656667")),
    Frame(0x606, bytes.fromhex("7000000000000000")), Frame(0x586, bytes.fromhex("1161626364656667")),
]  # fmt: skip


def test_questions_wait_for_transfers_of_other_clients() -> None:
    bus = AskedBus()
    for frame in (READ, SEGMENTED):
        bus.take(frame)
        bus.step(0.5)
    assert bus.sent == []
    for frame in ENDS:
        bus.take(frame)
    bus.step(1.0)
    assert list(bus.said) == SAID


def test_a_transfer_that_its_client_has_left_is_not_waited_for() -> None:
    bus = AskedBus()
    bus.take(READ)
    bus.step(GIVEN_UP + 0.1)
    assert bus.sent != []


def test_a_question_into_which_another_client_talks_is_asked_again_later() -> None:
    bus = AskedBus()
    bus.answers = False
    bus.step()
    (asked,) = bus.sent
    other = Frame(0x605, bytes.fromhex("4017100000000000"))
    bus.take(other)
    bus.answers = True
    bus.answer(asked)
    bus.answer(other)
    bus.step(3.0)
    assert bus.sent[1] == asked
    assert list(bus.said) == SAID
    assert {each.rule for each in bus.found()} == OF_DRIVE


def test_a_node_with_trouble_of_another_kind_is_asked_again_after_a_while() -> None:
    bus = AskedBus()
    for _ in range(10):
        bus.take(Frame(0x705, b"\5"))
        bus.step(0.1)
    first = len(bus.sent)
    bus.step(AGAIN)
    assert len(bus.sent) == first
    bus.take(Frame(0x705, b"\0"))
    bus.step(1.0)
    assert len(bus.sent) == 2 * first
