"""Measures what the codec costs for fields in slices, against the same fields in one piece.

Rule of this file: both dialects turn by turn in one process, the same messages; the ratio of the minima counts, as
noise only ever adds time.
"""

from __future__ import annotations

import argparse
import timeit
from collections.abc import Callable, Sequence

from eurobot_od import dialects
from eurobot_od.messages import GotoXY, Message, StartConfigurationSet
from eurobot_od.protocol import Protocol
from eurobot_od.values import Barriers, TeamColour

MESSAGES: tuple[Message, ...] = (
    GotoXY(1234, 567, 89, 75, Barriers(0xA5C3)),
    StartConfigurationSet(TeamColour.RED, 2, 1, 45, 33),
)
CALLS = 20_000
"""Calls in one measurement."""


def tasks(protocol: Protocol, message: Message) -> dict[str, Callable[[], object]]:
    """Give what is measured for one message."""
    frame = protocol.encode(message)
    name, values = protocol.unpack(*frame)
    return {
        "decode": lambda: protocol.decode(*frame),
        "encode": lambda: protocol.encode(message),
        "unpack": lambda: protocol.unpack(*frame),
        "pack": lambda: protocol.pack(name, **values),
    }


def minima(rounds: int, turns: Sequence[Callable[[], object]]) -> list[float]:
    """Measure the functions in turn and return the shortest time of a call of each, in microseconds."""
    times = [[timeit.timeit(turn, number=CALLS) for turn in turns] for _ in range(rounds)]
    return [min(column) / CALLS * 1e6 for column in zip(*times)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for each message and task."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=7, metavar="N", help="turns of each (default: 7)")
    options = parser.parse_args(arguments)
    names = dialects.names()
    protocols = [Protocol.load(name) for name in names]
    print(f"{'message':<25} {'task':<8}" + "".join(f"{name:>14}" for name in names) + "   ratio to the first")
    for message in MESSAGES:
        for task in tasks(protocols[0], message):
            best = minima(options.rounds, [tasks(protocol, message)[task] for protocol in protocols])
            times = "".join(f"{each:>11.2f} us" for each in best)
            ratios = " ".join(f"{each / best[0]:.2f}" for each in best[1:])
            print(f"{type(message).__name__:<25} {task:<8}{times}   {ratios}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
