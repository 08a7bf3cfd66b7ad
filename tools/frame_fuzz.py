"""Sends random and mutated frames to the three nodes in simulated time, and checks that they still do their work.

A trial is a row of frames, one after the other, to all nodes of a dialect while these start up, drive and are asked.
There are two kinds of trials:

- *meaningless*: frames on which no node may act, such as one that is too short, has a value out of range, or is for
another node. Meanwhile each message and heartbeat of the nodes has to be the same, at the same time, as without them.
- *any*: frames of all kinds: gotos and stops, SDO requests, NMT commands, damaged frames. Nothing may raise or pile up;
and after an NMT reset the nodes have to send what new ones send.

SDO answers and EMCY messages are not compared, since a node may report an unexpected frame. A trial follows from the
seed and its number alone; `--first` and `--trials` repeat one.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from functools import cache, partial
from itertools import zip_longest
from math import inf
from typing import NamedTuple

from sdo_fuzz import IDLE, RandomClient, address_in

from eurobot_od.controller import Event, Report
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.station import Station
from eurobot_od.errors import LocalError
from eurobot_od.frame import HIGHEST_IDENTIFIER, MOST_BYTES, Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NMT_COB_ID, Address, PdoDirection
from eurobot_od.robot import dialects
from eurobot_od.robot.model.values import Obstacle, TeamColour
from eurobot_od.robot.nodes import ROLES, Core, Node
from eurobot_od.robot.protocol import EurobotProtocol

FINE, WRONG = 0, 1

FRAMES = 20_000
"""Frames of a trial."""

PERIOD = 0.0005
"""Time between two frames, in s."""

PAUSE = 2.0
"""Time between two resets, in which a robot comes to a stop, in s."""

RESET = Frame(NMT_COB_ID, bytes([NmtCommand.RESET_NODE, 0]))

PLAN: tuple[tuple[float, Callable[[Core], object]], ...] = (
    (0.1, Core.check_nodes),
    (0.3, lambda core: core.configure_start(TeamColour.RED, 2, 1, 30, 20)),
    (1.0, lambda core: core.goto(900, 1500, 30, 40)),
    (3.5, Core.position),
    (4.0, Core.stop),
    (5.0, lambda core: core.goto(1500, 1000, 90, 80)),
    (7.0, lambda core: core.emergency_stop(Obstacle.ENEMY)),
    (7.5, lambda core: core.goto(600, 1600, 0, 60)),
)
"""The calls of the core, and when each is made, in seconds since the nodes were switched on."""

FAILURES = {Event.LISTENER_FAILED, Event.NODE_FAILED}


class Sent(NamedTuple):
    """A frame, and when a node has sent it, in seconds."""

    time: float
    frame: Frame


class FuzzedNodes:
    """The nodes of a dialect at their gatekeepers, on a bus that takes no time; `sent` are their frames with times.

    `wrong` are the reports of failures, and the frames that are not valid.
    """

    def __init__(self, dialect: str) -> None:
        self.now = 0.0
        self.sent: list[Sent] = []
        self.wrong: list[str] = []
        self._calls: deque[tuple[float, Callable[[Core], object]]] = deque()
        self._stations = [self._station(role(files(dialect)[name])) for name, role in ROLES.items()]
        for station in self._stations:
            station.start(0.0)
        self._carry()
        self.begin()

    def begin(self) -> None:
        """Plan the calls of the core from now on."""
        self._calls = deque((self.now + after, call) for after, call in PLAN)

    def _station(self, node: Node) -> Station:
        station = Station(node, report=self._note, clock=lambda: self.now)
        station.controller.start()
        node.wake = partial(station.plan.at, -inf)
        return station

    def _note(self, report: Report) -> None:
        if report.event in FAILURES:
            self.wrong.append(f"{self.now:.4f} s: {report}")

    @property
    def core(self) -> Core:
        core = self._stations[0].node
        assert isinstance(core, Core)
        return core

    def receive(self, frame: Frame, *, to_its_sender: bool = True) -> None:
        """Pass a frame from outside to all nodes, or to all but the one that sends messages with its COB-ID.

        That one takes the frame for one of a second node of its kind, and acts on it.
        """
        for station in self._stations:
            if to_its_sender or frame.cob_id not in sent_by(station.node.device.dictionary):
                station.controller.receive(frame, self.now)
        self._carry()

    def run(self, until: float) -> None:
        """Advance the time."""
        while (soonest := self._soonest()) <= until:
            self.now = max(self.now, soonest)
            while self._calls and self._calls[0][0] <= self.now:
                with suppress(LocalError):  # told to the caller: not operational, or shut down
                    self._calls.popleft()[1](self.core)
            for station in self._stations:
                if station.plan.soonest <= self.now:
                    station.tick(self.now)
                    station.next_wakeup  # noqa: B018  (asking sets the plan)
            self._carry()
        self.now = until

    def _soonest(self) -> float:
        call = self._calls[0][0] if self._calls else inf
        return min(call, *(station.plan.soonest for station in self._stations))

    def _carry(self) -> None:
        """Pass the frames of each node to the others, the most urgent first, until there are no more."""
        while frames := [(frame, each) for each in self._stations if (frame := each.controller.queue.next(self.now))]:
            frame, sender = min(frames, key=lambda pair: pair[0].cob_id)
            sender.controller.queue.complete(frame)
            self.sent.append(Sent(self.now, frame))
            if not 0 <= frame.cob_id <= HIGHEST_IDENTIFIER or len(frame.data) > MOST_BYTES:
                self.wrong.append(f"{self.now:.4f} s: sent {frame!r}, which is not a frame")
            for station in self._stations:
                if station is not sender:
                    station.controller.receive(frame, self.now)


@cache
def sent_by(dictionary: Dictionary) -> frozenset[int]:
    """Return the COB-IDs of the messages that a node sends."""
    return frozenset(each.cob_id for each in dictionary.pdos if each.direction is PdoDirection.TPDO)


@cache
def files(dialect: str) -> dict[str, Dictionary]:
    """Return the nodes' dictionaries of a dialect, read once in each process."""
    return {each.name: each for each in dialects.load_all(dialect)}


