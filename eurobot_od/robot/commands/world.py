"""Run the world that the simulated nodes of other processes share: the truth that their wheels and beacons meet."""

from __future__ import annotations

import argparse
import asyncio
import json
import secrets
import signal
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from eurobot_od.cli import options as shared
from eurobot_od.robot.commands.common import add_sides, options_of
from eurobot_od.support import durations

if TYPE_CHECKING:
    from eurobot_od.robot.match import MatchEvent
    from eurobot_od.robot.world import World
    from eurobot_od.robot.world.channel import Channel, WorldAddress

HERE = "127.0.0.1:2014"
"""Where it listens by default: only this machine reaches it."""

TOKEN_BYTES = 12
"""Of chance in a token: too many to be guessed over a network."""

IN_WORDS = (
    "\n{seconds:.1f} s: {points} points; {touches} touches of our robot, in {at_fault} of them it drove into the "
    "other; {requests} requests, {refused} of them refused"
)
"""The summary, as a person reads it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument(
        "--listen",
        type=world_address,
        default=HERE,
        metavar="[TOKEN@]HOST:PORT",
        help=f"where to (default: {HERE}); beyond this machine requests need the token, a new one unless it is given",
    )
    add_sides(parser)
    parser.add_argument("--seed", type=int, default=1, help="seed of all chance, the instruments' too (default: 1)")
    parser.add_argument(
        "--world",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="an error of the instruments, such as beacon_dropouts=0.1; repeatable",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="FACT=VALUE",
        help="fact in place of robot.yaml's, such as body.radius=250; repeatable",
    )
    parser.add_argument("--duration", type=durations.seconds, metavar="TIME", help="end after this time, such as 90 s")
    parser.add_argument("--json", action="store_true", help="print as JSON, a line for each event and the summary")
    shared.add_dialect(parser)


def run(arguments: argparse.Namespace) -> None:
    """Serve until the time is over or somebody ends it; raises LocalError, WorldError."""
    from eurobot_od.robot.model.options import facts_given
    from eurobot_od.robot.world import World
    from eurobot_od.robot.world.channel import Channel
    from eurobot_od.robot.world.server import Server
    from eurobot_od.robot.world.world import OURS
    from eurobot_od.web.access import is_local

    options = options_of(arguments, facts_given(shared.assignments("--set", "FACT=VALUE", arguments.set)))
    begin = time.monotonic()
    # Monotonic: a clock that is set while the match runs would move the robots.
    world = World(options, lambda: time.monotonic() - begin)
    where = arguments.listen
    # 127.0.0.1 is reached only by programs of this machine; any other address by the whole network.
    if not where.token and not is_local(where.address.host):
        where = where._replace(token=secrets.token_hex(TOKEN_BYTES))
    channel = Channel(world, {OURS: options}, where.token)

    def show(event: MatchEvent) -> None:
        print(json.dumps(event.as_data()) if arguments.json else event, flush=True)

    duration = float("inf") if arguments.duration is None else arguments.duration
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
    with suppress(KeyboardInterrupt):  # not an error: a server ends in no other way
        asyncio.run(Server(world, channel, show).serve(where, duration))
    summary = _summary(world, channel)
    print(json.dumps({"summary": summary}) if arguments.json else IN_WORDS.format(**summary))


def world_address(text: str) -> WorldAddress:
    """Read [TOKEN@]HOST:PORT for argparse."""
    from eurobot_od.robot.world.channel import WorldAddress

    return shared.argument_of(WorldAddress.parse)(text)


def _summary(world: World, channel: Channel) -> dict[str, Any]:
    from eurobot_od.robot.world.world import OURS

    touches = [touch for touch in world.touches if OURS in (touch.robot, touch.thing)]
    return {
        "seconds": round(world.clock(), 3),
        "points": world.game.points(OURS),
        "touches": len(touches),
        "at_fault": sum(touch.is_fault_of(OURS) for touch in touches),
        "requests": channel.requests,
        "refused": channel.refused,
    }
