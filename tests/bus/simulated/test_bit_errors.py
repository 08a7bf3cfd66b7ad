"""Which bits of which frames are struck, and how often by chance."""

from __future__ import annotations

from itertools import islice, takewhile

import pytest

from eurobot_od.bus.simulated.bit_errors import Attempt, Flip, Noise, Strike
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame

GOTO, STOP = Frame(0x008, b"\1"), Frame(0x004)


def attempt(frame: Frame = GOTO, bits: int = 100) -> Attempt:
    return Attempt(0.0, frame, bits, ())


@pytest.mark.parametrize(("bit", "struck"), [(0, 0), (30, 30), (99, 99), (-1, 99), (-2, 98), (-100, 0)])
def test_a_bit_is_counted_from_the_start_or_from_the_end(bit: int, struck: int) -> None:
    assert list(Strike(bit)(attempt())) == [Flip(struck)]


def test_the_first_frames_are_left_out_and_so_many_struck_then() -> None:
    strike = Strike(5, skip=2, times=3)
    assert [len(list(strike(attempt()))) for _ in range(7)] == [0, 0, 1, 1, 1, 0, 0]


def test_one_frame_is_struck_if_nothing_else_is_said() -> None:
    strike = Strike(5)
    assert [len(list(strike(attempt()))) for _ in range(3)] == [1, 0, 0]


def test_frames_that_are_not_chosen_are_not_counted() -> None:
    strike = Strike(5, lambda each: each.frame == STOP, skip=1)
    assert [len(list(strike(attempt(frame)))) for frame in (GOTO, STOP, GOTO, STOP, STOP)] == [0, 0, 0, 1, 0]


@pytest.mark.parametrize("rate", [-0.001, 0.501, 1.0])
def test_a_rate_is_a_probability_up_to_a_half(rate: float) -> None:
    with pytest.raises(LocalError, match=rf"^a bit error rate is a probability from 0 to 0\.5, not {rate}$"):
        Noise(rate)


def test_without_a_rate_there_is_no_error() -> None:
    assert list(Noise(0.0)(attempt())) == []


@pytest.mark.long
@pytest.mark.parametrize("rate", [0.001, 0.1, 0.5])
def test_of_many_bits_the_rate_is_struck(rate: float) -> None:
    bits = 1_000_000
    struck = [flip.bit for flip in takewhile(lambda flip: flip.bit < bits, Noise(rate)(attempt(bits=bits)))]
    assert struck == sorted(set(struck))
    assert len(struck) == pytest.approx(rate * bits, rel=0.1)
    assert 0 in {next(iter(Noise(rate, seed)(attempt()))).bit for seed in range(20_000)}, "the first bit, too"


def test_a_seed_gives_its_errors_again() -> None:
    assert [*islice(Noise(0.01, 7)(attempt()), 5)] == [*islice(Noise(0.01, 7)(attempt()), 5)]
    assert [*islice(Noise(0.01, 7)(attempt()), 5)] != [*islice(Noise(0.01, 8)(attempt()), 5)]