@cache
def protocol(dialect: str) -> EurobotProtocol:
    """Return the messages of a dialect."""
    return EurobotProtocol.load(dialect)


# What comes from nobody knows whom


class Dice(random.Random):
    """The random numbers of a trial, with its `dialect`, and for each node a client that makes up SDO requests."""

    dialect: str
    clients: dict[str, RandomClient]

    @classmethod
    def of(cls, seed: str, dialect: str) -> Dice:
        """Return the random numbers of a seed."""
        dice = cls(seed)
        dice.dialect = dialect
        dice.clients = {name: RandomClient(dictionary, dice) for name, dictionary in files(dialect).items()}
        return dice


Maker = Callable[[Dice], Frame]


@cache
def identifiers(dialect: str) -> list[int]:
    """Return the identifiers that any of the nodes receives or sends, and that of NMT."""
    nodes = [role(files(dialect)[name]) for name, role in ROLES.items()]
    own = {0x080, 0x580, 0x600, 0x700}
    sent = {base + node.device.node_id for node in nodes for base in own}
    messages = {each.cob_id for each in protocol(dialect).bindings}
    return sorted(sent.union(messages, *(node.device.identifiers for node in nodes)))


@cache
def _strangers(dialect: str) -> list[int]:
    return sorted(set(range(HIGHEST_IDENTIFIER + 1)).difference(identifiers(dialect)))


def for_somebody_else(dice: Dice) -> Frame:
    """Make a frame that no node receives."""
    return Frame(dice.choice(_strangers(dice.dialect)), _bytes(dice))


def too_short(dice: Dice) -> Frame:
    """Make a message that is cut off. A stop acts with any data, and a goto may end after its speed."""
    cob_id, size = dice.choice(_with_data(dice.dialect))
    short = dice.randrange(size)
    return Frame(cob_id, dice.randbytes(short - (cob_id == protocol(dice.dialect).cob_id("Goto XY") and short == 6)))


@cache
def _with_data(dialect: str) -> list[tuple[int, int]]:
    """Return identifier and length of the messages that have data and are not stops."""
    found = ((each.cob_id, each.layout.length) for each in protocol(dialect).bindings if not each.always)
    return [(cob_id, size) for cob_id, size in found if size]


POSITIONS = ("Navi", "Kalman", "Enemy 1", "Enemy 2", "Confederate")


