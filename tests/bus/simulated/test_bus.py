"""The bus bit by bit: what errors lead to, who counts what, and that frames without errors need no playing out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.bus.simulated.access import MediumAccess
from eurobot_od.bus.simulated.bit_errors import LAST_BUT_ONE, Attempt, BitErrors, Noise, Strike
from eurobot_od.bus.simulated.bits import frame_bits, on_wire
from eurobot_od.bus.simulated.bus import Bus, Play, undisturbed
from eurobot_od.bus.simulated.confinement import FRESH, Counters, ErrorState
from eurobot_od.bus.simulated.controller import Controller
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame

BITRATE = 1_000_000
FRAME, URGENT, LATER = Frame(0x555, b"\x55\x0f"), Frame(0x123, b"\x01"), Frame(0x6AB, b"\x02")
END = on_wire(FRAME).end


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

    def __init__(self, count: int = 3, *bit_errors: BitErrors) -> None:
        self.bit_errors = list(bit_errors)
        self.bus = Bus(BITRATE, self.bit_errors, self._ended, self._changed)
        self.sources = [Frames() for _ in range(count)]
        self.bus.controllers += [Controller(source) for source in self.sources]
        self.frames: list[Ended] = []
        self.states: list[tuple[int, str, ErrorState]] = []
        self.now = 0.0

    @property
    def bit(self) -> int:
        return round(self.now * BITRATE)

    def _names(self, controllers: Sequence[Controller]) -> str:
        return "".join("ABCDEF"[self.bus.controllers.index(each)] for each in controllers)

    def _ended(self, frame: Frame, senders: Sequence[Controller], receivers: Sequence[Controller]) -> None:
        for each in senders:
            each.source.complete(frame)
        self.frames.append(Ended(self.bit, frame, self._names(senders), self._names(receivers)))

    def _changed(self, controller: Controller, _: ErrorState, state: ErrorState) -> None:
        self.states.append((self.bit, self._names([controller]), state))

    def controller(self, name: str) -> Controller:
        return self.bus.controllers["ABCDEF".index(name)]

    def say(self, name: str, *frames: Frame) -> None:
        self.sources["ABCDEF".index(name)].waiting += frames

    def run(self, bits: int = 2000) -> Scene:
        """Run for so many bits."""
        until = (self.bit + bits) / BITRATE
        self.bus.arbitrate(self.now)
        while self.bus.next_event <= until:
            self.now = self.bus.next_event
            self.bus.advance(self.now)
            self.bus.arbitrate(self.now)
        self.now = until
        return self

    @property
    def counters(self) -> list[tuple[int, int]]:
        return [(each.counters.transmit, each.counters.receive) for each in self.bus.controllers]


# Without errors

offers = st.dictionaries(st.integers(0, 5), st.sampled_from([FRAME, URGENT, LATER]), min_size=1, max_size=5)
all_counters = st.lists(
    st.builds(Counters, st.integers(0, 255), st.sampled_from([0, 1, 127, 128, 200])), min_size=6, max_size=6
)


@given(offers, all_counters)
def test_a_frame_without_errors_ends_as_if_its_bits_were_played_out(
    chosen: dict[int, Frame], counters: list[Counters]
) -> None:
    here = [Controller(Frames(), counters=each) for each in counters]
    sending = {here[place]: frame for place, frame in sorted(chosen.items())}
    short = undisturbed(min(sending.values()), sending, here)
    assert short is not None
    parts = [MediumAccess(each, each.counters, sending.get(each)) for each in here]
    long = Play(parts).run().course
    assert long.bits == short.bits
    assert [each for each in long.moments if each.frame] == [each._replace(counts=()) for each in short.moments]
    assert list(long.suspended) == list(short.suspended)
    counted = {each: each.counters for each in here}
    for each, rule in (count for moment in short.moments for count in moment.counts):
        counted[each] = counted[each].after(rule)
    assert {part.controller: part.counters for part in parts} == counted


def test_who_is_bus_off_sees_one_sequence_of_recessive_bits_with_each_frame() -> None:
    here = [Controller(Frames(), counters=FRESH) for _ in range(2)]
    off = Controller(Frames(), counters=Counters(256, 0), recovery=128)
    short = undisturbed(FRAME, {here[0]: FRAME}, [*here, off])
    assert short is not None
    parts = [MediumAccess(each, each.counters, FRAME if each is here[0] else None) for each in (*here, off)]
    assert list(Play(parts).run().course.sequences) == list(short.sequences) == [(off, 1)]


def test_the_next_arbitration_is_after_the_intermission() -> None:
    scene = Scene()
    scene.say("A", FRAME)
    scene.say("B", LATER)
    scene.run()
    assert [each.bit for each in scene.frames] == [END, frame_bits(FRAME) + on_wire(LATER).end]


# One error. Counters are those after the frame has come through

DATA = 30
"""A bit in the data of FRAME."""


class OneError(NamedTuple):
    """A bit that is seen the other way round, by everyone or by one controller."""

    bit: int
    at: str | None = None

    def scene(self) -> Scene:
        """Have it strike the first frame."""
        scene = Scene()
        scene.bit_errors.append(Strike(self.bit, at=scene.controller(self.at) if self.at else None))
        scene.say("A", FRAME)
        return scene


ONE_ERROR = {
    # Who sees which bit flipped; who has the frame how often; (transmit, receive) of A, who sends, B and C
    "in the data, for all": (OneError(DATA), "BC", [(7, 0), (0, 0), (0, 0)]),
    "in the data, for the sender: its flag is an error to all": (OneError(DATA, "A"), "BC", [(7, 0), (0, 0), (0, 0)]),
    "in the data, for one receiver: it flags first": (OneError(DATA, "B"), "BC", [(7, 0), (0, 8), (0, 0)]),
    "the CRC delimiter, for one receiver": (OneError(END - 10, "B"), "BC", [(7, 0), (0, 8), (0, 0)]),
    "the acknowledge slot, for the sender: nobody is there": (OneError(END - 9, "A"), "BC", [(7, 0), (0, 0), (0, 0)]),
    "the first bit of the end, for one receiver": (OneError(-7, "B"), "BC", [(7, 0), (0, 8), (0, 0)]),
    "the last bit but one, for all: nobody has it yet": (OneError(LAST_BUT_ONE), "BC", [(7, 0), (0, 0), (0, 0)]),
    "the last bit but one, for one receiver: the others have the frame twice": (
        OneError(LAST_BUT_ONE, "B"), "CBC", [(7, 0), (0, 8), (0, 0)],
    ),
    "the last bit, for all: all have the frame twice": (OneError(-1), "BCBC", [(7, 0), (0, 0), (0, 0)]),
    "the last bit, for the sender: all have the frame twice": (OneError(-1, "A"), "BCBC", [(7, 0), (0, 0), (0, 0)]),
    "the last bit, for one receiver: it asks for time, no more": (OneError(-1, "B"), "BC", [(0, 0), (0, 0), (0, 0)]),
}  # fmt: skip


@pytest.mark.parametrize(("error", "received", "counters"), ONE_ERROR.values(), ids=ONE_ERROR)
def test_one_error(error: OneError, received: str, counters: list[tuple[int, int]]) -> None:
    scene = error.scene().run()
    assert "".join(each.receivers for each in scene.frames) == received
    assert "".join(each.senders for each in scene.frames) == "A"
    assert scene.counters == counters


FLAG, DELIMITER, INTERMISSION = 6, 8, 3

ERROR_FRAMES = {
    # Where the error is; how many bits are dominant, from the bit behind it; why
    "all see it": (OneError(END - 3), FLAG, "all flags begin together"),
    "one receiver sees it, the others its flag": (OneError(END - 7, "B"), FLAG + 1, "the end has to be recessive"),
}


@pytest.mark.parametrize(("error", "dominant", "_why"), ERROR_FRAMES.values(), ids=ERROR_FRAMES)
def test_how_long_an_error_frame_is(error: OneError, dominant: int, _why: str) -> None:
    scene = error.scene().run()
    free = error.bit + 1 + dominant + DELIMITER + INTERMISSION
    assert scene.frames[-1].bit == free + END


def test_flags_of_who_sees_an_error_first_and_last_take_12_bits() -> None:
    zeros = Frame(0x555, bytes(8))
    place = max(place for place in on_wire(zeros).stuffed if place < 80)
    scene = Scene()
    scene.bit_errors.append(Strike(place, at=scene.controller("B")))  # it sees a sixth dominant bit
    scene.say("A", zeros)
    scene.run()
    assert scene.frames[-1].bit == place + 1 + 2 * FLAG + DELIMITER + INTERMISSION + on_wire(zeros).end


def test_two_errors_in_one_bit_undo_each_other() -> None:
    scene = OneError(END - 3, "B").scene()
    scene.bit_errors.append(Strike(END - 3))
    scene.run()
    # B sees the flags of the others only, and its own flag ends behind that of C.
    assert scene.counters == [(7, 0), (0, 0), (0, 8)]


def test_an_error_in_the_delimiter_of_an_error_frame_is_one_more_error() -> None:
    scene = OneError(END - 3).scene()
    scene.bit_errors.append(Strike(END - 2 + FLAG + 2))
    scene.run()
    assert scene.counters == [(15, 0), (0, 1), (0, 1)]
    assert len(scene.frames) == 1


def test_a_dominant_bit_in_the_intermission_is_an_overload_frame_which_nobody_counts() -> None:
    scene = Scene(3, Strike(END))
    scene.say("A", FRAME, LATER)
    scene.run()
    free = END + 1 + FLAG + DELIMITER + INTERMISSION
    assert [each.bit for each in scene.frames] == [END, free + on_wire(LATER).end]
    assert scene.counters == [(0, 0)] * 3


def test_a_dominant_third_bit_of_the_intermission_is_a_start_of_frame_that_leads_to_an_error() -> None:
    scene = Scene(3, Strike(END + 2))
    scene.say("A", FRAME, LATER)
    scene.run()
    assert len(scene.frames) == 2
    assert scene.counters == [(0, 1), (0, 0), (0, 0)]  # one each, and B and C have received a frame since then


def test_who_has_missed_the_start_of_frame_comes_in_later() -> None:
    scene = OneError(0, "B").scene().run()
    assert scene.frames[-1].receivers == "BC"
    assert scene.controller("B").counters.receive > 0


def test_who_sees_a_lower_identifier_that_is_not_there_takes_itself_for_a_receiver() -> None:
    scene = OneError(1, "A").scene().run()  # its first identifier bit is recessive
    assert "".join(each.receivers for each in scene.frames) == "BC"
    assert scene.controller("A").counters.transmit == 0


# Different data under one identifier

ONE, OTHER = Frame(0x555, b"\x01"), Frame(0x555, b"\x02")


def test_different_data_under_one_identifier_is_a_bit_error_again_and_again() -> None:
    scene = Scene()
    scene.say("A", OTHER)
    scene.say("B", ONE)
    scene.run(20_000)
    assert [(each.frame, each.senders) for each in scene.frames] == [(ONE, "B"), (OTHER, "A")]
    assert {name for _, name, state in scene.states if state is ErrorState.PASSIVE} == {"A", "B"}


# Nobody acknowledges


def test_a_lone_node_becomes_error_passive_and_no_more() -> None:
    scene = Scene(1)
    scene.say("A", FRAME)
    scene.run(100_000)
    assert scene.counters == [(128, 0)]
    assert [(name, state) for _, name, state in scene.states] == [("A", ErrorState.PASSIVE)]
    assert scene.frames == []


def test_a_lone_node_is_heard_as_soon_as_somebody_is_there() -> None:
    scene = Scene(2)
    scene.controller("B").silent_until = 50_000 / BITRATE
    scene.say("A", FRAME)
    scene.run(51_000)
    assert [(each.frame, each.receivers) for each in scene.frames] == [(FRAME, "B")]
    assert 50_000 < scene.frames[0].bit < 50_300
    assert scene.counters == [(127, 0), (0, 0)]
    assert scene.controller("A").state is ErrorState.ACTIVE


def test_equal_frames_of_all_who_are_there_are_acknowledged_by_nobody() -> None:
    scene = Scene(2)
    scene.say("A", FRAME)
    scene.say("B", FRAME)
    assert scene.run().frames == []


# Error passive


def passive(scene: Scene, name: str) -> Controller:
    controller = scene.controller(name)
    controller.counters = Counters(*(200, 0) if name == "A" else (0, 200))
    return controller


def test_the_flag_of_an_error_passive_receiver_disturbs_nobody() -> None:
    scene = OneError(DATA, "B").scene()
    passive(scene, "B")
    scene.run()
    assert [(each.bit, each.receivers) for each in scene.frames] == [(END, "C")]
    assert scene.counters == [(0, 0), (0, 201), (0, 0)]


def test_a_frame_received_makes_an_error_passive_receiver_active() -> None:
    scene = Scene()
    passive(scene, "B")
    scene.say("A", FRAME)
    scene.run()
    assert scene.counters[1] == (0, 127)
    assert scene.states == [(END, "B", ErrorState.ACTIVE)]


def test_an_error_passive_sender_lets_others_go_first() -> None:
    scene = Scene()
    passive(scene, "A")
    scene.say("A", URGENT, URGENT)
    scene.say("B", LATER)
    scene.run()
    assert [each.senders for each in scene.frames] == ["A", "B", "A"]


def test_an_error_passive_sender_waits_for_8_bits_if_nobody_else_sends() -> None:
    scene = Scene()
    passive(scene, "A")
    scene.say("A", FRAME, FRAME)
    scene.run()
    assert [each.bit for each in scene.frames] == [END, frame_bits(FRAME) + 8 + END]


def test_the_error_of_an_error_passive_sender_is_seen_by_the_receivers_as_its_frame_breaks_off() -> None:
    scene = OneError(DATA, "A").scene()
    passive(scene, "A")
    scene.run()
    assert [each.receivers for each in scene.frames] == ["BC"]
    assert scene.counters == [(207, 0), (0, 0), (0, 0)]


# Bus-off


def going_off() -> Scene:
    """Have A see an error in each of its frames, until it is off after 32 of them."""
    scene = Scene()
    scene.bit_errors.append(
        Strike(DATA, lambda attempt: scene.controller("A") in attempt.senders, scene.controller("A"), times=32)
    )
    scene.say("A", FRAME)
    return scene


def test_a_sender_whose_frames_all_fail_goes_off_and_comes_back_after_128_sequences_of_11_recessive_bits() -> None:
    scene = going_off().run(10_000)
    (passive_at, *_), (off_at, *_), (back_at, *_) = scene.states
    assert [state for *_, state in scene.states] == [ErrorState.PASSIVE, ErrorState.OFF, ErrorState.ACTIVE]
    assert passive_at < off_at < back_at
    flags = FLAG + FLAG + DELIMITER + INTERMISSION  # of the receivers, after the frame has broken off
    assert 128 * 11 <= back_at - off_at <= 128 * 11 + flags
    assert scene.frames[-1].bit == back_at + END
    assert scene.counters[0] == (0, 0)


def test_who_is_off_counts_sequences_between_the_frames_of_others() -> None:
    scene = going_off()
    while scene.controller("A").state is not ErrorState.OFF:
        scene.run(10)
    scene.say("B", *[LATER] * 200)
    scene.run(20_000)
    ended = [each for each in scene.frames if each.frame == LATER]
    off_at, back_at = (bit for bit, name, _ in scene.states[1:] if name == "A")
    assert back_at > off_at + 128 * 11
    assert 120 <= sum(off_at < each.bit < back_at for each in ended) <= 128
    assert [each.senders for each in scene.frames].count("A") == 1


def test_who_is_off_neither_acknowledges_nor_receives() -> None:
    scene = Scene(2)
    off = scene.controller("B")
    off.counters, off.recovery = Counters(256, 0), 128
    scene.say("A", FRAME)
    scene.run(500)
    assert scene.frames == []


def test_who_is_off_goes_on_counting_when_the_idle_bus_is_dropped() -> None:
    scene = going_off()
    while scene.controller("A").state is not ErrorState.OFF:
        scene.run(10)
    for _ in range(20):
        scene.run(100)
        scene.bus.drop(scene.now)
    assert scene.controller("A").state is ErrorState.ACTIVE


def test_a_receiver_never_goes_off() -> None:
    scene = Scene(
        3,
    )
    scene.bit_errors.append(Noise(0.02, at=scene.controller("B")))
    scene.say("A", *[FRAME] * 500)
    scene.run(200_000)
    assert scene.controller("B").state is not ErrorState.OFF
    assert scene.controller("B").counters.transmit == 0


# Noise


def test_noise_is_the_same_for_the_same_seed_and_another_for_another() -> None:
    def flips(seed: int) -> list[int]:
        noise = Noise(1e-3, seed)
        attempt = Attempt(0.0, FRAME, END, ())
        return [flip.bit for _ in range(50) for flip, _ in zip(noise(attempt), range(20))]

    assert flips(1) == flips(1)
    assert flips(1) != flips(2)


@pytest.mark.parametrize("rate", [1e-3, 1e-2, 0.1])
def test_noise_has_its_rate(rate: float) -> None:
    flips = Noise(rate)(Attempt(0.0, FRAME, END, ()))
    count = 5000
    last = [flip.bit for flip, _ in zip(flips, range(count))][-1]
    assert count / (last + 1) == pytest.approx(rate, rel=0.05)


def test_noise_of_rate_0_is_none() -> None:
    assert list(Noise(0.0)(Attempt(0.0, FRAME, END, ()))) == []


@pytest.mark.parametrize("rate", [-0.1, 0.6, 1.0])
def test_a_rate_that_is_none_is_refused(rate: float) -> None:
    with pytest.raises(LocalError, match="bit error rate"):
        Noise(rate)


@given(st.integers(0, 1000), st.sampled_from([1e-3, 3e-3, 1e-2]))
def test_nothing_is_lost_however_much_noise_there_is(seed: int, rate: float) -> None:
    scene = Scene(3, Noise(rate, seed))
    scene.say("A", *[FRAME] * 5)
    scene.say("B", *[LATER] * 5)
    for _ in range(50):
        scene.run(2000)
    assert not any(source.waiting for source in scene.sources)
    for frame in (FRAME, LATER):
        assert sum("C" in each.receivers for each in scene.frames if each.frame == frame) >= 5


@pytest.mark.parametrize(
    ("strike", "struck"),
    [
        (Strike(DATA), [0]),
        (Strike(DATA, skip=2), [2]),
        (Strike(DATA, skip=1, times=2), [1, 2]),
        (Strike(DATA, lambda attempt: attempt.frame == LATER), []),
    ],
)
def test_which_attempts_are_struck(strike: Strike, struck: list[int]) -> None:
    attempt = Attempt(0.0, FRAME, END, ())
    assert [number for number in range(5) if list(strike(attempt))] == struck
