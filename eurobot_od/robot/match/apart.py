"""A match that a core leads in a process of its own; the other nodes, and the world, are in others."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import replace
from math import isnan, nan
from typing import Any

from eurobot_od.bus.live import BITRATE, Live
from eurobot_od.bus.live.event_loop import run
from eurobot_od.errors import WorldError
from eurobot_od.robot.match.observer import Observer
from eurobot_od.robot.match.referee import Referee, Strategy
from eurobot_od.robot.match.summary import FrameCounter, Summary
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.world.remote import RemoteVehicle
from eurobot_od.robot.world.timeline import MatchEvent, Timeline
from eurobot_od.robot.world.world import OURS

NOWHERE = Pose(nan, nan, nan)
"""Where a robot is in a world that cannot be reached."""

LOOKS = 0.1
"""How often to check whether the bus has failed, s."""


class Led:
    """A core that is running on a bus, with the truth about its robot from the world; `show` gets the timeline."""

    def __init__(self, live: Live, core: Core, vehicle: RemoteVehicle, show: Callable[[MatchEvent], None]) -> None:
        begin = live.clock()
        self._live, self._core, self._vehicle = live, core, vehicle
        self._points: dict[str, int] = {}
        self._timeline = Timeline(lambda: live.clock() - begin, show)

    def play(self, options: MatchOptions, strategy: Strategy, counter: FrameCounter) -> Summary:
        """Play a match from the node checks to its end.

        `counter` counts the frames. An arrival at which the world did not answer has no position error. Raises
        BusError, NoAnswer.
        """
        observer = Observer(self._core, self._timeline, self._truth)
        referee = Referee(self._core, options, self._timeline, self._truth)
        run(_as_long_as_it_runs(self._live, referee.play(strategy)))
        self._truth()  # the points at the end, unless the world has gone
        errors = [error for error in observer.errors if not isnan(error)]
        summary = counter.summary(self._timeline.clock(), BITRATE)
        return replace(summary, errors=errors, points=self._points, failure=referee.failure)

    def _truth(self) -> Pose:
        try:
            truth = self._vehicle.truth()
        except WorldError:
            return NOWHERE
        self._points = {OURS: truth.points}
        return truth.pose


async def _as_long_as_it_runs(live: Live, playing: Coroutine[Any, Any, None]) -> None:
    """Await a match, and give it up when the bus fails."""
    task = asyncio.ensure_future(playing)
    while not task.done() and live.failure is None:
        await asyncio.wait([task], timeout=LOOKS)
    if live.failure is not None:
        # The strategy's `finally` may still await something, so it is waited for before the failure comes out.
        task.cancel()
        await asyncio.wait([task])
        raise live.failure
    task.result()