def out_of_range(dice: Dice) -> Frame:
    """Make a message with a value that its field cannot have."""
    name, fields = dice.choice(
        (
            ("Goto XY", {"x": dice.randrange(3001, 4096), "y": 500, "angle": 0, "speed": 50, "barriers": 0}),
            ("Goto XY", {"x": 500, "y": 500, "angle": 0, "speed": dice.randrange(101, 256), "barriers": 0}),
            (f"{dice.choice(POSITIONS)} Position Response", {"x": 500, "y": dice.randrange(2001, 4096), "angle": 0}),
            ("Start Configuration Set", {"team_colour": 1, "enemies": 3, "confederates": 0}),
        )
    )
    messages = protocol(dice.dialect)
    binding = messages.binding(name)
    return Frame(binding.cob_id, messages.pack(name, **dict.fromkeys(binding.layout.fields, 0) | fields))


def no_nmt_command(dice: Dice) -> Frame:
    """Make an NMT message of a wrong length, with an unknown command, or for another node."""
    known = dice.choice(tuple(NmtCommand))
    node_id = dice.randrange(4, 128)
    unknown = dice.choice(sorted(set(range(256)) - set(NmtCommand)))
    return Frame(NMT_COB_ID, dice.choice((bytes([known, node_id]), bytes([unknown, 0]), bytes([known]), b"")))


@cache
def _addresses(dictionary: Dictionary) -> list[Address]:
    return list(dictionary.addresses())


def sdo_reading(dice: Dice) -> Frame:
    """Make an SDO request that changes nothing: one that reads, continues no transfer, aborts, or is cut off."""
    dictionary = dice.choice(list(files(dice.dialect).values()))
    index, subindex = dice.choice(_addresses(dictionary))
    command = dice.choice((0x40, 0x60, 0x70, 0x80, 0xA0, 0xA1, 0xA2, 0xA3, 0xA4, 0xE0))
    data = bytes([command, *index.to_bytes(2, "little"), subindex, *dice.randbytes(4)])
    return Frame(0x600 + dictionary.node_id, data[: dice.choice((8, 8, 8, 7, 1))])


MEANINGLESS: tuple[Maker, ...] = (for_somebody_else, too_short, out_of_range, no_nmt_command, sdo_reading)


def noise(dice: Dice) -> Frame:
    """Make any frame."""
    return Frame(dice.randrange(HIGHEST_IDENTIFIER + 1), _bytes(dice))


def to_a_node(dice: Dice) -> Frame:
    """Make a frame with an identifier that the nodes know, and random data."""
    return Frame(dice.choice(identifiers(dice.dialect)), _bytes(dice))


def mutated(dice: Dice) -> Frame:
    """Make a frame that a node has sent, with some bits changed or unchanged."""
    cob_id, data = dice.choice(healthy(dice.dialect)).frame
    changed = int.from_bytes(data, "little") ^ sum(1 << dice.randrange(64) for _ in range(dice.randrange(3)))
    return Frame(cob_id, changed.to_bytes(9, "little")[: len(data)])


def sdo_request(dice: Dice) -> Frame:
    """Make the first request of an SDO transfer, also one that writes, but no new node-ID, which outlasts a reset."""
    name = dice.choice(tuple(ROLES))
    dictionary = files(dice.dialect)[name]
    request = dice.clients[name].request(IDLE)
    address = address_in(request.ljust(MOST_BYTES, b"\0"))
    return Frame(0x600 + dictionary.node_id, request[:1] if address == dictionary.device.node_id_address else request)


def nmt_command(dice: Dice) -> Frame:
    """Make an NMT command to one of the nodes or to all."""
    return Frame(NMT_COB_ID, bytes([dice.choice(tuple(NmtCommand)), dice.randrange(4)]))


ANY: tuple[Maker, ...] = (*MEANINGLESS, noise, to_a_node, mutated, sdo_request, nmt_command)


def _bytes(dice: Dice) -> bytes:
    return dice.randbytes(dice.randrange(MOST_BYTES + 1))


# Trials


