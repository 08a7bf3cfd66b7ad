"""Compares a simulated bus with the analysis: no message may be later than its computed bound.

For each set of messages, the robot's own and random ones, two things are done. *Critical instants*: for each message in
turn, the longest less urgent frame begins; just after it the other less urgent messages of the same node fall due, the
least urgent first, which fill its mailboxes; then all that are as urgent, and the message last. *Random phases*: each
message begins at a random time, and is late by a random part of its jitter. The frames have the data with the most
stuff bits that was found. Reported are the response times over their bound, of which there must be none, and how near
to their bounds the longest come: the nearest of each set shows how tight the analysis is.

The exit status is 0 if every set keeps its bounds and is tight enough, else 1.
"""

from __future__ import annotations

import argparse
import heapq
import math
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from itertools import product
from pathlib import Path
from random import Random
from statistics import median
from typing import NamedTuple

from eurobot_od.bus import frame_bits
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.cli.load import of_robot
from eurobot_od.controller import Reporter
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.plugin import ROBOT
from eurobot_od.traffic.load import MICROSECONDS, MessageSet, PeriodicMessage, analysed

FINE, WRONG = 0, 1

TIGHT = 0.8
"""The nearest response time of a set has to be at least this share of its bound."""

SETS, FRAMES = 200, 100_000
MOST_MESSAGES = 80
BIT_RATES = (125_000, 250_000, 500_000, 1_000_000)
PERIODS = (5_000, 10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000)
"""Periods of random messages, in us, before they are stretched to the wanted load."""

STEP = 1e-8
"""Time between two messages that fall due at a critical instant, in s: far less than a bit time."""

ROUNDING = 1e-3
"""Bit times that simulated times may be off, since they are binary fractions of a second."""

PAUSE = 0.01
"""Time of an idle bus before a critical instant, in s."""

EDS = b"[1000]\nParameterName=Device type\nDataType=0x0007\nAccessType=ro\nDefaultValue=0\n"
"""The smallest EDS of a device."""


class Due(NamedTuple):
    """An instance of a message, by its place in the set: when it is released, and when it fell due."""

    release: float
    place: int
    due: float


class Sender(Node):
    """A node that only puts frames into its mailboxes when they are released."""

    def __init__(self, mailboxes: int, frames: Sequence[Frame], released: Callable[[Due], object]) -> None:
        super().__init__(_dictionary())
        self._mailboxes = mailboxes
        self._frames = frames
        self._released = released
        self.dues: list[Due] = []

    def controller(self, report: Reporter | None, clock: Callable[[], float]) -> Gatekeeper:
        # no frame is dropped because it waits too long
        protocol = self.device.protocol
        return Gatekeeper(protocol, mailboxes=self._mailboxes, mailbox_wait=math.inf, report=report, clock=clock)

    @property
    def next_wakeup(self) -> float:
        return self.dues[0].release if self.dues else math.inf

    def start(self, now: float) -> list[Frame]:
        return []

    def tick(self, now: float) -> list[Frame]:
        frames = []
        while self.dues and self.dues[0].release <= now:
            each = heapq.heappop(self.dues)
            self._released(each)
            frames.append(self._frames[each.place])
        return frames


@cache
def _dictionary() -> Dictionary:
    return Dictionary.read(EDS, Path("sender.eds"), 1)


