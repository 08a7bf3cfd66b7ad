"""`world` runs the world that simulated nodes of other processes share."""

from __future__ import annotations

import asyncio
import json
import secrets
import signal
import time
from collections.abc import Sequence
from contextlib import suppress
from math import inf
from typing import Annotated, Any

from eurobot_od.cli import RobotName
from eurobot_od.cli.devices import Dialect
from eurobot_od.cli.options import Json, Seconds, assigned
from eurobot_od.cli.signature import Option
from eurobot_od.robot.commands import Sides, WorldErrors
from eurobot_od.robot.match import MatchEvent
from eurobot_od.robot.model.options import Errors, MatchOptions, WorldAddress, facts_given
from eurobot_od.robot.model.values import OURS
from eurobot_od.robot.world import World
from eurobot_od.robot.world.server import Channel, Server
from eurobot_od.web.access import is_local

HERE = WorldAddress.parse("127.0.0.1:2014")
"""Default address, which only this machine can reach."""

TOKEN_BYTES = 12
"""Number of random bytes of a token."""

IN_WORDS = (
    "\n{seconds:.1f} s: {points} points; {touches} touches of our robot, in {at_fault} of them it drove into the "
    "other; {requests} requests, {refused} of them refused"
)
"""The summary as text."""


def world(
    *,
    listen: Annotated[WorldAddress, Option(metavar="[TOKEN@]HOST:PORT", read=WorldAddress.parse)] = HERE,
    sides: Sides,
    seed: int = 1,
    errors: WorldErrors = (),
    facts: Annotated[Sequence[tuple[str, str]], Option("--set"), assigned("FACT=VALUE")] = (),
    duration: Annotated[Seconds | None, Option("--for")] = None,
    as_json: Json = False,
    dialect: Dialect = None,
    robot_name: RobotName = None,
) -> None:
    """Run the world that the simulated nodes of other processes share: the truth that their wheels and beacons meet.

    It goes on until the time is over or somebody ends it; raises LocalError, WorldError.

    listen: where to (default: 127.0.0.1:2014); beyond this machine requests need the token, a new one unless it is
        given
    seed: seed of all chance, the instruments' too (default: 1)
    errors: an error of the instruments, such as beacon_dropouts=0.1; repeatable
    facts: fact in place of robot.yaml's, such as body.radius=250; repeatable
    duration: end after this time, such as 90 s
    as_json: print as JSON, a line for each event and the summary

    $ world --listen 127.0.0.1:2014
    """
    options = MatchOptions(
        **vars(sides),
        seed=seed,
        dialect=dialect,
        errors=Errors().changed_by(errors),
        settings=tuple(facts_given(facts)),
        robot=robot_name,
    )
    begin = time.monotonic()
    # Monotonic, as setting a clock would move the robots.
    truth = World(options, lambda: time.monotonic() - begin)
    where = listen
    # Any address but 127.0.0.1 can be reached from the network.
    if not where.token and not is_local(where.address.host):
        where = where._replace(token=secrets.token_hex(TOKEN_BYTES))
    channel = Channel(truth, options, where.token)

    def show(event: MatchEvent) -> None:
        print(json.dumps(event.as_data()) if as_json else event, flush=True)

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # acts as Ctrl-C
    with suppress(KeyboardInterrupt):  # the usual way to end it
        asyncio.run(Server(truth, channel, show).serve(where, inf if duration is None else duration))
    summary = _summary(truth, channel)
    print(json.dumps({"summary": summary}) if as_json else IN_WORDS.format(**summary))


def _summary(world: World, channel: Channel) -> dict[str, Any]:
    touches = [touch for touch in world.touches if OURS in (touch.robot, touch.thing)]
    return {
        "seconds": round(world.clock(), 3),
        "points": world.game.points(OURS),
        "touches": len(touches),
        "at_fault": sum(touch.is_fault_of(OURS) for touch in touches),
        "requests": channel.requests,
        "refused": channel.refused,
    }
