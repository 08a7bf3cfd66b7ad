"""Waveforms: their values at times, and the file that says them."""

from __future__ import annotations

from itertools import pairwise

import pytest

from eurobot_od.device.waveforms import Waveform, constant, fitted, ramp, read_waveforms, sine, square, steps, walk
from eurobot_od.errors import YamlError
from eurobot_od.od.values import REAL32, UNSIGNED8
from tests.rows import rows

SHAPES = [
    (constant(7), [7, 7, 7, 7, 7]),
    (ramp(0, 8, 2.0), [0, 2, 4, 6, 0]),
    (square(-1, 1, 2.0), [-1, -1, 1, 1, -1]),
    (steps([5, 6, 7], 0.5), [5, 6, 7, 5, 6]),
    (sine(0, 10, 2.0), [5, 10, 5, 0, 5]),
]


@pytest.mark.parametrize(("waveform", "values"), SHAPES)
def test_the_values_of_a_waveform_every_half_second(waveform: Waveform, values: list[float]) -> None:
    assert [waveform(n / 2) for n in range(5)] == pytest.approx(values)


def test_a_walk_is_the_same_for_the_same_seed_also_begun_anew() -> None:
    times = [n / 10 for n in range(100)]
    one, other = walk(0, 1, 0.1, seed=3), walk(0, 1, 0.1, seed=3)
    first = list(map(one, times))
    assert first == list(map(other, times)) == list(map(one, times))
    assert first != list(map(walk(0, 1, 0.1, seed=4), times))


def test_a_walk_stays_inside_and_goes_in_small_steps() -> None:
    places = list(map(walk(5, 1, 1.0, low=4, high=6), range(1000)))
    assert (min(places), max(places)) == (4, 6)
    assert max(abs(after - before) for before, after in pairwise(places)) <= 1


FITTED = [(1.4, UNSIGNED8, 1), (-3.0, UNSIGNED8, 0), (1e9, UNSIGNED8, 255), (float("nan"), UNSIGNED8, 0)]


@pytest.mark.parametrize(("value", "type_", "expected"), [*FITTED, (1.4, REAL32, 1.4)])
def test_an_integer_is_rounded_and_ends_where_its_type_ends(value: float, type_: object, expected: float) -> None:
    assert fitted(value, type_) == expected  # type: ignore[arg-type]


def test_a_file_of_waveforms() -> None:
    text = """\
Temperature: 21.5
Motor.Speed: {sine: {low: 0, high: 3000, period: 2 s}}
0x6000:1: {square: {low: 0, high: 1, period: 500 ms}}
State: {steps: {values: [0, 0x10, -7], every: 1 s}}
Noise: {walk: {start: 20, step: 0.5, every: 100 ms, seed: 7, low: 10, high: 30}}
"""
    found = read_waveforms(text, "values.yaml")
    assert list(found) == ["Temperature", "Motor.Speed", "0x6000:1", "State", "Noise"]
    assert [each(1.5) for each in found.values()][:4] == pytest.approx([21.5, 0, 0, 16])


WRONG = [
    ("", "1:1: the file is empty"),
    ("[1]", "1:1: expected a mapping, `key: value`, found a list"),
    ("A: x", "1:4: expected a number, found 'x'"),
    ("A: nan", "1:4: expected a number, found 'nan'"),
    ("A: 1\nA: 2", "2:1: key 'A' is given twice"),
    ("A: {saw: {}}", "1:4: expected a number or one of ramp, sine, square, steps, walk, found saw"),
    ("A: {ramp: {low: 0, high: 1}}", "1:11: key 'period' is missing"),
    ("A: {ramp: {low: 0, high: 1, period: 5}}", "1:37: '5' is not a duration"),
    ("A: {ramp: {low: 0, high: 1, period: 0 s}}", "1:37: this time has to be longer than 0"),
    ("A: {steps: {values: [], every: 1 s}}", "1:21: expected at least one entry"),
    ("A: &a {ramp: {low: 0, high: 1, period: 1 s}}\nB: *a", "1:4: an alias refers to this; write it out"),
]


@rows("text, complaint", WRONG)
def test_a_file_that_says_no_waveforms_is_refused_with_its_line(text: str, complaint: str) -> None:
    with pytest.raises(YamlError) as refusal:
        read_waveforms(text, "values.yaml")
    assert str(refusal.value).startswith(f"values.yaml:{complaint}")