class Bench:
    """A set of messages on a simulated bus; `longest` are the longest response times so far, in bit times."""

    def __init__(self, messages: MessageSet, bit_rate: int, random: Random) -> None:
        self.messages = messages.messages
        self.bit_rate = bit_rate
        self.random = random
        self.network = Simulation(bit_rate)
        self.network.disturb = lambda _now, _frame: ()  # nobody listens
        self.network.observers.append(self._sent)
        self.longest = [0.0] * len(self.messages)
        self.frames = 0
        self._data = [worst_frame(each.identifier, each.length) for each in self.messages]
        self._pending: dict[int, deque[Due]] = {n: deque() for n in range(len(self.messages))}
        self._places: dict[int, list[int]] = {}
        self._answers: dict[str, list[int]] = {}
        for place, each in enumerate(self.messages):
            self._places.setdefault(each.identifier, []).append(place)
            if each.answers:
                self._answers.setdefault(each.answers, []).append(place)
        most = len(self.messages) * 4
        self.nodes = {
            node: Sender(messages.mailboxes.get(node, most), self._data, self._released)
            for node in {each.node for each in self.messages}
        }
        for node in self.nodes.values():
            self.network.attach(node)
        self.network.run(PAUSE)

    def _released(self, each: Due) -> None:
        self._pending[each.place].append(each)

    def _sent(self, now: float, frame: Frame) -> None:
        self.frames += 1
        for place in self._places[frame.cob_id]:  # two senders of one frame may have sent it at once
            if self._pending[place]:
                due = self._pending[place].popleft().due
                self.longest[place] = max(self.longest[place], (now - due) * self.bit_rate)
                for answer in self._answers.get(self.messages[place].name, ()):
                    self.release(answer, now + self._lateness(answer), due)

    def _lateness(self, place: int) -> float:
        return self.random.random() * self.messages[place].jitter / MICROSECONDS

    def release(self, place: int, at: float, due: float) -> None:
        """Plan an instance of a message for the time `at`; it fell due at `due`."""
        node = self.nodes[self.messages[place].node]
        heapq.heappush(node.dues, Due(at, place, due))
        node.device.plan.at(at)

    def drain(self) -> None:
        """Run until all is sent."""
        while self.network.next_event < math.inf:
            self.network.advance(math.inf)

    # What is done to the messages

    def random_phases(self, frames: int) -> None:
        """Send a number of frames, each message from a random time on."""
        begin = self.network.now + PAUSE
        own = [(place, each) for place, each in enumerate(self.messages) if not each.answers]
        rate = sum(MICROSECONDS / each.period for each in self.messages)
        phases = {place: self.random.random() * each.period / MICROSECONDS for place, each in own}
        span = frames / rate
        done = 0.0
        while done < span:  # a second at a time: the plans stay short
            until = min(done + 1.0, span)
            for place, each in own:
                period = each.period / MICROSECONDS
                while phases[place] < until:
                    due = begin + phases[place]
                    self.release(place, due + self._lateness(place), due)
                    phases[place] += period
            self.network.run(begin + until)
            done = until
        self.drain()

    def critical_instant(self, target: int, span: float) -> None:
        """Release a message when it has to wait the longest, and all others as often as they may come."""
        begin = self.network.now + PAUSE
        message = self.messages[target]
        less = [n for n, each in enumerate(self.messages) if n > target and each.identifier != message.identifier]
        if less:
            blocking = max(less, key=lambda n: frame_bits(self._data[n]))
            self.release(blocking, begin, begin)
            ours = [n for n in reversed(less) if self.messages[n].node == message.node and n != blocking]
            for order, place in enumerate(ours):
                at = begin + STEP * (1 + order / len(ours))
                self.release(place, at, at)
        for place, each in enumerate(self.messages[: target + 1]):
            if not each.answers or place == target:
                self._as_often_as_can_be(place, begin + (3 if place == target else 2) * STEP, begin + span)
        self.drain()

    def _as_often_as_can_be(self, place: int, begin: float, until: float) -> None:
        """Release a message as late as it can be, and from then on as early as it can be."""
        each = self.messages[place]
        jitter, period = (0 if each.answers else each.jitter) / MICROSECONDS, each.period / MICROSECONDS
        due = begin - jitter
        while due < until:
            self.release(place, max(due, begin), due)
            due += period


# Frames with many stuff bits

RUNS = tuple((0x0F0F0F0F0F0F0F0F0F0F << shift >> 16 & (1 << 64) - 1).to_bytes(8, "big") for shift in range(8))
"""Runs of four equal bits, at each phase: after a stuff bit, four more of the other kind make the next one necessary.
"""


@cache
def worst_frame(identifier: int, length: int) -> Frame:
    """Return the frame with the most stuff bits among candidates that should have many."""
    frames = (Frame(identifier, data[:length]) for data in _candidates(identifier, length))
    return max(frames, key=frame_bits)


def _candidates(identifier: int, length: int) -> Iterator[bytes]:
    random = Random(f"{identifier} {length}")
    for run in (*RUNS, bytes(8), bytes([0xFF]) * 8):
        yield run
        for _ in range(8):  # the CRC is behind the data, and changes with every bit of it
            yield run[: max(length - 1, 0)] + random.randbytes(1)
    for first, rest in product((0x00, 0x1F, 0x07, 0x83), RUNS):
        yield bytes([first]) + rest[:7]


# Sets


def random_set(random: Random) -> tuple[MessageSet, int]:
    """Make a set of up to 80 messages, and a bit rate at which it fills 20 to 85 % of the bus."""
    bit_rate = random.choice(BIT_RATES)
    number = random.randint(3, MOST_MESSAGES)
    nodes = [f"node {n}" for n in range(random.randint(1, 8))]
    mailboxes = {node: random.choice((2, 3, 4)) for node in nodes if random.random() < 0.3}
    identifiers = sorted(random.sample(range(0x800), number))
    messages = [_random_message(f"message {n}", identifier, random, nodes) for n, identifier in enumerate(identifiers)]
    load = sum(each.bits * MICROSECONDS / each.period for each in messages) / bit_rate
    stretch = load / random.uniform(0.2, 0.85)
    stretched = [_stretched(each, stretch, random) for each in messages]
    return MessageSet(tuple(stretched), mailboxes, bit_rate=bit_rate), bit_rate


