"""Waveforms: what a simulated device measures, as functions of time; and the YAML file that describes them.

A waveform is a function of the seconds since the device was switched on or reset, so that simulated and real time give
the same values.

    Temperature: 21.5                                                   # one that does not change
    Motor.Speed: {sine: {low: 0, high: 3000, period: 2 s}}              # objects by name, or by number
    "0x6000:1": {square: {low: 0, high: 1, period: 500 ms}}
    Position: {ramp: {low: 0, high: 100, period: 10 s}}                 # from low to high, again and again
    State: {steps: {values: [0, 3, 7], every: 1 s}}                     # again and again
    Noise: {walk: {start: 20, step: 0.5, every: 100 ms, seed: 7, low: 10, high: 30}}    # low, high: no limits without
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite, nan, pi, sin
from random import Random
from typing import Annotated, TypeAlias

import yaml

from eurobot_od.errors import LocalError
from eurobot_od.od.values import DataType, Value, parse_number
from eurobot_od.support.yaml_places import Problems, compose, refuse, refuse_aliases, telling
from eurobot_od.support.yaml_shapes import (
    DURATION,
    SCALAR,
    Shape,
    converted,
    filled,
    longer_than_0,
    mapping,
    pairs_of,
    shape_of,
)

Waveform: TypeAlias = Callable[[float], float]
"""Gives the value at a time in seconds."""

Period: TypeAlias = Annotated[float, DURATION, longer_than_0]
"""In seconds; in the file a duration with its unit."""


def constant(value: float) -> Waveform:
    """A waveform that does not change."""
    return lambda _: value


def ramp(low: float, high: float, period: Period) -> Waveform:
    """Rises from `low` to `high` in each period, in seconds, and drops back to `low` at once."""
    return lambda time: low + (high - low) * (time / period % 1)


def sine(low: float, high: float, period: Period) -> Waveform:
    """Swings between `low` and `high`, starting upwards from the middle."""
    return lambda time: (low + high) / 2 + (high - low) / 2 * sin(2 * pi * time / period)


def square(low: float, high: float, period: Period) -> Waveform:
    """`low` for the first half of each period, `high` for the second."""
    return lambda time: low if time / period % 1 < 0.5 else high


def steps(values: Annotated[Sequence[float], filled], every: Period) -> Waveform:
    """One value after the other, each for `every` seconds, then from the beginning."""
    return lambda time: values[int(time / every) % len(values)]


def walk(start: float, step: float, every: Period, seed: int = 1, low: float = -inf, high: float = inf) -> Waveform:
    """A random walk within limits: up to `step` up or down `every` so many seconds, the same for the same seed."""
    chance, steps_done, place = Random(seed), 0, start

    def at(time: float) -> float:
        nonlocal chance, steps_done, place
        if time < steps_done * every:  # the time has started over
            chance, steps_done, place = Random(seed), 0, start
        # Every step, however seldom anybody looks: the same seed must give the same walk at any sampling rate.
        for _ in range(int(time / every) - steps_done):
            place = min(max(place + chance.uniform(-step, step), low), high)
            steps_done += 1
        return place

    return at


def fitted(value: float, type_: DataType) -> Value:
    """Return what an object of a type holds of a value: an integer is rounded, and kept within the type's range."""
    if not type_.is_integer:
        return value
    # A user's function may return infinity or NaN, for which round() raises.
    return min(max(round(value), type_.low), type_.high) if isfinite(value) else type_.low


# The file


def _number(text: str) -> float:
    whole = parse_number(text)
    try:
        number = whole.value if whole and not whole.relative else float(text)
    except ValueError:
        number = nan
    if not isfinite(number):  # float() accepts `nan` and `inf` as well
        raise LocalError(f"expected a number, found {str(text)!r}")
    return number


NUMBER: Shape[float] = converted(SCALAR, _number)
WAVEFORMS: Mapping[str, Shape[Waveform]] = {
    each.__name__: shape_of(each, {float: NUMBER, int: NUMBER}) for each in (ramp, sine, square, steps, walk)
}
"""The reader of each waveform, by its name in the file."""


def _waveform(node: yaml.Node, problems: Problems) -> Waveform:
    if isinstance(node, yaml.ScalarNode):
        return constant(NUMBER.read(node, problems))
    pairs = pairs_of(node, problems)
    if len(pairs) != 1 or not pairs.keys() <= WAVEFORMS.keys():
        refuse(node, problems, f"expected a number or one of {', '.join(WAVEFORMS)}, found {', '.join(pairs)}")
    ((name, shape),) = pairs.items()
    return WAVEFORMS[name].read(shape, problems)


def read_waveforms(text: str, file: str) -> Mapping[str, Waveform]:
    """Read the waveforms of a YAML text by the names of their objects; `file` is its name in errors.

    Raises YamlError.
    """
    with telling(file) as problems:
        root = compose(text, problems)
        refuse_aliases(root, problems)
        return {str(name): each for name, each in mapping(Shape(_waveform, {}), SCALAR).read(root, problems).items()}
