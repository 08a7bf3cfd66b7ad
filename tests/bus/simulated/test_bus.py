"""The simulated bus alone: who wins, how long a frame takes, who hears it, and what nobody acknowledges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.bus.bits import INTERMISSION, frame_bits
from eurobot_od.bus.simulated.bus import Bus, Controller
from eurobot_od.frame import Frame

BITRATE = 1_000_000
FRAME, URGENT, LATER = Frame(0x555, b"\x55\x0f"), Frame(0x123, b"\x01"), Frame(0x6AB, b"\x02")
END = frame_bits(FRAME) - INTERMISSION


class Frames:
    """Frames in the order in which they are to be sent."""

    def __init__(self) -> None:
        self.waiting: list[Frame] = []

    def urgent(self) -> Frame | None:
        return self.waiting[0] if self.waiting else None

    def complete(self, frame: Frame) -> None:
        self.waiting.remove(frame)


class Ended(NamedTuple):
    """A frame that has ended after so many bits since the beginning, who has sent it and who has it."""

    bit: int
    frame: Frame
    senders: str
    receivers: str


class Scene:
    """Controllers A, B, ... on one bus, and what has happened on it."""

    def __init__(self, count: int = 3) -> None:
        self.bus = Bus(BITRATE, self._ended)
        self.sources = [Frames() for _ in range(count)]
        self.bus.controllers += [Controller(source) for source in self.sources]
        self.frames: list[Ended] = []
        self.now = 0.0

    def _names(self, controllers: Sequence[Controller]) -> str:
        return "".join("ABCDEF"[self.bus.controllers.index(each)] for each in controllers)

    def _ended(self, frame: Frame, senders: Sequence[Controller], receivers: Sequence[Controller]) -> None:
        for each in senders:
            each.source.complete(frame)
        self.frames.append(Ended(round(self.now * BITRATE), frame, self._names(senders), self._names(receivers)))

    def say(self, name: str, *frames: Frame) -> None:
        self.sources["ABCDEF".index(name)].waiting += frames

    def run(self, bits: int = 2000) -> list[Ended]:
        """Run for so many bits; return all frames so far."""
        until = self.now + bits / BITRATE
        self.bus.arbitrate(self.now)
        while self.bus.next_event <= until:
            self.now = self.bus.next_event
            self.bus.advance(self.now)
            self.bus.arbitrate(self.now)
        self.now = until
        return self.frames


def test_the_lowest_identifier_wins_and_the_next_arbitration_is_after_the_intermission() -> None:
    scene = Scene()
    scene.say("A", LATER)
    scene.say("B", FRAME)
    assert scene.run() == [
        (END, FRAME, "B", "AC"),
        (frame_bits(FRAME) + frame_bits(LATER) - INTERMISSION, LATER, "A", "BC"),
    ]


def test_equal_frames_go_out_as_one() -> None:
    scene = Scene()
    scene.say("A", FRAME)
    scene.say("B", FRAME)
    assert scene.run() == [(END, FRAME, "AB", "C")]


def test_of_two_frames_with_one_identifier_the_lower_one_goes_first() -> None:
    scene, one, other = Scene(), Frame(0x555, b"\x01"), Frame(0x555, b"\x02")
    scene.say("A", other)
    scene.say("B", one)
    assert [(each.frame, each.senders) for each in scene.run()] == [(one, "B"), (other, "A")]


def test_a_lone_node_sends_again_and_again_and_is_heard_as_soon_as_somebody_is_there() -> None:
    scene = Scene(2)
    scene.bus.controllers[1].silent_until = 50_000 / BITRATE
    scene.say("A", FRAME)
    assert scene.run(50_000) == []
    ((bit, frame, _, receivers),) = scene.run(1000)
    assert (frame, receivers) == (FRAME, "B")
    assert 50_000 < bit <= 50_000 + 2 * frame_bits(FRAME)


def test_equal_frames_of_all_who_are_there_are_acknowledged_by_nobody() -> None:
    scene = Scene(2)
    scene.say("A", FRAME)
    scene.say("B", FRAME)
    assert scene.run() == []


def test_what_is_dropped_is_sent_again() -> None:
    scene = Scene()
    scene.say("A", FRAME)
    scene.run(30)
    scene.bus.drop()
    assert scene.run() == [(30 + END, FRAME, "A", "BC")]


@given(st.lists(st.lists(st.sampled_from([FRAME, URGENT, LATER]), max_size=5), min_size=2, max_size=5))
def test_every_frame_goes_out_once_and_takes_its_bits(said: list[list[Frame]]) -> None:
    scene = Scene(len(said) + 1)  # the last one only listens
    for source, frames in zip(scene.sources, said):
        source.waiting += frames
    ended = scene.run(20_000)
    assert not any(source.waiting for source in scene.sources)
    assert sum(len(each.senders) for each in ended) == sum(map(len, said))
    assert [each.bit for each in ended] == [
        sum(frame_bits(each.frame) for each in ended[: number + 1]) - INTERMISSION for number in range(len(ended))
    ]