class Trial(NamedTuple):
    """One run: its seed and number, how many frames, and of which kinds; the dialect."""

    seed: int
    number: int
    frames: int = FRAMES

    @property
    def dialect(self) -> str:
        return dialects.names()[self.number // 2 % len(dialects.names())]

    @property
    def meaningless(self) -> bool:
        return self.number % 2 == 0


class Result(NamedTuple):
    """The result of a trial: frames of each kind, frames of the nodes that were compared, and what is wrong."""

    trial: Trial
    made: Counter[str]
    compared: int
    wrong: list[str]


@cache
def healthy(dialect: str, seconds: float = FRAMES * PERIOD, is_reset: bool = False) -> list[Sent]:
    """Return what the nodes send in some seconds, or after a reset, when no other frames come."""
    nodes = FuzzedNodes(dialect)
    nodes.run(seconds)
    if is_reset:
        reset(nodes, seconds)
    return nodes.sent


def reset(nodes: FuzzedNodes, seconds: float) -> None:
    """Reset nodes twice, as a core that is reset in a goto stops first; keep only what they send afterwards."""
    nodes.receive(RESET)
    nodes.run(nodes.now + PAUSE)
    nodes.sent.clear()
    nodes.receive(RESET)
    nodes.begin()
    nodes.run(nodes.now + seconds)


def compared(sent: Sequence[Sent]) -> dict[int, list[tuple[float, str]]]:
    """Return the messages and heartbeats of some frames with their times, by identifier."""
    found: dict[int, list[tuple[float, str]]] = {}
    for time_, frame in sent:
        if frame.cob_id not in NOT_COMPARED:
            found.setdefault(frame.cob_id, []).append((round(time_, 6), str(frame)))
    return found


NOT_COMPARED = {base + each.node_id for base in (0x080, 0x580) for each in dialects.load_all()}
"""EMCY and SDO answers: a node may report an unexpected frame."""


def attempt(trial: Trial) -> Result:
    """Run a trial, in any process."""
    dice = Dice.of(f"{trial.seed} {trial.number}", trial.dialect)
    nodes = FuzzedNodes(trial.dialect)
    seconds = trial.frames * PERIOD
    made = Counter[str]()
    for number in range(trial.frames):
        maker = dice.choice(MEANINGLESS if trial.meaningless else ANY)
        made[maker.__name__] += 1
        nodes.run((number + 1) * PERIOD)
        nodes.receive(maker(dice), to_its_sender=not trial.meaningless)
    if not trial.meaningless:
        reset(nodes, seconds)
    expected = healthy(trial.dialect, seconds, not trial.meaningless)
    return Result(trial, made, len(nodes.sent), [*nodes.wrong, *differences(nodes.sent, expected)])


def differences(sent: Sequence[Sent], expected: Sequence[Sent]) -> list[str]:
    """Return for each identifier where the frames differ from the expected ones."""
    ours, theirs = compared(sent), compared(expected)
    return [
        f"{cob_id:03X}: {first_difference(ours.get(cob_id, []), theirs.get(cob_id, []))}"
        for cob_id in sorted(ours.keys() | theirs.keys())
        if ours.get(cob_id) != theirs.get(cob_id)
    ]


def first_difference(ours: Sequence[object], theirs: Sequence[object]) -> str:
    """Return the first difference of two sequences."""
    for one, other in zip_longest(ours, theirs):
        if one != other:
            return f"{one} where healthy nodes have {other}"
    return "nothing"


# The command line


def parser() -> argparse.ArgumentParser:
    """Describe the command line."""
    command = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    command.add_argument("--frames", type=int, default=1_000_000, help="how many (default: %(default)s)")
    command.add_argument("--seed", type=int, default=1, help="which ones (default: %(default)s)")
    command.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N", help="processes")
    command.add_argument("--first", type=int, default=0, metavar="NUMBER", help="the first trial's (default: 0)")
    return command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the trials; print how many frames of each kind were made, and what is wrong; exit status 1 if anything is."""
    options = parser().parse_args(arguments)
    started = time.perf_counter()
    trials = [Trial(options.seed, options.first + n) for n in range(-(-options.frames // FRAMES))]
    made = Counter[str]()
    sent = 0
    wrong = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for result in pool.map(attempt, trials):
            made += result.made
            sent += result.compared
            wrong += bool(result.wrong)
            print(
                *(f"trial {result.trial.number} ({result.trial.dialect}): {line}" for line in result.wrong),
                sep="\n",
                end="\n" if result.wrong else "",
            )
    print(*(f"{count:9} {name.replace('_', ' ')}" for name, count in sorted(made.items())), sep="\n")
    took = time.perf_counter() - started
    print(
        f"{made.total()} frames in {len(trials)} trials, {sent} frames of the nodes, {wrong} trials wrong, {took:.0f} s"
    )
    return WRONG if wrong else FINE


if __name__ == "__main__":
    sys.exit(main())
