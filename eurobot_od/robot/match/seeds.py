"""Plays a match for each of many seeds, on as many processes as are wanted.

Rule of this file: matches are given in the order of their seeds, and are the same on any number of processes; each
process reads the EDS files and the strategies once.

Each process gets one seed at a time, as matches differ in length, over a pipe of its own. The pools of the standard
library would do, but for one thing: their processes wait for work for ever when the parent was killed. Ours wait for
the parent's end as well (see `_work`).
"""

from __future__ import annotations

import os
import signal
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from multiprocessing import Pipe, Process, parent_process
from multiprocessing.connection import Connection, wait
from typing import cast

from eurobot_od.robot.match.played import PlayedMatch, play
from eurobot_od.robot.match.stage import EdsFiles, Performance
from eurobot_od.robot.match.strategies import StrategyFiles
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.world import World


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


SHIPPED = StrategyFiles()


def play_many(
    options: MatchOptions, seeds: range, jobs: int, strategies: StrategyFiles = SHIPPED
) -> Generator[PlayedMatch, None, None]:
    """Play a match for each seed on `jobs` processes, 1: in this one. Closing the iterator ends the processes.

    Raises UnknownName, DictionaryError, LocalError before anything is played, ChildProcessError if a process dies.
    """
    files, players = EdsFiles.read(options.dialect), strategies.load()
    Performance(options, files, World(options, lambda: 0.0))  # complains here, once
    if jobs == 1 or len(seeds) == 1:
        return (play(replace(options, seed=seed), files, players) for seed in seeds)
    return _spread(options, seeds, min(jobs, len(seeds)), strategies)


# Processes


def _spread(
    options: MatchOptions, seeds: range, jobs: int, strategies: StrategyFiles
) -> Generator[PlayedMatch, None, None]:
    """Play on several processes, and hold back a match that is over before its turn."""
    early: dict[int, PlayedMatch] = {}
    turn = seeds.start
    with ExitStack() as stack:
        workers = [stack.enter_context(_worker(options, strategies)) for _ in range(jobs)]
        try:
            for match in _hand_out(workers, iter(seeds)):
                early[match.seed] = match
                while turn in early:
                    yield early.pop(turn)
                    turn += 1
        except (EOFError, ConnectionError):
            raise ChildProcessError("a process that played matches has died") from None


def _hand_out(workers: list[Connection], seeds: Iterator[int]) -> Iterator[PlayedMatch]:
    """Give each worker a seed, and another one whenever it has played one; no more workers than seeds."""
    for worker, seed in zip(workers, seeds):
        worker.send(seed)
    busy = list(workers)
    while busy:
        for worker in cast(list[Connection], wait(busy)):
            match: PlayedMatch = worker.recv()
            if (following := next(seeds, None)) is None:
                busy.remove(worker)
            else:
                worker.send(following)
            yield match


@contextmanager
def _worker(options: MatchOptions, strategies: StrategyFiles) -> Iterator[Connection]:
    """Start a process, and give our end of the line to it: seeds go in, matches come out."""
    ours, theirs = Pipe()
    process = Process(target=_work, args=(theirs, options, strategies), daemon=True)
    process.start()
    theirs.close()  # so that the line ends when the process does
    try:
        yield ours
    finally:
        process.terminate()
        process.join()
        ours.close()


def _work(line: Connection, options: MatchOptions, strategies: StrategyFiles) -> None:
    """Play the seeds that come over the line, as long as the parent lives."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the parent ends the others
    files, players, parent = EdsFiles.read(options.dialect), strategies.load(), parent_process()
    while parent and line in wait([line, parent.sentinel]):
        line.send(play(replace(options, seed=line.recv()), files, players))