def _random_message(name: str, identifier: int, random: Random, nodes: Sequence[str]) -> PeriodicMessage:
    period = random.choice(PERIODS)
    return PeriodicMessage.of(name, identifier, random.randint(0, 8), random.choice(nodes)).every(period)


def _stretched(message: PeriodicMessage, stretch: float, random: Random) -> PeriodicMessage:
    period = max(math.ceil(message.period * stretch), 200)
    jitter = int(random.choice((0.0, 0.0, 0.2)) * random.random() * period)
    return message._replace(period=period, deadline=period, jitter=jitter)


# The comparison


class Outcome(NamedTuple):
    """The result of a set: frames sent, response times over their bound, and how near the nearest was to its bound.

    `nearest` is None if no message has a bound. Where mailboxes are limited the bounds are `loose`: their worst case
    needs more than this simulation brings together, so that the nearest is reported and not judged.
    """

    name: str
    frames: int
    over: tuple[str, ...]
    nearest: float | None
    unbounded: int
    loose: bool


def crosscheck(name: str, messages: MessageSet, bit_rate: int, frames: int) -> Outcome:
    """Simulate a set and compare it with its bounds."""
    random = Random(f"crosscheck {name}")
    bounds = analysed(messages, bit_rate).bounds
    bench = Bench(messages, bit_rate, random)
    for target, bound in enumerate(bounds):
        if bound.busy is not None:
            bench.critical_instant(target, bound.busy / bit_rate)
    bench.random_phases(max(frames - bench.frames, 0))
    seen = [
        (message.name, longest, bound.response)
        for message, longest, bound in zip(messages.messages, bench.longest, bounds)
        if bound.response is not None
    ]
    over = tuple(
        f"{name}: {m}: {longest:.1f} of {bound} bits" for m, longest, bound in seen if longest > bound + ROUNDING
    )
    nearest = max((longest / bound for _, longest, bound in seen), default=None)
    return Outcome(name, bench.frames, over, nearest, len(bounds) - len(seen), bool(messages.mailboxes))


def attempt(number: int, frames: int) -> Outcome:
    """Check a set by its number: the robot's own at each bit rate, and then random ones."""
    if number < len(BIT_RATES):
        name = f"robot at {BIT_RATES[number] // 1000}"
        messages = of_robot(ROBOT)
        bit_rate = BIT_RATES[number]
    else:
        name = f"set {number}"
        (messages, bit_rate) = random_set(Random(f"set {number}"))
    return crosscheck(name, messages, bit_rate, frames)


def wrong(outcome: Outcome) -> bool:
    """Return whether a set breaks a bound, or its bounds are not tight."""
    return bool(outcome.over) or (not outcome.loose and outcome.nearest is not None and outcome.nearest < TIGHT)


def summary(outcomes: Iterable[Outcome]) -> str:
    """Return the result of all sets in one line."""
    all_of_them = list(outcomes)
    near = [each.nearest for each in all_of_them if each.nearest is not None]
    return (
        f"{sum(each.frames for each in all_of_them)} frames of {len(all_of_them)} sets: "
        f"{sum(len(each.over) for each in all_of_them)} response times over their bound; the nearest of a set is "
        f"{min(near):.0%} to {max(near):.0%} of its bound, half of them over {median(near):.0%}; "
        f"{sum(each.unbounded for each in all_of_them)} messages without a bound"
    )


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    command = argparse.ArgumentParser(description="Compare response times on the simulated bus with their bounds.")
    command.add_argument("--frames", type=int, default=FRAMES, metavar="N", help="in all sets (default: %(default)s)")
    command.add_argument("--sets", type=int, default=SETS, metavar="N", help="random sets (default: %(default)s)")
    command.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (default: %(default)s)")
    return command


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the sets, and print what is wrong and the figures."""
    options = parser().parse_args(arguments)
    began = time.perf_counter()
    numbers = range(len(BIT_RATES) + options.sets)
    frames = options.frames // len(numbers)
    with ProcessPoolExecutor(options.jobs) as pool:
        outcomes = list(pool.map(partial(attempt, frames=frames), numbers))
    for each in outcomes:
        if wrong(each):
            print(*each.over, f"{each.name}: the nearest is {each.nearest} of its bound", sep="\n")
    print(f"{summary(outcomes)}; {time.perf_counter() - began:.0f} s")
    return WRONG if any(map(wrong, outcomes)) else FINE


if __name__ == "__main__":
    sys.exit(main())
