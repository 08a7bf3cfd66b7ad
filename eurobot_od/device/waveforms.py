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
from math import inf, isfinite, pi, sin
from random import Random
from typing import TypeAlias

import yaml

from eurobot_od.errors import LocalError
from eurobot_od.od.values import DataType, Value, parse_number
from eurobot_od.support import durations
from eurobot_od.support.yaml_places import (
    NodeReader,
    Problems,
    ReadError,
    listing,
    mapping,
    pairs_of,
    read_yaml,
    record,
    refuse,
    refuse_aliases,
    scalar,
)

Waveform: TypeAlias = Callable[[float], float]
"""Gives the value at a time in seconds."""


def constant(value: float) -> Waveform:
    """A waveform that does not change."""
    return lambda _: value


def ramp(low: float, high: float, period: float) -> Waveform:
    """Rises from `low` to `high` in each period, in seconds, and drops back to `low` at once."""
    return lambda time: low + (high - low) * (time / period % 1)


def sine(low: float, high: float, period: float) -> Waveform:
    """Swings between `low` and `high`, starting upwards from the middle."""
    return lambda time: (low + high) / 2 + (high - low) / 2 * sin(2 * pi * time / period)


def square(low: float, high: float, period: float) -> Waveform:
    """`low` for the first half of each period, `high` for the second."""
    return lambda time: low if time / period % 1 < 0.5 else high


def steps(values: Sequence[float], every: float) -> Waveform:
    """One value after the other, each for `every` seconds, then from the beginning."""
    return lambda time: values[int(time / every) % len(values)]


def walk(start: float, step: float, every: float, seed: int = 1, low: float = -inf, high: float = inf) -> Waveform:
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


def _number(node: yaml.Node, problems: Problems) -> float:
    text = scalar(node, problems)
    whole = parse_number(text)
    try:
        number = whole.value if whole and not whole.relative else float(text)
    except ValueError:
        refuse(node, problems, f"expected a number, found {str(text)!r}")
    if not isfinite(number):  # float() accepts `nan` and `inf` as well
        refuse(node, problems, f"expected a number, found {str(text)!r}")
    return number


def _duration(node: yaml.Node, problems: Problems) -> float:
    text = scalar(node, problems)
    try:
        seconds = durations.seconds(text)
    except durations.DurationError as error:
        refuse(node, problems, str(error))
    if not seconds:
        refuse(node, problems, "expected a time longer than 0")
    return seconds


_BETWEEN: Mapping[str, NodeReader[float]] = {"low": _number, "high": _number, "period": _duration}

_WAVEFORMS: Mapping[str, NodeReader[Waveform]] = {
    "ramp": record(ramp, _BETWEEN, {}),
    "sine": record(sine, _BETWEEN, {}),
    "square": record(square, _BETWEEN, {}),
    "steps": record(
        steps,
        {
            "values": lambda node, problems: (
                listing(_number)(node, problems) or refuse(node, problems, "expected at least one value")
            ),
            "every": _duration,
        },
        {},
    ),
    "walk": record(
        walk,
        {"start": _number, "step": _number, "every": _duration},
        {"seed": _number, "low": _number, "high": _number},
    ),
}
"""The reader of each waveform, by its name in the file."""


def _waveform(node: yaml.Node, problems: Problems) -> Waveform:
    if isinstance(node, yaml.ScalarNode):
        return constant(_number(node, problems))
    pairs = pairs_of(node, problems)
    if len(pairs) != 1 or not pairs.keys() <= _WAVEFORMS.keys():
        refuse(node, problems, f"expected a number or one of {', '.join(_WAVEFORMS)}, found {', '.join(pairs)}")
    ((name, shape),) = pairs.items()
    return _WAVEFORMS[name](shape, problems)


def read_waveforms(text: str, file: str) -> Mapping[str, Waveform]:
    """Read the waveforms of a YAML text by the names of their objects; `file` is its name in errors.

    Raises LocalError with the line of the first fault.
    """

    def named(node: yaml.Node, problems: Problems) -> Mapping[str, Waveform]:
        refuse_aliases(node, problems)
        return {str(name): each for name, each in mapping(_waveform, key=scalar)(node, problems).items()}

    problems: Problems = []
    try:
        return read_yaml(text, named, problems)
    except ReadError as error:
        place, what = problems[0]
        raise LocalError(f"{file}, line {place.line}: {what}") from error
